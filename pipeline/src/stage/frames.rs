//! Stage 5, frames: anatomical frames of both bones, and the pose in CT.

use super::layers::bone_layers;
use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::record::json;
use crate::report::geometry::Pool;
use crate::report::picture::{BONE, Picture, picture};
use crate::report::scene::{Layer, Scene, at};
use meshes::frame::AnatomicalFrame;
use meshes::render::{Painted, ball, tube};
use meshes::surface::TriMesh;
use serde_json::json as object;
use stages::StageError;
use stages::bones::Bones;
use stages::frames::{Frames, FramesOptions, frames};
use stages::specimen::Specimen;

reported!(Frames);

/// The stage.
pub(crate) struct AssignFrames;

impl Stage for AssignFrames {
    const NUMBER: &'static str = "05";
    const NAME: &'static str = "frames";
    const TELLING: &'static [&'static str] = &["angle_to_tea_axial_deg", "fe_deg", "vv_deg", "ie_deg"];
    type Inputs<'a> = (&'a Kept<Specimen>, &'a Kept<Bones>);
    type Options = FramesOptions;
    type Value = Frames;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &FramesOptions {
        &all.frames
    }

    fn run((specimen, bones): Self::Inputs<'_>, options: &FramesOptions, _: &Work) -> Result<Frames, StageError> {
        frames(specimen, bones, options)
    }

    /// frames.json.
    fn artifacts(f: &Frames, _: Self::Inputs<'_>) -> Files {
        let value = object!({
            "femur": f.femur,
            "tibia": f.tibia,
            "gs_ct_pose": f.gs_ct_pose,
            "epicondyles": {"medial": f.epicondyles[0], "lateral": f.epicondyles[1]},
            "condylar_axis": {"point": f.condylar_axis.0, "direction": f.condylar_axis.1, "radius_mm": f.condylar_radius_mm,
                              "angle_to_tea_axial_deg": f.condylar_angle_deg},
        });
        Ok(vec![("frames.json".into(), json(&value))])
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let f = v.of::<Frames>()?;
        let mut layers = bone_layers(v, pool, 0.55);
        for (name, frame) in [("femur", &f.femur), ("tibia", &f.tibia)] {
            let ends = |frame: &AnatomicalFrame| {
                [
                    (frame.medial, "medial", "#c8102e"),
                    (frame.anterior, "anterior", "#1a7f37"),
                    (frame.superior, "superior", "#1f4fd8"),
                ]
            };
            for (axis, word, colour) in ends(frame) {
                let tip = frame.origin + axis * 70.0;
                layers.push(Layer {
                    name: format!("{name} {word}"),
                    colour,
                    lines: vec![at(pool, &frame.origin), at(pool, &tip)],
                    opacity: 1.0,
                    on: true,
                    ..Layer::default()
                });
            }
        }
        let (middle, along) = f.condylar_axis;
        layers.push(Layer {
            name: "condylar axis".into(),
            colour: "#7b3fa0",
            lines: vec![at(pool, &(middle - along * 45.0)), at(pool, &(middle + along * 45.0))],
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
        layers.push(Layer {
            name: "epicondyles".into(),
            colour: "#e69f00",
            points: f.epicondyles.iter().map(|p| at(pool, p)).collect(),
            labels: vec!["medial epicondyle".into(), "lateral epicondyle".into()],
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
        let p = &f.gs_ct_pose;
        Some(Scene {
            id: "frames".into(),
            title: "Frames and axes".into(),
            text: format!(
                "Anatomical frames (medial red, anterior green, superior blue), condylar axis (radius {:.1} mm, {:.1} deg from the epicondyles) and epicondyles. Pose in CT: flexion {:.1}, valgus {:.1}, external {:.1} deg; lateral {:.1}, anterior {:.1}, superior {:.1} mm. Red must point to the midline, green forwards, blue to the hip.",
                f.condylar_radius_mm, f.condylar_angle_deg, p.fe_deg, p.vv_deg, p.ie_deg, p.ml_mm, p.ap_mm, p.si_mm
            ),
            from: "front",
            layers,
            moves: false,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        let (bones, frames) = (v.of::<Bones>()?, v.of::<Frames>()?);
        let mut parts: Vec<(TriMesh, [u8; 3])> =
            bones.surfaces.named().map(|(_, mesh)| (mesh.clone(), BONE)).into_iter().collect();
        for frame in [&frames.femur, &frames.tibia] {
            parts.extend(axes_of(frame));
        }
        parts.extend(frames.epicondyles.iter().map(|p| (ball(p, 2.5), [230, 160, 0])));
        let painted: Vec<Painted> =
            parts.iter().map(|(mesh, c)| Painted { mesh, colours: std::slice::from_ref(c) }).collect();
        let f = &frames.femur;
        let words = "medial red, anterior green, superior blue; epicondyles yellow";
        Some(vec![
            picture(&painted, f.anterior, f.superior, format!("Frames from the front: {words}")),
            picture(&painted, -f.superior, f.anterior, format!("Frames from below: {words}")),
        ])
    }
}

fn axes_of(frame: &AnatomicalFrame) -> Vec<(TriMesh, [u8; 3])> {
    [(frame.medial, [210, 30, 30]), (frame.anterior, [30, 160, 30]), (frame.superior, [40, 60, 210])]
        .into_iter()
        .map(|(axis, c)| (tube(&frame.origin, &(frame.origin + axis * 80.0), 1.2), c))
        .collect()
}

//! Stage 2, register: scans laid on their CT bones.

use super::artifacts::surface;
use super::layers::ct_layers;
use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::record::json;
use crate::report::check::{self, Check, KeyFigure};
use crate::report::geometry::{Pool, packed_values, thinned};
use crate::report::picture::{Picture, picture};
use crate::report::scene::{Layer, Scalar, Scene};
use meshes::render::{Painted, colour};
use serde_json::json as object;
use stages::StageError;
use stages::frames::Frames;
use stages::register::{RegisterOptions, Registration, register};
use stages::specimen::Specimen;

reported!(Registration);

/// Edge of the cubes in which corners of scans are drawn together [mm].
const SCAN_MM: f64 = 0.9;

/// The stage.
pub(crate) struct Register;

impl Stage for Register {
    const NUMBER: &'static str = "02";
    const NAME: &'static str = "register";
    const TELLING: &'static [&'static str] = &["predicted_error_mm"];
    const LOOK: Option<&'static str> = Some("Does bare bone of the scans lie on the CT bones?");
    type Inputs<'a> = (&'a Kept<Specimen>,);
    type Options = RegisterOptions;
    type Value = Registration;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &RegisterOptions {
        &all.register
    }

    fn run((specimen,): Self::Inputs<'_>, options: &RegisterOptions, _: &Work) -> Result<Registration, StageError> {
        register(specimen, options)
    }

    /// transforms.json, and each scan on its bone with its distance to it (the residual map).
    fn artifacts(r: &Registration, (s,): Self::Inputs<'_>) -> Files {
        let mut transforms = serde_json::Map::new();
        let mut files = Vec::new();
        let patella = r.patella.as_ref().zip(s.patella.as_ref().and_then(|p| p.scan.as_ref()));
        let bones =
            r.bones.named().into_iter().zip(s.scans.named()).map(|((name, bone), (_, scan))| (name, bone, scan));
        for (name, bone, scan) in bones.chain(patella.map(|(bone, scan)| ("patella", bone, scan))) {
            let matrix = bone.ct_from_scan.motion().to_homogeneous();
            let rows: Vec<Vec<f64>> = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
            transforms.insert(
                name.into(),
                object!({
                    "ct_from_scan": rows,
                    "rms_bare_bone_mm": bone.rms_bare_bone_mm,
                    "inlier_fraction": bone.inlier_fraction,
                    "held_out_rms_mm": bone.held_out_rms_mm,
                    "predicted_error_mm": bone.predicted_error_mm,
                }),
            );
            let bare: Vec<f64> = bone.bare_bone.iter().map(|b| f64::from(u8::from(*b))).collect();
            let moved = bone.ct_from_scan.mesh(&scan.mesh);
            let scalars: [(&str, &[f64]); 2] = [("residual_mm", &bone.residual_mm), ("bare_bone", &bare)];
            files.push((format!("{name}_residual.ply"), surface(&moved, &scalars)?));
        }
        files.push(("transforms.json".into(), json(&transforms)));
        Ok(files)
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let (registration, specimen) = (v.of::<Registration>()?, v.of::<Specimen>()?);
        let mut layers = Vec::new();
        let mut words = String::new();
        let patella = registration.patella.as_ref().zip(specimen.patella.as_ref().and_then(|p| p.scan.as_ref()));
        let bones =
            registration.bones.named().into_iter().zip(specimen.scans.named()).map(|((n, b), (_, s))| (n, b, s));
        for (name, bone, scan) in bones.chain(patella.map(|(bone, scan)| ("patella", bone, scan))) {
            let bare: Vec<f64> = bone.bare_bone.iter().map(|b| f64::from(u8::from(*b))).collect();
            let (mesh, means) = thinned(&bone.ct_from_scan.mesh(&scan.mesh), &[&bone.residual_mm, &bare], SCAN_MM);
            let key = format!("scan {name}");
            pool.keep(&key, &mesh);
            let maps = [
                ("distance to bone", &means[0], -1.0, 3.0, "mm", "distance"),
                ("bare-bone mask", &means[1], 0.0, 1.0, "bare bone", "mask"),
            ];
            for (what, values, low, high, title, scale) in maps {
                layers.push(Layer {
                    name: format!("{name}: {what}"),
                    mesh: Some(key.clone()),
                    opacity: 1.0,
                    scalar: Some(Scalar {
                        values: packed_values(values, low, high),
                        low,
                        high,
                        title,
                        scale,
                        cells: false,
                    }),
                    on: scale == "distance",
                    one_of: Some(name),
                    ..Layer::default()
                });
            }
            words += &format!(
                " {name}: {:.2} mm root mean square on bare bone, {:.0} % of what looks like bone lies on it, predicted error {:.2} mm.",
                bone.rms_bare_bone_mm,
                100.0 * bone.inlier_fraction,
                bone.predicted_error_mm
            );
        }
        layers.extend(ct_layers(specimen, pool, 1.0, false));
        Some(Scene {
            id: "register".into(),
            title: "Scans on their bones".into(),
            text: format!(
                "Each scan laid on its CT bone, coloured by its distance to the bone: about 0 mm on bare bone, 1 to 4 mm where cartilage lies between.{words} The other map shows which part was taken for bare bone. Bare bone must be of one colour, and the mask must hold no edge of cartilage."
            ),
            from: "front",
            layers,
            moves: false,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        let (registration, specimen, frames) = (v.of::<Registration>()?, v.of::<Specimen>()?, v.of::<Frames>()?);
        let named =
            registration.bones.named().into_iter().zip(specimen.scans.named()).zip([frames.femur, frames.tibia]);
        Some(
            named
                .flat_map(|(((name, bone), (_, scan)), frame)| {
                    let mesh = bone.ct_from_scan.mesh(&scan.mesh);
                    let paint: Vec<[u8; 3]> = bone.residual_mm.iter().map(|d| colour(*d, -1.0, 1.0)).collect();
                    [("the front", frame.anterior), ("behind", -frame.anterior)].map(|(from, eye)| {
                        picture(
                            &[Painted { mesh: &mesh, colours: &paint }],
                            eye,
                            frame.superior,
                            format!("Scan of the {name} on its CT bone, from {from}: distance from -1 mm (blue) to +1 mm (red, cartilage)"),
                        )
                    })
                })
                .collect(),
        )
    }

    fn key_figure(v: &Values) -> Option<KeyFigure> {
        let (worst, limit) = (worst_error(v.of()?), v.options.register.error_limit_mm);
        Some(KeyFigure {
            name: "predicted error of the registration",
            value: format!("{worst:.2} mm"),
            limit: format!("limit {limit:.2} mm"),
            good: Some(check::at_most(worst, limit, 2)),
        })
    }

    fn checks(v: &Values) -> Vec<Check> {
        let Some(r) = v.of() else { return vec![] };
        let (worst, limit) = (worst_error(r), v.options.register.error_limit_mm);
        vec![Check {
            question: "Do the scans lie on their bones?",
            answer: format!("predicted error at most {worst:.2} mm (limit {limit:.2})"),
            good: Some(check::at_most(worst, limit, 2)),
            reaches: None,
            model: None,
            stage: Self::NAME,
        }]
    }
}

/// The larger predicted error of the two bones [mm].
fn worst_error(r: &Registration) -> f64 {
    r.bones.named().into_iter().map(|(_, b)| b.predicted_error_mm).fold(0.0, f64::max)
}

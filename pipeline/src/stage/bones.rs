//! Stage 3, bones: the rigid surfaces.

use super::artifacts::surface;
use super::layers::{CONTEXT_MM, bone_layers};
use super::{Files, Stage, Values, Work, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::report::geometry::Pool;
use crate::report::picture::{BONE, Picture, picture};
use crate::report::scene::Scene;
use meshes::render::Painted;
use stages::StageError;
use stages::bones::{Bones, BonesOptions, bones};
use stages::frames::Frames;
use stages::specimen::Specimen;

reported!(Bones);

/// The stage.
pub(crate) struct RigidBones;

impl Stage for RigidBones {
    const NUMBER: &'static str = "03";
    const NAME: &'static str = "bones";
    const TELLING: &'static [&'static str] = &["edge_p50_mm", "volume_change_percent"];
    type Inputs<'a> = (&'a Kept<Specimen>,);
    type Options = BonesOptions;
    type Value = Bones;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &BonesOptions {
        &all.bones
    }

    fn run((specimen,): Self::Inputs<'_>, options: &BonesOptions, _: &Work) -> Result<Bones, StageError> {
        bones(specimen, options)
    }

    /// The rigid surfaces.
    fn artifacts(b: &Bones, _: Self::Inputs<'_>) -> Files {
        let bones = b.surfaces.named().into_iter().chain(b.patella.as_ref().map(|mesh| ("patella", mesh)));
        bones.map(|(name, mesh)| Ok((format!("{name}.ply"), surface(mesh, &[])?))).collect()
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        let surfaces = &v.of::<Bones>()?.surfaces;
        Some(Scene {
            id: "bones".into(),
            title: "Rigid bones".into(),
            text: format!(
                "The rigid bone surfaces: femur of {} triangles, tibia with fibula of {}, shown with edges of about {CONTEXT_MM} mm. Both must be closed, without spikes or steps, and complete.",
                surfaces.femur.triangles.len(),
                surfaces.tibfib.triangles.len()
            ),
            from: "front",
            layers: bone_layers(v, pool, 1.0),
            moves: false,
        })
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        let (bones, frames) = (v.of::<Bones>()?, v.of::<Frames>()?);
        let painted: Vec<Painted> =
            bones.surfaces.named().map(|(_, mesh)| Painted { mesh, colours: &[BONE] }).into_iter().collect();
        let f = &frames.tibia;
        Some(vec![
            picture(&painted, f.anterior, f.superior, "Rigid bones from the front".into()),
            picture(&painted, -f.medial, f.superior, "Rigid bones from the lateral side".into()),
        ])
    }
}

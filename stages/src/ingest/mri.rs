//! What MRI gives in place of scans: a label map, or surfaces of cartilage.

mod clean;
mod labels;
mod surfaces;

pub(super) use labels::from_labels;
pub(super) use surfaces::from_surfaces;

use super::SpecimenFile;
use crate::{PerBone, PerCartilage, StageError};
use meshes::surface::TriMesh;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A label by its number, or by the name that the file gives it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a label's number, 1 to 255, or a segment's name")]
pub enum LabelName {
    /// Its number.
    Number(u8),
    /// The name of a segment (.seg.nrrd).
    Name(String),
}

/// The `[segmentation]` table: a label map and what its labels are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentationPaths {
    /// The label map's path.
    pub labels: String,
    /// The femur.
    pub femur: LabelName,
    /// The tibia, with or without the fibula.
    pub tibia: LabelName,
    /// The fibula, where it has a label of its own.
    pub fibula: Option<LabelName>,
    /// The patella.
    pub patella: Option<LabelName>,
    /// The femur's cartilage.
    pub femoral_cartilage: LabelName,
    /// The medial plateau's cartilage.
    pub tibial_cartilage_medial: LabelName,
    /// The lateral plateau's cartilage.
    pub tibial_cartilage_lateral: LabelName,
    /// The patella's cartilage: carried along.
    pub patellar_cartilage: Option<LabelName>,
    /// The medial meniscus: carried along.
    pub meniscus_medial: Option<LabelName>,
    /// The lateral meniscus: carried along.
    pub meniscus_lateral: Option<LabelName>,
}

/// Where surfaces of cartilage lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CartilageFrame {
    /// Where the bones of `[ct]` lie.
    #[default]
    Ct,
    /// In MRI, with bones of their own by which they are registered.
    Mri,
}

/// The `[cartilage]` table: surfaces of the cartilages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CartilagePaths {
    /// The femur's.
    pub femur: String,
    /// The medial plateau's.
    pub tibia_medial: String,
    /// The lateral plateau's.
    pub tibia_lateral: String,
    /// Where they lie.
    #[serde(default)]
    pub frame: CartilageFrame,
    /// The femur as MRI shows it, where the frame is MRI's.
    pub femur_bone: Option<String>,
    /// The tibia, perhaps with the fibula, as MRI shows it.
    pub tibfib_bone: Option<String>,
}

impl CartilagePaths {
    /// Keys and the paths they name.
    pub(super) fn named(&self) -> Vec<(&'static str, String)> {
        let own = [
            ("cartilage.femur", Some(&self.femur)),
            ("cartilage.tibia_medial", Some(&self.tibia_medial)),
            ("cartilage.tibia_lateral", Some(&self.tibia_lateral)),
            ("cartilage.femur_bone", self.femur_bone.as_ref()),
            ("cartilage.tibfib_bone", self.tibfib_bone.as_ref()),
        ];
        own.into_iter().filter_map(|(key, path)| Some((key, path?.clone()))).collect()
    }
}

/// Cartilage as MRI shows it. Its bones stand in the specimen's scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mri {
    /// Whether it lies where the bones of CT lie; else its bones are registered to theirs.
    pub in_ct: bool,
    /// By cartilage: the surface about bone and cartilage, or the cartilage's own.
    pub covers: PerCartilage<TriMesh>,
    /// Whether `covers` go about bone and cartilage.
    pub with_bone: bool,
    /// Menisci, the patella's cartilage and, beside CT, the patella: carried along. By name.
    pub bodies: BTreeMap<String, TriMesh>,
    /// Volume of each cartilage as given [mm3]; 0 for an open surface.
    pub given_mm3: PerCartilage<f64>,
}

/// What is read of a label map or of surfaces.
pub(super) struct Read {
    /// Bones in MRI's frame.
    pub(super) bones: PerBone<TriMesh>,
    /// The patella.
    pub(super) patella: Option<TriMesh>,
    pub(super) mri: Mri,
    pub(super) metrics: serde_json::Value,
}

/// Checks that a specimen names one source of bones and one of cartilage.
pub(super) fn check_sources(file: &SpecimenFile) -> Result<(), StageError> {
    let refuse = |what: &str| Err(StageError(format!("specimen.toml: {what}")));
    let named: Vec<&str> = [
        ("[scans]", file.scans.is_some()),
        ("[segmentation]", file.segmentation.is_some()),
        ("[cartilage]", file.cartilage.is_some()),
    ]
    .into_iter()
    .filter_map(|(name, there)| there.then_some(name))
    .collect();
    match named[..] {
        [] => {
            return refuse(
                "nothing shows cartilage; expected one of [scans] (surface scans), [segmentation] (a label map) or [cartilage] (surfaces)",
            );
        }
        [_] => {}
        _ => {
            return refuse(&format!(
                "{} are both given; expected one: keep the one to build from",
                named.join(" and ")
            ));
        }
    }
    if file.ct.is_empty() && file.segmentation.is_none() {
        return refuse("nothing shows the bones; expected [ct] femur and tibfib (surfaces), or volume");
    }
    if let Some(c) = &file.cartilage {
        let bones = c.femur_bone.is_some() as usize + c.tibfib_bone.is_some() as usize;
        if c.frame == CartilageFrame::Mri && bones != 2 {
            return refuse(
                "cartilage.frame is mri; expected femur_bone and tibfib_bone, the bones by which it is registered to those of [ct]",
            );
        }
    }
    Ok(())
}

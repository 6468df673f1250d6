//! What MRI gives in place of scans, as specimen.toml names it and as it is checked.

use crate::PerCartilage;
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
    pub(crate) fn named(&self) -> Vec<(&'static str, String)> {
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

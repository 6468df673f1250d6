//! The patellofemoral joint in model.json.

use super::AxisSpec;
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use serde::{Deserialize, Serialize};

/// The patellofemoral joint: the patella in the CT pose, and what acts on it. It acts only under tension of the quadriceps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PatellaSpec {
    /// Whether the patella is the knee's own.
    pub source: PatellaSource,
    /// Axes of the patella: medial, anterior, superior (apex to base); origin at its middle; CT frame.
    pub frame: AnatomicalFrame,
    /// Which articular surfaces meet, and how they press.
    pub contact: PatellaContactSpec,
    /// The patellar tendon; its far ends lie on the tibia.
    pub tendon: BandSpec,
    /// Ligaments from the patella to the femur; their far ends lie on the femur.
    #[serde(default)]
    pub retinacula: Vec<BandSpec>,
    /// The quadriceps.
    pub quadriceps: QuadricepsSpec,
}

/// Where a patella comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum PatellaSource {
    /// Seen in this knee's CT or MRI.
    Measured,
    /// Of mean shape, scaled to this knee.
    Generic,
}

/// Contact of patella and trochlea: tabular pressure over overclosure, without friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PatellaContactSpec {
    /// Articular surface of the femur with its trochlea (PLY, outward normals, open patch).
    pub femur: String,
    /// Articular surface of the patella (PLY, outward normals, open patch).
    pub patella: String,
    /// Bone of the femur beside its cartilage, that a patella off the trochlea lies on (PLY).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bone: Option<String>,
    /// Table: overclosure [mm], ascending.
    pub overclosure_mm: Vec<f64>,
    /// Table: pressure [MPa]; the last slope is continued.
    pub pressure_mpa: Vec<f64>,
}

impl PatellaContactSpec {
    /// The meshes that it names, by their keys.
    pub fn meshes(&self) -> impl Iterator<Item = (&'static str, &String)> {
        let bone = self.bone.iter().map(|b| ("bone", b));
        [("femur", &self.femur), ("patella", &self.patella)].into_iter().chain(bone)
    }

    /// The same, to be changed.
    pub fn meshes_mut(&mut self) -> impl Iterator<Item = &mut String> {
        [&mut self.femur, &mut self.patella].into_iter().chain(&mut self.bone)
    }
}

/// Fibres that share a stiffness: tension only, a quadratic toe, then linear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BandSpec {
    /// Its name.
    pub name: String,
    /// Of all its fibres together [N/mm].
    pub stiffness_n_per_mm: f64,
    /// Ratio of length to slack length in the CT pose [-].
    pub reference_strain: f64,
    /// Toe strain [-].
    pub toe_strain: f64,
    /// Its fibres.
    pub fibres: Vec<EndsSpec>,
}

/// A straight fibre of the patella, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EndsSpec {
    /// End on the patella [mm].
    #[schemars(with = "[f64; 3]")]
    pub patella: Point,
    /// End on the other bone [mm].
    #[schemars(with = "[f64; 3]")]
    pub far: Point,
}

/// The quadriceps: lines of constant tension that wrap over the front of the femur.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct QuadricepsSpec {
    /// Its heads.
    pub heads: Vec<HeadSpec>,
    /// The cylinder that they wrap over, fixed in the femur; its axis in the CT pose.
    pub wrap: AxisSpec,
    /// Radius of the cylinder [mm].
    pub wrap_radius_mm: f64,
}

/// A head of the quadriceps, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeadSpec {
    /// Its name.
    pub name: String,
    /// Its share of the tension [-]; the shares sum to 1.
    pub share: f64,
    /// End on the patella [mm].
    #[schemars(with = "[f64; 3]")]
    pub patella: Point,
    /// Where it comes from, carried by the femur [mm].
    #[schemars(with = "[f64; 3]")]
    pub femur: Point,
}

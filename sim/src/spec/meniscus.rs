//! A meniscus in model.json.

use meshes::Point;
use serde::{Deserialize, Serialize};

/// Poisson's ratio across the fibres [-] [hautdonahue2003]; of a deformable meniscus in an export.
pub const POISSON_ACROSS: f64 = 0.2;
/// Poisson's ratio from along to across the fibres [-] [hautdonahue2003].
pub const POISSON_ALONG: f64 = 0.3;
/// Shear modulus along the fibres [MPa] [hautdonahue2003].
pub const SHEAR_ALONG_MPA: f64 = 57.7;

/// A meniscus between the surfaces of a contact pair: sections from the anterior to the posterior horn, CT frame, as they lie in the CT pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeniscusSpec {
    /// "meniscus_medial" or "meniscus_lateral".
    pub name: String,
    /// The femoral surface of its contact pair.
    pub femur: String,
    /// The tibial surface of its contact pair.
    pub tibia: String,
    /// Where its shape is from: "segmentation", or "atlas".
    pub source: String,
    /// Its sections from horn to horn, all of as many points.
    pub sections: Vec<SectionSpec>,
    /// Rigid wedges that it is parted into along its length.
    pub wedges: usize,
    /// What it is made of.
    pub material: MeniscusMaterial,
    /// Where the anterior horn is attached to the tibia.
    pub anterior_horn: HornSpec,
    /// Where the posterior horn is attached to the tibia.
    pub posterior_horn: HornSpec,
    /// Stiffness of the coronary ligament that holds the periphery to the tibia, for each mm of periphery [N/mm2].
    pub periphery_n_per_mm2: f64,
}

/// A section across a meniscus [mm]: its face on the tibia and its face on the femur, each from the inner edge to the periphery.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SectionSpec {
    /// Tibial face.
    #[schemars(with = "Vec<[f64; 3]>")]
    pub lower: Vec<Point>,
    /// Femoral face, above it point by point.
    #[schemars(with = "Vec<[f64; 3]>")]
    pub upper: Vec<Point>,
}

/// Transversely isotropic, linear elastic; circumferential fibres bear tension alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeniscusMaterial {
    /// Young's modulus along the fibres [MPa].
    pub circumferential_modulus_mpa: f64,
    /// Young's modulus across the fibres, and along them in compression [MPa].
    pub transverse_modulus_mpa: f64,
    /// Modulus of neighbouring wedges against each other, across the fibres [MPa].
    pub shear_modulus_mpa: f64,
    /// Foundation stiffness of the cartilage that it lies on, of one layer [MPa/mm].
    pub cartilage_mpa_per_mm: f64,
}

/// A horn's attachment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HornSpec {
    /// Its site on the tibia [mm].
    #[schemars(with = "[f64; 3]")]
    pub tibia: Point,
    /// Of all of its fibres [N/mm].
    pub stiffness_n_per_mm: f64,
}

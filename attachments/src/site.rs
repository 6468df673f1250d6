//! Attachment sites and fibres as values.

use meshes::Point;
use serde::{Deserialize, Serialize};

/// The bone that carries a site.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Bone {
    /// The femur.
    Femur,
    /// The tibia with the fibula.
    Tibfib,
}

/// Where a site comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// An outline on the scan.
    Marked,
    /// A description in the literature.
    Literature,
    /// attachments.csv of the specimen.
    Given,
}

/// A ligament's attachment region on a bone, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Site {
    /// Ligament name.
    pub ligament: String,
    /// The bone.
    pub bone: Bone,
    /// Centroid on the bone [mm].
    pub centroid: Point,
    /// Area of the region [mm2]; 0 where the source gives a point or a line only.
    pub area_mm2: f64,
    /// Where it comes from.
    pub source: Source,
    /// Mean distance from the scan's surface to the bone along the normals [mm]; 0 unless marked.
    pub projection_mm: f64,
    /// The region as points on the bone, evenly spread over it [mm]; at least the centroid.
    pub region: Vec<Point>,
}

/// A straight fibre, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fibre {
    /// Bundle name of Table 3.
    pub bundle: String,
    /// Number within the bundle, from 1.
    pub fibre: usize,
    /// Femoral end [mm].
    pub femur: Point,
    /// Tibial (or fibular) end [mm].
    pub tibia: Point,
    /// The less certain of its two ends' sources: literature before marked before given.
    pub source: Source,
}

//! Stage 4, cartilage: registered scan minus CT bone, made usable.

use crate::PerCartilage;
use meshes::surface::TriMesh;
use serde::{Deserialize, Serialize};

/// A closed cartilage solid, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CartilageSolid {
    /// The closed surface, outward normals.
    pub solid: TriMesh,
    /// Per triangle: true on the articular face, false on the bony face.
    pub articular: Vec<bool>,
    /// Thickness at each vertex, along the bone's normal [mm]; 0 on the rim.
    pub thickness_mm: Vec<f64>,
}

/// The three cartilages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cartilage {
    /// The solids.
    pub solids: PerCartilage<CartilageSolid>,
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// For metrics.json: by cartilage name `volume_mm3`, `thickness_mean_mm`, `thickness_p95_mm`, `area_articular_mm2`.
    pub metrics: serde_json::Value,
}

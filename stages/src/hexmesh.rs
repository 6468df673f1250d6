//! Stage 7, hexmesh: cartilage solids become hexahedra.

use crate::PerCartilage;
use meshes::hex::HexMesh;
use serde::{Deserialize, Serialize};

/// The three hexahedral cartilages, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HexCartilage {
    /// The meshes.
    pub meshes: PerCartilage<HexMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// For metrics.json: by cartilage name `elements`, `scaled_jacobian_min|p05|mean`, `inverted`.
    pub metrics: serde_json::Value,
}

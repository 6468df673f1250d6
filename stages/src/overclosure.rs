//! Stage 8, overclosure: femoral and tibial cartilage pushed apart until no gap is below the wanted one.

use crate::PerCartilage;
use meshes::hex::HexMesh;
use serde::{Deserialize, Serialize};

/// The separated cartilages, CT frame; connectivity as in stage 7.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Separated {
    /// The meshes.
    pub meshes: PerCartilage<HexMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// For metrics.json: by cartilage name as stage 7; and `max_overclosure_before_mm`, `max_overclosure_after_mm`, `gap_min_mm`, `iterations`.
    pub metrics: serde_json::Value,
}

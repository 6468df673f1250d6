//! Stage 3, bones: the model's rigid bone surfaces from CT.

use meshes::surface::TriMesh;
use serde::{Deserialize, Serialize};

/// The rigid bones, closed, about 1.5 mm edges, CT frame; tibia and fibula are bodies of one surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bones {
    /// The surfaces.
    pub surfaces: crate::PerBone<TriMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// For metrics.json.
    pub metrics: serde_json::Value,
}

//! What a build keeps of each stage, and the names of the stages.

use serde::{Deserialize, Serialize};

/// The stages in order, with their numbers in folder names.
pub const STAGES: [(&str, &str); 14] = [
    ("00", "segment"),
    ("01", "ingest"),
    ("02", "register"),
    ("03", "bones"),
    ("04", "cartilage"),
    ("05", "frames"),
    ("06", "attachments"),
    ("07", "hexmesh"),
    ("08", "overclosure"),
    ("08b", "contact-law"),
    ("09", "assemble"),
    ("10", "calibrate"),
    ("11", "validate"),
    ("12", "diagnose"),
];

/// A line of log.jsonl.
#[derive(Clone, Debug, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Record {
    /// Stage name.
    pub stage: String,
    /// Wall time when it last ran [s].
    pub seconds: f64,
    /// Peak memory of the process while it ran [MiB]; 0 where unknown.
    pub peak_memory_mib: f64,
    /// Digest of its value.
    pub digest: String,
    /// Taken from an earlier run.
    pub cached: bool,
    /// What it warns of.
    pub warnings: Vec<String>,
    /// Its metrics.
    pub metrics: serde_json::Value,
}

/// What stopped a build; kept as failure.json until a build goes through.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Failure {
    /// The stage.
    pub stage: String,
    /// Why, and what to do.
    pub message: String,
}

/// `NN-stage`.
pub fn folder_name(stage: &str) -> String {
    let number = STAGES.iter().find(|(_, s)| *s == stage).map_or("00", |(n, _)| n);
    format!("{number}-{stage}")
}

/// Pretty JSON with a final newline.
pub fn json<T: Serialize>(value: &T) -> Vec<u8> {
    let mut bytes = serde_json::to_vec_pretty(value).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// blake3, hexadecimal.
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

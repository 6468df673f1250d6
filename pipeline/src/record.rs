//! What a build keeps of each stage.

use crate::again::building_again;
use crate::error::{BuildError, Place};
use crate::store;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use stages::error::Mark;
use std::path::Path;

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
    /// Left by an earlier run with other inputs or options, or not looked at since: its folder stands, and is not what this run would make.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub outdated: bool,
    /// What it warns of, in sentences.
    pub warnings: Vec<String>,
    /// The same as values; empty in a log that another version wrote.
    #[serde(default)]
    pub notices: Vec<Notice>,
    /// Its metrics.
    pub metrics: serde_json::Value,
}

/// What stopped a build; kept as failure.json until a build goes through.
#[derive(Clone, Debug, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Failure {
    /// The stage.
    pub stage: String,
    /// Why, and what to do.
    pub message: String,
    /// The file at fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Its row or line, the first being 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row: Option<usize>,
    /// The places that the message names, in CT.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(with = "Vec<serde_json::Value>")]
    pub marks: Vec<Mark>,
}

impl Record {
    /// What it warns of, as values; of a log that another version wrote, sentences of no known kind.
    pub fn told(&self) -> Vec<Notice> {
        if !self.notices.is_empty() {
            return self.notices.clone();
        }
        self.warnings.iter().map(|w| Kind::Other.notice(w.as_str()).told_by(&self.stage)).collect()
    }
}

/// The lines of a build's log.
pub fn records(build: &Path) -> Result<Vec<Record>, BuildError> {
    let path = build.join("log.jsonl");
    store::read_text(&path)?
        .lines()
        .enumerate()
        .map(|(i, line)| {
            serde_json::from_str(line).map_err(|e| {
                let told = format!("{} line {}: {e}; run again: {}", path.display(), i + 1, building_again(build));
                BuildError::at(Place { row: Some(i + 1), ..Place::of(&path) }, told)
            })
        })
        .collect()
}

/// The records of stages that are what the last run made or found unchanged.
pub fn current(records: &[Record]) -> Vec<Record> {
    records.iter().filter(|r| !r.outdated).cloned().collect()
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

//! A bench on disk: its cases, its data sets, the names of its files.

use crate::error::BuildError;
use crate::store;
use std::path::Path;

/// Ending of the name of a file with what the same knee read before.
pub(super) const BEFORE: &str = "_before";

/// Cases and data sets of a bench.
pub(super) fn bench(folder: &Path) -> Result<(Vec<String>, Vec<String>, serde_json::Value), BuildError> {
    let path = folder.join("bench.json");
    let value: serde_json::Value =
        serde_json::from_str(&store::read_text(&path)?).map_err(|e| BuildError::in_file(&path, e))?;
    let cases = value["seals"].as_object().map(|o| o.keys().cloned().collect()).unwrap_or_default();
    let list = value["sources"].as_array().cloned().unwrap_or_default();
    let sources = list.iter().filter_map(|s| s.as_str().map(str::to_owned)).collect();
    Ok((cases, sources, value))
}

//! `fetch` in a program that was built without the feature of this name.

use crate::error::BuildError;
use std::path::Path;

/// Always an error, which says what is missing.
pub fn fetch(id: &str, _dir: &Path, _mirror: Option<&str>, _patience: u64) -> Result<String, BuildError> {
    Err(BuildError::Usage(format!("this build-model cannot fetch {id}: it was built without the feature fetch")))
}

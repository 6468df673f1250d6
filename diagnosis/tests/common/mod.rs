//! Data that tests may read where it is there.
pub(crate) mod asked;
pub(crate) mod deck;

use std::path::{Path, PathBuf};

/// A path below `../shared`; `None`, with a line, where it is not there and not required.
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
pub(crate) fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(path);
    if full.exists() {
        return Some(full);
    }
    assert!(std::env::var("GENU_SHARED").as_deref() != Ok("required"), "{test}: {} is required", full.display());
    eprintln!("{test}: skipped, {} is not there", full.display());
    None
}

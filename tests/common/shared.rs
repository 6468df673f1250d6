//! Data that tests may read where it is there; the one home of its path. Other crates' tests take this file too.

use std::path::{Path, PathBuf};

/// A path below `../shared`, beside the workspace; `None`, with a line said, where it is not there and need not be.
///
/// A test that proves nothing without it is `#[needs_shared]`, not `#[test]`.
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
pub(crate) fn shared(test: &str, path: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let workspace = own.ancestors().find(|folder| folder.join("Cargo.lock").exists())?;
    let full = workspace.join("../shared").join(path);
    if full.exists() {
        return Some(full);
    }
    assert!(std::env::var("GENU_SHARED").as_deref() != Ok("required"), "{test}: {} is missing", full.display());
    eprintln!("{test}: skipped, {} is not there", full.display());
    None
}

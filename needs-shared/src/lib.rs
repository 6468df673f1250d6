//! `#[needs_shared]` in place of `#[test]`: a test that proves nothing without the shared data, `../shared` beside the workspace.
//!
//! Where the data are absent the test is ignored and counted as such, not passed. With `GENU_SHARED=required` it runs, and fails.
//! Whether they are there is seen when the test is compiled; while they are absent a change of `GENU_SHARED` compiles it again.

use proc_macro::TokenStream;
use std::path::Path;

/// Makes a function a test that is ignored where `../shared` is absent.
#[proc_macro_attribute]
pub fn needs_shared(_: TokenStream, test: TokenStream) -> TokenStream {
    let there = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").exists();
    let required = std::env::var("GENU_SHARED").is_ok_and(|v| v == "required");
    let attributes = match (there, required) {
        (true, _) => "#[test]",
        // the compiler notes what the environment held
        (false, true) => "const _: Option<&str> = option_env!(\"GENU_SHARED\"); #[test]",
        (false, false) => {
            "const _: Option<&str> = option_env!(\"GENU_SHARED\"); #[test] #[ignore = \"needs ../shared\"]"
        }
    };
    let mut out: TokenStream = attributes.parse().unwrap_or_default();
    out.extend(test);
    out
}

//! `#[needs_shared]` in place of `#[test]`: a test that proves nothing without the shared data, `../shared` beside the workspace.
//!
//! Where the data are absent the test is ignored and counted as such, not passed. With `GENU_SHARED=required` it runs, and fails.
//! Whether they are there is seen when the test is compiled; while they are absent a change of `GENU_SHARED` compiles it again.
//! A test that was compiled while they were there fails where they are gone.

use proc_macro::{Delimiter, Group, TokenStream, TokenTree};
use std::path::Path;

/// Makes a function a test that is ignored where `../shared` is absent.
#[proc_macro_attribute]
pub fn needs_shared(_: TokenStream, test: TokenStream) -> TokenStream {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let required = std::env::var("GENU_SHARED").is_ok_and(|v| v == "required");
    let attributes = match (shared.exists(), required) {
        (true, _) => "#[test]",
        // the compiler notes what the environment held
        (false, true) => "const _: Option<&str> = option_env!(\"GENU_SHARED\"); #[test]",
        (false, false) => {
            "const _: Option<&str> = option_env!(\"GENU_SHARED\"); #[test] #[ignore = \"needs ../shared\"]"
        }
    };
    let mut out: TokenStream = attributes.parse().unwrap_or_default();
    out.extend(if shared.exists() { first_looks(test, &shared) } else { test });
    out
}

/// The test with a look at its data before all else.
fn first_looks(test: TokenStream, shared: &Path) -> TokenStream {
    let look = format!(
        "assert!(::std::path::Path::new({shared:?}).exists(), \"../shared was there when this test was compiled, and is gone\");"
    );
    let look: TokenStream = look.parse().unwrap_or_default();
    let body = |tree: TokenTree| match tree {
        TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => {
            let mut inner = look.clone();
            inner.extend(group.stream());
            TokenTree::Group(Group::new(Delimiter::Brace, inner))
        }
        other => other,
    };
    test.into_iter().map(body).collect()
}

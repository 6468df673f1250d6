//! Names of bundles as other programs can have them.

use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// Longest name of a bundle that is written [letters]: Abaqus has 80, and what is put behind a name takes a dozen.
const LONGEST: usize = 60;
/// What stands before a name that begins with no letter.
const BEFORE: &str = "L";

/// What each bundle of a model is called in a file whose names have no other letters than the `allowed` ones: others become `_`.
/// No two are one, whatever the case of their letters.
pub fn written_names(spec: &ModelSpec, allowed: impl Fn(char) -> bool) -> BTreeMap<String, String> {
    let mut out = BTreeMap::new();
    let mut taken: Vec<String> = Vec::new();
    for bundle in &spec.bundles {
        let plain: String = bundle.name.chars().take(LONGEST).map(|c| if allowed(c) { c } else { '_' }).collect();
        let before = if plain.starts_with(|c: char| c.is_alphabetic()) { "" } else { BEFORE };
        let stem = format!("{before}{plain}");
        let numbered = (2..).map(|n| format!("{stem}_{n}"));
        let is_free = |name: &String| !taken.contains(&name.to_lowercase());
        let name = std::iter::once(stem.clone()).chain(numbered).find(is_free).unwrap_or_default();
        taken.push(name.to_lowercase());
        out.insert(bundle.name.clone(), name);
    }
    out
}

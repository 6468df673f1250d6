//! The fetched files as a specimen directory.

use crate::error::BuildError;
use crate::store;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What a specimen needs: key in specimen.toml, words that a file's path must hold, words it must not, endings.
type Rule = (&'static str, &'static [&'static str], &'static [&'static str], &'static [&'static str]);

const SURFACES: &[&str] = &[".stl", ".ply", ".obj"];
const RULES: [Rule; 4] = [
    ("ct.femur", &["femur", "ct"], &["cart", "scan", "capsule"], SURFACES),
    ("ct.tibfib", &["tib", "ct"], &["cart", "scan", "capsule"], SURFACES),
    ("scans.femur", &["femur", "scan"], &["capsule"], SURFACES),
    ("scans.tibfib", &["tib", "scan"], &["capsule"], SURFACES),
];

/// Writes specimen.toml where each file it must name is there once; else tells what is not. Gives the words to print.
pub(super) fn specimen(id: &str, side: &str, dir: &Path, have: &[PathBuf]) -> Result<String, BuildError> {
    if store::exists(&dir.join("specimen.toml")) {
        return Ok(format!("{} is left as it is.\n", dir.join("specimen.toml").display()));
    }
    let names: Vec<String> = have.iter().map(|p| p.to_string_lossy().replace('\\', "/")).collect();
    let mut found = Vec::new();
    let mut open = Vec::new();
    for (key, with, without, endings) in RULES {
        let fits = |name: &&String| {
            let lower = name.to_ascii_lowercase();
            endings.iter().any(|e| lower.ends_with(e))
                && with.iter().all(|w| lower.contains(w))
                && !without.iter().any(|w| lower.contains(w))
        };
        match names.iter().filter(fits).collect::<Vec<_>>()[..] {
            [one] => found.push((key, one)),
            [] => open.push(format!("{key}: no file fits")),
            ref many => open.push(format!("{key}: {} files may be it, {} first", many.len(), many[0])),
        }
    }
    if !open.is_empty() {
        return Ok(format!(
            "specimen.toml is not written, since files are missing or packed:\n  {}\nUnpack archives, then write it by hand (docs/specimen.md).\n",
            open.join("\n  ")
        ));
    }
    let mut toml = format!(
        "[specimen]\nid = \"{id}\"\nside = \"{side}\"\nprovenance = \"published\"\nnote = \"Fetched from the public records; see LICENCE.txt.\"\n"
    );
    for table in ["ct", "scans"] {
        let _ = writeln!(toml, "\n[{table}]");
        for (key, path) in &found {
            if let Some(name) = key.strip_prefix(table).and_then(|k| k.strip_prefix('.')) {
                let _ = writeln!(toml, "{name} = \"{path}\"");
            }
        }
    }
    store::write(&dir.join("specimen.toml"), toml.as_bytes())?;
    Ok(format!("Build its model: {}\n", crate::suggested::command_on("build", dir)))
}

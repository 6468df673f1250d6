//! The arrows between the crates, the one door to the file system, and the size of files.
#![expect(clippy::disallowed_methods, reason = "looks at the sources")]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Folder of each crate and which of ours it may use.
const ARROWS: [(&str, &[&str]); 12] = [
    ("meshes", &[]),
    ("attachments", &["meshes"]),
    ("sim", &["meshes"]),
    ("decks", &["meshes", "sim"]),
    ("stages", &["meshes", "attachments", "sim"]),
    ("inference", &["meshes", "sim"]),
    ("calibration", &["meshes", "sim", "decks", "inference"]),
    ("validation", &["attachments", "sim", "calibration"]),
    // of validation, diagnosis uses the plotting alone
    ("diagnosis", &["meshes", "attachments", "sim", "decks", "inference", "calibration", "validation"]),
    ("blindbench", &["meshes"]),
    (
        ".",
        &[
            "meshes",
            "attachments",
            "sim",
            "decks",
            "stages",
            "inference",
            "calibration",
            "validation",
            "diagnosis",
            "blindbench",
        ],
    ),
    ("python", &["genu", "sim"]),
];

const LONGEST_FILE: usize = 600;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn manifest(folder: &str) -> Option<Table> {
    let text = fs::read_to_string(root().join(folder).join("Cargo.toml")).ok()?;
    Some(text.parse().unwrap())
}

fn members() -> Vec<String> {
    let members = manifest(".").unwrap()["workspace"]["members"].as_array().unwrap().clone();
    members.iter().map(|m| m.as_str().unwrap().to_owned()).collect()
}

/// Names of the dependencies of all kinds that are crates of ours.
fn ours(manifest: &Table) -> BTreeSet<String> {
    let known: BTreeSet<&str> = ARROWS.iter().map(|(name, _)| *name).collect();
    let mut found = BTreeSet::new();
    let mut look = |table: Option<&Value>| {
        for name in table.and_then(Value::as_table).into_iter().flat_map(|t| t.keys()) {
            if known.contains(name.as_str()) {
                found.insert(name.clone());
            }
        }
    };
    for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
        look(manifest.get(kind));
        for target in manifest.get("target").and_then(Value::as_table).into_iter().flat_map(|t| t.values()) {
            look(target.get(kind));
        }
    }
    found
}

#[test]
fn no_crate_uses_what_it_must_not() {
    for member in members() {
        let (_, allowed) =
            ARROWS.iter().find(|(name, _)| *name == member).unwrap_or_else(|| panic!("{member}: no arrow"));
        for used in ours(&manifest(&member).unwrap()) {
            assert!(allowed.contains(&used.as_str()), "{member} must not use {used}");
        }
    }
}

#[test]
fn every_crate_inherits_the_lints() {
    for member in members() {
        let table = manifest(&member).unwrap();
        let inherits = table.get("lints").and_then(|l| l.get("workspace")).and_then(Value::as_bool);
        assert_eq!(inherits, Some(true), "{member}/Cargo.toml: [lints] workspace = true is missing");
    }
}

/// All Rust files of `folder`.
fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

fn sources(part: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for member in members() {
        let folder = if member == "." {
            root().join(if part == "src" { "pipeline/src" } else { part })
        } else {
            root().join(&member).join(part)
        };
        rust_files(&folder, &mut files);
    }
    assert!(part != "src" || files.len() > 50, "only {} source files found", files.len());
    files
}

#[test]
fn only_the_store_opens_files() {
    let doors = ["std::fs", "File::open", "File::create", "OpenOptions", "std::net", "TcpStream"];
    for file in sources("src") {
        if file.ends_with("pipeline/src/store.rs") || file.components().any(|c| c.as_os_str() == "store") {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        for (number, line) in text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
            for door in doors {
                assert!(
                    !line.contains(door),
                    "{}:{}: {door}; only pipeline::store opens files",
                    file.display(),
                    number + 1
                );
            }
        }
    }
}

#[test]
fn no_file_is_too_long() {
    for part in ["src", "tests", "benches", "examples"] {
        for file in sources(part) {
            let lines = fs::read_to_string(&file).unwrap().lines().count();
            assert!(lines <= LONGEST_FILE, "{}: {lines} lines, at most {LONGEST_FILE}: split it", file.display());
        }
    }
}

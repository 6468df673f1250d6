//! The arrows between the crates, the one door to the file system, and the size of files.
#![expect(clippy::disallowed_methods, reason = "looks at the sources")]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Folder of each crate and which of ours it may use.
const ARROWS: [(&str, &[&str]); 17] = [
    ("meshes", &[]),
    ("notices", &[]),
    ("formats", &["meshes", "notices"]),
    // an attribute for tests; nothing that is shipped holds it
    ("needs-shared", &[]),
    ("attachments", &["meshes", "formats"]),
    ("sim", &["meshes", "notices"]),
    ("deformable", &["meshes"]),
    ("decks", &["meshes", "notices", "formats", "sim"]),
    ("stages", &["meshes", "notices", "formats", "attachments", "sim", "deformable"]),
    ("inference", &["meshes", "sim"]),
    ("calibration", &["meshes", "notices", "formats", "attachments", "sim", "decks", "inference"]),
    ("validation", &["notices", "attachments", "sim", "calibration"]),
    ("diagnosis", &["meshes", "formats", "attachments", "sim", "decks", "inference", "calibration"]),
    ("blindbench", &["meshes"]),
    ("live", &["meshes", "sim", "calibration"]),
    (
        ".",
        &[
            "meshes",
            "notices",
            "formats",
            "attachments",
            "sim",
            "decks",
            "stages",
            "inference",
            "calibration",
            "validation",
            "diagnosis",
            "blindbench",
            "live",
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
        for used in ours(&manifest(&member).unwrap()).iter().filter(|used| *used != "needs-shared") {
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

/// An exported name must be unique in the module, which the compiler cannot check. It is the only thing of ours that is unsafe.
#[test]
fn only_the_doors_of_the_web_are_unsafe() {
    let doors = Path::new("live/src/web.rs");
    for file in ["src", "tests", "benches", "examples"].into_iter().flat_map(sources) {
        let text = fs::read_to_string(&file).unwrap();
        let says = |line: &&str| {
            let code = line.split("//").next().unwrap_or_default();
            code.contains("unsafe(")
                || code.contains("unsafe {")
                || code.contains("unsafe fn")
                || code.contains("(unsafe_code")
        };
        let at = text.lines().filter(says).count();
        // this test names what it looks for
        let may = file.ends_with(doors) || file.ends_with("tests/architecture.rs");
        assert!(at == 0 || may, "{}: unsafe; only {} may", file.display(), doors.display());
    }
    let text = fs::read_to_string(root().join(doors)).unwrap();
    let unsafe_words = text.lines().filter(|l| l.contains("unsafe(") || l.contains("unsafe {")).count();
    assert_eq!(unsafe_words, text.matches("#[unsafe(no_mangle)]").count(), "the doors hold more than exported names");
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

/// Files of a crate by module path, without comments and unit tests; the crate's root is "".
fn modules(member: &str) -> BTreeMap<String, String> {
    let folder = if member == "." { root().join("pipeline/src") } else { root().join(member).join("src") };
    let mut files = Vec::new();
    rust_files(&folder, &mut files);
    let mut out = BTreeMap::new();
    for file in files.iter().filter(|f| !f.ends_with("tests.rs")) {
        let path = file.strip_prefix(&folder).unwrap().with_extension("");
        let parts: Vec<String> = path.iter().map(|p| p.to_string_lossy().into_owned()).collect();
        let name = parts.join("::");
        let text = fs::read_to_string(file).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        let code = code.lines().map(|l| l.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
        out.insert(if ["lib", "main"].contains(&name.as_str()) { String::new() } else { name }, code);
    }
    out
}

/// Reads a path from `text` after `prefix`; a group in braces gives several. What is left of the text comes back.
fn paths<'a>(text: &'a str, prefix: &[String], out: &mut Vec<Vec<String>>) -> &'a str {
    let mut path = prefix.to_vec();
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        if let Some(group) = rest.strip_prefix('{') {
            rest = group;
            while !rest.is_empty() && !rest.starts_with('}') {
                let before = rest.len();
                rest = paths(rest, &path, out).trim_start();
                rest = rest.strip_prefix(',').unwrap_or(rest).trim_start();
                if rest.len() == before {
                    rest = &rest[rest.chars().next().map_or(0, char::len_utf8)..];
                }
            }
            return rest.strip_prefix('}').unwrap_or(rest);
        }
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        if end == 0 {
            break;
        }
        path.push(rest[..end].to_owned());
        rest = &rest[end..];
        match rest.strip_prefix("::") {
            Some(more) => rest = more,
            None => break,
        }
    }
    out.push(path);
    rest
}

/// Modules that the text of `name` uses, but for those that it lies in.
fn used(name: &str, text: &str, known: &BTreeMap<String, String>) -> BTreeSet<String> {
    let own: Vec<String> = name.split("::").filter(|p| !p.is_empty()).map(str::to_owned).collect();
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_alphanumeric() || c == '_') {
        let led = rest[..start].ends_with("::");
        rest = &rest[start..];
        let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let child = [own.join("::"), rest[..end].to_owned()]
            .iter()
            .filter(|p| !p.is_empty())
            .cloned()
            .collect::<Vec<_>>()
            .join("::");
        let begins = ["crate", "super", "self"].contains(&&rest[..end]) || known.contains_key(&child);
        if begins && !led && rest[end..].starts_with("::") {
            rest = paths(rest, &[], &mut found);
        } else {
            rest = &rest[end..];
        }
    }
    let absolute = |path: Vec<String>| -> Vec<String> {
        let ups = path.iter().take_while(|p| *p == "super").count();
        match path.first().map(String::as_str) {
            Some("crate") => path[1..].to_vec(),
            Some("super") => [&own[..own.len().saturating_sub(ups)], &path[ups..]].concat(),
            Some("self") => [&own[..], &path[1..]].concat(),
            _ => [&own[..], &path[..]].concat(),
        }
    };
    let module = |mut path: Vec<String>| {
        while !path.is_empty() && !known.contains_key(&path.join("::")) {
            path.pop();
        }
        path.join("::")
    };
    let all = found.into_iter().map(|p| module(absolute(p)));
    all.filter(|m| !m.is_empty() && m != name && !name.starts_with(&format!("{m}::"))).collect()
}

#[test]
fn no_files_of_a_crate_use_each_other_in_a_circle() {
    for member in members() {
        let known = modules(&member);
        let uses: BTreeMap<&String, BTreeSet<String>> =
            known.iter().map(|(name, text)| (name, used(name, text, &known))).collect();
        let reached = |from: &String| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
            while let Some(at) = open.pop() {
                open.extend(uses[&at].iter().filter(|m| seen.insert((*m).clone())).cloned());
            }
            seen
        };
        let all: BTreeMap<&String, BTreeSet<String>> = known.keys().map(|name| (name, reached(name))).collect();
        let circle = |name: &String| -> Vec<String> {
            all[name].iter().filter(|other| all[other].contains(name)).cloned().collect()
        };
        for name in known.keys() {
            let files = circle(name);
            assert!(files.is_empty(), "{member}: files that use each other in a circle: {}", files.join(", "));
        }
    }
}

#[test]
fn every_file_of_tests_is_part_of_its_crates_one_program() {
    for crate_folder in std::fs::read_dir(root()).unwrap().map(|e| e.unwrap().path()).chain([root()]) {
        let tests = crate_folder.join("tests");
        let Ok(main) = std::fs::read_to_string(tests.join("main.rs")) else { continue };
        for entry in std::fs::read_dir(&tests).unwrap().map(|e| e.unwrap().path()) {
            let name = entry.file_stem().unwrap().to_string_lossy().into_owned();
            let is_module = entry.extension().is_some_and(|e| e == "rs") || entry.join("mod.rs").exists();
            let is_named = name == "main" || main.contains(&format!("mod {name};"));
            assert!(!is_module || is_named, "{}: not a module of tests/main.rs, so it never runs", entry.display());
        }
    }
}

//! The arrows between the crates, the one door to the file system, the size of files; the pages of the site, the wheels of a tag.
#![expect(clippy::disallowed_methods, reason = "looks at the sources")]
#![allow(clippy::unwrap_used, reason = "tests")]

mod circles;

use circles::{Sources, circles};
use std::collections::BTreeSet;
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

/// Names come from outside; a second function that makes them safe for a page would do it otherwise.
#[test]
fn one_function_makes_text_safe() {
    let home = root().join("pipeline/src/report/html.rs");
    for file in sources("src") {
        let text = fs::read_to_string(&file).unwrap();
        let made = text.matches("\"&lt;\"").count();
        assert_eq!(
            made,
            usize::from(file == home),
            "{}: text is made safe in {} alone",
            file.display(),
            home.display()
        );
    }
}

/// Pages below `docs/`, by their paths from there.
fn pages(folder: &Path, into: &mut BTreeSet<String>) {
    for path in fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        if path.is_dir() {
            pages(&path, into);
        } else if path.extension().is_some_and(|e| e == "md") {
            let name = path.strip_prefix(root().join("docs")).unwrap();
            into.insert(name.iter().map(|p| p.to_string_lossy()).collect::<Vec<_>>().join("/"));
        }
    }
}

#[test]
fn the_site_leads_to_every_page_once() {
    let text = fs::read_to_string(root().join("mkdocs.yml")).unwrap();
    let (_, nav) = text.split_once("\nnav:\n").unwrap();
    let named: Vec<String> =
        nav.lines().filter(|l| l.ends_with(".md")).map(|l| l.rsplit(": ").next().unwrap().to_owned()).collect();
    let mut there = BTreeSet::new();
    pages(&root().join("docs"), &mut there);
    let led: BTreeSet<String> = named.iter().cloned().collect();
    let missing: Vec<&String> = there.symmetric_difference(&led).collect();
    assert!(missing.is_empty(), "in mkdocs.yml or in docs, and not in both: {missing:?}");
    assert_eq!(named.len(), led.len(), "a page stands twice in mkdocs.yml");
}

/// One for each machine, after the checks, and of a tag alone: all is compiled anew for them.
#[test]
fn a_tag_builds_the_wheels_for_older_systems() {
    let text = fs::read_to_string(root().join(".github/workflows/ci.yml")).unwrap();
    let (checks, wheels) = text.split_once("\n  wheels:\n").unwrap();
    assert!(checks.contains(" .ci/run\n") && !checks.contains("portable"), "{checks}");
    assert!(wheels.contains("if: startsWith(github.ref, 'refs/tags/')") && wheels.contains("needs: run"), "{wheels}");
    for command in ["bash python/ci.sh portable\n", "bash python/ci.sh portable aarch64\n"] {
        assert!(wheels.contains(command), "{command}");
    }
}

/// Files of a crate by module path, without those of unit tests; the crate's root is "".
fn modules(member: &str) -> Sources {
    let folder = if member == "." { root().join("pipeline/src") } else { root().join(member).join("src") };
    let mut files = Vec::new();
    rust_files(&folder, &mut files);
    let named = |file: &PathBuf| {
        let path = file.strip_prefix(&folder).unwrap().with_extension("");
        let parts: Vec<String> = path.iter().map(|p| p.to_string_lossy().into_owned()).collect();
        let name = parts.join("::");
        let is_root = ["lib", "main"].contains(&name.as_str());
        (if is_root { String::new() } else { name }, fs::read_to_string(file).unwrap())
    };
    files.iter().filter(|f| !f.ends_with("tests.rs")).map(named).collect()
}

/// Circles that are still there: crate and files. What a person gave of frames needs an option and a function of the file that reads it.
const STILL_THERE: [(&str, &[&str]); 1] = [("stages", &["anatomy", "bones", "frames::given", "specimen"])];

#[test]
fn no_files_of_a_crate_use_each_other_in_a_circle() {
    for member in members() {
        let known: BTreeSet<Vec<String>> = STILL_THERE
            .iter()
            .filter(|(of, _)| *of == member)
            .map(|(_, files)| files.iter().map(|f| (*f).to_owned()).collect())
            .collect();
        let found = circles(&modules(&member));
        let new: Vec<String> = found.difference(&known).map(|files| files.join(", ")).collect();
        assert!(new.is_empty(), "{member}: files that use each other in a circle: {}", new.join("; "));
        let gone: Vec<String> = known.difference(&found).map(|files| files.join(", ")).collect();
        assert!(gone.is_empty(), "{member}: no circle any more, take it out of STILL_THERE: {}", gone.join("; "));
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

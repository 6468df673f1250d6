//! What the project depends on: licences, doubles, bans, and that every dependency is used. Needs no network.
#![expect(clippy::disallowed_methods, reason = "looks at the sources")]
#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Licences under which a dependency may come: permissive, and those of files that are used as they are.
const ALLOWED: [&str; 14] = [
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "Zlib",
    "BSL-1.0",
    "CC0-1.0",
    "0BSD",
    "Unlicense",
    "Unicode-3.0",
    "CDLA-Permissive-2.0",
];
/// What the program must not bring in: C libraries of the system, other TLS, mesh Booleans with another licence.
const BANNED: [&str; 8] =
    ["openssl-sys", "native-tls", "libgit2-sys", "netcdf-sys", "hdf5-sys", "manifold-rs", "matio-rs", "boolmesh"];
/// Crates of which two versions are compiled into the program, since the crates that use them move at their own pace.
/// A new double is a decision: one more compilation, and types that do not fit each other.
const DOUBLE: [&str; 14] = [
    "bitflags", // 1 by JPEG 2000 alone
    "darling",
    "darling_core",
    "darling_macro",
    "getrandom",
    "glam",
    "hashbrown",
    "indexmap",
    "miniz_oxide",
    "num-bigint",
    "schemars",
    "syn",
    "thiserror", // 1 by JPEG 2000 alone
    "thiserror-impl",
];

/// Named by a manifest for its features alone: what else brings it then is compiled once for the program, the tests and the wheel.
const FOR_FEATURES: [&str; 5] = ["bitflags", "libc", "syn", "typenum", "zerocopy"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn metadata() -> Value {
    let out = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--format-version",
            "1",
            "--locked",
            "--offline",
            "--filter-platform",
            "x86_64-unknown-linux-gnu",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// Packages that the program, the module and their build scripts need; those of tests alone are left out.
fn shipped(metadata: &Value) -> Vec<&Value> {
    let nodes: BTreeMap<&str, &Value> =
        metadata["resolve"]["nodes"].as_array().unwrap().iter().map(|n| (n["id"].as_str().unwrap(), n)).collect();
    let mut open: Vec<&str> =
        metadata["workspace_members"].as_array().unwrap().iter().map(|m| m.as_str().unwrap()).collect();
    let mut seen = BTreeSet::new();
    while let Some(id) = open.pop() {
        if !seen.insert(id) {
            continue;
        }
        let used = nodes[id]["deps"].as_array().unwrap().iter();
        open.extend(
            used.filter(|d| d["dep_kinds"].as_array().unwrap().iter().any(|k| k["kind"] != "dev"))
                .map(|d| d["pkg"].as_str().unwrap()),
        );
    }
    let packages = metadata["packages"].as_array().unwrap().iter();
    packages.filter(|p| seen.contains(p["id"].as_str().unwrap())).collect()
}

/// Whether an SPDX expression leaves a choice that is allowed.
fn allowed(expression: &str) -> bool {
    let expression = expression.replace('/', " OR ");
    if let Some((open, close)) = expression.rfind('(').and_then(|o| Some((o, o + expression[o..].find(')')?))) {
        // an inner expression becomes an allowed or a forbidden word
        let inner = if allowed(&expression[open + 1..close]) { "MIT" } else { "forbidden" };
        return allowed(&format!("{}{inner}{}", &expression[..open], &expression[close + 1..]));
    }
    expression.split(" OR ").any(|one| one.split(" AND ").all(|l| ALLOWED.contains(&l.trim())))
}

#[test]
fn licences_allow_use_and_doubles_and_bans_are_known() {
    assert!(allowed("MIT OR GPL-3.0") && allowed("(MIT OR Apache-2.0) AND Unicode-3.0") && allowed("MIT/Apache-2.0"));
    assert!(!allowed("GPL-3.0") && !allowed("MIT AND GPL-3.0") && !allowed("(GPL-3.0 OR LGPL-2.1) AND MIT"));
    let metadata = metadata();
    let shipped = shipped(&metadata);
    assert!(shipped.len() > 50, "only {} packages found", shipped.len());
    let mut faults = Vec::new();
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for p in &shipped {
        let (name, licence) = (p["name"].as_str().unwrap(), p["license"].as_str().unwrap_or_default());
        versions.entry(name).or_default().insert(p["version"].as_str().unwrap());
        if !allowed(licence) {
            faults.push(format!("{name}: licence \"{licence}\" is not among those allowed"));
        }
        if BANNED.contains(&name) {
            faults.push(format!("{name} is banned"));
        }
        let source = p["source"].as_str().unwrap_or("registry+");
        if !source.starts_with("registry+") {
            faults.push(format!("{name} comes from {source}; only the registry is allowed"));
        }
    }
    for (name, all) in versions.iter().filter(|(name, all)| all.len() > 1 && !DOUBLE.contains(name)) {
        faults.push(format!("{name} is compiled in {} versions: {all:?}", all.len()));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

fn text_of(folder: &Path, into: &mut String) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            text_of(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let text = std::fs::read_to_string(&path).unwrap();
            // modules taken from another crate: `#[path = "..."]`
            for other in text.split("#[path = \"").skip(1).filter_map(|rest| rest.split('"').next()) {
                into.push_str(&std::fs::read_to_string(path.parent().unwrap().join(other)).unwrap_or_default());
            }
            into.push_str(&text);
        }
    }
}

#[test]
fn every_dependency_is_used_by_a_line() {
    let metadata = metadata();
    let members = metadata["workspace_members"].as_array().unwrap();
    let nodes = metadata["resolve"]["nodes"].as_array().unwrap();
    let mut unused = Vec::new();
    for p in metadata["packages"].as_array().unwrap().iter().filter(|p| members.contains(&p["id"])) {
        let folder = Path::new(p["manifest_path"].as_str().unwrap()).parent().unwrap();
        let mut text = String::new();
        let parts: &[&str] = if folder == root() {
            &["pipeline", "tests", "benches", "examples"]
        } else {
            &["src", "tests", "benches", "examples"]
        };
        parts.iter().for_each(|part| text_of(&folder.join(part), &mut text));
        let node = nodes.iter().find(|n| n["id"] == p["id"]).unwrap();
        for name in node["deps"].as_array().unwrap().iter().map(|d| d["name"].as_str().unwrap()) {
            // an attribute (`derive(thiserror::Error)`), a path, a `use`, a macro
            let signs = [format!("{name}::"), format!("use {name};"), format!("{name}!")];
            if !FOR_FEATURES.contains(&name) && !signs.iter().any(|w| text.contains(w)) {
                unused.push(format!("{}: {name}", p["name"].as_str().unwrap()));
            }
        }
    }
    assert!(unused.is_empty(), "no line uses {}", unused.join(", "));
}

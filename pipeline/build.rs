//! Gives the program a digest of its own source, so that stages kept by another version are not taken for this one's.
#![expect(clippy::disallowed_methods, reason = "a build script reads sources and talks to cargo")]

use std::path::{Path, PathBuf};

fn main() {
    let mut hasher = blake3::Hasher::new();
    let mut files = Vec::new();
    for root in roots() {
        println!("cargo:rerun-if-changed={}", root.display());
        collect(&root, &mut files);
    }
    files.sort();
    for file in files {
        hasher.update(file.to_string_lossy().as_bytes());
        hasher.update(&std::fs::read(&file).expect("a source that was just listed can be read"));
    }
    println!("cargo:rustc-env=GENU_CODE_DIGEST={}", hasher.finalize().to_hex());
}

/// What the program is made of: `src` and `data` of every crate of the workspace, and the locked dependencies.
fn roots() -> Vec<PathBuf> {
    let mut roots = vec![PathBuf::from("Cargo.lock"), PathBuf::from("data")];
    for folder in std::fs::read_dir(".").expect("the workspace can be listed").flatten() {
        let crate_of_ours = folder.path().join("Cargo.toml").exists() || folder.file_name() == "pipeline";
        let parts = ["src", "data"].map(|part| folder.path().join(part));
        roots.extend(parts.into_iter().filter(|part| crate_of_ours && part.exists()));
    }
    roots.sort();
    roots
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in std::fs::read_dir(path).expect("a source folder can be listed").flatten() {
            collect(&entry.path(), files);
        }
    } else if path.exists() {
        files.push(path.to_path_buf());
    }
}

//! Gives the program a digest of its own source, so that stages kept by another version are not taken for this one's.
#![expect(clippy::disallowed_methods, reason = "a build script reads sources and talks to cargo")]

use std::path::{Path, PathBuf};

const SOURCES: [&str; 6] = ["meshes/src", "attachments/src", "sim/src", "stages/src", "pipeline/src", "Cargo.lock"];

fn main() {
    let mut hasher = blake3::Hasher::new();
    for root in SOURCES {
        println!("cargo:rerun-if-changed={root}");
        let mut files = Vec::new();
        collect(Path::new(root), &mut files);
        files.sort();
        for file in files {
            hasher.update(file.to_string_lossy().as_bytes());
            hasher.update(&std::fs::read(&file).expect("a source that was just listed can be read"));
        }
    }
    println!("cargo:rustc-env=GENU_CODE_DIGEST={}", hasher.finalize().to_hex());
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

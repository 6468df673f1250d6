//! Whole specimen directories, corrupted: exit 1 with the file's name, or the same surfaces, or a warning.
//!
//! `GENU_CORRUPTIONS=1000` makes it as many; 40 without.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod common;
#[path = "common/readers.rs"]
mod readers;

use common::{build_model, copy, phantom, read, text, write};
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use readers::{Dice, corrupted};
use std::path::Path;
use tempfile::TempDir;

const FILES: [&str; 7] = [
    "specimen.toml",
    "ct/femur.stl",
    "ct/tibfib.stl",
    "scans/femur.ply",
    "scans/tibfib.ply",
    "landmarks.csv",
    "marks.csv",
];

/// Runs as far as ingest.
fn ingested(specimen: &Path, out: &Path) -> (Option<i32>, String) {
    let run = build_model()
        .arg(specimen)
        .arg("--out")
        .arg(out)
        .args(["--to", "ingest", "--jobs", "1"])
        .timeout(std::time::Duration::from_secs(60))
        .output()
        .unwrap();
    let words = [run.stdout, run.stderr].concat();
    (run.status.code(), String::from_utf8_lossy(&words).into_owned())
}

fn surface(out: &Path, name: &str) -> TriMesh {
    let name = format!("01-ingest/{name}.ply");
    meshes::format::read_surface(&name, &read(&out.join(&name)), &Default::default()).unwrap().mesh
}

const SURFACES: [&str; 4] = ["ct_femur", "ct_tibfib", "scan_femur", "scan_tibfib"];

#[test]
fn a_corrupted_directory_is_refused_by_name_or_read_right() {
    let count = std::env::var("GENU_CORRUPTIONS").ok().and_then(|n| n.parse().ok()).unwrap_or(40);
    let good = phantom("S193761-phantom");
    let clean = TempDir::new().unwrap();
    assert_eq!(ingested(good.path(), clean.path()).0, Some(0));
    let right = SURFACES.map(|name| SurfaceQuery::new(&surface(clean.path(), name)).unwrap());
    let points = text(&clean.path().join("01-ingest/points.json"));
    let mut dice = Dice(2026);
    let (mut refused, mut warned, mut same, mut noticed) = (0, 0, 0, 0);
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    copy(good.path(), folder.path());
    for i in 0..count {
        let file = FILES[dice.below(FILES.len())];
        let whole = read(&good.path().join(file));
        write(&folder.path().join(file), corrupted(&whole, &mut dice));
        let (code, words) = ingested(folder.path(), out.path());
        match code {
            Some(1) => {
                assert!(
                    words.contains(file) || file == "specimen.toml" && words.contains("specimen"),
                    "{i} {file}: {words}"
                );
                refused += 1;
            }
            Some(0) if words.contains("warning") => warned += 1,
            Some(0) => {
                for (name, query) in SURFACES.iter().zip(&right) {
                    let worst = surface(out.path(), name)
                        .vertices
                        .iter()
                        .map(|p| query.nearest(p).distance)
                        .fold(0.0, f64::max);
                    assert!(worst < 1.0, "{i} {file}: {name} is {worst:.2} mm off, without a word");
                }
                // Points are written out for the eye, and held against the bones in later stages.
                if text(&out.path().join("01-ingest/points.json")) == points { same += 1 } else { noticed += 1 }
            }
            code => panic!("{i} {file}: exit status {code:?}: {words}"),
        }
        write(&folder.path().join(file), whole);
    }
    println!(
        "{count} corruptions: {refused} refused, {warned} with a warning, {same} as before, {noticed} with other points"
    );
}

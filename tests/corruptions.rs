//! Whole specimen directories, corrupted: exit 1 with the file's name, or a warning, or the same model.
//!
//! `GENU_CORRUPTIONS=1000` makes it as many, and each may take an hour, as such a run stands back for other work; 40 of 5 minutes without.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use crate::common::readers::{Dice, corrupted};
use crate::common::{build_model, copy, json, phantom, read, text, write};
use meshes::Vector;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use serde_json::Value;
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

/// How many, where it is asked for.
fn asked() -> Option<usize> {
    std::env::var("GENU_CORRUPTIONS").ok()?.parse().ok()
}

/// Runs as far as `stage`.
fn built(specimen: &Path, out: &Path, stage: &str) -> (Option<i32>, String) {
    let patience = if asked().is_some() { 3600 } else { 300 };
    let run = build_model()
        .arg(specimen)
        .arg("--out")
        .arg(out)
        .args(["--to", stage, "--jobs", "1"])
        .timeout(std::time::Duration::from_secs(patience))
        .output()
        .unwrap();
    let words = [run.stdout, run.stderr].concat();
    (run.status.code(), String::from_utf8_lossy(&words).into_owned())
}

fn surface(out: &Path, name: &str) -> TriMesh {
    let name = format!("01-ingest/{name}.ply");
    formats::read_surface(&name, &read(&out.join(&name)), &Default::default()).unwrap().mesh
}

/// How far a build's frames and attachment sites are from the right ones: mm, degrees, mm.
fn apart(out: &Path, right: &Path) -> (f64, f64, f64) {
    let [here, there] = [out, right].map(|o| json(&o.join("05-frames/frames.json")));
    let triple = |v: &Value| Vector::from_fn(|k, _| v[k].as_f64().unwrap());
    let (mut shift, mut turn, mut sites) = (0.0_f64, 0.0_f64, 0.0_f64);
    for bone in ["femur", "tibia"] {
        shift = shift.max((triple(&here[bone]["origin"]) - triple(&there[bone]["origin"])).norm());
        for axis in ["medial", "anterior", "superior"] {
            turn = turn.max(triple(&here[bone][axis]).angle(&triple(&there[bone][axis])).to_degrees());
        }
    }
    let [here, there] = [out, right].map(|o| json(&o.join("06-attachments/sites.json")));
    let (here, there) = (here.as_array().unwrap(), there.as_array().unwrap());
    for site in there {
        let same = here.iter().find(|s| s["ligament"] == site["ligament"] && s["bone"] == site["bone"]);
        let off = same.map_or(f64::INFINITY, |s| (triple(&s["centroid"]) - triple(&site["centroid"])).norm());
        sites = sites.max(off);
    }
    (shift, turn, sites)
}

const SURFACES: [&str; 4] = ["ct_femur", "ct_tibfib", "scan_femur", "scan_tibfib"];

#[test]
fn a_corrupted_directory_is_refused_by_name_or_read_right() {
    let count = asked().unwrap_or(40);
    let good = phantom("S193761-phantom");
    let clean = TempDir::new().unwrap();
    let (code, words) = built(good.path(), clean.path(), "attachments");
    assert_eq!(code, Some(0), "{words}");
    let warnings = words.matches("warning").count();
    let right = SURFACES.map(|name| SurfaceQuery::new(&surface(clean.path(), name)).unwrap());
    let points = text(&clean.path().join("01-ingest/points.json"));
    let mut dice = Dice(2026);
    let (mut refused, mut warned, mut same, mut farther) = (0, 0, 0, 0);
    let (folder, out) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    copy(good.path(), folder.path());
    for i in 0..count {
        if i % 50 == 49 {
            println!("{i}: {refused} refused, {warned} with a warning, {same} the same model so far");
        }
        let file = FILES[dice.below(FILES.len())];
        let whole = read(&good.path().join(file));
        write(&folder.path().join(file), corrupted(&whole, &mut dice));
        let (code, words) = built(folder.path(), out.path(), "ingest");
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
                if text(&out.path().join("01-ingest/points.json")) == points {
                    same += 1;
                    write(&folder.path().join(file), whole);
                    continue;
                }
                // Points are held against the bones in later stages.
                farther += 1;
                let (code, words) = built(folder.path(), out.path(), "attachments");
                match code {
                    Some(1) => refused += 1,
                    Some(0) if words.matches("warning").count() > warnings => warned += 1,
                    Some(0) => {
                        let (shift, turn, sites) = apart(out.path(), clean.path());
                        assert!(
                            shift < 1.0 && turn < 1.0 && sites < 2.0,
                            "{i} {file}: frames {shift:.2} mm and {turn:.2} deg, sites {sites:.2} mm off, without a word\n{words}"
                        );
                        same += 1;
                    }
                    code => panic!("{i} {file}: exit status {code:?}: {words}"),
                }
            }
            code => panic!("{i} {file}: exit status {code:?}: {words}"),
        }
        write(&folder.path().join(file), whole);
    }
    println!(
        "{count} corruptions: {refused} refused, {warned} with a warning, {same} the same model; {farther} of them were built as far as the attachments"
    );
}

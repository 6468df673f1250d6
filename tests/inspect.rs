//! `inspect`: what each stage made, in a terminal and as JSON.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at what a build left")]

use crate::common::{build_model, json, phantom};
use serde_json::Value;
use std::path::Path;

fn inspect(dir: &Path, more: &[&str]) -> (Option<i32>, String) {
    let run = build_model().arg("inspect").arg(dir).args(more).output().unwrap();
    (run.status.code(), String::from_utf8_lossy(&[run.stdout, run.stderr].concat()).into_owned())
}

#[test]
fn every_stage_with_its_time_memory_metrics_warnings_and_files() {
    let folder = phantom("S192803-phantom");
    build_model()
        .arg(folder.path())
        .args(["--quiet", "--to", "bones", "--set", "bones.edge_mm=2.5"])
        .assert()
        .success();
    let build = folder.path().join("build");
    let (code, table) = inspect(folder.path(), &[]);
    assert_eq!(code, Some(0));
    for words in [
        "stage",
        "seconds",
        "MiB",
        "metrics",
        "01  ingest",
        "02  register",
        "03  bones",
        "predicted_error_mm",
        "3 stages",
    ] {
        assert!(table.contains(words), "{words:?} is not in:\n{table}");
    }
    assert_eq!(inspect(&build, &[]), (code, table.clone()), "the build's own folder");

    let (code, text) = inspect(folder.path(), &["--json"]);
    let all: Vec<Value> = serde_json::from_str(&text).unwrap();
    assert_eq!((code, all.len()), (Some(0), 3));
    for record in &all {
        let stage = record["stage"].as_str().unwrap();
        assert!(record["seconds"].as_f64().unwrap() > 0.0 && record["peak_memory_mib"].as_f64().unwrap() > 1.0);
        let inner = build.join(record["folder"].as_str().unwrap());
        assert_eq!(record["metrics"], json(&inner.join("metrics.json")), "{stage}");
        let files = record["files"].as_array().unwrap();
        assert_eq!(files.len(), std::fs::read_dir(&inner).unwrap().count(), "{stage}");
        for file in files {
            let size = std::fs::metadata(inner.join(file["name"].as_str().unwrap())).unwrap().len();
            assert_eq!(file["bytes"].as_u64(), Some(size), "{stage} {file}");
        }
        for warning in record["warnings"].as_array().unwrap() {
            assert!(table.contains(warning.as_str().unwrap()), "{warning}");
        }
    }
}

#[test]
fn one_stage_in_full_and_one_that_is_not_there() {
    let folder = phantom("S192803-phantom");
    assert_eq!(inspect(folder.path(), &[]).0, Some(1), "nothing is built");
    build_model().arg(folder.path()).args(["--quiet", "--to", "register"]).assert().success();
    let (code, text) = inspect(folder.path(), &["register"]);
    assert_eq!(code, Some(0));
    for words in ["transforms.json", "femur_residual.ply", "KiB", "held_out_rms_mm"] {
        assert!(text.contains(words), "{words:?} is not in:\n{text}");
    }
    assert!(!text.contains("01  ingest"));
    let (_, one) = inspect(folder.path(), &["register", "--json"]);
    let one: Vec<Value> = serde_json::from_str(&one).unwrap();
    assert_eq!((one.len(), one[0]["stage"].as_str()), (1, Some("register")));
    let (code, text) = inspect(folder.path(), &["bones"]);
    assert!(code == Some(1) && text.contains("bones has not been run"), "{text}");
}

#[test]
fn what_stopped_a_build_is_told() {
    let folder = phantom("S192803-phantom");
    build_model().arg(folder.path()).args(["--quiet", "--set", "register.error_limit_mm=0.001"]).assert().code(1);
    let (_, table) = inspect(folder.path(), &[]);
    assert!(table.contains("stopped at register: "), "{table}");
    let (_, text) = inspect(folder.path(), &["--json"]);
    let all: Vec<Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(all.last().unwrap()["failed"]["stage"], "register");
}

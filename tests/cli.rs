//! The command line: verbs, exit statuses, words.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{build_model, phantom};
use predicates::str::contains;
use tempfile::TempDir;

#[test]
fn wrong_use_ends_with_2_and_says_what_was_expected() {
    let specimen = phantom("S193761-phantom");
    for (arguments, words) in [
        (vec![], "Usage"),
        (vec!["--to", "bonse"], "ingest, register, bones"),
        (vec!["--from", "frames", "--to", "bones"], "comes after"),
        (vec!["--set", "bones.edge_mm"], "stage.key=value"),
        (vec!["--set", "bones.no_such=1"], "bones.no_such"),
        (vec!["--set", "bnes.edge_mm=1"], "bnes"),
        (vec!["--jobs", "0"], "--jobs"),
        (vec!["--no-such"], "--no-such"),
    ] {
        let mut command = build_model();
        if !arguments.is_empty() {
            command.arg(specimen.path());
        }
        command.args(&arguments).assert().code(2).stderr(contains(words));
    }
    assert!(!specimen.path().join("build/01-ingest").exists());
}

#[test]
fn help_and_version() {
    build_model().arg("--help").assert().success().stdout(contains("phantom")).stdout(contains("inspect"));
    build_model().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_phantom_is_written_built_and_inspected() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    build_model().arg("phantom").arg("right-phantom").arg(&knee).assert().success().stdout(contains("synthetic"));
    build_model().arg("phantom").arg("no-such").arg(&knee).assert().code(1).stderr(contains("right-phantom"));
    build_model().arg("phantom").arg("S193761-phantom").arg(&knee).assert().code(1).stderr(contains("not empty"));
    build_model().arg("inspect").arg(&knee).assert().code(1).stderr(contains("no build"));
    build_model().arg(&knee).args(["--to", "bones"]).assert().success().stdout(contains("report.html"));
    build_model().arg("inspect").arg(&knee).assert().success().stdout(contains("03  bones"));
    build_model()
        .arg("inspect")
        .arg(&knee)
        .args(["bones", "--json"])
        .assert()
        .success()
        .stdout(contains("\"stage\": \"bones\""));
    build_model().arg("inspect").arg(&knee).arg("hexmesh").assert().code(1).stderr(contains("has not been run"));
    build_model().arg("report").arg(&knee).assert().success().stdout(contains("report.html"));
}

#[test]
fn json_and_quiet_print_nothing_else() {
    let specimen = phantom("S193761-phantom");
    let run = build_model().arg(specimen.path()).args(["--to", "ingest", "--json"]).output().unwrap();
    let records: Vec<serde_json::Value> = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(records[0]["stage"], "ingest");
    assert!(run.stderr.is_empty());
    let run = build_model().arg(specimen.path()).args(["--to", "ingest", "--quiet"]).output().unwrap();
    assert!(run.stdout.is_empty() && run.stderr.is_empty());
}

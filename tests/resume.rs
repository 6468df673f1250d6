//! The same bytes on any number of threads, after any interruption; only what changed runs again.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at what a build left")]

mod common;

use common::{build_model, differing, files, phantom, text, write};
use std::path::Path;
use std::time::Duration;
use tempfile::TempDir;

fn build(specimen: &Path, out: &Path, arguments: &[&str]) {
    build_model().arg(specimen).arg("--out").arg(out).args(arguments).arg("--quiet").assert().success();
}

/// Which stages ran, of the last build in `out`.
fn ran(out: &Path) -> Vec<String> {
    text(&out.join("log.jsonl"))
        .lines()
        .map(|l| serde_json::from_str::<serde_json::Value>(l).unwrap())
        .filter(|r| r["cached"] == false)
        .map(|r| r["stage"].as_str().unwrap().to_string())
        .collect()
}

#[test]
fn one_thread_and_two_give_the_same_bytes() {
    let specimen = phantom("S193761-phantom");
    let (one, two) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    build(specimen.path(), one.path(), &["--jobs", "1"]);
    build(specimen.path(), two.path(), &["--jobs", "2"]);
    let (one, two) = (files(one.path()), files(two.path()));
    assert!(one.contains_key("09-assemble/model.json") && one.contains_key("report.html"));
    assert_eq!(differing(&one, &two), Vec::<String>::new());
}

#[test]
fn only_what_depends_on_a_change_runs_again() {
    let specimen = phantom("S193761-phantom");
    let out = TempDir::new().unwrap();
    let all =
        ["ingest", "register", "bones", "cartilage", "frames", "attachments", "hexmesh", "overclosure", "assemble"];
    build(specimen.path(), out.path(), &[]);
    assert_eq!(ran(out.path()), all);
    let first = files(out.path());
    build(specimen.path(), out.path(), &[]);
    assert_eq!(ran(out.path()), Vec::<String>::new());
    assert_eq!(differing(&first, &files(out.path())), Vec::<String>::new());
    build(specimen.path(), out.path(), &["--set", "overclosure.gap_mm=0.06"]);
    assert_eq!(ran(out.path()), ["overclosure", "assemble"]);
    build(specimen.path(), out.path(), &["--from", "hexmesh", "--to", "hexmesh"]);
    assert_eq!(ran(out.path()), ["hexmesh"]);
    // A file changed by hand is not believed; its stage gives the same again and nothing after it changes.
    let path = out.path().join("03-bones/femur.ply");
    std::fs::write(&path, b"changed").unwrap();
    build(specimen.path(), out.path(), &[]);
    assert_eq!(ran(out.path()), ["bones", "overclosure", "assemble"]);
    assert_eq!(differing(&first, &files(out.path())), Vec::<String>::new());
    // A specimen that changed.
    let toml = specimen.path().join("specimen.toml");
    write(&toml, text(&toml) + "\n[ligaments.LCL]\nstiffness_n_per_mm = 61.0\n");
    build(specimen.path(), out.path(), &[]);
    assert!(ran(out.path()).contains(&"assemble".to_string()));
}

#[test]
fn a_killed_build_goes_on_to_the_same_bytes() {
    let specimen = phantom("S193761-phantom");
    let whole = TempDir::new().unwrap();
    let start = std::time::Instant::now();
    build(specimen.path(), whole.path(), &[]);
    let time = start.elapsed();
    let whole = files(whole.path());
    let broken = TempDir::new().unwrap();
    for share in [0.07, 0.31, 0.55, 0.83] {
        let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("build-model"))
            .arg(specimen.path())
            .arg("--out")
            .arg(broken.path())
            .args(["--quiet", "--force"])
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_secs_f64(share * time.as_secs_f64()));
        let _ = child.kill();
        child.wait().unwrap();
    }
    build(specimen.path(), broken.path(), &[]);
    assert_eq!(differing(&whole, &files(broken.path())), Vec::<String>::new());
}

#[test]
fn two_builds_do_not_write_one_folder() {
    let specimen = phantom("S193761-phantom");
    let out = TempDir::new().unwrap();
    let mut first = std::process::Command::new(assert_cmd::cargo::cargo_bin("build-model"))
        .arg(specimen.path())
        .arg("--out")
        .arg(out.path())
        .arg("--quiet")
        .spawn()
        .unwrap();
    while !out.path().join(".lock").exists() {
        std::thread::sleep(Duration::from_millis(2));
    }
    std::thread::sleep(Duration::from_millis(50));
    build_model()
        .arg(specimen.path())
        .arg("--out")
        .arg(out.path())
        .assert()
        .code(1)
        .stderr(predicates::str::contains("another build-model"));
    assert!(first.wait().unwrap().success());
}

//! The same bytes on any number of threads, after any interruption; only what changed runs again.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at what a build left")]

use crate::common::{build_model, differing, files, phantom, text, thinned, write};
use std::collections::{BTreeMap, BTreeSet};
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

/// What each stage is given, as the pages of the stages tell: earlier stages, and files.
const GIVEN: [(&str, &[&str]); 12] = [
    (
        "ingest",
        &[
            "specimen.toml",
            "ct/femur.stl",
            "ct/tibfib.stl",
            "scans/femur.ply",
            "scans/tibfib.ply",
            "landmarks.csv",
            "marks.csv",
        ],
    ),
    ("register", &["ingest"]),
    ("bones", &["ingest"]),
    ("cartilage", &["ingest", "register", "bones"]),
    ("frames", &["ingest", "bones"]),
    ("attachments", &["ingest", "register", "bones", "cartilage", "frames"]),
    ("hexmesh", &["cartilage"]),
    ("overclosure", &["hexmesh"]),
    ("assemble", &["ingest", "frames", "attachments", "overclosure"]),
    ("calibrate", &["assemble", "bones", "cartilage", "laxity/kla.csv", "laxity/rks.csv"]),
    ("validate", &["assemble", "bones", "cartilage", "calibrate", "passive.csv"]),
    ("diagnose", &["assemble", "bones", "cartilage", "calibrate", "laxity/kla.csv", "laxity/rks.csv"]),
];

/// The stages that depend on a stage or a file, itself among them.
fn dependent(on: &str) -> Vec<&'static str> {
    let mut all = Vec::new();
    for (stage, given) in GIVEN {
        if stage == on || given.iter().any(|g| *g == on || all.contains(g)) {
            all.push(stage);
        }
    }
    all
}

/// The stages that a plan says would run.
fn planned(specimen: &Path, out: &Path, more: &[&str]) -> Vec<String> {
    let run = build_model().arg(specimen).arg("--out").arg(out).args(SHORT).args(more).arg("--plan").output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let words = String::from_utf8(run.stdout).unwrap();
    let lines = words.lines().filter(|l| l.contains("would run"));
    lines.map(|l| l.split_whitespace().next().unwrap().to_owned()).collect()
}

/// A short search, so that every stage is there to depend on something.
const SHORT: [&str; 10] = [
    "--set",
    "calibrate.inference.samples=0",
    "--set",
    "calibrate.inference.starts=1",
    "--set",
    "validate.ap_flexions_deg=[30]",
    "--set",
    "diagnose.run=true",
    "--set",
    "diagnose.nulls=0",
];

/// A phantom on disk with a third of its trials: what stages 10 to 12 find is not judged here.
fn phantom_of_few_trials() -> TempDir {
    let specimen = TempDir::new().unwrap();
    build_model().args(["phantom", "S192803-phantom"]).arg(specimen.path()).assert().success();
    for name in ["laxity/kla.csv", "laxity/rks.csv"] {
        let path = specimen.path().join(name);
        write(&path, thinned(&text(&path), 3, &[]));
    }
    specimen
}

#[test]
fn a_change_of_an_option_or_a_file_runs_again_exactly_what_depends_on_it() {
    let specimen = phantom_of_few_trials();
    let place = |name: &str| specimen.path().join(name);
    let passive = "fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n10,0,0,0,0,0\n20,0,0,0,0,0\n";
    write(&place("passive.csv"), passive);
    let toml = text(&place("specimen.toml")) + "\n[passive]\nrks = \"passive.csv\"\n";
    write(&place("specimen.toml"), &toml);
    let out = TempDir::new().unwrap();
    build(specimen.path(), out.path(), &SHORT);
    let stages = GIVEN.map(|(stage, _)| stage);
    assert_eq!(ran(out.path()), stages);
    let before = files(out.path());
    assert_eq!(planned(specimen.path(), out.path(), &[]), [""; 0]);
    // an option of every stage; that each option is in the key of its own stage alone is a test of the list of stages
    let options = [
        ("ingest", "ingest.ras=[\"points\"]"),
        ("register", "register.seed=7"),
        ("bones", "bones.edge_mm=2.5"),
        ("cartilage", "cartilage.least_thickness_mm=0.6"),
        ("frames", "frames.valgus_deg=5"),
        ("attachments", "attachments.mark_reach_mm=5"),
        ("hexmesh", "hexmesh.layers=4"),
        ("overclosure", "overclosure.gap_mm=0.06"),
        ("assemble", "assemble.friction=0.02"),
        ("calibrate", "calibrate.seed=7"),
        ("validate", "validate.compression_n=30"),
        ("diagnose", "diagnose.seed=7"),
    ];
    assert_eq!(options.map(|(stage, _)| stage), stages);
    for (stage, set) in options {
        assert_eq!(planned(specimen.path(), out.path(), &["--set", set]), dependent(stage), "{set}");
        assert_eq!(planned(specimen.path(), out.path(), &["--from", stage, "--to", stage]), [stage]);
    }
    // every file that is read; a space at its end changes none of what a table says
    let read: BTreeSet<&str> =
        GIVEN.iter().flat_map(|(_, given)| *given).copied().filter(|g| g.contains('.')).collect();
    for name in read {
        let was = crate::common::read(&place(name));
        let changed = match name {
            "specimen.toml" => toml.replace("[specimen]", "[specimen]\nage_years = 31").into_bytes(),
            "passive.csv" => passive.replace("20,0", "20,1").into_bytes(),
            _ => [was.clone(), b"\n".to_vec()].concat(),
        };
        write(&place(name), changed);
        assert_eq!(planned(specimen.path(), out.path(), &[]), dependent(name), "{name}");
        write(&place(name), was);
    }
    // options in specimen.toml are told by section; a plan writes nothing
    write(&place("specimen.toml"), toml + "\n[options.frames]\nvalgus_deg = 5\n");
    assert_eq!(planned(specimen.path(), out.path(), &[]), dependent("frames"));
    assert_eq!(differing(&before, &files(out.path())), Vec::<String>::new());
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

/// Parts of stages at work that are kept in a build's folder, with when they were written.
fn parts(folder: &Path) -> BTreeMap<String, std::time::SystemTime> {
    let entries = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap());
    let own = entries.filter(|e| e.file_name().to_string_lossy().starts_with(".part-"));
    own.map(|e| (e.file_name().to_string_lossy().into_owned(), e.metadata().unwrap().modified().unwrap())).collect()
}

/// At how many moments of stages 10 to 12 a build is killed.
const MOMENTS: u32 = 4;

#[test]
fn no_finished_calibration_is_made_twice() {
    let specimen = phantom_of_few_trials();
    let (whole, broken) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let to_assemble: Vec<&str> = SHORT.iter().copied().chain(["--to", "assemble"]).collect();
    for out in [&whole, &broken] {
        build(specimen.path(), out.path(), &to_assemble);
    }
    let start = std::time::Instant::now();
    build(specimen.path(), whole.path(), &SHORT);
    let time = start.elapsed();
    let mut known = BTreeMap::new();
    for moment in 0..MOMENTS {
        let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("build-model"))
            .arg(specimen.path())
            .arg("--out")
            .arg(broken.path())
            .args(SHORT)
            .arg("--quiet")
            .spawn()
            .unwrap();
        // further and further into what is left to do, and at the end not before a part is finished: a busy machine is slower than it was
        let begun = std::time::Instant::now();
        let share = time.mul_f64(0.12 + 0.4 * f64::from(moment) / f64::from(MOMENTS));
        let last = moment + 1 == MOMENTS;
        let early = || begun.elapsed() < share || (last && known.is_empty() && parts(broken.path()).is_empty());
        while early() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = child.kill();
        child.wait().unwrap();
        let now = parts(broken.path());
        for (name, written) in &now {
            assert!(
                known.get(name).is_none_or(|before| before == written),
                "{name} was made twice, at moment {moment}"
            );
        }
        known.extend(now);
    }
    assert!(!known.is_empty(), "no moment met a finished part");
    build(specimen.path(), broken.path(), &SHORT);
    assert!(parts(broken.path()).is_empty());
    let (whole, broken) = (files(whole.path()), files(broken.path()));
    assert!(whole.contains_key("12-diagnose/diagnosis.json") && whole.contains_key("10-calibrate/joint/model.json"));
    assert_eq!(differing(&whole, &broken), Vec::<String>::new());
}

#[test]
#[cfg(unix)]
fn ctrl_c_says_what_is_kept_and_how_to_go_on() {
    let specimen = phantom("S193761-phantom");
    let out = specimen.path().join("my build");
    let child = std::process::Command::new(assert_cmd::cargo::cargo_bin("build-model"))
        .arg(specimen.path())
        .arg("--out")
        .arg(&out)
        .args(["--quiet", "--force"])
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    while !out.join("01-ingest").exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(50));
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(said.contains("interrupted. Kept in ") && said.contains("Go on: build-model "), "{said}");
    assert!(said.contains("/my build'") && !said.contains("--force"), "{said}");
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
        .code(3)
        .stderr(predicates::str::contains("another build-model"));
    assert!(first.wait().unwrap().success());
}

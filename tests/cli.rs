//! The command line: verbs, exit statuses, words.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{build_model, json, phantom, read, write};
use crate::one_knee;
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

/// Verbs with results at --out, each with the file that is edited there; the words that are the same for all come after.
const WITH_RESULTS: [(&[&str], &str); 5] = [
    (&["simulate", "--protocol", "pivot-shift", "--samples", "0"], ""),
    (&["validate", "--samples", "0"], "compare.csv"),
    (&["credibility"], "credibility.json"),
    (&["cohort"], "cohort.html"),
    (&["export", "--format", "stl"], "femur_bone.stl"),
];

#[test]
fn what_was_edited_stays_in_every_verb_until_forced() {
    let out = TempDir::new().unwrap();
    let knee = one_knee::specimen().display().to_string();
    for (words, inner) in WITH_RESULTS {
        let place = out.path().join(words[0]);
        let file = if inner.is_empty() { place.clone() } else { place.join(inner) };
        let run = |more: &[&str]| {
            let mut command = build_model();
            command.args(words).arg(&knee).arg("--out").arg(&place).args(more).assert()
        };
        run(&[]).success();
        run(&[]).success();
        write(&file, "by hand");
        let told = run(&["--json"]).code(1);
        let error: serde_json::Value = serde_json::from_slice(&told.get_output().stderr).unwrap();
        assert_eq!((&error["code"], &error["file"]), (&"file".into(), &file.display().to_string().into()), "{error}");
        for part in ["message", "advice"] {
            assert!(error[part].as_str().unwrap().contains("--force"), "{error}");
        }
        assert_eq!(read(&file), b"by hand", "{words:?}");
        run(&["--force"]).success();
        assert_ne!(read(&file), b"by hand", "{words:?}");
    }
}

#[test]
#[cfg(unix)]
fn a_file_of_others_is_no_result() {
    let out = TempDir::new().unwrap();
    let (file, link) = (out.path().join("notes.csv"), out.path().join("link.csv"));
    write(&file, "years of work");
    std::os::unix::fs::symlink("notes.csv", &link).unwrap();
    for place in [&file, &link] {
        let mut command = build_model();
        command.arg("simulate").arg(one_knee::specimen()).args([
            "--protocol",
            "pivot-shift",
            "--samples",
            "0",
            "--out",
        ]);
        command.arg(place).assert().code(1).stderr(contains("--force"));
        assert_eq!(read(&file), b"years of work");
    }
}

#[test]
fn details_go_to_standard_error_and_change_nothing_else() {
    let out = TempDir::new().unwrap();
    let knee = one_knee::specimen().display().to_string();
    let commands: [&[&str]; 4] = [&["inspect", &knee], &["options"], &["credibility", &knee], &["cohort", &knee]];
    for words in commands {
        let place = out.path().join(words[0]).display().to_string();
        let more: &[&str] = if ["inspect", "options"].contains(&words[0]) { &[] } else { &["--out", &place] };
        let run = |flag: &[&str]| {
            let done = build_model().args(words).args(more).args(flag).assert().success();
            let texts = [&done.get_output().stdout, &done.get_output().stderr];
            texts.map(|bytes| String::from_utf8(bytes.clone()).unwrap())
        };
        let ([plain, _], [same, told]) = (run(&[]), run(&["-v"]));
        assert_eq!(plain, same, "{words:?}");
        let details: Vec<&str> = told.lines().filter(|l| l.get(8..11) == Some(" s ")).collect();
        assert!(details[0].contains("build-model") && details.last().unwrap().contains("ends with 0"), "{told}");
        assert!(words[0] == "options" || details.iter().any(|l| l.contains("reads ")), "{told}");
        assert_eq!(details.iter().any(|l| l.contains("writes ")), !more.is_empty(), "{told}");
    }
    let specimen = phantom("S193761-phantom");
    let run = build_model().arg(specimen.path()).args(["--to", "ingest", "--verbose"]).assert().success();
    let told = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    for part in ["specimen.toml", "ingest begins", "ingest is done", "01-ingest", "ends with 0"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    build_model().arg(specimen.path()).args(["-v", "-q"]).assert().code(2);
    assert!(json(&specimen.path().join("build/01-ingest/metrics.json")).is_object());
}

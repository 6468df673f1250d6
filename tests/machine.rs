//! What programs read: `--json` is data that obeys its schema, errors are data, warnings stand on standard error, `--quiet` is silence.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

use crate::common::{build_model, text, write};
use crate::one_knee;
use crate::schema::obeys;
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// A value of the program's output, held against the schema that the program tells.
fn held(name: &str, bytes: &[u8]) -> Value {
    let schema: Value = serde_json::from_str(&genu::schema::schema(name).unwrap()).unwrap();
    let value = serde_json::from_slice(bytes).unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(bytes)));
    obeys(&value, &schema, &schema).unwrap_or_else(|e| panic!("{name}: {e}"));
    value
}

#[test]
fn verbs_that_compute_tell_data_of_their_schemas() {
    let (knee, out) = (one_knee::specimen(), TempDir::new().unwrap());
    let path = |name: &str| out.path().join(name).display().to_string();
    let run = |name: &str, arguments: &[&str]| {
        let mut command = build_model();
        let run = command.arg(name).args(arguments).arg("--json").assert().success();
        assert!(run.get_output().stderr.is_empty(), "{}", String::from_utf8_lossy(&run.get_output().stderr));
        held(name, &run.get_output().stdout)
    };
    let place = knee.to_str().unwrap();
    let told = run("simulate", &[place, "--protocol", "pivot-shift", "--out", &path("r.csv")]);
    let rows = text(out.path().join("r.csv").as_path());
    let columns: Vec<&str> = told["columns"].as_array().unwrap().iter().map(|c| c.as_str().unwrap()).collect();
    assert_eq!(columns.join(","), rows.lines().next().unwrap());
    assert_eq!(told["rows"], rows.lines().count() - 1);
    assert_eq!((&told["samples"], &told["model"]["calibrated_to"]), (&12.into(), &serde_json::json!(["kla", "rks"])));

    let told = run("export", &[place, "--format", "stl", "--out", &path("stl")]);
    let files = told["files"].as_array().unwrap();
    assert!(files.len() > 3 && files.iter().all(|f| out.path().join("stl").join(f.as_str().unwrap()).exists()));

    // of an earlier run, which would be read as of this one
    let stale = out.path().join("v/cross_prediction.csv");
    std::fs::create_dir_all(stale.parent().unwrap()).unwrap();
    write(&stale, "of another run");
    let mut refused = build_model();
    refused.args(["validate", place, "--out", &path("v"), "--samples", "0"]).assert().code(1);
    assert_eq!(text(&stale), "of another run", "a file of others is not removed unasked");
    let told = run("validate", &[place, "--out", &path("v"), "--samples", "0", "--force"]);
    assert!(!stale.exists());
    assert_eq!(told["models"].as_array().unwrap().len(), 3);
    assert!(told["differences"].as_array().unwrap().iter().all(|d| d["rmsd"].as_f64().unwrap() >= 0.0));

    let targets = knee.join("laxity/rks.csv").display().to_string();
    let few = ["inference.starts=1", "inference.finalists=1", "inference.rounds=1", "inference.samples=0"];
    let few = few.map(|option| format!("calibrate.{option}"));
    let set: Vec<&str> = few.iter().flat_map(|option| ["--set", option]).collect();
    let search = ["--as-assembled", "--targets", &targets, "--out", &path("c")];
    let told = run("calibrate", &[&[place], &search[..], &set].concat());
    assert_eq!(told["metrics"], serde_json::from_str::<Value>(&text(&out.path().join("c/metrics.json"))).unwrap());
    assert_eq!(
        told["calibrated"].as_str().unwrap(),
        out.path().join("c/model.json").canonicalize().unwrap().display().to_string()
    );
}

/// The verbs that answer with what they found or wrote.
#[test]
fn what_was_found_and_written_is_data_too() {
    let (knee, out) = (one_knee::specimen(), TempDir::new().unwrap());
    let path = |name: &str| out.path().join(name).display().to_string();
    let run = |name: &str, arguments: &[&str]| {
        let run = build_model().args(arguments).arg("--json").assert().success();
        held(name, &run.get_output().stdout)
    };
    let place = knee.to_str().unwrap();
    let bones = knee.join("ct").display().to_string();
    let told = run("init", &["init", &path("new"), "--from", &bones]);
    let placed = told["files"].as_array().unwrap().iter().filter_map(|f| f["to"].as_str());
    assert!(placed.map(|to| assert!(out.path().join("new").join(to).exists(), "{to}")).count() >= 2);
    let wanted = told["missing"].as_array().unwrap();
    assert!(wanted.iter().any(|m| m.as_str().unwrap().contains("scans/femur.ply")), "{wanted:?}");

    let told = run("phantom", &["phantom", "right-phantom", &path("phantom")]);
    assert!(told["files"].as_array().unwrap().iter().any(|f| f == "specimen.toml"));
    let told = run("check", &["check", place, "--out", &path("check")]);
    assert!(told.as_array().unwrap().iter().all(|item| item["state"] != "fault"));
    let told = run("inspect", &["inspect", place]);
    assert!(told.as_array().unwrap().iter().any(|s| s["stage"] == "assemble" && s["files"][0]["bytes"].is_u64()));
    let told = run("cohort", &["cohort", place, "--out", &path("cohort")]);
    assert_eq!((&told["knees"][0]["status"], &told["knees"][0]["failed"]), (&"built".into(), &Value::Null));
    run("options", &["options"]);

    let laxity = format!("rks={}", knee.join("laxity/rks.csv").display());
    let told = run("diagnose", &["diagnose", place, "--measured", &laxity, "--atlas", "--out", &path("atlas")]);
    assert_eq!(told["result"], serde_json::from_str::<Value>(&text(&out.path().join("atlas/atlas.json"))).unwrap());
    let told = run("export", &["export", place, "--format", "abaqus", "--out", &path("deck")]);
    let main = told["files"].as_array().unwrap().iter().filter_map(Value::as_str).find(|f| f.ends_with("_flex.inp"));
    let deck = out.path().join("deck").join(main.unwrap()).display().to_string();
    let told = run("import", &["import-abaqus", &deck, "--out", &path("model")]);
    assert!(told["fibres"].as_u64().unwrap() >= 30 && out.path().join("model/model.json").exists());
}

#[test]
fn a_report_is_data_of_its_page_its_stages_and_what_stopped_it() {
    let (knee, other) = (crate::common::phantom("S192803-phantom"), TempDir::new().unwrap());
    let [place, second] = [knee.path(), other.path()].map(|p| p.display().to_string());
    let build = |more: &[&str]| build_model().args(["build", &place, "--quiet"]).args(more).assert();
    build(&["--to", "ingest"]).success();
    build(&["--to", "ingest", "--out", &second]).success();
    let run = |more: &[&str]| {
        let run = build_model().args(["report", &place, "--json"]).args(more).assert().success();
        held("report", &run.get_output().stdout)
    };
    let own = knee.path().join("build");
    let there = |told: &Value, name: &str| {
        let path = Path::new(told.as_str().unwrap());
        assert!(path.exists() && path == own.join(name), "{told}");
    };
    let told = run(&[]);
    there(&told["page"], "report.html");
    there(&told["methods"], "methods.md");
    let record: Value = serde_json::from_str(text(&own.join("log.jsonl")).lines().next().unwrap()).unwrap();
    let (stage, digest) = (&told["stages"][0]["stage"], &told["stages"][0]["digest"]);
    assert_eq!((stage, digest), (&"ingest".into(), &record["digest"]));
    assert!(told["stages"].as_array().unwrap().len() == 1 && told["failed"].is_null(), "{told}");

    let told = run(&["--compare", &second]);
    there(&told["page"], "compare.html");
    assert_eq!((&told["compared_with"], &told["methods"]), (&second.as_str().into(), &Value::Null));

    build(&["--to", "register", "--set", "register.error_limit_mm=0.001"]).code(1);
    assert_eq!(run(&[])["failed"]["stage"], "register");
}

#[test]
fn an_error_is_data_with_its_file_row_and_column() {
    let folder = TempDir::new().unwrap();
    let trials = folder.path().join("bad.csv");
    write(&trials, text(&one_knee::specimen().join("laxity/kla.csv")).replacen(",30.000000,", ",thirty,", 1));
    let model = one_knee::specimen().display().to_string();
    let run = |arguments: &[&str]| {
        let mut command = build_model();
        let out = command.args(arguments).arg("--json").output().unwrap();
        let told = held("error", &out.stderr);
        assert_eq!(told["status"], out.status.code().unwrap());
        assert!(out.stdout.is_empty());
        told
    };
    let out = folder.path().join("r.csv").display().to_string();
    let bad = trials.display().to_string();
    let told = run(&["simulate", &model, "--trials", &bad, "--out", &out]);
    assert_eq!((&told["code"], &told["file"]), (&"file".into(), &bad.as_str().into()));
    assert!(told["row"].as_u64().is_some() && told["column"].is_string(), "{told}");
    assert!(told["message"].as_str().unwrap().contains("thirty"));

    write(&folder.path().join("model.json"), "{\n  \"schema\": ,\n}");
    let broken = folder.path().join("model.json").display().to_string();
    let told = run(&["simulate", &broken, "--protocol", "pivot-shift", "--out", &out]);
    assert_eq!((&told["file"], &told["row"]), (&broken.as_str().into(), &2.into()));

    assert_eq!(run(&["simulate", &model, "--protocol", "pivot", "--out", &out])["code"], "usage");
    assert_eq!(run(&["simulate", &model, "--protocol", "pivot-shift", "--out", "/dev/full"])["code"], "machine");
    let told = run(&[&model, "--set", "bones.edge_mm=-4", "--out", &out]);
    assert_eq!((&told["code"], &told["key"], &told["value"]), (&"usage".into(), &"bones.edge_mm".into(), &"-4".into()));
    let told = run(&[&model, "--set", "register.error_limit_mm=0.001", "--from", "register", "--out", &out]);
    assert_eq!((&told["code"], &told["stage"]), (&"stage".into(), &"register".into()));
}

#[test]
fn quiet_is_silence_in_every_verb() {
    let (knee, out) = (one_knee::specimen(), TempDir::new().unwrap());
    let path = |name: &str| out.path().join(name).display().to_string();
    let place = knee.to_str().unwrap();
    for arguments in [
        &["simulate", place, "--protocol", "pivot-shift", "--samples", "0", "--out", &path("r.csv")][..],
        &["export", place, "--format", "abaqus", "--out", &path("deck")],
        &["validate", place, "--samples", "0", "--out", &path("v")],
        &["phantom", "right-phantom", &path("phantom")],
        &["init", &path("new")],
        &["check", place, "--out", &path("check")],
        &["inspect", place],
        &["report", place],
        &["cohort", place, "--out", &path("cohort")],
    ] {
        let run = build_model().args(arguments).arg("-q").assert().success();
        assert!(run.get_output().stdout.is_empty() && run.get_output().stderr.is_empty(), "{arguments:?}");
    }
}

//! `next-tests`: what it tells, its files, faults.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{build_model, json, text};
use crate::one_knee::specimen;
use crate::schema::obeys;
use predicates::str::contains;
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

fn told(out: &Path, more: &[&str]) -> Value {
    let mut command = build_model();
    command.arg("next-tests").arg(specimen()).args(["--for", "drawer", "--count", "3", "--json"]).arg("--out").arg(out);
    let said = command.args(more).assert().success().get_output().stdout.clone();
    serde_json::from_slice(&said).unwrap()
}

#[test]
fn tests_leave_less_one_after_the_other_and_are_trials_that_can_be_simulated() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (one, three) = (told(&at("a.csv"), &["--jobs", "1"]), told(&at("b.csv"), &["--jobs", "3"]));
    assert_eq!((&one["tests"], &one["spread"]), (&three["tests"], &three["spread"]));
    assert_eq!(text(&at("a.csv")), text(&at("b.csv")));
    let schema = json(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schema/next-tests.schema.json"));
    obeys(&one, &schema, &schema).unwrap();
    let left: Vec<f64> = one["tests"].as_array().unwrap().iter().map(|t| t["left"].as_f64().unwrap()).collect();
    // a drawer that was not measured is told by a drawer
    assert!(!left.is_empty() && left.len() <= 3 && left[0] < 1.0 && left.windows(2).all(|w| w[1] < w[0]), "{left:?}");
    build_model()
        .arg("simulate")
        .arg(specimen())
        .arg("--trials")
        .arg(at("a.csv"))
        .args(["--samples", "0"])
        .arg("--out")
        .arg(at("poses.csv"))
        .assert()
        .success();
    let rows = text(&at("poses.csv")).lines().count() - 1;
    assert_eq!(rows, text(&at("a.csv")).lines().count() - 1);
    // louder readings tell less
    let loud = told(&at("c.csv"), &["--noise-deg", "20", "--noise-mm", "20"]);
    let least = loud["tests"].as_array().unwrap().last().map_or(1.0, |t| t["left"].as_f64().unwrap());
    assert!(least > *left.last().unwrap(), "{least} {left:?}");
}

#[test]
fn what_cannot_be_asked_is_one_clear_error() {
    let run = |more: &[&str]| {
        let mut command = build_model();
        command.arg("next-tests").arg(specimen()).args(more).assert()
    };
    run(&["--for", "ACl"]).code(2).stderr(contains("did you mean ACL"));
    run(&["--for", "ACL", "--noise-mm", "0"]).code(2).stderr(contains("--noise-mm is 0"));
    run(&["--for", "ACL", "--count", "0"]).code(2);
    for wrong in ["-1", "5001", "nan", "inf", "many"] {
        let said = run(&["--for", "ACL", "--compression", wrong]).code(2);
        said.stderr(contains("--compression")).stderr(contains("expected a number from 0 to"));
    }
    for wrong in ["-1", "1.5", "nan"] {
        let said = run(&["--for", "ACL", "--samples", wrong]).code(2);
        said.stderr(contains("--samples")).stderr(contains("expected a whole number, 0 or more"));
    }
    run(&["--for", "ACL", "--without", "AGL"]).failure().stderr(contains("no bundle is named"));
    run(&["--for", "ACL", "--as-assembled"]).failure().stderr(contains("expected a calibrated knee"));
}

//! The optional stage contact-law in a build: its files, its law in the model, its place in the report.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{build_model, phantom, text};
use predicates::prelude::PredicateBooleanExt;
use serde_json::Value;
use tempfile::TempDir;

/// Coarse and light, so that it is quick.
const QUICK: [&str; 7] = [
    "hexmesh.edge_length_mm=1.8",
    "hexmesh.layers=2",
    "contact-law.fit=true",
    "contact-law.flexions_deg=[0, 60]",
    "contact-law.force_n=300",
    "contact-law.least_force_n=20",
    "contact-law.levels=5",
];

#[test]
fn a_build_fits_the_law_and_assembles_with_it() {
    let specimen = phantom("S193761-phantom");
    let out = TempDir::new().unwrap();
    let build = |more: &[&str]| {
        let mut command = build_model();
        command.arg(specimen.path()).arg("--out").arg(out.path()).arg("--quiet").args(["--to", "assemble"]);
        QUICK.iter().chain(more).for_each(|s| {
            command.args(["--set", s]);
        });
        command.assert()
    };
    build(&[]).success();
    let folder = out.path().join("08b-contact-law");
    let read = |name: &str| serde_json::from_str::<Value>(&text(&out.path().join(name))).unwrap();
    let law = read("08b-contact-law/law.json");
    let list = |v: &Value| v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>();
    let (over, pressure) = (list(&law["overclosure_mm"]), list(&law["pressure_mpa"]));
    assert_eq!(over, [0.0, 0.05, 0.1, 0.2]);
    assert!(pressure.windows(2).all(|w| w[0] <= w[1]) && (0.2..10.0).contains(&pressure[3]), "{pressure:?}");
    assert!(law["fit_error_percent"].as_f64().unwrap() < 30.0, "{law}");
    let model = read("09-assemble/model.json");
    assert_eq!(list(&model["contact"]["pressure_mpa"]), pressure);
    let layer = &law["layer"];
    let rms = |v: &Value| v["fit_rms_percent"].as_f64().unwrap();
    assert!(
        rms(layer) < 15.0 && layer["youngs_modulus_mpa"].as_f64().is_some_and(|e| (3.0..40.0).contains(&e)),
        "{layer}"
    );
    assert_eq!(law["rules"], if rms(layer) < rms(&law) { "thickness" } else { "table" });
    assert_eq!(model["contact"]["layer"].is_object(), law["rules"] == "thickness");
    let metrics = read("08b-contact-law/metrics.json");
    for flexion in metrics["flexions"].as_array().unwrap() {
        assert!(flexion["force_max_n"].as_f64().unwrap() >= 300.0, "{flexion}");
        assert!(flexion["kinetic_share_at_rest_max"].as_f64().unwrap() < 1e-3, "{flexion}");
        assert!(flexion["energy_balance_error"].as_f64().unwrap() < 0.05, "{flexion}");
    }
    assert!(text(&folder.join("curves.csv")).lines().count() > 6);
    let list = text(&folder.join("fields.pvd"));
    assert_eq!(list.matches("<DataSet").count(), 6);
    let name = list.split('"').find(|w| w.starts_with("fields/tibia_medial_060deg")).unwrap();
    let fields = text(&folder.join(name));
    assert!(fields.contains("stress_mpa") && fields.contains("contact_pressure_mpa"));
    let report = text(&out.path().join("report.html"));
    assert!(report.contains("id=\"contact-law\"") && report.contains("a/law-force"));
    // taken up again, and the same bytes on one thread
    build_model().arg(specimen.path()).arg("--out").arg(out.path()).args(["--to", "contact-law"]).assert().code(2);
    let refused = build(&["contact-law.youngs_modulus_mpa=12e6"]).code(2);
    refused.stderr(
        predicates::str::contains("--set contact-law.youngs_modulus_mpa")
            .and(predicates::str::contains("check its unit")),
    );
}

#[test]
fn contact_by_thickness_without_a_fit_is_an_option_and_is_simulated() {
    let specimen = phantom("S193761-phantom");
    let out = TempDir::new().unwrap();
    let mut build = build_model();
    build.arg(specimen.path()).arg("--out").arg(out.path()).args(["--quiet", "--to", "assemble"]);
    build.args([
        "--set",
        "assemble.by_thickness=true",
        "--set",
        "assemble.layer.law=logarithmic",
        "--set",
        "assemble.layer.youngs_modulus_mpa=9",
    ]);
    build.assert().success();
    let path = out.path().join("09-assemble/model.json");
    let model = serde_json::from_str::<Value>(&text(&path)).unwrap();
    let layer = &model["contact"]["layer"];
    assert_eq!((&layer["law"], &layer["poissons_ratio"]), (&Value::from("logarithmic"), &Value::from(0.45)));
    assert_eq!(layer["bony_faces"].as_object().unwrap().len(), 3);
    let results = out.path().join("results.csv");
    let mut simulate = build_model();
    simulate.arg("simulate").arg(&path).args(["--protocol", "passive-flexion", "--out"]).arg(&results);
    simulate.assert().success();
    assert!(text(&results).lines().count() > 5);
    let mut export = build_model();
    export.arg("export").arg(&path).args(["--format", "opensim", "--out"]).arg(out.path().join("osim"));
    export.assert().success().stderr(predicates::str::contains("contact is that of the table"));
}

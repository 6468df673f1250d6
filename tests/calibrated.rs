//! From laxity data to compared models, on both published specimens: figures within their bands.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{build_model, json, shared, text};
use std::path::Path;
use tempfile::TempDir;

/// Most that a source's model may miss a coordinate by, root mean square over the trials: VV, IE [deg], ML, AP, SI [mm].
type Band = (&'static str, [f64; 5]);

const COORDINATES: [&str; 5] = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];

/// S193761's data are another simulator's. Two simulators of one knee differ in nine trials of ten by less than 1.6 mm AP and 3.9 deg IE (a static
/// against Abaqus's model of S192803), so by 1.0 mm and 2.4 deg root mean square; for the others no such figure is known, and twice the noise of KLA (0.5
/// deg, 0.4 mm) stands.
const SYNTHETIC: [Band; 2] = [("kla", [1.0, 2.4, 0.8, 1.0, 0.8]), ("rks", [1.0, 2.4, 0.8, 1.0, 0.8])];

/// S192803's data are measured. The published calibration, simulated again with what was published of the model, misses by this much; a calibration
/// that misses by more has failed.
const MEASURED: [Band; 2] = [("kla", [4.5, 6.8, 2.9, 3.8, 2.4]), ("rks", [7.9, 11.9, 3.3, 4.3, 2.1])];

/// Builds a specimen to the end, with fewer starts and samples than usual.
fn built(specimen: &Path) -> TempDir {
    let out = TempDir::new().unwrap();
    let mut command = build_model();
    command.arg(specimen).arg("--out").arg(out.path()).arg("--quiet");
    for set in ["starts=2", "finalists=2", "samples=8"] {
        command.args(["--set", &format!("calibrate.inference.{set}")]);
    }
    command.assert().success();
    out
}

fn check_bands(out: &Path, bands: [Band; 2]) {
    let metrics = json(&out.join("10-calibrate/metrics.json"));
    for (source, band) in bands {
        for (coordinate, most) in COORDINATES.iter().zip(band) {
            let rms = metrics[source]["rms"][coordinate].as_f64().unwrap();
            assert!(rms < most, "{source} misses {coordinate} by {rms:.2}, band {most}");
        }
    }
}

#[test]
fn synthetic_data_are_met_and_every_file_is_there() {
    let Some(specimen) = shared("synthetic_data_are_met", "specimens/S193761") else { return };
    let out = built(&specimen);
    check_bands(out.path(), SYNTHETIC);
    for source in ["kla", "rks"] {
        let parameters = text(&out.path().join(format!("10-calibrate/{source}/parameters.csv")));
        assert!(parameters.starts_with("design_variable,bundle,kind,value,lower,upper"));
        assert_eq!(parameters.lines().count(), 27);
        for file in ["ap_laxity", "passive_flexion", "pivot_shift", "pivot_shift_no_acl"] {
            let rows = text(&out.path().join(format!("11-validate/{source}/{file}.csv")));
            assert!(rows.starts_with("fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm,"), "{source} {file}");
        }
        // the calibrated model is one that other verbs read
        let model = out.path().join(format!("10-calibrate/{source}/model.json"));
        let results = out.path().join("results.csv");
        let mut simulate = build_model();
        simulate.arg("simulate").arg(&model).args(["--protocol", "pivot-shift", "--out"]).arg(&results);
        simulate.assert().success();
    }
    let compare = text(&out.path().join("11-validate/compare.csv"));
    assert!(compare.contains("kla,rks,ap_laxity,anterior_ap,mm,"), "{compare}");
    for file in ["table4.csv", "table5.csv", "table6.csv", "table7.csv", "tables.md", "figure5.svg", "figure7.svg"] {
        assert!(!text(&out.path().join("11-validate").join(file)).is_empty(), "{file}");
    }
}

#[test]
fn measured_data_are_met_as_well_as_by_the_published_calibration() {
    let Some(specimen) = shared("measured_data_are_met", "specimens/S192803") else { return };
    let out = built(&specimen);
    check_bands(out.path(), MEASURED);
}

//! Laxity files whose readings are displacements from another trial's pose.
#![allow(clippy::unwrap_used, reason = "tests")]

use meshes::frame::Side;
use sim::coordinate::{AP, Free};
use sim::laxity::{LaxityFormat, LaxityTable, TrialResult, read, read_as, results_csv, sign_doubts, trials_csv};
use sim::spec::PoseSpec;

const HEADER: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm";

/// An arthrometer's file: one drawer at 30 deg, rotation at 30 and 90 deg, each named from its unloaded trial.
const NAMED: [&str; 7] = [
    "n30,neutral,30,0,0,0,0,0,30,,,,0,,",
    "a30,anterior,30,0,0,0,134,0,30,,,,6.2,,n30",
    "i30,internal,30,0,-5,0,0,0,30,,-14,,,,n30",
    "e30,external,30,0,5,0,0,0,30,,12,,,,n30",
    "n90,neutral,90,0,0,0,0,0,90,,,,,,",
    "i90,internal,90,0,-5,0,0,0,90,,-18,,,,n90",
    "e90,external,90,0,5,0,0,0,90,,15,,,,n90",
];

fn named(rows: &[&str]) -> Result<LaxityTable, String> {
    read(format!("{HEADER},reference\n{}\n", rows.join("\n")).as_bytes()).map_err(|e| e.to_string())
}

/// The same without names, told as differences in specimen.toml.
fn told(rows: &[&str]) -> Result<LaxityTable, String> {
    let cut = |r: &&str| r.rsplit_once(',').unwrap().0.to_owned();
    let rows: Vec<String> = rows.iter().map(cut).collect();
    let format: LaxityFormat = toml::from_str("readings = \"difference\"").unwrap();
    read_as(format!("{HEADER}\n{}\n", rows.join("\n")).as_bytes(), &format, Side::Right).map_err(|e| e.to_string())
}

#[test]
fn a_file_says_by_column_or_by_declaration_what_its_readings_count_from() {
    let table = named(&NAMED).unwrap();
    assert!(table.warnings.is_empty(), "{:?}", table.warnings);
    let from: Vec<Option<&str>> = table.trials.iter().map(|t| t.reference.as_ref().map(|r| r.trial.as_str())).collect();
    let n30 = Some("n30");
    assert_eq!(from, [None, n30, n30, n30, None, Some("n90"), Some("n90")]);
    assert_eq!(table.trials[0].measured, Free::all(None), "the zero of an instrument is no pose");
    assert!((table.trials[1].load_step(AP) - 134.0).abs() < 1e-9);
    assert_eq!(table, told(&NAMED).unwrap());
    // and comes back from the standard file
    assert_eq!(read(trials_csv(&table.trials).as_bytes()).unwrap().trials, table.trials);
    assert!(sign_doubts(&table.trials).is_empty());
}

#[test]
fn the_unloaded_trial_of_the_same_test_goes_before_a_neutral_one() {
    let mut rows = NAMED.to_vec();
    rows.insert(1, "a30_0,anterior,30,0,0,0,0,20,30,,,,,,");
    let table = told(&rows).unwrap();
    assert_eq!(table.trials[2].reference.as_ref().unwrap().trial, "a30_0");
    assert_eq!(table.trials[3].reference.as_ref().unwrap().trial, "n30");
}

#[test]
fn a_displacement_against_its_load_is_a_sign_doubt_though_it_is_alone() {
    let rows = ["n30,neutral,30,0,0,0,0,0,30,,,,,,", "a30,anterior,30,0,0,0,134,0,30,,,,-6.2,,n30"];
    let doubts = sign_doubts(&named(&rows).unwrap().trials);
    assert_eq!(doubts.iter().map(|d| d.column.as_str()).collect::<Vec<_>>(), ["ap_mm"]);
}

#[test]
fn every_fault_of_a_pair_is_one_sentence_with_row_and_trial() {
    let without: Vec<&str> = NAMED.iter().filter(|r| !r.starts_with("n90")).copied().collect();
    let missing = named(&without).unwrap_err();
    assert!(missing.contains("row 6 (i90)") && missing.contains("no trial \"n90\""), "{missing}");
    let missing = told(&without).unwrap_err();
    assert!(missing.contains("row 6 (i90)") && missing.contains("no unloaded trial at 90 deg"), "{missing}");
    let change = |from: &str, to: &str| {
        let rows: Vec<String> = NAMED.iter().map(|r| r.replace(from, to)).collect();
        named(&rows.iter().map(String::as_str).collect::<Vec<_>>()).unwrap_err()
    };
    assert!(change("6.2,,n30", "6.2,,n90").contains("at 90 deg, this trial at 30 deg"));
    assert!(change("6.2,,n30", "6.2,,a30").contains("counts from itself"));
    assert!(change("6.2,,n30", "6.2,,i30").contains("counts from another trial itself"));
    assert!(change("0,0,134,0", "0,0,0,0").contains("the same loads"));
    let poses: Vec<String> = NAMED.iter().map(|r| r.replace("30,,,,0,,", "30,,,,2.5,,")).collect();
    let poses = told(&poses.iter().map(String::as_str).collect::<Vec<_>>()).unwrap_err();
    assert!(poses.contains("row 2 (n30)") && poses.contains("are the readings poses?"), "{poses}");
}

#[test]
fn simulated_displacements_count_as_the_measured_ones_do() {
    let table = named(&NAMED[..2]).unwrap();
    let pose = |ap_mm: f64| PoseSpec { fe_deg: 30.0, vv_deg: 1.0, ie_deg: -2.0, ml_mm: 0.5, ap_mm, si_mm: -25.0 };
    let result = |(t, ap): (&sim::laxity::LaxityTrial, f64)| TrialResult {
        trial: t.clone(),
        pose: pose(ap),
        forces_n: vec![],
        outputs: vec![],
        flags: vec![],
        bands: vec![],
    };
    let results: Vec<TrialResult> = table.trials.iter().zip([-1.5, 5.0]).map(result).collect();
    let back = read(results_csv(&[], &results).as_bytes()).unwrap();
    assert_eq!(back.trials[0].measured[AP], Some(-1.5));
    assert_eq!(back.trials[1].measured.0, [Some(0.0), Some(0.0), Some(0.0), Some(6.5), Some(0.0)]);
    assert_eq!(back.trials[1].reference, table.trials[1].reference);
}

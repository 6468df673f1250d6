//! `simulate` on a whole model: both solvers, trials and protocols, faults.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "looks at what the program wrote")]

use crate::common::{build_model, shared};
use crate::one_knee::specimen;
use needs_shared::needs_shared;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use std::path::Path;
use tempfile::TempDir;

/// The published knee, imported.
fn imported(test: &str) -> Option<TempDir> {
    let deck = shared(test, "published/S192803/deck")?.join("S192803_MAIN_LAXITY_Anterior_30deg_10.inp");
    let folder = TempDir::new().unwrap();
    build_model().arg("import-abaqus").arg(deck).arg("--out").arg(folder.path().join("m")).assert().success();
    Some(folder)
}

/// Columns of a results file.
fn columns(path: &Path, names: &[&str]) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at: Vec<usize> = names.iter().map(|n| header.iter().position(|h| h == n).unwrap()).collect();
    lines.map(|l| at.iter().map(|&i| l.split(',').nth(i).unwrap().to_owned()).collect()).collect()
}

#[needs_shared]
fn both_solvers_run_a_protocol_and_agree_and_a_dislocated_knee_is_told() {
    let Some(folder) = imported("protocols by both solvers") else { return };
    let run = |solver: &str, out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let mut command = build_model();
        command.arg("simulate").arg(folder.path().join("m")).args(["--protocol", "pivot-shift", "--solver", solver]);
        let run = command.args(more).arg("--out").arg(&out).assert().success();
        let printed = [run.get_output().stdout.clone(), run.get_output().stderr.clone()].concat();
        let rows = columns(&out, &["step", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"]);
        (rows, String::from_utf8(printed).unwrap())
    };
    let ((rest, quiet), (moving, still)) = (run("quasistatic", "q.csv", &[]), run("explicit", "e.csv", &[]));
    assert!(rest.len() == 2 && !quiet.contains("dislocated") && !still.contains("dislocated"));
    for (a, b) in rest.iter().zip(&moving) {
        assert_eq!(a[0], b[0]);
        for k in 1..6 {
            let (x, y): (f64, f64) = (a[k].parse().unwrap(), b[k].parse().unwrap());
            assert!((x - y).abs() < 0.1, "{}: {x} {y}", a[0]);
        }
    }
    let (loose, told) = run("quasistatic", "d.csv", &["--without", "ACL"]);
    assert!(loose[0][4].parse::<f64>().unwrap() > 25.0 && told.contains("30 deg compressed: dislocated"), "{told}");
}

#[needs_shared]
fn a_model_cut_short_is_one_clear_error() {
    let Some(folder) = imported("a model cut short") else { return };
    let model = folder.path().join("m/model.json");
    let whole = std::fs::read(&model).unwrap();
    let refused = |words: &str| {
        let mut command = build_model();
        command.arg("simulate").arg(&model).args(["--protocol", "pivot-shift", "--out"]);
        let assert = command.arg(folder.path().join("x.csv")).assert().code(1).stderr(contains(words));
        assert!(String::from_utf8_lossy(&assert.get_output().stderr).lines().count() <= 3);
    };
    std::fs::write(&model, &whole[..whole.len() / 2]).unwrap();
    refused("model.json");
    std::fs::write(&model, b"").unwrap();
    refused("model.json");
    std::fs::write(&model, &whole).unwrap();
    let mesh = folder.path().join("m/meshes/articular_femur.ply");
    let bytes = std::fs::read(&mesh).unwrap();
    std::fs::write(&mesh, &bytes[..bytes.len() / 2]).unwrap();
    refused("articular_femur");
}

/// A knee without collateral ligaments has no equilibrium under a large moment; the other rows are wanted all the same.
#[test]
fn a_trial_without_equilibrium_leaves_the_other_rows_as_they_are() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let head = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg\n";
    let (rest, lost, drawn) =
        ("rest,neutral,30,0,0,0,0,20,30\n", "opened,valgus,30,60,0,0,0,20,30\n", "drawn,anterior,30,0,0,0,50,20,30\n");
    let run = |name: &str, rows: &[&str]| {
        let trials = path(&format!("{name}.csv"));
        std::fs::write(&trials, head.to_owned() + &rows.concat()).unwrap();
        let mut command = build_model();
        command.arg("simulate").arg(specimen()).arg("--trials").arg(&trials);
        command
            .args(["--without", "sMCL,dMCL,LCL,PFL,POL", "--samples", "0", "--out"])
            .arg(path(&format!("{name}.out")));
        command.assert()
    };
    run("all", &[rest, lost, drawn])
        .success()
        .stderr(contains("1 of 3 trials has no equilibrium").and(contains("opened")));
    run("two", &[rest, drawn]).success();
    let told = ["trial", "fe_deg", "vv_deg", "ap_mm", "force_PCL_AL_n", "contact_medial_force_n", "flags"];
    let (all, two) = (columns(&path("all.out"), &told), columns(&path("two.out"), &told));
    assert_eq!([&all[0], &all[2]], [&two[0], &two[1]]);
    assert_eq!(all[1], ["opened", "30.000000", "", "", "", "", "no equilibrium"]);
    // where no row has an answer there is no file
    run("none", &[lost]).code(1).stderr(contains("opened: no equilibrium"));
    assert!(!path("none.out").exists());
}

/// A knee without ligaments has no equilibrium under the moments of a pivot shift; the row without them is wanted all the same.
#[test]
fn a_step_of_a_protocol_without_equilibrium_is_a_row_without_an_answer() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("r.csv");
    let mut command = build_model();
    command.arg("simulate").arg(specimen()).args(["--protocol", "pivot-shift"]);
    command.args(["--without", "ACL,PCL,sMCL,dMCL,LCL,PFL,POL,ALS,PCAP", "--out"]).arg(&out);
    let told = contains("1 of 2 steps has no equilibrium").and(contains("30 deg pivot shift"));
    command.assert().success().stderr(told);
    let names = ["step", "fe_deg", "load_vv_nm", "vv_deg", "ap_mm", "force_PCL_AL_n", "contact_medial_force_n"];
    let rows = columns(&out, &[names.as_slice(), &["flags", "odd"]].concat());
    assert_eq!(rows.len(), 2);
    assert!(rows[0][1..7].iter().all(|cell| cell.parse::<f64>().is_ok()), "{:?}", rows[0]);
    let lost = ["30 deg pivot shift", "30.000000", "8.000000", "", "", "", "", "no equilibrium", "yes"];
    // no sample rests otherwise than a knee that has no answer
    assert_eq!(rows[1], lost);
    // a series of files has one of each row that has a pose
    let series = folder.path().join("series");
    let mut command = build_model();
    command.arg("export").arg(specimen()).args(["--format", "vtk", "--poses"]).arg(&out).arg("--out").arg(&series);
    let told = contains("1 of 2 rows of").and(contains("has no equilibrium")).and(contains("the first: row 2"));
    command.assert().success().stderr(told);
    let files = std::fs::read_dir(&series)
        .unwrap()
        .filter(|f| f.as_ref().unwrap().path().extension().is_some_and(|e| e == "vtu"));
    assert_eq!(files.count(), 1);
}

/// A data set that a model does not know would be read as none at all.
#[test]
fn a_data_set_that_the_model_does_not_know_is_refused() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("r.csv");
    let run = |words: &[&str]| {
        let mut command = build_model();
        command.arg("simulate").arg(specimen()).args(["--protocol", "ap-laxity", "--samples", "0"]).args(words);
        command.arg("--out").arg(&out).assert()
    };
    run(&["--read-as", "kla"]).success();
    std::fs::remove_file(&out).unwrap();
    run(&["--read-as", "klaa"])
        .code(2)
        .stderr(contains("no such data set; did you mean kla").and(contains("knows kla, rks")));
    run(&["--read-as", "kla", "--as-assembled"]).code(2).stderr(contains("knows no data set"));
    assert!(!out.exists());
}

/// What was cut is said by the table, by the command, or by both: the same knee, the same numbers. The column stands in the results where it stood in the
/// table, and they read back as they are.
#[test]
fn a_cut_knee_is_the_same_whether_its_table_or_the_command_says_what_was_cut() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let run = |name: &str, state: &str, more: &[&str]| {
        let head =
            "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,without\n";
        let rows =
            ["rest,neutral,30,0,0,0,0,20,30", "drawn,anterior,30,0,0,0,40,20,30"].map(|r| format!("{r},{state}\n"));
        std::fs::write(path(&format!("{name}.csv")), head.to_owned() + &rows.concat()).unwrap();
        let mut command = build_model();
        command.arg("simulate").arg(specimen()).arg("--trials").arg(path(&format!("{name}.csv")));
        command.args(["--samples", "2", "--out"]).arg(path(&format!("{name}.out"))).args(more).assert()
    };
    run("table", "ACL+ALS", &[]).success();
    run("command", "", &["--without", "ACL,ALS"]).success();
    run("each", "ACL", &["--without", "ALS"]).success();
    run("whole", "intact", &[]).success();
    let read = |name: &str| std::fs::read_to_string(path(name)).unwrap();
    let answers =
        |name: &str| columns(&path(name), &["vv_deg", "ie_deg", "ap_mm", "force_dMCL_n", "ap_mm_lower", "flags"]);
    assert_eq!([answers("command.out"), answers("each.out")], [answers("table.out"), answers("table.out")]);
    assert_ne!(answers("table.out"), answers("whole.out"));
    assert!(["command.out", "whole.out"].iter().all(|name| !read(name).contains("without")));
    // with both, the column says all that was cut
    assert!(columns(&path("each.out"), &["without"]).iter().all(|row| row == &["ACL+ALS"]));
    let told = columns(&path("table.out"), &["without", "force_ACL_AM_n", "force_ALS_n"]);
    assert!(told.iter().all(|row| row == &["ACL+ALS", "0.000000", "0.000000"]), "{told:?}");
    let mut again = build_model();
    again.arg("simulate").arg(specimen()).arg("--trials").arg(path("table.out")).args(["--samples", "2", "--out"]);
    again.arg(path("again.out")).assert().success();
    assert_eq!(read("again.out"), read("table.out"));
    run("unknown", "ACLX", &[]).code(1).stderr(
        contains("unknown.csv: row 2 (rest)").and(contains("column \"without\"")).and(contains("did you mean ACL?")),
    );
}

//! One knee: whatever is asked of the folder of a build is answered by its joint calibrated model, by name and with intervals.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

use crate::common::{build_model, differing, files, read, text, write};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A phantom built to the end of its calibration, with few starts and samples.
pub(crate) fn specimen() -> &'static Path {
    static BUILT: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let built = BUILT.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        build_model().args(["phantom", "S193761-phantom"]).arg(folder.path().join("knee")).assert().success();
        let mut command = build_model();
        command.arg(folder.path().join("knee")).args(["--quiet", "--to", "validate"]);
        for set in ["inference.starts=1", "inference.finalists=1", "inference.rounds=1", "inference.samples=12"] {
            command.args(["--set", &format!("calibrate.{set}")]);
        }
        command.assert().success();
        let knee = folder.path().join("knee");
        (folder, knee)
    });
    &built.1
}

/// What a command prints.
fn said(arguments: &[&str], model: &Path, more: &[&str]) -> String {
    let mut command = build_model();
    let run = command.args(arguments).arg(model).args(more).assert().success();
    String::from_utf8(run.get_output().stdout.clone()).unwrap()
}

/// The columns of a file by their names, as numbers where they are.
fn columns(csv: &str) -> BTreeMap<String, Vec<String>> {
    let mut lines = csv.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let rows: Vec<Vec<String>> = lines.collect();
    header.iter().enumerate().map(|(k, name)| (name.clone(), rows.iter().map(|r| r[k].clone()).collect())).collect()
}

fn number(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("\"{text}\" is no number"))
}

#[test]
fn what_nobody_measured_is_told_as_extrapolated_and_what_was_is_not() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let path = out.path().join("rows.csv").display().to_string();
    let told = |more: &[&str]| {
        let mut command = build_model();
        command.arg("simulate").arg(knee).args(more).args(["--samples", "0", "--out", &path]);
        String::from_utf8(command.assert().success().get_output().stderr.clone()).unwrap()
    };
    let beyond = "ask for what the knee was not calibrated to";
    for set in ["kla", "rks"] {
        let own = told(&["--trials", knee.join(format!("laxity/{set}.csv")).to_str().unwrap()]);
        assert!(!own.contains(beyond), "{own}");
    }
    let bent = told(&["--protocol", "passive-flexion", "--to-flexion", "120"]);
    assert!(bent.contains(beyond) && bent.contains("flexion of 120 deg (trials reach"), "{bent}");
}

#[test]
fn a_folder_of_a_build_is_its_joint_model_in_every_verb() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let (build, joint) = (knee.join("build"), knee.join("build/10-calibrate/joint"));
    let trials = knee.join("laxity/kla.csv");
    let path = |name: &str| out.path().join(name).display().to_string();
    for (place, name) in [(knee, "a"), (&build, "b"), (&joint, "c")] {
        let more = ["--trials", trials.to_str().unwrap(), "--out", &path(name)];
        let told = said(&["simulate"], place, &more);
        let first = told.lines().next().unwrap();
        assert!(
            first.contains("calibrated to") && first.contains("10-calibrate/joint") && first.contains("digest"),
            "{first}"
        );
        said(&["export", "--format", "abaqus"], place, &["--out", &path(&format!("x{name}"))]);
    }
    assert!(
        read(Path::new(&path("a"))) == read(Path::new(&path("c")))
            && read(Path::new(&path("b"))) == read(Path::new(&path("c")))
    );
    let exported = |name: &str| files(&out.path().join(format!("x{name}")));
    assert_eq!(differing(&exported("a"), &exported("c")), Vec::<String>::new());
    // the others are asked for by name
    let told =
        said(&["simulate", "--as-assembled"], knee, &["--trials", trials.to_str().unwrap(), "--out", &path("d")]);
    assert!(told.lines().next().unwrap().contains("assembled, not calibrated"), "{told}");
    let told =
        said(&["simulate", "--source", "rks"], knee, &["--trials", trials.to_str().unwrap(), "--out", &path("e")]);
    assert!(told.lines().next().unwrap().contains("10-calibrate/rks"), "{told}");
    assert!(read(Path::new(&path("d"))) != read(Path::new(&path("c"))));
    let mut command = build_model();
    command.args(["simulate", "--source", "mri"]).arg(knee).args(["--protocol", "pivot-shift", "--out", &path("f")]);
    command.assert().code(1).stderr(contains("it has joint, kla, rks"));
    let mut command = build_model();
    command.args(["simulate", "--as-assembled"]).arg(&joint).args(["--protocol", "pivot-shift", "--out", &path("f")]);
    command.assert().code(2).stderr(contains("give its folder"));
}

/// Forces of one equilibrium that is found from two points differ by less [N], a large one by this share of it [-].
const SAME_N: f64 = 0.5;
/// The search ends within this [mm]: a stiff bundle's force differs by its stiffness times it.
const SAME_MM: f64 = 0.01;
/// See [`SAME_N`].
const SAME_SHARE: f64 = 0.005;

/// A bundle that bears less is slack, and is not compared [N].
const TAUT_N: f64 = 5.0;
/// Share of the forces after a cycle that lie inside the intervals of the first loading, at least [-]: that of the intervals.
const LOOP_INSIDE: f64 = 0.9;

#[test]
fn what_friction_keeps_of_a_loading_lies_inside_the_intervals() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let results = out.path().join("ap.csv");
    said(&["simulate"], knee, &["--protocol", "ap-laxity", "--out", results.to_str().unwrap()]);
    let found = columns(&text(&results));
    let bundles: Vec<&str> =
        found.keys().filter(|c| c.starts_with("force_")).filter_map(|c| c.strip_suffix("_n_lower")).collect();
    let place = |step: String| found["step"].iter().position(|s| *s == step).unwrap();
    let (mut inside, mut all, mut moved) = (0, 0, 0.0_f64);
    for fe_deg in [30, 60, 90] {
        let (first, again) =
            (place(format!("{fe_deg} deg load +133.0 N")), place(format!("{fe_deg} deg forwards +133.0 N")));
        for bundle in &bundles {
            let of = |end: &str, row: usize| number(&found[&format!("{bundle}_n{end}")][row]);
            let (before, after) = (of("", first), of("", again));
            if before.max(after) > TAUT_N {
                all += 1;
                inside += usize::from((of("_lower", first)..=of("_upper", first)).contains(&after));
                moved = moved.max((after - before).abs());
            }
        }
    }
    assert!(moved > 1.0, "friction keeps something: {moved} N");
    assert!(inside as f64 >= LOOP_INSIDE * f64::from(all), "{inside} of {all}");
}

#[test]
fn drawers_have_the_intervals_that_the_calibration_tells() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let header = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n";
    let rows: String = [("anterior", 133), ("posterior", -133)]
        .iter()
        .flat_map(|(test, load)| [30, 60, 90].map(|f| format!("{test}_{f},{test},{f},0,0,0,{load},20,{f},,,,,\n")))
        .collect();
    let trials = out.path().join("drawers.csv");
    write(&trials, format!("{header}{rows}"));
    let results = out.path().join("results.csv");
    let more = ["--trials", trials.to_str().unwrap(), "--out", results.to_str().unwrap()];
    let printed = said(&["simulate"], knee, &more);
    assert!(printed.contains("interval by"), "{printed}");
    let (found, told) = (columns(&text(&results)), columns(&text(&knee.join("build/10-calibrate/joint/forces.csv"))));
    let place = |trial: &str| found["trial"].iter().position(|t| t == trial).unwrap();
    let model: serde_json::Value =
        serde_json::from_str(&text(&knee.join("build/10-calibrate/joint/model.json"))).unwrap();
    let bundles = model["bundles"].as_array().unwrap().iter();
    let stiffness: BTreeMap<&str, f64> =
        bundles.map(|b| (b["name"].as_str().unwrap(), b["stiffness_n_per_mm"].as_f64().unwrap())).collect();
    let mut compared = 0;
    for (k, (trial, bundle)) in told["trial"].iter().zip(&told["bundle"]).enumerate() {
        let row = place(trial);
        // both leave out the samples that leave the plateau, and tell how many; one that stands on its rim may count in the one and not in the other
        let flags = found["flags"][row].split("; ");
        let leaving = flags.filter(|f| f.ends_with("the plateau")).find_map(|f| f.split(' ').next()).unwrap_or("0");
        if leaving != told["leaving"][k] || told["lower_n"][k] == "nan" {
            continue;
        }
        compared += 1;
        for (end, column) in
            [("_mean", "value_n"), ("_mean", "mean_n"), ("_lower", "lower_n"), ("_upper", "upper_n"), ("", "mode_n")]
        {
            let here = number(&found[&format!("force_{bundle}_n{end}")][row]);
            let there = number(&told[column][k]);
            // found from another point close by, to the end of the same search
            assert!(
                (here - there).abs() < SAME_N.max(SAME_SHARE * there).max(SAME_MM * stiffness[bundle.as_str()]),
                "{bundle} in {trial}: {end} {here}, calibration {there}"
            );
        }
    }
    assert!(compared >= told["trial"].len() / 2, "{compared} of {}", told["trial"].len());
    // one knee is no middle of all: where it lies outside its interval the row says so
    let is_outside = |k: usize| {
        let [mode, lower, upper] = ["mode_n", "lower_n", "upper_n"].map(|c| number(&told[c][k]));
        mode < lower - 2e-3 || mode > upper + 2e-3
    };
    for (k, said) in told["outside"].iter().enumerate().filter(|(k, _)| is_outside(*k)) {
        assert_eq!(said, "true", "{} {}", told["trial"][k], told["bundle"][k]);
    }
    let said_outside = found["flags"].iter().filter(|f| f.contains("outside its interval: ")).count();
    assert_eq!(said_outside > 0, printed.contains("lie outside their interval"), "{printed}");
    for column in ["ap_mm", "group_ACL_n", "contact_medial_force_n", "contact_si_n"] {
        let end = |e: &str| number(&found[&format!("{column}_{e}")][0]);
        assert!(end("lower") <= end("mean") && end("mean") <= end("upper"), "{column}");
    }
    // as laxity data they read back
    let again = out.path().join("again.csv");
    said(
        &["simulate"],
        knee,
        &["--trials", results.to_str().unwrap(), "--out", again.to_str().unwrap(), "--samples", "0"],
    );
    assert!(!text(&again).contains("ap_mm_mean"));
}

/// How many bundles have a force among the columns.
fn bundles_of(columns: &BTreeMap<String, Vec<String>>) -> usize {
    columns.keys().filter(|c| c.starts_with("force_") && columns.contains_key(&format!("{c}_mean"))).count()
}

/// A copy of the built specimen's build.
fn copied() -> TempDir {
    let copy = TempDir::new().unwrap();
    for (name, bytes) in files(&specimen().join("build")) {
        let path = copy.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        write(&path, bytes);
    }
    copy
}

#[test]
fn samples_that_do_not_scatter_say_what_the_model_says() {
    let copy = copied();
    let file = copy.path().join("10-calibrate/joint/samples.json");
    let mut samples: serde_json::Value = serde_json::from_str(&text(&file)).unwrap();
    for unknown in samples["unknowns"].as_array_mut().unwrap() {
        let n = unknown["samples"].as_array().unwrap().len();
        unknown["samples"] = vec![unknown["most_probable"].clone(); n].into();
    }
    write(&file, serde_json::to_vec(&samples).unwrap());
    let out = copy.path().join("r.csv");
    let protocols = [["passive-flexion", ""], ["ap-laxity", ""], ["pivot-shift", ""], ["pivot-shift", "ACL"]];
    for [protocol, without] in protocols {
        let more = ["--protocol", protocol, "--out", out.to_str().unwrap()];
        let cut = ["--without", without];
        let more = [&more[..], if without.is_empty() { &[] } else { &cut[..] }].concat();
        said(&["simulate"], copy.path(), &more);
        let found = columns(&text(&out));
        let banded: Vec<&String> = found.keys().filter(|c| found.contains_key(&format!("{c}_mean"))).collect();
        assert!(banded.len() > 20, "{banded:?}");
        for column in banded {
            // what the model lacks and what another simulator would say scatter beside the samples; the contact's numbers have neither
            let alone = column.starts_with("contact_");
            for (row, value) in found[column].iter().enumerate().filter(|(_, v)| !v.is_empty()) {
                for end in if alone { &["mean", "lower", "upper"][..] } else { &["mean"][..] } {
                    let told = &found[&format!("{column}_{end}")][row];
                    if !told.is_empty() {
                        let near = (number(told) - number(value)).abs() < 1e-5 * number(value).abs().max(1.0);
                        assert!(near, "{protocol} {without}: {column} {value}, {end} {told}");
                    }
                }
            }
        }
    }
}

/// The model that the last cell of a table's first row names; it holds commas, so it stands between quotation marks.
fn named_model(table: &Path) -> String {
    let text = text(table);
    let row = text.lines().nth(1).unwrap().trim_end_matches('"');
    row.rsplit_once('"').unwrap().1.to_owned()
}

#[test]
fn what_the_build_tells_of_a_protocol_is_what_simulate_tells() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let path = out.path().join("r.csv");
    for (source, file, more) in [
        ("joint", "passive_flexion", &["--protocol", "passive-flexion"][..]),
        ("joint", "ap_laxity", &["--protocol", "ap-laxity"]),
        ("joint", "pivot_shift", &["--protocol", "pivot-shift"]),
        ("joint", "pivot_shift_no_acl", &["--protocol", "pivot-shift", "--without", "ACL"]),
        ("rks", "ap_laxity", &["--protocol", "ap-laxity", "--source", "rks"]),
    ] {
        // the joint knee by explicit dynamics, the quasi-static answer beside it; the models of single data sets by the latter alone
        let simulate = |solver: &str| {
            said(&["simulate"], knee, &[more, &["--solver", solver, "--out", path.to_str().unwrap()]].concat());
            columns(&text(&path))
        };
        let quasistatic = simulate("quasistatic");
        let simulated = if source == "joint" { simulate("explicit") } else { quasistatic.clone() };
        let file_built = knee.join(format!("build/11-validate/{source}/{file}.csv"));
        let [here, there] = [&path, &file_built].map(|p| named_model(p));
        assert!(there.contains(&format!("10-calibrate/{source}/model.json, digest")), "{there}");
        assert_eq!(here, there, "{source}, {file}");
        let built = columns(&text(&file_built));
        let by = &built["solver"];
        let expected = if source == "joint" { "explicit" } else { "quasistatic" };
        assert!(by.iter().all(|s| s == expected), "{source}, {file}: {by:?}");
        for (column, told) in built.iter().filter(|(c, _)| *c != "solver") {
            let same = match column.strip_suffix("_quasistatic") {
                Some(beside) => quasistatic.get(beside) == Some(told),
                // whether both solvers agree is told by the build alone
                None if source == "joint" && ["flags", "odd"].contains(&column.as_str()) => continue,
                None => simulated.get(column) == Some(told),
            };
            assert!(same, "{source}, {file}: {column}");
        }
        assert_eq!(built.contains_key("ap_mm_quasistatic"), source == "joint", "{source}, {file}");
    }
}

#[test]
fn files_of_forces_have_one_name_for_the_single_model_and_one_for_the_mean() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    said(&["export", "--format", "stl"], knee, &["--out", out.path().to_str().unwrap()]);
    let exported = columns(&text(&out.path().join("ligament_forces.csv")));
    let told = columns(&text(&knee.join("build/10-calibrate/joint/forces.csv")));
    assert_eq!(exported["value_n"], exported["mean_n"], "the best estimate is the mean");
    assert_eq!(told["value_n"], told["mean_n"], "the best estimate is the mean");
    let mut compared = 0;
    for (k, trial) in told["trial"].iter().enumerate() {
        let same = |j: &usize| exported["trial"][*j] == *trial && exported["bundle"][*j] == told["bundle"][k];
        let j = (0..exported["trial"].len()).find(same).unwrap();
        let [here, there] = [&exported["mode_n"][j], &told["mode_n"][k]].map(|x| number(x));
        assert!((here - there).abs() < SAME_N.max(SAME_SHARE * there), "{trial} {}: {here} {there}", told["bundle"][k]);
        compared += usize::from(there > 0.0);
    }
    assert!(compared > 10, "{compared}");
    // a protocol is told as `simulate` tells it
    let path = out.path().join("r.csv");
    for (name, protocol) in
        [("passive_flexion", "passive-flexion"), ("ap_laxity", "ap-laxity"), ("pivot_shift", "pivot-shift")]
    {
        said(&["simulate"], knee, &["--protocol", protocol, "--out", path.to_str().unwrap()]);
        let simulated = columns(&text(&path));
        let whole = columns(&text(&out.path().join("predictions.csv")));
        for (row, trial) in simulated["step"].iter().enumerate() {
            let own = format!("{name} {trial}");
            let there = whole["trial"].iter().position(|t| *t == own).unwrap();
            for column in ["ap_mm", "ie_deg_mean", "ap_mm_upper", "group_ACL_n_lower", "contact_medial_force_n_mean"] {
                assert_eq!(whole[column][there], simulated[column][row], "{own}, {column}");
            }
            let rows: Vec<usize> = (0..exported["trial"].len()).filter(|j| exported["trial"][*j] == own).collect();
            assert_eq!(rows.len(), bundles_of(&simulated), "{own}");
            for j in rows {
                let force = format!("force_{}_n", exported["bundle"][j]);
                for (end, column) in [("", "mode_n"), ("_mean", "mean_n"), ("_lower", "lower_n"), ("_upper", "upper_n")]
                {
                    let (here, there) =
                        (number(&exported[column][j]), number(&simulated[&format!("{force}{end}")][row]));
                    assert!((here - there).abs() < 2e-3, "{own} {force}{end}: {here} {there}");
                }
            }
        }
    }
    let rest = columns(&text(&knee.join("build/10-calibrate/joint/rest.csv")));
    assert_eq!((&rest["mean_n"], &rest["mode_n"]), (&rest["value_n"], &rest["model_n"]));
}

#[test]
fn a_model_changed_by_hand_loses_its_samples_and_a_stale_one_is_refused() {
    let copy = copied();
    let out = copy.path().join("r.csv").display().to_string();
    let model = copy.path().join("10-calibrate/joint/model.json");
    let whole = text(&model);
    write(&model, whole.replacen("\"stiffness_n_per_mm\": ", "\"stiffness_n_per_mm\": 1", 1));
    let mut command = build_model();
    command.arg("simulate").arg(copy.path()).args(["--protocol", "pivot-shift", "--out", &out]);
    // what is odd is beside the results, not among them
    let aside = "changed since it was calibrated";
    command.assert().success().stderr(contains(aside)).stdout(contains(aside).not());
    assert!(!text(Path::new(&out)).contains("ap_mm_mean"));
    write(&model, whole);
    let assembled = copy.path().join("09-assemble/model.json");
    write(&assembled, text(&assembled).replacen("\"stiffness_n_per_mm\": ", "\"stiffness_n_per_mm\": 1", 1));
    let mut command = build_model();
    command.arg("simulate").arg(copy.path()).args(["--protocol", "pivot-shift", "--out", &out]);
    command.assert().code(1).stderr(contains("calibrated from another model").and(contains("--as-assembled")));
}

#[test]
fn an_option_that_a_command_does_not_hear_is_refused() {
    let knee = specimen();
    let laxity = format!("kla={}", knee.join("laxity/kla.csv").display());
    for (verb, more, theirs) in [
        ("validate", vec![], "validate"),
        ("calibrate", vec!["--targets", laxity.as_str()], "calibrate"),
        ("diagnose", vec!["--measured", laxity.as_str()], "calibrate"),
    ] {
        let mut command = build_model();
        command.arg(verb).arg(knee).args(more).args(["--set", "assemble.friction=0.1", "--out"]);
        let told = command.arg(knee.join("nowhere")).assert().code(2);
        let said = String::from_utf8_lossy(&told.get_output().stderr).into_owned();
        assert!(said.contains("assemble.friction") && said.contains(&format!("{theirs}.key=value")), "{verb}: {said}");
        assert!(!knee.join("nowhere").exists());
    }
}

#[test]
fn a_calibration_to_laxity_that_is_no_longer_there_is_of_an_earlier_run() {
    let knee = TempDir::new().unwrap();
    crate::common::copy(specimen(), knee.path());
    let log = "build/log.jsonl";
    write(&knee.path().join(log), read(&specimen().join(log)));
    let file = knee.path().join("specimen.toml");
    let toml = text(&file);
    write(&file, &toml[..toml.find("[laxity]").unwrap()]);
    build_model().arg(knee.path()).assert().success().stdout(contains("assembled, not calibrated"));
    let inspected = said(&["inspect"], knee.path(), &["--json"]);
    let records: serde_json::Value = serde_json::from_str(&inspected).unwrap();
    let outdated = records.as_array().unwrap().iter().filter(|r| r["outdated"] == true);
    assert_eq!(outdated.map(|r| r["stage"].as_str().unwrap()).collect::<Vec<_>>(), ["calibrate", "validate"]);
    let simulate = |more: &[&str]| {
        let mut command = build_model();
        command.arg("simulate").arg(knee.path()).args(["--protocol", "pivot-shift", "--out"]);
        command.arg(knee.path().join("r.csv")).args(more).assert()
    };
    simulate(&[]).code(1).stderr(contains("of an earlier run").and(contains("--as-assembled")));
    simulate(&["--as-assembled"]).success();
    let mut validate = build_model();
    validate.arg("validate").arg(knee.path()).arg("--out").arg(knee.path().join("v"));
    validate.assert().code(1).stderr(contains("of an earlier run"));
}

#[test]
fn an_atlas_of_a_knee_that_nobody_calibrated_is_refused() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let measured = format!("kla={}", knee.join("laxity/kla.csv").display());
    let mut command = build_model();
    command
        .args(["diagnose", "--as-assembled", "--atlas", "--measured", &measured])
        .arg(knee)
        .arg("--out")
        .arg(out.path());
    command.assert().code(1).stderr(contains("not calibrated"));
}

/// Largest distance of a pose read as a data set's from the one that fit.csv has for it: six decimals are written [mm, deg].
const ROUNDED: f64 = 1.01e-6;
/// So far the frames of a data set move poses at least [mm, deg]: of a phantom whose data sets have frames of their own.
const FRAMES_MOVE: f64 = 0.3;

#[test]
fn poses_read_as_a_data_set_are_in_its_frames() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let trials = knee.join("laxity/kla.csv");
    let fit = columns(&text(&knee.join("build/10-calibrate/joint/fit.csv")));
    let asked = |name: &str, more: &[&str]| {
        let file = out.path().join(name);
        let mut words = vec!["--trials", trials.to_str().unwrap(), "--out", file.to_str().unwrap()];
        words.extend(more);
        if !more.contains(&"--samples") {
            words.extend(["--samples", "0"]);
        }
        (said(&["simulate"], knee, &words), columns(&text(&file)))
    };
    let stage = knee.join("build/10-calibrate");
    let mut of_stage = build_model();
    of_stage.arg("simulate").arg(&stage).args(["--protocol", "pivot-shift", "--out", "r.csv"]);
    of_stage.assert().code(1).stderr(contains("give the build's folder").and(contains("build-model build").not()));
    let (words, of_one) = asked("one.csv", &["--samples", "1"]);
    assert!(!words.contains("interval by") && !of_one.contains_key("ap_mm_lower"), "{words}");
    let (words, read) = asked("kla.csv", &["--read-as", "kla"]);
    assert!(words.contains("poses in the frames of kla"), "{words}");
    let (words, shared) = asked("shared.csv", &[]);
    assert!(words.contains("--read-as kla or rks"), "{words}");
    let apart = |set: &str, poses: &BTreeMap<String, Vec<String>>| {
        let trial = |r: usize| format!("{set}/{}", poses["trial"][r]);
        let row = |r: usize| fit["trial"].iter().position(|t| *t == trial(r)).unwrap();
        let off = |c: &str, r: usize| (number(&poses[c][r]) - number(&fit[&format!("predicted_{c}")][row(r)])).abs();
        let all = |c: &&str| (0..poses[*c].len()).map(|r| off(c, r)).fold(0.0, f64::max);
        ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"].iter().map(all).fold(0.0, f64::max)
    };
    let file = out.path().join("rks.csv");
    let rks = knee.join("laxity/rks.csv");
    let words =
        ["--trials", rks.to_str().unwrap(), "--read-as", "rks", "--out", file.to_str().unwrap(), "--samples", "0"];
    said(&["simulate"], knee, &words);
    for (set, poses) in [("kla", &read), ("rks", &columns(&text(&file)))] {
        assert!(apart(set, poses) <= ROUNDED, "{set}: {:.2e}", apart(set, poses));
    }
    assert!(apart("kla", &shared) > FRAMES_MOVE, "{:.3}: the frames of all data sets would do", apart("kla", &shared));
}

#[test]
fn the_interval_of_a_row_does_not_depend_on_which_others_are_asked() {
    let (knee, out) = (specimen(), TempDir::new().unwrap());
    let all = text(&knee.join("laxity/kla.csv"));
    let (header, rows) = all.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().take(5).collect();
    let asked = |name: &str, rows: &[&str]| {
        let (trials, file) = (out.path().join(format!("{name}_trials.csv")), out.path().join(name));
        write(&trials, format!("{header}\n{}\n", rows.join("\n")));
        said(&["simulate"], knee, &["--trials", trials.to_str().unwrap(), "--out", file.to_str().unwrap()]);
        columns(&text(&file))
    };
    let together = asked("together.csv", &rows);
    let turned = asked("turned.csv", &rows.iter().rev().copied().collect::<Vec<_>>());
    let alone = asked("alone.csv", &rows[2..3]);
    let ends: Vec<&String> = together.keys().filter(|c| c.ends_with("_lower") || c.ends_with("_upper")).collect();
    assert!(ends.iter().any(|c| *c == "ap_mm_lower") && ends.len() > 40, "{ends:?}");
    for column in ends {
        let cells = &together[column];
        for (k, cell) in cells.iter().enumerate() {
            assert_eq!(*cell, turned[column][cells.len() - 1 - k], "{column}, row {k}, in the other order");
        }
        assert_eq!(cells[2], alone[column][0], "{column}, alone");
    }
}

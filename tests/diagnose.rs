//! A hidden effect is found, named, sized, added, and taken in by the other verbs; nothing is named where nothing is hidden.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::{build_model, built, json, shared, text, thinned};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::effect::{Active, Place};
use diagnosis::problem::trial::Trial;
use needs_shared::needs_shared;
use rand::{RngExt, SeedableRng};
use sim::coordinate::{FE, Load, Six};
use sim::laxity::{LaxityTrial, Test};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The published deck imported, in a folder.
fn deck(test: &str) -> Option<TempDir> {
    let deck = shared(test, "published/S192803/deck/S192803_MAIN_LAXITY_Anterior_30deg_0.inp")?;
    let folder = TempDir::new().unwrap();
    build_model().arg("import-abaqus").arg(deck).arg("--out").arg(folder.path().join("m")).assert().success();
    Some(folder)
}

/// A set with one of `every` trials, and with those of the names `kept`: enough for what acts in every trial.
fn fewer(case: &Path, to: &Path, every: usize, kept: &[&str]) {
    for name in ["kla.csv", "rks.csv"] {
        crate::common::write(&to.join(name), thinned(&text(&case.join(name)), every, kept));
    }
}

/// `kla=...` and `rks=...` of a set.
fn measured(case: &Path) -> [String; 4] {
    let set = |name: &str| format!("{name}={}", case.join(format!("{name}.csv")).display());
    ["--measured".into(), set("kla"), "--measured".into(), set("rks")]
}

fn diagnose(folder: &Path, case: &Path, out: &str, more: &[&str]) -> PathBuf {
    let out = folder.join(out);
    build_model()
        .arg("diagnose")
        .arg(folder.join("m/model.json"))
        .args(measured(case))
        .arg("--out")
        .arg(&out)
        .args(more)
        .assert()
        .success();
    out
}

#[needs_shared]
fn an_eccentric_load_is_named_sized_added_and_acts_where_it_was_found() {
    let Some(case) = shared("diagnose", "blind/case_008") else { return };
    let Some(folder) = deck("diagnose") else { return };
    let truth = json(&case.with_file_name("case_008.truth.json"));
    let out = diagnose(folder.path(), &case, "found", &[]);
    let told = json(&out.join("diagnosis.json"));
    let first = &told["answers"][0]["effects"][0];
    assert_eq!((first["effect"].as_str(), first["scope"].as_str()), (Some("load_misalign"), Some("rks")));
    let arm = &first["parameters"]["arm_mm"];
    let (value, sd) = (arm["value"].as_f64().unwrap(), arm["sd"].as_f64().unwrap());
    let hidden = truth["effects"][0][2]["arm_mm"].as_f64().unwrap();
    assert!((value - hidden).abs() < 1.645 * sd && sd < 0.25 * hidden.abs(), "{value} +- {sd} against {hidden}");
    assert!(told["gap"]["held_out"]["closed"].as_f64().unwrap() > 0.75);
    // the page says what it means and how to check it
    let page = text(&out.join("report.html"));
    let words = "Mark the line of the force on the tibia; measure its distance from the shaft's axis.";
    assert!(page.contains(words) && page.contains("with the answer"), "{page}");
    assert!(page.contains("<svg") && page.contains("What the ligaments carry"));
    curves_come_nearer(&told);
    // the component and the model that carries it tell what they were found with
    let provenance = &told["provenance"];
    let file = |name: &str| blake3::hash(&crate::common::read(&case.join(format!("{name}.csv")))).to_hex().to_string();
    assert_eq!(
        (provenance["data"]["kla"].as_str(), provenance["data"]["rks"].as_str()),
        (Some(&*file("kla")), Some(&*file("rks")))
    );
    assert_eq!(json(&out.join("model.json"))["components"][0]["provenance"], *provenance);
    assert!(text(&out.join("components/load_misalign-1.toml")).contains(provenance["model"].as_str().unwrap()));
    assert!(!told["ligament_forces"].as_array().unwrap().is_empty());
    // what was added is felt by the apparatus it belongs to alone
    let poses = |read_as: Option<&str>| {
        let csv = folder.path().join(format!("{}.csv", read_as.unwrap_or("knee")));
        let mut command = build_model();
        command.arg("simulate").arg(out.join("model.json")).arg("--trials").arg(case.join("rks.csv"));
        command.args(read_as.map(|name| ["--read-as", name]).into_iter().flatten()).arg("--out").arg(&csv);
        command.assert().success();
        text(&csv)
    };
    let knee = poses(None);
    assert_ne!(poses(Some("rks")), knee);
    assert_eq!(poses(Some("kla")), knee);
}

/// Three curves through the worst places, by load, on which the answer is nearer to what was measured than recalibrated ligaments are.
fn curves_come_nearer(told: &serde_json::Value) {
    let curves = told["curves"].as_array().unwrap();
    assert_eq!(curves.len(), 3);
    for curve in curves {
        let points = curve["points"].as_array().unwrap();
        let of = |p: &serde_json::Value, key: &str| p[key].as_f64().unwrap();
        assert!(points.len() > 1 && points.windows(2).all(|p| of(&p[0], "load") <= of(&p[1], "load")), "{curve}");
        let miss = |key: &str| points.iter().map(|p| (of(p, key) - of(p, "measured")).powi(2)).sum::<f64>();
        assert!(miss("with") < 0.5 * miss("without"), "{curve}");
    }
}

#[needs_shared]
fn nothing_is_named_where_nothing_is_hidden_whatever_the_number_of_threads() {
    let Some(case) = shared("diagnose", "blind/case_003") else { return };
    let Some(folder) = deck("diagnose") else { return };
    fewer(&case, folder.path(), 3, &[]);
    let [one, two] = ["1", "2"].map(|jobs| diagnose(folder.path(), folder.path(), jobs, &["--jobs", jobs]));
    assert_eq!(
        crate::common::differing(&crate::common::files(&one), &crate::common::files(&two)),
        Vec::<String>::new()
    );
    let told = json(&one.join("diagnosis.json"));
    assert_eq!(told["verdict"], "none");
    assert!(told["answers"].as_array().unwrap().is_empty() && !one.join("components").exists());
    // friction needs both branches of a load, which these data do not have
    let untested = told["not_testable"].as_array().unwrap();
    assert!(untested.iter().any(|n| n["effect"] == "friction"));
}

#[needs_shared]
fn every_rival_tells_what_it_gains_itself_on_held_out_trials() {
    let Some(case) = shared("diagnose", "blind/case_009") else { return };
    let Some(folder) = deck("diagnose") else { return };
    let told = json(&diagnose(folder.path(), &case, "rivals", &[]).join("diagnosis.json"));
    let answers = told["answers"].as_array().unwrap();
    assert!(answers.len() > 1, "a load bias of 27 N has rivals: {answers:?}");
    let gains: Vec<f64> = answers.iter().map(|a| a["held_out_gain"].as_f64().unwrap()).collect();
    for (k, gain) in gains.iter().enumerate() {
        let own = gains[..k].iter().all(|other| (other - gain).abs() > 1e-6);
        assert!(own && gain.abs() > 1e-6, "answer {k} of {gains:?}");
    }
}

/// Needs no shared data. The model is built from what is measured of a phantom, so its shape, sites and frames are as wrong as those of any built
/// knee; the laboratory has another contact and other fibres, and hides an effect in the laxity.
#[test]
fn an_effect_hidden_in_a_phantom_is_named_and_sized_and_none_where_none_is_hidden() {
    let folder = TempDir::new().unwrap();
    let [hidden, plain] = ["hidden", "plain"].map(|name| folder.path().join(name));
    let make = |to: &Path, more: &[&str]| {
        build_model().args(["phantom", "S193761-phantom"]).arg(to).args(more).assert().success();
    };
    make(&hidden, &["--hide", "ham_tone"]);
    make(&plain, &[]);
    // nothing hidden is found with fewer trials as well
    let laxity = plain.join("laxity");
    fewer(&laxity, &laxity, 2, &[]);
    build_model().arg(&hidden).args(["--to", "assemble", "--quiet"]).assert().success();
    let told = |laxity: &Path, out: &str| {
        let out = folder.path().join(out);
        let model = hidden.join("build/09-assemble/model.json");
        let mut command = build_model();
        command.arg("diagnose").arg(model).args(measured(&laxity.join("laxity"))).arg("--out").arg(&out);
        command.assert().success();
        json(&out.join("diagnosis.json"))
    };
    let truth = json(&hidden.join("truth/laxity.json"));
    let (effect, scope, sizes) = (&truth["effects"][0][0], &truth["effects"][0][1], &truth["effects"][0][2]);
    let found = told(&hidden, "found");
    let first = &found["answers"][0]["effects"][0];
    assert_eq!((&first["effect"], &first["scope"]), (effect, scope));
    for (key, size) in sizes.as_object().unwrap() {
        let of = |what: &str| first["parameters"][key][what].as_f64().unwrap();
        let (value, sd, size) = (of("value"), of("sd"), size.as_f64().unwrap());
        assert!((value - size).abs() < 1.645 * sd && sd < 0.25 * size.abs(), "{key}: {value} +- {sd} against {size}");
    }
    assert!(found["gap"]["held_out"]["closed"].as_f64().unwrap() > 0.75);
    crate::live::page_answers_as_its_model(&folder.path().join("found"));
    let none = told(&plain, "none");
    assert_eq!(none["verdict"], "none");
    assert!(none["answers"].as_array().unwrap().is_empty());
}

/// A set with the readings of two trials of a file exchanged; recorded loads and flexion stay.
#[expect(clippy::disallowed_methods, reason = "a test's own set")]
fn exchanged(case: &Path, to: &Path, file: &str, [one, other]: [&str; 2]) {
    std::fs::create_dir_all(to).unwrap();
    for name in ["kla.csv", "rks.csv"] {
        std::fs::copy(case.join(name), to.join(name)).unwrap();
    }
    let all = text(&case.join(file));
    let header: Vec<&str> = all.lines().next().unwrap().split(',').collect();
    let first = header.iter().position(|h| *h == "vv_deg").unwrap();
    let mut rows: Vec<Vec<&str>> = all.lines().map(|l| l.split(',').collect()).collect();
    let place = |name: &str| rows.iter().position(|r| r[0] == name).unwrap();
    let (a, b) = (place(one), place(other));
    let [one, other] = rows.get_disjoint_mut([a, b]).unwrap();
    one[first..first + 5].swap_with_slice(&mut other[first..first + 5]);
    let lines: Vec<String> = rows.iter().map(|r| r.join(",")).collect();
    std::fs::write(to.join(file), lines.join("\n") + "\n").unwrap();
}

#[needs_shared]
fn records_that_were_mixed_up_are_told_by_name() {
    let Some(case) = shared("diagnose", "blind/case_003") else { return };
    let Some(folder) = deck("diagnose") else { return };
    let mixed = folder.path().join("mixed");
    let two = ["posterior_30deg_203.5", "external_60deg_7.5"];
    exchanged(&case, &mixed, "rks.csv", two);
    fewer(&mixed, &mixed, 3, &two);
    let told = json(&diagnose(folder.path(), &mixed, "told", &[]).join("diagnosis.json"));
    assert_eq!(told["verdict"], "unnamed");
    let mut names: Vec<&str> =
        told["exchanged"]["trials"].as_array().unwrap().iter().map(|t| t.as_str().unwrap()).collect();
    names.sort_unstable();
    assert_eq!(names, ["rks external_60deg_7.5", "rks posterior_30deg_203.5"]);
    assert!(told["description"].as_str().unwrap().contains("may have been exchanged"));
}

#[needs_shared]
fn an_effect_struck_from_the_catalogue_is_unnamed_and_an_unknown_one_is_refused() {
    let Some(case) = shared("diagnose", "blind/case_008") else { return };
    let Some(folder) = deck("diagnose") else { return };
    fewer(&case, folder.path(), 2, &[]);
    let out = diagnose(folder.path(), folder.path(), "struck", &["--without-effect", "load_misalign"]);
    let told = json(&out.join("diagnosis.json"));
    assert_eq!(told["verdict"], "unnamed");
    assert!(told["description"].as_str().unwrap().contains("nearest relatives"));
    // no effect that was tried by itself is ahead of the best that was found
    let best = told["best_log_bayes_factor"].as_f64().unwrap();
    let tried = told["unexplained"]["tried"].as_array().unwrap();
    assert!(!tried.is_empty() && tried.iter().all(|t| t["log_bayes_factor"].as_f64().unwrap() <= best), "{tried:?}");
    // each was asked as if it were the answer: the likeliest is none, what earns a name was asked on other trials, and all leave something
    let against = |t: &serde_json::Value| -> Vec<String> {
        t["against"].as_array().into_iter().flatten().map(|a| a.as_str().unwrap().to_owned()).collect()
    };
    assert!(!against(&tried[0]).is_empty(), "{}", tried[0]);
    for row in tried {
        let earns_a_name = !against(row).contains(&"earns_too_little".to_owned());
        assert!(!earns_a_name || row["closes_held_out"].is_number(), "{row}");
        assert!(row["leaves"].as_f64().unwrap() > 0.0, "{row}");
    }
    let left = told["unexplained"]["left"].as_array().unwrap();
    let z: Vec<f64> = left.iter().map(|l| l["z"].as_f64().unwrap().abs()).collect();
    assert!(!z.is_empty() && z.is_sorted_by(|a, b| a >= b), "{left:?}");
    assert!(text(&out.join("report.html")).contains("What came nearest"));
    let refused = build_model()
        .arg("diagnose")
        .arg(folder.path().join("m/model.json"))
        .args(measured(folder.path()))
        .args(["--without-effect", "no_such", "--out"])
        .arg(folder.path().join("none"))
        .assert()
        .failure();
    let said = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(said.contains("no_such") && said.contains("load_misalign"), "{said}");
    assert!(!folder.path().join("none").exists());
}

#[needs_shared]
fn a_sealed_set_is_made_answered_and_scored_and_a_broken_seal_is_refused() {
    let Some(case) = shared("diagnose", "blind/case_001") else { return };
    let Some(folder) = deck("diagnose") else { return };
    let [bench, answers, model] = ["bench", "answers", "m/model.json"].map(|name| folder.path().join(name));
    fewer(&case, folder.path(), 4, &[]);
    let [_, kla, _, rks] = measured(folder.path());
    let mut make = build_model();
    make.args(["blind", "make"]).arg(&model).args(["--like", &kla, "--like", &rks, "--out"]).arg(&bench);
    make.args(["--kind", "origin_shift", "--count", "1", "--seed", "5"]).assert().success();
    build_model().args(["blind", "answer"]).arg(&model).arg(&bench).arg("--out").arg(&answers).assert().success();
    let score = || {
        let mut command = build_model();
        command.args(["blind", "score"]).arg(&model).arg(&bench).arg(&answers);
        command
    };
    let told = score().assert().success();
    let told = String::from_utf8(told.get_output().stdout.clone()).unwrap();
    let line = told.lines().find(|l| l.starts_with("strong: named first")).unwrap();
    assert!(line.contains("1 of 1"), "{told}");
    // the same case with its effect struck counts as what is not in the catalogue
    let struck = folder.path().join("struck");
    build_model()
        .args(["blind", "answer"])
        .arg(&model)
        .arg(&bench)
        .arg("--struck")
        .arg("--out")
        .arg(&struck)
        .assert()
        .success();
    assert_eq!(json(&struck.join("case_0001/diagnosis.json"))["without"], serde_json::json!(["origin_shift"]));
    let told = score().arg(&struck).assert().success();
    let told = String::from_utf8(told.get_output().stdout.clone()).unwrap();
    let line = told.lines().find(|l| l.starts_with("strong, struck from the catalogue: flagged")).unwrap();
    assert!(line.contains("of 1"), "{told}");
    // and, beside the answer that named it, as what nothing else comes near
    let line = told.lines().find(|l| l.starts_with("struck, none does nearly as well")).unwrap();
    assert!(line.contains("of 1"), "{told}");
    let truth = bench.join("case_0001.truth.json");
    crate::common::write(&truth, text(&truth).replace("origin_shift", "femur_frame"));
    let broken = score().assert().failure();
    let said = String::from_utf8(broken.get_output().stderr.clone()).unwrap();
    assert!(said.contains("case_0001"), "{said}");
}

/// Seed of the noise that is laid on what a model with a patella answers.
const SEED: u64 = 7;
/// That noise: VV, IE [deg], ML, AP, SI [mm]; as is taken where a file states none.
const NOISE: [f64; 5] = [0.5, 0.5, 0.4, 0.4, 0.4];
/// Tension of the quadriceps that is hidden [N]. These trials tell it within 38 N or so: 150 N earn about what a name needs, and noise decides.
const HIDDEN_N: f64 = 250.0;

/// A phantom's model with a patella of mean shape, and the folder it lies in.
fn knee_with_a_patella() -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    build_model().args(["phantom", "S193761-phantom"]).arg(&knee).assert().success();
    let mut build = build_model();
    build.arg(&knee).args(["--to", "assemble", "--quiet", "--set", "assemble.patella=generic"]).assert().success();
    let model = knee.join("build/09-assemble/model.json");
    (folder, model)
}

/// What a model answers to trials under a tension of the quadriceps [N], with noise, as a file that does not tell the tension.
fn answered(model: &Path, asked: &Path, tension: f64, to: &Path) {
    let rows: Vec<String> = text(asked).lines().map(str::to_owned).collect();
    let load =
        |(n, line): (usize, &String)| format!("{line},{}\n", ["load_quadriceps_n", &tension.to_string()][n.min(1)]);
    let trials = to.with_extension("asked.csv");
    crate::common::write(&trials, rows.iter().enumerate().map(load).collect::<String>());
    let poses = to.with_extension("poses.csv");
    build_model().arg("simulate").arg(model).arg("--trials").arg(&trials).arg("--out").arg(&poses).assert().success();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(SEED);
    // sum of twelve: nearly normal, of spread 1
    let mut noise = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
    let first = rows[0].split(',').position(|h| h == "vv_deg").unwrap();
    let mut out = rows[0].clone() + "\n";
    for (line, pose) in rows[1..].iter().zip(text(&poses).lines().skip(1)) {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let pose: Vec<&str> = pose.split(',').collect();
        assert_eq!(cells[0], pose[0]);
        for (k, sd) in NOISE.iter().enumerate() {
            let value: f64 = pose[first + k].parse().unwrap();
            cells[first + k] = format!("{:.6}", value + sd * noise());
        }
        out += &(cells.join(",") + "\n");
    }
    crate::common::write(to, out);
}

/// Needs no shared data. The model has a patella of mean shape; what it answers under a hidden tension is diagnosed with the same model.
#[test]
fn tension_of_the_quadriceps_hidden_in_a_knee_with_a_patella_is_named_and_sized() {
    let (folder, model) = knee_with_a_patella();
    let asked = folder.path().join("knee/laxity/rks.csv");
    let fewer = folder.path().join("fewer.csv");
    crate::common::write(&fewer, thinned(&text(&asked), 2, &[]));
    let told = |tension: f64, asked: &Path, name: &str| {
        let measured = folder.path().join(format!("{name}.csv"));
        answered(&model, asked, tension, &measured);
        let out = folder.path().join(name);
        let set = format!("rks={}", measured.display());
        build_model().arg("diagnose").arg(&model).args(["--measured", &set]).arg("--out").arg(&out).assert().success();
        json(&out.join("diagnosis.json"))
    };
    let found = told(HIDDEN_N, &asked, "pulled");
    let first = &found["answers"][0]["effects"][0];
    assert_eq!(first["effect"], "quad_passive", "{}", found["description"]);
    let of = |what: &str| first["parameters"]["force_n"][what].as_f64().unwrap();
    assert!((of("value") - HIDDEN_N).abs() < 1.645 * of("sd") && of("sd") < 0.5 * HIDDEN_N, "{first}");
    assert!(found["gap"]["held_out"]["closed"].as_f64().unwrap() > 0.75, "{}", found["gap"]);
    let none = told(0.0, &fewer, "slack");
    assert_eq!(none["verdict"], "none", "{}", none["description"]);
}

/// Needs no shared data. The effect is the patella of the model: its pull, with a slope where there is no tension yet.
#[test]
fn a_patella_under_tension_is_the_effect_and_has_a_slope_at_none() {
    let (_folder, model) = knee_with_a_patella();
    let loaded = genu::model_file::load(&model).unwrap();
    let knee = sim::compile(&loaded.spec, &loaded.meshes).unwrap();
    let place = Place { femur: loaded.spec.frames.femur, tibia: loaded.spec.frames.tibia };
    let catalogue = Catalogue::shipped();
    let (effect, variant) = catalogue.find("quad_passive").unwrap();
    let asked = LaxityTrial::asked("a".into(), Test::Neutral, 0.0, Load::default());
    for own in [0.0, 40.0] {
        let trial = Trial::alone(LaxityTrial { quadriceps_n: own, ..asked.clone() });
        for flexion in [0.2, 0.8, 1.5] {
            let mut q = Six::zeros();
            q[FE] = flexion;
            let force = |tension: f64| {
                let active = Active::new(effect, variant, &[tension, 0.0, 0.0]).unwrap();
                active.force(&place.situation(&knee, &trial, &trial.load(), &q))
            };
            // what the model does under the tension
            let pulled = |tension: f64| -knee.with_quadriceps(tension).unwrap().evaluate(&q).gradient;
            let (own_pull, size) = (pulled(own), force(100.0).amax());
            assert!((force(100.0) - (pulled(own + 100.0) - own_pull)).amax() < 1e-6 * size);
            // the slope is the same from above and from below, over steps of any size, and tells of what a tension does
            let slope = force(0.1) / 0.1;
            assert!((slope + force(-0.1) / 0.1).amax() < 2e-3 * slope.amax(), "{own} N, {flexion}: {slope}");
            assert!((slope - force(1.0)).amax() < 2e-3 * slope.amax(), "{own} N, {flexion}: {slope}");
            let along = slope.dot(&force(100.0)) / (slope.norm() * force(100.0).norm());
            assert!(along > 0.9, "{own} N, {flexion}: {along}");
            // no step where the patella is seated
            assert!((force(10.001) - force(9.999)).amax() < 1e-3 * force(10.0).amax());
        }
    }
}

/// A few trials of one flexion: what tests of an intact and of a hurt knee ask.
const PLAN: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,\
    fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
    a,anterior,30,0,0,0,80,50,30,,,,,\nb,posterior,30,0,0,0,-80,50,30,,,,,\n\
    c,internal,30,0,-3,0,0,50,30,,,,,\nd,external,30,0,3,0,0,50,30,,,,,\n\
    e,varus,30,-6,0,0,0,50,30,,,,,\nf,valgus,30,6,0,0,0,50,30,,,,,\n";

#[test]
fn what_was_measured_before_is_of_the_same_knee_and_nothing_is_sought_in_it() {
    let (folder, model) = (TempDir::new().unwrap(), built().join("build/09-assemble/model.json"));
    let [plan, whole, cut] = ["plan.csv", "whole.csv", "cut.csv"].map(|name| folder.path().join(name));
    crate::common::write(&plan, PLAN);
    for (to, words) in [(&whole, &[][..]), (&cut, &["--without", "PCL_AL", "--without", "PCL_PM"])] {
        let simulate = ["simulate".into(), model.clone(), "--trials".into(), plan.clone(), "--out".into(), to.clone()];
        build_model().args(simulate).args(words).assert().success();
    }
    let asked = |measured: &[(&str, &Path)], out: &str| {
        let mut command = build_model();
        command.arg("diagnose").arg(&model).arg("--out").arg(folder.path().join(out));
        measured.iter().for_each(|(word, file)| {
            command.args([*word, &format!("kla={}", file.display())]);
        });
        command
    };
    let both = [("--measured", &*cut), ("--before", &*whole)];
    asked(&both, "both").assert().success();
    let told = json(&folder.path().join("both/diagnosis.json"));
    assert_eq!(told["before"], serde_json::json!(["kla_before"]));
    let effects = || told["answers"].as_array().unwrap().iter().flat_map(|a| a["effects"].as_array().unwrap());
    assert!(effects().all(|e| e["scope"] == "kla"), "{}", told["answers"]);
    assert!(effects().any(|e| e["effect"] == "structure_loss" && e["variant"] == "PCL"), "{}", told["plain"]);
    // what was read before is named by its file, and is one of the data
    let digest = blake3::hash(&crate::common::read(&whole)).to_hex().to_string();
    assert_eq!(told["provenance"]["data"]["kla_before"].as_str(), Some(&*digest));
    // without it a slacker PCL does nearly as well as a torn one
    asked(&both[..1], "alone").assert().success();
    let alone = json(&folder.path().join("alone/diagnosis.json"));
    assert!(alone["verdict"] != "decisive" && alone.get("before").is_none(), "{}", alone["plain"]);
    // what was cut before is not whole now
    let said = folder.path().join("said.csv");
    let rows = crate::common::text(&cut);
    let rows = rows.lines().enumerate().map(|(k, row)| format!("{row},{}\n", if k == 0 { "without" } else { "PCL" }));
    crate::common::write(&said, rows.collect::<String>());
    let refused = asked(&[("--measured", &*whole), ("--before", &said)], "exchanged").assert().code(2);
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("without PCL (column without)"));
    let missing = folder.path().join("no_such.csv");
    let refused = asked(&[both[0], ("--before", &missing)], "none").assert().failure();
    assert!(String::from_utf8_lossy(&refused.get_output().stderr).contains("no_such.csv"));
}

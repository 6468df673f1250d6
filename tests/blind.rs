//! Every kind of the catalogue can be hidden by the laboratory, and the bench can be made hard.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::phantoms::made;
use crate::common::{build_model, built, differing, files, json, text, write};
use blindbench::further::FURTHER;
use blindbench::knee::KneeInput;
use blindbench::laboratory::{Case, Planned, make};
use meshes::Point;
use stages::phantom::PHANTOMS;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// A reading's usual noise: VV, IE [deg], ML, AP, SI [mm].
const NOISE: [f64; 5] = [0.5, 0.5, 0.4, 0.4, 0.4];

/// Effects are hidden twice as large as they are usually drawn, but for wraps: what stands twice as far out pulls fibres in two.
fn size(kind: &str) -> f64 {
    if kind.ends_with("_wrap") { 1.0 } else { 2.0 }
}

/// Drawer, rotation and tilt both ways in extension, where the capsule is taut, and in flexion, and there drawers of a turned knee, by a tracker without noise.
fn plan() -> Vec<Planned> {
    let under = |flexion: f64, [vv, ie, ap]: [f64; 3]| {
        let condition = format!("{flexion} {vv} {ie} {ap}");
        let load = [vv, ie, 0.0, ap, 20.0];
        Planned { source: "all".into(), condition, flexion_deg: flexion, load, sd: [1e-6; 5] }
    };
    let each = [[0.0, 0.0, 134.0], [0.0, 5.0, 0.0], [10.0, 0.0, 0.0]];
    let loads = each.into_iter().flat_map(|load| [load, load.map(|x| -x)]);
    let single = [-5.0, 80.0].into_iter().flat_map(|flexion| loads.clone().map(move |load| (flexion, load)));
    let turned = [5.0, -5.0].map(|ie| (80.0, [0.0, ie, 134.0]));
    single.chain(turned).map(|(flexion, load)| under(flexion, load)).collect()
}

/// What can be hidden beside the first fifteen kinds, by the name that is asked for.
fn kinds() -> Vec<String> {
    let further = FURTHER.iter().map(|k| k.0.to_owned());
    further.chain(["cut_LCL", "attachment_PCL"].map(String::from)).collect()
}

fn case(knee: &KneeInput, kind: &str) -> Case {
    make(knee, &plan(), "phantom", (kind, size(kind)), 3).unwrap()
}

fn knee(id: &str) -> KneeInput {
    genu::phantom::knee(made(id)).unwrap()
}

/// A case of each kind, of one knee; made once.
fn cases() -> &'static [(String, Case)] {
    static CASES: OnceLock<Vec<(String, Case)>> = OnceLock::new();
    CASES.get_or_init(|| {
        let knee = knee(PHANTOMS[0]);
        let of = |kind: String| {
            let case = case(&knee, &kind);
            (kind, case)
        };
        kinds().into_iter().map(of).collect()
    })
}

/// The knee of the other side.
fn mirrored(of: &KneeInput) -> KneeInput {
    let mut out = of.clone();
    let turned = |p: &mut Point| p.x = -p.x;
    for mesh in out.tibia.iter_mut().chain([&mut out.femur]) {
        mesh.vertices.iter_mut().for_each(turned);
        *mesh = std::mem::take(mesh).flipped();
    }
    out.bundles.iter_mut().flat_map(|b| &mut b.fibres).for_each(|(a, b)| [a, b].into_iter().for_each(turned));
    for frame in [&mut out.frames.0, &mut out.frames.1] {
        turned(&mut frame.origin);
        [&mut frame.medial, &mut frame.anterior, &mut frame.superior].into_iter().for_each(|v| v.x = -v.x);
    }
    out
}

/// Name in a truth of what was asked for as `kind`.
fn names(kind: &str, told: &str) -> bool {
    match kind {
        "attachment" => told.strip_prefix("attachment_").is_some(),
        cut if cut.starts_with("cut_") => told == "structure_loss",
        other => told == other,
    }
}

/// How much of an effect's own change stands in the difference of two sets of readings, by least squares [-].
fn part(with: &Case, without: &Case) -> f64 {
    let own = with.truth.signature.iter().flatten();
    let seen = with.readings.iter().flatten().zip(without.readings.iter().flatten()).map(|(a, b)| a - b);
    let (mut along, mut squares) = (0.0, 0.0);
    for (k, (own, seen)) in own.zip(seen).enumerate() {
        let weight = NOISE[k % 5].powi(-2);
        along += weight * own * seen;
        squares += weight * own * own;
    }
    along / squares
}

#[test]
fn each_kind_changes_what_is_read_by_more_than_noise_and_the_truth_names_it() {
    let null = case(&knee(PHANTOMS[0]), "null");
    assert!(null.truth.effects.is_empty() && null.truth.signature.iter().flatten().all(|s| *s == 0.0));
    for (kind, hidden) in cases() {
        let [(effect, scope, parameters)] = &hidden.truth.effects[..] else { panic!("{kind}: one effect") };
        assert!(names(kind, effect) && !parameters.is_empty() && !scope.is_empty(), "{kind}: {effect} {parameters:?}");
        let noises = hidden.truth.signature.iter().flat_map(|row| (0..5).map(move |c| (row[c] / NOISE[c]).abs()));
        let most = noises.fold(0.0, f64::max);
        assert!(most > 1.0, "{kind} changes readings by {most} noises");
        // the readings hold it: what else differs is the noise of the loads
        let part = part(hidden, &null);
        assert!((part - 1.0).abs() < 0.5, "{kind}: {part} of its change is in the readings");
    }
}

#[test]
fn each_kind_hidden_in_a_knee_and_in_its_mirror_image_gives_the_same_readings() {
    let right = mirrored(&knee(PHANTOMS[0]));
    for (kind, a) in cases() {
        let b = case(&right, kind);
        assert_eq!(a.truth.effects, b.truth.effects);
        // where two points of a surface are equally near, the mirror image may choose the other: a tenth of the noise
        for (a, b) in a.readings.iter().flatten().zip(b.readings.iter().flatten()) {
            assert!((a - b).abs() < 0.05, "{kind}: {a} {b}");
        }
    }
}

/// A protocol of four trials: the poses in it are not looked at.
const PROTOCOL: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm
a,anterior,30,0,0,0,133,20,30,0,0,0,0,0
b,posterior,30,0,0,0,-133,20,30,0,0,0,0,0
c,external,60,0,5,0,0,20,60,0,0,0,0,0
d,valgus,60,8,0,0,0,20,60,0,0,0,0,0
";

/// A bench of one case of the built phantom, by that protocol in two data sets.
fn bench(folder: &Path, more: &[&str]) {
    let file = folder.with_extension("csv");
    write(&file, PROTOCOL);
    let like = |name: &str| format!("{name}={}", file.display());
    let mut command = build_model();
    command.args(["blind", "make"]).arg(built().join("build/09-assemble/model.json"));
    command.args(["--like", &like("kla"), "--like", &like("rks"), "--count", "1", "--out"]).arg(folder);
    command.args(more).assert().success();
}

#[test]
fn a_hard_bench_is_the_same_when_made_again_and_its_truth_tells_what_is_hard() {
    let folder = TempDir::new().unwrap();
    let hard = ["--kind", "gravity", "--wide", "--surfaces", "--laboratory", "second", "--own-frames"];
    let [one, two, plain] = ["one", "two", "plain"].map(|name| folder.path().join(name));
    bench(&one, &hard);
    bench(&two, &hard);
    bench(&plain, &["--kind", "gravity"]);
    assert_eq!(differing(&files(&one), &files(&two)), Vec::<String>::new());
    let [truth, usual] = [&one, &plain].map(|bench| json(&bench.join("case_0001.truth.json")));
    let differs: Vec<&str> = truth["differs"].as_array().unwrap().iter().filter_map(|d| d.as_str()).collect();
    assert!(["wide", "surfaces", "laboratory"].iter().all(|d| differs.contains(d)), "{differs:?}");
    assert_eq!(truth["effects"][0][0], "gravity");
    let usual = usual["differs"].as_array().unwrap();
    assert!(usual.iter().all(|d| *d == "unlike"), "{usual:?}");
    // loads of the second laboratory, as its file tells them
    let largest = |bench: &Path| {
        let table = text(&bench.join("case_0001/rks.csv"));
        let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
        let column = head.iter().position(|name| *name == "load_ap_n").unwrap();
        let loads = table.lines().skip(1).map(|l| l.split(',').nth(column).unwrap().parse::<f64>().unwrap().abs());
        loads.fold(0.0, f64::max)
    };
    assert!((largest(&one) - 0.75 * largest(&plain)).abs() < 1e-6, "{} {}", largest(&one), largest(&plain));
}

/// Rows of a file of readings.
fn rows(file: &Path) -> usize {
    text(file).lines().skip(1).count()
}

/// A knee may come out of its joint once it is cut. Then trials are left out of its files and of its truth alike, or the case is refused, and both are said.
#[test]
fn a_bench_of_cuts_has_each_trial_in_its_files_or_left_out_and_each_case_made_or_refused() {
    let folder = TempDir::new().unwrap();
    let (protocol, bench) = (folder.path().join("protocol.csv"), folder.path().join("cuts"));
    write(&protocol, PROTOCOL);
    let like = |name: &str| format!("{name}={}", protocol.display());
    let mut command = build_model();
    command.args(["blind", "make"]).arg(built().join("build/09-assemble/model.json"));
    command.args(["--like", &like("kla"), "--like", &like("rks"), "--cuts", "1", "--before", "--out"]).arg(&bench);
    let made = command.assert().success();
    let said = String::from_utf8(made.get_output().stdout.clone()).unwrap();
    let seals = json(&bench.join("bench.json"))["seals"].as_object().unwrap().clone();
    assert_eq!(seals.len() + said.matches("is no test").count(), 5, "{said}");
    for case in seals.keys() {
        let truth = json(&bench.join(format!("{case}.truth.json")));
        let left_out = truth["out_of_joint"].as_array().map_or(0, Vec::len);
        let of = |ending: &str| ["kla", "rks"].map(|s| rows(&bench.join(case).join(format!("{s}{ending}.csv"))));
        let read: usize = of("").iter().sum();
        assert_eq!(read + left_out, 8, "{case}: {truth}");
        assert_eq!(truth["signature"].as_array().unwrap().len(), read, "{case}");
        assert!(left_out == 0 || said.contains(&format!("{left_out} of 8 trials left out")), "{said}");
        // the whole knee read all of it
        assert_eq!(of("_before"), [4, 4], "{case}");
        let is_whole = truth["kind"] == "null";
        assert_eq!(is_whole, truth["effects"].as_array().unwrap().is_empty(), "{case}");
        assert!(!is_whole || left_out == 0, "{case}");
    }
}

/// As in a bench: what no laboratory reads stands in no file.
#[test]
fn a_phantom_of_a_cut_ligament_has_no_trial_in_which_its_knee_lies_out_of_its_joint() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    let made = build_model().args(["phantom", PHANTOMS[2], "--hide", "cut_ACL"]).arg(&knee).assert().success();
    let said = String::from_utf8(made.get_output().stdout.clone()).unwrap();
    let truth = json(&knee.join("truth/laxity.json"));
    let left_out = truth["out_of_joint"].as_array().map_or(0, Vec::len);
    assert!(left_out > 0 && said.contains(&format!("Left out are {left_out} trials")), "{left_out}: {said}");
    let read: usize = ["kla", "rks"].map(|s| rows(&knee.join(format!("laxity/{s}.csv")))).iter().sum();
    assert_eq!(read + left_out, 54);
    assert_eq!(truth["signature"].as_array().unwrap().len(), read);
}

#[test]
fn what_the_knee_read_before_is_the_same_knee_on_another_day_and_its_case_is_as_without() {
    let folder = TempDir::new().unwrap();
    let [plain, with] = ["plain", "with"].map(|name| folder.path().join(name));
    bench(&plain, &["--kind", "null"]);
    bench(&with, &["--kind", "null", "--before"]);
    assert_eq!(json(&with.join("bench.json"))["before"], true);
    assert!(json(&plain.join("bench.json")).get("before").is_none());
    let readings = |file: &Path| -> Vec<f64> {
        let table = text(file);
        let head: Vec<String> = table.lines().next().unwrap().split(',').map(str::to_owned).collect();
        let read = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];
        let columns: Vec<usize> = read.map(|name| head.iter().position(|c| c == name).unwrap()).to_vec();
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            columns.iter().map(|c| cells[*c].parse::<f64>().unwrap()).collect::<Vec<_>>()
        };
        table.lines().skip(1).flat_map(row).collect()
    };
    for source in ["kla", "rks"] {
        let case = with.join("case_0001");
        let now = text(&case.join(format!("{source}.csv")));
        assert_eq!(now, text(&plain.join(format!("case_0001/{source}.csv"))));
        let [one, other] =
            [source.to_owned(), format!("{source}_before")].map(|name| readings(&case.join(format!("{name}.csv"))));
        assert_eq!(one.len(), other.len());
        // noise alone lies between the days of a whole knee: that of the tracker, and that of the loads, which a soft rotation shows
        let mut off: Vec<f64> =
            one.iter().zip(&other).enumerate().map(|(k, (a, b))| ((a - b) / NOISE[k % 5]).abs()).collect();
        off.sort_by(f64::total_cmp);
        assert!((0.01..3.0).contains(&off[off.len() / 2]), "{off:?}");
    }
}

#[test]
fn a_kind_that_nobody_knows_is_refused_with_the_names_that_there_are() {
    let folder = TempDir::new().unwrap();
    let model = built().join("build/09-assemble/model.json");
    let protocol = folder.path().join("protocol.csv");
    write(&protocol, PROTOCOL);
    let like = format!("kla={}", protocol.display());
    let mut command = build_model();
    command.args(["blind", "make"]).arg(model).args(["--like", &like, "--kind", "gravitty", "--out"]);
    let refused = command.arg(folder.path().join("bench")).assert().failure();
    let said = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(said.contains("gravitty") && said.contains("guarding_reflex") && said.contains("cut_ACL"), "{said}");
    let help = build_model().args(["blind", "make", "--help"]).assert().success();
    let said = String::from_utf8(help.get_output().stdout.clone()).unwrap();
    for option in ["--cuts", "--before", "--wide", "--surfaces", "--laboratory", "--every-kind", "attachment_ACL"] {
        assert!(said.contains(option), "{option}: {said}");
    }
}

#[test]
fn an_answer_tells_its_regret_where_that_is_asked_and_never_with_the_truth_struck() {
    let help = build_model().args(["blind", "answer", "--help"]).assert().success();
    assert!(String::from_utf8(help.get_output().stdout.clone()).unwrap().contains("--regret"));
    let folder = TempDir::new().unwrap();
    let mut both = build_model();
    both.args(["blind", "answer"]).arg(built().join("build/09-assemble/model.json")).arg(folder.path());
    let refused = both.args(["--regret", "--struck", "--out"]).arg(folder.path().join("answers")).assert().failure();
    let said = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(said.contains("--regret") && said.contains("--struck"), "{said}");
}

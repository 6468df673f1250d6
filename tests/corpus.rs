//! The small knees of tests/corpus, a ball on a plate with four fibres and a phantom's of few triangles: laws of the program that need no shared data
//! and no phantom made anew.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "common/knee.rs"]
mod knee;

use crate::common::{build_model, copy, json, read, text, write};
use meshes::frame::Side;
use meshes::{Isometry, Point, Vector};
use sim::Model;
use sim::coordinate::Load;
use sim::mesh::MeshValue;
use sim::trials::{TrialOptions, solve};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The small knee as a model.
fn ball() -> (TempDir, PathBuf) {
    let deck = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/ball.feb");
    let folder = TempDir::new().unwrap();
    let model = folder.path().join("m");
    build_model().arg("import-febio").arg(deck).arg("--out").arg(&model).assert().success();
    (folder, model)
}

/// Simulates trials; gives the results.
fn answers(model: &Path, trials: &str, more: &[&str]) -> Vec<u8> {
    let folder = TempDir::new().unwrap();
    let (asked, out) = (folder.path().join("asked.csv"), folder.path().join("out.csv"));
    write(&asked, trials);
    let mut command = build_model();
    command.arg("simulate").arg(model).arg("--trials").arg(&asked).args(more).arg("--out").arg(&out);
    command.assert().success();
    read(&out)
}

const LOADS: &str = "load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n";

/// Three trials with these columns of flexion.
fn trials(flexions: &[&str]) -> String {
    let row = |name: &str, test: &str, fe: &str, loads: &str| {
        let fe = flexions.iter().map(|_| format!("{fe},")).collect::<String>();
        format!("{name},{test},{fe}{loads}\n")
    };
    let head = flexions.iter().map(|name| format!("{name},")).collect::<String>();
    format!("trial,test,{head}{LOADS}\n")
        + &row("rest", "neutral", "0", "0,0,0,0,20")
        + &row("drawn", "anterior", "0", "0,0,0,10,20")
        + &row("bent", "neutral", "5.5", "0,0,0,0,20")
}

#[test]
fn a_model_cut_anywhere_is_one_clear_error() {
    let (_folder, model) = ball();
    let out = model.join("x.csv");
    for name in ["model.json", "meshes/articular_femur.ply", "meshes/articular_tibia.ply"] {
        let path = model.join(name);
        let whole = read(&path);
        for share in [0, 1, 30, 50, 80, 98] {
            write(&path, &whole[..whole.len() * share / 100]);
            let mut command = build_model();
            command.arg("simulate").arg(&model).args(["--protocol", "pivot-shift", "--out"]).arg(&out);
            let run = command.assert().code(1);
            let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
            assert!(said.contains(name) && said.lines().count() <= 3, "{name} at {share} %: {said}");
            assert!(!out.exists(), "{name} at {share} %");
        }
        write(&path, &whole);
    }
}

/// A trial that is only a load needs no column of the pose, and its flexion once.
#[test]
fn loads_and_one_flexion_are_asked_as_loads_and_both() {
    let (_folder, model) = ball();
    let of = |flexions: &[&str]| answers(&model, &trials(flexions), &[]);
    let both = of(&["nominal_flexion_deg", "fe_deg"]);
    assert_eq!(String::from_utf8_lossy(&both).lines().count(), 4);
    for one in ["nominal_flexion_deg", "fe_deg"] {
        assert!(of(&[one]) == both, "by {one} alone");
    }
}

#[test]
fn trials_are_answered_alike_on_any_number_of_threads() {
    let (_folder, model) = ball();
    let by = |jobs: &str, solver: &str| {
        let asked = trials(&["nominal_flexion_deg", "fe_deg"]);
        answers(&model, &asked, &["--solver", solver, "--jobs", jobs])
    };
    let one = ["quasistatic", "explicit"].map(|solver| by("1", solver));
    assert!(one[0] != one[1], "else a solver was not heard");
    for jobs in ["2", "5"] {
        assert!(["quasistatic", "explicit"].map(|solver| by(jobs, solver)) == one, "{jobs} threads");
    }
}

/// The phantom's small knee as a model, without friction, which remembers the path.
fn phantom() -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/knee"), folder.path());
    let path = folder.path().join("model.json");
    let mut model = json(&path);
    model["contact"]["friction"] = 0.0.into();
    write(&path, serde_json::to_vec(&model).unwrap());
    (folder, path)
}

/// Drawers, a rotation and a moment under compression.
const LOADED: &str = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg\n\
    rest,neutral,30,0,0,0,0,50,30\nforward,anterior,30,0,0,0,100,50,30\nback,posterior,60,0,0,0,-100,50,60\n\
    inward,internal,30,0,-3,0,0,50,30\ntilted,valgus,30,6,0,0,0,50,30\n";

/// Of each row of results the columns whose names begin so.
fn columns(results: &[u8], begins: &[&str]) -> Vec<Vec<f64>> {
    let text = String::from_utf8_lossy(results);
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let wanted: Vec<usize> =
        (0..head.len()).filter(|&k| begins.iter().any(|begin| head[k].starts_with(begin))).collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        wanted.iter().map(|&k| cells[k].parse::<f64>().unwrap()).collect::<Vec<f64>>()
    };
    lines.map(row).collect()
}

/// VV, IE [deg], ML, AP, SI [mm].
const POSE: [&str; 5] = ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];

/// Farthest that two tables of one shape are apart.
fn apart(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert!(!a.is_empty() && !a[0].is_empty());
    assert_eq!(a.iter().map(Vec::len).collect::<Vec<_>>(), b.iter().map(Vec::len).collect::<Vec<_>>());
    a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// Fails where dynamics are taken for rest too early, or a solver puts a load on with another sign, lever or frame.
#[test]
fn both_solvers_rest_a_knee_alike_under_drawers_and_moments() {
    let (_folder, model) = phantom();
    let [path, dynamics] =
        ["quasistatic", "explicit"].map(|solver| columns(&answers(&model, LOADED, &["--solver", solver]), &POSE));
    assert!((path[1][3] - path[2][3]).abs() > 1.0, "else no drawer was felt: {path:?}");
    // without friction 8e-6 when this was written
    assert!(apart(&path, &dynamics) < 0.01, "{path:?}\n{dynamics:?}");
}

/// Fails where a deck loses a fibre, a strain, a surface, a digit or a side on its way out or back.
#[test]
fn a_knee_that_went_out_as_a_deck_and_came_back_answers_as_before() {
    let (folder, model) = phantom();
    let (deck, back) = (folder.path().join("deck"), folder.path().join("back"));
    build_model().arg("export").arg(&model).args(["--format", "abaqus", "--out"]).arg(&deck).assert().success();
    let main = deck.join("small-phantom_settle_flex.inp");
    build_model().arg("import-abaqus").arg(main).arg("--out").arg(&back).assert().success();
    let all = [&POSE[..], &["force_"]].concat();
    let [before, after] = [&model, &back].map(|m| columns(&answers(m, LOADED, &[]), &all));
    assert_eq!(before[0].len(), POSE.len() + 14);
    assert!(apart(&before, &after) < 1e-3, "{before:?}\n{after:?}");
}

/// Fails where a cut leaves a fibre at work, or changes what the ligament did not carry.
#[test]
fn a_knee_without_its_acl_comes_forward_and_goes_back_no_further() {
    let (_folder, model) = phantom();
    let all = [&POSE[..], &["force_ACL"]].concat();
    let whole = columns(&answers(&model, LOADED, &[]), &all);
    let cut = columns(&answers(&model, LOADED, &["--without", "ACL"]), &all);
    let (forward, back, ap) = (1, 2, 3);
    assert!(whole[forward][POSE.len()..].iter().sum::<f64>() > 50.0, "the ACL bears the drawer: {whole:?}");
    assert!(cut.iter().all(|row| row[POSE.len()..] == [0.0, 0.0]), "{cut:?}");
    assert!(cut[forward][ap] > whole[forward][ap] + 5.0, "{cut:?}\n{whole:?}");
    assert!(whole[back][POSE.len()..] == [0.0, 0.0] && apart(&cut[2..3], &whole[2..3]) < 1e-4, "{cut:?}\n{whole:?}");
}

/// The small knee with each point mapped; of the other side where the map mirrors.
fn mapped(point: impl Fn(Point) -> Point, mirrors: bool) -> Model {
    let (mut spec, meshes) = knee::small();
    spec.contact.friction = 0.0;
    let origin = point(Point::origin());
    let vector = |v: Vector| point(Point::from(v)) - origin;
    for frame in [&mut spec.frames.femur, &mut spec.frames.tibia] {
        (frame.origin, frame.medial) = (point(frame.origin), vector(frame.medial));
        (frame.anterior, frame.superior) = (vector(frame.anterior), vector(frame.superior));
    }
    for fibre in &mut spec.fibres {
        (fibre.femur, fibre.tibia) = (point(fibre.femur), point(fibre.tibia));
    }
    assert_eq!(spec.side, Side::Left);
    spec.side = if mirrors { Side::Right } else { Side::Left };
    let surface = |(name, mesh): (String, MeshValue)| {
        let MeshValue::Surface(mut mesh) = mesh else { panic!("{name} is no surface") };
        mesh.vertices.iter_mut().for_each(|p| *p = point(*p));
        (name, MeshValue::Surface(if mirrors { mesh.flipped() } else { mesh }))
    };
    let meshes = meshes.into_iter().map(surface).collect();
    sim::compile(&spec, &meshes).unwrap()
}

/// Fails where a side, an axis or a grid is taken from the file's frame in place of the bones'.
#[test]
fn left_mirrors_right_and_a_knee_moved_in_ct_answers_alike() {
    let motion = Isometry::new(Vector::new(310.0, -42.0, 77.0), Vector::new(0.9, -1.7, 0.4));
    let rows = |model: &Model| {
        let drawers = [(30.0, [0.0, 0.0, 100.0]), (60.0, [0.0, 0.0, -100.0])];
        let moments = [(30.0, [0.0, -3.0, 0.0]), (30.0, [6.0, 0.0, 0.0])];
        let row = |(fe, [vv, ie, ap]): (f64, [f64; 3])| {
            let found = solve(model, fe, &Load::new(vv, ie, 0.0, ap, 50.0), &TrialOptions::default()).unwrap();
            [&found.predicted().0[..], &found.forces_n].concat()
        };
        drawers.into_iter().chain(moments).map(row).collect::<Vec<Vec<f64>>>()
    };
    let own = rows(&mapped(|p| p, false));
    let mirrored = rows(&mapped(|p| Point::new(-p.x, p.y, p.z), true));
    let moved = rows(&mapped(|p| motion * p, false));
    // 1e-6 when this was written
    assert!(apart(&own, &mirrored) < 1e-3 && apart(&own, &moved) < 1e-3, "{own:?}\n{mirrored:?}\n{moved:?}");
}

/// Most that the corpus may weigh [byte]: it is public, and everyone who clones the project has it.
const HEAVIEST: u64 = 300_000;

#[test]
fn the_corpus_stays_small() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    let bytes: u64 = crate::common::files(&folder).values().map(|file| file.len() as u64).sum();
    assert!(bytes > 100_000 && bytes < HEAVIEST, "{bytes}");
}

/// proptest without the feature `std` draws from one seed, so a case that fails fails again on every machine and needs no kept file.
#[test]
fn drawn_tests_draw_the_same_each_time() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = |folder: &Path| text(&folder.join("Cargo.toml")).parse::<toml::Table>().unwrap();
    let whole = manifest(root);
    let own = &whole["workspace"]["dependencies"]["proptest"];
    assert_eq!(own["default-features"].as_bool(), Some(false), "{own}");
    let features: Vec<&str> = own["features"].as_array().unwrap().iter().filter_map(toml::Value::as_str).collect();
    assert_eq!(features, ["alloc"], "std and hardware-rng draw another seed each time");
    let mut users = 0;
    for entry in std::fs::read_dir(root).unwrap().flatten().filter(|e| e.path().join("Cargo.toml").exists()) {
        let of_crate = manifest(&entry.path());
        for kind in ["dependencies", "dev-dependencies"] {
            let Some(used) = of_crate.get(kind).and_then(|all| all.get("proptest")) else { continue };
            let keys: Vec<&String> = used.as_table().unwrap().keys().collect();
            assert_eq!(keys, ["workspace"], "{}: {used}", entry.path().display());
            users += 1;
        }
    }
    assert!(users > 1, "{users} crates draw");
}

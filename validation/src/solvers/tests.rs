//! The difference that is told is the true one, with its place.
use super::*;
use sim::coordinate::{AP, Free, Load};
use sim::laxity::{LaxityTrial, Test};
use sim::spec::{ModelSpec, PoseSpec};
use std::collections::BTreeMap;

fn row(step: &str, ap_mm: f64, ie_deg: f64, force: f64) -> TrialResult {
    TrialResult {
        trial: LaxityTrial::asked(step.into(), Test::Anterior, 30.0, Load::compression(20.0)),
        pose: PoseSpec { fe_deg: 30.0, ie_deg, ap_mm, ..PoseSpec::default() },
        forces_n: vec![force, 1.0],
        outputs: vec![],
        flags: vec![],
        bands: vec![],
    }
}

#[test]
fn the_largest_difference_of_each_unit_is_told_with_its_place_and_sign() {
    let bundles = ["ACL_AM", "LCL"].map(String::from);
    let place = Place { protocol: "ap_laxity", cut: "ACL" };
    let both =
        [[row("a", 1.0, 2.0, 50.0), row("a", 1.1, 2.0, 50.0)], [row("b", 1.0, 2.5, 45.0), row("b", 1.05, 2.0, 50.0)]];
    let may = Agreement::default();
    let all: Vec<Apart> = both.iter().flat_map(|[e, q]| place.differences(e, q, &bundles, &may)).collect();
    let told = ["mm", "deg", "N"].map(|unit| most(&all, unit).unwrap());
    let read = |a: &Apart| (a.step.clone(), a.column.clone(), a.cut.clone());
    assert_eq!(read(&told[0]), ("a".into(), AP.column(), "ACL".into()));
    assert_eq!(read(&told[1]), ("b".into(), "ie_deg".into(), "ACL".into()));
    assert_eq!(read(&told[2]), ("b".into(), force_column("ACL_AM"), "ACL".into()));
    let difference = told.each_ref().map(Apart::difference);
    assert!((difference[0] + 0.1).abs() < 1e-12 && (difference[1] - 0.5).abs() < 1e-12);
    assert!((difference[2] + 5.0).abs() < 1e-12);
    assert!(told[0].share() < 1.0 && told[1].share() > 1.0 && told[2].share() > 1.0);
    // no larger difference stands anywhere in the rows
    for ([e, q], unit) in both.iter().zip(["mm", "deg"]) {
        let here: Free<f64> = e.predicted();
        let largest = FREE.into_iter().filter(|c| c.unit() == unit).map(|c| (here[c] - q.predicted()[c]).abs());
        let told = told.iter().find(|a| a.unit == unit).unwrap();
        assert!(largest.fold(0.0, f64::max) <= told.difference().abs() + 1e-12);
    }
}

/// Two bodies in one frame without cartilage, as model.json has them.
const BODIES: &str = r#"
schema = "model/1"
id = "hung"
side = "left"
units = { length = "mm", force = "N", pressure = "MPa", angle = "deg" }
bodies = [
  { name = "femur", bone = "femur.ply", cartilage = [], mass_tonne = 2e-4, inertia_tonne_mm2 = 0.5 },
  { name = "tibia", bone = "tibia.ply", cartilage = [], mass_tonne = 2e-4, inertia_tonne_mm2 = 0.5 },
]
contact = { overclosure_mm = [0, 1], pressure_mpa = [0, 5], friction = 0, damping = 0, pairs = [] }
toe_end_multiple = {}
protocols = []
components = []
warnings = []
[frames]
femur = { origin = [0, 0, 0], medial = [-1, 0, 0], anterior = [0, -1, 0], superior = [0, 0, 1] }
tibia = { origin = [0, 0, 0], medial = [-1, 0, 0], anterior = [0, -1, 0], superior = [0, 0, 1] }
gs_ct_pose = { fe_deg = 0, vv_deg = 0, ie_deg = 0, ml_mm = 0, ap_mm = 0, si_mm = 0 }
"#;
/// Where springs hold the femur, and how far off they end [mm].
const ARM: f64 = 20.0;
const FAR: f64 = 40.0;

/// A femur hung in springs of 30 N/mm, stretched by 3 mm: both solvers have one answer, and no friction. The first two springs are the ACL.
fn hung() -> (ModelSpec, Model) {
    let corners = [(ARM, ARM), (ARM, -ARM), (-ARM, ARM), (-ARM, -ARM)];
    let upright = corners.into_iter().flat_map(|(x, y)| [-FAR, FAR].map(|z| ([x, y, 0.0], [x, y, z])));
    let sides = [(ARM, FAR), (ARM, -FAR), (-ARM, FAR), (-ARM, -FAR)];
    let level = sides.into_iter().flat_map(|(s, by)| [([s, 0.0, 0.0], [s, by, 0.0]), ([0.0, s, 0.0], [by, s, 0.0])]);
    let (mut bundles, mut fibres) = (String::new(), String::new());
    for (k, (femur, tibia)) in upright.chain(level).enumerate() {
        let name = ["ACL_AM", "ACL_PL"].get(k).map_or(format!("S{k}"), |n| (*n).to_owned());
        let length: f64 = (0..3).map(|c| f64::powi(femur[c] - tibia[c], 2)).sum::<f64>().sqrt();
        bundles += &format!(
            "[[bundles]]\nname = \"{name}\"\nreference_strain = {}\nstiffness_n_per_mm = 30\nreference_length_mm = {length:?}\ntoe_strain = 1e-6\nlaw = \"smooth\"\n",
            length / (length - 3.0)
        );
        fibres += &format!("[[fibres]]\nbundle = \"{name}\"\nfemur = {femur:?}\ntibia = {tibia:?}\n");
    }
    let spec: ModelSpec = toml::from_str(&format!("{BODIES}{bundles}{fibres}")).unwrap();
    let model = sim::compile(&spec, &BTreeMap::new()).unwrap();
    (spec, model)
}

fn few_rows() -> ProtocolOptions {
    ProtocolOptions {
        ap_flexions_deg: vec![5.0],
        ap_load_n: 50.0,
        ap_rows: 2,
        to_flexion_deg: 5.0,
        pivot_flexion_deg: 5.0,
        pivot_valgus_nm: 1.0,
        pivot_internal_nm: 0.5,
        ..ProtocolOptions::default()
    }
}

#[test]
fn both_solvers_agree_on_a_hung_femur_and_the_difference_told_is_the_true_one() {
    let (spec, model) = hung();
    let options = few_rows();
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let (mut source, told) = explicit(&quasi, &model, &options).unwrap();
    assert!(told.is_empty(), "{told:?}");
    let told = hold_against(&mut source, &quasi, &model, &options).unwrap();
    assert!(told.is_empty(), "{told:?}");
    let check = source.check.clone().unwrap();
    assert_eq!(check.largest.len(), 12, "three units in each of four protocols");
    for ((protocol, rows), beside) in source.protocols().into_iter().zip(&check.quasistatic) {
        assert!(!rows.is_empty() && rows.len() == beside.len(), "{protocol}");
        let far = |r: &TrialResult, q: &TrialResult| {
            FREE.into_iter().map(move |c| (c, r.predicted()[c] - q.predicted()[c])).collect::<Vec<_>>()
        };
        let all: Vec<_> = rows.iter().zip(beside).flat_map(|(r, q)| far(r, q)).collect();
        for unit in ["mm", "deg"] {
            let most = all.iter().filter(|(c, _)| c.unit() == unit).map(|(_, d)| d.abs()).fold(0.0, f64::max);
            let told = check.largest.iter().find(|a| a.protocol == protocol && a.unit == unit).unwrap();
            assert!((told.difference().abs() - most).abs() < 1e-12, "{protocol} {unit}");
            assert!(most < 5e-3, "{protocol}: {most} {unit} apart");
        }
        let moved = rows.iter().any(|r| r.predicted().iter().any(|x| x.abs() > 0.1));
        // flexed without a load, the springs hold it in its middle
        assert_eq!(moved, protocol != "passive_flexion", "{protocol}");
    }
}

#[test]
fn rows_that_the_explicit_solver_is_stopped_in_are_flagged_and_quasi_static() {
    let (spec, model) = hung();
    let mut options = few_rows();
    options.explicit.most_increments = 50;
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let (mut source, told) = explicit(&quasi, &model, &options).unwrap();
    assert_eq!(told.len(), 4);
    assert!(told.iter().all(|n| n.kind == Kind::ExplicitStopped && n.count > Some(0)), "{told:?}");
    hold_against(&mut source, &quasi, &model, &options).unwrap();
    for ((protocol, rows), (_, beside)) in source.protocols().into_iter().zip(quasi.protocols()) {
        for (row, quasi) in rows.iter().zip(beside) {
            assert!(row.flags.contains(&Flag::Stopped) && row.pose == quasi.pose, "{protocol}");
        }
    }
    assert!(source.check.unwrap().largest.is_empty(), "nothing was told by both");
}

#[test]
fn rows_further_apart_than_they_may_are_flagged_with_the_cause() {
    let (spec, model) = hung();
    let options = few_rows();
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let mut source = quasi.clone();
    source.passive_flexion[1].pose.ap_mm += 0.5;
    source.passive_flexion[1].flags.clear();
    let mut beside = quasi.clone();
    beside.passive_flexion[1].flags.clear();
    let told = hold_against(&mut source, &beside, &model, &options).unwrap();
    assert!(told.len() == 1 && told[0].kind == Kind::SolversApart && told[0].count == Some(1), "{told:?}");
    // without friction both come to rest where the springs hold them
    assert_eq!(source.passive_flexion[1].flags, [Flag::Apart(Cause::Friction)]);
    let check = source.check.unwrap();
    let worst = check.worst("mm").unwrap();
    assert_eq!(
        (worst.protocol.as_str(), worst.quantity.as_str(), worst.cause),
        ("passive_flexion", "AP", Some(Cause::Friction))
    );
    assert!((worst.difference() - 0.5).abs() < 1e-12);
}

#[test]
fn a_row_that_the_quasi_static_solver_has_no_answer_to_is_held_against_nothing() {
    let (spec, model) = hung();
    let options = few_rows();
    let (mut quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let trial = quasi.passive_flexion[1].trial.clone();
    quasi.passive_flexion[1] = TrialResult::without_equilibrium(&trial, quasi.bundles.len());
    let (mut source, _) = explicit(&quasi, &model, &options).unwrap();
    assert!(Source::has_answer(&source.passive_flexion[1]), "explicit dynamics come to rest there");
    let told = hold_against(&mut source, &quasi, &model, &options).unwrap();
    assert!(told.is_empty(), "{told:?}");
    let check = source.check.unwrap();
    assert!(check.largest.len() == 12 && check.largest.iter().all(|a| a.difference().is_finite()));
}

/// Share of the usual damping of fibres by which a knee swings on beyond a row's rest [-].
const LIGHT: f64 = 0.003;

#[test]
fn rows_of_a_knee_that_swings_on_are_held_until_it_rests() {
    let (mut spec, _) = hung();
    spec.bundles.iter_mut().for_each(|b| b.damping_n_s_per_mm *= LIGHT);
    let model = sim::compile(&spec, &BTreeMap::new()).unwrap();
    let options = few_rows();
    let (quasi, _) = Source::simulated("hung", &spec, &model, &options).unwrap();
    let (mut source, _) = explicit(&quasi, &model, &options).unwrap();
    let told = hold_against(&mut source, &quasi, &model, &options).unwrap();
    assert!(told.is_empty(), "{told:?}");
    for (protocol, rows) in source.protocols() {
        assert!(rows.iter().all(|r| !r.flags.contains(&Flag::Moving)), "{protocol} is told before it rests");
    }
}

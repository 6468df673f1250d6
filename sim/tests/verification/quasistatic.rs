//! Laws and orders of convergence of the quasi-static solver, on the same rig as explicit dynamics.
use crate::verification::rig::{Rig, plate};
use meshes::frame::Side;
use meshes::shapes::icosphere;
use meshes::{Isometry, Point, Vector};
use sim::Model;
use sim::contact::{ContactOptions, Nearby};
use sim::coordinate::{FREE, Load, SI, Six};
use sim::explicit::{ExplicitOptions, ExplicitState, TrialSteps, run, unobserved};
use sim::model::compile_with;
use sim::quasistatic::{Dashpots, Goal, Phase, SolverOptions, State, follow, increment};
use sim::trials::{Answer, TrialOptions, chain_flexion, solve, solve_from};

/// VV, IE [N m], ML, AP, SI [N].
pub(crate) const LOAD: Load = Load::new(0.8, -0.5, 0.0, 40.0, 30.0);

pub(crate) fn answer(model: &Model) -> Answer {
    solve(model, 20.0, &LOAD, &TrialOptions::default()).unwrap()
}

/// A difference of coordinates [mm], angles times 30 mm.
fn size(step: &Six) -> f64 {
    step.component_mul(&Six::new(30.0, 30.0, 30.0, 1.0, 1.0, 1.0)).norm()
}

#[test]
fn left_and_right_rest_alike_and_the_ct_frame_does_not_matter() {
    let rig = Rig::knee();
    let here = answer(&rig.compiled()).state.q;
    let mirrored = rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled();
    let mirror = (answer(&mirrored).state.q - here).amax();
    let motion = Isometry::new(Vector::new(120.0, -340.0, 55.0), Vector::new(0.4, -1.1, 2.0));
    let frame = (answer(&rig.mapped(Side::Left, |p| motion * p).compiled()).state.q - here).amax();
    println!("quasi-static: mirror {mirror:.1e}; moved CT frame {frame:.1e} mm or rad");
    // the fields hold distances in single precision
    assert!(mirror < 1e-5 && frame < 1e-5 && here.amax() > 0.3);
}

#[test]
fn at_rest_the_forces_on_the_femur_balance_its_load() {
    let model = Rig::knee().compiled();
    let answer = answer(&model);
    let pose = &answer.evaluation.pose;
    // fibres and contact as forces at their points, and what friction holds, against the load
    let mut left = -LOAD.generalised() + answer.state.friction_gradient;
    for fibre in model.fibre_states(pose) {
        let pull = -fibre.line.direction * fibre.response.force;
        left -= Six::from_fn(|j, _| pose.screws[j].at(&fibre.line.femur).dot(&pull));
    }
    for (force, moment) in &answer.evaluation.contact.wrench {
        left -= Six::from_fn(|j, _| pose.screws[j].linear.dot(force) + pose.screws[j].angular.dot(moment));
    }
    let miss = FREE.iter().map(|&c| left[c].abs() / if c.turns() { 30.0 } else { 1.0 }).fold(0.0, f64::max);
    println!("quasi-static: forces balance to {miss:.1e} N");
    assert!(miss < 1e-5, "{left}");
}

/// An output of an answer by its name.
fn told(answer: &Answer, name: &str) -> f64 {
    answer.outputs.iter().find(|o| o.0 == name).unwrap_or_else(|| panic!("{name} in {:?}", answer.outputs)).1
}

#[test]
fn contact_as_it_is_told_bears_the_load_and_what_the_ligaments_pull() {
    let rig = Rig::knee();
    let model = rig.compiled().with_friction(0.0).unwrap();
    for fe_deg in [0.0, 30.0] {
        let answer = solve(&model, fe_deg, &Load::compression(500.0), &TrialOptions::default()).unwrap();
        let superior = model.joint.tibia().superior;
        let fibres = model.fibre_states(&answer.evaluation.pose);
        let pull: f64 = fibres.iter().map(|f| f.line.direction.dot(&superior) * f.response.force).sum();
        let pressed = -told(&answer, "contact_si_n");
        println!("500 N at {fe_deg} deg: contact {pressed:.2} N, ligaments {pull:.2} N, left {:.2} N", pressed - pull);
        assert!((pressed - pull - 500.0).abs() < 5.0, "{pressed} N of contact, {pull} N of ligaments");
        let area = ["medial", "lateral"].map(|c| told(&answer, &format!("contact_{c}_area_mm2")));
        let whole: f64 = answer.evaluation.contact.area.iter().sum();
        assert!((area[0] + area[1] - whole).abs() < 1e-9 * whole && whole > 0.0, "{area:?} of {whole} mm2");
        for c in ["medial", "lateral"] {
            let [mean, peak] = ["mean", "peak"].map(|k| told(&answer, &format!("contact_{c}_{k}_mpa")));
            assert!(mean <= peak, "{c}: mean {mean}, peak {peak} MPa");
        }
    }
}

#[test]
fn a_mirrored_knee_presses_the_same_compartment() {
    let rig = Rig::knee();
    let here = answer(&rig.compiled());
    let there = answer(&rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled());
    for (name, value) in here.outputs.iter().filter(|o| o.0.starts_with("contact_")) {
        let off = (told(&there, name) - value).abs();
        assert!(off < 1e-3 * value.abs().max(1.0), "{name}: {value} and {}", told(&there, name));
    }
}

/// Follows a load put on with dashpots, then taken off.
fn way(model: &Model, steps: usize, back: bool) -> Six {
    let dashpots = Dashpots { fibres: true, translation: 0.2, rotation: 20.0 };
    let options =
        SolverOptions { step_on_the_way_mm: 1e-9, departure_mm: 50.0, iterations: 200, ..SolverOptions::default() };
    let rest = Load::compression(30.0).generalised();
    let (on, mut near) = (LOAD.generalised(), Nearby::default());
    let mut go = |from: &State, load: &Six, goal: &Six, seconds: f64, flexion: f64| {
        let phase = Phase { flexion, load: *goal, load_from: 0.0, flow: Some((seconds, dashpots)), steps };
        follow(model, from, load, &phase, (&options, &mut near), &mut |_, _| {}).unwrap()
    };
    let start = go(&State::default(), &rest, &rest, 30.0, 0.0);
    let there = go(&start, &rest, &on, 0.02, 0.2);
    if !back {
        return there.q;
    }
    let off = go(&there, &on, &rest, 0.02, 0.0);
    let again = go(&off, &rest, &rest, 30.0, 0.0);
    assert!(size(&(there.q - start.q)) > 1.0);
    again.q - start.q
}

#[test]
fn a_frictionless_path_returns() {
    let model = Rig::knee().compiled().with_friction(0.0).unwrap();
    let miss = size(&way(&model, 32, true));
    println!("quasi-static: load put on and taken off without friction, {miss:.1e} mm from the start");
    assert!(miss < 1e-6);
}

#[test]
fn halving_the_increment_halves_the_error_of_a_path() {
    // implicit Euler is of first order; the ends at rest are those of any increment
    let model = Rig::knee().compiled().with_friction(0.0).unwrap();
    let q = [16, 32, 64, 128].map(|steps| way(&model, steps, false));
    let gap: Vec<f64> = q.windows(2).map(|w| size(&(w[1] - w[0]))).collect();
    let order = [(gap[0] / gap[1]).log2(), (gap[1] / gap[2]).log2()];
    println!("quasi-static: halved increments move the pose under way by {gap:.5?} mm, orders {order:.2?}");
    assert!(order.iter().all(|o| (o - 1.0).abs() < 0.3));
}

#[test]
fn resting_poses_converge_as_both_contact_meshes_are_refined() {
    let at_rest = |levels: u32, cells: usize| {
        let knee = Rig::knee();
        let mut rig = Rig::new();
        for (x, depth) in [(-22.0, 0.05), (22.0, 0.03)] {
            let at = |z: f64| Isometry::translation(x + 0.0713, 0.0437, z + 0.0137);
            let ball = icosphere(20.0, levels).moved(&at(20.0 - depth));
            rig = rig.pair(ball, plate(18.0, cells, true).moved(&at(0.0)));
        }
        (rig.spec.bundles, rig.spec.fibres) = (knee.spec.bundles, knee.spec.fibres);
        answer(&compile_with(&rig.spec, &rig.meshes, &ContactOptions { spacing_mm: 0.0 }).unwrap()).state.q
    };
    let q = [(3, 24), (4, 48), (5, 96)].map(|(levels, cells)| at_rest(levels, cells));
    let gap: Vec<f64> = q.windows(2).map(|w| size(&(w[1] - w[0]))).collect();
    let order = (gap[0] / gap[1]).log2();
    println!("quasi-static: refined meshes move the end by {gap:.4?} mm, order {order:.2}");
    assert!(gap[1] < 0.05 && order > 1.0);
}

/// How far explicit dynamics end from the quasi-static path [mm or deg], both from rest at 20 deg under [`LOAD`].
pub(crate) fn explicit_apart(model: &Model) -> f64 {
    let steps = TrialSteps::default().program(&model.joint, 20.0, &LOAD.generalised()).unwrap();
    let mut state = ExplicitState::at_rest();
    run(model, &steps, &ExplicitOptions::default(), &mut state, &mut unobserved).unwrap();
    let mut options = TrialOptions { increments: [24, 144, 32], ..TrialOptions::default() };
    options.solver.step_on_the_way_mm = 1e-5;
    let still = solve(model, 20.0, &LOAD, &options).unwrap();
    let [a, b] = [&state.q, &still.state.q].map(|q| model.joint.grood_suntay(q));
    FREE.map(|c| c.to_file(a[c] - b[c]).abs()).into_iter().fold(0.0, f64::max)
}

/// Where a trial's flexing, loading and holding leave a knee, from a state on.
fn left(model: &Model, from: &State, (flexion, load): (f64, &Load), o: &TrialOptions) -> State {
    let dashpots = Dashpots { fibres: true, translation: o.damping, rotation: o.damping };
    let (before, after) = (Load::compression(load[SI]).generalised(), load.generalised());
    let phase = |seconds: f64, load_from: f64, steps: usize| Phase {
        flexion,
        load: after,
        load_from,
        flow: Some((seconds, dashpots)),
        steps,
    };
    let mut near = Nearby::default();
    let loading = phase(o.load_s, o.load_from, o.increments[1]);
    let there = follow(model, from, &before, &loading, (&o.solver, &mut near), &mut |_, _| {}).unwrap();
    let holding = phase(o.hold_s, 0.0, o.increments[2]);
    follow(model, &there, &after, &holding, (&o.solver, &mut near), &mut |_, _| {}).unwrap()
}

#[test]
fn a_knee_that_is_far_from_its_rest_when_a_trial_ends_is_held_again() {
    let model = Rig::knee().compiled().with_friction(0.0).unwrap();
    let flexion = chain_flexion(&model, 20.0, &TrialOptions::default()).unwrap();
    // loaded so soon, with dashpots so heavy, that the knee lags further behind than so few steps of a search go
    for (damping, ap, is_near_enough) in [(1.0, 200.0, true), (10.0, 200.0, false)] {
        let load = Load::new(0.8, -0.5, 0.0, ap, 30.0);
        let o = TrialOptions {
            load_s: 0.1,
            hold_s: 0.1,
            damping,
            increments: [1, 200, 50],
            solver: SolverOptions { iterations: 5, ..SolverOptions::default() },
            ..TrialOptions::default()
        };
        let from = State::default();
        let held_once = left(&model, &from, (flexion, &load), &o);
        let goal = Goal { flexion, load: load.generalised(), flow: None };
        assert!(
            increment(&model, &held_once, &goal, &o.solver, true).is_err(),
            "{damping}, {ap} N: nothing to hold for"
        );
        let found = solve_from(&model, &from, 20.0, &load, &o);
        assert_eq!(found.is_ok(), is_near_enough, "{damping}, {ap} N");
        let rest = solve(&model, 20.0, &load, &TrialOptions::default()).unwrap();
        let off = found.map_or(0.0, |found| size(&(found.state.q - rest.state.q)));
        assert!(off < 1e-5, "{damping}, {ap} N: {off} mm off");
    }
}

//! Laws that explicit dynamics keep.
use crate::verification::fixed;
use crate::verification::rig::{Rig, program, step};
use meshes::frame::Side;
use meshes::{Isometry, Point, Vector};
use sim::coordinate::{AP, IE, SI, Six, VV};
use sim::explicit::{ExplicitOptions, ExplicitState, Program, Progress, TrialSteps, run, snapshot, unobserved};
use sim::{Model, SimError};
use std::ops::ControlFlow;

pub(crate) fn trial_load() -> Six {
    let mut load = Six::zeros();
    (load[SI], load[AP], load[IE], load[VV]) = (30.0, 40.0, -500.0, 800.0);
    load
}

/// Without friction and dashpots a motion whose rates are turned round goes back to where it began.
pub(crate) fn reversed_returns(name: &str, mut rig: Rig, compiled: impl Fn(&Rig) -> Model) {
    rig.spec.bundles.iter_mut().for_each(|b| b.damping_n_s_per_mm = 0.0);
    rig.spec.contact.damping = 0.0;
    let model = compiled(&rig).with_friction(0.0).unwrap();
    let program = program([step(5e-3, &[], trial_load() * 0.2)]);
    let start = Six::new(0.02, 0.01, -0.02, 0.3, -0.4, -0.1);
    let mut state = ExplicitState::moving(&model, 1.0, start, Six::zeros());
    run(&model, &program, &fixed(2e-5), &mut state, &mut unobserved).unwrap();
    let way = (state.q - start).amax();
    let mut back = state.reversed();
    run(&model, &program, &fixed(2e-5), &mut back, &mut unobserved).unwrap();
    let miss = (back.q - start).amax();
    println!("{name}, reversal: {way:.3} mm out, {miss:.1e} mm from the start after coming back");
    assert!(way > 0.1 && miss < 1e-6);
}

/// The paper's steps on the rig knee, with an AP cycle.
pub(crate) fn trial(model: &Model) -> Program {
    let steps = TrialSteps { settle_s: 0.3, load_s: 0.6, ..TrialSteps::default() };
    let mut program = steps.program(&model.joint, 20.0, &trial_load()).unwrap();
    program.steps.push(steps.ap_cycle(&trial_load(), 40.0));
    program
}

pub(crate) fn finished(model: &Model, program: &Program, options: &ExplicitOptions) -> ExplicitState {
    let mut state = ExplicitState::at_rest();
    run(model, program, options, &mut state, &mut unobserved).unwrap();
    state
}

#[test]
fn energy_balances_over_settling_loading_and_cycling() {
    let model = Rig::knee().compiled();
    let state = finished(&model, &trial(&model), &ExplicitOptions::default());
    println!("energy: {}, balance {:.1e}", state.energies, state.energies.balance_error());
    assert!(state.energies.balance_error() < 0.01);
    assert!(state.energies.friction > 0.0 && state.energies.damping > 0.0);
}

#[test]
fn energy_balances_when_a_bundle_fails() {
    let model = Rig::knee().compiled();
    let mut program = trial(&model);
    program.steps[1].fail = vec!["spring0".into()];
    let state = finished(&model, &program, &ExplicitOptions::default());
    let there = snapshot(&model, &program, &state).unwrap();
    println!("failure: {:.2} N mm released, balance {:.1e}", state.energies.released, state.energies.balance_error());
    assert_eq!(there.bundle_forces[0], 0.0);
    assert!(state.energies.released > 0.1 && state.energies.balance_error() < 0.01);
}

#[test]
fn a_free_body_keeps_its_momentum() {
    let model = Rig::new().compiled();
    let rate = Six::new(3.0, -2.0, 4.0, 50.0, -30.0, 20.0);
    let mut state = ExplicitState::moving(&model, 1.0, Six::new(0.3, 0.1, -0.2, 1.0, 2.0, 3.0), rate);
    let before = state.momentum();
    run(&model, &program([step(0.1, &[], Six::zeros())]), &fixed(1e-4), &mut state, &mut unobserved).unwrap();
    let drift = (state.momentum() - before).amax() / before.amax();
    println!("free body: momentum drifts by {drift:.1e}, energy balance {:.1e}", state.energies.balance_error());
    assert!(drift < 1e-12 && state.energies.balance_error() < 1e-9);
}

#[test]
fn the_change_of_momentum_is_the_impulse_of_the_forces() {
    let p = Point::new;
    let rig = Rig::new().spring([p(3.0, 2.0, 5.0), p(10.0, -20.0, -30.0)], 40.0, 2.0);
    let model = rig.spring([p(-4.0, 1.0, 0.0), p(-25.0, 10.0, 20.0)], 30.0, 1.5).compiled();
    let wrench = |q: &Six| {
        let pose = model.joint.pose(q);
        let centre = (pose.femur * Point::origin()).coords;
        let mut out = Six::zeros();
        for fibre in model.fibre_states(&pose) {
            let f: Vector = -fibre.line.direction * fibre.response.force;
            let m = (fibre.line.femur - centre).cross(&f);
            out += Six::new(m.x, m.y, m.z, f.x, f.y, f.z);
        }
        out
    };
    let dt = 2e-6;
    let mut impulse = wrench(&Six::zeros()) * (0.5 * dt);
    let mut q = Vec::new();
    let mut state = ExplicitState::at_rest();
    let mut observer = |p: &Progress| {
        q.push(p.state.q);
        ControlFlow::Continue(())
    };
    run(&model, &program([step(2000.0 * dt, &[], Six::zeros())]), &fixed(dt), &mut state, &mut observer).unwrap();
    let last = q.pop().unwrap();
    impulse += q.iter().map(wrench).sum::<Six>() * dt + wrench(&last) * (0.5 * dt);
    let miss = (state.momentum() - impulse).amax() / impulse.amax();
    println!("impulse: momentum {:.3e}, off by {miss:.1e}", state.momentum().amax());
    assert!(miss < 1e-5);
}

#[test]
fn a_frictionless_motion_reversed_returns_to_where_it_began() {
    reversed_returns("knee", Rig::knee(), Rig::compiled);
}

#[test]
fn left_and_right_answer_alike_and_the_ct_frame_does_not_matter() {
    let rig = Rig::knee();
    let options = ExplicitOptions::default();
    let model = rig.compiled();
    let here = finished(&model, &trial(&model), &options).q;
    let mirrored = rig.mapped(Side::Right, |p| Point::new(-p.x, p.y, p.z)).compiled();
    let mirror = (finished(&mirrored, &trial(&mirrored), &options).q - here).amax();
    let motion = Isometry::new(Vector::new(120.0, -340.0, 55.0), Vector::new(0.4, -1.1, 2.0));
    let moved = rig.mapped(Side::Left, |p| motion * p).compiled();
    let frame = (finished(&moved, &trial(&moved), &options).q - here).amax();
    println!("mirror: {mirror:.1e}; moved CT frame: {frame:.1e} mm or rad");
    assert!(mirror < 1e-4 && frame < 1e-4 && here.amax() > 0.3);
}

#[test]
fn contact_forces_are_the_slope_of_the_energy_and_those_of_the_quasi_static_solver() {
    let model = Rig::knee().compiled();
    let q = Six::new(0.1, 0.004, -0.03, 0.4, 0.7, 0.1);
    let at = |q: &Six| model.contact.press(&model.joint.pose(q));
    let pose = model.joint.pose(&q);
    let here = at(&q);
    let whole = model.contact.evaluate(&pose);
    assert!((here.energy - whole.energy).abs() < 1e-9 * whole.energy && whole.energy > 1.0);
    let mut worst: f64 = 0.0;
    for j in 0..6 {
        let force = pose.screws[j].linear.dot(&here.force) + pose.screws[j].angular.dot(&here.moment);
        assert!((force + whole.gradient[j]).abs() < 1e-9 * whole.gradient.amax());
        let mut h = Six::zeros();
        h[j] = if j < 3 { 1e-6 } else { 1e-5 };
        let slope = (at(&(q + h)).energy - at(&(q - h)).energy) / (2.0 * h[j]);
        worst = worst.max((slope + force).abs() / whole.gradient.amax());
    }
    println!("contact: forces against finite differences of the energy, worst {worst:.1e} of the largest");
    assert!(worst < 1e-4);
}

fn bytes(state: &ExplicitState) -> Vec<u8> {
    let mut out = Vec::new();
    ciborium::into_writer(state, &mut out).unwrap();
    out
}

#[test]
fn a_run_that_was_stopped_written_and_read_ends_in_the_same_bytes() {
    let model = Rig::knee().compiled();
    let (program, options) = (trial(&model), ExplicitOptions::default());
    let whole = finished(&model, &program, &options);
    for stop in [1, 137, 700, whole.increments - 1] {
        let mut state = ExplicitState::at_rest();
        let mut observer =
            |p: &Progress| if p.state.increments == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let stopped = run(&model, &program, &options, &mut state, &mut observer);
        assert!(matches!(stopped, Err(SimError::Cancelled { time }) if time > 0.0));
        let mut state: ExplicitState = ciborium::from_reader(bytes(&state).as_slice()).unwrap();
        run(&model, &program, &options, &mut state, &mut unobserved).unwrap();
        assert_eq!(bytes(&state), bytes(&whole), "stopped at {stop}");
    }
}

#[test]
fn what_blows_up_says_when_and_with_what_energies() {
    let model = Rig::knee().compiled();
    let options = ExplicitOptions { mass_scale: 1e-3, ..fixed(5e-3) };
    let error = run(&model, &trial(&model), &options, &mut ExplicitState::at_rest(), &mut unobserved).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("blew up at increment") && text.contains("kinetic") && text.contains("s of step"), "{text}");
}

#[test]
fn bad_programs_are_refused() {
    let model = Rig::knee().compiled();
    let refused = |program: &Program, options: &ExplicitOptions, word: &str| {
        let error = run(&model, program, options, &mut ExplicitState::at_rest(), &mut unobserved).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
    };
    let good = trial(&model);
    let mut nan = good.clone();
    nan.steps[1].drive[AP.index()] = sim::explicit::Drive::Load(sim::explicit::Course::constant(f64::NAN));
    refused(&nan, &fixed(1e-3), "AP");
    let mut never = good.clone();
    never.steps[0].duration_s = 0.0;
    refused(&never, &fixed(1e-3), "duration");
    refused(&good, &fixed(5.0), "longest_increment_s");
    refused(&good, &fixed(-1.0), "longest_increment_s");
    let mut absurd = good.clone();
    absurd.steps[0].increment_s = Some(1e-12);
    refused(&absurd, &fixed(1e-3), "increments of");
    refused(&Program::default(), &fixed(1e-3), "without steps");
    let mut fail = good;
    fail.steps[0].fail = vec!["NONE".into()];
    refused(&fail, &fixed(1e-3), "NONE");
    let steps = TrialSteps::default();
    for (flexion, load) in [(500.0, 0.0), (f64::NAN, 0.0), (30.0, f64::NAN), (30.0, f64::INFINITY)] {
        let mut loads = Six::zeros();
        loads[AP] = load;
        assert!(steps.program(&model.joint, flexion, &loads).is_err());
    }
}

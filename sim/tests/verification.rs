//! Explicit dynamics against closed answers: docs/verification.md holds the figures printed here.
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

#[path = "common/rig.rs"]
mod rig;

use meshes::{Point, Vector};
use rig::{INERTIA, MASS, Rig, program, step};
use sim::explicit::{Control, ExplicitOptions, ExplicitState, run, unobserved};
use sim::joint::{AP, FE, IE, ML, SI, Six, VV};

fn fixed(increment_s: f64) -> ExplicitOptions {
    ExplicitOptions {
        control: Control::Fixed,
        longest_increment_s: increment_s,
        mass_scale: 1.0,
        ..ExplicitOptions::default()
    }
}

fn load(coordinate: usize, value: f64) -> Six {
    let mut load = Six::zeros();
    load[coordinate] = value;
    load
}

/// Femur on a spring hung above it along the tibial axis: the tibia's superior load pulls the femur away.
fn hanging(increment_s: f64, duration_s: f64) -> ExplicitState {
    let rig = Rig::new().spring([Point::origin(), Point::new(0.0, 0.0, 50.0)], 80.0, 1.0);
    let model = rig.compiled();
    let step = step(duration_s, &[FE, VV, IE, ML, AP], load(SI, 90.0));
    let mut state = ExplicitState::at_rest();
    run(&model, &program([step]), &fixed(increment_s), &mut state, &mut unobserved).unwrap();
    state
}

#[test]
fn a_spring_swings_as_in_closed_form() {
    let omega = (80.0 / MASS).sqrt();
    let t = 2.3 * std::f64::consts::TAU / omega;
    // stretched by 1 mm, less its toe, and pulled by 90 N: x = (F - F0) / k (1 - cos), the femur's way down
    let pretension = 80.0 * (1.0 - 49e-6);
    let exact = (90.0 - pretension) / 80.0 * (1.0 - (omega * t).cos());
    let error = |n: f64| (hanging(t / n, t).q[SI] - exact).abs();
    let (coarse, fine) = (error(200.0), error(400.0));
    let order = (coarse / fine).log2();
    println!("spring: q {exact:.6} mm, errors {coarse:.2e} {fine:.2e} mm, order {order:.2}");
    assert!((order - 2.0).abs() < 0.1 && fine < 2e-4);
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
    assert!(drift < 1e-12 && state.energies.balance_error() < 1e-6);
    let _ = (INERTIA, Vector::x());
}

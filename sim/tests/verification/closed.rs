//! Explicit dynamics against closed answers.
use crate::verification::fixed;
use crate::verification::rig::{MASS, Rig, plate, program, step};
use meshes::shapes::icosphere;
use meshes::{Isometry, Point};
use sim::contact::ContactOptions;
use sim::coordinate::{AP, Coordinate, FE, IE, ML, SI, Six, VV};
use sim::deck::Curve;
use sim::explicit::{Course, Drive, ExplicitOptions, ExplicitState, Progress, Step, run, unobserved};
use sim::model::compile_with;
use sim::{Model, SimError};
use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;

const TURNS: [Coordinate; 3] = [FE, VV, IE];

fn load(coordinate: Coordinate, value: f64) -> Six {
    let mut load = Six::zeros();
    load[coordinate] = value;
    load
}

fn all_nodes(rig: &Rig) -> Model {
    compile_with(&rig.spec, &rig.meshes, &ContactOptions { spacing_mm: 0.0 }).unwrap()
}

/// Runs a step from `state` to its end.
fn go(model: &Model, step: Step, options: &ExplicitOptions, mut state: ExplicitState) -> ExplicitState {
    run(model, &program([step]), options, &mut state, &mut unobserved).unwrap();
    state
}

/// Runs a step under light dashpots until it is at rest.
fn rest(model: &Model, mut step: Step) -> ExplicitState {
    step.damping = Six::repeat(1.0);
    let state = go(model, step, &ExplicitOptions::default(), ExplicitState::at_rest());
    assert!(state.rate.amax() < 1e-6, "not at rest: {:?}", state.rate.as_slice());
    state
}

#[test]
fn a_spring_swings_as_in_closed_form() {
    // the femur on a spring hung above it along the tibial axis: the tibia's superior load pulls the femur away
    let model = Rig::new().spring([Point::origin(), Point::new(0.0, 0.0, 50.0)], 80.0, 1.0).compiled();
    let omega = (80.0 / MASS).sqrt();
    let t = 2.3 * TAU / omega;
    // stretched by 1 mm, less its toe, and pulled by 90 N: x = (F - F0) / k (1 - cos), the femur's way down
    let pretension = 80.0 * (1.0 - 49e-6);
    let exact = (90.0 - pretension) / 80.0 * (1.0 - (omega * t).cos());
    let error = |n: f64| {
        let step = step(t, &[FE, VV, IE, ML, AP], load(SI, 90.0));
        (go(&model, step, &fixed(t / n), ExplicitState::at_rest()).q[SI] - exact).abs()
    };
    let (coarse, fine) = (error(200.0), error(400.0));
    let order = (coarse / fine).log2();
    println!("spring: way {exact:.6} mm, errors {coarse:.2e} {fine:.2e} mm, order {order:.2}");
    assert!((order - 2.0).abs() < 0.1 && fine < 2e-4);
}

/// Period of a point hung on a stiff fibre of 50 mm under 2 N, let go at `angle`.
fn pendulum(angle: f64, increment_s: f64) -> Result<f64, SimError> {
    let length = 50.0;
    let model = Rig::new().spring([Point::origin(), Point::new(0.0, 0.0, length)], 2e4, 1e-4).compiled();
    let mut q = Six::zeros();
    (q[ML], q[SI]) = (length * angle.sin(), -length * (1.0 - angle.cos()));
    let mut state = ExplicitState::moving(&model, 1.0, q, Six::zeros());
    let (mut last, mut crossings) = ((0.0, q[ML]), Vec::new());
    let mut observer = |p: &Progress| {
        let now = (p.state.time_s, p.state.q[ML]);
        if last.1 * now.1 < 0.0 {
            crossings.push(last.0 + (now.0 - last.0) * last.1 / (last.1 - now.1));
        }
        last = now;
        ControlFlow::Continue(())
    };
    let step = step(1.2, &TURNS, load(SI, 2.0));
    run(&model, &program([step]), &fixed(increment_s), &mut state, &mut observer)?;
    Ok(crossings[2] - crossings[0])
}

#[test]
fn a_pendulum_has_its_period() {
    for angle in [0.1f64, 1.2] {
        let (mut a, mut b) = (1.0, (angle / 2.0).cos());
        for _ in 0..8 {
            (a, b) = ((a + b) / 2.0, f64::sqrt(a * b));
        }
        let exact = TAU * (50.0 * MASS / 2.0).sqrt() / a;
        let error = pendulum(angle, 5e-5).unwrap() / exact - 1.0;
        println!("pendulum from {angle} rad: period {exact:.6} s, relative error {error:.1e}");
        assert!(error.abs() < 2e-4);
    }
}

#[test]
fn a_block_sinks_into_an_elastic_foundation_and_bounces_on_it() {
    let model = all_nodes(&Rig::new().pair(plate(25.0, 100, false), plate(30.0, 120, true)));
    let stiffness = 5.0 * 50.0 * 50.0;
    let at_rest = rest(&model, step(0.5, &[FE, VV, IE, ML, AP], load(SI, 1250.0)));
    let miss = at_rest.q[SI] / (1250.0 / stiffness) - 1.0;
    // let go 0.05 mm deeper, the way after a quarter of the period is the equilibrium's
    let mut q = at_rest.q;
    q[SI] += 0.05;
    let period = TAU * (MASS / stiffness).sqrt();
    let mut state = ExplicitState::moving(&model, 1.0, q, Six::zeros());
    let mut track = Vec::new();
    let mut observer = |p: &Progress| {
        track.push((p.state.time_s, p.state.q[SI] - at_rest.q[SI]));
        ControlFlow::Continue(())
    };
    let bounce = step(2.0 * period, &[FE, VV, IE, ML, AP], load(SI, 1250.0));
    run(&model, &program([bounce]), &fixed(period / 400.0), &mut state, &mut observer).unwrap();
    let falls: Vec<f64> = track
        .windows(2)
        .filter(|w| w[0].1 > 0.0 && w[1].1 <= 0.0)
        .map(|w| w[0].0 + (w[1].0 - w[0].0) * w[0].1 / (w[0].1 - w[1].1))
        .collect();
    let late = (falls[1] - falls[0]) / period - 1.0;
    println!(
        "block: {:.5} mm for {:.5}, off by {:.2} %; period off by {:.2} %",
        at_rest.q[SI],
        1250.0 / stiffness,
        100.0 * miss,
        100.0 * late
    );
    // the block's rim fades
    assert!(miss.abs() < 0.01 && late.abs() < 0.01);
}

#[test]
fn a_sphere_sinks_into_a_plane_as_in_closed_form_and_ever_closer_with_finer_meshes() {
    // nodes of the sphere into the plane: pi k R d^2; of the plane into the sphere: pi k (R - d) d^2; the mean of both
    let (radius, force) = (20.0, 40.0);
    let mut exact = f64::sqrt(force / (PI * 5.0 * radius));
    for _ in 0..20 {
        exact = (force / (PI * 5.0 * (radius - 0.5 * exact))).sqrt();
    }
    let mut errors = Vec::new();
    for (levels, cells) in [(3, 24), (4, 48), (5, 96)] {
        let ball = icosphere(radius, levels).moved(&Isometry::translation(0.0, 0.0, radius));
        let model = all_nodes(&Rig::new().pair(ball, plate(12.0, cells, true)));
        let state = rest(&model, step(0.5, &[FE, VV, IE, ML, AP], load(SI, force)));
        errors.push((state.q[SI] / exact - 1.0).abs());
    }
    let order = (errors[0] / errors[2]).log2() / 2.0;
    println!("sphere: depth {exact:.5} mm, relative errors {errors:.4?}, order over both halvings {order:.2}");
    assert!(errors[2] < 0.005 && order > 1.4 && errors.is_sorted_by(|a, b| a > b));
}

/// Way after `time` of a block pulled by `pull` against friction that grows to `limit` over `slip`: a spring first, then steady acceleration.
fn slide(pull: f64, limit: f64, slip: f64, time: f64) -> f64 {
    let omega = (limit / slip / MASS).sqrt();
    let stuck = (1.0 - limit / pull).acos() / omega;
    let speed = pull / limit * slip * omega * (omega * stuck).sin();
    let rest = time - stuck;
    slip + speed * rest + 0.5 * (pull - limit) / MASS * rest * rest
}

#[test]
fn a_block_on_a_slope_stays_below_the_angle_of_friction_and_slides_above_it() {
    let mut rig = Rig::new().pair(plate(10.125, 40, false), plate(20.0, 80, true));
    rig.spec.contact.friction = 0.3;
    let model = all_nodes(&rig);
    let weight = 50.0;
    let on = |angle: f64| {
        let mut load = load(SI, weight * angle.cos());
        load[ML] = weight * angle.sin();
        load
    };
    let lying = |angle: f64| {
        let load = load(SI, weight * angle.cos());
        rest(&model, step(0.2, &[FE, VV, IE, ML, AP], load)).restarted()
    };
    let options = ExplicitOptions { slip_mm: 1e-3, ..fixed(2e-6) };
    // below the angle (0.291 rad) the pull is ramped up: the patches give way elastically, within the slip
    let mut pull = step(0.02, &TURNS, on(0.24));
    pull.drive[ML.index()] = Drive::Load(Course::ramp([0.0, weight * 0.24f64.sin()], [0.0, 0.01], Curve::SmoothStep));
    let shallow = go(&model, pull, &options, lying(0.24)).q[ML];
    let (angle, time) = (0.4f64, 4e-3);
    let steep = go(&model, step(time, &TURNS, on(angle)), &options, lying(angle)).q[ML];
    let exact = slide(weight * angle.sin(), 0.3 * weight * angle.cos(), 1e-3, time);
    println!(
        "slope: {shallow:.2e} mm given way below the angle of friction; {steep:.4} mm slid above it, exact {exact:.4}"
    );
    assert!(shallow.abs() < 1e-3 && (steep / exact - 1.0).abs() < 0.02);
}

#[test]
fn two_fibres_settle_where_their_tensions_balance() {
    let p = |x: f64| Point::new(x, 0.0, 0.0);
    let model = Rig::new().spring([p(0.0), p(40.0)], 70.0, 2.0).spring([p(0.0), p(-60.0)], 30.0, 3.0).compiled();
    let state = rest(&model, step(0.5, &[FE, VV, IE, AP, SI], load(ML, 12.0)));
    // 70 (2 - toe - x) = 30 (3 - toe' + x) + load, the toes 38e-6 and 57e-6 mm; the tibia's lateral load pushes the femur medially
    let (a, b) = (2.0 - 38e-6, 3.0 - 57e-6);
    let exact = -(70.0 * a - 30.0 * b - 12.0) / 100.0;
    println!("two fibres: {:.9} mm, exact {exact:.9}", state.q[ML]);
    assert!((state.q[ML] - exact).abs() < 1e-7);
}

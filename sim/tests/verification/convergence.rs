//! Orders of convergence of explicit dynamics.
use crate::verification::fixed;
use crate::verification::rig::{Rig, plate, program, step};
use meshes::Isometry;
use meshes::shapes::icosphere;
use sim::Model;
use sim::contact::ContactOptions;
use sim::coordinate::{AP, IE, SI, Six, VV};
use sim::explicit::{ExplicitOptions, ExplicitState, TrialSteps, run, unobserved};
use sim::model::compile_with;

fn load() -> Six {
    let mut load = Six::zeros();
    (load[SI], load[AP], load[IE], load[VV]) = (30.0, 20.0, -300.0, 300.0);
    load
}

/// Where a motion from rest under half the load is 4 ms after the rest is put on, with fixed increments.
fn after(model: &Model, increment_s: f64) -> Six {
    let mut settle = step(0.5, &[], load() * 0.5);
    settle.damping = Six::repeat(1.0);
    let mut state = ExplicitState::at_rest();
    run(model, &program([settle]), &ExplicitOptions::default(), &mut state, &mut unobserved).unwrap();
    let options = fixed(increment_s);
    let mut state = ExplicitState::moving(model, 1.0, state.q, Six::zeros());
    run(model, &program([step(4e-3, &[], load())]), &options, &mut state, &mut unobserved).unwrap();
    state.q
}

/// Orders between increments of 16, 8, 4, 2 microseconds.
fn orders(model: &Model) -> (f64, f64) {
    let q = [16e-6, 8e-6, 4e-6, 2e-6].map(|dt| after(model, dt));
    let gap = |k: usize| (q[k + 1] - q[k]).component_mul(&scale()).norm();
    ((gap(0) / gap(1)).log2(), (gap(1) / gap(2)).log2())
}

#[test]
fn halving_the_increment_quarters_the_error() {
    let mut rig = Rig::knee();
    rig.spec.contact.friction = 0.0;
    let damped = orders(&rig.compiled());
    rig.spec.bundles.iter_mut().for_each(|b| b.damping_n_s_per_mm = 0.0);
    let free = orders(&rig.compiled());
    println!("increments: orders {:.2} {:.2} without dashpots, {:.2} {:.2} with", free.0, free.1, damped.0, damped.1);
    for order in [free.0, free.1, damped.0, damped.1] {
        assert!((order - 2.0).abs() < 0.4);
    }
}

/// End state of a trial on the rig knee whose femoral and tibial meshes are refined together.
fn refined(levels: u32, cells: usize) -> Six {
    let mut rig = Rig::knee();
    let (spec, fibres) = (rig.spec.clone(), rig.spec.fibres.clone());
    rig = Rig::new();
    for (x, depth) in [(-22.0, 0.05), (22.0, 0.03)] {
        let at = |z: f64| Isometry::translation(x + 0.0713, 0.0437, z + 0.0137);
        let ball = icosphere(20.0, levels).moved(&at(20.0 - depth));
        rig = rig.pair(ball, plate(18.0, cells, true).moved(&at(0.0)));
    }
    (rig.spec.bundles, rig.spec.fibres) = (spec.bundles, fibres);
    let model = compile_with(&rig.spec, &rig.meshes, &ContactOptions { spacing_mm: 0.0 }).unwrap();
    let steps = TrialSteps { settle_s: 0.3, load_s: 0.6, ..TrialSteps::default() };
    let program = steps.program(&model.joint, 20.0, &load()).unwrap();
    let mut state = ExplicitState::at_rest();
    run(
        &model,
        &program,
        &ExplicitOptions { mass_scale: 20.0, ..ExplicitOptions::default() },
        &mut state,
        &mut unobserved,
    )
    .unwrap();
    state.q
}

#[test]
fn end_states_converge_as_both_contact_meshes_are_refined() {
    let q = [(3, 24), (4, 48), (5, 96)].map(|(levels, cells)| refined(levels, cells));
    let gap: Vec<f64> = q.windows(2).map(|w| (w[1] - w[0]).component_mul(&scale()).norm()).collect();
    let order = (gap[0] / gap[1]).log2();
    println!("meshes: end states move by {gap:.4?} mm from refinement to refinement, order {order:.2}");
    assert!(gap[1] < 0.05 && order > 1.0);
}

/// Radians to mm at 30 mm.
fn scale() -> Six {
    Six::new(30.0, 30.0, 30.0, 1.0, 1.0, 1.0)
}

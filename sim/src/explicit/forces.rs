//! Forces of position at a pose, with what damps and stiffens it.

use super::options::ExplicitOptions;
use super::state::ExplicitState;
use crate::contact::{FrictionState, Nearby};
use crate::coordinate::Six;
use crate::joint::Pose;
use crate::model::Model;
use meshes::Vector;
use nalgebra::Matrix6;

/// Forces at a node of time.
pub(super) struct Forces {
    /// Generalised force of fibres and contact [N mm, N].
    pub(super) elastic: Six,
    /// Of friction.
    pub(super) friction: Six,
    /// Energy in the fibres [N mm].
    pub(super) strain: f64,
    /// Energy in the contact and in bodies in between [N mm].
    pub(super) contact: f64,
    /// Dashpots of fibres and contact.
    pub(super) damping: Matrix6<f64>,
    /// Stiffness along fibres, contact normals and sticking patches: what limits the increment.
    pub(super) stiffness: Matrix6<f64>,
    /// Tangential forces held from here on.
    pub(super) held: FrictionState,
}

/// Forces where `state` stands; with contact where its lists are given.
pub(super) fn at(
    model: &Model,
    pose: &Pose,
    mut near: Option<&mut Nearby>,
    options: &ExplicitOptions,
    state: &ExplicitState,
) -> Forces {
    let mut out = Forces {
        elastic: Six::zeros(),
        friction: Six::zeros(),
        strain: 0.0,
        contact: 0.0,
        damping: Matrix6::zeros(),
        stiffness: Matrix6::zeros(),
        held: FrictionState::default(),
    };
    let states = match &mut near {
        Some(near) => model.fibre_states_near(pose, near),
        None => model.fibre_states(pose),
    };
    for (fibre, state) in model.fibres.iter().zip(states) {
        if model.is_removed(fibre.bundle) {
            continue;
        }
        let (g, r) = (state.line.gradient, state.response);
        out.elastic -= g * r.force;
        out.strain += r.energy;
        add_outer(&mut out.damping, &g, model.bundles[fibre.bundle].damping);
        add_outer(&mut out.stiffness, &g, r.stiffness);
    }
    if let Some(near) = near {
        for body in model.bodies_near((&state.q, pose), near) {
            out.contact += body.energy;
            out.elastic -= body.gradient;
            out.stiffness += body.hessian;
        }
        add_contact(model, (pose, near), options, state, &mut out);
    }
    out
}

/// Adds what the cartilages do.
fn add_contact(
    model: &Model,
    (pose, near): (&Pose, &mut Nearby),
    options: &ExplicitOptions,
    state: &ExplicitState,
    out: &mut Forces,
) {
    let press = model.contact.press_near(pose, near);
    out.contact += press.energy;
    out.elastic += Six::from_fn(|j, _| {
        let s = &pose.screws[j];
        s.linear.dot(&press.force) + s.angular.dot(&press.moment)
    });
    let mass = model.femur_mass.0 * options.mass_scale;
    for spot in &press.spots {
        let n: Vector = spot.normal();
        let lever = Six::from_fn(|j, _| n.dot(&pose.screws[j].at(&spot.centre)));
        add_outer(&mut out.stiffness, &lever, spot.stiffness);
        // a fraction of the critical dashpot of the femur's mass on the patch
        add_outer(&mut out.damping, &lever, 2.0 * model.contact.damping * (spot.stiffness * mass).sqrt());
    }
    let patches = model.contact.patches_of(&press.spots, &pose.screws, &state.friction, options.slip_mm);
    let mut against = Six::zeros();
    patches.add(&state.last_step, &mut 0.0, &mut against, &mut out.stiffness);
    out.friction = -against;
    out.held = patches.after(&state.last_step);
}

/// Adds `factor g g'`.
fn add_outer(matrix: &mut Matrix6<f64>, g: &Six, factor: f64) {
    if factor != 0.0 {
        matrix.ger(factor, g, g, 1.0);
    }
}

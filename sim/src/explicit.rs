//! Explicit dynamics: the femur, a rigid body with isotropic inertia, driven along the chain's coordinates by central differences.
//!
//! Velocities stand at half increments [belytschko2014]. The momentum of the body about its centre is carried in space, so that a free body
//! keeps it exactly; `p+ - p- = dt W` is solved for the chain's velocities with the velocity fields at the middle of the increment, so
//! that prescribed coordinates need no constraint equations and their reactions come out. Forces of position are explicit. Dashpots are
//! exponentially fitted: central for light ones, backward for heavy ones, so that 100 N s/mm on 1e-5 t does not limit the increment.
//! Friction is the quasi-static solver's: patches that stick elastically and slide at the Coulomb limit.

mod energy;
mod forces;
mod increment;
pub(crate) mod options;
pub mod program;
pub mod protocol;
mod state;
pub mod trial;
mod twist;

pub use energy::Energies;
pub use options::{ExplicitOptions, Increments};
pub use program::{Course, Drive, Program, Step};
pub use protocol::{explicit_protocol, explicit_rows};
pub use state::ExplicitState;
pub use trial::{TrialSteps, deck_program, explicit_trial};

use crate::contact::Nearby;
use crate::coordinate::Six;
use crate::error::SimError;
use crate::joint::Pose;
use crate::model::{FibreState, Model};
use increment::Stepper;
use std::ops::ControlFlow;

/// What an observer sees after each increment.
#[derive(Debug)]
pub struct Progress<'a> {
    /// The step's name.
    pub step: &'a str,
    /// Time over the time of the whole program [-].
    pub fraction: f64,
    /// Length of the increment just done [s].
    pub increment_s: f64,
    /// Reaction of prescribed coordinates, load on the others [N mm, N].
    pub drive: Six,
    /// Where the model stands.
    pub state: &'a ExplicitState,
}

/// Is called after every increment and may stop the run.
pub type Observer<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// A pose as results give it.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Grood-Suntay coordinates [rad, mm].
    pub grood_suntay: Six,
    /// Where the femur is.
    pub pose: Pose,
    /// Every fibre; slack where cut or failed.
    pub fibres: Vec<FibreState>,
    /// Force of each bundle [N].
    pub bundle_forces: Vec<f64>,
}

/// Runs `program` from `state` to its end; a state of an interrupted run goes on where it stopped, to the same bytes.
///
/// Errors: an option or drive out of range, an increment that cannot be stable, a motion that blows up (increment, time and energies are
/// named), more increments than the options allow, an observer's wish to stop (`state` can be run on).
pub fn run(
    model: &Model,
    program: &Program,
    options: &ExplicitOptions,
    state: &mut ExplicitState,
    observer: &mut Observer,
) -> Result<(), SimError> {
    options.check()?;
    program.check(options)?;
    let total: f64 = program.steps.iter().map(|s| s.duration_s).sum();
    let mut near = Nearby::default();
    let most = state.increments.saturating_add(options.most_increments);
    while let Some(step) = program.steps.get(state.step) {
        let earlier = &program.steps[..state.step];
        let cut = failed(model, &program.steps[..=state.step])?;
        let contact = earlier.last().map_or(step.contact, |s| s.contact);
        state.begin((&failed(model, earlier)?, contact), (&cut, step.contact));
        let stepper = Stepper::new(&cut, step, options);
        let before: f64 = earlier.iter().map(|s| s.duration_s).sum();
        while state.time_s < step.duration_s {
            crate::interrupt::check();
            if state.increments >= most {
                return Err(SimError::Solver(format!(
                    "stopped after {} increments, at {:.4} of {:.4} s of step {}; allow more by explicit.most_increments, or raise explicit.mass_scale",
                    options.most_increments, state.time_s, step.duration_s, step.name
                )));
            }
            let done = stepper.advance(state, &mut near)?;
            let (increment_s, drive) = (done.increment_s, done.drive);
            let fraction = (before + state.time_s) / total;
            let progress = Progress { step: &step.name, fraction, increment_s, drive, state };
            if observer(&progress).is_break() {
                return Err(SimError::Cancelled { time: before + state.time_s });
            }
        }
        stepper.close(state, &mut near)?;
        state.end();
    }
    Ok(())
}

/// The model with every bundle cut that has failed by the last of `steps`.
pub(crate) fn failed(model: &Model, steps: &[Step]) -> Result<Model, SimError> {
    let names: Vec<String> = steps.iter().flat_map(|s| s.fail.iter().cloned()).collect();
    if names.is_empty() { Ok(model.clone()) } else { model.without(&names) }
}

/// The pose and forces of a state; `program` tells which bundles have failed by then.
///
/// Errors: a program that names bundles the model does not have.
pub fn snapshot(model: &Model, program: &Program, state: &ExplicitState) -> Result<Snapshot, SimError> {
    let reached = (state.step + 1).min(program.steps.len());
    let cut = failed(model, &program.steps[..reached])?;
    let pose = cut.joint.pose(&state.q);
    let fibres = cut.fibre_states(&pose);
    let bundle_forces = cut.bundle_forces(&fibres);
    Ok(Snapshot { grood_suntay: cut.joint.grood_suntay_of(&pose.femur), pose, fibres, bundle_forces })
}

/// An observer that lets a run go on to its end.
pub fn unobserved(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

//! The validation protocols [andreassen2025, section 2.6] by explicit dynamics.

use super::options::ExplicitOptions;
use super::program::{Course, Drive, Step};
use super::state::ExplicitState;
use super::trial::{REST, TrialSteps, result, run_to_rest};
use super::unobserved;
use crate::coordinate::{FE, FREE, Load, Six};
use crate::deck::Curve;
use crate::error::SimError;
use crate::laxity::TrialResult;
use crate::model::Model;
use crate::protocols::{Leg, Protocol, ProtocolOptions, paths, with_lost};
use crate::trials::{TrialOptions, chain_flexion};
use rayon::prelude::*;

/// Runs a protocol to rest at each of its rows, which are those of [`crate::protocols::run`]. Where the motion of a path is lost, its rows from there on
/// have no answer; beside the rows stands why the first has none.
///
/// Errors: as [`run`], with the row's name.
pub fn explicit_protocol(
    model: &Model,
    protocol: Protocol,
    numbers: &ProtocolOptions,
    steps: &TrialSteps,
    options: &ExplicitOptions,
) -> Result<(Vec<TrialResult>, Option<SimError>), SimError> {
    let rows = explicit_rows(model, protocol, numbers, steps, options)?;
    let paths = paths(model, protocol, numbers)?;
    with_lost(rows, paths.iter().flatten().map(|leg| &leg.trial), model.bundle_names().len())
}

/// The same row by row: where a path is lost or stopped, its rows from there on say why, and other paths stand.
///
/// Errors: options out of range.
pub fn explicit_rows(
    model: &Model,
    protocol: Protocol,
    numbers: &ProtocolOptions,
    steps: &TrialSteps,
    options: &ExplicitOptions,
) -> Result<Vec<Result<TrialResult, SimError>>, SimError> {
    options.check()?;
    let paths = paths(model, protocol, numbers)?;
    let trials = numbers.of(protocol);
    let each = paths.par_iter().map(|legs| {
        let (mut rows, mut lost) = (Vec::with_capacity(legs.len()), None);
        if let Err(e) = follow(model, legs, (numbers, &trials), (steps, options), &mut rows) {
            lost = Some(e);
        }
        let mut rows: Vec<Result<TrialResult, SimError>> = rows.into_iter().map(Ok).collect();
        let left = legs.len().saturating_sub(rows.len());
        rows.extend(lost.iter().flat_map(|e| vec![Err(e.clone()); left]));
        rows
    });
    Ok(each.collect::<Vec<_>>().concat())
}

/// One path: the paper's settling, then its legs. Rows that are at rest stand in `rows`, whatever becomes of the next.
fn follow(
    model: &Model,
    legs: &[Leg],
    (numbers, trials): (&ProtocolOptions, &TrialOptions),
    (steps, options): (&TrialSteps, &ExplicitOptions),
    rows: &mut Vec<TrialResult>,
) -> Result<(), SimError> {
    let mut state = ExplicitState::at_rest();
    let mut load = Load::compression(numbers.compression_n).generalised();
    for (n, leg) in legs.iter().enumerate() {
        let trial = &leg.trial;
        let next = trial.load.generalised();
        let mut program = steps.program(&model.joint, trial.fe_deg, &next)?;
        if let Some((seconds, _)) = leg.going {
            let flexion = chain_flexion(model, trial.fe_deg, &numbers.trials)?;
            // the first leg follows the settling, which holds the CT pose
            program.steps[1] = ramp(steps, flexion - state.q[FE], [&load, &next], seconds);
        }
        if n > 0 {
            program.steps.remove(0);
        }
        state = state.restarted();
        run_to_rest((model, &program), (steps, &next), options, &mut state, &mut unobserved)
            .map_err(|e| e.of_trial(&trial.trial))?;
        rows.push(result(model, trial, &state, trials));
        load = next;
    }
    Ok(())
}

/// Flexion and loads go straight to where they shall be within `seconds` and stay.
fn ramp(steps: &TrialSteps, turn: f64, [from, to]: [&Six; 2], seconds: f64) -> Step {
    let mut step = steps.step("ramp", seconds + REST, steps.load_damping);
    let straight = Curve::Linear { smooth: 0.0 };
    step.drive[FE.index()] = Drive::Motion(Course::ramp([0.0, turn], [0.0, seconds], straight));
    for c in FREE {
        step.drive[c.index()] = Drive::Load(Course::ramp([from[c], to[c]], [0.0, seconds], steps.curve()));
    }
    step
}

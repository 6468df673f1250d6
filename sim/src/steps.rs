//! Programs of steps, such as a deck's own, by the quasi-static solver: the load history that explicit dynamics run, without inertia.

use crate::contact::{FrictionState, Nearby};
use crate::coordinate::{AP, Coordinate, FE, FREE, IE, ML, SI, Six, VV};
use crate::error::SimError;
use crate::explicit::{Drive, ExplicitOptions, Program, Step, failed};
use crate::model::Model;
use crate::quasistatic::{Dashpots, Goal, SolverOptions, State, increment_near};
use serde::{Deserialize, Serialize};

/// How finely steps are followed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StepOptions {
    /// First increment of a step [s]: what the step changes at once relaxes from there on.
    pub first_increment_s: f64,
    /// Each increment over the one before, at most [-].
    pub growth: f64,
    /// Longest increment [s].
    pub longest_increment_s: f64,
    /// The solver's.
    pub solver: SolverOptions,
}

impl Default for StepOptions {
    fn default() -> Self {
        let solver = SolverOptions { step_on_the_way_mm: 1e-5, ..SolverOptions::default() };
        StepOptions { first_increment_s: 1e-5, growth: 1.1, longest_increment_s: 2e-3, solver }
    }
}

/// Follows `program` from the CT pose to the equilibrium at its end. A step drives flexion by a motion and the other coordinates by loads, or all
/// six by motions.
///
/// Errors: steps of another kind, drives or options out of range, a solver that finds no equilibrium; each names the step.
pub fn follow_program(model: &Model, program: &Program, options: &StepOptions) -> Result<State, SimError> {
    options.solver.check()?;
    program.check(&ExplicitOptions::default())?;
    let times = [options.first_increment_s, options.longest_increment_s];
    if !(times.iter().all(|t| (1e-9..=1.0).contains(t)) && (1.0..=1e3).contains(&options.growth)) {
        return Err(SimError::Input(format!("steps: increments of {times:?} s, growing by {}", options.growth)));
    }
    let (mut state, mut near) = (State::default(), Nearby::default());
    for (n, step) in program.steps.iter().enumerate() {
        let cut = failed(model, &program.steps[..=n])?;
        let kind = Kind::of(step)?;
        let start = state.q;
        let (mut time, mut size) = (0.0, options.first_increment_s);
        while time < step.duration_s * (1.0 - 1e-12) {
            let next = if time + 1.01 * size > step.duration_s { step.duration_s } else { time + size };
            match advance(&cut, (step, kind), (&state, &start), [time, next], &options.solver, &mut near) {
                Ok(found) => {
                    (state, time) = (found, next);
                    size = (options.growth * size).min(options.longest_increment_s);
                }
                Err(error) if size <= options.first_increment_s => return Err(named(step, error)),
                Err(_) => size = (0.25 * size).max(options.first_increment_s),
            }
        }
        if n + 1 == program.steps.len() && matches!(kind, Kind::Loaded(_)) {
            let goal = Goal { flexion: state.q[FE], load: drives(step, step.duration_s), flow: None };
            let solved = increment_near(&cut, &state, &goal, &options.solver, true, &mut near);
            state = solved.map_err(|e| named(step, e))?.state;
        }
    }
    Ok(state)
}

fn named(step: &Step, error: SimError) -> SimError {
    match error {
        SimError::Solver(m) => SimError::Solver(format!("step {}: {m}", step.name)),
        other => other,
    }
}

/// What is imposed in a step.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// All six coordinates.
    Held,
    /// Flexion and loads, against these dashpots.
    Loaded(Dashpots),
}

impl Kind {
    fn of(step: &Step) -> Result<Kind, SimError> {
        let moved = |c: Coordinate| matches!(step.drive[c.index()], Drive::Motion(_));
        let fault = |m: &str| Err(SimError::Input(format!("step {}: {m}", step.name)));
        if FREE.iter().all(|&c| moved(c)) && moved(FE) {
            return Ok(Kind::Held);
        }
        if !moved(FE) || FREE.iter().any(|&c| moved(c)) {
            return fault("the quasi-static solver moves all coordinates, or flexion alone");
        }
        if !step.contact {
            return fault("loads without contact have no equilibrium");
        }
        let d = &step.damping;
        if [VV, IE].iter().any(|&c| d[c] != d[VV]) || [ML, AP, SI].iter().any(|&c| d[c] != d[ML]) {
            return fault("dashpots that differ among translations or among rotations are not followed");
        }
        Ok(Kind::Loaded(Dashpots { fibres: true, translation: d[ML], rotation: d[VV] }))
    }
}

/// Loads and motions at a time of the step.
fn drives(step: &Step, time: f64) -> Six {
    Six::from_fn(|c, _| match &step.drive[c] {
        Drive::Load(course) | Drive::Motion(course) => course.at(time),
    })
}

/// One increment, from a time to another; motions count from `start`.
fn advance(
    model: &Model,
    (step, kind): (&Step, Kind),
    (from, start): (&State, &Six),
    [time, next]: [f64; 2],
    options: &SolverOptions,
    near: &mut Nearby,
) -> Result<State, SimError> {
    let imposed = drives(step, next);
    match kind {
        Kind::Held => {
            let mut state = State::at(start + imposed);
            if step.contact {
                let pose = model.joint.pose(&from.q);
                let patches = model.contact.patches(&pose, &from.friction, options.slip_mm, near);
                state.friction = patches.after(&(state.q - from.q));
            } else {
                state.friction = FrictionState::default();
            }
            Ok(state)
        }
        Kind::Loaded(dashpots) => {
            let goal = Goal { flexion: start[FE] + imposed[FE], load: imposed, flow: Some((next - time, dashpots)) };
            Ok(increment_near(model, from, &goal, options, false, near)?.state)
        }
    }
}

//! A calibration from beginning to end: a recipe as a state that advances a step at a time, is saved between steps, and goes on
//! from where it was saved to the same bytes.

use crate::cost::{FAILED, rms};
use crate::design::Design;
use crate::error::CalibrationError;
use crate::next_test::NextTest;
use crate::options::{CalibrateOptions, Method};
use crate::posterior::{self, ForceEstimate, NoiseEstimate, OtherEstimate, ParameterEstimate, RestEstimate};
use crate::problem::{Probes, Problem};
use crate::recipe::Recipe;
use crate::targets::row;
use inference::weights::Weighed;
use notices::Notice;
use serde::{Deserialize, Serialize};
use sim::coordinate::Free;
use sim::laxity::LaxityTrial;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// Everything that decides the answer of a calibration; a checkpoint of another one is refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Digest of the model.
    pub model: String,
    /// The design variables and their ranges.
    pub design: Design,
    /// Where it starts [- or N/mm].
    pub start: Vec<f64>,
    /// The targets.
    pub trials: Vec<LaxityTrial>,
    /// The options.
    pub options: CalibrateOptions,
}

/// A calibration between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    identity: Identity,
    state: State,
}

/// A method between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum State {
    Recipe(Recipe),
    /// All at once: nothing is kept between.
    Inference,
}

/// How far a calibration has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What it is doing.
    pub phase: &'static str,
    /// Share of the work done, 0 to 1, by count of fits or evaluations.
    pub share: f64,
    /// Evaluations of all trials so far.
    pub evaluations: usize,
    /// The lowest cost so far; infinite before the first.
    pub lowest_cost: f64,
}

/// What a calibration found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibrated {
    /// How.
    pub method: Method,
    /// The design values chosen, in the order of the design.
    pub values: Vec<f64>,
    /// Their cost.
    pub cost: f64,
    /// The lowest cost met on the way, and where; differs from the above where the most probable values were chosen.
    pub lowest_cost: (f64, Vec<f64>),
    /// Every design variable with its interval.
    pub parameters: Vec<ParameterEstimate>,
    /// What else was inferred: frames, contact.
    pub others: Vec<OtherEstimate>,
    /// Bundle forces in the probe trials, with their intervals.
    pub forces: Vec<ForceEstimate>,
    /// Tension of all ligaments at rest.
    pub rest: Vec<RestEstimate>,
    /// Tests that would narrow the forces most, the best first.
    #[serde(default)]
    pub next_tests: Vec<NextTest>,
    /// Noise of each data set and coordinate, as stated and as inferred.
    pub noise: Vec<NoiseEstimate>,
    /// Standard deviation that the best fit misses by, over the noise stated, a coordinate each (VV, IE, ML, AP, SI) [-]; 1 where it fits.
    pub noise_scale: Free<f64>,
    /// Root mean square of predicted minus measured, a coordinate each [deg or mm]; `None` where nothing was measured.
    pub rms: Free<Option<f64>>,
    /// Predictions at the chosen values, a trial each [deg, mm].
    pub predicted: Vec<Option<Free<f64>>>,
    /// Trials whose path of loading ends in another equilibrium than the one the search found, far from what was measured; `rms` is without them.
    #[serde(default)]
    pub elsewhere: Vec<usize>,
    /// Values found from different starts, with their cost, lowest first: what one start alone would have reported.
    pub rivals: Vec<(f64, Vec<f64>)>,
    /// Samples of the posterior, design values.
    pub samples: Vec<Vec<f64>>,
    /// The same samples with every unknown; empty where a recipe was followed.
    #[serde(default)]
    pub unknowns: crate::unknown::Unknowns,
    /// What the importance weights of the samples say of them; `None` where a recipe was followed, and of too few samples.
    #[serde(default)]
    pub weighed: Option<Weighed>,
    /// Evaluations spent.
    pub evaluations: usize,
    /// What the method lowers, in order: the cost of every evaluation, or half the sum of squares that each start left.
    pub history: Vec<f64>,
    /// The most probable value of every parameter, by its name; empty where a recipe was followed.
    #[serde(default)]
    pub mode: BTreeMap<String, f64>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
}

impl Checkpoint {
    /// The beginning of a calibration.
    ///
    /// # Errors
    /// Options out of range.
    pub fn new(identity: Identity) -> Result<Checkpoint, CalibrationError> {
        let o = &identity.options;
        o.check()?;
        let start = identity.design.unit(&identity.start);
        let state = match o.method {
            Method::SwarmSimplex => State::Recipe(Recipe::new(&start, &o.swarm, o.seed)),
            Method::Posterior => State::Inference,
        };
        Ok(Checkpoint { identity, state })
    }

    /// A checkpoint as bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        // writing to memory cannot fail
        let _ = ciborium::into_writer(self, &mut bytes);
        bytes
    }

    /// The checkpoint in `bytes`, if it is one of this calibration.
    ///
    /// # Errors
    /// Not a checkpoint, or one of other data, options or model: which.
    pub fn from_bytes(bytes: &[u8], identity: &Identity) -> Result<Checkpoint, CalibrationError> {
        let refuse = |what: &str| {
            Err(CalibrationError::Checkpoint(format!("{what}; remove it to begin anew, or give another folder")))
        };
        let Ok(kept) = ciborium::from_reader::<Checkpoint, _>(bytes) else {
            return refuse("not readable, or written by another version of the program");
        };
        let theirs = &kept.identity;
        for (same, what) in [
            (theirs.model == identity.model, "model"),
            (theirs.trials == identity.trials, "targets"),
            (theirs.design == identity.design && theirs.start == identity.start, "ranges or start"),
            (theirs.options == identity.options, "options"),
        ] {
            if !same {
                return refuse(&format!("it belongs to a calibration with other {what}"));
            }
        }
        Ok(kept)
    }

    /// True when there is nothing left to do.
    pub fn is_finished(&self) -> bool {
        match &self.state {
            State::Recipe(r) => r.is_finished(),
            State::Inference => true,
        }
    }

    /// How far it has come.
    pub fn progress(&self) -> Progress {
        let o = &self.identity.options;
        match &self.state {
            State::Recipe(r) => Progress {
                phase: if r.history.len() == r.swarm_evaluations { "swarm" } else { "simplex" },
                share: share(r.history.len(), o.swarm.swarm_evaluations + o.swarm.simplex_evaluations),
                evaluations: r.history.len(),
                lowest_cost: r.best().map_or(f64::INFINITY, |b| b.0),
            },
            State::Inference => Progress { phase: "fits", share: 0.0, evaluations: 0, lowest_cost: f64::INFINITY },
        }
    }

    /// One step: a generation, an iteration, a chunk of fits.
    ///
    /// # Errors
    /// No start has an answer.
    pub fn advance(&mut self, problem: &Problem) -> Result<(), CalibrationError> {
        let o = &self.identity.options;
        match &mut self.state {
            State::Recipe(r) => {
                r.advance(problem, &o.swarm);
                match r.best() {
                    Some((cost, _)) if cost >= FAILED => Err(no_answer(problem, &self.identity.start)),
                    _ => Ok(()),
                }
            }
            State::Inference => Ok(()),
        }
    }
}

fn share(done: usize, of: usize) -> f64 {
    (done as f64 / of.max(1) as f64).min(1.0)
}

/// Why no point has an answer, in the solver's words at the start.
fn no_answer(problem: &Problem, start: &[f64]) -> CalibrationError {
    let answers = problem.experiment.answers(start, false);
    let first = answers.iter().enumerate().find_map(|(i, a)| a.as_ref().err().map(|e| (i, e.to_string())));
    let why = first.map_or("some trial has no answer at every point tried".to_owned(), |(i, e)| {
        let target = &problem.targets.trials[i];
        format!("row {} ({}): {e}", row(target), target.trial)
    });
    CalibrationError::Model(format!("no point has an answer to every trial: {why}"))
}

/// Runs a calibration to its end from wherever it is. `watch` sees it between steps and may stop it.
///
/// # Errors
/// No start has an answer; stopped by `watch`.
pub fn calibrate(
    checkpoint: &mut Checkpoint,
    problem: &Problem,
    probes: &Probes,
    watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>,
) -> Result<Calibrated, CalibrationError> {
    while !checkpoint.is_finished() {
        checkpoint.advance(problem)?;
        if watch(checkpoint).is_break() {
            return Err(CalibrationError::Stopped);
        }
    }
    finish(checkpoint, problem, probes)
}

/// The answer of a finished calibration.
fn finish(checkpoint: &Checkpoint, problem: &Problem, probes: &Probes) -> Result<Calibrated, CalibrationError> {
    let o = &checkpoint.identity.options;
    let design = problem.experiment.design;
    let none = || no_answer(problem, &checkpoint.identity.start);
    let (lowest, rivals) = match &checkpoint.state {
        State::Recipe(r) => (r.best().ok_or_else(none)?, r.rivals()),
        State::Inference => return Err(CalibrationError::Option("method: posterior is no recipe".into())),
    };
    let found = posterior::of_recipe(problem, &lowest.1, rivals, &o.gradient, o.seed)?;
    let lowest = judged(problem, lowest);
    let point = lowest.1.clone();
    let values = design.at(&point);
    let predicted = problem.in_full.predictions(&values);
    let history = match &checkpoint.state {
        State::Recipe(r) => r.history.clone(),
        State::Inference => vec![],
    };
    Ok(Calibrated {
        mode: BTreeMap::new(),
        method: o.method,
        cost: problem.cost.cost(&predicted).value,
        lowest_cost: (lowest.0, design.at(&lowest.1)),
        parameters: posterior::parameters(design, &point, &found, o.gradient.interval),
        forces: posterior::forces(probes, design, &point, &found, o.gradient.interval),
        others: vec![],
        rest: vec![],
        next_tests: vec![],
        noise: vec![],
        noise_scale: found.noise_scale,
        rms: rms(&problem.targets.trials, &predicted, &[]),
        elsewhere: vec![],
        predicted,
        rivals: found.rivals.iter().map(|(c, p)| (*c, design.at(p))).collect(),
        samples: found.samples.iter().map(|p| design.at(p)).collect(),
        unknowns: Default::default(),
        weighed: None,
        evaluations: history.len(),
        history,
        warnings: found.warnings,
        values,
    })
}

/// The lowest cost as the model in full has it, and where.
fn judged(problem: &Problem, lowest: (f64, Vec<f64>)) -> (f64, Vec<f64>) {
    let values = problem.experiment.design.at(&lowest.1);
    (problem.cost.cost(&problem.in_full.predictions(&values)).value, lowest.1)
}

#[cfg(test)]
mod tests;

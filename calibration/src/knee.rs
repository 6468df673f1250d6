//! The solver as an experiment sees it: answers to trials at design values, with their derivatives.
//!
//! A search asks for thousands of answers, so it asks a model with fewer contact nodes along a path of fewer increments; what is reported in
//! the end comes from the model and path of `simulate`. How far the two differ: docs/stages/calibrate.md.
//!
//! A recipe's design variables are the model's own numbers, so their derivatives are that part of [`inference::jacobian`]'s. A recipe knows no frames, no
//! apparatus and no bearing surface: its Jacobian has no other columns.

use crate::design::{Design, Kind};
use crate::experiment::{Answer, Jacobian};
use inference::knee::by_the_model;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::SimError;
use sim::contact::ContactOptions;
use sim::coordinate::Free;
use sim::flags::Flag;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::model::{BundleParameters, Model, compile_with};
use sim::quasistatic::SolverOptions;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::collections::BTreeMap;

/// How answers are sought during a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SearchOptions {
    /// Contact nodes nearer to each other than this are merged [mm]; ours.
    pub contact_spacing_mm: f64,
    /// Increments of settling, loading, holding [-]; ours.
    pub increments: [usize; 3],
    /// Newton steps below this end an increment on the way [mm]; ours.
    pub step_on_the_way_mm: f64,
    /// The same at the end of the path [mm]; ours.
    pub step_at_the_end_mm: f64,
}

impl Default for SearchOptions {
    fn default() -> Self {
        SearchOptions {
            contact_spacing_mm: 2.2,
            increments: [1, 4, 1],
            step_on_the_way_mm: 0.1,
            step_at_the_end_mm: 1e-4,
        }
    }
}

impl SearchOptions {
    pub(crate) fn trials(&self) -> TrialOptions {
        let solver = SolverOptions {
            step_on_the_way_mm: self.step_on_the_way_mm,
            departure_mm: 100.0,
            step_at_the_end_mm: self.step_at_the_end_mm,
            ..SolverOptions::default()
        };
        TrialOptions { increments: self.increments, solver, ..TrialOptions::default() }
    }
}

/// A compiled model with its specification, for the search and for what is reported.
#[derive(Clone, Debug)]
pub struct Knee {
    /// The specification.
    pub spec: ModelSpec,
    /// The model as `simulate` has it.
    pub model: Model,
    /// Its path.
    pub options: TrialOptions,
    search: Model,
    search_options: TrialOptions,
}

impl Knee {
    /// Compiles a specification.
    ///
    /// # Errors
    /// As [`sim::compile`]; options out of range.
    pub fn new(
        spec: ModelSpec,
        meshes: &BTreeMap<String, MeshValue>,
        search: &SearchOptions,
    ) -> Result<Knee, SimError> {
        let model = sim::compile(&spec, meshes)?;
        let coarse = ContactOptions { spacing_mm: search.contact_spacing_mm };
        let (options, search_options) = (TrialOptions::default(), search.trials());
        search_options.check()?;
        Ok(Knee { search: compile_with(&spec, meshes, &coarse)?, spec, model, options, search_options })
    }

    /// The model that the search asks.
    pub fn search_model(&self) -> &Model {
        &self.search
    }

    /// The path of the search.
    pub fn search_options(&self) -> &TrialOptions {
        &self.search_options
    }

    /// Answers to trials, as fast as the search needs them.
    pub fn searching<'a>(
        &'a self,
        design: &'a Design,
        trials: &'a [LaxityTrial],
    ) -> impl Fn(&[f64], bool) -> Vec<Result<Answer, SimError>> + Sync + 'a {
        let questions = Questions { model: &self.search, options: &self.search_options, design, trials };
        move |values, jacobian| questions.answers(values, jacobian)
    }

    /// Answers to trials, as `simulate` gives them.
    pub fn simulating<'a>(
        &'a self,
        design: &'a Design,
        trials: &'a [LaxityTrial],
    ) -> impl Fn(&[f64], bool) -> Vec<Result<Answer, SimError>> + Sync + 'a {
        let questions = Questions { model: &self.model, options: &self.options, design, trials };
        move |values, jacobian| questions.answers(values, jacobian)
    }
}

/// The model at design values.
///
/// # Errors
/// A value out of range.
pub fn model_at(model: &Model, design: &Design, values: &[f64]) -> Result<Model, SimError> {
    let mut parameters: Vec<BundleParameters> = model.parameters();
    for (v, &x) in design.variables.iter().zip(values) {
        for (p, _) in parameters.iter_mut().zip(&model.bundles).filter(|(_, b)| v.bundles.contains(&b.name)) {
            match v.kind {
                Kind::ReferenceStrain => p.reference_strain = x,
                Kind::StiffnessNPerMm => p.stiffness_n_per_mm = x,
            }
        }
    }
    model.with_parameters(&parameters)
}

/// What is asked of a solver.
struct Questions<'a> {
    model: &'a Model,
    options: &'a TrialOptions,
    design: &'a Design,
    trials: &'a [LaxityTrial],
}

impl Questions<'_> {
    /// Answers at design values, in order; displacements where a trial's readings are.
    fn answers(&self, values: &[f64], jacobian: bool) -> Vec<Result<Answer, SimError>> {
        let unloaded: Vec<LaxityTrial> = self.trials.iter().filter_map(LaxityTrial::unloaded).collect();
        let here = self.poses(values, jacobian);
        if unloaded.is_empty() {
            return here;
        }
        let mut there = Questions { trials: &unloaded, ..*self }.poses(values, jacobian).into_iter();
        let displaced = |(t, a): (&LaxityTrial, Result<Answer, SimError>)| match t.reference {
            Some(_) => match there.next() {
                Some(zero) => Ok(from(a?, &zero?)),
                None => a,
            },
            None => a,
        };
        self.trials.iter().zip(here).map(displaced).collect()
    }

    /// Poses at design values, in order; trials in parallel, after what those of one compression share.
    fn poses(&self, values: &[f64], jacobian: bool) -> Vec<Result<Answer, SimError>> {
        let model = match model_at(self.model, self.design, values) {
            Ok(found) => found,
            Err(e) => return self.trials.iter().map(|_| Err(e.clone())).collect(),
        };
        let found = solve_trials(&model, self.trials, self.options);
        let answer = |(trial, found): (&LaxityTrial, Result<sim::trials::Answer, SimError>)| {
            let found = found?;
            let jacobian = if jacobian { Some(self.jacobian(&*model.in_trial(trial)?, &found, values)?) } else { None };
            Ok(Answer { predicted: found.predicted(), forces_n: found.forces_n, flags: found.flags, jacobian })
        };
        self.trials.par_iter().zip(found).map(answer).collect()
    }

    /// Derivatives by design variables.
    fn jacobian(&self, model: &Model, found: &sim::trials::Answer, values: &[f64]) -> Result<Jacobian, SimError> {
        let names = model.bundle_names();
        let at = self.design.variables.iter().zip(values).map(|(v, x)| (v.quantity(&names), *x));
        let (predicted, forces_n) = by_the_model(model, found, at)?.into_iter().unzip();
        Ok(Jacobian { predicted, forces_n })
    }
}

/// A trial's answer with its pose counted from another's; forces stay the trial's own.
fn from(answer: Answer, zero: &Answer) -> Answer {
    let less = |a: Free<f64>, b: &Free<f64>| Free::from_fn(|c| a[c] - b[c]);
    let jacobian = answer.jacobian.zip(zero.jacobian.as_ref()).map(|(s, z)| Jacobian {
        predicted: s.predicted.into_iter().zip(&z.predicted).map(|(a, b)| less(a, b)).collect(),
        ..s
    });
    let mut flags = answer.flags;
    flags.extend(zero.flags.iter().map(|f| Flag::Unloaded(Box::new(f.clone()))));
    Answer { predicted: less(answer.predicted, &zero.predicted), jacobian, flags, ..answer }
}

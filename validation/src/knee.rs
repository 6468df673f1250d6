//! The solver as an experiment sees it: answers to trials at design values, with their derivatives.
//!
//! A search asks for thousands of answers, so it asks a model with fewer contact nodes along a path of fewer increments; what is reported in
//! the end comes from the model and path of `simulate`. How far the two differ: docs/stages/calibrate.md.

use crate::design::{Design, Kind};
use crate::experiment::{Answer, Slopes};
use serde::{Deserialize, Serialize};
use sim::SimError;
use sim::abaqus::MeshValue;
use sim::contact::ContactOptions;
use sim::laxity::LaxityTrial;
use sim::model::{BundleParameters, Model, compile_with};
use sim::quasistatic::SolverOptions;
use sim::sensitivity::{Parameter, sensitivities};
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trial};
use std::collections::BTreeMap;

/// How answers are sought during a search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SearchOptions {
    /// Contact nodes nearer to each other than this are merged [mm]; ours.
    pub contact_spacing_mm: f64,
    /// Increments of settling, loading, holding [-]; ours.
    pub increments: [usize; 3],
    /// Newton steps below this end an increment on the way [mm]; ours.
    pub step_on_the_way_mm: f64,
    /// The same at the end of the path; ours.
    pub step_at_the_end_mm: f64,
}

impl Default for SearchOptions {
    fn default() -> Self {
        SearchOptions {
            contact_spacing_mm: 2.0,
            increments: [1, 4, 1],
            step_on_the_way_mm: 0.1,
            step_at_the_end_mm: 1e-4,
        }
    }
}

impl SearchOptions {
    fn trials(&self) -> TrialOptions {
        let solver = SolverOptions {
            step_on_the_way_mm: self.step_on_the_way_mm,
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

    /// Answers to trials by their index, as fast as the search needs them.
    pub fn searching<'a>(
        &'a self,
        design: &'a Design,
        trials: &'a [LaxityTrial],
    ) -> impl Fn(&[f64], usize, bool) -> Result<Answer, SimError> + Sync + 'a {
        move |values, i, slopes| answer(&self.search, &self.search_options, (design, values), trial(trials, i)?, slopes)
    }

    /// Answers to trials by their index, as `simulate` gives them.
    pub fn simulating<'a>(
        &'a self,
        design: &'a Design,
        trials: &'a [LaxityTrial],
    ) -> impl Fn(&[f64], usize, bool) -> Result<Answer, SimError> + Sync + 'a {
        move |values, i, slopes| answer(&self.model, &self.options, (design, values), trial(trials, i)?, slopes)
    }
}

fn trial(trials: &[LaxityTrial], i: usize) -> Result<&LaxityTrial, SimError> {
    trials.get(i).ok_or_else(|| SimError::Input(format!("no trial {i} of {}", trials.len())))
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

fn answer(
    model: &Model,
    options: &TrialOptions,
    (design, values): (&Design, &[f64]),
    trial: &LaxityTrial,
    slopes: bool,
) -> Result<Answer, SimError> {
    let model = model_at(model, design, values)?;
    let found = solve_trial(&model, trial, options)?;
    let slopes = if slopes { Some(slopes_of(&model, design, &found)?) } else { None };
    Ok(Answer { predicted: found.predicted(), forces_n: found.forces_n, flags: found.flags, slopes })
}

/// Derivatives by design variables: of a shared one the sum over its bundles.
fn slopes_of(model: &Model, design: &Design, found: &sim::trials::Answer) -> Result<Slopes, SimError> {
    let bundles = model.bundles.len();
    let all: Vec<Parameter> =
        (0..bundles).map(Parameter::ReferenceStrain).chain((0..bundles).map(Parameter::Stiffness)).collect();
    let s = sensitivities(model, found, &all)?;
    let mut out = Slopes { predicted: vec![], forces_n: vec![] };
    for v in &design.variables {
        let (mut pose, mut forces) = ([0.0; 5], vec![0.0; bundles]);
        for b in (0..bundles).filter(|&b| v.bundles.contains(&model.bundles[b].name)) {
            let column = if v.kind == Kind::ReferenceStrain { b } else { bundles + b };
            pose.iter_mut().zip(s.pose.column(column).iter()).for_each(|(x, d)| *x += d);
            forces.iter_mut().zip(s.forces_n.column(column).iter()).for_each(|(x, d)| *x += d);
        }
        out.predicted.push(pose);
        out.forces_n.push(forces);
    }
    Ok(out)
}

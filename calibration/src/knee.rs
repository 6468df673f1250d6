//! The solver as an experiment sees it: answers to trials at design values, with their derivatives.
//!
//! A search asks for thousands of answers, so it asks a model with fewer contact nodes along a path of fewer increments; what is reported in
//! the end comes from the model and path of `simulate`. How far the two differ: docs/stages/calibrate.md.

use crate::design::{Design, Kind};
use crate::experiment::{Answer, Slopes};
use crate::frames::{FIRST, Terms, corrected};
use nalgebra::{Matrix5, Matrix6, Vector5};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::SimError;
use sim::contact::ContactOptions;
use sim::joint::{FE, FREE, Joint, Pose};
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::model::{BundleParameters, Model, compile_with};
use sim::quasistatic::SolverOptions;
use sim::sensitivity::{Parameter, sensitivities};
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, chain_flexion, pose_spec, solve_trials};
use std::collections::BTreeMap;

/// Step of the derivatives by frames [deg or mm].
const FRAME_STEP: f64 = 0.05;

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
            contact_spacing_mm: 2.2,
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

    /// Answers to trials, as fast as the search needs them.
    pub fn searching<'a>(
        &'a self,
        design: &'a Design,
        trials: &'a [LaxityTrial],
    ) -> impl Fn(&[f64], bool) -> Vec<Result<Answer, SimError>> + Sync + 'a {
        let questions =
            Questions { model: &self.search, spec: &self.spec, options: &self.search_options, design, trials };
        move |values, slopes| questions.answers(values, slopes)
    }

    /// Answers to trials, as `simulate` gives them.
    pub fn simulating<'a>(
        &'a self,
        design: &'a Design,
        trials: &'a [LaxityTrial],
    ) -> impl Fn(&[f64], bool) -> Vec<Result<Answer, SimError>> + Sync + 'a {
        let questions = Questions { model: &self.model, spec: &self.spec, options: &self.options, design, trials };
        move |values, slopes| questions.answers(values, slopes)
    }
}

/// The model at design values: ligament parameters, and the joint's frames where they are among the variables.
///
/// # Errors
/// A value out of range.
pub fn model_at(
    model: &Model,
    spec: &ModelSpec,
    design: &Design,
    values: &[f64],
) -> Result<(Model, Option<Terms>), SimError> {
    let mut parameters: Vec<BundleParameters> = model.parameters();
    for (v, &x) in design.variables.iter().zip(values) {
        for (p, _) in parameters.iter_mut().zip(&model.bundles).filter(|(_, b)| v.bundles.contains(&b.name)) {
            match v.kind {
                Kind::ReferenceStrain => p.reference_strain = x,
                _ => p.stiffness_n_per_mm = x,
            }
        }
    }
    let mut model = model.with_parameters(&parameters)?;
    let terms = design.frame_terms(values);
    if let Some(t) = &terms {
        model.joint = joint_with(spec, t)?;
    }
    Ok((model, terms))
}

/// The joint in frames turned and shifted.
fn joint_with(spec: &ModelSpec, terms: &Terms) -> Result<Joint, SimError> {
    Joint::new(&corrected(&spec.frames, spec.side, terms)?, spec.side)
}

/// What is asked of a solver.
struct Questions<'a> {
    model: &'a Model,
    spec: &'a ModelSpec,
    options: &'a TrialOptions,
    design: &'a Design,
    trials: &'a [LaxityTrial],
}

impl Questions<'_> {
    /// Answers at design values, in order; trials in parallel, after what those of one compression share.
    fn answers(&self, values: &[f64], slopes: bool) -> Vec<Result<Answer, SimError>> {
        let (model, terms) = match model_at(self.model, self.spec, self.design, values) {
            Ok(found) => found,
            Err(e) => return self.trials.iter().map(|_| Err(e.clone())).collect(),
        };
        let found = solve_trials(&model, self.trials, self.options);
        let answer = |(found, trial): (Result<sim::trials::Answer, SimError>, &LaxityTrial)| {
            let found = found?;
            let slopes = if slopes { Some(self.slopes(&model, terms, &found, trial)?) } else { None };
            Ok(Answer { predicted: found.predicted(), forces_n: found.forces_n, flags: found.flags, slopes })
        };
        found.into_par_iter().zip(self.trials).map(answer).collect()
    }

    /// Derivatives by design variables: of a shared one the sum over its bundles.
    fn slopes(
        &self,
        model: &Model,
        terms: Option<Terms>,
        found: &sim::trials::Answer,
        trial: &LaxityTrial,
    ) -> Result<Slopes, SimError> {
        let bundles = model.bundles.len();
        let all: Vec<Parameter> =
            (0..bundles).map(Parameter::ReferenceStrain).chain((0..bundles).map(Parameter::Stiffness)).collect();
        let s = sensitivities(model, found, &all)?;
        let mut out = Slopes { predicted: vec![], forces_n: vec![] };
        for v in &self.design.variables {
            if let Some(t) = terms.filter(|_| v.is_of_frames()) {
                let (pose, forces) = self.frame_slope(model, (found, trial), &t, (v.number - FIRST) as usize)?;
                out.predicted.push(pose);
                out.forces_n.push(forces);
                continue;
            }
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

    /// Derivative by a frame's turn or shift [per deg, per mm]: the same bones in the other frames, flexed to the trial's flexion and brought back
    /// to equilibrium by one Newton step; forces there by the tangent at the answer, friction's stay.
    fn frame_slope(
        &self,
        model: &Model,
        (found, trial): (&sim::trials::Answer, &LaxityTrial),
        terms: &Terms,
        term: usize,
    ) -> Result<([f64; 5], Vec<f64>), SimError> {
        let step = FRAME_STEP;
        let mut moved = *terms;
        moved[term] += step;
        let mut other = model.clone();
        other.joint = joint_with(self.spec, &moved)?;
        let place = model.joint.pose(&found.state.q).femur;
        let mut q = other.joint.coordinates(&other.joint.grood_suntay_of(&place))?;
        q[FE] = chain_flexion(&other, trial.fe_deg, self.options)?;
        let singular = || SimError::Solver("the tangent is singular: nothing holds the knee in one direction".into());
        // the pull there in the coordinates of the frames as they are, then as a wrench, then in the other frames' coordinates
        let there = other.joint.pose(&q);
        let same = model.joint.coordinates(&model.joint.grood_suntay_of(&there.femur))?;
        let hessian = &found.evaluation.hessian;
        let pull = found.evaluation.gradient + hessian * (same - found.state.q);
        let wrench = screws(&model.joint.pose(&same)).transpose().lu().solve(&pull).ok_or_else(singular)?;
        let residual = screws(&there).transpose() * wrench - found.evaluation.gradient;
        let residual = Vector5::from_fn(|i, _| residual[FREE[i]]);
        let tangent = Matrix5::from_fn(|i, j| 0.5 * (hessian[(FREE[i], FREE[j])] + hessian[(FREE[j], FREE[i])]));
        let back = tangent.lu().solve(&-residual).ok_or_else(singular)?;
        (0..5).for_each(|i| q[FREE[i]] += back[i]);
        let pose = pose_spec(&other.joint.grood_suntay(&q));
        let now = [pose.vv_deg, pose.ie_deg, pose.ml_mm, pose.ap_mm, pose.si_mm];
        let before = found.predicted();
        let forces = other.bundle_forces(&other.fibre_states(&other.joint.pose(&q)));
        Ok((
            std::array::from_fn(|c| (now[c] - before[c]) / step),
            forces.iter().zip(&found.forces_n).map(|(a, b)| (a - b) / step).collect(),
        ))
    }
}

/// Velocities of the femur by the coordinates, a column each: angular, then linear.
fn screws(pose: &Pose) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| if i < 3 { pose.screws[j].angular[i] } else { pose.screws[j].linear[i - 3] })
}

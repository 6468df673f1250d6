//! A knee in laxity trials as a function of its parameters: the forward model of an inference.
//!
//! Each trial's answer is an equilibrium without friction, found from the one of a point close by and what moves it; the first along the path of its
//! loading ([`sim::trials`]). Derivatives are the implicit function theorem's.

mod jacobian;
pub mod predict;
mod reading;

use crate::discrepancy::ModelDiscrepancy;
use crate::error::InferenceError;
use crate::frames::{FrameSteps, Terms, corrected, frame_steps};
use crate::jacobian::pressed;
use crate::parameter::Parameter;
use crate::posterior::{Forward, Point};
use crate::quantity::shares;
pub use crate::quantity::{KNOTS, Quantity};
use crate::trial::Trial;
use jacobian::Jacobian;
pub use jacobian::{ByOne, by_the_model};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sim::Model;
use sim::SimError;
use sim::contact::Nearby;
use sim::coordinate::{FE, Free, Load, Six};
use sim::joint::Joint;
use sim::laxity::LaxityTrial;
use sim::quasistatic::{Goal, close};
use sim::sensitivity::End;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, chain_flexion, pose_spec, solve_trials};

/// A belief about bundle forces in a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Belief {
    /// The trial.
    pub trial: usize,
    /// Bundles whose tensions are summed.
    pub bundles: Vec<usize>,
    /// Expected [N]; with `only_above`, what they may have without being less likely.
    pub mean_n: f64,
    /// Standard deviation [N].
    pub sd_n: f64,
    /// Whether only more than `mean_n` counts.
    pub only_above: bool,
}

/// A knee in trials.
pub struct Trials<'a> {
    /// The compiled model that answers.
    pub model: &'a Model,
    /// Its specification: frames, side and pressure law.
    pub spec: &'a ModelSpec,
    /// Its parameters.
    pub parameters: &'a [Parameter<Quantity>],
    /// The trials.
    pub trials: &'a [Trial],
    /// Beliefs about forces in them.
    pub beliefs: &'a [Belief],
    /// The path to the first answers.
    pub options: &'a TrialOptions,
    /// Scatter of loads as recorded.
    pub load_sd: Load,
    /// What the model lacks.
    pub discrepancy: ModelDiscrepancy,
    /// Told of every fit of an inference that has ended.
    pub on_fit: Option<&'a (dyn Fn() + Sync)>,
}

/// An answer to a trial and what moves it.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Joint coordinates [rad, mm].
    pub q: Six,
    /// Size of the contact force [N].
    pub pressed: f64,
    /// Predicted VV, IE [deg], ML, AP, SI [mm].
    pub predicted: Free<f64>,
    /// Bundle forces [N].
    pub forces_n: Vec<f64>,
    /// Derivatives by the parameters: of the coordinates (6 rows), without those by frames.
    coordinates: DMatrix<f64>,
    /// Derivatives of the prediction by the loads: a row a coordinate.
    by_load: Free<Free<f64>>,
    /// Where cartilage nearly touches, for answers close by.
    near: Nearby,
}

/// Where an answer is sought from.
struct Start {
    q: Six,
    /// Size of the contact force there [N].
    pressed: f64,
    near: Nearby,
}

/// Answers of all trials.
pub type Answers = Vec<Answer>;

/// A model at values of its parameters: in the frames that all data sets share, then in those of each that has its own.
#[derive(Clone, Debug)]
pub struct Models(Vec<Model>);

impl Models {
    /// In the frames of a data set; of none, in those of all.
    pub fn of(&self, source: Option<usize>) -> &Model {
        source.and_then(|s| self.0.get(s + 1)).unwrap_or(&self.0[0])
    }

    /// In the frames of all.
    pub fn shared(&self) -> &Model {
        &self.0[0]
    }

    /// With what was cut of the knee in each data set, as its trials say. A data set is of one state of the knee.
    ///
    /// # Errors
    /// A ligament that the model does not have.
    pub fn as_cut(mut self, trials: &[Trial]) -> Result<Models, SimError> {
        let mut known = std::collections::BTreeSet::new();
        for trial in trials.iter().filter(|t| !t.record.without.is_empty()) {
            let Some(source) = trial.source.filter(|s| known.insert(*s)) else { continue };
            let shared = self.0[0].clone();
            self.0.resize(self.0.len().max(source + 2), shared);
            self.0[source + 1] = self.0[source + 1].without(&trial.record.without)?;
        }
        Ok(self)
    }
}

/// A knee at values of its parameters.
pub(crate) struct Knee {
    models: Models,
    /// Of the frames of all, then of each data set's.
    terms: Vec<Terms>,
    values: Vec<f64>,
}

impl Knee {
    /// The model a trial is put to, and its frames.
    pub(crate) fn of(&self, trial: &Trial) -> (&Model, &Terms) {
        (self.models.of(trial.source), of_frames(&self.terms, trial.source))
    }
}

/// What is of a data set's frames; of none, what is of those of all.
fn of_frames<T>(terms: &[T], source: Option<usize>) -> &T {
    source.and_then(|s| terms.get(s + 1)).unwrap_or(&terms[0])
}

impl Trials<'_> {
    /// Checks the priors.
    ///
    /// # Errors
    /// One that is no distribution.
    pub fn check(&self) -> Result<(), InferenceError> {
        self.parameters.iter().try_for_each(|p| p.prior.check(&p.name))
    }

    /// Values of the parameters at standard normal numbers, and their derivatives.
    pub fn values(&self, z: &DVector<f64>) -> Vec<(f64, f64)> {
        self.parameters.iter().zip(z.iter()).map(|(p, z)| p.prior.at(*z)).collect()
    }

    /// How many data sets the parameters and trials know.
    fn sources(&self) -> usize {
        let trials = self.trials.iter().filter_map(|t| t.source).max().map_or(0, |s| s + 1);
        trials.max(framed_sources(self.parameters))
    }

    /// The model at values, in each data set's frames.
    pub(crate) fn knee(&self, values: Vec<f64>) -> Result<Knee, SimError> {
        let terms = terms_at(self.parameters, &values, self.sources());
        let model = model_at(self.model, self.spec, self.parameters, &values)?;
        Ok(Knee { models: in_frames(&model, self.spec, &terms)?, terms, values })
    }

    /// Steps of the frames that are parameters, about those of all, then about those of each data set.
    fn steps(&self, knee: &Knee) -> Vec<FrameSteps> {
        let is_asked = |term: usize| {
            let is_its = |p: &Parameter<Quantity>| p.quantity.frame().is_some_and(|(_, of)| of == term);
            self.parameters.iter().any(is_its)
        };
        knee.terms.iter().map(|terms| frame_steps(&self.spec.frames, self.spec.side, terms, is_asked)).collect()
    }

    /// The specification with frames of all, sites, contact and ligaments as at `z`; `source` picks a data set's frames.
    ///
    /// # Errors
    /// Frames that make no joint.
    pub fn spec_at(&self, z: &DVector<f64>, source: Option<usize>) -> Result<ModelSpec, SimError> {
        let knee = self.knee(self.values(z).into_iter().map(|v| v.0).collect())?;
        let (model, terms) = (knee.models.of(source), of_frames(&knee.terms, source));
        let mut out = self.spec.clone();
        out.frames = corrected(&self.spec.frames, self.spec.side, terms)?;
        for (b, p) in out.bundles.iter_mut().zip(model.parameters()) {
            (b.reference_strain, b.stiffness_n_per_mm) = (p.reference_strain, p.stiffness_n_per_mm);
        }
        for (f, moved) in out.fibres.iter_mut().zip(&model.fibres) {
            (f.femur, f.tibia) = (meshes::Point::from(moved.femur), meshes::Point::from(moved.tibia));
        }
        for (p, x) in self.parameters.iter().zip(&knee.values) {
            match p.quantity {
                Quantity::ContactScale => out.contact.scale_pressure(*x),
                Quantity::Cartilage => out.contact.overclosure_mm.iter_mut().for_each(|y| *y -= x),
                Quantity::ReferenceStrain(_)
                | Quantity::Stiffness(_)
                | Quantity::Site(..)
                | Quantity::Frame(..)
                | Quantity::Lean(..)
                | Quantity::Compliance(..)
                | Quantity::Resting(..) => {}
            }
        }
        Ok(out)
    }

    /// A trial's load with what the knee bears beside it.
    fn borne(&self, values: &[f64], trial: &Trial) -> Load {
        let mut load = trial.record.load;
        for (p, x) in self.parameters.iter().zip(values) {
            if let Quantity::Resting(source, coordinate) = p.quantity
                && trial.source == Some(source)
            {
                load[coordinate] += x;
            }
        }
        load
    }

    /// A trial as the solver has it, with what the knee bears beside its load.
    pub fn bearing(&self, values: &[f64], trial: &Trial) -> LaxityTrial {
        LaxityTrial { load: self.borne(values, trial), ..trial.record.clone() }
    }

    /// What the lean of the bearing surface adds to a trial's load, per newton of contact force.
    fn lean(&self, values: &[f64], fe_deg: f64) -> Six {
        let share = shares(fe_deg);
        let mut load = Load::default();
        for (p, x) in self.parameters.iter().zip(values) {
            if let Quantity::Lean(coordinate, knot) = p.quantity {
                load[coordinate] += share[knot] * x;
            }
        }
        load.generalised()
    }

    /// Answers along the paths of loading, without derivatives: where nothing close by is known.
    fn restarted_from_afar(&self, knee: &Knee) -> Option<Vec<Start>> {
        let mut found: Vec<Option<Start>> = self.trials.iter().map(|_| None).collect();
        for source in std::iter::once(None).chain((0..self.sources()).map(Some)) {
            let of: Vec<usize> = (0..self.trials.len()).filter(|&i| self.trials[i].source == source).collect();
            let Some(&first) = of.first() else { continue };
            let trials: Vec<_> = of.iter().map(|&i| self.bearing(&knee.values, &self.trials[i])).collect();
            let model = knee.of(&self.trials[first]).0;
            for (i, answer) in of.into_iter().zip(solve_trials(model, &trials, self.options)) {
                found[i] = answer.ok().map(|a| Start {
                    q: a.state.q,
                    pressed: pressed(&a.evaluation),
                    near: Nearby::default(),
                });
            }
        }
        found.into_iter().collect()
    }

    /// An answer from coordinates close by, with its derivatives; `steps` are those of the frames of all, then of each data set.
    fn answer(
        &self,
        (knee, steps): (&Knee, &[FrameSteps]),
        trial: &Trial,
        start: Start,
    ) -> Result<(Answer, Jacobian), SimError> {
        let model = &*knee.of(trial).0.in_trial(&trial.record)?;
        let lean = self.lean(&knee.values, trial.record.fe_deg);
        let goal = Goal {
            flexion: chain_flexion(model, trial.record.fe_deg, self.options)?,
            load: self.borne(&knee.values, trial).generalised() + lean * start.pressed,
            flow: None,
        };
        let mut near = start.near;
        let solved = close(model, start.q, &goal, &self.options.solver, &mut near)?;
        let gs = model.joint.grood_suntay(&solved.state.q);
        let forces_n = model.bundle_forces(&solved.evaluation.fibres);
        let found = sim::trials::Answer {
            state: solved.state,
            evaluation: solved.evaluation,
            pose: pose_spec(&gs),
            forces_n,
            outputs: vec![],
            flags: vec![],
            evaluations: solved.evaluations,
        };
        self.with_jacobian((model, &knee.values), (trial, of_frames(steps, trial.source)), found, &near)
    }

    /// Where an answer is sought from: the other point's answer moved by what its derivatives say, in the frames of this point.
    fn start(&self, knee: &Knee, before: &Knee, trial: &Trial, answer: &Answer) -> Result<Six, SimError> {
        let mut q = answer.q;
        for (k, (x, y)) in knee.values.iter().zip(&before.values).enumerate() {
            if x != y {
                q += answer.coordinates.column(k) * (x - y);
            }
        }
        let (model, terms) = knee.of(trial);
        let (old, then) = before.of(trial);
        if terms != then {
            q = model.joint.coordinates(&model.joint.grood_suntay_of(&old.joint.pose(&q).femur))?;
        }
        q[FE] = chain_flexion(model, trial.record.fe_deg, self.options)?;
        Ok(q)
    }
}

/// How many data sets have frames of their own.
fn framed_sources(parameters: &[Parameter<Quantity>]) -> usize {
    let of = |p: &Parameter<Quantity>| p.quantity.frame().and_then(|(source, _)| source);
    parameters.iter().filter_map(of).max().map_or(0, |s| s + 1)
}

/// A model at values of its parameters: in the frames that all data sets share, then in those of each data set that has its own.
///
/// # Errors
/// Values out of the model's range, frames that make no joint.
pub fn models_at(
    model: &Model,
    spec: &ModelSpec,
    parameters: &[Parameter<Quantity>],
    values: &[f64],
) -> Result<Models, SimError> {
    let terms = terms_at(parameters, values, framed_sources(parameters));
    in_frames(&model_at(model, spec, parameters, values)?, spec, &terms)
}

/// Turns and shifts of the frames of all, then of each data set.
fn terms_at(parameters: &[Parameter<Quantity>], values: &[f64], sources: usize) -> Vec<Terms> {
    let mut terms = vec![[0.0; 12]; sources + 1];
    for (p, x) in parameters.iter().zip(values) {
        match p.quantity.frame() {
            Some((None, term)) => terms.iter_mut().for_each(|t| t[term] += x),
            Some((Some(source), term)) => terms[source + 1][term] += x,
            None => {}
        }
    }
    terms
}

/// A model in frames turned and shifted.
fn in_frames(model: &Model, spec: &ModelSpec, terms: &[Terms]) -> Result<Models, SimError> {
    let framed = |t: &Terms| -> Result<Model, SimError> {
        let mut framed = model.clone();
        if t.iter().any(|x| *x != 0.0) {
            framed.joint = Joint::new(&corrected(&spec.frames, spec.side, t)?, spec.side)?;
        }
        Ok(framed)
    };
    terms.iter().map(framed).collect::<Result<_, _>>().map(Models)
}

/// A model at values, in its own frames.
fn model_at(
    model: &Model,
    spec: &ModelSpec,
    parameters: &[Parameter<Quantity>],
    values: &[f64],
) -> Result<Model, SimError> {
    let mut bundles = model.parameters();
    let mut ends = vec![[[0.0; 3]; 2]; bundles.len()];
    let (mut scale, mut thicker) = (1.0, 0.0);
    for (p, &x) in parameters.iter().zip(values) {
        match &p.quantity {
            Quantity::ReferenceStrain(of) => of.iter().for_each(|&b| bundles[b].reference_strain = x),
            Quantity::Stiffness(of) => of.iter().for_each(|&b| bundles[b].stiffness_n_per_mm = x),
            Quantity::Site(bundle, end, axis) => ends[*bundle][usize::from(*end == End::Tibia)][*axis] += x,
            Quantity::ContactScale => scale = x,
            Quantity::Cartilage => thicker = x,
            Quantity::Frame(..) | Quantity::Lean(..) | Quantity::Compliance(..) | Quantity::Resting(..) => {}
        }
    }
    let mut model = model.with_parameters(&bundles)?.with_contact_scale(scale)?;
    if thicker != 0.0 {
        let law = &spec.contact;
        let shifted: Vec<f64> = law.overclosure_mm.iter().map(|x| x - thicker).collect();
        model.contact = model.contact.with_law(&shifted, &law.pressure_mpa)?;
    }
    for fibre in 0..model.fibres.len() {
        let [femur, tibia] = ends[model.fibres[fibre].bundle].map(meshes::Vector::from);
        if femur != meshes::Vector::zeros() || tibia != meshes::Vector::zeros() {
            let f = &model.fibres[fibre];
            let (a, b) = (meshes::Point::from(f.femur + femur), meshes::Point::from(f.tibia + tibia));
            model = model.with_fibre_ends(fibre, a, b)?;
        }
    }
    Ok(model)
}

impl Forward for Trials<'_> {
    type State = Answers;

    fn size(&self) -> usize {
        self.parameters.len()
    }

    fn fitted(&self) {
        self.on_fit.iter().for_each(|told| told());
    }

    fn at(&self, z: &DVector<f64>, near: Option<(&DVector<f64>, &Answers)>) -> Option<Point<Answers>> {
        let values = self.values(z);
        let knee = self.knee(values.iter().map(|v| v.0).collect()).ok()?;
        let starts: Vec<Start> = match near {
            Some((other, answers)) => {
                let before = self.knee(self.values(other).into_iter().map(|v| v.0).collect()).ok()?;
                let start = |(t, a): (&Trial, &Answer)| {
                    let q = self.start(&knee, &before, t, a).ok()?;
                    Some(Start { q, pressed: a.pressed, near: a.near.clone() })
                };
                self.trials.iter().zip(answers).map(start).collect::<Option<_>>()?
            }
            None => self.restarted_from_afar(&knee)?,
        };
        let steps = self.steps(&knee);
        let found: Vec<(Answer, Jacobian)> = self
            .trials
            .par_iter()
            .zip(starts)
            .map(|(t, start)| self.answer((&knee, &steps), t, start).ok())
            .collect::<Option<_>>()?;
        Some(self.point(found, &values))
    }

    fn starts_anew(&self, number: usize) -> bool {
        matches!(self.parameters[number].quantity, Quantity::ReferenceStrain(_) | Quantity::Site(..))
    }

    fn scatter(&self, state: &Answers) -> Option<DMatrix<f64>> {
        Some(self.shared_scatter(state))
    }
}

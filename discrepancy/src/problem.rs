//! The question: a model, trials, and what may differ; predictions and their derivatives at any answer.
//!
//! Unknowns stand in units of their prior: ligament strains (0.03) and log stiffnesses (0.2), the log of the contact's scale (0.3), then the
//! parameters of the effects.

use crate::catalogue::{Catalogue, Effect};
use crate::effect::{Active, Place};
use crate::equilibrium::{Bench, Rest};
use crate::error::DiscrepancyError;
use crate::trial::{PER_UNIT, Source, Trial, trials};
use nalgebra::DMatrix;
use rayon::prelude::*;
use sim::Model;
use sim::contact::Nearby;
use sim::joint::{AP, FREE, IE, ML, SI, Six, VV};
use sim::model::BundleParameters;
use sim::spec::ModelSpec;
use validation::design::{Design, Kind};

/// Prior standard deviations: reference strain [-], log of stiffness [-], log of the contact's scale [-].
pub const PRIOR: [f64; 3] = [0.03, 0.2, 0.3];
/// Coordinates of a reading.
const READ: [usize; 5] = [VV, IE, ML, AP, SI];

/// Sum of squares, in noises, from which a trial's rest is taken for lost: nothing that scatters takes a knee that stays where it is six noises away.
const LOST: f64 = 36.0;
/// The same where the model fits so little of the data that branches are not the matter: there rests count as they are, as far as they can be told.
const FAR: f64 = 400.0;
/// Most trials, as a share, that may be lost beside recalibrated ligaments for that [-].
const MOST_LOST: f64 = 0.2;

/// Where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scope {
    /// In every data set.
    Both,
    /// In one.
    Only(usize),
}

impl Scope {
    /// Whether it acts in a data set.
    pub fn covers(self, source: usize) -> bool {
        self == Scope::Both || self == Scope::Only(source)
    }
}

/// An effect with a scope: what can be named.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The effect.
    pub effect: Effect,
    /// Which of its variants.
    pub variant: usize,
    /// Where it acts.
    pub scope: Scope,
}

impl Candidate {
    /// Name in answers.
    pub fn name(&self) -> String {
        self.effect.name(self.variant)
    }

    /// The effect at work with values in units of its priors.
    pub fn active(&self, scaled: &[f64]) -> Active {
        let values = self.effect.parameter.iter().zip(scaled).map(|(p, x)| p.sd * x).collect();
        Active::new(&self.effect, self.variant, values).expect("candidates come from implemented effects")
    }

    /// Whether values in units of its priors are as large as the effect must be to deserve its name.
    pub fn is_large_enough(&self, scaled: &[f64]) -> bool {
        self.effect.parameter.iter().zip(scaled).all(|(p, x)| p.sd * x.abs() >= p.least)
    }

    /// Whether values in units of its priors are no larger than the effect can be.
    pub fn is_small_enough(&self, scaled: &[f64]) -> bool {
        self.effect.parameter.iter().zip(scaled).all(|(p, x)| p.most.is_none_or(|most| p.sd * x.abs() <= most))
    }

    /// Number of parameters.
    pub fn size(&self) -> usize {
        self.effect.parameter.len()
    }
}

/// A model, data and a catalogue.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The model as given.
    pub model: Model,
    /// Frames.
    pub place: Place,
    /// Ligament unknowns.
    pub design: Design,
    /// Names of the data sets.
    pub sources: Vec<String>,
    /// Trials of all of them.
    pub trials: Vec<Trial>,
    /// What may be named.
    pub catalogue: Catalogue,
    /// Effects the model has already, with the scope of each.
    pub present: Vec<(Active, Scope)>,
    /// The pose next to each trial's measured one, where the chain reaches it: a start on the branch that the knee took.
    held: Vec<Option<Rest>>,
    bundles: Vec<Vec<usize>>,
    /// Sum of squares from which a trial's rest is taken for lost.
    lost: f64,
}

/// Predictions and derivatives at an answer.
#[derive(Clone, Debug)]
pub struct Linear {
    /// Five readings a trial [deg, mm].
    pub value: Vec<f64>,
    /// Derivatives by the unknowns: a row a reading.
    pub slope: DMatrix<f64>,
    /// Where each trial rests.
    pub rests: Vec<Rest>,
}

impl Problem {
    /// Sets the question up and finds the unloaded pose of every trial.
    ///
    /// Errors: what the data or the model lack.
    pub fn new(
        model: &Model,
        spec: &ModelSpec,
        sources: &[Source],
        catalogue: &Catalogue,
    ) -> Result<Problem, DiscrepancyError> {
        let mut design = Design::of_model(spec)?;
        design.variables.retain(|v| matches!(v.kind, Kind::ReferenceStrain | Kind::StiffnessNPerMm));
        let place = Place { femur: spec.frames.femur, tibia: spec.frames.tibia };
        let index = |name: &String| model.bundles.iter().position(|b| b.name == *name);
        let bundles = design.variables.iter().map(|v| v.bundles.iter().filter_map(index).collect()).collect();
        let mut problem = Problem {
            // where the model brings a second contact, the diagnosis works with that one
            model: model.with_second_share(1.0)?,
            place,
            design,
            sources: sources.iter().map(|s| s.name.clone()).collect(),
            trials: trials(sources)?,
            catalogue: catalogue.clone(),
            present: vec![],
            held: vec![],
            bundles,
            lost: LOST,
        };
        let neutral: Vec<Six> = problem
            .trials
            .par_iter()
            .map(|t| Bench { model: &problem.model, effects: &[], place: &problem.place }.neutral(t).q)
            .collect();
        for (t, q) in problem.trials.iter_mut().zip(neutral) {
            t.neutral = q;
        }
        problem.hold();
        Ok(problem)
    }

    /// The same question of a model that has effects already.
    pub fn with_present(mut self, present: Vec<(Active, Scope)>) -> Problem {
        self.present = present;
        self.hold();
        self
    }

    /// Grood-Suntay coordinates that a trial read [rad, mm]; what was not measured is taken from the unloaded pose.
    fn measured(&self, trial: &Trial) -> Six {
        let mut gs = self.model.joint.grood_suntay(&trial.neutral);
        gs[0] = trial.flexion;
        for (c, value) in trial.measured.iter().enumerate() {
            if let Some(v) = value {
                gs[READ[c]] = v * PER_UNIT[c];
            }
        }
        gs
    }

    /// Finds the poses next to the measured ones.
    fn hold(&mut self) {
        let near = |t: &Trial| {
            let effects = self.effects_in(t.source, &[], &[]);
            let bench = Bench { model: &self.model, effects: &effects, place: &self.place };
            let measured = self.measured(t);
            self.model.joint.coordinates(&measured).ok().map(|q| bench.held(t, &measured, &q))
        };
        self.held = self.trials.par_iter().map(near).collect();
    }

    /// Predictions and derivatives of the model as given, linear about the measured poses instead of its own: an effect that moves the knee far is
    /// seen there as a force, undistorted.
    ///
    /// Errors: a model that cannot be evaluated.
    pub fn linear_held(&self) -> Result<Linear, DiscrepancyError> {
        let unknowns = vec![0.0; self.nuisances()];
        let own = |i: usize| Bench { model: &self.model, effects: &[], place: &self.place }.neutral(&self.trials[i]);
        let rests: Vec<Rest> =
            (0..self.trials.len()).into_par_iter().map(|i| self.held[i].clone().unwrap_or_else(|| own(i))).collect();
        let mut linear = self.linear_at(&[], &unknowns, rests)?;
        for (i, rest) in linear.rests.iter().enumerate() {
            let effects = self.effects_in(self.trials[i].source, &[], &unknowns);
            let bench = Bench { model: &self.model, effects: &effects, place: &self.place };
            let moved = Slopes::new(bench, &self.trials[i], rest).by(&rest.miss, &Six::zeros());
            (0..5).for_each(|c| linear.value[5 * i + c] += moved[c]);
        }
        Ok(linear)
    }

    /// Number of ligament and contact unknowns.
    pub fn nuisances(&self) -> usize {
        self.design.variables.len() + 1
    }

    /// Every testable effect, variant and scope.
    pub fn candidates(&self) -> Vec<Candidate> {
        let mut scopes: Vec<Scope> = vec![Scope::Both];
        if self.sources.len() > 1 {
            scopes.extend((0..self.sources.len()).map(Scope::Only));
        }
        let mut out = Vec::new();
        for effect in &self.catalogue.effect {
            if effect.parameter.is_empty() || effect.untestable(&self.trials).is_some() {
                continue;
            }
            for variant in 0..effect.variants.len().max(1) {
                for &scope in scopes.iter().filter(|s| !effect.one_knee || **s == Scope::Both) {
                    out.push(Candidate { effect: effect.clone(), variant, scope });
                }
            }
        }
        out
    }

    /// The model with other ligaments and contact.
    pub fn model_at(&self, unknowns: &[f64]) -> Result<Model, DiscrepancyError> {
        let mut parameters: Vec<BundleParameters> = self.model.parameters();
        for (k, v) in self.design.variables.iter().enumerate() {
            for &b in &self.bundles[k] {
                match v.kind {
                    Kind::ReferenceStrain => parameters[b].reference_strain += PRIOR[0] * unknowns[k],
                    Kind::StiffnessNPerMm => parameters[b].stiffness_n_per_mm *= (PRIOR[1] * unknowns[k]).exp(),
                    // frames are effects here, not unknowns
                    Kind::FrameTurnDeg | Kind::FrameShiftMm => {}
                }
            }
        }
        let contact = (PRIOR[2] * unknowns[self.design.variables.len()]).exp();
        Ok(self.model.with_parameters(&parameters)?.with_contact_scale(contact)?)
    }

    /// The effects at work in a data set: those the model has, then the hypothesis'.
    pub fn effects_in(&self, source: usize, hypothesis: &[Candidate], unknowns: &[f64]) -> Vec<Active> {
        let mut out: Vec<Active> =
            self.present.iter().filter(|(_, s)| s.covers(source)).map(|(a, _)| a.clone()).collect();
        let mut at = self.nuisances();
        for candidate in hypothesis {
            let values = &unknowns[at..at + candidate.size()];
            if candidate.scope.covers(source) {
                out.push(candidate.active(values));
            }
            at += candidate.size();
        }
        out
    }

    /// Rests of all trials at an answer; from nearby poses, or the whole way where `starts` is empty.
    pub fn rests(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        starts: &[Six],
    ) -> Result<Vec<Rest>, DiscrepancyError> {
        let model = self.model_at(unknowns)?;
        let effects: Vec<Vec<Active>> =
            (0..self.sources.len()).map(|s| self.effects_in(s, hypothesis, unknowns)).collect();
        Ok((0..self.trials.len())
            .into_par_iter()
            .map(|i| {
                let trial = &self.trials[i];
                let bench = Bench { model: &model, effects: &effects[trial.source], place: &self.place };
                match starts.get(i) {
                    Some(q) => bench.settle(trial, q),
                    None => bench.walk(trial),
                }
            })
            .collect())
    }

    /// Rests from nearby poses; where that ends far from the measurement, also from the measured pose, and the nearer of the two: a loaded knee
    /// has several stable branches, and the one it took is not for the parameters to explain.
    pub fn nearer(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        starts: &[Six],
    ) -> Result<Vec<Rest>, DiscrepancyError> {
        let model = self.model_at(unknowns)?;
        let effects: Vec<Vec<Active>> =
            (0..self.sources.len()).map(|s| self.effects_in(s, hypothesis, unknowns)).collect();
        let miss = |i: usize, rest: &Rest| self.off(i, rest);
        Ok((0..self.trials.len())
            .into_par_iter()
            .map(|i| {
                let trial = &self.trials[i];
                let bench = Bench { model: &model, effects: &effects[trial.source], place: &self.place };
                let first = match starts.get(i) {
                    Some(q) => bench.settle(trial, q),
                    None => bench.walk(trial),
                };
                if miss(i, &first) <= 16.0 {
                    return first;
                }
                // the second is taken where it is much nearer; a knee that left the joint altogether may find back from the measured pose, let go slowly
                let nearer = |a: Rest, b: Rest| {
                    if (b.balanced || !a.balanced) && miss(i, &b) < 0.5 * miss(i, &a) { b } else { a }
                };
                let Some(held) = &self.held[i] else { return first };
                let second = nearer(first, bench.settle(trial, &held.q));
                if miss(i, &second) <= self.lost {
                    return second;
                }
                let third = nearer(second, bench.released(trial, &self.measured(trial), &held.q));
                if miss(i, &third) > self.lost { self.imagined(bench, trial, held) } else { third }
            })
            .collect())
    }

    /// How far a rest of trial `i` is from what was measured: sum of squares in noises, half a degree or millimetre added to each.
    fn off(&self, i: usize, rest: &Rest) -> f64 {
        let (there, t) = (reading(rest), &self.trials[i]);
        (0..5).map(|c| t.measured[c].map_or(0.0, |m| ((there[c] - m) / (t.sd[c] + 0.5)).powi(2))).sum()
    }

    /// Whether trials count as lost only far from what was measured.
    pub fn with_far_rests(mut self, far: bool) -> Problem {
        self.lost = if far { FAR } else { LOST };
        self
    }

    /// Whether so many of these rests are lost that the model fits little.
    pub fn fits_little(&self, rests: &[Rest]) -> bool {
        let lost = rests.iter().enumerate().filter(|(i, r)| self.off(*i, r) > LOST).count();
        lost as f64 > MOST_LOST * rests.len() as f64
    }

    /// Where a trial that finds no rest near the measured pose would rest if the knee were as stiff there as the model as given is at that pose, and no less stiff than it takes to stay: what
    /// is out of balance there counts, no matter how far it would throw the knee.
    fn imagined(&self, bench: Bench, trial: &Trial, held: &Rest) -> Rest {
        let tangent = bench.stiffened(trial, &held.tangent);
        let mut rest = Rest { tangent, ..bench.held(trial, &self.measured(trial), &held.q) };
        let moved = Slopes::new(bench, trial, &rest).by(&rest.miss, &Six::zeros());
        READ.iter().zip(moved).zip(PER_UNIT).for_each(|((&j, m), unit)| rest.observed[j] += m * unit);
        rest
    }

    /// Predictions and derivatives by all unknowns of a hypothesis.
    pub fn linear(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        starts: &[Six],
    ) -> Result<Linear, DiscrepancyError> {
        let rests = self.nearer(hypothesis, unknowns, starts)?;
        self.linear_at(hypothesis, unknowns, rests)
    }

    /// [`Problem::linear`] where the rests are known.
    pub fn linear_at(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        rests: Vec<Rest>,
    ) -> Result<Linear, DiscrepancyError> {
        let model = self.model_at(unknowns)?;
        let (n, m) = (self.trials.len(), unknowns.len());
        let rows: Vec<Vec<[f64; 5]>> = (0..n)
            .into_par_iter()
            .map(|i| {
                let trial = &self.trials[i];
                let effects = self.effects_in(trial.source, hypothesis, unknowns);
                let slopes =
                    Slopes::new(Bench { model: &model, effects: &effects, place: &self.place }, trial, &rests[i]);
                let mut columns = slopes.ligaments(self);
                columns.push(slopes.contact());
                let mut at = self.nuisances();
                for candidate in hypothesis {
                    let scaled = &unknowns[at..at + candidate.size()];
                    at += candidate.size();
                    columns.extend(slopes.candidate(candidate, scaled, candidate.scope.covers(trial.source)));
                }
                columns
            })
            .collect();
        let slope = DMatrix::from_fn(5 * n, m, |r, c| rows[r / 5][c][r % 5]);
        let value = rests.iter().flat_map(reading).collect();
        Ok(Linear { value, slope, rests })
    }
}

/// Readings VV, IE [deg], ML, AP, SI [mm] of a rest.
pub fn reading(rest: &Rest) -> [f64; 5] {
    std::array::from_fn(|c| rest.observed[READ[c]] / PER_UNIT[c])
}

/// Derivatives of a trial's reading at its rest.
pub struct Slopes<'a> {
    bench: Bench<'a>,
    trial: &'a Trial,
    rest: &'a Rest,
    /// Of the reading by what is out of balance.
    answer: Option<nalgebra::Matrix6<f64>>,
}

impl<'a> Slopes<'a> {
    /// Prepares the derivatives of `trial` at `rest`.
    pub fn new(bench: Bench<'a>, trial: &'a Trial, rest: &'a Rest) -> Slopes<'a> {
        let reading = bench.observe_derivative(trial, &rest.q);
        let answer = rest.tangent.try_inverse().map(|inverse| reading * inverse);
        Slopes { bench, trial, rest, answer }
    }

    /// Change of the reading [deg, mm] when the balance changes by `miss` (flexion's row: the read flexion) and the reading itself by `direct`.
    pub fn by(&self, miss: &Six, direct: &Six) -> [f64; 5] {
        let Some(answer) = &self.answer else { return [0.0; 5] };
        let moved = direct - answer * miss;
        std::array::from_fn(|c| moved[READ[c]] / PER_UNIT[c])
    }

    /// By the ligament unknowns.
    pub fn ligaments(&self, problem: &Problem) -> Vec<[f64; 5]> {
        let model = self.bench.model;
        let states = model.fibre_states(&model.joint.pose(&self.rest.q));
        let mut by_bundle = vec![[Six::zeros(); 2]; model.bundles.len()];
        for (fibre, state) in model.fibres.iter().zip(&states) {
            let bundle = &model.bundles[fibre.bundle];
            let [strain, stiffness] = bundle.parameter_derivatives(state.line.length - fibre.initial_length);
            by_bundle[fibre.bundle][0] += state.line.gradient * (strain * PRIOR[0]);
            by_bundle[fibre.bundle][1] += state.line.gradient * (stiffness * bundle.stiffness * PRIOR[1]);
        }
        problem
            .design
            .variables
            .iter()
            .enumerate()
            .map(|(k, v)| {
                let which = usize::from(v.kind == Kind::StiffnessNPerMm);
                let miss = problem.bundles[k].iter().fold(Six::zeros(), |s, &b| s + by_bundle[b][which]);
                self.by(&balanced(miss), &Six::zeros())
            })
            .collect()
    }

    /// By the contact's scale.
    pub fn contact(&self) -> [f64; 5] {
        let model = self.bench.model;
        let force = model.contact_near(&model.joint.pose(&self.rest.q), &mut Nearby::default()).gradient;
        self.by(&balanced(force * PRIOR[2]), &Six::zeros())
    }

    /// By the model's own contact in place of the second; nothing where there is none.
    pub fn own_contact(&self) -> [f64; 5] {
        let model = self.bench.model;
        if !model.has_second_contact() {
            return [0.0; 5];
        }
        let pose = model.joint.pose(&self.rest.q);
        let second = model.contact_near(&pose, &mut Nearby::default()).gradient;
        self.by(&balanced(model.contact.evaluate(&pose).gradient - second), &Six::zeros())
    }

    /// By each load: VV, IE [N mm], ML, AP, SI [N].
    pub fn loads(&self) -> [[f64; 5]; 5] {
        FREE.map(|j| {
            let mut miss = Six::zeros();
            miss[j] = -1.0;
            self.by(&miss, &Six::zeros())
        })
    }

    /// By each end of each fibre moved along the axes [per mm].
    pub fn attachments(&self) -> Vec<[f64; 5]> {
        let model = self.bench.model;
        let here = self.bench.place.situation(model, self.trial, &self.trial.load, &self.rest.q);
        let mut out = Vec::with_capacity(6 * model.fibres.len());
        for fibre in &model.fibres {
            for k in 0..6 {
                let mut ends = [nalgebra::Vector3::zeros(); 2];
                let h = 0.05;
                ends[k / 3][k % 3] = h;
                let pull = |s: f64| {
                    let moved = crate::effect::moved_fibre(fibre, &(ends[0] * s), &(ends[1] * s));
                    crate::effect::fibre_pull(&here, &moved)
                };
                out.push(self.by(&balanced((pull(-1.0) - pull(1.0)) / (2.0 * h)), &Six::zeros()));
            }
        }
        out
    }

    /// By the scaled parameters of a candidate at `scaled`; zero where it does not act.
    pub fn candidate(&self, candidate: &Candidate, scaled: &[f64], acts: bool) -> Vec<[f64; 5]> {
        if !acts {
            return vec![[0.0; 5]; candidate.size()];
        }
        let (trial, q) = (self.trial, &self.rest.q);
        let here = self.bench.place.situation(self.bench.model, trial, &trial.load, q);
        let gs = self.bench.model.joint.grood_suntay(q);
        (0..candidate.size())
            .map(|k| {
                let flat = candidate.active(scaled).has_no_slope_at_zero() && scaled[k] < 0.3;
                let h = if flat { 1.0 } else { 1e-3 };
                let at = |s: f64| {
                    let mut moved = scaled.to_vec();
                    moved[k] += s * h;
                    candidate.active(&moved)
                };
                let (up, down) = (at(1.0), at(if flat { 0.0 } else { -1.0 }));
                let width = if flat { h } else { 2.0 * h };
                if up.has_reading() {
                    let place = self.bench.place;
                    let direct = (up.read(&gs, trial, place) - down.read(&gs, trial, place)) / width;
                    let mut miss = Six::zeros();
                    miss[0] = direct[0];
                    self.by(&miss, &direct)
                } else {
                    let push = (up.force(&here) - down.force(&here)) / width;
                    self.by(&balanced(-push), &Six::zeros())
                }
            })
            .collect()
    }
}

/// A change of the generalised forces alone: read flexion stays.
fn balanced(mut miss: Six) -> Six {
    miss[0] = 0.0;
    miss
}

/// The largest fraction of rests without balance that a diagnosis bears.
pub const UNBALANCED: f64 = 0.2;

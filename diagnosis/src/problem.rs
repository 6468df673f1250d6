//! The question: a model, trials, and what may differ; predictions and their derivatives at any answer.
//!
//! Unknowns stand in units of their prior: the nuisance parameters of the knee ([`crate::problem::nuisance`]), then the parameters of the effects.

pub(crate) mod astray;
pub mod covariance;
pub mod jacobian;
pub mod noise;
pub mod nuisance;
pub mod outlier;
mod rests;
pub mod rim;
pub mod trial;

use crate::effect::bench::Bench;
use crate::effect::candidate::{Candidate, Scope, sized};
use crate::effect::catalogue::Catalogue;
use crate::effect::ways::walked;
use crate::effect::{Active, Place};
use crate::error::DiagnosisError;
use crate::problem::jacobian::Jacobian;
use crate::problem::nuisance::Nuisances;
use crate::problem::rests::Knee;
pub use crate::problem::rests::{Begin, Linear};
use crate::problem::trial::{NoiseScale, PER_UNIT, Source, at_row, row_of, trials};
use calibration::design::Design;
use calibration::options::CalibrateOptions;
use inference::knee::Models;
use inference::trial::Trial;
use nalgebra::DMatrix;
use rayon::prelude::*;
use sim::Model;
use sim::coordinate::{Coordinate, FE, FREE, Free, Six};
use sim::equilibrium::{Equilibrium, Start};
use sim::model::BundleParameters;
use sim::names::is_of;
use sim::spec::ModelSpec;
use std::borrow::Cow;

/// Sum of squares, in noises, up to which a trial's rest is near enough to what was measured that no other is looked for.
const NEAR: f64 = 16.0;
/// Sum of squares, in noises, from which a trial's rest is taken for lost: nothing that scatters takes a knee that stays where it is six noises away.
const LOST: f64 = 36.0;
/// The same where the model fits so little of the data that branches are not the matter: there rests count as they are, as far as they can be told.
const FAR: f64 = 400.0;
/// Most trials, as a share, that may be lost beside recalibrated ligaments for that [-].
const MOST_LOST: f64 = 0.2;

/// A model, data and a catalogue.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The model as assembled.
    assembled: Model,
    /// The model where it stands, in the frames of all data sets.
    pub model: Model,
    /// The same in the frames of each.
    pub models: Models,
    /// Frames.
    pub place: Place,
    /// Ligament unknowns.
    pub design: Design,
    /// All that is unknown of the knee itself.
    pub nuisance: Nuisances,
    /// Ligament parameters of the model that was given, whatever the model was moved to since.
    pub given: Vec<BundleParameters>,
    /// Names of the data sets.
    pub sources: Vec<String>,
    /// Which of them were measured before what is asked about.
    pub before: Vec<bool>,
    /// Standard deviation of a compartment's cartilage where the knee was built from raw data; 0 of a deck, whose contact the floor covers [mm].
    pub cartilage_mm: f64,
    /// Measurement noise of a reading whose file gives none: VV, IE [deg], ML, AP, SI [mm].
    pub usual_noise: Free<f64>,
    /// Measurement noise as the data have it; empty until it was asked for.
    pub noise: Vec<NoiseScale>,
    /// What its own unknowns would take up.
    pub absorbed: Vec<TakenUp>,
    /// Trials of all of them.
    pub trials: Vec<Trial>,
    /// Names of those that were left out, since the knee lies out of its joint there.
    pub astray: Vec<String>,
    /// What may be named.
    pub catalogue: Catalogue,
    /// Effects the model has already, with the scope of each.
    pub present: Vec<(Active, Scope)>,
    /// The pose next to each trial's measured one, where the chain reaches it: a start on the branch that the knee took.
    held: Vec<Option<Equilibrium>>,
    /// From where on rests are taken for lost.
    lost: Lost,
}

/// An effect that the unknowns of a built knee would take up.
#[derive(Clone, Debug)]
pub struct TakenUp {
    /// The effect with its variant and scope.
    pub candidate: Candidate,
    /// By what.
    pub by: &'static str,
}

/// From where on a trial's rest is taken for lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lost {
    /// From [`LOST`] on; there other rests are looked for.
    Near,
    /// From [`FAR`] on.
    Far,
    /// Where a hypothesis fits little, from [`FAR`] on, and no other rests are looked for; from [`LOST`] on elsewhere.
    FarWhereLittleFits,
}

impl Problem {
    /// Sets the question up and finds the unloaded pose of every trial. Ranges, priors, frames and the usual noise are those of the knee's calibration.
    ///
    /// Errors: what the data or the model lack.
    pub fn new(
        model: &Model,
        spec: &ModelSpec,
        sources: &[Source],
        catalogue: &Catalogue,
        calibrate: &CalibrateOptions,
    ) -> Result<Problem, DiagnosisError> {
        let design = Design::of_model(spec)?.with_ranges(&calibrate.ranges)?.separated(spec);
        let place = Place { femur: spec.frames.femur, tibia: spec.frames.tibia };
        let sources_of: Vec<String> = sources.iter().map(|s| s.name.clone()).collect();
        let nuisance = Nuisances::new(spec, &design, &sources_of, calibrate);
        // where the model brings a second contact, the diagnosis works with that one
        let assembled = model.with_second_share(1.0)?;
        let stated = spec.uncertainty.as_ref().filter(|_| nuisance.are_of_a_built_knee());
        let cartilage_mm = stated.map_or(0.0, |u| u.cartilage_mm);
        let usual_noise = calibrate.targets.noise;
        let trials = trials(sources, &usual_noise)?;
        trials.iter().try_for_each(|t| model.in_trial(&t.record).map(drop))?;
        let models = nuisance.apply(&assembled, &vec![0.0; nuisance.len()])?.as_cut(&trials)?;
        let mut problem = Problem {
            model: models.shared().clone(),
            models,
            assembled,
            place,
            design,
            nuisance,
            given: model.parameters(),
            before: sources.iter().map(|s| s.before).collect(),
            sources: sources_of,
            cartilage_mm,
            usual_noise,
            noise: vec![],
            absorbed: vec![],
            trials,
            astray: vec![],
            catalogue: catalogue.clone(),
            present: vec![],
            held: vec![],
            lost: Lost::Near,
        };
        problem.unload();
        problem.hold();
        Ok(problem)
    }

    /// The same question about the model at other values of its nuisance parameters; their priors stay where they are.
    ///
    /// Errors: values out of the model's range.
    pub fn centred_at(mut self, unknowns: &[f64]) -> Result<Problem, DiagnosisError> {
        self.models = self.models_at(unknowns)?;
        self.model = self.models.shared().clone();
        let frames = self.nuisance.frames_at(unknowns)?;
        self.place = Place { femur: frames.femur, tibia: frames.tibia };
        self.nuisance = self.nuisance.centred_at(unknowns);
        self.unload();
        self.hold();
        Ok(self)
    }

    /// The same question with the noise that the data clearly have in place of the stated one.
    pub fn with_noise(mut self, scales: Vec<NoiseScale>) -> Problem {
        for n in scales.iter().filter(|n| n.taken) {
            let place = (self.sources.iter().position(|s| *s == n.source), Coordinate::named(&n.coordinate));
            let (Some(source), Some(c)) = place else { continue };
            self.trials.iter_mut().filter(|t| t.source == Some(source)).for_each(|t| t.sd[c] *= n.inferred / n.stated);
        }
        self.noise = scales;
        self
    }

    /// Finds the unloaded pose of every trial.
    fn unload(&mut self) {
        let compressed: Vec<Trial> = self.trials.iter().map(Trial::compressed).collect();
        let neutral = walked(&compressed, |i| self.plain(&compressed[i]));
        self.trials.iter_mut().zip(neutral).for_each(|(t, at)| t.unloaded = at.start());
    }

    /// The same question of a model that has effects already.
    pub fn with_present(mut self, present: Vec<(Active, Scope)>) -> Problem {
        self.present = present;
        self.hold();
        self
    }

    /// Grood-Suntay coordinates that a trial read [rad, mm]; what was not measured is taken from the unloaded pose.
    fn measured(&self, trial: &Trial) -> Six {
        let mut gs = self.models.of(trial.source).joint.grood_suntay(&trial.unloaded.q);
        gs[FE] = trial.flexion();
        for (c, value) in trial.record.measured.each() {
            if let Some(v) = value {
                gs[c] = v * PER_UNIT[c];
            }
        }
        gs
    }

    /// Finds the poses next to the measured ones.
    fn hold(&mut self) {
        let near = |t: &Trial| {
            let effects = self.effects_in(t.source, &[], &[]);
            let bench = Bench { effects: &effects, ..self.plain(t) };
            let measured = self.measured(t);
            bench.model.joint.coordinates(&measured).ok().map(|q| bench.held(t, &measured, &Start::at(q)))
        };
        self.held = self.trials.par_iter().map(near).collect();
    }

    /// Coordinates of the poses next to the measured ones.
    pub(crate) fn held_coordinates(&self) -> Vec<Option<Six>> {
        self.held.iter().map(|held| held.as_ref().map(|rest| rest.q)).collect()
    }

    /// Keeps those trials that stay.
    pub(crate) fn keep(&mut self, stay: &[bool]) {
        let mut of = stay.iter();
        self.trials.retain(|_| of.next().is_none_or(|s| *s));
        let mut of = stay.iter();
        self.held.retain(|_| of.next().is_none_or(|s| *s));
    }

    /// Predictions and derivatives of the model as given, linear about the measured poses instead of its own: an effect that moves the knee far is
    /// seen there as a force, undistorted.
    ///
    /// Errors: a model that cannot be evaluated.
    pub fn linear_held(&self) -> Result<Linear, DiagnosisError> {
        let unknowns = vec![0.0; self.nuisances()];
        let own = |i: usize| self.plain(&self.trials[i]).neutral(&self.trials[i]);
        let rests: Vec<Equilibrium> =
            (0..self.trials.len()).into_par_iter().map(|i| self.held[i].clone().unwrap_or_else(|| own(i))).collect();
        let mut linear = self.linear_at(&[], &unknowns, rests)?;
        for (i, rest) in linear.rests.iter().enumerate() {
            let effects = self.effects_in(self.trials[i].source, &[], &unknowns);
            let bench = Bench { effects: &effects, ..self.plain(&self.trials[i]) };
            let moved = Jacobian::new(bench, &self.trials[i], rest).by(&rest.miss, &Six::zeros());
            FREE.into_iter().for_each(|c| linear.value[row_of(i, c)] += moved[c]);
        }
        Ok(linear)
    }

    /// Number of nuisance parameters.
    pub fn nuisances(&self) -> usize {
        self.nuisance.len()
    }

    /// Prior means of the unknowns of a hypothesis, in units of their widths.
    pub fn means(&self, unknowns: usize) -> Vec<f64> {
        let mut out = self.nuisance.mean.clone();
        out.resize(unknowns, 0.0);
        out
    }

    /// Name of a trial's data set.
    pub fn source_of(&self, trial: &Trial) -> &str {
        trial.source.map_or("", |s| &self.sources[s])
    }

    /// Whether what has a scope acts in a data set: not in one that was measured before.
    pub fn acts(&self, scope: Scope, source: Option<usize>) -> bool {
        source.is_none_or(|s| !self.before[s]) && scope.covers(source)
    }

    /// Data sets in which effects may act, those that were not measured before.
    pub fn asked(&self) -> Vec<usize> {
        (0..self.sources.len()).filter(|s| !self.before[*s]).collect()
    }

    /// Every testable effect, variant and scope.
    pub fn candidates(&self) -> Vec<Candidate> {
        let mut scopes: Vec<Scope> = vec![Scope::Both];
        let asked = self.asked();
        if asked.len() > 1 {
            scopes.extend(asked.into_iter().map(Scope::Only));
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
        out.retain(|c| self.absorbed.iter().all(|t| t.candidate != *c));
        out.retain(|c| c.variant_name().is_none_or(|structure| !self.was_cut(&structure)));
        out
    }

    /// Whether a structure was cut before all that the question is about, as the files say: nothing can be missing of it.
    pub fn was_cut(&self, structure: &str) -> bool {
        let bundles = self.model.bundle_names();
        let own: Vec<usize> = (0..bundles.len()).filter(|&b| is_of(&bundles[b], structure)).collect();
        let is_cut = |source: usize| own.iter().all(|&b| self.models.of(Some(source)).is_removed(b));
        !own.is_empty() && self.asked().into_iter().all(is_cut)
    }

    /// The model with other values of its nuisance parameters, each data set's as its knee was cut.
    ///
    /// Errors: values out of the model's range.
    pub fn models_at(&self, unknowns: &[f64]) -> Result<Models, DiagnosisError> {
        Ok(self.nuisance.apply(&self.assembled, unknowns)?.as_cut(&self.trials)?)
    }

    /// The model where it stands, as a trial is put to it without effects.
    fn plain(&self, trial: &Trial) -> Bench<'_> {
        Bench { model: self.models.of(trial.source), effects: &[], place: &self.place }
    }

    /// The effects at work in a data set: those the model has, then the hypothesis'.
    pub fn effects_in(&self, source: Option<usize>, hypothesis: &[Candidate], unknowns: &[f64]) -> Vec<Active> {
        let mut out: Vec<Active> =
            self.present.iter().filter(|(_, s)| s.covers(source)).map(|(a, _)| a.clone()).collect();
        let values = unknowns.get(self.nuisances()..).unwrap_or_default();
        let acting = sized(hypothesis, values).filter(|(c, _)| self.acts(c.scope, source));
        out.extend(acting.map(|(c, values)| c.active(values)));
        out
    }

    /// Trials with the unloaded poses of a model's ligaments, where a hypothesis or the model has an effect that departs from them.
    pub fn unloaded_at<'a>(&self, trials: &'a [Trial], models: &Models, hypothesis: &[Candidate]) -> Cow<'a, [Trial]> {
        let departs = self.present.iter().any(|(a, _)| a.is_about_unloaded())
            || hypothesis.iter().any(|c| c.active(&vec![0.0; c.size()]).is_about_unloaded());
        if !departs {
            return Cow::Borrowed(trials);
        }
        let moved = |(t, at): (&Trial, Start)| Trial { unloaded: at, ..t.clone() };
        Cow::Owned(trials.iter().zip(self.neutrals(trials, models)).map(moved).collect())
    }

    /// Unloaded poses of a model's ligaments, next to those of the trials; where it finds none, those.
    pub fn neutrals(&self, trials: &[Trial], models: &Models) -> Vec<Start> {
        let moved = |t: &Trial| {
            let plain = Bench { model: models.of(t.source), effects: &[], place: &self.place };
            let rest = plain.neutral_near(t);
            if rest.balanced { rest.start() } else { t.unloaded.clone() }
        };
        trials.par_iter().map(moved).collect()
    }

    fn knee(&self, hypothesis: &[Candidate], unknowns: &[f64]) -> Result<Knee<'_>, DiagnosisError> {
        let models = self.models_at(unknowns)?;
        let effects = (0..self.sources.len()).map(|s| self.effects_in(Some(s), hypothesis, unknowns)).collect();
        let trials = self.unloaded_at(&self.trials, &models, hypothesis);
        Ok(Knee { models, effects, trials, place: &self.place })
    }

    /// Rests of all trials at an answer; from nearby poses, or the whole way where `starts` is empty.
    pub fn rests(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        starts: &[Start],
    ) -> Result<Vec<Equilibrium>, DiagnosisError> {
        let knee = self.knee(hypothesis, unknowns)?;
        Ok(knee.rests(starts))
    }

    /// Rests from nearby poses; where that ends far from the measurement, also from the measured pose, and the nearer of the two: a loaded knee
    /// has several stable branches, and the one it took is not for the parameters to explain.
    pub fn nearer(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        starts: &[Start],
    ) -> Result<Vec<Equilibrium>, DiagnosisError> {
        Ok(self.nearer_in(&self.knee(hypothesis, unknowns)?, Begin::At(starts)).0)
    }

    /// The rests, and for which trials one near the measured pose was sought in vain.
    fn nearer_in(&self, knee: &Knee, begin: Begin) -> (Vec<Equilibrium>, Vec<bool>) {
        let first = knee.rests(&begin.starts());
        // where a hypothesis explains little of data that the model fits little of, rests count as they are: looking for others would be most of the work
        let as_they_are = self.lost == Lost::FarWhereLittleFits && self.fits_little(&first);
        let lost = if as_they_are || self.lost == Lost::Far { FAR } else { LOST };
        let near = if as_they_are { FAR } else { NEAR };
        let nearer = |(i, first): (usize, Equilibrium)| {
            let quickly = as_they_are || begin.is_in_vain(i);
            if self.off(i, &first) > near { self.next_to(i, knee, first, (lost, quickly)) } else { (first, false) }
        };
        first.into_par_iter().enumerate().map(nearer).unzip()
    }

    /// The rest of trial `i` next to the measured pose, where that is much nearer than `first`; a knee that left the joint altogether may find back from the
    /// measured pose, let go slowly, where there is time for that. With it whether that was sought in vain.
    fn next_to(&self, i: usize, knee: &Knee, first: Equilibrium, (lost, quickly): (f64, bool)) -> (Equilibrium, bool) {
        let (trial, miss) = (&knee.trials[i], |rest: &Equilibrium| self.off(i, rest));
        let bench = knee.bench(trial);
        let nearer = |a: Equilibrium, b: Equilibrium| {
            if (b.balanced || !a.balanced) && miss(&b) < 0.5 * miss(&a) { b } else { a }
        };
        let Some(held) = &self.held[i] else { return (first, false) };
        let second = nearer(first, bench.settle(trial, &held.start()));
        if miss(&second) <= lost {
            return (second, false);
        }
        if !quickly {
            let third = nearer(second, bench.released(trial, &self.measured(trial), &held.start()));
            if miss(&third) <= lost {
                return (third, false);
            }
        }
        (self.imagined(bench, trial, held), true)
    }

    /// How far a rest of trial `i` is from what was measured: sum of squares in noises, half a degree or millimetre added to each.
    fn off(&self, i: usize, rest: &Equilibrium) -> f64 {
        let (there, t) = (reading(rest), &self.trials[i]);
        FREE.into_iter().map(|c| t.record.measured[c].map_or(0.0, |m| ((there[c] - m) / (t.sd[c] + 0.5)).powi(2))).sum()
    }

    /// Whether trials count as lost only far from what was measured.
    pub fn with_far_rests(mut self, far: bool) -> Problem {
        self.lost = if far { Lost::Far } else { Lost::Near };
        self
    }

    /// Rests count as they are wherever a hypothesis leaves so many of them lost, and only there.
    pub fn with_rests_as_they_are(mut self) -> Problem {
        self.lost = Lost::FarWhereLittleFits;
        self
    }

    /// Whether so many of these rests are lost that the model fits little.
    pub fn fits_little(&self, rests: &[Equilibrium]) -> bool {
        let lost = rests.iter().enumerate().filter(|(i, r)| self.off(*i, r) > LOST).count();
        lost as f64 > MOST_LOST * rests.len() as f64
    }

    /// Where a trial that finds no rest near the measured pose would rest if the knee were as stiff there as the model as given is at that pose, and no less stiff than it takes to stay: what
    /// is out of balance there counts, no matter how far it would throw the knee.
    fn imagined(&self, bench: Bench, trial: &Trial, held: &Equilibrium) -> Equilibrium {
        let tangent = bench.stiffened(trial, &held.tangent);
        let mut rest = Equilibrium { tangent, ..bench.held(trial, &self.measured(trial), &held.start()) };
        let moved = Jacobian::new(bench, trial, &rest).by(&rest.miss, &Six::zeros());
        FREE.iter().zip(moved).zip(PER_UNIT).for_each(|((&j, m), unit)| rest.observed[j] += m * unit);
        rest
    }

    /// Predictions and derivatives by all unknowns of a hypothesis.
    pub fn linear(&self, hypothesis: &[Candidate], unknowns: &[f64], begin: Begin) -> Result<Linear, DiagnosisError> {
        let knee = self.knee(hypothesis, unknowns)?;
        let (rests, in_vain) = self.nearer_in(&knee, begin);
        Ok(Linear { in_vain, ..self.linear_in(&knee, hypothesis, unknowns, rests)? })
    }

    /// [`Problem::linear`] where the rests are known.
    pub fn linear_at(
        &self,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        rests: Vec<Equilibrium>,
    ) -> Result<Linear, DiagnosisError> {
        self.linear_in(&self.knee(hypothesis, unknowns)?, hypothesis, unknowns, rests)
    }

    fn linear_in(
        &self,
        knee: &Knee,
        hypothesis: &[Candidate],
        unknowns: &[f64],
        rests: Vec<Equilibrium>,
    ) -> Result<Linear, DiagnosisError> {
        let joints = self.nuisance.joints(unknowns, self.sources.len());
        let by_unknowns = |(trial, rest): (&Trial, &Equilibrium)| {
            let jacobian = Jacobian::new(knee.bench(trial), trial, rest);
            let mut columns = jacobian.nuisances(&self.nuisance, unknowns, &joints)?;
            let mut at = self.nuisances();
            for candidate in hypothesis {
                let scaled = &unknowns[at..at + candidate.size()];
                at += candidate.size();
                columns.extend(jacobian.candidate(candidate, scaled, self.acts(candidate.scope, trial.source)));
            }
            Ok(columns)
        };
        let rows: Vec<Vec<Free<f64>>> =
            knee.trials.par_iter().zip(&rests).map(by_unknowns).collect::<Result<_, DiagnosisError>>()?;
        let jacobian = DMatrix::from_fn(5 * rows.len(), unknowns.len(), |r, c| {
            let (i, d) = at_row(r);
            rows[i][c][d]
        });
        let value = rests.iter().flat_map(reading).collect();
        Ok(Linear { value, jacobian, in_vain: vec![false; rests.len()], rests })
    }
}

/// Readings VV, IE [deg], ML, AP, SI [mm] of a rest.
pub fn reading(rest: &Equilibrium) -> Free<f64> {
    Free::from_fn(|c| rest.observed[c] / PER_UNIT[c])
}

/// The largest fraction of rests without balance that a diagnosis bears.
pub const UNBALANCED: f64 = 0.2;

//! The knee of a diagnosis as it gives way: under effects, read with their errors, beside an unloaded pose that effects depart from.
//!
//! What a parameter of the knee puts out of balance is said in [`inference::jacobian`], as for a calibration. Here are how a trial's reading answers, and
//! the derivatives by what a calibration does not have: effects, and what scatters.

use crate::effect::Active;
use crate::effect::bench::Bench;
use crate::effect::candidate::Candidate;
use crate::problem::nuisance::Nuisances;
use crate::problem::trial::PER_UNIT;
use inference::frames::{FrameChange, FrameSteps};
use inference::jacobian::{Rest, columns};
use inference::knee::Quantity;
use inference::trial::Trial;
use nalgebra::{Matrix6, Vector3};
use sim::Model;
use sim::SimError;
use sim::contact::Nearby;
use sim::coordinate::{FE, Free, SI, Six};
use sim::equilibrium::{Equilibrium, Start};
use sim::joint::Joint;
use sim::model::Evaluation;
use sim::sensitivity::{End, Parameter as Number, out_of_balance};
use std::cell::OnceCell;

/// Derivatives of a trial's reading at its rest.
pub struct Jacobian<'a> {
    bench: Bench<'a>,
    trial: &'a Trial,
    rest: &'a Equilibrium,
    /// Of the reading by what is out of balance.
    answer: Option<Matrix6<f64>>,
    /// The model at the rest.
    loaded: At,
    /// What it bears there, once it was asked.
    borne: OnceCell<Six>,
    /// The unloaded pose, where an effect departs from it.
    root: Option<Root>,
}

/// A pose at which something gets out of balance.
pub struct At {
    /// Chain coordinates [rad, mm].
    pub q: Six,
    near: Nearby,
    found: OnceCell<Evaluation>,
}

impl At {
    fn new(start: Start) -> At {
        At { q: start.q, near: start.near, found: OnceCell::new() }
    }

    /// Force on the femur and its moment about the CT's origin, by a model's contact, a pair each [N, N mm]; so much higher up [mm].
    pub fn wrenches_above(&self, model: &Model, by: f64) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let mut q = self.q;
        q[SI] += by;
        model.contact_near(&model.joint.pose(&q), &mut self.near.lists()).wrench
    }
}

/// The unloaded pose that an effect departs from: what moves that pose moves the effect with it.
struct Root {
    at: At,
    /// What is out of balance under load by what is out of balance there.
    lever: Matrix6<f64>,
}

impl Root {
    /// Of a trial at `rest`; none where no effect departs from the unloaded pose or nothing holds the knee in it.
    fn new(bench: &Bench, trial: &Trial, rest: &Equilibrium) -> Option<Root> {
        let departing: Vec<Active> = bench.effects.iter().filter(|e| e.is_about_unloaded()).cloned().collect();
        if departing.is_empty() {
            return None;
        }
        let plain = Bench { effects: &[], ..*bench };
        let unloaded = plain.neutral_near(trial);
        let inverse = unloaded.tangent.try_inverse()?;
        let holds = Bench { effects: &departing, ..*bench }.effects_tangent(trial, &trial.load(), &rest.q);
        let at = At::new(Start { q: trial.unloaded.q, near: unloaded.near });
        Some(Root { at, lever: holds * inverse })
    }
}

impl<'a> Jacobian<'a> {
    /// Prepares the derivatives of `trial` at `rest`.
    pub fn new(bench: Bench<'a>, trial: &'a Trial, rest: &'a Equilibrium) -> Jacobian<'a> {
        let reading = bench.observe_derivative(trial, &rest.q);
        let answer = rest.tangent.try_inverse().map(|inverse| reading * inverse);
        let loaded = At::new(rest.start());
        Jacobian { bench, trial, rest, answer, loaded, borne: OnceCell::new(), root: Root::new(&bench, trial, rest) }
    }

    /// What the model does at one of its poses, under the quadriceps.
    pub fn at<'b>(&self, at: &'b At) -> &'b Evaluation {
        at.found.get_or_init(|| self.bench.pulled(self.trial).evaluate_near(&at.q, &mut at.near.lists()))
    }

    /// The model at the rest.
    pub fn loaded(&self) -> &Evaluation {
        self.at(&self.loaded)
    }

    /// The generalised force that the model bears at the rest, without the effects [N mm, N].
    fn borne(&self) -> &Six {
        let effects = || self.bench.effects_at(self.trial, &self.trial.load(), &self.rest.q);
        self.borne.get_or_init(|| self.loaded().gradient - effects())
    }

    /// Change of the reading [deg, mm] by changes of the knee itself that put `out_of_balance` what it tells at a pose: under load, and unloaded where an
    /// effect departs from there.
    pub fn of_the_knee(&self, out_of_balance: impl Fn(&At) -> Vec<Six>) -> Vec<Free<f64>> {
        let loaded = out_of_balance(&self.loaded);
        let unloaded = self.root.as_ref().map(|root| (out_of_balance(&root.at), root.lever));
        let by = |k: usize, miss: Six| {
            let moved = unloaded.as_ref().map_or(Six::zeros(), |(there, lever)| lever * balanced(there[k]));
            self.by(&balanced(miss - moved), &Six::zeros())
        };
        loaded.into_iter().enumerate().map(|(k, miss)| by(k, miss)).collect()
    }

    /// Change of the reading [deg, mm] when the balance changes by `miss` (flexion's row: the read flexion) and the reading itself by `direct`.
    /// A knee that nothing holds has no tangent, so its readings say nothing of any parameter: 0 for all.
    pub fn by(&self, miss: &Six, direct: &Six) -> Free<f64> {
        let Some(answer) = &self.answer else { return Free::all(0.0) };
        let moved = direct - answer * miss;
        Free::from_fn(|c| moved[c] / PER_UNIT[c])
    }

    /// By the nuisance parameters at some values; `joints` are the steps of the frames of each data set, then of all.
    ///
    /// Errors: a parameter that is no unknown of a diagnosis.
    pub(crate) fn nuisances(
        &self,
        of: &Nuisances,
        unknowns: &[f64],
        joints: &[FrameSteps],
    ) -> Result<Vec<Free<f64>>, SimError> {
        let values: Vec<(f64, f64)> = unknowns.iter().enumerate().take(of.len()).map(|(k, x)| of.at(k, *x)).collect();
        let asked: Vec<(&Quantity, f64)> =
            of.list.iter().map(|p| &p.quantity).zip(values.iter().map(|v| v.0)).collect();
        let steps = &joints[self.trial.source.unwrap_or(joints.len() - 1)];
        let by = columns(self, (self.trial, steps), &asked)?;
        Ok(by.into_iter().zip(&values).map(|(column, value)| column.map(|x| x * value.1)).collect())
    }

    /// What some numbers of the model, all by one unit, put out of balance at a pose [N mm, N]. What effects take from a bundle its numbers do not move:
    /// a torn ligament's strain, stiffness and sites are felt nowhere. No effect acts on the unloaded knee.
    fn by_numbers_at(&self, at: &At, numbers: &[Number]) -> Six {
        let model = self.bench.model;
        let is_loaded = std::ptr::eq(at, &self.loaded);
        let one = |n: &Number| {
            let left = if is_loaded { bundle_of(model, *n).map_or(1.0, |b| self.bench.left(b)) } else { 1.0 };
            out_of_balance(model, self.at(at), *n).expect("a parameter is of bundles that the model has") * left
        };
        numbers.iter().map(one).sum()
    }

    /// By the model's own contact in place of the second; nothing where there is none.
    pub fn own_contact(&self) -> Free<f64> {
        let model = self.bench.model;
        if !model.has_second_contact() {
            return Free::all(0.0);
        }
        let differs = |at: &At| {
            let there = self.at(at);
            model.contact.evaluate(&there.pose).gradient - there.contact.gradient
        };
        self.of_the_knee(|at| vec![differs(at)])[0]
    }

    /// By each load: VV, IE [N mm], ML, AP, SI [N].
    pub fn loads(&self) -> Free<Free<f64>> {
        Free::from_fn(|j| {
            let mut miss = Six::zeros();
            miss[j] = -1.0;
            self.by(&miss, &Six::zeros())
        })
    }

    /// By each end of each fibre moved along the axes [per mm].
    pub fn attachments(&self) -> Vec<Free<f64>> {
        let ends = [End::Femur, End::Tibia].into_iter().flat_map(|end| (0..3).map(move |axis| (end, axis)));
        let of = |fibre: usize| ends.clone().map(move |(end, axis)| Number::Attachment(fibre, end, axis));
        let all: Vec<Number> = (0..self.bench.model.fibres.len()).flat_map(of).collect();
        self.of_the_knee(|at| all.iter().map(|n| self.by_numbers_at(at, &[*n])).collect())
    }

    /// By the scaled parameters of a candidate at `scaled`; zero where it does not act.
    pub fn candidate(&self, candidate: &Candidate, scaled: &[f64], acts: bool) -> Vec<Free<f64>> {
        if !acts {
            return vec![Free::all(0.0); candidate.size()];
        }
        let (trial, q) = (self.trial, &self.rest.q);
        let here = self.bench.place.situation(self.bench.model, trial, &trial.load(), q);
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
                // beyond the whole nothing changes
                let is_whole = candidate.effect.parameter[k]
                    .whole
                    .is_some_and(|w| candidate.effect.parameter[k].sd * (scaled[k] + h) > w);
                let (up, down) = (at(if is_whole { 0.0 } else { 1.0 }), at(if flat { 0.0 } else { -1.0 }));
                let width = if flat || is_whole { h } else { 2.0 * h };
                if up.has_reading() {
                    let direct = (up.read(&gs, trial) - down.read(&gs, trial)) / width;
                    let mut miss = Six::zeros();
                    miss[FE] = direct[FE];
                    self.by(&miss, &direct)
                } else {
                    let push = (up.force(&here) - down.force(&here)) / width;
                    self.by(&balanced(-push), &Six::zeros())
                }
            })
            .collect()
    }
}

impl Rest for Jacobian<'_> {
    type Column = Free<f64>;

    fn still(&self) -> Free<f64> {
        Free::all(0.0)
    }

    fn by_numbers(&self, of: &[(Vec<Number>, f64)]) -> Result<Vec<Free<f64>>, SimError> {
        Ok(self
            .of_the_knee(|at| of.iter().map(|(numbers, factor)| self.by_numbers_at(at, numbers) * *factor).collect()))
    }

    fn by_force(&self, force: &Six) -> Free<f64> {
        self.by(&balanced(-force), &Six::zeros())
    }

    /// What is read, and the generalised forces of the same wrench, are of other axes then.
    fn by_frame(&self, steps: &[Joint; 2]) -> Result<Free<f64>, SimError> {
        let read = |gs: &Six| self.bench.effects.iter().fold(*gs, |gs, e| e.read(&gs, self.trial));
        let change = FrameChange::of(steps, &self.loaded().pose, self.borne(), &read);
        // a pose that the chain does not reach is out of the joint: what is read there says nothing of frames
        Ok(change.map_or(self.still(), |FrameChange { read, mut force, .. }| {
            force[FE] = read[FE];
            self.by(&force, &read)
        }))
    }

    fn evaluation(&self) -> &Evaluation {
        self.loaded()
    }

    fn by_thickness(&self) -> Result<Six, SimError> {
        Err(SimError::Input("a diagnosis has the thickness of cartilage in its scatter, not among its unknowns".into()))
    }
}

/// The bundle that a number of the model is of; none where it is of no bundle.
fn bundle_of(model: &Model, number: Number) -> Option<usize> {
    match number {
        Number::ReferenceStrain(b) | Number::Stiffness(b) | Number::Site(b, ..) => Some(b),
        Number::Attachment(fibre, ..) => Some(model.fibres[fibre].bundle),
        Number::Load(_) | Number::Flexion | Number::ContactScale => None,
    }
}

/// A change of the generalised forces alone: read flexion stays.
fn balanced(mut miss: Six) -> Six {
    miss[FE] = 0.0;
    miss
}

//! The knee of a calibration as it gives way: a model alone, at the answer to a trial.

use super::{Answer, Quantity, Trials};
use crate::frames::{FrameChange, FrameSteps};
use crate::jacobian::{Rest, columns, pressed};
use crate::trial::Trial;
use nalgebra::DMatrix;
use sim::Model;
use sim::SimError;
use sim::contact::Nearby;
use sim::coordinate::{FREE, Free, Six};
use sim::joint::Joint;
use sim::model::Evaluation;
use sim::sensitivity::{Parameter as Number, Sensitivities, sensitivities};
use sim::spec::ContactSpec;

/// Step of the derivative by cartilage thickness [mm].
const CARTILAGE_STEP: f64 = 0.02;

/// Derivatives of an answer, a column a parameter, per unit of its value.
pub(super) struct Jacobian {
    /// Of VV, IE [deg], ML, AP, SI [mm]: 5 rows.
    pub(super) predicted: DMatrix<f64>,
    /// Of the bundle forces [N]: a row a bundle.
    pub(super) forces_n: DMatrix<f64>,
}

/// What an answer changes by, one parameter's column.
#[derive(Clone, Debug)]
struct Column {
    predicted: Free<f64>,
    forces_n: Vec<f64>,
    coordinates: Six,
}

/// A model alone at the answer to a trial.
struct Alone<'a> {
    model: &'a Model,
    found: &'a sim::trials::Answer,
    /// The law of its contact as specified.
    law: &'a ContactSpec,
    near: &'a Nearby,
    /// By the five loads, then by flexion.
    gives: Sensitivities,
}

impl<'a> Alone<'a> {
    fn new(
        model: &'a Model,
        found: &'a sim::trials::Answer,
        law: &'a ContactSpec,
        near: &'a Nearby,
    ) -> Result<Alone<'a>, SimError> {
        let asked: Vec<Number> = FREE.map(Number::Load).into_iter().chain([Number::Flexion]).collect();
        Ok(Alone { model, found, law, near, gives: sensitivities(model, found, &asked)? })
    }

    /// The column of which these are the parts of the loads [N m, N] and of flexion [deg].
    fn given(&self, load: &Free<f64>, flexion_deg: f64) -> Column {
        let mut out = self.still();
        for (k, l) in load.iter().copied().chain([flexion_deg]).enumerate().filter(|(_, l)| *l != 0.0) {
            out.add(&self.gives, k, l);
        }
        out
    }
}

impl Rest for Alone<'_> {
    type Column = Column;

    fn still(&self) -> Column {
        Column::none(self.model.bundles.len())
    }

    fn by_numbers(&self, of: &[(Vec<Number>, f64)]) -> Result<Vec<Column>, SimError> {
        by_numbers(self.model, self.found, of)
    }

    fn by_force(&self, force: &Six) -> Column {
        self.given(&Free::from_fn(|c| force[c] / c.to_force(1.0)), 0.0)
    }

    fn by_frame(&self, steps: &[Joint; 2]) -> Result<Column, SimError> {
        let at = &self.found.evaluation;
        let out_of_reach = || SimError::Solver("the chain does not reach the pose in frames turned a little".into());
        let change = FrameChange::of(steps, &at.pose, &at.gradient, &|gs| *gs).ok_or_else(out_of_reach)?;
        // the bones turn back to the flexion that was asked for, and to balance
        let load = Free::from_fn(|c| -change.force[c] / c.to_force(1.0));
        let mut out = self.given(&load, -change.flexion.to_degrees());
        FREE.into_iter().for_each(|c| out.predicted[c] += c.to_file(change.read[c]));
        // starts in other frames are found from the place of the bones
        out.coordinates = Six::zeros();
        Ok(out)
    }

    fn evaluation(&self) -> &Evaluation {
        &self.found.evaluation
    }

    fn by_thickness(&self) -> Result<Six, SimError> {
        let law = self.law;
        let now = law.overclosure_mm.first().map_or(0.0, |x| x - self.model.contact.starts_at());
        let shifted: Vec<f64> = law.overclosure_mm.iter().map(|x| x - now - CARTILAGE_STEP).collect();
        let thicker = self.model.contact.with_law(&shifted, &law.pressure_mpa)?;
        let evaluation = &self.found.evaluation;
        let other = thicker.evaluate_near(&evaluation.pose, &mut self.near.lists()).gradient;
        Ok((evaluation.contact.gradient - other) / CARTILAGE_STEP)
    }
}

impl Column {
    fn none(bundles: usize) -> Column {
        Column { predicted: Free::all(0.0), forces_n: vec![0.0; bundles], coordinates: Six::zeros() }
    }

    /// Adds a column of the solver's, times a factor.
    fn add(&mut self, s: &Sensitivities, k: usize, factor: f64) {
        FREE.into_iter().for_each(|c| self.predicted[c] += factor * s.pose[(c.free_index(), k)]);
        self.forces_n.iter_mut().zip(s.forces_n.column(k).iter()).for_each(|(x, d)| *x += factor * d);
        self.coordinates += s.coordinates.column(k) * factor;
    }
}

/// By numbers of a model: each entry's together by one unit, times its factor.
fn by_numbers(model: &Model, found: &sim::trials::Answer, of: &[(Vec<Number>, f64)]) -> Result<Vec<Column>, SimError> {
    let asked: Vec<Number> = of.iter().flat_map(|(numbers, _)| numbers.iter().copied()).collect();
    let s = sensitivities(model, found, &asked)?;
    let mut columns = 0..asked.len();
    let one = |(numbers, factor): &(Vec<Number>, f64)| {
        let mut out = Column::none(model.bundles.len());
        columns.by_ref().take(numbers.len()).for_each(|k| out.add(&s, k, *factor));
        out
    };
    Ok(of.iter().map(one).collect())
}

impl Trials<'_> {
    /// An answer of `model` at values of the parameters, with its derivatives; `steps` are those of the frames of the trial's data set.
    pub(super) fn with_jacobian(
        &self,
        (model, values): (&Model, &[f64]),
        (trial, steps): (&Trial, &FrameSteps),
        found: sim::trials::Answer,
        near: &Nearby,
    ) -> Result<(Answer, Jacobian), SimError> {
        let rest = Alone::new(model, &found, &self.spec.contact, near)?;
        let of: Vec<(&Quantity, f64)> =
            self.parameters.iter().map(|p| &p.quantity).zip(values.iter().copied()).collect();
        let by = columns(&rest, (trial, steps), &of)?;
        let of_loads = &rest.gives.pose;
        let by_load = Free::from_fn(|c| Free::from_fn(|l| of_loads[(c.free_index(), l.free_index())]));
        let (n, pressed) = (by.len(), pressed(&found.evaluation));
        let jacobian = Jacobian {
            predicted: DMatrix::from_fn(FREE.len(), n, |r, k| by[k].predicted.0[r]),
            forces_n: DMatrix::from_fn(model.bundles.len(), n, |b, k| by[k].forces_n[b]),
        };
        let answer = Answer {
            q: found.state.q,
            pressed,
            predicted: found.predicted(),
            forces_n: found.forces_n,
            coordinates: DMatrix::from_fn(Six::zeros().len(), n, |r, k| by[k].coordinates[r]),
            by_load,
            near: near.lists(),
        };
        Ok((answer, jacobian))
    }
}

/// Derivatives by one quantity: of VV, IE [deg], ML, AP, SI [mm], and of the bundle forces [N].
pub type ByOne = (Free<f64>, Vec<f64>);

/// Derivatives of an answer by quantities that are the model's own numbers, at their values, an entry a quantity: the part of [`columns`] that a recipe
/// needs, whose answers come from any solver.
///
/// # Errors
/// A quantity that stands beside the model; one that it does not have; a singular tangent.
pub fn by_the_model(
    model: &Model,
    found: &sim::trials::Answer,
    at: impl Iterator<Item = (Quantity, f64)>,
) -> Result<Vec<ByOne>, SimError> {
    let numbers = |(quantity, x): (Quantity, f64)| {
        let beside = || SimError::Input(format!("{quantity:?} is no number of the model"));
        quantity.numbers(x).ok_or_else(beside)
    };
    let of: Vec<(Vec<Number>, f64)> = at.map(numbers).collect::<Result<_, _>>()?;
    Ok(by_numbers(model, found, &of)?.into_iter().map(|c| (c.predicted, c.forces_n)).collect())
}

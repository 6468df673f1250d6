//! Descent on the cost itself, which is a sum of percentiles and so has kinks: at each point the predictions are taken as linear in the
//! variables, the cost of that linear model is minimised in a trust region, and the step kept if the true cost falls
//! (composite non-smooth descent [fletcher1982]).

use crate::cost::CostFunction;
use crate::experiment::{Experiment, Linear};
use crate::levenberg::box_step;
use nalgebra::{DMatrix, DVector};
use sim::coordinate::Free;

/// How far and how often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// First radius, in widths of the ranges [-].
    pub radius: f64,
    /// Radius at which it has converged [-].
    pub least: f64,
    /// Most evaluations.
    pub evaluations: usize,
}

/// Where a descent ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The point, unit coordinates.
    pub point: Vec<f64>,
    /// The cost there.
    pub cost: f64,
    /// The cost of each evaluation, in order.
    pub history: Vec<f64>,
}

/// Descends on the cost from a point of the unit box; `None` when the start has no answer.
pub fn descend(experiment: &Experiment, cost: &CostFunction, start: &[f64], trust: Trust) -> Option<Found> {
    let mut point = start.to_vec();
    let mut here = experiment.linear(&point)?;
    let mut value = cost.cost(&rows(&here.value)).value;
    let (mut radius, mut history) = (trust.radius, vec![value]);
    while history.len() < trust.evaluations && radius > trust.least {
        let (step, promised) = least_of_linear(cost, &here, &point, radius);
        if promised <= 1e-6 * value {
            radius *= 0.3;
            continue;
        }
        let tried: Vec<f64> = point.iter().zip(step.iter()).map(|(x, d)| (x + d).clamp(0.0, 1.0)).collect();
        let next = experiment.linear(&tried);
        let reached = next.as_ref().map_or(f64::INFINITY, |n| cost.cost(&rows(&n.value)).value);
        history.push(reached.min(crate::cost::FAILED));
        let gain = (value - reached) / promised;
        if gain < 0.25 {
            radius *= 0.4;
        } else if gain > 0.7 && step.amax() > 0.9 * radius {
            radius = (radius * 2.0).min(0.5);
        }
        if let Some(next) = next.filter(|_| reached < value) {
            (point, here, value) = (tried, next, reached);
        }
    }
    Some(Found { point, cost: value, history })
}

/// Five numbers a trial.
fn rows(value: &[f64]) -> Vec<Option<Free<f64>>> {
    value.chunks_exact(5).map(|c| c.try_into().ok().map(Free)).collect()
}

/// The step within the trust region that lowers the cost of the linear model most, and by how much: reweighted least squares, with the
/// percentile's share spread over its neighbours at first, then a search along axes.
fn least_of_linear(cost: &CostFunction, here: &Linear, point: &[f64], radius: f64) -> (DVector<f64>, f64) {
    let base = DVector::from_column_slice(&here.value);
    let of = |step: &DVector<f64>| cost.cost(&rows((&base + &here.jacobian * step).as_slice())).value;
    let start = of(&DVector::zeros(point.len()));
    let mut best = (DVector::zeros(point.len()), start);
    let mut step = DVector::zeros(point.len());
    for spread in [40.0, 40.0, 25.0, 25.0, 15.0, 15.0, 8.0, 8.0, 8.0, 4.0, 4.0, 4.0] {
        let predicted = (&base + &here.jacobian * &step).as_slice().to_vec();
        let (hessian, gradient) = reweighted(cost, here, &predicted, &step, spread);
        step = box_step(&hessian, &gradient, point, radius);
        let value = of(&step);
        if value < best.1 {
            best = (step.clone(), value);
        }
    }
    along_axes(&of, here, point, radius, &mut best);
    let promised = start - best.1;
    (best.0, promised)
}

/// The quadratic model of sum w |e| at the present errors, each |e| as e^2 / (2 |e_now|), for the step from the point.
fn reweighted(
    cost: &CostFunction,
    here: &Linear,
    predicted: &[f64],
    step: &DVector<f64>,
    spread: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let n = step.len();
    let weights = cost.spread_weights(&rows(predicted), spread);
    let mut hessian = DMatrix::identity(n, n) * 1e-3;
    let mut gradient = DVector::zeros(n);
    for (i, of_trial) in weights.iter().enumerate() {
        for (c, &(weight, error, scale)) in of_trial.iter().enumerate() {
            if weight <= 0.0 {
                continue;
            }
            let row = here.jacobian.row(5 * i + c).transpose();
            let w = weight / (error.abs() + 0.02 * scale);
            // the error at the point itself, from which the step counts
            let at_point = error - row.dot(step);
            hessian.ger(w, &row, &row, 1.0);
            gradient.axpy(w * at_point, &row, 1.0);
        }
    }
    (hessian, gradient)
}

/// Searches along each axis with halving steps.
fn along_axes(
    of: &dyn Fn(&DVector<f64>) -> f64,
    here: &Linear,
    point: &[f64],
    radius: f64,
    best: &mut (DVector<f64>, f64),
) {
    let n = point.len();
    let mut size = 0.25 * radius;
    for _ in 0..5 {
        for k in (0..n).filter(|&k| here.jacobian.column(k).amax() > 0.0) {
            for sign in [1.0, -1.0] {
                let mut tried = best.0.clone();
                tried[k] = (tried[k] + sign * size).clamp((-point[k]).max(-radius), (1.0 - point[k]).min(radius));
                let value = of(&tried);
                if value < best.1 {
                    *best = (tried, value);
                    break;
                }
            }
        }
        size *= 0.5;
    }
}

#[cfg(test)]
mod tests;

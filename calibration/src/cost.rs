//! The one definition of residual and cost [andreassen2025, section 2.5]; a worked example stands in docs/theory/cost.md.
//!
//! Residual of a trial and coordinate: predicted minus measured [deg or mm].
//! Cost: trials are grouped by test and nominal flexion; of a group and coordinate, the 75th percentile over its trials of the
//! absolute error, divided by the coordinate's range over all measured trials, times a weight; summed; squared where a
//! trial reaches a joint limit in ML or SI.

use crate::error::CalibrationError;
use serde::{Deserialize, Serialize};
use sim::coordinate::{Coordinate, FREE, Free, ML, SI};
use sim::laxity::{LaxityTrial, Test};
use sim::spec::PoseSpec;
use std::collections::BTreeMap;

/// Cost of an evaluation in which a trial has no answer, as in the published logs [-].
pub const FAILED: f64 = 1e10;
/// Coordinates with a joint limit: ML and SI.
const LIMITED: [Coordinate; 2] = [ML, SI];

/// How the cost is counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CostOptions {
    /// Weights [-] of the five coordinates (VV, IE, ML, AP, SI) by test; the published scripts' [andreassen2025, figure 6].
    pub weights: BTreeMap<Test, Free<f64>>,
    /// Percentile of a group's errors [%]; [andreassen2025, section 2.5].
    pub percentile: f64,
    /// ML or SI further than this from the CT pose is a joint limit [mm]; ours, the paper gives no number.
    pub limit_mm: f64,
}

impl Default for CostOptions {
    fn default() -> Self {
        let weights = BTreeMap::from([
            (Test::Anterior, Free([0.0, 50.0, 0.0, 100.0, 0.0])),
            (Test::Posterior, Free([0.0, 50.0, 0.0, 100.0, 0.0])),
            (Test::Internal, Free([0.0, 100.0, 0.0, 50.0, 0.0])),
            (Test::External, Free([0.0, 100.0, 0.0, 50.0, 0.0])),
            (Test::Varus, Free([100.0, 50.0, 0.0, 0.0, 0.0])),
            (Test::Valgus, Free([100.0, 50.0, 0.0, 0.0, 0.0])),
            (Test::Neutral, Free([100.0, 100.0, 0.0, 100.0, 0.0])),
        ]);
        CostOptions { weights, percentile: 75.0, limit_mm: 20.0 }
    }
}

impl CostOptions {
    /// Weights of a test's coordinates; zero where none are given.
    pub fn weights_of(&self, test: Test) -> Free<f64> {
        self.weights.get(&test).copied().unwrap_or(Free::all(0.0))
    }
}

/// A group of trials and a coordinate that counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// What the group tests.
    pub test: Test,
    /// The flexion it is filed under [deg].
    pub nominal_flexion_deg: f64,
    /// What was cut of the knee before.
    pub without: Vec<String>,
    /// The coordinate.
    pub coordinate: Coordinate,
    /// Its weight [-].
    pub weight: f64,
    /// The coordinate's range over all measured trials [deg or mm].
    pub range: f64,
    /// Indices of the group's trials in which the coordinate is measured.
    pub trials: Vec<usize>,
}

impl Term {
    /// Its test, and what was cut before: "anterior without ACL".
    pub fn in_words(&self) -> String {
        let cut =
            if self.without.is_empty() { String::new() } else { format!(" without {}", self.without.join(" and ")) };
        self.test.name().to_owned() + &cut
    }
}

/// The cost of one set of trials, ready for predictions.
#[derive(Clone, Debug, PartialEq)]
pub struct CostFunction {
    /// What is summed.
    pub terms: Vec<Term>,
    measured: Vec<Free<Option<f64>>>,
    /// Of each trial, from where its joint limits count.
    from: Vec<Free<f64>>,
    percentile: f64,
    limit_mm: f64,
}

/// A cost and what it is made of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The cost [-].
    pub value: f64,
    /// The sum of the terms, before the penalty [-].
    pub sum: f64,
    /// Error of each term: the percentile over its trials [deg or mm].
    pub errors: Vec<f64>,
    /// Indices of the trials at a joint limit.
    pub at_limit: Vec<usize>,
    /// Indices of the trials without an answer.
    pub unanswered: Vec<usize>,
}

/// Residual of a trial: predicted minus measured [deg, mm]; `None` where not measured.
pub fn residual(trial: &LaxityTrial, predicted: &Free<f64>) -> Free<Option<f64>> {
    Free::from_fn(|c| trial.measured[c].map(|m| predicted[c] - m))
}

/// Root mean square of predicted minus measured, a coordinate each [deg or mm]; trials without an answer and those `left_out` do not count. `None`
/// where nothing was measured.
pub fn rms<'a>(
    trials: impl IntoIterator<Item = &'a LaxityTrial>,
    predicted: &[Option<Free<f64>>],
    left_out: &[usize],
) -> Free<Option<f64>> {
    let answered = trials.into_iter().zip(predicted).enumerate().filter(|(i, _)| !left_out.contains(i));
    let residuals: Vec<_> = answered.filter_map(|(_, (t, p))| p.as_ref().map(|p| residual(t, p))).collect();
    Free::from_fn(|c| {
        let squares: Vec<f64> = residuals.iter().filter_map(|r| r[c]).map(|r| r * r).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    })
}

/// The p-th percentile by linear interpolation between the sorted values x_k at 100 (k - 1/2) / n, clamped at the ends: MATLAB's
/// `prctile`, since the published calibration ran there.
pub fn percentile(values: &[f64], p: f64) -> f64 {
    let n = values.len();
    if n == 0 {
        return 0.0;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (p / 100.0 * n as f64 - 0.5).clamp(0.0, (n - 1) as f64);
    let below = place.floor() as usize;
    let t = place - below as f64;
    sorted[below] * (1.0 - t) + sorted[(below + 1).min(n - 1)] * t
}

impl CostFunction {
    /// The cost of these trials for a model whose CT pose is `ct`.
    ///
    /// # Errors
    /// Options out of range; no coordinate with a weight is measured; a weighted coordinate does not vary over the trials.
    pub fn new(trials: &[LaxityTrial], ct: &PoseSpec, options: &CostOptions) -> Result<CostFunction, CalibrationError> {
        check(options)?;
        let at_ct = ct.free();
        let mut groups: BTreeMap<(Test, i64, bool, &[String]), Vec<usize>> = BTreeMap::new();
        for (i, t) in trials.iter().enumerate() {
            let flexion = (t.nominal_flexion_deg * 10.0).round() as i64;
            let kind = (t.test, flexion, t.reference.is_some(), t.without.as_slice());
            groups.entry(kind).or_default().push(i);
        }
        let mut terms = Vec::new();
        for ((test, _, displaced, without), members) in &groups {
            let weights = options.weights_of(*test);
            for coordinate in FREE.into_iter().filter(|&c| weights[c] > 0.0) {
                let trials_of: Vec<usize> =
                    members.iter().copied().filter(|&i| trials[i].measured[coordinate].is_some()).collect();
                if let Some(&first) = trials_of.first() {
                    terms.push(Term {
                        test: *test,
                        nominal_flexion_deg: trials[first].nominal_flexion_deg,
                        without: without.to_vec(),
                        coordinate,
                        weight: weights[coordinate],
                        range: range(trials, coordinate, *displaced)?,
                        trials: trials_of,
                    });
                }
            }
        }
        if terms.is_empty() {
            return Err(CalibrationError::Targets("no coordinate with a weight is measured in any trial".into()));
        }
        Ok(CostFunction {
            terms,
            measured: trials.iter().map(|t| t.measured).collect(),
            from: trials.iter().map(|t| if t.reference.is_some() { Free::all(0.0) } else { at_ct }).collect(),
            percentile: options.percentile,
            limit_mm: options.limit_mm,
        })
    }

    /// The cost of these predictions, one a trial (VV, IE [deg], ML, AP, SI [mm]); `None` is a trial without an answer.
    pub fn cost(&self, predicted: &[Option<Free<f64>>]) -> Cost {
        let unanswered: Vec<usize> = (0..predicted.len()).filter(|&i| predicted[i].is_none()).collect();
        if !unanswered.is_empty() {
            return Cost { value: FAILED, sum: FAILED, errors: vec![], at_limit: vec![], unanswered };
        }
        let beyond = |i: usize, p: &Free<f64>| LIMITED.iter().any(|&c| (p[c] - self.from[i][c]).abs() >= self.limit_mm);
        let at_limit: Vec<usize> =
            (0..predicted.len()).filter(|&i| predicted[i].is_some_and(|p| beyond(i, &p))).collect();
        let (mut sum, mut errors) = (0.0, Vec::with_capacity(self.terms.len()));
        for term in &self.terms {
            let absolute: Vec<f64> =
                term.trials.iter().map(|&i| self.error(predicted, i, term.coordinate).abs()).collect();
            let error = percentile(&absolute, self.percentile);
            sum += term.weight / term.range * error;
            errors.push(error);
        }
        // squaring must not make a cost below 1 smaller
        let value = if at_limit.is_empty() { sum } else { sum * sum.max(1.0) };
        Cost { value, sum, errors, at_limit, unanswered }
    }

    /// Predicted minus measured; zero where either is missing.
    fn error(&self, predicted: &[Option<Free<f64>>], trial: usize, coordinate: Coordinate) -> f64 {
        match (predicted[trial], self.measured[trial][coordinate]) {
            (Some(p), Some(m)) => p[coordinate] - m,
            _ => 0.0,
        }
    }
}

/// Largest minus smallest measured value of a coordinate, of poses or of displacements. A displacement counts from 0, which was measured too.
fn range(trials: &[LaxityTrial], coordinate: Coordinate, displaced: bool) -> Result<f64, CalibrationError> {
    let of = trials.iter().filter(|t| t.reference.is_some() == displaced);
    let values = of.filter_map(|t| t.measured[coordinate]).chain(displaced.then_some(0.0));
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if high > low {
        return Ok(high - low);
    }
    Err(CalibrationError::Targets(format!(
        "{} is {low} in every trial that has it; its errors cannot be divided by its range: give trials in which it varies",
        coordinate.column()
    )))
}

/// Refuses options that mean nothing.
fn check(options: &CostOptions) -> Result<(), CalibrationError> {
    let refuse = |text: String| Err(CalibrationError::Option(text));
    if !(0.0..=100.0).contains(&options.percentile) {
        return refuse(format!("cost.percentile is {}, expected 0 to 100", options.percentile));
    }
    if options.limit_mm.is_nan() || options.limit_mm <= 0.0 {
        return refuse(format!("cost.limit_mm is {}, expected above 0", options.limit_mm));
    }
    match options.weights.values().flatten().find(|w| !(**w >= 0.0 && w.is_finite())) {
        Some(w) => refuse(format!("cost.weights: {w}, expected 0 or more")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;

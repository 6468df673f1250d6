//! A calibration's question: trials, what was measured, the cost, and the derivatives of its residuals.

use crate::cost::{Cost, CostFunction, FAILED};
use crate::error::CalibrationError;
use crate::experiment::{Answer, Experiment};
use crate::options::{CalibrateOptions, LoadPrior};
use crate::targets::Targets;
use nalgebra::{DMatrix, DVector};
use sim::SimError;
use sim::coordinate::Free;

/// Standard deviation of a number spread evenly over a unit width: the prior of Table 3's ranges.
const UNIFORM_SD: f64 = 0.288_675_134_594_812_9;

/// Trials, what was measured, the cost.
pub struct Problem<'a> {
    /// The solver as the search has it, and the design variables.
    pub experiment: Experiment<'a>,
    /// The solver as `simulate` has it; the search may be coarser.
    pub in_full: Experiment<'a>,
    /// What was measured.
    pub targets: &'a Targets,
    /// The cost.
    pub cost: CostFunction,
    /// What is believed of ligament loads, with the indices of their bundles.
    loads: Vec<(&'a LoadPrior, Vec<usize>)>,
    /// Residuals beyond this many standard deviations count linearly.
    robust: f64,
}

impl<'a> Problem<'a> {
    /// A problem for a solver as the search has it and in full; `bundles` are the names in the order of the solver's forces.
    ///
    /// # Errors
    /// A load belief about a bundle the model does not have.
    pub fn new(
        (experiment, in_full): (Experiment<'a>, Experiment<'a>),
        targets: &'a Targets,
        cost: CostFunction,
        bundles: &[String],
        options: &'a CalibrateOptions,
    ) -> Result<Problem<'a>, CalibrationError> {
        let index = |name: &String| {
            bundles.iter().position(|b| b == name).ok_or_else(|| {
                CalibrationError::Option(format!("loads: no bundle {name}; the model has {}", bundles.join(", ")))
            })
        };
        let loads = options
            .loads
            .iter()
            .map(|p| Ok((p, p.bundles.iter().map(index).collect::<Result<Vec<usize>, _>>()?)))
            .collect::<Result<_, CalibrationError>>()?;
        Ok(Problem { experiment, in_full, targets, cost, loads, robust: options.gradient.robust })
    }

    /// The cost at unit coordinates, load beliefs included; 1e10 when a trial has no answer.
    pub fn value(&self, unit: &[f64]) -> f64 {
        let answers = self.experiment.answers(&self.experiment.design.at(unit), false);
        self.value_of(&answers)
    }

    /// The cost of these answers, load beliefs included.
    fn value_of(&self, answers: &[Result<Answer, SimError>]) -> f64 {
        let cost = self.cost_of(answers).value;
        if cost >= FAILED {
            return FAILED;
        }
        cost + self.loads.iter().map(|(p, index)| self.load_cost(p, index, answers)).sum::<f64>()
    }

    /// The cost alone.
    pub fn cost_of(&self, answers: &[Result<Answer, SimError>]) -> Cost {
        let predicted: Vec<Option<Free<f64>>> = answers.iter().map(|a| a.as_ref().ok().map(|a| a.predicted)).collect();
        self.cost.cost(&predicted)
    }

    /// Weight times the mean size of a belief's residual over its trials.
    fn load_cost(&self, p: &LoadPrior, index: &[usize], answers: &[Result<Answer, SimError>]) -> f64 {
        let of: Vec<f64> = (0..answers.len())
            .filter(|&i| self.applies(p, i))
            .filter_map(|i| answers[i].as_ref().ok().map(|a| load_residual(p, total(&a.forces_n, index)).0.abs()))
            .collect();
        p.weight * of.iter().sum::<f64>() / of.len().max(1) as f64
    }

    fn applies(&self, p: &LoadPrior, trial: usize) -> bool {
        p.applies(&self.targets.trials[trial])
    }

    /// Derivatives by unit coordinates of the residuals in standard deviations, scaled by `noise_scale`, and of the beliefs: a row a number. `None` when a
    /// trial has no answer.
    pub fn jacobian(&self, unit: &[f64], noise_scale: &Free<f64>) -> Option<DMatrix<f64>> {
        let design = self.experiment.design;
        let answers = self.experiment.answers(&design.at(unit), true);
        let (n, widths) = (unit.len(), design.variables.iter().map(crate::design::Variable::width).collect::<Vec<_>>());
        let mut rows: Vec<DVector<f64>> = Vec::new();
        for (i, answer) in answers.iter().enumerate() {
            let (answer, t) = (answer.as_ref().ok()?, &self.targets.trials[i]);
            let noise = self.targets.noise(t);
            let jacobian = answer.jacobian.as_ref()?;
            let residual = crate::cost::residual(t, &answer.predicted);
            for (c, r) in residual.each() {
                let Some(r) = r else { continue };
                let sd = noise[c] * noise_scale[c];
                let by = DVector::from_fn(n, |k, _| jacobian.predicted[k][c] * widths[k] / sd);
                rows.push(by * huber(r / sd, self.robust));
            }
            for (p, index) in self.loads.iter().filter(|(p, _)| self.applies(p, i)) {
                let slope = load_residual(p, total(&answer.forces_n, index)).1;
                rows.push(DVector::from_fn(n, |k, _| slope * total(&jacobian.forces_n[k], index) * widths[k]));
            }
        }
        rows.extend((0..n).map(|k| DVector::from_fn(n, |j, _| if j == k { 1.0 / UNIFORM_SD } else { 0.0 })));
        let jacobian = DMatrix::from_fn(rows.len(), n, |i, k| rows[i][k]);
        jacobian.iter().all(|x| x.is_finite()).then_some(jacobian)
    }

    /// By how much predictions miss the measurements in standard deviations, a coordinate each, and no less than 1: root mean square of residuals
    /// cut off at `robust` times the scale so far, each coordinate giving up its share of the variables the data determine.
    pub fn misses(&self, predicted: &[Option<Free<f64>>], so_far: &Free<f64>, robust: f64) -> Free<f64> {
        let z = self.standardised(predicted);
        let all = z.iter().flatten().flatten().count().max(1) as f64;
        // the data determine about half of the variables
        let spent = (0.5 * self.experiment.design.len() as f64 / all).min(0.5);
        Free::from_fn(|c| {
            let of: Vec<f64> = z.iter().filter_map(|z| z[c]).collect();
            let most = robust * so_far[c];
            let mean = of.iter().map(|z| z.abs().min(most).powi(2)).sum::<f64>() / of.len().max(1) as f64;
            (mean / (1.0 - spent)).sqrt().max(1.0)
        })
    }

    /// Predicted minus measured in standard deviations (unscaled), a trial each.
    pub fn standardised(&self, predicted: &[Option<Free<f64>>]) -> Vec<Free<Option<f64>>> {
        let of = |i: usize| {
            let Some(p) = &predicted[i] else { return Free::all(None) };
            let t = &self.targets.trials[i];
            let (r, noise) = (crate::cost::residual(t, p), self.targets.noise(t));
            Free::from_fn(|c| r[c].map(|r| r / noise[c]))
        };
        (0..predicted.len()).map(of).collect()
    }
}

/// Sum of some of the numbers.
fn total(values: &[f64], index: &[usize]) -> f64 {
    index.iter().filter_map(|&k| values.get(k)).sum()
}

/// A belief's residual [-] at a force, and its slope [1/N].
fn load_residual(p: &LoadPrior, force: f64) -> (f64, f64) {
    match (p.mean_n, p.most_n) {
        (Some(mean), _) => ((force - mean) / p.sd_n, 1.0 / p.sd_n),
        (None, Some(most)) if force > most => ((force - most) / p.sd_n, 1.0 / p.sd_n),
        _ => (0.0, 0.0),
    }
}

/// Derivative by `z` of a residual whose square is Huber's loss [huber1964]: of `z` itself up to `k`, beyond that of `sqrt(2 k |z| - k^2)`.
fn huber(z: f64, k: f64) -> f64 {
    if z.abs() <= k { 1.0 } else { k / (2.0 * k * z.abs() - k * k).sqrt() }
}

/// A trial whose bundle forces are estimated, beside the targets.
#[derive(Clone, Copy)]
pub struct Probes<'a> {
    /// The solver for these trials.
    pub experiment: Experiment<'a>,
    /// The same as the search asks it.
    pub search: Experiment<'a>,
    /// Their names.
    pub names: &'a [String],
}

//! A calibration's question: trials, what was measured, the cost, and the derivatives of its residuals.

use crate::cost::{Cost, CostFunction, FAILED};
use crate::error::CalibrationError;
use crate::experiment::{Answer, Experiment, Jacobian};
use crate::options::{CalibrateOptions, LoadPrior};
use crate::targets::Targets;
use inference::linear::Linear;
use inference::noise::Likelihood;
use nalgebra::{DMatrix, DVector, RowDVector};
use sim::SimError;
use sim::coordinate::{Coordinate, Free};

/// Standard deviation of a number spread evenly over a unit width: the prior of Table 3's ranges.
const UNIFORM_SD: f64 = 0.288_675_134_594_812_9;
/// Its mean.
const UNIFORM_MEAN: f64 = 0.5;
/// Times that the noise is inferred: what counts as an outlier moves with it. Where all readings miss by ten noises, the third moves it by less than 1 %.
const NOISE_ROUNDS: usize = 3;

/// Whether derivatives are asked of the solver. Without them the variables take nothing up of what is read.
#[derive(Clone, Copy, PartialEq)]
enum Derivatives {
    Asked,
    LeftOut,
}

/// Readings about a point.
struct Readings {
    /// Predicted minus measured, and beliefs, by standard normal numbers of the variables.
    at: Linear,
    /// Noise of each reading as stated.
    sd: Vec<f64>,
    /// Coordinate of each.
    coordinate: Vec<Coordinate>,
}

/// Values and their derivatives, a row each.
struct Stacked {
    values: DVector<f64>,
    jacobian: DMatrix<f64>,
}

impl Stacked {
    fn of(all: &[(f64, RowDVector<f64>)], columns: usize) -> Stacked {
        Stacked {
            values: DVector::from_iterator(all.len(), all.iter().map(|(value, _)| *value)),
            jacobian: DMatrix::from_fn(all.len(), columns, |r, k| all[r].1[k]),
        }
    }
}

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

    /// Derivatives by unit coordinates of the residuals in standard deviations, scaled by `noise_scale`, of the beliefs, and of the priors: a row a number.
    /// `None` when a trial has no answer.
    pub fn jacobian(&self, unit: &[f64], noise_scale: &Free<f64>) -> Option<DMatrix<f64>> {
        let Readings { mut at, sd, coordinate } = self.about(unit, Derivatives::Asked)?;
        for (i, mut row) in at.jacobian.row_iter_mut().enumerate() {
            let sd = sd[i] * noise_scale[coordinate[i]];
            row *= huber(at.reading[i] / sd, self.robust) / sd;
        }
        let (n, readings, beliefs) = (unit.len(), at.jacobian.nrows(), at.belief_jacobian.nrows());
        let mut out = DMatrix::zeros(readings + beliefs + n, n);
        out.rows_mut(0, readings).copy_from(&at.jacobian);
        out.rows_mut(readings, beliefs).copy_from(&at.belief_jacobian);
        out.rows_mut(readings + beliefs, n).fill_with_identity();
        out /= UNIFORM_SD;
        out.iter().all(|x| x.is_finite()).then_some(out)
    }

    /// By how much the data scatter more than stated about unit coordinates, a coordinate each, and no less than 1: an inference's answer
    /// ([`Likelihood::infer_scales`]), since a recipe's cost says nothing of noise.
    ///
    /// # Errors
    /// A covariance that is not positive definite.
    pub fn noise_scale(&self, unit: &[f64]) -> Result<Free<f64>, CalibrationError> {
        let about = self.about(unit, Derivatives::Asked).or_else(|| self.about(unit, Derivatives::LeftOut));
        // a point without an answer has no cost either
        let Some(Readings { at, sd, coordinate }) = about else { return Ok(Free::all(1.0)) };
        let group = coordinate.iter().map(|c| c.free_index()).collect();
        let mut likelihood = Likelihood::independent(DVector::zeros(sd.len()), sd, group);
        likelihood.robust = self.robust;
        for _ in 0..NOISE_ROUNDS {
            likelihood.infer_scales(&at, true)?;
        }
        Ok(Free::from_fn(|c| likelihood.scale.get(c.free_index()).map_or(1.0, |s| s.max(1.0))))
    }

    /// What is read and believed about unit coordinates. `None` when a trial has no answer, or no derivatives where those are asked.
    fn about(&self, unit: &[f64], derivatives: Derivatives) -> Option<Readings> {
        let design = self.experiment.design;
        let answers = self.experiment.answers(&design.at(unit), derivatives == Derivatives::Asked);
        let by_number: Vec<f64> = design.variables.iter().map(|v| v.width() * UNIFORM_SD).collect();
        let row = |by: &dyn Fn(usize, &Jacobian) -> f64, jacobian: Option<&Jacobian>| {
            RowDVector::from_fn(unit.len(), |_, k| jacobian.map_or(0.0, |j| by(k, j) * by_number[k]))
        };
        let (mut sd, mut coordinate, mut read, mut believed) = (vec![], vec![], vec![], vec![]);
        for (i, answer) in answers.iter().enumerate() {
            let (answer, t) = (answer.as_ref().ok()?, &self.targets.trials[i]);
            let jacobian = match derivatives {
                Derivatives::Asked => Some(answer.jacobian.as_ref()?),
                Derivatives::LeftOut => None,
            };
            let noise = self.targets.noise(t);
            for (c, residual) in crate::cost::residual(t, &answer.predicted).each() {
                let Some(residual) = residual else { continue };
                sd.push(noise[c]);
                coordinate.push(c);
                read.push((*residual, row(&|k, j| j.predicted[k][c], jacobian)));
            }
            for (p, index) in self.loads.iter().filter(|(p, _)| self.applies(p, i)) {
                let (residual, slope) = load_residual(p, total(&answer.forces_n, index));
                believed.push((residual, row(&|k, j| slope * total(&j.forces_n[k], index), jacobian)));
            }
        }
        let one_side = vec![false; believed.len()];
        let (read, believed) = (Stacked::of(&read, unit.len()), Stacked::of(&believed, unit.len()));
        let at = Linear {
            reading: read.values,
            jacobian: read.jacobian,
            belief: believed.values,
            belief_jacobian: believed.jacobian,
            one_side,
            z: DVector::from_iterator(unit.len(), unit.iter().map(|x| (x - UNIFORM_MEAN) / UNIFORM_SD)),
        };
        Some(Readings { at, sd, coordinate })
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

//! What an optimiser asks of a solver: answers to trials at design values, with their derivatives where wanted.

use crate::design::Design;
use nalgebra::DMatrix;
use rayon::prelude::*;
use sim::SimError;
use sim::coordinate::Free;

/// What a model answers to one trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Predicted VV, IE [deg], ML, AP, SI [mm].
    pub predicted: Free<f64>,
    /// Force of each bundle [N].
    pub forces_n: Vec<f64>,
    /// What is odd about it ("dislocated"); empty when nothing is.
    pub flags: Vec<String>,
    /// Derivatives by each design variable, where asked for.
    pub slopes: Option<Slopes>,
}

/// Derivatives of an answer by the design variables, each per unit of the variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Slopes {
    /// Of the prediction: a row a variable.
    pub predicted: Vec<Free<f64>>,
    /// Of the bundle forces: a row a variable, a column a bundle.
    pub forces_n: Vec<Vec<f64>>,
}

/// Answers every trial at design values, in order; the last argument asks for derivatives.
pub type Simulate<'a> = dyn Fn(&[f64], bool) -> Vec<Result<Answer, SimError>> + Sync + 'a;

/// A number of trials of one model.
#[derive(Clone, Copy)]
pub struct Experiment<'a> {
    /// The design variables.
    pub design: &'a Design,
    /// The solver.
    pub simulate: &'a Simulate<'a>,
    /// How many trials.
    pub trials: usize,
}

impl Experiment<'_> {
    /// Answers to all trials, in order.
    pub fn answers(&self, values: &[f64], slopes: bool) -> Vec<Result<Answer, SimError>> {
        (self.simulate)(values, slopes)
    }

    /// Predictions of all trials; `None` where the solver has none.
    pub fn predictions(&self, values: &[f64]) -> Vec<Option<Free<f64>>> {
        self.answers(values, false).into_iter().map(|a| a.ok().map(|a| a.predicted)).collect()
    }

    /// Predictions of all trials (five rows a trial) and their derivatives by unit coordinates of the box; `None` when a trial
    /// has no answer.
    pub fn linear(&self, unit: &[f64]) -> Option<Linear> {
        let values = self.design.at(unit);
        let n = values.len();
        let mut out =
            Linear { value: Vec::with_capacity(5 * self.trials), jacobian: DMatrix::zeros(5 * self.trials, n) };
        for (i, answer) in self.answers(&values, true).into_iter().enumerate() {
            let answer = answer.ok()?;
            out.value.extend(answer.predicted);
            let slopes = answer.slopes?;
            for (j, (v, by)) in self.design.variables.iter().zip(&slopes.predicted).enumerate() {
                for (c, s) in by.iter().enumerate() {
                    out.jacobian[(5 * i + c, j)] = s * v.width();
                }
            }
        }
        let finite = out.value.iter().chain(out.jacobian.iter()).all(|x| x.is_finite());
        finite.then_some(out)
    }
}

/// Predictions of all trials and their derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Five numbers a trial [deg, mm].
    pub value: Vec<f64>,
    /// A row a number, a column a variable, per width of its range.
    pub jacobian: DMatrix<f64>,
}

/// A solver without derivatives made into one with, by central differences of `step` times a variable's range.
pub fn with_differences<'a>(
    simulate: &'a Simulate<'a>,
    design: &'a Design,
    step: f64,
) -> impl Fn(&[f64], bool) -> Vec<Result<Answer, SimError>> + Sync + 'a {
    move |values, slopes| {
        let answers = simulate(values, false);
        if !slopes {
            return answers;
        }
        let widths: Vec<f64> = design.variables.iter().map(|v| 2.0 * step * v.width()).collect();
        let moved = |j: usize, sign: f64| {
            let mut moved = values.to_vec();
            moved[j] += sign * 0.5 * widths[j];
            simulate(&moved, false)
        };
        let sides: Vec<_> = (0..values.len()).into_par_iter().map(|j| (moved(j, 1.0), moved(j, -1.0))).collect();
        let with_slopes = |(i, answer): (usize, Result<Answer, SimError>)| {
            let mut slopes = Slopes { predicted: vec![], forces_n: vec![] };
            for ((up, down), h) in sides.iter().zip(&widths) {
                let (a, b) = (up[i].as_ref().map_err(Clone::clone)?, down[i].as_ref().map_err(Clone::clone)?);
                slopes.predicted.push(Free::from_fn(|c| (a.predicted[c] - b.predicted[c]) / h));
                slopes.forces_n.push(a.forces_n.iter().zip(&b.forces_n).map(|(x, y)| (x - y) / h).collect());
            }
            Ok(Answer { slopes: Some(slopes), ..answer? })
        };
        answers.into_iter().enumerate().map(with_slopes).collect()
    }
}

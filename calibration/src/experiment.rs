//! What an optimiser asks of a solver: answers to trials at design values, with their derivatives where wanted.

use crate::design::Design;
use sim::SimError;
use sim::coordinate::Free;
use sim::flags::Flag;

/// What a model answers to one trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Predicted VV, IE [deg], ML, AP, SI [mm].
    pub predicted: Free<f64>,
    /// Force of each bundle [N].
    pub forces_n: Vec<f64>,
    /// What is odd about it; empty when nothing is.
    pub flags: Vec<Flag>,
    /// Derivatives by each design variable, where asked for.
    pub jacobian: Option<Jacobian>,
}

/// Derivatives of an answer by the design variables, each per unit of the variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Jacobian {
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
    pub fn answers(&self, values: &[f64], jacobian: bool) -> Vec<Result<Answer, SimError>> {
        (self.simulate)(values, jacobian)
    }

    /// Predictions of all trials; `None` where the solver has none.
    pub fn predictions(&self, values: &[f64]) -> Vec<Option<Free<f64>>> {
        self.answers(values, false).into_iter().map(|a| a.ok().map(|a| a.predicted)).collect()
    }
}

//! The paper's recipe [andreassen2025, section 2.5]: a particle swarm, then a simplex from its best, as a state that advances a step
//! at a time and can be saved between steps.

use crate::options::SwarmOptions;
use crate::problem::Problem;
use crate::simplex::Simplex;
use crate::swarm::Swarm;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Between two steps of the recipe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    swarm: Swarm,
    simplex: Option<Simplex>,
    /// The cost of every evaluation, in order.
    pub history: Vec<f64>,
    /// How many of them the swarm made.
    pub swarm_evaluations: usize,
    finished: bool,
}

impl Recipe {
    /// The recipe from a start in unit coordinates.
    pub fn new(start: &[f64], options: &SwarmOptions, seed: u64) -> Recipe {
        let swarm = Swarm::new(start, options.particles, seed);
        Recipe { swarm, simplex: None, history: vec![], swarm_evaluations: 0, finished: false }
    }

    /// A generation of the swarm, or an iteration of the simplex.
    pub fn advance(&mut self, problem: &Problem, options: &SwarmOptions) {
        let history = &mut self.history;
        let mut evaluate = |points: &[Vec<f64>]| -> Vec<f64> {
            let costs: Vec<f64> = points.par_iter().map(|p| problem.value(p)).collect();
            history.extend(&costs);
            costs
        };
        match &mut self.simplex {
            None => {
                self.swarm.advance(&mut evaluate);
                self.swarm_evaluations = self.history.len();
                if self.history.len() + options.particles > options.swarm_evaluations {
                    self.finish_swarm(problem, options);
                }
            }
            Some(simplex) => {
                simplex.advance(&mut evaluate);
                let spent = self.history.len() - self.swarm_evaluations;
                self.finished = spent >= options.simplex_evaluations || simplex.size() < 1e-7;
            }
        }
    }

    /// Puts a simplex at the swarm's best.
    fn finish_swarm(&mut self, problem: &Problem, options: &SwarmOptions) {
        let best = self.swarm.best().cloned();
        let corners = best.as_ref().map_or(0, |b| b.1.len());
        let Some(best) = best.filter(|_| options.simplex_evaluations > corners) else {
            self.finished = true;
            return;
        };
        let history = &mut self.history;
        self.simplex = Some(Simplex::new(best, options.simplex_size, &mut |points| {
            let costs: Vec<f64> = points.par_iter().map(|p| problem.value(p)).collect();
            history.extend(&costs);
            costs
        }));
    }

    /// True when there is nothing left to do.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// The lowest cost found and where, unit coordinates.
    pub fn best(&self) -> Option<(f64, Vec<f64>)> {
        let swarm = self.swarm.best().cloned();
        let simplex = self.simplex.as_ref().and_then(|s| s.best().cloned());
        match (swarm, simplex) {
            (Some(a), Some(b)) => Some(if b.0 < a.0 { b } else { a }),
            (a, b) => a.or(b),
        }
    }

    /// The particles' own best, lowest cost first: what different starts found.
    pub fn rivals(&self) -> Vec<(f64, Vec<f64>)> {
        self.swarm.ranked().into_iter().cloned().collect()
    }
}

//! The faster way: least squares from many starts, noise scaled where the model misses by more, descent on the cost, samples of the
//! posterior; a state that advances a chunk at a time and can be saved between chunks.
//!
//! Samples by randomised maximum likelihood [oliver1996]: each is the fit to measurements shifted by their noise, under a prior centred
//! at a random point of the ranges, begun where a linear model would have it. For a linear model and a normal prior these are exact samples; here a parameter that the
//! data do not touch keeps its random start, so that its interval is the range's own.

use crate::cost::FAILED;
use crate::descent::{Trust, descend as descend_on_cost};
use crate::error::ValidationError;
use crate::levenberg::{Stop, box_step, descend};
use crate::options::GradientOptions;
use crate::problem::{Problem, View};
use crate::swarm::latin_hypercube;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Mutex;

/// Fits a chunk: a fixed number, so that saved states and histories do not depend on the number of threads.
const CHUNK: usize = 8;
/// Rounds of noise scaling.
const ROUNDS: usize = 3;

/// A fit: where a start led.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Unit coordinates.
    pub point: Vec<f64>,
    /// Half the sum of squares, prior included [-].
    pub half_sum: f64,
    /// The cost there [-].
    pub cost: f64,
}

/// Between two chunks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gradient {
    start: Vec<f64>,
    /// Seed of the starts and samples.
    pub seed: u64,
    /// Least-squares fits of the starts, in their order; `None` where a start has no answer.
    pub starts: Vec<Option<Fit>>,
    /// Factor of the noise, a coordinate each [-].
    pub noise_scale: [f64; 5],
    /// Rounds of noise scaling done.
    rounds: usize,
    /// The most probable point.
    pub best: Option<Fit>,
    /// Descents on the cost done so far.
    pub descents: Vec<(f64, Vec<f64>)>,
    descents_done: bool,
    /// Samples of the posterior.
    pub samples: Vec<Fit>,
    drawn: usize,
    /// The cost of every evaluation, in order.
    pub history: Vec<f64>,
    finished: bool,
}

impl Gradient {
    /// From a start in unit coordinates.
    pub fn new(start: &[f64], seed: u64) -> Gradient {
        Gradient {
            start: start.to_vec(),
            seed,
            starts: vec![],
            noise_scale: [1.0; 5],
            rounds: 0,
            best: None,
            descents: vec![],
            descents_done: false,
            samples: vec![],
            drawn: 0,
            history: vec![],
            finished: false,
        }
    }

    /// True when there is nothing left to do.
    pub fn is_finished(&self) -> bool {
        self.finished
    }

    /// What it is doing.
    pub fn phase(&self, options: &GradientOptions) -> &'static str {
        if self.starts.len() < options.starts {
            "starts"
        } else if !self.descents_done {
            "refining"
        } else {
            "sampling"
        }
    }

    /// Share of the work done, 0 to 1, by count of fits.
    pub fn share(&self, options: &GradientOptions) -> f64 {
        let work = |starts: usize, rest: usize, samples: usize| {
            (starts * options.evaluations + rest * options.descent_evaluations + samples * options.sample_evaluations)
                as f64
        };
        let rest = if self.descents_done { 1 } else { 0 };
        work(self.starts.len(), rest, self.drawn) / work(options.starts, 1, options.samples).max(1.0)
    }

    /// Costs met, and where.
    pub fn candidates(&self) -> Vec<(f64, Vec<f64>)> {
        let fits = self.starts.iter().flatten().chain(&self.best).map(|f| (f.cost, f.point.clone()));
        fits.chain(self.descents.iter().cloned()).collect()
    }

    /// The lowest cost found and where.
    pub fn lowest_cost(&self) -> Option<(f64, Vec<f64>)> {
        self.candidates().into_iter().reduce(|a, b| if b.0 < a.0 { b } else { a })
    }

    /// A chunk of starts, a round of noise scaling, the descents on the cost, or a chunk of samples.
    ///
    /// # Errors
    /// No start has an answer.
    pub fn advance(&mut self, problem: &Problem, options: &GradientOptions) -> Result<(), ValidationError> {
        if self.starts.len() < options.starts {
            self.advance_starts(problem, options);
        } else if self.rounds == 0 {
            self.best =
                self.starts.iter().flatten().cloned().reduce(|a, b| if b.half_sum < a.half_sum { b } else { a });
            if self.best.is_none() {
                return Err(ValidationError::Model(format!(
                    "the solver has no answer to all trials at any of {} starts: {}",
                    options.starts,
                    self.complaint(problem)
                )));
            }
            self.rounds = 1;
        } else if options.scale_noise && self.rounds < ROUNDS {
            self.rescale(problem, options);
        } else if !self.descents_done {
            self.advance_descents(problem, options);
        } else if self.drawn < options.samples {
            self.advance_samples(problem, options);
        } else {
            self.finished = true;
        }
        Ok(())
    }

    /// What the solver says at the start.
    fn complaint(&self, problem: &Problem) -> String {
        let answers = problem.experiment.answers(&problem.experiment.design.at(&self.start), false);
        let first = answers.iter().enumerate().find_map(|(i, a)| a.as_ref().err().map(|e| (i, e.to_string())));
        first.map_or("derivatives are missing".to_owned(), |(i, e)| {
            format!("row {} ({}): {e}", problem.targets.rows[i], problem.targets.trials[i].trial)
        })
    }

    /// The view of the measurements as they are, with the noise as scaled so far.
    fn view(&self, problem: &Problem) -> View {
        let plain = View::plain(problem.targets.trials.len(), self.start.len());
        View { noise_scale: self.noise_scale, ..plain }
    }

    fn advance_starts(&mut self, problem: &Problem, options: &GradientOptions) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut points = latin_hypercube(self.start.len(), options.starts, &mut random);
        points[0] = self.start.clone();
        let from = self.starts.len();
        let chunk = &points[from..options.starts.min(from + CHUNK)];
        let view = self.view(problem);
        let stop = Stop { evaluations: options.evaluations, fall: 1e-3 };
        let fits: Vec<(Option<Fit>, Vec<f64>)> = chunk.par_iter().map(|p| fit(problem, &view, p, stop)).collect();
        for (fit, costs) in fits {
            self.history.extend(costs);
            self.starts.push(fit);
        }
    }

    /// Scales the noise of each coordinate by how much the best fit misses, then fits again from there.
    fn rescale(&mut self, problem: &Problem, options: &GradientOptions) {
        self.rounds += 1;
        let Some(best) = self.best.clone() else { return };
        let predicted = problem.experiment.predictions(&problem.experiment.design.at(&best.point));
        self.history.push(best.cost);
        self.noise_scale = problem.misses(&predicted, &self.noise_scale, options.robust);
        let stop = Stop { evaluations: 2 * options.evaluations, fall: 1e-3 };
        let (fitted, costs) = fit(problem, &self.view(problem), &best.point, stop);
        self.history.extend(costs);
        self.best = fitted.or(Some(best));
    }

    fn advance_descents(&mut self, problem: &Problem, options: &GradientOptions) {
        self.descents_done = true;
        let mut from: Vec<&Fit> = self.starts.iter().flatten().collect();
        from.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let first = self.best.iter().chain(from).take(options.descents).map(|f| f.point.clone());
        let trust = Trust { radius: 0.2, least: 1e-3, evaluations: options.descent_evaluations };
        let points: Vec<Vec<f64>> = first.collect();
        let found: Vec<_> =
            points.par_iter().map(|p| descend_on_cost(&problem.experiment, &problem.cost, p, trust)).collect();
        for f in found.into_iter().flatten() {
            self.history.extend(f.history);
            self.descents.push((f.cost, f.point));
        }
    }

    fn advance_samples(&mut self, problem: &Problem, options: &GradientOptions) {
        let chunk = self.drawn..options.samples.min(self.drawn + CHUNK);
        self.drawn = chunk.end;
        let (plain, best) = (self.view(problem), self.best.clone());
        let stop = Stop { evaluations: options.sample_evaluations, fall: 1e-2 };
        let drawn: Vec<Option<Fit>> = chunk
            .into_par_iter()
            .map(|s| {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                random.set_stream(1 + s as u64);
                let middle = point(&mut random, self.start.len());
                let shift = plain.shift.iter().map(|_| std::array::from_fn(|_| normal(&mut random))).collect();
                let view = View { shift, middle: middle.clone(), ..plain.clone() };
                let start = near(problem, &view, best.as_ref()).unwrap_or(middle);
                fit(problem, &view, &start, stop).0
            })
            .collect();
        self.samples.extend(drawn.into_iter().flatten());
    }
}

/// Where a sample would lie if the model were linear about the best fit: there its search begins. What the data do not touch is at once where the
/// sample's prior has it.
fn near(problem: &Problem, view: &View, best: Option<&Fit>) -> Option<Vec<f64>> {
    let point = &best?.point;
    let r = problem.least_squares(point, view)?.residuals;
    let (hessian, gradient) = (r.jacobian.tr_mul(&r.jacobian), r.jacobian.tr_mul(&r.value));
    let step = box_step(&hessian, &gradient, point, f64::INFINITY);
    Some(point.iter().zip(step.iter()).map(|(x, d)| (x + d).clamp(0.0, 1.0)).collect())
}

/// A least-squares fit and the costs met on the way.
fn fit(problem: &Problem, view: &View, start: &[f64], stop: Stop) -> (Option<Fit>, Vec<f64>) {
    let costs = Mutex::new(Vec::new());
    let evaluate = |p: &[f64]| {
        let e = problem.least_squares(p, view);
        if let Ok(mut costs) = costs.lock() {
            costs.push((e.as_ref().map_or(FAILED, |e| e.cost), p.to_vec()));
        }
        e.map(|e| e.residuals)
    };
    let found = descend(start, &evaluate, stop);
    let costs = costs.into_inner().unwrap_or_default();
    let fitted = found.map(|d| {
        let cost = costs.iter().rev().find(|c| c.1 == d.point).map_or(FAILED, |c| c.0);
        Fit { half_sum: d.residuals.half_sum(), cost, point: d.point }
    });
    (fitted, costs.into_iter().map(|c| c.0).collect())
}

/// A point spread evenly over the unit box.
fn point(random: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| random.random_range(0.0..1.0)).collect()
}

/// The middle of the prior of a sample, a point spread evenly over the ranges.
pub fn prior_point(seed: u64, sample: usize, n: usize) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(1 + sample as u64);
    point(&mut random, n)
}

/// A standard normal number [box1958].
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random_range(f64::EPSILON..1.0), random.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()
}

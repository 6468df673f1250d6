//! The faster way: least squares from many starts, noise scaled where the model misses by more, descent on the cost, samples of the
//! posterior; a state that advances a chunk at a time and can be saved between chunks.
//!
//! Samples by randomised maximum likelihood [oliver1996]: each is the fit to measurements shifted by their noise, under a prior centred
//! at a random point of the ranges, begun where a linear model would have it. For a linear model and a normal prior these are exact samples; here a parameter that the
//! data do not touch keeps its random start, so that its interval is the range's own.

use crate::cost::FAILED;
use crate::descent::{Trust, descend as descend_on_cost};
use crate::error::CalibrationError;
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
/// Samples taken up as starts once more.
const TAKEN_UP: usize = 2;
/// By how much the corrected search may misjudge a mode against the best (natural logarithm); 16 seen.
const MISJUDGED: f64 = 30.0;
/// Fits no further apart than this in any coordinate are the same, in widths of the ranges [-].
const SAME: f64 = 0.05;
/// Modes less likely than the best by this much (natural logarithm) are not sampled.
const UNLIKELY: f64 = 6.0;

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

/// A fit with what corrects the search there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mode {
    /// The fit.
    pub fit: Fit,
    /// What the model in full predicts more there than the search [deg, mm], a trial each.
    pub correction: Vec<[f64; 5]>,
}

/// What is done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Stage {
    Starts,
    Finals,
    Modes,
    Rescale,
    Samples,
    TakeUp,
    Descents,
    Finished,
}

/// Between two chunks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gradient {
    start: Vec<f64>,
    /// Seed of the starts and samples.
    pub seed: u64,
    /// Least-squares fits of the starts, in their order; `None` where a start has no answer.
    pub starts: Vec<Option<Fit>>,
    stage: Stage,
    /// Factor of the noise, a coordinate each [-].
    pub noise_scale: [f64; 5],
    /// Fits that the search is corrected by, the most probable first; of the model in full once the noise is scaled.
    pub modes: Vec<Mode>,
    /// Descents on the cost.
    pub descents: Vec<(f64, Vec<f64>)>,
    /// Samples of the posterior.
    pub samples: Vec<Fit>,
    drawn: usize,
    /// The cost of every evaluation, in order.
    pub history: Vec<f64>,
}

impl Gradient {
    /// From a start in unit coordinates.
    pub fn new(start: &[f64], seed: u64) -> Gradient {
        Gradient {
            start: start.to_vec(),
            seed,
            starts: vec![],
            stage: Stage::Starts,
            noise_scale: [1.0; 5],
            modes: vec![],
            descents: vec![],
            samples: vec![],
            drawn: 0,
            history: vec![],
        }
    }

    /// True when there is nothing left to do.
    pub fn is_finished(&self) -> bool {
        self.stage == Stage::Finished
    }

    /// What it is doing.
    pub fn phase(&self) -> &'static str {
        match self.stage {
            Stage::Starts => "starts",
            Stage::Samples => "sampling",
            _ => "refining",
        }
    }

    /// Share of the work done, 0 to 1, by count of fits.
    pub fn share(&self, options: &GradientOptions) -> f64 {
        let o = options;
        // a fit of the model in full takes about five times one of the search
        let work = [
            (Stage::Starts, o.starts * o.first_evaluations, self.starts.len(), o.starts),
            (Stage::Finals, o.finalists * o.evaluations, 0, 1),
            (Stage::Modes, 2 * o.modes * o.evaluations, 0, 1),
            (Stage::Rescale, 6 * o.modes * o.evaluations, 0, 1),
            (Stage::Samples, o.samples * o.sample_evaluations, self.drawn, o.samples),
            (Stage::TakeUp, TAKEN_UP.min(o.samples) * o.evaluations, 0, 1),
            (Stage::Descents, o.descents * o.descent_evaluations, 0, 1),
        ];
        let (mut done, mut all) = (0.0, 0.0);
        for (stage, effort, drawn, of) in work {
            all += effort as f64;
            if stage < self.stage {
                done += effort as f64;
            } else if stage == self.stage {
                done += effort as f64 * drawn as f64 / of.max(1) as f64;
            }
        }
        done / all.max(1.0)
    }

    /// The most probable point.
    pub fn best(&self) -> Option<&Fit> {
        self.modes.first().map(|m| &m.fit)
    }

    /// Costs met, and where.
    pub fn candidates(&self) -> Vec<(f64, Vec<f64>)> {
        let fits =
            self.starts.iter().flatten().chain(self.modes.iter().map(|m| &m.fit)).map(|f| (f.cost, f.point.clone()));
        fits.chain(self.descents.iter().cloned()).collect()
    }

    /// The lowest cost found and where.
    pub fn lowest_cost(&self) -> Option<(f64, Vec<f64>)> {
        self.candidates().into_iter().reduce(|a, b| if b.0 < a.0 { b } else { a })
    }

    /// A chunk of starts, the best of them fitted to the end, those fitted in full, the noise scaled, a chunk of samples, the best of those fitted
    /// in full, or the descents on the cost.
    ///
    /// # Errors
    /// No start has an answer.
    pub fn advance(&mut self, problem: &Problem, options: &GradientOptions) -> Result<(), CalibrationError> {
        match self.stage {
            Stage::Starts => self.advance_starts(problem, options),
            Stage::Finals => self.advance_finals(problem, options),
            Stage::Modes => {
                let points = self.ranked().into_iter().take(options.modes).map(|i| self.point_of(i)).collect();
                self.add_modes(points, problem, options, Depth::Corrected);
                if self.modes.is_empty() {
                    return Err(CalibrationError::Model(format!(
                        "the solver has no answer to all trials at any of {} starts: {}",
                        options.starts,
                        self.complaint(problem)
                    )));
                }
                self.stage = Stage::Rescale;
            }
            Stage::Rescale => self.rescale(problem, options),
            Stage::Samples => self.advance_samples(problem, options),
            Stage::TakeUp => self.take_up(problem, options),
            Stage::Descents => self.advance_descents(problem, options),
            Stage::Finished => {}
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

    /// The view of the measurements as they are, with the noise as scaled so far, the search corrected as at the most probable point.
    fn view(&self, problem: &Problem) -> View {
        let plain = View::plain(problem.targets.trials.len(), self.start.len());
        let correction = self.modes.first().map_or(plain.correction, |m| m.correction.clone());
        View { noise_scale: self.noise_scale, correction, ..plain }
    }

    /// Indices of the starts that have an answer, the best first.
    fn ranked(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.starts.len()).filter(|&i| self.starts[i].is_some()).collect();
        let sum = |i: &usize| self.starts[*i].as_ref().map_or(f64::INFINITY, |f| f.half_sum);
        order.sort_by(|a, b| sum(a).total_cmp(&sum(b)));
        order
    }

    /// Where a start led.
    fn point_of(&self, start: usize) -> Vec<f64> {
        self.starts[start].as_ref().map_or_else(|| self.start.clone(), |f| f.point.clone())
    }

    fn advance_starts(&mut self, problem: &Problem, options: &GradientOptions) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let mut points = latin_hypercube(self.start.len(), options.starts, &mut random);
        points[0] = self.start.clone();
        let from = self.starts.len();
        let chunk = &points[from..options.starts.min(from + CHUNK)];
        let view = self.view(problem);
        let stop = Stop { evaluations: options.first_evaluations, fall: 1e-3 };
        let fits: Vec<(Option<Fit>, Vec<f64>)> = chunk.par_iter().map(|p| fit(problem, &view, p, stop)).collect();
        for (fit, costs) in fits {
            self.history.extend(costs);
            self.starts.push(fit);
        }
        if self.starts.len() >= options.starts {
            self.stage = Stage::Finals;
        }
    }

    /// Fits the best of the starts to the end, then scales the noise by how much the best of them misses.
    fn advance_finals(&mut self, problem: &Problem, options: &GradientOptions) {
        self.stage = Stage::Modes;
        let mut order = self.ranked();
        order.truncate(options.finalists);
        let view = self.view(problem);
        let stop = Stop { evaluations: options.evaluations, fall: 1e-3 };
        let fits: Vec<(Option<Fit>, Vec<f64>)> =
            order.par_iter().map(|&i| fit(problem, &view, &self.point_of(i), stop)).collect();
        for (i, (fit, costs)) in order.into_iter().zip(fits) {
            self.history.extend(costs);
            self.starts[i] = fit.or(self.starts[i].take());
        }
        if let Some(&best) = self.ranked().first() {
            self.scale_noise(&self.point_of(best), problem, options);
        }
    }

    /// Scales the noise of each coordinate by how much the model in full misses.
    fn scale_noise(&mut self, point: &[f64], problem: &Problem, options: &GradientOptions) {
        let predicted = problem.in_full.predictions(&problem.experiment.design.at(point));
        self.history.push(problem.cost.cost(&predicted).value);
        if options.scale_noise {
            self.noise_scale = problem.misses(&predicted, &self.noise_scale, options.robust);
        }
    }

    /// Fits from these points, among the modes found before.
    fn add_modes(&mut self, points: Vec<Vec<f64>>, problem: &Problem, options: &GradientOptions, depth: Depth) {
        let view = View { correction: vec![], ..self.view(problem) };
        let found: Vec<(Option<Mode>, Vec<f64>)> =
            points.par_iter().map(|p| mode(problem, &view, p, options, depth)).collect();
        for (mode, costs) in found {
            self.history.extend(costs);
            self.modes.extend(mode);
        }
        self.modes.sort_by(|a, b| a.fit.half_sum.total_cmp(&b.fit.half_sum));
    }

    /// Scales the noise as the best mode misses, and fits the likely modes again, now by the model in full.
    fn rescale(&mut self, problem: &Problem, options: &GradientOptions) {
        self.stage = Stage::Samples;
        let Some(best) = self.best().cloned() else { return };
        self.scale_noise(&best.point, problem, options);
        let likely = |m: &Mode| m.fit.half_sum < best.half_sum + MISJUDGED;
        let before = std::mem::take(&mut self.modes);
        let points = before.iter().filter(|m| likely(m)).map(|m| m.fit.point.clone()).collect();
        self.add_modes(points, problem, options, Depth::InFull);
        if self.modes.is_empty() {
            self.modes = before;
        }
    }

    fn advance_samples(&mut self, problem: &Problem, options: &GradientOptions) {
        let chunk = self.drawn..options.samples.min(self.drawn + CHUNK);
        self.drawn = chunk.end;
        let (plain, limit) = (self.view(problem), self.limit(problem));
        let stop = Stop { evaluations: options.sample_evaluations, fall: 1e-2 };
        let drawn: Vec<Option<Fit>> = chunk
            .into_par_iter()
            .map(|s| {
                let mut random = ChaCha8Rng::seed_from_u64(self.seed);
                random.set_stream(1 + s as u64);
                let middle = point(&mut random, self.start.len());
                let shift = plain.shift.iter().map(|_| std::array::from_fn(|_| normal(&mut random))).collect();
                let mode = self.mode_of((s as f64 + 0.5) / options.samples as f64)?;
                let view = View { shift, middle: middle.clone(), correction: mode.correction.clone(), ..plain.clone() };
                let start = near(problem, &view, &mode.fit.point).unwrap_or(middle);
                let first = fit(problem, &view, &start, stop).0;
                if first.as_ref().is_some_and(|f| f.half_sum <= limit) {
                    return first;
                }
                // stuck: once more from the mode itself
                let second = fit(problem, &view, &mode.fit.point, stop).0;
                first.into_iter().chain(second).reduce(|a, b| if b.half_sum < a.half_sum { b } else { a })
            })
            .collect();
        self.samples.extend(drawn.into_iter().flatten());
        if self.drawn >= options.samples {
            self.stage = Stage::TakeUp;
        }
    }

    /// The half sum of squares above which a sample has not come near a fit: a sample's exceeds the best fit's by half a sum of as many squared
    /// normals as there are numbers measured, give or take.
    pub fn limit(&self, problem: &Problem) -> f64 {
        let measured = problem.targets.trials.iter().flat_map(|t| t.measured).flatten().count() as f64;
        self.best().map_or(0.0, |b| b.half_sum) + 0.5 * (measured + 4.0 * (6.0 * measured).sqrt())
    }

    /// The mode whose samples hold this place, 0 to 1: modes share the samples by their probability.
    fn mode_of(&self, place: f64) -> Option<&Mode> {
        let best = self.best()?.half_sum;
        let weight = |m: &Mode| {
            let below = m.fit.half_sum - best;
            if below < UNLIKELY { (-below).exp() } else { 0.0 }
        };
        let all: f64 = self.modes.iter().map(weight).sum();
        let mut sum = 0.0;
        self.modes.iter().find(|m| {
            sum += weight(m) / all;
            sum >= place
        })
    }

    /// Fits once more from the samples that fit the measurements best: by the search, and in full where that leads to another likely mode.
    fn take_up(&mut self, problem: &Problem, options: &GradientOptions) {
        self.stage = Stage::Descents;
        let (view, stop) = (self.view(problem), Stop { evaluations: options.evaluations, fall: 1e-3 });
        let half_sum =
            |f: &Fit| problem.least_squares(&f.point, &view).map(|e| (e.residuals.half_sum(), f.point.clone()));
        let mut sums: Vec<(f64, Vec<f64>)> = self.samples.par_iter().filter_map(half_sum).collect();
        sums.sort_by(|a, b| a.0.total_cmp(&b.0));
        sums.truncate(TAKEN_UP);
        let fits: Vec<(Option<Fit>, Vec<f64>)> = sums.par_iter().map(|s| fit(problem, &view, &s.1, stop)).collect();
        let mut points = Vec::new();
        for (fit, costs) in fits {
            self.history.extend(costs);
            points.extend(fit.filter(|f| self.is_another(f)).map(|f| f.point));
        }
        self.add_modes(points, problem, options, Depth::InFull);
    }

    /// Whether a fit is likely and none of the modes.
    fn is_another(&self, fit: &Fit) -> bool {
        let apart = |m: &Mode| m.fit.point.iter().zip(&fit.point).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let best = self.best().map_or(f64::INFINITY, |b| b.half_sum);
        fit.half_sum < best + UNLIKELY && self.modes.iter().all(|m| apart(m) > SAME)
    }

    fn advance_descents(&mut self, problem: &Problem, options: &GradientOptions) {
        self.stage = Stage::Finished;
        let mut from: Vec<(f64, Vec<f64>)> = self.candidates();
        from.sort_by(|a, b| a.0.total_cmp(&b.0));
        let trust = Trust { radius: 0.2, least: 1e-3, evaluations: options.descent_evaluations };
        let points: Vec<Vec<f64>> = from.into_iter().take(options.descents).map(|f| f.1).collect();
        let found: Vec<_> =
            points.par_iter().map(|p| descend_on_cost(&problem.experiment, &problem.cost, p, trust)).collect();
        for f in found.into_iter().flatten() {
            self.history.extend(f.history);
            self.descents.push((f.cost, f.point));
        }
    }
}

/// By which model a mode is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Depth {
    /// The search, corrected twice by what the model in full predicts more.
    Corrected,
    /// That once, then the model in full.
    InFull,
}

/// A fit of the search corrected by what the model in full predicts more at the start, then of that again or of the model in full.
fn mode(
    problem: &Problem,
    view: &View,
    start: &[f64],
    options: &GradientOptions,
    depth: Depth,
) -> (Option<Mode>, Vec<f64>) {
    let stop = Stop { evaluations: options.evaluations, fall: 1e-3 };
    let corrected = |point: &[f64]| View { correction: correction(problem, point), ..view.clone() };
    let (near, mut costs) = fit(problem, &corrected(start), start, stop);
    let point = near.map_or_else(|| start.to_vec(), |f| f.point);
    let then = match depth {
        Depth::Corrected => corrected(&point),
        Depth::InFull => View { in_full: true, ..view.clone() },
    };
    let (fitted, more) = fit(problem, &then, &point, stop);
    costs.extend(more);
    (fitted.map(|fit| Mode { correction: correction(problem, &fit.point), fit }), costs)
}

/// What the model in full predicts more than the search; 0 where either has no answer.
fn correction(problem: &Problem, point: &[f64]) -> Vec<[f64; 5]> {
    let values = problem.experiment.design.at(point);
    let (full, seen) = (problem.in_full.predictions(&values), problem.experiment.predictions(&values));
    let more = |(full, seen): (&Option<[f64; 5]>, &Option<[f64; 5]>)| match (full, seen) {
        (Some(a), Some(b)) => std::array::from_fn(|c| a[c] - b[c]),
        _ => [0.0; 5],
    };
    full.iter().zip(&seen).map(more).collect()
}

/// Where a sample would lie if the model were linear about the best fit: there its search begins. What the data do not touch is at once where the
/// sample's prior has it.
fn near(problem: &Problem, view: &View, point: &[f64]) -> Option<Vec<f64>> {
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

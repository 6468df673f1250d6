//! Descents on the cost with the solver's derivatives: from many starts, the best of them on, then from points a random way off the best
//! found [wales1997]; a state that advances a chunk at a time and can be saved between chunks. No prior: the lowest cost, as the paper's recipe seeks it.

use crate::descent::{Trust, descend};
use crate::options::HopOptions;
use crate::problem::Problem;
use crate::swarm::latin_hypercube;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Descents a chunk: a fixed number, so that saved states and histories do not depend on the number of threads.
const CHUNK: usize = 8;
/// The best points, from which hops go in turn.
const KEPT: usize = 2;
/// First trust radius of a descent from a start, and of the others, in widths of the ranges [-].
const RADIUS: [f64; 2] = [0.3, 0.15];
/// Radius at which a descent has converged [-].
const LEAST: f64 = 1e-3;

/// Between two chunks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hops {
    start: Vec<f64>,
    seed: u64,
    /// Where the starts led, lowest cost first once all are there.
    pub starts: Vec<(f64, Vec<f64>)>,
    started: usize,
    refined: bool,
    hopped: usize,
    best: Vec<(f64, Vec<f64>)>,
    /// The cost of every evaluation, in order.
    pub history: Vec<f64>,
}

impl Hops {
    /// From a start in unit coordinates.
    pub fn new(start: &[f64], seed: u64) -> Hops {
        let (starts, best, history) = (vec![], vec![], vec![]);
        Hops { start: start.to_vec(), seed, starts, started: 0, refined: false, hopped: 0, best, history }
    }

    /// True when there is nothing left to do.
    pub fn is_finished(&self, options: &HopOptions) -> bool {
        self.refined && (self.hopped >= options.hops || self.best.is_empty())
    }

    /// The lowest costs found and where, lowest first.
    pub fn best(&self) -> &[(f64, Vec<f64>)] {
        &self.best
    }

    /// Share of the work done, 0 to 1, by count of evaluations.
    pub fn share(&self, o: &HopOptions) -> f64 {
        let refining = if self.refined { o.finalists * o.evaluations } else { 0 };
        let done = self.started * o.first_evaluations + refining + self.hopped * o.hop_evaluations;
        let all = o.starts * o.first_evaluations + o.finalists * o.evaluations + o.hops * o.hop_evaluations;
        done as f64 / all.max(1) as f64
    }

    /// A chunk of starts, the best of them on, or a chunk of hops.
    pub fn advance(&mut self, problem: &Problem, o: &HopOptions) {
        if self.started < o.starts {
            let mut random = ChaCha8Rng::seed_from_u64(self.seed);
            let mut points = latin_hypercube(self.start.len(), o.starts, &mut random);
            points[0] = self.start.clone();
            let to = o.starts.min(self.started + CHUNK);
            let found = self.descend(problem, &points[self.started..to], RADIUS[0], o.first_evaluations);
            self.starts.extend(found);
            self.started = to;
            self.starts.sort_by(|a, b| a.0.total_cmp(&b.0));
            self.best = self.starts.clone();
        } else if !self.refined {
            let points: Vec<Vec<f64>> = self.starts.iter().take(o.finalists).map(|s| s.1.clone()).collect();
            let found = self.descend(problem, &points, RADIUS[1], o.evaluations);
            self.keep(found);
            self.refined = true;
        } else {
            let to = o.hops.min(self.hopped + CHUNK);
            let points: Vec<Vec<f64>> = (self.hopped..to).map(|n| self.hop(n, o)).collect();
            let found = self.descend(problem, &points, RADIUS[1], o.hop_evaluations);
            self.keep(found);
            self.hopped = to;
        }
    }

    /// The `n`-th point off the best: some of its coordinates, drawn anew each time, moved.
    fn hop(&self, n: usize, o: &HopOptions) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(1 + n as u64);
        let from = &self.best[n % self.best.len().min(KEPT)].1;
        let mut moved = |x: &f64| {
            let (chosen, way) = (random.random_range(0.0..1.0) < o.hop_share, random.random_range(-1.0..1.0));
            if chosen { (x + o.hop_size * way).clamp(0.0, 1.0) } else { *x }
        };
        from.iter().map(&mut moved).collect()
    }

    fn keep(&mut self, found: Vec<(f64, Vec<f64>)>) {
        self.best.extend(found);
        self.best.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.best.truncate(2 * KEPT);
    }

    fn descend(
        &mut self,
        problem: &Problem,
        points: &[Vec<f64>],
        radius: f64,
        evaluations: usize,
    ) -> Vec<(f64, Vec<f64>)> {
        let trust = Trust { radius, least: LEAST, evaluations };
        let found: Vec<_> = points.par_iter().map(|p| descend(&problem.experiment, &problem.cost, p, trust)).collect();
        let mut ends = Vec::new();
        for f in found.into_iter().flatten() {
            self.history.extend(f.history);
            ends.push((f.cost, f.point));
        }
        ends
    }
}

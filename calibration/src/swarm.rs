//! Particle swarm in a unit box [kennedy1995], with Clerc and Kennedy's constriction [clerc2002].
//!
//! A generation's particles are independent, so they are evaluated in parallel; random numbers come from a stream of the seed for
//! each generation, so that a saved swarm goes on as if it had not been interrupted.

use rand::RngExt;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Inertia of the constricted swarm [clerc2002].
const INERTIA: f64 = 0.729_843_788;
/// Pull towards a particle's own and the swarm's best [clerc2002].
const PULL: f64 = 1.496_179_766;

/// A swarm between two generations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Swarm {
    seed: u64,
    /// Generations evaluated so far.
    pub generation: u64,
    positions: Vec<Vec<f64>>,
    velocities: Vec<Vec<f64>>,
    best: Vec<(f64, Vec<f64>)>,
}

impl Swarm {
    /// A swarm of `particles`, the first at `first`, the others spread as a Latin hypercube [mckay1979].
    pub fn new(first: &[f64], particles: usize, seed: u64) -> Swarm {
        let (n, mut random) = (first.len(), ChaCha8Rng::seed_from_u64(seed));
        let mut positions = latin_hypercube(n, particles, &mut random);
        if let Some(p) = positions.first_mut() {
            *p = first.to_vec();
        }
        let velocities = positions.iter().map(|_| (0..n).map(|_| random.random_range(-0.25..0.25)).collect()).collect();
        Swarm { seed, generation: 0, positions, velocities, best: vec![] }
    }

    /// Evaluates the particles (costs in the order of the points given) and moves them.
    pub fn advance(&mut self, evaluate: &mut dyn FnMut(&[Vec<f64>]) -> Vec<f64>) {
        let costs = evaluate(&self.positions);
        if self.generation == 0 {
            self.best = costs.into_iter().zip(self.positions.iter().cloned()).collect();
        } else {
            for ((cost, position), best) in costs.into_iter().zip(&self.positions).zip(&mut self.best) {
                if cost < best.0 {
                    *best = (cost, position.clone());
                }
            }
        }
        self.generation += 1;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(self.generation);
        let Some(leader) = self.best().map(|b| b.1.clone()) else { return };
        for ((x, v), own) in self.positions.iter_mut().zip(&mut self.velocities).zip(&self.best) {
            for k in 0..x.len() {
                let (a, b): (f64, f64) = (random.random_range(0.0..1.0), random.random_range(0.0..1.0));
                v[k] = INERTIA * v[k] + PULL * (a * (own.1[k] - x[k]) + b * (leader[k] - x[k]));
                x[k] += v[k];
                if !(0.0..=1.0).contains(&x[k]) {
                    x[k] = x[k].clamp(0.0, 1.0);
                    v[k] = 0.0;
                }
            }
        }
    }

    /// The lowest cost found and where; the earliest of equals.
    pub fn best(&self) -> Option<&(f64, Vec<f64>)> {
        self.best.iter().reduce(|a, b| if b.0 < a.0 { b } else { a })
    }

    /// The particles' own best, lowest cost first.
    pub fn ranked(&self) -> Vec<&(f64, Vec<f64>)> {
        let mut out: Vec<_> = self.best.iter().collect();
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        out
    }
}

/// `points` points of the unit box, one in each slice of each coordinate [mckay1979].
pub fn latin_hypercube(dimensions: usize, points: usize, random: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let mut out = vec![vec![0.0; dimensions]; points];
    for k in 0..dimensions {
        let mut slices: Vec<usize> = (0..points).collect();
        slices.shuffle(random);
        for (point, slice) in out.iter_mut().zip(slices) {
            point[k] = (slice as f64 + random.random_range(0.0..1.0)) / points as f64;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bowl(x: &[f64]) -> f64 {
        x.iter().enumerate().map(|(k, v)| (v - 0.2 - 0.02 * k as f64).powi(2)).sum()
    }

    #[test]
    fn a_swarm_finds_the_bottom_of_a_bowl() {
        let mut swarm = Swarm::new(&[0.9; 10], 25, 7);
        for _ in 0..120 {
            swarm.advance(&mut |points| points.iter().map(|p| bowl(p)).collect());
        }
        assert!(swarm.best().unwrap().0 < 1e-3, "{:?}", swarm.best());
    }

    #[test]
    fn a_swarm_in_a_corner_stays_in_the_box() {
        let mut swarm = Swarm::new(&[0.5; 6], 20, 3);
        for _ in 0..60 {
            swarm.advance(&mut |points| {
                assert!(points.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
                points.iter().map(|p| p.iter().sum()).collect()
            });
        }
        assert!(swarm.best().unwrap().0 < 1e-9);
    }

    #[test]
    fn a_latin_hypercube_has_one_point_a_slice() {
        let points = latin_hypercube(3, 8, &mut ChaCha8Rng::seed_from_u64(1));
        for k in 0..3 {
            let mut slices: Vec<usize> = points.iter().map(|p| (p[k] * 8.0) as usize).collect();
            slices.sort_unstable();
            assert_eq!(slices, (0..8).collect::<Vec<_>>());
        }
    }
}

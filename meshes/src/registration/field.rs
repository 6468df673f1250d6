//! A Gaussian field along a surface, seen at places: whitened by the nearest places before each, its covariance by likelihood.

use super::target::tree_of;
use crate::Point;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix6, SVector, Vector6};

/// How fast the correlation of a field falls with distance: Matern's functions of half-integer order [matern1986].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Smoothness {
    /// Order 3/2: the field has one derivative.
    Once,
    /// Order 5/2: two.
    Twice,
    /// Order 7/2: three.
    Thrice,
}

/// How residuals vary along the surface: a part that is correlated over some length and a part of each point by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance {
    /// Variance of the correlated part [mm2].
    pub correlated: f64,
    /// Length of Matern's function [mm].
    pub length: f64,
    /// Order of it.
    pub smoothness: Smoothness,
    /// Variance of the part of each point by itself [mm2].
    pub white: f64,
}

/// One place where the field is seen, with the unknowns' say in it.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Where [mm].
    pub point: Point,
    /// How each of six unknowns changes the value, then the value [mm].
    pub row: SVector<f64, 7>,
    /// How many points were averaged: their own part is smaller by so much.
    pub count: f64,
}

/// For each place the nearest of the places before it, at most [`NEIGHBOURS`], nearest first.
pub struct Order {
    before: Vec<Vec<u32>>,
}

/// Sums over whitened rows: what least squares needs.
pub struct Whitened {
    /// Information of the six unknowns.
    pub information: Matrix6<f64>,
    /// Right-hand side.
    pub rhs: Vector6<f64>,
    /// Sum of squares of the values.
    pub square: f64,
    /// Logarithm of the determinant of the covariance.
    pub log_determinant: f64,
    /// How many rows went in.
    pub count: f64,
}

/// How many earlier places each is whitened by.
const NEIGHBOURS: usize = 24;

fn correlation(smoothness: Smoothness, t: f64) -> f64 {
    match smoothness {
        Smoothness::Once => {
            let a = 3f64.sqrt() * t;
            (1.0 + a) * (-a).exp()
        }
        Smoothness::Twice => {
            let a = 5f64.sqrt() * t;
            (1.0 + a + a * a / 3.0) * (-a).exp()
        }
        Smoothness::Thrice => {
            let a = 7f64.sqrt() * t;
            (1.0 + a + 0.4 * a * a + a * a * a / 15.0) * (-a).exp()
        }
    }
}

/// The nearest places before the `i`-th among those of a tree; `None` where it does not tell enough of them.
fn earlier(tree: &ImmutableKdTree<f64, 3>, places: &[Place], i: usize) -> Option<Vec<u32>> {
    let p = &places[i].point;
    let many = std::num::NonZero::new(4 * NEIGHBOURS)?;
    let found = tree.query(&[p.x, p.y, p.z]).nearest_n::<SquaredEuclidean<f64>>(many).execute();
    let near: Vec<u32> = found.into_iter().map(|f| f.item).filter(|&j| (j as usize) < i).collect();
    (near.len() >= NEIGHBOURS).then(|| nearest_of(places, i, near.into_iter()))
}

/// The nearest [`NEIGHBOURS`] of some places to the `i`-th, nearest first.
fn nearest_of(places: &[Place], i: usize, of: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut near: Vec<(f64, u32)> =
        of.map(|j| ((places[j as usize].point - places[i].point).norm_squared(), j)).collect();
    if near.len() > NEIGHBOURS {
        near.select_nth_unstable_by(NEIGHBOURS - 1, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(NEIGHBOURS);
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.into_iter().map(|(_, j)| j).collect()
}

impl Order {
    /// Finds the neighbours of places that are ordered far apart first (as `sample::farthest` does), which makes few of
    /// them enough [guinness2018].
    pub fn new(places: &[Place]) -> Order {
        let mut before = Vec::with_capacity(places.len());
        // Trees over twice as many places each time: at least half of those in one come before the place that asks.
        let mut tree = None;
        let mut held = 0;
        for i in 0..places.len() {
            if i >= held {
                held = (2 * held).max(4 * NEIGHBOURS).min(places.len());
                tree = tree_of(&places[..held].iter().map(|p| p.point).collect::<Vec<_>>());
            }
            let from_tree = tree.as_ref().and_then(|tree| earlier(tree, places, i));
            before.push(from_tree.unwrap_or_else(|| nearest_of(places, i, 0..i as u32)));
        }
        Order { before }
    }

    /// Whitens every `every`-th place by its nearest `neighbours` before it [vecchia1988], the variances in units of the
    /// noise's correlated part (of its white part where nothing is correlated).
    pub fn whiten(&self, places: &[Place], noise: &Covariance, neighbours: usize, every: usize) -> Whitened {
        let (unit, own) = if noise.correlated > 0.0 { (1.0, noise.white / noise.correlated) } else { (0.0, 1.0) };
        let between = |i: usize, j: usize| {
            unit * correlation(noise.smoothness, (places[i].point - places[j].point).norm() / noise.length)
        };
        let alone = |i: usize| unit + own / places[i].count + 1e-6;
        let mut sums = Whitened {
            information: Matrix6::zeros(),
            rhs: Vector6::zeros(),
            square: 0.0,
            log_determinant: 0.0,
            count: 0.0,
        };
        let mut factor = vec![0.0; (NEIGHBOURS + 1) * (NEIGHBOURS + 1)];
        for i in (0..places.len()).step_by(every.max(1)) {
            let near = &self.before[i][..self.before[i].len().min(neighbours)];
            let m = near.len();
            // Cholesky factor of the covariance of the neighbours, nearest last, and then the place itself: its last row
            // and the same elimination on the neighbours' rows whiten the place's.
            let index = |k: usize| if k < m { near[k] as usize } else { i };
            let mut rows = [SVector::<f64, 7>::zeros(); NEIGHBOURS + 1];
            for a in 0..=m {
                let mut row = places[index(a)].row;
                for b in 0..=a {
                    let mut value = if a == b { alone(index(a)) } else { between(index(a), index(b)) };
                    for c in 0..b {
                        value -= factor[a * (NEIGHBOURS + 1) + c] * factor[b * (NEIGHBOURS + 1) + c];
                    }
                    factor[a * (NEIGHBOURS + 1) + b] =
                        if a == b { value.max(1e-9).sqrt() } else { value / factor[b * (NEIGHBOURS + 1) + b] };
                    if b < a {
                        row -= factor[a * (NEIGHBOURS + 1) + b] * rows[b];
                    }
                }
                rows[a] = row / factor[a * (NEIGHBOURS + 1) + a];
            }
            sums.add(&rows[m], factor[m * (NEIGHBOURS + 1) + m]);
        }
        sums
    }

    /// The covariance of greatest restricted likelihood [patterson1971]: a compass search over length and share of the
    /// part of each point by itself, for each smoothness.
    pub fn likeliest(&self, places: &[Place]) -> Covariance {
        let mut best =
            (f64::INFINITY, Covariance { correlated: 0.0, length: 1.0, smoothness: Smoothness::Once, white: 1.0 });
        let mut judge = |noise: Covariance| {
            let sums = self.whiten(places, &noise, 12, 3);
            let Some((cost, variance)) = sums.restricted() else { return f64::INFINITY };
            if cost < best.0 {
                best = (
                    cost,
                    Covariance { correlated: variance * noise.correlated, white: variance * noise.white, ..noise },
                );
            }
            cost
        };
        judge(Covariance { correlated: 0.0, length: 1.0, smoothness: Smoothness::Once, white: 1.0 });
        let mut at = [6f64.ln(), 0.1f64.ln()];
        for (smoothness, first) in [(Smoothness::Twice, 0.8), (Smoothness::Once, 0.4), (Smoothness::Thrice, 0.4)] {
            let mut noise = |at: [f64; 2]| {
                judge(Covariance { correlated: 1.0, length: at[0].exp(), smoothness, white: at[1].exp() })
            };
            let (mut here, mut cost, mut step) = (at, noise(at), first);
            while step > 0.15 {
                let tries = [(0, step), (0, -step), (1, 2.0 * step), (1, -2.0 * step)];
                let better = tries.into_iter().find_map(|(k, by)| {
                    let mut there = here;
                    there[k] = (there[k] + by).clamp([0.0, -9.0][k], [4.0, 5.0][k]);
                    let less = noise(there);
                    (less < cost - 1e-9).then_some((there, less))
                });
                match better {
                    Some(found) => (here, cost) = found,
                    None => step *= 0.5,
                }
            }
            // The others begin where the first of them ended.
            if smoothness == Smoothness::Twice {
                at = here;
            }
        }
        best.1
    }
}

impl Whitened {
    fn add(&mut self, row: &SVector<f64, 7>, deviation: f64) {
        let unknowns = row.fixed_rows::<6>(0).into_owned();
        self.information += unknowns * unknowns.transpose();
        self.rhs -= unknowns * row[6];
        self.square += row[6] * row[6];
        self.log_determinant += 2.0 * deviation.ln();
        self.count += 1.0;
    }

    /// Twice the negative restricted log likelihood, but for a constant, and the likeliest variance unit [mm2].
    fn restricted(&self) -> Option<(f64, f64)> {
        let factor = self.information.cholesky()?;
        let left = (self.square - self.rhs.dot(&factor.solve(&self.rhs))).max(1e-18);
        let free = self.count - 6.0;
        let variance = left / free;
        let spread = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let cost = free * variance.ln() + self.log_determinant + spread;
        cost.is_finite().then_some((cost, variance))
    }
}

//! Generalised least squares on residuals that are correlated along the surface, as errors of a segmentation are.

use super::field::{Covariance, Order, Place};
use super::rigid::{plane_row, small_motion};
use super::sample::{farthest, systematic};
use super::target::{nearest_in, tree_of};
use crate::{Isometry, Point, Vector};
use nalgebra::{Matrix6, SVector, Vector6};
use rayon::prelude::*;

/// A point-to-plane equation of one vertex.
#[derive(Clone, Copy, Debug)]
pub struct Equation {
    /// The scan's point in the bone's frame [mm].
    pub point: Point,
    /// Unit normal of the bone.
    pub normal: Vector,
    /// Signed distance [mm].
    pub residual: f64,
    /// Area of the vertex [mm2].
    pub weight: f64,
    /// Its patch, of [`patches`].
    pub patch: u32,
}

/// The step and its covariance, in (translation, rotation) about the centre [mm, rad].
pub struct Solution {
    /// The motion that takes the scan onto the bone.
    pub step: Isometry,
    /// Its unknowns.
    pub unknowns: Vector6<f64>,
    /// Covariance of its unknowns, 6 x 6.
    pub covariance: Matrix6<f64>,
    /// What the residuals showed.
    pub noise: Covariance,
}

/// Which of the places, far apart and in the order of [`farthest`], each of `points` is nearest to: about `size` [mm] apart,
/// at most 4000, chosen from 8000 of the points.
pub fn patches(points: &[Point], size: f64) -> Vec<u32> {
    let few = systematic(&vec![1.0; points.len()], 8000);
    let few: Vec<Point> = few.into_iter().map(|i| points[i]).collect();
    let centres: Vec<Point> = farthest(&few, 4000, size).0.into_iter().map(|i| few[i]).collect();
    match tree_of(&centres) {
        Some(tree) => points.par_iter().map(|p| nearest_in(&tree, p).0 as u32).collect(),
        None => vec![0; points.len()],
    }
}

/// Solves the equations by generalised least squares [aitken1936] over their patches.
///
/// The covariance of the residuals is `noise`, or else the likeliest by the residuals themselves, so independent noise gives
/// plain least squares. O(patches x neighbours^3). `None` for fewer than 20 patches or where a direction is free.
pub fn solve(equations: &[Equation], centre: &Point, noise: Option<Covariance>) -> Option<Solution> {
    let places = means(equations, centre);
    if places.len() < 20 {
        return None;
    }
    let order = Order::new(&places);
    let noise = noise.unwrap_or_else(|| order.likeliest(&places));
    let sums = order.whiten(&places, &noise, usize::MAX, 1);
    let factor = sums.information.cholesky()?;
    let x = factor.solve(&sums.rhs);
    let unit = if noise.correlated > 0.0 { noise.correlated } else { noise.white };
    x.iter().all(|v| v.is_finite()).then(|| Solution {
        step: small_motion(&x, centre),
        unknowns: x,
        covariance: factor.inverse() * unit,
        noise,
    })
}

/// The mean equation of each patch that has one.
fn means(equations: &[Equation], centre: &Point) -> Vec<Place> {
    let count = equations.iter().map(|e| e.patch as usize + 1).max().unwrap_or(0);
    let mut sums = vec![(Vector::zeros(), SVector::<f64, 7>::zeros(), 0.0, 0.0); count];
    for e in equations {
        let sum = &mut sums[e.patch as usize];
        let row = plane_row(&e.point, &e.normal, centre).push(e.residual);
        sum.0 += e.weight * e.point.coords;
        sum.1 += e.weight * row;
        sum.2 += e.weight;
        sum.3 += e.weight * e.weight;
    }
    sums.iter()
        .filter(|s| s.2 > 0.0)
        .map(|s| Place { point: Point::from(s.0 / s.2), row: s.1 / s.2, count: s.2 * s.2 / s.3 })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::sample::spread;
    use crate::shapes::cuboid;
    use rand::{RngExt, SeedableRng};

    fn equations(moved: &Isometry, error: impl Fn(usize, &Point) -> f64) -> Vec<Equation> {
        let samples = spread(&cuboid([60.0, 50.0, 40.0]), 6000);
        let size = Vector::new(60.0, 50.0, 40.0);
        let face = |p: &Point| {
            let side = |k: usize| f64::from((p[k] - size[k]).abs() < 1e-9) - f64::from(p[k].abs() < 1e-9);
            Vector::new(side(0), side(1), side(2))
        };
        let patches = patches(&samples.points, 4.0);
        samples
            .points
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let normal = face(p);
                let point = moved * p;
                let residual = (point - p).dot(&normal) + error(i, p);
                Equation { point, normal, residual, weight: 1.0, patch: patches[i] }
            })
            .collect()
    }

    #[test]
    fn a_small_motion_is_undone() {
        let moved = Isometry::new(Vector::new(0.01, -0.02, 0.03), Vector::new(1e-4, -2e-4, 1e-4));
        let found = solve(&equations(&moved, |_, _| 0.0), &Point::origin(), None).unwrap().step * moved;
        assert!(found.translation.vector.norm() < 1e-4 && found.rotation.angle() < 1e-5, "{found}");
    }

    #[test]
    fn the_covariance_of_the_noise_is_recognised() {
        let still = Isometry::identity();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let drawn: Vec<f64> = (0..6000).map(|_| rng.random_range(-0.1..0.1)).collect();
        let independent = equations(&still, |i, _| drawn[i]);
        let white = solve(&independent, &Point::origin(), None).unwrap();
        let mut plain = crate::registration::rigid::PlaneEquations::about(Point::origin());
        independent.iter().for_each(|e| plain.add(&e.point, &e.normal, e.residual, e.weight));
        let least = plain.matrix.try_inverse().unwrap() * (0.1f64.powi(2) / 3.0);
        let ratio = (white.covariance.trace() / least.trace(), white.noise);
        assert!((0.7..1.5).contains(&ratio.0), "independent errors: plain least squares, {ratio:?}");
        let waves = |_: usize, p: &Point| -> f64 {
            let wave = |k: i32| {
                let (k, turn) = (f64::from(k), 2.399_963 * f64::from(k));
                let z = (k + 0.5) / 20.0 - 1.0;
                let along = Vector::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z);
                (0.1 + 0.3 * (0.618 * k).fract()) * along.dot(&p.coords) + k * k
            };
            (0..40).map(|k| 0.02 * wave(k).cos()).sum()
        };
        let smooth = solve(&equations(&still, waves), &Point::origin(), None).unwrap();
        assert!(smooth.noise.correlated > 0.7 * (smooth.noise.correlated + smooth.noise.white), "{:?}", smooth.noise);
        assert!(smooth.noise.length > 3.0, "{:?}", smooth.noise);
        let error = |s: &Solution| s.covariance.fixed_view::<3, 3>(0, 0).trace();
        assert!(error(&smooth) > 3.0 * error(&white), "correlated noise leaves the pose less certain");
    }
}

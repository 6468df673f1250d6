//! Generalised least squares on residuals that are correlated along the surface, as errors of a segmentation are.

use super::rigid::{plane_row, small_motion};
use super::sample::farthest;
use super::target::{nearest_in, tree_of};
use crate::{Isometry, Point, Vector};
use kiddo::SquaredEuclidean;
use nalgebra::{Matrix6, SVector, Vector6};

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
}

/// How residuals vary along the surface: a part that is correlated up to `range` and a part of each vertex by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covariance {
    /// Variance of the correlated part [mm2].
    pub correlated: f64,
    /// Distance beyond which nothing is correlated [mm].
    pub range: f64,
    /// Variance of the part of each vertex by itself [mm2].
    pub white: f64,
}

/// The step and its covariance, in (translation, rotation) about the centre [mm, rad].
pub struct Solution {
    /// The motion that takes the scan onto the bone.
    pub step: Isometry,
    /// Covariance of its unknowns, 6 x 6.
    pub covariance: Matrix6<f64>,
    /// What the residuals showed.
    pub noise: Covariance,
}

/// Vertices about a centre, taken together.
struct Patch {
    place: Point,
    row: Vector6<f64>,
    residual: f64,
    single: f64,
    count: f64,
}

/// Correlation at a distance of `t` ranges: Wendland's function, positive definite in space [wendland1995].
fn correlation(t: f64) -> f64 {
    if t < 1.0 { (1.0 - t).powi(4) * (4.0 * t + 1.0) } else { 0.0 }
}

/// Solves the equations by generalised least squares [aitken1936] over patches of about `size` [mm].
///
/// The covariance of the residuals is estimated from themselves (variogram fit over distance classes of 2 mm [cressie1993]),
/// so independent noise gives plain least squares. Conjugate gradients on the sparse covariance, O(patches x neighbours).
/// `None` for fewer than 20 patches or where a direction is free.
pub fn solve(equations: &[Equation], centre: &Point, size: f64) -> Option<Solution> {
    let patches = patches(equations, centre, size);
    if patches.len() < 20 {
        return None;
    }
    let places: Vec<Point> = patches.iter().map(|p| p.place).collect();
    let tree = tree_of(&places)?;
    let neighbours: Vec<Vec<(usize, f64)>> = places
        .iter()
        .map(|p| {
            let near = tree.query(&[p.x, p.y, p.z]).within::<SquaredEuclidean<f64>>(REACH * REACH).execute();
            let mut near: Vec<(usize, f64)> = near.iter().map(|k| (k.item as usize, k.distance.sqrt())).collect();
            near.sort_by_key(|k| k.0);
            near
        })
        .collect();
    let noise = estimate(&patches, &neighbours);
    let matrix = sparse(&patches, &neighbours, &noise);
    let columns: Vec<[f64; 7]> =
        patches.iter().map(|p| std::array::from_fn(|k| if k < 6 { p.row[k] } else { p.residual })).collect();
    let mut information = Matrix6::zeros();
    let mut rhs = Vector6::zeros();
    for k in 0..7 {
        let column: Vec<f64> = columns.iter().map(|c| c[k]).collect();
        let whitened = conjugate_gradients(&matrix, &column);
        let dots: SVector<f64, 6> = patches.iter().zip(&whitened).map(|(p, w)| p.row * *w).sum();
        if k < 6 { information.set_column(k, &dots) } else { rhs = -dots }
    }
    let information = 0.5 * (information + information.transpose());
    let factor = information.cholesky()?;
    let x = factor.solve(&rhs);
    x.iter().all(|v| v.is_finite()).then(|| Solution {
        step: small_motion(&x, centre),
        covariance: factor.inverse(),
        noise,
    })
}

/// Largest range of correlation looked for [mm].
const REACH: f64 = 32.0;
const CLASS: f64 = 2.0;

fn patches(equations: &[Equation], centre: &Point, size: f64) -> Vec<Patch> {
    let points: Vec<Point> = equations.iter().map(|e| e.point).collect();
    let (chosen, _) = farthest(&points, 2500, size);
    let centres: Vec<Point> = chosen.iter().map(|&i| points[i]).collect();
    let Some(tree) = tree_of(&centres) else { return Vec::new() };
    let mut sums: Vec<(Vector, Vector6<f64>, f64, f64, f64)> =
        vec![(Vector::zeros(), Vector6::zeros(), 0.0, 0.0, 0.0); centres.len()];
    for e in equations {
        let sum = &mut sums[nearest_in(&tree, &e.point).0];
        sum.0 += e.weight * e.point.coords;
        sum.1 += e.weight * plane_row(&e.point, &e.normal, centre);
        sum.2 += e.weight * e.residual;
        sum.3 += e.weight;
        sum.4 += e.weight * e.weight;
    }
    sums.iter()
        .zip(&chosen)
        .filter(|(s, _)| s.3 > 0.0)
        .map(|(s, &i)| Patch {
            place: Point::from(s.0 / s.3),
            row: s.1 / s.3,
            residual: s.2 / s.3,
            single: equations[i].residual,
            count: s.3 * s.3 / s.4,
        })
        .collect()
}

/// The covariance that the residuals themselves show.
fn estimate(patches: &[Patch], neighbours: &[Vec<(usize, f64)>]) -> Covariance {
    let classes = (REACH / CLASS) as usize;
    let mut products = vec![(0.0, 0.0); classes];
    for (i, near) in neighbours.iter().enumerate() {
        for &(j, distance) in near.iter().filter(|(j, _)| *j > i) {
            let class = &mut products[((distance / CLASS) as usize).min(classes - 1)];
            class.0 += patches[i].residual * patches[j].residual;
            class.1 += 1.0;
        }
    }
    let variance = patches.iter().map(|p| p.single * p.single).sum::<f64>() / patches.len() as f64;
    let mut best = (f64::INFINITY, Covariance { correlated: 0.0, range: CLASS, white: variance });
    for step in 0..16 {
        let range = 5.0 * 1.13f64.powi(step);
        let model = |c: usize| correlation((c as f64 + 0.5) * CLASS / range);
        let sums = products
            .iter()
            .enumerate()
            .fold((0.0, 0.0), |s, (c, (product, pairs))| (s.0 + product * model(c), s.1 + pairs * model(c) * model(c)));
        let correlated = if sums.1 > 0.0 { (sums.0 / sums.1).clamp(0.0, variance) } else { 0.0 };
        let misfit = products
            .iter()
            .enumerate()
            .filter(|(_, (_, pairs))| *pairs > 0.0)
            .map(|(c, (product, pairs))| pairs * (product / pairs - correlated * model(c)).powi(2));
        let misfit: f64 = misfit.sum();
        if misfit < best.0 {
            best = (misfit, Covariance { correlated, range, white: variance - correlated });
        }
    }
    best.1
}

/// Rows of the covariance matrix of the patches' residuals. A twentieth of the variance stays each patch's own: what a
/// smooth model does not know of corners and facets.
fn sparse(patches: &[Patch], neighbours: &[Vec<(usize, f64)>], noise: &Covariance) -> Vec<Vec<(usize, f64)>> {
    let floor = 0.05 * (noise.correlated + noise.white) + 1e-12;
    neighbours
        .iter()
        .enumerate()
        .map(|(i, near)| {
            near.iter()
                .filter(|(j, distance)| *j == i || *distance < noise.range)
                .map(|&(j, distance)| {
                    let own = if j == i { noise.white / patches[i].count + floor } else { 0.0 };
                    (j, noise.correlated * correlation(distance / noise.range) + own)
                })
                .collect()
        })
        .collect()
}

/// Solves a sparse symmetric positive definite system to 1e-10 [hestenes1952].
fn conjugate_gradients(matrix: &[Vec<(usize, f64)>], rhs: &[f64]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut x = vec![0.0; rhs.len()];
    let mut residual = rhs.to_vec();
    let mut direction = rhs.to_vec();
    let mut square = dot(&residual, &residual);
    let goal = square * 1e-20;
    for _ in 0..500 {
        if square <= goal || square == 0.0 {
            break;
        }
        let moved: Vec<f64> = matrix.iter().map(|row| row.iter().map(|(j, v)| v * direction[*j]).sum()).collect();
        let step = square / dot(&direction, &moved);
        for i in 0..x.len() {
            x[i] += step * direction[i];
            residual[i] -= step * moved[i];
        }
        let next = dot(&residual, &residual);
        let ratio = next / square;
        square = next;
        direction.iter_mut().zip(&residual).for_each(|(d, r)| *d = r + ratio * *d);
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::sample::spread;
    use crate::shapes::cuboid;

    fn equations(moved: &Isometry, error: impl Fn(usize, &Point) -> f64) -> Vec<Equation> {
        let samples = spread(&cuboid([60.0, 50.0, 40.0]), 6000);
        let size = Vector::new(60.0, 50.0, 40.0);
        let face = |p: &Point| {
            let side = |k: usize| f64::from((p[k] - size[k]).abs() < 1e-9) - f64::from(p[k].abs() < 1e-9);
            Vector::new(side(0), side(1), side(2))
        };
        samples
            .points
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let normal = face(p);
                let point = moved * p;
                let residual = (point - p).dot(&normal) + error(i, p);
                Equation { point, normal, residual, weight: 1.0 }
            })
            .collect()
    }

    #[test]
    fn a_small_motion_is_undone() {
        let moved = Isometry::new(Vector::new(0.01, -0.02, 0.03), Vector::new(1e-4, -2e-4, 1e-4));
        let found = solve(&equations(&moved, |_, _| 0.0), &Point::origin(), 4.0).unwrap().step * moved;
        assert!(found.translation.vector.norm() < 1e-4 && found.rotation.angle() < 1e-5, "{found}");
    }

    #[test]
    fn the_covariance_of_the_noise_is_recognised() {
        let still = Isometry::identity();
        let white =
            solve(&equations(&still, |i, _| if i % 2 == 0 { 0.1 } else { -0.1 }), &Point::origin(), 4.0).unwrap();
        assert!(white.noise.correlated < 0.1 * white.noise.white, "{:?}", white.noise);
        let waves = |_: usize, p: &Point| -> f64 {
            let wave = |k: i32| {
                let (k, turn) = (f64::from(k), 2.399_963 * f64::from(k));
                let z = (k + 0.5) / 20.0 - 1.0;
                let along = Vector::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z);
                (0.1 + 0.3 * (0.618 * k).fract()) * along.dot(&p.coords) + k * k
            };
            (0..40).map(|k| 0.02 * wave(k).cos()).sum()
        };
        let smooth = solve(&equations(&still, waves), &Point::origin(), 4.0).unwrap();
        assert!(smooth.noise.correlated > 0.7 * (smooth.noise.correlated + smooth.noise.white), "{:?}", smooth.noise);
        let error = |s: &Solution| s.covariance.fixed_view::<3, 3>(0, 0).trace();
        assert!(error(&smooth) > 3.0 * error(&white), "correlated noise leaves the pose less certain");
    }
}

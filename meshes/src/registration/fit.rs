//! The last fit, on bare bone alone, and its grade by points it has not seen.

use super::bare::{Classified, Scan, classify};
use super::rigid::{PlaneEquations, plane_row};
use super::sample::{farthest, systematic};
use super::target::Target;
use crate::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Matrix6, Vector6};

/// A pose with its grade.
pub struct Fitted {
    /// Scan to bone.
    pub pose: Isometry,
    /// The scan under that pose.
    pub classified: Classified,
    /// Root mean square residual of bare bone that was fitted [mm].
    pub rms: f64,
    /// Root mean square residual of bare bone that was kept out [mm].
    pub held_out_rms: f64,
    /// Area share of bone-like vertices within reach of the bone.
    pub inlier_fraction: f64,
    /// Predicted mean error over the scan's vertices [mm].
    pub predicted_error: f64,
}

/// Fits to bare bone with `held_out` of each so many blocks kept out, `rounds` times anew telling bare bone from the rest;
/// `None` where bare bone does not fix the pose.
pub fn fit(target: &Target, scan: &Scan, start: &Isometry, rounds: usize, held_out: usize) -> Option<Fitted> {
    let vertices = &scan.mesh.mesh.vertices;
    let (_, blocks) = blocks_of(scan, 12.0);
    let kept_out = |i: usize| blocks[i] as usize % held_out == held_out - 1;
    let mut pose = *start;
    let mut classified = classify(target, scan, &pose);
    let mut information = Information::new(target.centre);
    for _ in 0..rounds {
        information = Information::new(target.centre);
        for (i, vertex) in vertices.iter().enumerate().filter(|(i, _)| classified.bare[*i] && !kept_out(*i)) {
            let s = &classified.standing[i];
            let weight = scan.areas[i] * (1.0 - (s.residual / (4.0 * classified.spread)).powi(2)).max(0.0).powi(2);
            information.add(&(pose * vertex), &s.normal, s.residual, weight, blocks[i]);
        }
        pose = information.equations.solve()? * pose;
        classified = classify(target, scan, &pose);
    }
    let (rms, held_out_rms) = (rms(scan, &classified, |i| !kept_out(i)), rms(scan, &classified, kept_out));
    let predicted_error = information.mean_error(&pose, vertices)?;
    let inlier_fraction = inlier_fraction(scan, &classified);
    Some(Fitted { pose, classified, rms, held_out_rms, inlier_fraction, predicted_error })
}

/// Blocks of about `size` [mm] over the scan: centres, and the block of each vertex.
fn blocks_of(scan: &Scan, size: f64) -> (Vec<Point>, Vec<u32>) {
    let vertices = &scan.mesh.mesh.vertices;
    let (centres, _) = farthest(vertices, 4000, size);
    let centres: Vec<Point> = centres.into_iter().map(|i| vertices[i]).collect();
    let Some(tree) = super::target::tree_of(&centres) else {
        return (centres, vec![0; vertices.len()]);
    };
    let block = vertices.iter().map(|p| super::target::nearest_in(&tree, p).0 as u32).collect();
    (centres, block)
}

fn rms(scan: &Scan, classified: &Classified, of: impl Fn(usize) -> bool) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for i in (0..scan.areas.len()).filter(|&i| classified.bare[i] && of(i)) {
        sum += scan.areas[i] * classified.standing[i].residual.powi(2);
        weight += scan.areas[i];
    }
    if weight > 0.0 { (sum / weight).sqrt() } else { f64::NAN }
}

fn inlier_fraction(scan: &Scan, classified: &Classified) -> f64 {
    let total = |flags: &[bool]| scan.areas.iter().zip(flags).filter(|(_, f)| **f).map(|(a, _)| a).sum::<f64>();
    total(&classified.bare) / total(&classified.bone_like).max(f64::MIN_POSITIVE)
}

/// Equations with the part of each block kept apart, so that residuals within a block may be correlated.
struct Information {
    equations: PlaneEquations,
    scores: std::collections::BTreeMap<u32, Vector6<f64>>,
}

impl Information {
    fn new(centre: Point) -> Information {
        Information { equations: PlaneEquations::about(centre), scores: std::collections::BTreeMap::new() }
    }

    fn add(&mut self, p: &Point, n: &Vector, residual: f64, weight: f64, block: u32) {
        self.equations.add(p, n, residual, weight);
        let row = plane_row(p, n, &self.equations.centre);
        *self.scores.entry(block).or_insert_with(Vector6::zeros) += weight * residual * row;
    }

    /// Mean error over the scan predicted by the block-wise sandwich covariance [liang1986].
    fn mean_error(&self, pose: &Isometry, vertices: &[Point]) -> Option<f64> {
        let inverse = self.equations.matrix.try_inverse()?;
        let middle: Matrix6<f64> = self.scores.values().map(|g| g * g.transpose()).sum();
        let n = self.scores.len() as f64;
        let covariance = inverse * middle * inverse * (n / (n - 6.0).max(1.0));
        Some(mean_displacement(&covariance, pose, vertices, &self.equations.centre))
    }
}

/// Mean over the vertices of the root mean square displacement under a pose covariance, times 0.92 (mean over rms of a
/// three-dimensional normal error) [mm].
fn mean_displacement(covariance: &Matrix6<f64>, pose: &Isometry, vertices: &[Point], centre: &Point) -> f64 {
    let chosen = systematic(&vec![1.0; vertices.len()], 500);
    let total: f64 = chosen
        .iter()
        .map(|&i| {
            let cross = (pose * vertices[i] - centre).cross_matrix();
            let mut lever = nalgebra::Matrix3x6::zeros();
            lever.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
            lever.fixed_view_mut::<3, 3>(0, 3).copy_from(&-cross);
            (lever * covariance * lever.transpose()).trace().max(0.0).sqrt()
        })
        .sum();
    0.92 * total / chosen.len().max(1) as f64
}

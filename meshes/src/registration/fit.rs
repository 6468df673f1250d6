//! The last fit, on bare bone alone, and its grade by points it has not seen.

use super::bare::{Classified, Scan, classify, tell};
use super::correlated::{Equation, patches, solve};
use super::field::Covariance;
use super::icp::Standing;
use super::rigid::{PlaneEquations, plane_row};
use super::sample::{farthest, systematic};
use super::target::{Target, nearest_in, spread_of, tree_of};
use crate::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Matrix6, Vector6};

/// Spacing of the patches over which residuals are averaged [mm].
const PATCH: f64 = 2.0;

/// A pose with its grade.
pub struct Fitted {
    /// Scan to bone.
    pub pose: Isometry,
    /// The scan under that pose.
    pub classified: Classified,
    /// Root mean square residual, from its level, of bare bone that was fitted [mm].
    pub rms: f64,
    /// Root mean square residual of bare bone that was kept out [mm].
    pub held_out_rms: f64,
    /// Area share of bone-like vertices within reach of the bone.
    pub inlier_fraction: f64,
    /// Predicted mean error over the scan's vertices [mm]: the covariance of the fit, scaled by the held-out residuals.
    pub predicted_error: f64,
    /// How the residuals vary along the surface.
    pub noise: Covariance,
}

/// Where a scan fits worst.
pub struct WorstPlace {
    /// Centre of the block, scan frame [mm].
    pub point: Point,
    /// Mean residual there [mm].
    pub residual: f64,
    /// 0, 1, 2: the third of the scan nearest its border, midway, farthest.
    pub third: usize,
}

impl Fitted {
    /// The block of bone-like scan with the largest mean residual; `None` without bone-like scan.
    pub fn worst_place(&self, scan: &Scan) -> Option<WorstPlace> {
        let vertices = &scan.mesh.mesh.vertices;
        let blocks = blocks_of(scan, 12.0);
        let mut sums = vec![(0.0, 0.0, Vector::zeros()); blocks.iter().max().map_or(0, |b| *b as usize + 1)];
        for i in (0..vertices.len()).filter(|&i| self.classified.bone_like[i]) {
            let sum = &mut sums[blocks[i] as usize];
            sum.0 += scan.areas[i];
            sum.1 += scan.areas[i] * self.classified.standing[i].residual;
            sum.2 += scan.areas[i] * vertices[i].coords;
        }
        let worst =
            sums.iter().filter(|s| s.0 > 20.0).max_by(|a, b| (a.1 / a.0).abs().total_cmp(&(b.1 / b.0).abs()))?;
        let point = Point::from(worst.2 / worst.0);
        let border: Vec<Point> = (0..vertices.len()).filter(|&i| scan.at_border[i]).map(|i| vertices[i]).collect();
        let away = spread_of(vertices).0 - spread_of(&border).0;
        let heights = vertices.iter().map(|p| p.coords.dot(&away));
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        let share = (point.coords.dot(&away) - low) / (high - low).max(f64::MIN_POSITIVE);
        Some(WorstPlace { point, residual: worst.1 / worst.0, third: ((3.0 * share) as usize).min(2) })
    }
}

/// Fits to bare bone with one of each `held_out` blocks kept out, by robust least squares; then, bare bone told anew, by
/// generalised least squares for correlated residuals: without those blocks for the grade, with them for the pose.
/// `None` where bare bone does not fix the pose.
pub fn fit(target: &Target, scan: &Scan, start: &Isometry, held_out: usize) -> Option<Fitted> {
    let vertices = &scan.mesh.mesh.vertices;
    let blocks = blocks_of(scan, 12.0);
    let patches = patches(vertices, PATCH);
    let kept_out = |i: usize| blocks[i] as usize % held_out == held_out - 1;
    let centre = spread_of(vertices).0;
    let mut pose = *start;
    let mut classified = classify(target, scan, &pose);
    let mut plain = PlaneEquations::about(pose * centre);
    for e in equations(scan, &classified, &pose, &patches, |i| !kept_out(i)) {
        let weight = e.weight * (1.0 - (e.residual / (4.0 * classified.spread)).powi(2)).max(0.0).powi(2);
        plain.add(&e.point, &e.normal, e.residual, weight);
    }
    let step = plain.solve()?;
    classified = tell(scan, stepped(scan, &classified, &pose, &step));
    pose = step * pose;
    let about = pose * centre;
    let mut all = equations(scan, &classified, &pose, &patches, |i| !kept_out(i));
    let held = equations(scan, &classified, &pose, &patches, kept_out);
    let graded = solve(&all, &about, None)?;
    let held_out_rms = rms_after(&graded.unknowns, &held, &about);
    all.extend(held);
    let solution = solve(&all, &about, Some(graded.noise))?;
    pose = solution.step * pose;
    classified = classify(target, scan, &pose);
    let rms = rms(scan, &classified);
    let scale = (held_out_rms / rms.max(1e-9)).powi(2).clamp(1.0, 10.0);
    let scale = if scale.is_finite() { scale } else { 1.0 };
    let predicted_error = mean_displacement(&(solution.covariance * scale), &pose, vertices, &about);
    let inlier_fraction = inlier_fraction(scan, &classified);
    Some(Fitted { pose, classified, rms, held_out_rms, inlier_fraction, predicted_error, noise: solution.noise })
}

/// How the vertices stand after a step of a few tenths of a mm: each moves along the normal at its foot, which is exact to
/// the second order in the step.
fn stepped(scan: &Scan, classified: &Classified, pose: &Isometry, step: &Isometry) -> Vec<Standing> {
    let vertices = scan.mesh.mesh.vertices.iter();
    vertices
        .zip(&classified.standing)
        .map(|(p, at)| {
            let p = pose * p;
            let residual = at.residual + (step * p - p).dot(&at.normal);
            Standing {
                residual,
                distance: (at.distance + residual.abs() - at.residual.abs()).max(residual.abs()),
                ..*at
            }
        })
        .collect()
}

/// The equation of each bare vertex among those that are asked for; residuals are from the level of bare bone.
fn equations(
    scan: &Scan,
    classified: &Classified,
    pose: &Isometry,
    patches: &[u32],
    of: impl Fn(usize) -> bool,
) -> Vec<Equation> {
    (0..scan.areas.len())
        .filter(|&i| classified.bare[i] && of(i))
        .map(|i| Equation {
            point: pose * scan.mesh.mesh.vertices[i],
            normal: classified.standing[i].normal,
            residual: classified.standing[i].residual - classified.level,
            weight: scan.areas[i],
            patch: patches[i],
        })
        .collect()
}

/// The block, of about `size` [mm], of each vertex.
fn blocks_of(scan: &Scan, size: f64) -> Vec<u32> {
    let vertices = &scan.mesh.mesh.vertices;
    let (centres, _) = farthest(vertices, 4000, size);
    let centres: Vec<Point> = centres.into_iter().map(|i| vertices[i]).collect();
    match tree_of(&centres) {
        Some(tree) => vertices.iter().map(|p| nearest_in(&tree, p).0 as u32).collect(),
        None => vec![0; vertices.len()],
    }
}

/// Root mean square residual of equations after a small motion of these unknowns [mm]; no number without equations.
fn rms_after(unknowns: &Vector6<f64>, equations: &[Equation], centre: &Point) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for e in equations {
        sum += e.weight * (e.residual + plane_row(&e.point, &e.normal, centre).dot(unknowns)).powi(2);
        weight += e.weight;
    }
    if weight > 0.0 { (sum / weight).sqrt() } else { f64::NAN }
}

fn rms(scan: &Scan, classified: &Classified) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for i in (0..scan.areas.len()).filter(|&i| classified.bare[i]) {
        sum += scan.areas[i] * (classified.standing[i].residual - classified.level).powi(2);
        weight += scan.areas[i];
    }
    if weight > 0.0 { (sum / weight).sqrt() } else { f64::NAN }
}

fn inlier_fraction(scan: &Scan, classified: &Classified) -> f64 {
    let total = |flags: &[bool]| scan.areas.iter().zip(flags).filter(|(_, f)| **f).map(|(a, _)| a).sum::<f64>();
    total(&classified.bare) / total(&classified.bone_like).max(f64::MIN_POSITIVE)
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

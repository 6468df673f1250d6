//! Iterated closest points, point to plane, robust: brings a rough pose close.

use super::rigid::PlaneEquations;
use super::sample::Samples;
use super::target::Target;
use crate::{Isometry, Point, Vector};

/// Moves `start` closer by samples alone, a step for each of `scales` [mm]: the residual at which a pair loses half its say
/// (Geman-McClure weights [zhou2016]); pairs whose normals differ by more than 60 degrees say nothing.
pub fn approach(target: &Target, source: &Samples, start: &Isometry, scales: &[f64]) -> Isometry {
    let mut pose = *start;
    for &scale in scales {
        let mut equations = PlaneEquations::about(target.centre);
        for (p, n) in source.points.iter().zip(&source.normals) {
            let (p, n) = (pose * p, pose * n);
            let (k, distance) = target.nearest_sample(&p);
            let (q, m) = (target.samples.points[k], target.samples.normals[k]);
            let facing = n.dot(&m);
            if facing < 0.5 {
                continue;
            }
            let weight = facing * (scale * scale / (scale * scale + distance * distance)).powi(2);
            equations.add(&p, &m, (p - q).dot(&m), weight);
        }
        match equations.solve() {
            Some(step) => pose = step * pose,
            None => break,
        }
    }
    pose
}

/// How well a pose explains the scan, 0 to 1: a sample on the bone counts 1, one up to 6 mm outside it, as cartilage lies, 0.4;
/// one within the bone, farther away or facing elsewhere 0.
pub fn agreement(target: &Target, source: &Samples, pose: &Isometry) -> f64 {
    let mut sum = 0.0;
    for (p, n) in source.points.iter().zip(&source.normals) {
        let (p, n) = (pose * p, pose * n);
        let (k, distance) = target.nearest_sample(&p);
        let (q, m) = (target.samples.points[k], target.samples.normals[k]);
        let residual = (p - q).dot(&m);
        if distance > 8.0 || n.dot(&m) < 0.7 {
            continue;
        }
        let near = (-(residual / 0.7).powi(2)).exp();
        sum += if (0.0..6.0).contains(&residual) { near.max(0.4) } else { near };
    }
    sum / source.points.len().max(1) as f64
}

/// Where a scan's point stands to the bone.
#[derive(Clone, Copy, Debug)]
pub struct Standing {
    /// Closest point of the bone [mm].
    pub foot: Point,
    /// Unit normal of the bone there, interpolated.
    pub normal: Vector,
    /// Signed distance along it [mm], positive outside.
    pub residual: f64,
    /// Distance to the foot [mm].
    pub distance: f64,
    /// Cosine between the normals of scan and bone.
    pub facing: f64,
}

/// Where a point with a unit normal, already moved to the bone's frame, stands.
pub fn standing(target: &Target, p: &Point, n: &Vector) -> Standing {
    let near = target.query.nearest(p);
    let normal = target.query.smooth_normal(&near);
    let along = (p - near.point).dot(&normal);
    Standing { foot: near.point, normal, residual: along, distance: near.distance, facing: n.dot(&normal) }
}

/// Moves `start` closer by exact closest points, a step for each of `scales` [mm] (Tukey weights [tukey1974] of that width).
pub fn refine(target: &Target, source: &Samples, start: &Isometry, scales: &[f64]) -> Isometry {
    let mut pose = *start;
    for &scale in scales {
        let mut equations = PlaneEquations::about(target.centre);
        for (p, n) in source.points.iter().zip(&source.normals) {
            let (p, n) = (pose * p, pose * n);
            let at = standing(target, &p, &n);
            if at.facing > 0.7 && at.distance < scale {
                let weight = (1.0 - (at.distance / scale).powi(2)).powi(2);
                equations.add(&p, &at.normal, at.residual, weight);
            }
        }
        match equations.solve() {
            Some(step) => pose = step * pose,
            None => break,
        }
    }
    pose
}

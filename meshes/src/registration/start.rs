//! Starting poses: from rough point pairs, else by a search over the whole surface; and the choice among them.

use super::features::{Search, describe, poses};
use super::icp::{agreement, approach};
use super::rigid::from_pairs;
use super::sample::{Samples, farthest};
use super::target::Target;
use crate::{Isometry, Point};

/// A rough pose with how well it explains the scan, 0 to 1.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Scan to bone.
    pub pose: Isometry,
    /// [`agreement`] of it.
    pub agreement: f64,
}

/// Poses from all pairs and from each three of them, so that some hold no bad pair; at most the first 12 pairs.
pub fn from_landmarks(pairs: &[(Point, Point)]) -> Vec<Isometry> {
    let pairs = &pairs[..pairs.len().min(12)];
    let mut poses: Vec<Isometry> = from_pairs(pairs).into_iter().collect();
    for i in 0..pairs.len() {
        for j in i + 1..pairs.len() {
            for k in j + 1..pairs.len() {
                poses.extend(from_pairs(&[pairs[i], pairs[j], pairs[k]]));
            }
        }
    }
    poses
}

/// Brings each pose close with a coarse part of the scan and returns the one that explains it best.
pub fn best(target: &Target, source: &Samples, poses: &[Isometry]) -> Option<Start> {
    let coarse = thinned(source, 300);
    let scales: Vec<f64> = (0..18).map(|i| 8.0 * 0.83f64.powi(i)).collect();
    let mut ranked: Vec<Start> = poses
        .iter()
        .map(|pose| {
            let pose = approach(target, &coarse, pose, &scales);
            Start { pose, agreement: agreement(target, &coarse, &pose) }
        })
        .collect();
    ranked.sort_by(|a, b| b.agreement.total_cmp(&a.agreement));
    ranked.truncate(3);
    let fine = thinned(source, 1500);
    let mut best: Option<Start> = None;
    for start in ranked {
        let pose = approach(target, &fine, &start.pose, &[2.0, 1.5, 1.2, 1.0, 1.0, 1.0]);
        let start = Start { pose, agreement: agreement(target, &fine, &pose) };
        if best.is_none_or(|b| start.agreement > b.agreement) {
            best = Some(start);
        }
    }
    best
}

/// Poses found without any hint.
pub fn search(target: &Target, source: &Samples, seed: u64) -> Vec<Isometry> {
    let radius = 0.25 * target.size;
    let here = describe(source, 300, radius);
    let there = describe(&target.samples, 900, radius);
    let few = thinned(source, 60);
    poses(target, &few, &here, &there, &Search { trials: 3000, keep: 20, seed })
}

/// Every so many-th of the samples, `count` of them, far apart when few.
pub fn thinned(source: &Samples, count: usize) -> Samples {
    let chosen = if count < 100 {
        farthest(&source.points, count, 0.0).0
    } else {
        let n = source.points.len();
        (0..count.min(n)).map(|k| k * n / count.min(n)).collect()
    };
    Samples {
        points: chosen.iter().map(|&k| source.points[k]).collect(),
        normals: chosen.iter().map(|&k| source.normals[k]).collect(),
    }
}

//! Descriptors of a surface about a point, after point feature histograms [rusu2009], and starting poses from their matches.

use super::icp::agreement;
use super::sample::{Samples, farthest};
use super::target::{Target, tree_of};
use crate::{Isometry, Point, Vector};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const BINS: usize = 11;
const LENGTH: usize = 2 * 3 * BINS;
type Descriptor = [f32; LENGTH];

/// Points with their descriptors.
pub struct Features {
    points: Vec<Point>,
    normals: Vec<Vector>,
    descriptors: Vec<Descriptor>,
}

/// Descriptors at `count` far-apart samples, over balls of `radius` and twice that [mm].
///
/// Each is, per ball, three histograms of the angles of [rusu2009] between the point's normal and each neighbour's
/// (the simplified histogram, not weighted over neighbours' own), square-rooted, so that their distance is Hellinger's.
pub fn describe(samples: &Samples, count: usize, radius: f64) -> Features {
    let (chosen, _) = farthest(&samples.points, count, 0.0);
    let mut features = Features { points: Vec::new(), normals: Vec::new(), descriptors: Vec::new() };
    let Some(tree) = tree_of(&samples.points) else {
        return features;
    };
    for k in chosen {
        features.points.push(samples.points[k]);
        features.normals.push(samples.normals[k]);
        features.descriptors.push(describe_one(samples, &tree, k, radius));
    }
    features
}

fn describe_one(samples: &Samples, tree: &ImmutableKdTree<f64, 3>, k: usize, radius: f64) -> Descriptor {
    let (p, n) = (samples.points[k], samples.normals[k]);
    let mut counts = [0f32; LENGTH];
    let reach = 4.0 * radius * radius;
    for near in tree.query(&[p.x, p.y, p.z]).within::<SquaredEuclidean<f64>>(reach).unsorted().execute() {
        let (q, m) = (samples.points[near.item as usize], samples.normals[near.item as usize]);
        let Some(d) = (q - p).try_normalize(1e-9) else { continue };
        let Some(v) = d.cross(&n).try_normalize(1e-6) else { continue };
        let w = n.cross(&v);
        let angles =
            [0.5 + 0.5 * v.dot(&m), 0.5 + 0.5 * n.dot(&d), 0.5 + w.dot(&m).atan2(n.dot(&m)) / std::f64::consts::TAU];
        for (a, angle) in angles.iter().enumerate() {
            let bin = ((angle * BINS as f64) as usize).min(BINS - 1);
            counts[LENGTH / 2 + a * BINS + bin] += 1.0;
            if near.distance < radius * radius {
                counts[a * BINS + bin] += 1.0;
            }
        }
    }
    for half in counts.chunks_mut(LENGTH / 2) {
        let total = half.iter().sum::<f32>().max(1.0);
        half.iter_mut().for_each(|c| *c = (*c / total).sqrt());
    }
    counts
}

/// The `k` nearest descriptors of `there` for each of `here`.
fn matches(here: &Features, there: &Features, k: usize) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (i, a) in here.descriptors.iter().enumerate() {
        let mut ranked: Vec<(f32, usize)> = there
            .descriptors
            .iter()
            .enumerate()
            .map(|(j, b)| (a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum(), j))
            .collect();
        let k = k.min(ranked.len());
        if k == 0 {
            continue;
        }
        ranked.select_nth_unstable_by(k - 1, |x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        ranked.truncate(k);
        ranked.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        pairs.extend(ranked.into_iter().map(|(_, j)| (i, j)));
    }
    pairs
}

/// What a search by features tries.
#[derive(Clone, Copy, Debug)]
pub struct Search {
    /// Poses tried.
    pub trials: usize,
    /// Poses kept.
    pub keep: usize,
    /// Seed of the draws.
    pub seed: u64,
}

/// Poses of `source` on the target from pairs of matched oriented points that are alike in distance and angles
/// [drost2010], best agreement first, no two nearly the same.
pub fn poses(target: &Target, source: &Samples, here: &Features, there: &Features, search: &Search) -> Vec<Isometry> {
    let pairs = matches(here, there, 8);
    if pairs.len() < 2 {
        return Vec::new();
    }
    let mut random = ChaCha8Rng::seed_from_u64(search.seed);
    let mut found: Vec<(f64, Isometry)> = Vec::new();
    let mut tried = 0;
    for _ in 0..search.trials * 200 {
        let ((i, k), (j, l)) = (pairs[random.random_range(0..pairs.len())], pairs[random.random_range(0..pairs.len())]);
        let a = [(here.points[i], here.normals[i]), (here.points[j], here.normals[j])];
        let b = [(there.points[k], there.normals[k]), (there.points[l], there.normals[l])];
        let Some(pose) = pose_of(&a, &b, target.size) else { continue };
        found.push((agreement(target, source, &pose), pose));
        tried += 1;
        if tried == search.trials {
            break;
        }
    }
    found.sort_by(|x, y| y.0.total_cmp(&x.0));
    let mut kept: Vec<Isometry> = Vec::new();
    for (_, pose) in found {
        if kept.iter().all(|k| !alike(k, &pose, target)) {
            kept.push(pose);
        }
        if kept.len() == search.keep {
            break;
        }
    }
    kept
}

fn alike(a: &Isometry, b: &Isometry, target: &Target) -> bool {
    let at = |pose: &Isometry| pose.inverse() * target.centre;
    a.rotation.angle_to(&b.rotation) < 0.2 && (at(a) - at(b)).norm() < 0.15 * target.size
}

/// The pose that lays the first oriented pair on the second; `None` where they are not alike.
fn pose_of(a: &[(Point, Vector); 2], b: &[(Point, Vector); 2], size: f64) -> Option<Isometry> {
    let (d, e) = (a[1].0 - a[0].0, b[1].0 - b[0].0);
    let (dn, en) = (d.norm(), e.norm());
    if dn < 0.5 * size || (dn - en).abs() > 0.07 * size {
        return None;
    }
    let near = |x: f64, y: f64| (x - y).abs() < 0.35;
    let (dh, eh) = (d / dn, e / en);
    let alike = near(dh.dot(&a[0].1), eh.dot(&b[0].1))
        && near(dh.dot(&a[1].1), eh.dot(&b[1].1))
        && near(a[0].1.dot(&a[1].1), b[0].1.dot(&b[1].1));
    let (ta, tb) = (triad(&dh, &(a[0].1 + a[1].1))?, triad(&eh, &(b[0].1 + b[1].1))?);
    if !alike {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(tb * ta.transpose()));
    let (from, to) = (nalgebra::center(&a[0].0, &a[1].0), nalgebra::center(&b[0].0, &b[1].0));
    Some(Isometry::from_parts(Translation3::from(to - rotation * from), rotation))
}

fn triad(along: &Vector, up: &Vector) -> Option<Matrix3<f64>> {
    let side = along.cross(up).try_normalize(0.2)?;
    Some(Matrix3::from_columns(&[*along, side, along.cross(&side)]))
}

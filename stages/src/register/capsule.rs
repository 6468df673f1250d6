//! A scan of the knee with its capsule on: shows bare bone beyond the capsule, and so checks the registrations of the bones' own scans.

use super::{BoneRegistration, rough};
use crate::PerBone;
use crate::specimen::Specimen;
use meshes::Isometry;
use meshes::query::SurfaceQuery;
use meshes::registration::icp::{refine, standing};
use meshes::registration::sample::{Samples, spread};
use meshes::registration::target::Target;
use meshes::surface::TriMesh;
use nalgebra::Matrix3;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};

/// Samples of the capsule scan.
const SAMPLES: usize = 6000;
/// A sample this near the bone's own scan shows the same bare bone [mm].
const SAME_MM: f64 = 1.5;
/// Least share of the capsule scan on a bone for a check [-].
const LEAST_SHARE: f64 = 0.05;
/// The two scans of one bone may lie this far apart in the median [mm]; the median, since soft tissue begins as a film on bone.
const MOST_APART_MM: f64 = 0.5;

/// What the capsule scan shows of a bone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CapsuleMetrics {
    /// Share of the scan that lies on the bone [-].
    pub share: f64,
    /// Median distance of the bone's own scan there [mm].
    pub median_to_scan_mm: f64,
}

/// Lays the capsule scan on each bone by what it shows of it, and tells how far the bone's own scan lies from it there.
/// Nothing is changed by it; a bone of which too little shows is told as not checked.
pub(super) fn check(
    scan: &TriMesh,
    specimen: &Specimen,
    bones: &PerBone<BoneRegistration>,
    seed: u64,
    warnings: &mut Vec<Notice>,
) -> PerBone<Option<CapsuleMetrics>> {
    let samples = spread(scan, SAMPLES);
    let mut figures = Vec::new();
    let targets: Vec<Option<Target>> = specimen.ct.named().into_iter().map(|(_, ct)| Target::new(ct, 6000)).collect();
    // where one bone shows too little to be found, the knee lies not far from how it lay in CT: the other's pose
    let starts: Vec<Isometry> =
        targets.iter().flatten().filter_map(|target| Some(rough(target, &samples, &[], seed)?.pose)).collect();
    for (((name, bone), target), (_, own)) in bones.named().into_iter().zip(&targets).zip(specimen.scans.named()) {
        let own = SurfaceQuery::new(&bone.ct_from_scan.mesh(&own.mesh));
        let found = target.as_ref().zip(own).and_then(|(target, own)| one(&samples, target, &own, &starts));
        match &found {
            None => warnings.push(Kind::CapsuleTooLittle.notice(format!("{name}: the capsule scan shows too little of it for a check")).of(name)),
            Some(f) if f.median > MOST_APART_MM => warnings.push(Kind::CapsuleApart.notice(format!(
                "{name}: its scan and the capsule scan lie {:.2} mm (median) apart where both show bare bone; expected {MOST_APART_MM} mm or less: look at the registration",
                f.median
            )).of(name)),
            Some(_) => {}
        }
        figures.push(found.map(|f| CapsuleMetrics { share: f.share, median_to_scan_mm: f.median }));
    }
    let mut figures = figures.into_iter();
    PerBone { femur: figures.next().flatten(), tibfib: figures.next().flatten() }
}

/// Widths of the weights by which a pose is refined [mm].
const SCALES_MM: [f64; 11] = [4.0, 3.0, 2.0, 1.5, 1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.3];
/// A pose is left by turns this large [deg], in so many rounds at most.
const TURN_DEG: f64 = 4.0;
const ROUNDS: usize = 3;

struct Found {
    share: f64,
    median: f64,
}

fn one(samples: &Samples, target: &Target, own: &SurfaceQuery, starts: &[Isometry]) -> Option<Found> {
    let pose = settled(target, samples, starts)?;
    let apart: Vec<f64> = (0..samples.points.len()).filter_map(|k| distance(target, own, samples, &pose, k)).collect();
    let share = apart.len() as f64 / samples.points.len().max(1) as f64;
    let mut sizes: Vec<f64> = apart.iter().map(|d| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = *sizes.get(sizes.len() / 2)?;
    (share >= LEAST_SHARE).then_some(Found { share, median })
}

/// The pose with most of the scan on the bone. A shaft that shows alone lets the scan turn and slip along it, so a pose is left by turns
/// about the bone's principal axes, both ways, and taken up again where they end on more of it.
fn settled(target: &Target, samples: &Samples, starts: &[Isometry]) -> Option<Isometry> {
    let from_centre = target.samples.points.iter().map(|p| p - target.centre);
    let axes = from_centre.map(|d| d * d.transpose()).sum::<Matrix3<f64>>().symmetric_eigen().eigenvectors;
    let about = target.centre.coords;
    let taken_up = |start: &Isometry| {
        let pose = refine(target, samples, start, &SCALES_MM);
        (pose, on_bone(target, samples, &pose))
    };
    let (mut best, mut most) = starts.iter().map(taken_up).max_by(|a, b| a.1.total_cmp(&b.1))?;
    for _ in 0..ROUNDS {
        let (from, before) = (best, most);
        for (k, sign) in (0..6).map(|n| (n / 2, if n % 2 == 0 { 1.0 } else { -1.0 })) {
            let turn = Isometry::new(about, axes.column(k) * (sign * TURN_DEG.to_radians()));
            let (pose, here) = taken_up(&(turn * Isometry::translation(-about.x, -about.y, -about.z) * from));
            if here > most {
                (best, most) = (pose, here);
            }
        }
        if most < 1.01 * before {
            break;
        }
    }
    Some(best)
}

/// How many samples lie on the bone, each by Tukey's weight [tukey1974].
fn on_bone(target: &Target, samples: &Samples, pose: &Isometry) -> f64 {
    let weight = |(p, n)| {
        let at = standing(target, &(pose * p), &(pose * n));
        if at.facing > 0.7 { (1.0 - (at.distance / SCALES_MM[10]).powi(2)).max(0.0).powi(2) } else { 0.0 }
    };
    samples.points.iter().zip(&samples.normals).map(weight).sum()
}

/// Signed distance of a sample on bare bone to the bone's own scan.
fn distance(target: &Target, own: &SurfaceQuery, samples: &Samples, pose: &Isometry, k: usize) -> Option<f64> {
    let (p, n) = (pose * samples.points[k], pose * samples.normals[k]);
    let at = standing(target, &p, &n);
    let near = own.nearest(&p);
    let same = at.distance < 1.0 && at.facing > 0.7 && near.distance < 3.0 * SAME_MM;
    same.then(|| (p - near.point).dot(&own.smooth_normal(&near)))
}

//! A scan of the knee with its capsule on: shows bare bone beyond the capsule, and so checks the registrations of the bones' own scans.

use super::{BoneRegistration, rough};
use crate::PerBone;
use crate::ingest::Specimen;
use meshes::Isometry;
use meshes::query::SurfaceQuery;
use meshes::registration::icp::{refine, standing};
use meshes::registration::sample::{Samples, spread};
use meshes::registration::target::Target;
use meshes::surface::TriMesh;
use serde_json::{Value, json};

/// Samples of the capsule scan.
const SAMPLES: usize = 6000;
/// A sample this near the bone's own scan shows the same bare bone [mm].
const SAME_MM: f64 = 1.5;
/// Least share of the capsule scan on a bone for a check [-].
const LEAST_SHARE: f64 = 0.05;
/// The two scans of one bone may lie this far apart in the median [mm]; the median, since soft tissue begins as a film on bone.
const MOST_APART_MM: f64 = 0.5;

/// Lays the capsule scan on each bone by what it shows of it, and tells how far the bone's own scan lies from it there.
/// Nothing is changed by it; a bone of which too little shows is told as not checked.
pub(super) fn check(
    scan: &TriMesh,
    specimen: &Specimen,
    bones: &PerBone<BoneRegistration>,
    seed: u64,
    warnings: &mut Vec<String>,
) -> Value {
    let samples = spread(scan, SAMPLES);
    let mut figures = serde_json::Map::new();
    for (((name, bone), (_, ct)), (_, own)) in
        bones.named().into_iter().zip(specimen.ct.named()).zip(specimen.scans.named())
    {
        let found = one(&samples, ct, &bone.ct_from_scan.mesh(&own.mesh), seed);
        match &found {
            None => warnings.push(format!("{name}: the capsule scan shows too little of it for a check")),
            Some(f) if f.median > MOST_APART_MM => warnings.push(format!(
                "{name}: its scan and the capsule scan lie {:.2} mm (median) apart where both show bare bone; expected {MOST_APART_MM} mm or less: look at the registration",
                f.median
            )),
            Some(_) => {}
        }
        let value = found.map(|f| json!({"share": f.share, "median_to_scan_mm": f.median}));
        figures.insert(name.into(), value.unwrap_or(Value::Null));
    }
    figures.into()
}

struct Found {
    share: f64,
    median: f64,
}

fn one(samples: &Samples, ct: &TriMesh, own: &TriMesh, seed: u64) -> Option<Found> {
    let target = Target::new(ct, 6000)?;
    let start = rough(&target, samples, &[], seed)?.pose;
    let pose = refine(&target, samples, &start, &[4.0, 3.0, 2.0, 1.5, 1.0, 0.8, 0.6, 0.5, 0.4, 0.3, 0.3]);
    let query = SurfaceQuery::new(own)?;
    let apart: Vec<f64> =
        (0..samples.points.len()).filter_map(|k| distance(&target, &query, samples, &pose, k)).collect();
    let share = apart.len() as f64 / samples.points.len().max(1) as f64;
    let mut sizes: Vec<f64> = apart.iter().map(|d| d.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = *sizes.get(sizes.len() / 2)?;
    (share >= LEAST_SHARE).then_some(Found { share, median })
}

/// Signed distance of a sample on bare bone to the bone's own scan.
fn distance(target: &Target, own: &SurfaceQuery, samples: &Samples, pose: &Isometry, k: usize) -> Option<f64> {
    let (p, n) = (pose * samples.points[k], pose * samples.normals[k]);
    let at = standing(target, &p, &n);
    let near = own.nearest(&p);
    let same = at.distance < 1.0 && at.facing > 0.7 && near.distance < 3.0 * SAME_MM;
    same.then(|| (p - near.point).dot(&own.smooth_normal(&near)))
}

//! The intercondylar eminences: the two tips of the ridge between the tibial plateaus, where Grood and Suntay place the tibia's origin.

use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use std::collections::BTreeMap;

/// Share of the distance between the plateaus' centres, on either side of their middle, in which the ridge lies [-]: 17 of 50 mm.
const RIDGE_SHARE: f64 = 0.35;
/// Least distance of the two tips across the knee, as a share of the same distance [-]. Ours: half of the usual 10 mm.
const APART_SHARE: f64 = 0.1;
/// Width of the strips in which the ridge's height is read [mm]: about one edge of the bone's mesh.
const STRIP_MM: f64 = 1.5;
/// Surface that counts for a tip: no lower than this below its highest point [mm].
const TIP_MM: f64 = 0.5;
/// Surface that counts for a tip lies no farther than this from its highest point [mm].
const TIP_REACH_MM: f64 = 3.0;
/// A second tip rises at least this much from the saddle between [mm]; less is roughness of the mesh.
const LEAST_RISE_MM: f64 = 0.3;

/// Medial and lateral tip of the ridge [mm]; `None` where the bone shows one tip only. `frame` lies at the joint line, midway between
/// the plateaus, whose centres are `spacing` [mm] apart.
pub fn eminences(tibfib: &TriMesh, frame: &AnatomicalFrame, spacing: f64) -> Option<[Point; 2]> {
    let across = |p: &Point| (p - frame.origin).dot(&frame.medial);
    let height = |p: &Point| (p - frame.origin).dot(&frame.superior);
    let ridge: Vec<&Point> = tibfib.vertices.iter().filter(|p| across(p).abs() < RIDGE_SHARE * spacing).collect();
    let first = **ridge.iter().max_by(|a, b| height(a).total_cmp(&height(b)))?;
    let apart = APART_SHARE * spacing;
    let second = [1.0, -1.0]
        .iter()
        .filter_map(|way| beyond_the_saddle(&ridge, &|p| way * (across(p) - across(&first)), &height, apart))
        .max_by(|a, b| height(a).total_cmp(&height(b)))?;
    let [a, b] = [first, second].map(|top| tip(&ridge, &top, &height));
    Some(if across(&a) > across(&b) { [a, b] } else { [b, a] })
}

/// The highest point on one side that rises from a saddle; `away` is the distance across from the first tip [mm].
fn beyond_the_saddle(
    ridge: &[&Point],
    away: &dyn Fn(&Point) -> f64,
    height: &dyn Fn(&Point) -> f64,
    apart: f64,
) -> Option<Point> {
    let strip = |p: &Point| (away(p) / STRIP_MM).floor();
    let mut tops: BTreeMap<i64, f64> = BTreeMap::new();
    for p in ridge.iter().filter(|p| away(p) >= 0.0) {
        let top = tops.entry(strip(p) as i64).or_insert(f64::NEG_INFINITY);
        *top = top.max(height(p));
    }
    let candidates = ridge.iter().filter(|p| away(p) >= apart);
    let rises = candidates.filter(|p| {
        let saddle = tops.range(0..=strip(p) as i64).map(|(_, h)| *h).fold(f64::INFINITY, f64::min);
        height(p) - saddle >= LEAST_RISE_MM
    });
    rises.max_by(|a, b| height(a).total_cmp(&height(b))).map(|p| **p)
}

/// Mean of the surface about a tip, weighted by how near to its top it lies.
fn tip(ridge: &[&Point], top: &Point, height: &dyn Fn(&Point) -> f64) -> Point {
    let (mut sum, mut weight) = (Vector::zeros(), 0.0);
    for p in ridge.iter().filter(|p| (**p - top).norm() < TIP_REACH_MM) {
        let w = (1.0 - (height(top) - height(p)) / TIP_MM).max(0.0);
        sum += (*p - top) * w;
        weight += w;
    }
    if weight > 0.0 { top + sum / weight } else { *top }
}

/// The bone straight above or below `place`, along the frame's superior axis; `place` itself where there is none.
pub fn on_the_bone(tibfib: &TriMesh, place: &Point, superior: &Vector) -> Point {
    const ABOVE_MM: f64 = 40.0;
    let hit =
        SurfaceQuery::new(tibfib).and_then(|bone| bone.ray(&(place + superior * ABOVE_MM), &-superior, 2.0 * ABOVE_MM));
    hit.map_or(*place, |h| h.point)
}

//! Places on the bones that the atlas' rules refer to.

use super::Half;
use meshes::frame::AnatomicalFrame;
use meshes::section::{Outline, section};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};

/// Depth of the cap of a condyle that shows its width [mm].
const CAP_MM: f64 = 4.0;
/// Half width of the strip about the middle of that width in which the surface is sought [mm]: two edges of the bone's mesh.
const STRIP_MM: f64 = 3.0;

/// The surface of one condyle farthest in the direction `arc_deg` behind straight distal, in the middle of the condyle's width there.
pub(super) fn condyle(femur: &TriMesh, frame: &AnatomicalFrame, side: Half, arc_deg: f64) -> Option<Point> {
    let (sin, cos) = arc_deg.to_radians().sin_cos();
    let towards = -frame.superior * cos - frame.anterior * sin;
    let sign = if side == Half::Medial { 1.0 } else { -1.0 };
    let across = |p: &Point| (p - frame.origin).dot(&frame.medial);
    let reach = |p: &Point| (p - frame.origin).dot(&towards);
    let near = |p: &&Point| sign * across(p) > 5.0 && (*p - frame.origin).dot(&frame.superior) < 30.0;
    let farthest = |points: &[&Point]| points.iter().map(|p| reach(p)).fold(f64::NEG_INFINITY, f64::max);
    let side: Vec<&Point> = femur.vertices.iter().filter(near).collect();
    let top = farthest(&side);
    let cap = side.iter().filter(|p| reach(p) > top - CAP_MM).map(|p| across(p));
    let (least, most) = cap.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(x), m.max(x)));
    let middle = 0.5 * (least + most);
    let strip: Vec<&Point> = side.into_iter().filter(|p| (across(p) - middle).abs() < STRIP_MM).collect();
    let top = farthest(&strip);
    let (mut sum, mut weight) = (Vector::zeros(), 0.0);
    for p in strip {
        let w = (1.0 - (top - reach(p)) / 0.5).max(0.0);
        sum += (p - frame.origin) * w;
        weight += w;
    }
    (weight > 0.0).then(|| frame.origin + sum / weight)
}

/// The tibia's own outline `depth` [mm] below the frame's origin: the largest piece.
fn outline(tibfib: &TriMesh, frame: &AnatomicalFrame, depth: f64) -> Option<Outline> {
    section(tibfib, &(frame.origin - frame.superior * depth), &frame.superior).into_iter().next()
}

/// Where the way from the middle of the tibia's outline at `depth` towards `azimuth` (medial, anterior) leaves the bone.
pub(super) fn outline_point(
    tibfib: &TriMesh,
    frame: &AnatomicalFrame,
    depth: f64,
    azimuth: &[f64; 2],
) -> Option<Point> {
    let middle = outline(tibfib, frame, depth)?.centroid;
    let way = (frame.medial * azimuth[0] + frame.anterior * azimuth[1]).try_normalize(1e-9)?;
    let bone = meshes::query::SurfaceQuery::new(tibfib)?;
    bone.ray(&middle, &way, 120.0).map(|hit| hit.point)
}

/// Depth of the outline that stands for the plateau's size [mm].
const PLATEAU_DEPTH_MM: f64 = 8.0;

/// The highest surface over the place given by shares of the outline's extent, from its medial and its anterior edge.
pub(super) fn plateau_point(tibfib: &TriMesh, frame: &AnatomicalFrame, shares: &[f64; 2]) -> Option<Point> {
    let outline = outline(tibfib, frame, PLATEAU_DEPTH_MM)?;
    let extent = |axis: &Vector| {
        outline
            .points
            .iter()
            .map(|p| (p - frame.origin).dot(axis))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    };
    let (lateral, medial) = extent(&frame.medial);
    let (posterior, anterior) = extent(&frame.anterior);
    let place = frame.medial * (medial + (lateral - medial) * shares[0])
        + frame.anterior * (anterior + (posterior - anterior) * shares[1]);
    let bone = meshes::query::SurfaceQuery::new(tibfib)?;
    bone.ray(&(frame.origin + place + frame.superior * 60.0), &-frame.superior, 120.0).map(|hit| hit.point)
}

/// Step of the sections that look for the fibula [mm].
const STEP_MM: f64 = 2.0;
/// The fibular apex lies at least this far below the joint line [mm]; what is higher belongs to the tibia. Ours.
const APEX_DEPTH_MM: f64 = 6.0;

/// The fibula's highest cross-section that is free of the tibia; `None` where no second bone is seen beside the tibia.
fn fibular_head(tibfib: &TriMesh, frame: &AnatomicalFrame) -> Option<Outline> {
    (3..60).find_map(|step| {
        let depth = STEP_MM * f64::from(step);
        let pieces = section(tibfib, &(frame.origin - frame.superior * depth), &frame.superior);
        let [tibia, fibula, ..] = &pieces[..] else { return None };
        let lateral = (fibula.centroid - tibia.centroid).dot(&frame.medial) < 0.0;
        (lateral && fibula.area > 25.0 && fibula.area < 0.6 * tibia.area).then(|| fibula.clone())
    })
}

/// The tip of the fibular head: the highest point met straight above the posterolateral quarter of the head's section,
/// where the styloid stands. Columns that run on into the tibia, where segmentation has joined the two, do not count.
pub(super) fn fibular_apex(tibfib: &TriMesh, frame: &AnatomicalFrame) -> Option<Point> {
    let head = fibular_head(tibfib, frame)?;
    let bone = meshes::query::SurfaceQuery::new(tibfib)?;
    let above = |p: &Point| (p - frame.origin).dot(&frame.superior);
    let styloid = |p: &&Point| {
        let x = *p - head.centroid;
        x.dot(&frame.medial) <= 0.0 && x.dot(&frame.anterior) <= 0.0
    };
    let rings = [0.3, 0.6, 0.9];
    let starts = rings
        .iter()
        .flat_map(|r| head.points.iter().filter(styloid).map(move |p| head.centroid + (p - head.centroid) * *r));
    starts
        .filter_map(|p| bone.ray(&p, &frame.superior, 100.0))
        .map(|hit| hit.point)
        .filter(|p| above(p) < -APEX_DEPTH_MM)
        .max_by(|a, b| above(a).total_cmp(&above(b)))
}

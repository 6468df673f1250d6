//! A region on a scan carried onto the CT bone.

use super::region::Region;
use meshes::query::SurfaceQuery;
use meshes::{Isometry, Point, Vector};

/// A region on the CT bone.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// The point of the bone nearest to the region's area-weighted centroid [mm].
    pub centroid: Point,
    /// Area of the region as projected [mm2].
    pub area_mm2: f64,
    /// Mean distance from the scan to the bone along the scan's normals [mm].
    pub projection_mm: f64,
    /// Points on the bone, evenly spread over the region [mm].
    pub points: Vec<Point>,
}

/// How far along a normal the bone is looked for before the nearest point is taken [mm]; thickest cartilage and a loose registration.
const REACH: f64 = 6.0;
/// Spacing of a footprint's points [mm].
const SPACING: f64 = 1.0;

/// `region` moved by `ct_from_scan` and carried along the scan's normals, outward or inward, onto `bone`.
pub fn project(region: &Region, ct_from_scan: &Isometry, bone: &SurfaceQuery) -> Footprint {
    let (mut moment, mut weight, mut area_mm2, mut distance) = (Vector::zeros(), 0.0, 0.0, 0.0);
    let mut all: Vec<Point> = Vec::new();
    for piece in &region.pieces {
        let normal = ct_from_scan * piece.normal;
        let corners = piece.corners.map(|p| onto(&(ct_from_scan * p), &normal, bone));
        let [a, b, c] = corners;
        area_mm2 += (b - a).cross(&(c - a)).norm() / 2.0;
        let middle = ct_from_scan * piece.middle();
        let landed = onto(&middle, &normal, bone);
        let w = piece.area();
        moment += w * landed.coords;
        weight += w;
        distance += w * (landed - middle).norm();
        all.push(landed);
    }
    let weight = f64::max(weight, f64::MIN_POSITIVE);
    let centroid = bone.nearest(&Point::from(moment / weight)).point;
    Footprint { centroid, area_mm2, projection_mm: distance / weight, points: spread(all, &centroid) }
}

/// Some of `points`, no two closer than [`SPACING`], taken from the centroid outwards: the order of the scan's triangles does not count.
fn spread(mut points: Vec<Point>, centroid: &Point) -> Vec<Point> {
    points.sort_by(|a, b| (a - centroid).norm().total_cmp(&(b - centroid).norm()));
    let mut kept: Vec<Point> = Vec::new();
    for p in points {
        if kept.iter().all(|k| (k - p).norm() >= SPACING) {
            kept.push(p);
        }
    }
    kept
}

/// Where the line through `p` along `normal` meets the bone nearest to `p`; the nearest point if it does not, or if that is much nearer.
fn onto(p: &Point, normal: &Vector, bone: &SurfaceQuery) -> Point {
    let nearest = bone.nearest(p);
    let reach = (2.0 * nearest.distance + 0.5).min(REACH);
    let hits = [*normal, -normal].into_iter().filter_map(|d| bone.ray(p, &d, reach));
    hits.min_by(|a, b| a.distance.total_cmp(&b.distance)).map_or(nearest.point, |h| h.point)
}

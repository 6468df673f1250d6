//! Ends of fibres in a region, and what lies in their way.

use crate::site::{Bone, Site};
use meshes::frame::AnatomicalFrame;
use meshes::query::SurfaceQuery;
use meshes::{Point, Vector};
use nalgebra::{Matrix3, SymmetricEigen};

/// Which ways a ligament's fibres are counted on a bone: the first that the axis of its site does not lie across decides.
///
/// Femoral ACL: AM proximal, PL distal; tibial: AM anterior [harner1999]. PCL: AL distal and anterior on the femur, anterior, lateral
/// and superior on the tibia [amis2006]. Capsule from medial to lateral; all others from anterior to posterior. After that come superior, medial
/// and anterior, ours: no axis lies across all three, and they turn with the side, so that the order does not depend on it.
pub fn counting_directions(ligament: &str, bone: Bone, frame: &AnatomicalFrame) -> [Vector; 4] {
    let [m, a, s] = match (ligament, bone) {
        ("ACL", Bone::Femur) => [0.0, 0.2, 1.0],
        ("PCL", Bone::Femur) => [0.0, 0.8, -0.6],
        ("PCL", Bone::Tibfib) => [-0.4, 0.5, 0.77],
        ("PCAP_M" | "PCAP_L", _) => [1.0, 0.0, 0.0],
        _ => [0.0, 1.0, 0.0],
    };
    let wished = (m * frame.medial + a * frame.anterior + s * frame.superior).normalize();
    [wished, frame.superior, frame.medial, frame.anterior]
}

/// Cosine below which a region's major axis lies across a way of counting [-].
const UNCLEAR: f64 = 0.3;
/// A line this long stands for a site that is known as a point only [mm].
const POINT_SPAN: f64 = 6.0;

/// `count` points on `bone`, equidistant along the major axis of the site's region over the share `span` of its length, counted along
/// the first of `directions` that the axis does not lie across; and whether that is the very first.
///
/// Source: [andreassen2025, sec. 2.4.4], where the axis is drawn by eye; ours is the first principal axis.
pub fn ends(site: &Site, bone: &SurfaceQuery, count: usize, directions: &[Vector; 4], span: f64) -> (Vec<Point>, bool) {
    let normal = bone.smooth_normal(&bone.nearest(&site.centroid));
    let wished = &directions[0];
    let (axis, reach) = major_axis(site, wished, &normal);
    let is_clear = |direction: &Vector| axis.dot(direction).abs() >= UNCLEAR;
    let counted = directions.iter().find(|d| is_clear(d)).unwrap_or(wished);
    let (along, (low, high)) = if axis.dot(counted) < 0.0 { (-axis, (-reach.1, -reach.0)) } else { (axis, reach) };
    let (middle, half) = (f64::midpoint(low, high), span * (high - low) / 2.0);
    let points = (0..count)
        .map(|i| {
            let t = if count > 1 { 1.0 - 2.0 * i as f64 / (count - 1) as f64 } else { 0.0 };
            let flat = site.centroid + along * (middle + t * half);
            onto(&flat, &normal, bone)
        })
        .collect();
    (points, is_clear(wished))
}

/// Unit major axis and how far the region reaches along it from the centroid [mm].
fn major_axis(site: &Site, direction: &Vector, normal: &Vector) -> (Vector, (f64, f64)) {
    let offsets: Vec<Vector> = site.region.iter().map(|p| p - site.centroid).collect();
    let mean = offsets.iter().sum::<Vector>() / offsets.len().max(1) as f64;
    let scatter = offsets.iter().fold(Matrix3::zeros(), |m, d| m + (d - mean) * (d - mean).transpose());
    let eigen = SymmetricEigen::new(scatter);
    let largest = eigen.eigenvalues.imax();
    if offsets.len() < 2 || eigen.eigenvalues[largest] < 1e-6 {
        let flat = direction - normal * normal.dot(direction);
        return (flat.try_normalize(1e-6).unwrap_or(*direction), (-POINT_SPAN / 2.0, POINT_SPAN / 2.0));
    }
    let axis: Vector = eigen.eigenvectors.column(largest).into_owned().normalize();
    let along = offsets.iter().map(|d| d.dot(&axis));
    (axis, along.fold((0.0, 0.0), |(lo, hi): (f64, f64), t| (lo.min(t), hi.max(t))))
}

/// Farthest a point of a site's flat axis may lie from the bone along the normal [mm].
const CURVATURE_REACH: f64 = 8.0;

fn onto(p: &Point, normal: &Vector, bone: &SurfaceQuery) -> Point {
    let nearest = bone.nearest(p);
    let reach = (2.0 * nearest.distance + 0.5).min(CURVATURE_REACH);
    let hits = [*normal, -normal].into_iter().filter_map(|d| bone.ray(p, &d, reach));
    hits.min_by(|a, b| a.distance.total_cmp(&b.distance)).map_or(nearest.point, |h| h.point)
}

/// Turns `tibia` round if that uncrosses fibres to `femur`: the ends' offsets across the ligament should agree.
pub fn uncross(femur: &[Point], tibia: &mut [Point]) {
    let mean = |points: &[Point]| points.iter().map(|p| p.coords).sum::<Vector>() / points.len().max(1) as f64;
    let (f, t) = (mean(femur), mean(tibia));
    let Some(line) = (f - t).try_normalize(0.0) else { return };
    let agreement: f64 = femur
        .iter()
        .zip(tibia.iter())
        .map(|(p, q)| {
            let (a, b) = (p.coords - f, q.coords - t);
            a.dot(&b) - a.dot(&line) * b.dot(&line)
        })
        .sum();
    if agreement < 0.0 {
        tibia.reverse();
    }
}

/// How deep the straight line from `a` to `b` runs inside a closed `bone` [mm]; 0 where it stays outside.
pub fn depth_inside(a: &Point, b: &Point, bone: &SurfaceQuery) -> f64 {
    let steps = ((b - a).norm() / 0.5).ceil().clamp(1.0, 1000.0) as usize;
    (0..=steps).map(|i| -bone.signed_distance(&(a + (b - a) * (i as f64 / steps as f64)))).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::site::Source;
    use meshes::shapes::icosphere;

    /// A region of 8 by 4 mm on the top of a ball, its long axis turned from x by `turn` [rad].
    fn oval(bone: &SurfaceQuery, turn: f64) -> Site {
        let turned =
            |x: f64, y: f64| Point::new(x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos(), 40.0);
        let region: Vec<Point> = (-4..=4)
            .flat_map(|i| (-2..=2).map(move |j| turned(f64::from(i), f64::from(j))))
            .map(|p| bone.nearest(&p).point)
            .collect();
        let centroid = bone.nearest(&Point::new(0.0, 0.0, 40.0)).point;
        Site {
            ligament: "LCL".into(),
            bone: Bone::Femur,
            centroid,
            area_mm2: 40.0,
            source: Source::Marked,
            projection_mm: 0.0,
            region,
        }
    }

    /// A direction, then superior, medial and anterior along z, x and y.
    fn from(wished: Vector) -> [Vector; 4] {
        [wished, Vector::z(), Vector::x(), Vector::y()]
    }

    #[test]
    fn ends_are_equidistant_spanning_counted_and_on_the_bone() {
        let bone = SurfaceQuery::new(&icosphere(40.0, 5)).unwrap();
        let site = oval(&bone, 0.0);
        let (points, clear) = ends(&site, &bone, 3, &from(Vector::x()), 1.0);
        assert!(clear);
        assert!(
            (points[0].x - 4.0).abs() < 0.1 && points[1].x.abs() < 0.1 && (points[2].x + 4.0).abs() < 0.1,
            "{points:?}"
        );
        assert!(points.iter().all(|p| bone.nearest(p).distance < 1e-9));
        let (turned, _) = ends(&site, &bone, 3, &from(-Vector::x()), 1.0);
        assert!((turned[0] - points[2]).norm() < 1e-9);
        assert!(!ends(&site, &bone, 2, &from(Vector::y()), 1.0).1);
    }

    #[test]
    fn an_axis_across_the_way_of_counting_has_one_order_however_it_tilts() {
        let bone = SurfaceQuery::new(&icosphere(40.0, 5)).unwrap();
        for medial in [Vector::x(), -Vector::x()] {
            for turn in [-0.2, -0.05, 0.0, 0.05, 0.2] {
                let directions = [Vector::y(), Vector::z(), medial, Vector::y()];
                let (points, clear) = ends(&oval(&bone, turn), &bone, 2, &directions, 1.0);
                assert!(!clear && (points[0] - points[1]).dot(&medial) > 6.0, "{turn}: {points:?}");
            }
        }
    }

    #[test]
    fn crossed_fibres_are_uncrossed_and_parallel_ones_stay() {
        let femur = [Point::new(1.0, 0.0, 50.0), Point::new(-1.0, 0.0, 50.0)];
        let straight = [Point::new(2.0, 0.0, 0.0), Point::new(-2.0, 0.0, 0.0)];
        let mut tibia = straight;
        uncross(&femur, &mut tibia);
        assert_eq!(tibia, straight);
        tibia.reverse();
        uncross(&femur, &mut tibia);
        assert_eq!(tibia, straight);
    }

    #[test]
    fn a_chord_runs_as_deep_as_its_sagitta() {
        let bone = SurfaceQuery::new(&icosphere(10.0, 5)).unwrap();
        let depth = depth_inside(&Point::new(-20.0, 0.0, 7.0), &Point::new(20.0, 0.0, 7.0), &bone);
        assert!((depth - 3.0).abs() < 0.05, "{depth}");
        assert_eq!(depth_inside(&Point::new(-20.0, 0.0, 11.0), &Point::new(20.0, 0.0, 11.0), &bone), 0.0);
    }
}

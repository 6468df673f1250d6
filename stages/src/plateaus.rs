//! The tibial plateaus: what of the bone faces up, at the height of the joint.

use crate::condyles::Directions;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use nalgebra::{Matrix3, SymmetricEigen};

/// A triangle of the plateaus: its middle [mm], area [mm2] and unit normal.
struct Facet {
    middle: Point,
    area: f64,
    normal: Vector,
}

/// Cosine of the slope up to which a triangle faces up.
const FACING: f64 = 0.85;
/// Distance from the joint across which plateau may lie, and its height above and below its level [mm].
const REACH_MM: f64 = 60.0;
const BAND_MM: f64 = 9.0;
/// Rounds in which the way up is found again from the plateaus that the last one shows.
const ROUNDS: usize = 12;

/// The triangles that face up, at the height of the plateaus.
fn plateaus(tibfib: &TriMesh, superior: &Vector, joint: &Point) -> Vec<Facet> {
    let mut up: Vec<Facet> = Vec::new();
    for t in 0..tibfib.triangles.len() {
        let vector = tibfib.area_vector(t);
        let area = vector.norm();
        let [a, b, c] = tibfib.corners(t);
        let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
        let away = middle - joint;
        if area > 0.0
            && vector.dot(superior) > FACING * area
            && (away - superior * away.dot(superior)).norm() < REACH_MM
        {
            up.push(Facet { middle, area, normal: vector / area });
        }
    }
    let height = |f: &Facet| (f.middle - joint).dot(superior);
    up.sort_by(|a, b| height(b).total_cmp(&height(a)));
    let total: f64 = up.iter().map(|f| f.area).sum();
    // The upper quarter of the upward faces is plateau; the fibular head and the tubercle's shelf lie lower.
    let mut sum = 0.0;
    let level = up
        .iter()
        .find(|f| {
            sum += f.area;
            sum > 0.25 * total
        })
        .map(height);
    up.retain(|f| level.is_some_and(|level| (height(f) - level).abs() < BAND_MM));
    up
}

/// Unit normal of the plane through both plateaus, upwards, begun along `superior` (within some 20 degrees): the way up where the
/// shaft is too short to tell; it leans backward by the slope of the plateaus.
pub(crate) fn plateau_normal(tibfib: &TriMesh, superior: &Vector, joint: &Point) -> Option<Vector> {
    let mut up = *superior;
    for _ in 0..ROUNDS {
        let sum = plateaus(tibfib, &up, joint).iter().fold(Vector::zeros(), |s, f| s + f.normal * f.area);
        up = sum.try_normalize(1e-6)?;
    }
    let facets = plateaus(tibfib, &up, joint);
    let weight: f64 = facets.iter().map(|f| f.area).sum();
    let mean =
        facets.iter().fold(Vector::zeros(), |s, f| s + (f.middle - joint) * f.area) / weight.max(f64::MIN_POSITIVE);
    let spread = facets.iter().fold(Matrix3::zeros(), |s, f| {
        let x = f.middle - joint - mean;
        s + x * x.transpose() * f.area
    });
    let eigen = SymmetricEigen::new(spread);
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let normal = if normal.dot(&up) < 0.0 { -normal } else { normal };
    (normal.dot(&up) > FACING).then_some(normal)
}

/// Centres of the medial and lateral tibial plateau: of the surface that faces up, at the height of the plateaus, on either
/// side of the middle between them. `d` gives rough directions, `joint` a point of the joint.
pub fn plateau_centres(tibfib: &TriMesh, d: &Directions, joint: &Point) -> Option<[Point; 2]> {
    let plateau = plateaus(tibfib, &d.superior, joint);
    let mean = |keep: &dyn Fn(&Point) -> bool| {
        let (mut sum, mut weight) = (Vector::zeros(), 0.0);
        for f in plateau.iter().filter(|f| keep(&f.middle)) {
            sum += (f.middle - joint) * f.area;
            weight += f.area;
        }
        (weight > 0.0).then(|| joint + sum / weight)
    };
    let mut middle = mean(&|_| true)?;
    let mut medial = d.medial;
    let mut centres = [middle; 2];
    for _ in 0..50 {
        centres = [mean(&|p| (p - middle).dot(&medial) > 0.0)?, mean(&|p| (p - middle).dot(&medial) <= 0.0)?];
        let across = centres[0] - centres[1];
        let next = (across - d.superior * across.dot(&d.superior)).try_normalize(1e-6)?;
        let centre = nalgebra::center(&centres[0], &centres[1]);
        let still = (next - medial).norm() < 1e-12 && (centre - middle).norm() < 1e-9;
        (medial, middle) = (next, centre);
        if still {
            break;
        }
    }
    Some(centres)
}

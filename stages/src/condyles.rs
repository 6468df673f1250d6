//! The posterior femoral condyles and the epicondyles: support points, the common cylinder, the longest transepicondylar chord.

use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use nalgebra::{DMatrix, DVector};

/// Orthonormal directions of the femur, by which its shape is read.
#[derive(Clone, Copy, Debug)]
pub struct Directions {
    /// Across the condyles.
    pub medial: Vector,
    /// Forwards.
    pub anterior: Vector,
    /// Towards the head.
    pub superior: Vector,
}

impl Directions {
    /// Right-handed or left-handed as `like`, with exactly `medial`, and superior as near `superior` as can be.
    pub fn with_medial(medial: &Vector, superior: &Vector, like: &Directions) -> Option<Directions> {
        let medial = medial.try_normalize(1e-9)?;
        let superior = (superior - medial * superior.dot(&medial)).try_normalize(1e-6)?;
        let anterior = superior.cross(&medial);
        let anterior = if anterior.dot(&like.anterior) < 0.0 { -anterior } else { anterior };
        Some(Directions { medial, anterior, superior })
    }
}

/// The cylinder common to both posterior condyles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// The point of the axis midway between the condyles [mm].
    pub point: Point,
    /// Unit direction, medial.
    pub direction: Vector,
    /// Radius [mm].
    pub radius: f64,
    /// Root mean square distance of the condyles' support points from it [mm].
    pub rms: f64,
}

/// Arc of the condyles that counts, from straight distal towards posterior [deg]: the flexion facet [eckhoff2005].
const ARC_DEG: [f64; 2] = [20.0, 115.0];
const ARC_STEP_DEG: f64 = 2.5;

/// Fits a cylinder to the support points of both condyles, seen along `d.medial`, beginning at `centre` (a point between them).
pub fn condylar_cylinder(femur: &TriMesh, d: &Directions, centre: &Point) -> Option<(Cylinder, [Vec<Point>; 2])> {
    let sides = [1.0, -1.0].map(|side| support_points(femur, d, centre, side));
    if sides.iter().any(|s| s.len() < 12) {
        return None;
    }
    let circles = [&sides[0], &sides[1]].map(|points| circle(points, d, centre));
    let [medial, lateral] = [circles[0]?, circles[1]?];
    let start = Cylinder {
        point: nalgebra::center(&medial.0, &lateral.0),
        direction: (medial.0 - lateral.0).try_normalize(1e-6)?,
        radius: 0.5 * (medial.1 + lateral.1),
        rms: 0.0,
    };
    let all: Vec<Point> = sides.iter().flatten().copied().collect();
    Some((refined(start, &all)?, sides))
}

/// The farthest points of one condyle in every direction of the arc, each a mean over its neighbourhood.
fn support_points(femur: &TriMesh, d: &Directions, centre: &Point, side: f64) -> Vec<Point> {
    let half: Vec<&Point> = femur
        .vertices
        .iter()
        .filter(|p| side * (*p - centre).dot(&d.medial) > 5.0 && (*p - centre).dot(&d.superior) < 40.0)
        .collect();
    let mut points = Vec::new();
    let mut angle = ARC_DEG[0];
    while angle <= ARC_DEG[1] {
        let (sin, cos) = angle.to_radians().sin_cos();
        let towards = -d.superior * cos - d.anterior * sin;
        let reach = |p: &Point| (p - centre).dot(&towards);
        let farthest = half.iter().map(|p| reach(p)).fold(f64::NEG_INFINITY, f64::max);
        // Weighted by depth, so that the mean moves smoothly with the surface.
        let (mut sum, mut weight) = (Vector::zeros(), 0.0);
        for p in &half {
            let w = (1.0 - (farthest - reach(p)) / 0.5).max(0.0);
            sum += (*p - centre) * w;
            weight += w;
        }
        if weight > 0.0 {
            let mean = centre + sum / weight;
            points.push(mean + towards * (farthest - reach(&mean)));
        }
        angle += ARC_STEP_DEG;
    }
    points
}

/// Least-squares circle in the sagittal plane: its centre, at the points' mean mediolateral place, and radius.
fn circle(points: &[Point], d: &Directions, origin: &Point) -> Option<(Point, f64)> {
    let rows = points.len();
    let (mut a, mut b) = (DMatrix::zeros(rows, 3), DVector::zeros(rows));
    let mut across = 0.0;
    for (i, p) in points.iter().enumerate() {
        let v = p - origin;
        let (x, y) = (v.dot(&d.anterior), v.dot(&d.superior));
        a.row_mut(i).copy_from_slice(&[2.0 * x, 2.0 * y, 1.0]);
        b[i] = x * x + y * y;
        across += v.dot(&d.medial) / rows as f64;
    }
    let s = a.svd(true, true).solve(&b, 1e-12).ok()?;
    let radius = (s[2] + s[0] * s[0] + s[1] * s[1]).sqrt();
    let centre = origin + d.anterior * s[0] + d.superior * s[1] + d.medial * across;
    (radius.is_finite() && radius > 5.0 && radius < 60.0).then_some((centre, radius))
}

/// Gauss-Newton on the distances to the axis: two shifts and two tilts of the axis, and the radius.
fn refined(mut c: Cylinder, points: &[Point]) -> Option<Cylinder> {
    let rows = points.len();
    for _ in 0..20 {
        let u = perpendicular(&c.direction);
        let v = c.direction.cross(&u);
        let (mut a, mut b) = (DMatrix::zeros(rows, 5), DVector::zeros(rows));
        for (i, p) in points.iter().enumerate() {
            let x = p - c.point;
            let along = x.dot(&c.direction);
            let radial = x - c.direction * along;
            let n = radial.try_normalize(1e-9)?;
            a.row_mut(i).copy_from_slice(&[-n.dot(&u), -n.dot(&v), -n.dot(&u) * along, -n.dot(&v) * along, -1.0]);
            b[i] = -(radial.norm() - c.radius);
        }
        let s = a.svd(true, true).solve(&b, 1e-12).ok()?;
        c.point += u * s[0] + v * s[1];
        c.direction = (c.direction + u * s[2] + v * s[3]).normalize();
        c.radius += s[4];
        if s.norm() < 1e-10 {
            break;
        }
    }
    let mean = points.iter().fold(Vector::zeros(), |sum, p| sum + (p - c.point)) / rows as f64;
    c.point += c.direction * mean.dot(&c.direction);
    let square = |p: &Point| {
        let x = p - c.point;
        ((x - c.direction * x.dot(&c.direction)).norm() - c.radius).powi(2)
    };
    c.rms = (points.iter().map(square).sum::<f64>() / rows as f64).sqrt();
    (c.radius.is_finite() && c.radius > 5.0 && c.radius < 60.0).then_some(c)
}

fn perpendicular(d: &Vector) -> Vector {
    let e = Vector::ith(d.iamin(), 1.0);
    (e - d * d.dot(&e)).normalize()
}

/// How the transepicondylar axis lies to the condylar axis in the mean: turned forwards on the medial side in the axial plane
/// [deg] (clinical TEA to posterior condylar line [berger1993]), and upwards on the medial side in the coronal plane [deg]
/// (the distal condylar line leans 87 to 88 deg to the mechanical axis [paley2002], to which the TEA is square [yoshioka1987]).
const MEAN_AXIAL_DEG: f64 = 4.0;
const MEAN_CORONAL_DEG: f64 = 2.5;
/// Depth over which a prominence fades [mm].
const DEPTH_MM: f64 = 1.0;

/// Medial and lateral epicondyle: on each side the mean of the surface weighted by how far it protrudes along the mean
/// transepicondylar direction, and by how near it is to the condylar axis (normal, sd half the condyles' radius).
///
/// The epicondyles are broad: on one specimen the longest chord across them moved by 5 deg with the way it was sought. The mean direction
/// steadies it; one rater alone scatters by 2.5 deg.
pub fn epicondyles(femur: &TriMesh, axis: &Cylinder, d: &Directions) -> Option<[Point; 2]> {
    let (axial, coronal) = (MEAN_AXIAL_DEG.to_radians(), MEAN_CORONAL_DEG.to_radians());
    let medial = (d.medial + d.anterior * axial.tan() + d.superior * coronal.tan()).normalize();
    let areas = femur.vertex_areas();
    let sigma = 0.5 * axis.radius;
    let end = |side: f64| {
        let score = |p: &Point| {
            let x = p - axis.point;
            let out = x.dot(&medial);
            side * out / DEPTH_MM - (x - medial * out).norm_squared() / (2.0 * sigma * sigma)
        };
        let best = femur.vertices.iter().map(score).fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut weight) = (Vector::zeros(), 0.0);
        for (p, area) in femur.vertices.iter().zip(&areas) {
            let w = area * (score(p) - best).exp();
            sum += (p - axis.point) * w;
            weight += w;
        }
        (weight > 0.0).then(|| axis.point + sum / weight)
    };
    Some([end(1.0)?, end(-1.0)?])
}

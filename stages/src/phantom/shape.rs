//! The bones as smooth implicit solids, and where cartilage covers them.
//!
//! Coordinates of a bone: lateral, anterior, superior [mm], for a knee 88 mm wide. The femur's origin is the middle of the
//! epicondylar axis, the tibia's the middle of the plateaus. The dimensions are those of anatomy books for a large male knee.

use meshes::shapes::icosphere;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};

/// Height of the femur's cut [mm].
pub(super) const FEMUR_CUT: f64 = 74.0;
/// Height of the tibia's and fibula's cut [mm].
pub(super) const TIBIA_CUT: f64 = -92.0;

fn ellipsoid(p: &Point, centre: [f64; 3], radii: [f64; 3]) -> f64 {
    let d = p - Point::from(centre);
    let r = Vector::from(radii);
    let k0 = d.component_div(&r).norm();
    let k1 = d.component_div(&r.component_mul(&r)).norm();
    if k1 > 0.0 { k0 * (k0 - 1.0) / k1 } else { -r.min() }
}

/// Smooth union: the smaller, rounded over `k` [mm].
fn join(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0) / k;
    a.min(b) - h * h * k / 4.0
}

/// Smooth intersection.
fn meet(a: f64, b: f64, k: f64) -> f64 {
    -join(-a, -b, k)
}

/// Smooth interpolation in a table of ascending first entries.
fn table<const N: usize>(rows: &[[f64; N]], z: f64) -> [f64; N] {
    let last = rows.len() - 1;
    let k = rows.iter().rposition(|r| r[0] <= z).unwrap_or(0).min(last - 1);
    let (a, b) = (rows[k], rows[k + 1]);
    let (before, after) = (rows[k.saturating_sub(1)], rows[(k + 2).min(last)]);
    let width = b[0] - a[0];
    let t = ((z - a[0]) / width).clamp(0.0, 1.0);
    std::array::from_fn(|c| {
        let slope_a = (b[c] - before[c]) / (b[0] - before[0]) * width;
        let slope_b = (after[c] - a[c]) / (after[0] - a[0]) * width;
        let (t2, t3) = (t * t, t * t * t);
        a[c] * (2.0 * t3 - 3.0 * t2 + 1.0)
            + slope_a * (t3 - 2.0 * t2 + t)
            + b[c] * (3.0 * t2 - 2.0 * t3)
            + slope_b * (t3 - t2)
    })
}

/// A tube along z of elliptic sections: rows of z, half width, half depth, centre lateral, centre anterior [mm].
fn tube(p: &Point, rows: &[[f64; 5]], exponent: f64) -> f64 {
    let [_, a, b, x, y] = table(rows, p.z);
    let r = (((p.x - x) / a).abs().powf(exponent) + ((p.y - y) / b).abs().powf(exponent)).powf(1.0 / exponent);
    (r - 1.0) * a.min(b)
}

const FEMUR_SHAFT: [[f64; 5]; 6] = [
    [2.0, 40.0, 25.0, 0.0, 12.0],
    [14.0, 38.0, 24.0, 0.0, 14.0],
    [24.0, 31.0, 22.0, 1.0, 17.0],
    [36.0, 24.0, 19.0, 2.5, 21.0],
    [54.0, 18.5, 16.0, 4.5, 25.0],
    [90.0, 16.5, 15.0, 6.0, 26.0],
];

/// The femur: negative inside.
pub(super) fn femur(p: &Point) -> f64 {
    let shaft = meet(tube(p, &FEMUR_SHAFT, 2.2), 1.0 - p.z, 12.0);
    let condyle = |x: f64, posterior: f64, low: f64, half: f64| {
        let back = ellipsoid(p, [x, -1.0, 0.5], [half - 1.0, posterior, posterior]);
        let below = ellipsoid(p, [x * 0.96, 10.0, -1.0], [half + 0.5, 30.0, low]);
        join(back, below, 5.0)
    };
    // As far below the epicondyles as MRI shows, 0.3 to 0.35 of the femur's width with cartilage [jointline2022], and as far behind them:
    // so ligaments keep about their lengths as the knee flexes.
    let condyles = join(condyle(-24.5, 25.5, 23.0, 14.0), condyle(24.0, 24.5, 22.0, 13.5), 4.0);
    let facets = join(
        ellipsoid(p, [15.0, 21.0, 2.0], [17.0, 24.0, 23.0]),
        ellipsoid(p, [-14.0, 20.0, -1.0], [16.0, 21.0, 22.0]),
        6.0,
    );
    let epicondyles = join(
        join(
            ellipsoid(p, [-35.5, 1.0, 2.0], [10.0, 12.0, 12.0]),
            ellipsoid(p, [-35.0, -8.0, 14.0], [6.5, 7.0, 8.0]),
            6.0,
        ),
        ellipsoid(p, [36.0, 0.0, 2.0], [8.0, 11.0, 11.0]),
        4.0,
    );
    let middle = ellipsoid(p, [0.0, 11.0, 6.0], [36.0, 23.0, 20.0]);
    let solid = join(join(join(condyles, facets, 6.0), join(epicondyles, middle, 8.0), 7.0), shaft, 8.0);
    // The notch: its roof falls forwards, as Blumensaat's line does.
    let notch = ellipsoid(p, [0.5, -16.0, -17.0], [10.5, 35.0, 18.0]);
    // The trochlear groove: a ring about the epicondylar axis, in front only.
    let around = ((p.y - 9.0).powi(2) + (p.z + 1.0).powi(2)).sqrt();
    let ring = ((p.x - 1.5).powi(2) + (around - 51.0).powi(2)).sqrt() - 22.0;
    let groove = ring + 0.8 * (p.z - 10.0).max(0.0) + 0.5 * (4.0 - p.y).max(0.0);
    let carved = meet(meet(solid, -groove, 5.0), -notch, 4.0);
    meet(carved, p.z - FEMUR_CUT, 1.0)
}

const TIBIA_SHAFT: [[f64; 5]; 7] = [
    [-110.0, 14.5, 16.5, 0.0, 5.0],
    [-75.0, 15.5, 17.5, 0.0, 5.0],
    [-50.0, 17.5, 19.0, 0.5, 4.0],
    [-34.0, 22.0, 21.5, 1.5, 2.0],
    [-20.0, 29.0, 24.0, 2.0, 0.0],
    [-9.0, 34.5, 25.5, 1.5, -1.0],
    [6.0, 37.0, 26.0, 0.5, -1.0],
];

fn bump(p: &Point, centre: [f64; 2], width: [f64; 2]) -> f64 {
    (-((p.x - centre[0]) / width[0]).powi(2) - ((p.y - centre[1]) / width[1]).powi(2)).exp()
}

/// Height of the plateaus: 7 degrees of posterior slope, a medial dish, a lateral hump, two spines between, whose flanks keep the
/// condyles from sliding sideways.
fn plateau(p: &Point) -> f64 {
    let slope = 7f64.to_radians().tan() * p.y;
    slope - 2.4 * bump(p, [-21.0, 0.0], [13.0, 17.0])
        + 0.9 * bump(p, [21.0, -2.0], [14.0, 11.0])
        + 7.0 * bump(p, [-6.0, -1.0], [7.5, 12.0])
        + 6.2 * bump(p, [6.5, -4.0], [7.5, 11.0])
        - 10.0 * bump(p, [0.0, -26.0], [9.0, 10.0])
        - 1.5 * bump(p, [0.0, 17.0], [9.0, 7.0])
}

/// Tibia and fibula, joined at their joint: negative inside.
pub(super) fn tibfib(p: &Point) -> f64 {
    let column = meet(tube(p, &TIBIA_SHAFT, 2.4), 0.95 * (p.z - plateau(p)), 4.0);
    let tuberosity = ellipsoid(p, [3.0, 20.0, -38.0], [9.0, 9.5, 17.0]);
    let gerdy = ellipsoid(p, [25.0, 14.0, -13.0], [9.0, 8.0, 7.0]);
    let facet = ellipsoid(p, [28.0, -14.0, -14.0], [11.0, 10.0, 9.0]);
    let tibia = join(join(join(column, tuberosity, 9.0), gerdy, 6.0), facet, 6.0);
    let head = join(
        ellipsoid(p, [41.0, -14.0, -26.0], [10.5, 11.0, 12.0]),
        ellipsoid(p, [41.0, -18.0, -17.0], [5.5, 6.0, 7.0]),
        5.0,
    );
    let along = ((-30.0 - p.z) / 80.0).clamp(0.0, 1.0);
    let axis = Vector::new(41.5 - 1.5 * along, -13.0 + 2.0 * along, p.z.min(-30.0));
    let shaft = (p.coords - axis).norm() - 6.8;
    let fibula = join(head, shaft, 8.0);
    meet(join(tibia, fibula, 3.0), TIBIA_CUT - p.z, 1.0)
}

/// The patella, before the trochlea, its cartilage's thickness away from the femur's.
pub(super) fn patella() -> TriMesh {
    let mut mesh = icosphere(1.0, 4);
    // The femur's front at this height; the groove is shallow enough for an ellipsoid to clear it.
    let front = (0..120).map(|k| 60.0 - 0.25 * f64::from(k)).find(|&y| femur(&Point::new(12.0, y, 14.0)) < 0.0);
    let centre = Vector::new(1.0, front.unwrap_or(45.0) + 5.0 + 9.0, 14.0);
    mesh.vertices.iter_mut().for_each(|p| *p = Point::from(centre + Vector::new(21.0 * p.x, 9.0 * p.y, 20.0 * p.z)));
    mesh
}

/// Which cartilage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cover {
    Femur,
    Medial,
    Lateral,
}

/// Distance inside the border of a cartilage [mm], negative outside, and which; at a point of the femur and its normal.
pub(super) fn femur_cover(p: &Point, normal: &Vector) -> (f64, Cover) {
    let radial = Vector::new(0.0, p.y - 8.0, p.z);
    let r = radial.norm().max(1.0);
    // Angle about the axis: 0 in front, 90 below, 180 behind [deg].
    let angle = (-p.z).atan2(p.y - 8.0).to_degrees();
    let angle = if angle < -90.0 { angle + 360.0 } else { angle };
    let arc = (angle + 22.0).min(218.0 - angle).to_radians() * r;
    let narrow = 11.0 + 0.17 * (angle + 22.0).clamp(0.0, 80.0);
    let trochlea = (narrow - (p.x - 1.0).abs()).min((92.0 - angle).to_radians() * r);
    let band = (12.0 - (p.x + 23.5).abs()).max(11.5 - (p.x - 23.0).abs());
    let condyles = band.min((angle - 50.0).to_radians() * r);
    let facing = 14.0 * (normal.dot(&radial) / r - 0.35);
    // The trochlea widens into the condyles without a corner.
    (arc.min(-join(-trochlea, -condyles, 9.0)).min(facing), Cover::Femur)
}

/// As [`femur_cover`], for the tibia.
pub(super) fn tibia_cover(p: &Point, normal: &Vector) -> (f64, Cover) {
    let facing = 24.0 * (normal.z - 0.70);
    let inside = |x: f64, y: f64, a: f64, b: f64| {
        let r = (((p.x - x) / a).powi(2) + ((p.y - y) / b).powi(2)).sqrt();
        (1.0 - r) * a.min(b)
    };
    let height = p.z + 12.0;
    let (medial, lateral) = (inside(-21.5, -1.0, 14.5, 21.5), inside(21.5, -2.0, 15.0, 19.5));
    if p.x < 0.0 {
        (medial.min(facing).min(height), Cover::Medial)
    } else {
        (lateral.min(facing).min(height), Cover::Lateral)
    }
}

//! The groove of the trochlea as a circle in the sagittal plane.

use crate::StageError;
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use nalgebra::{Matrix3, Vector3};

/// Where the groove is sought about a point ahead of the epicondylar axis: angles below the front, and their steps [deg].
const ANGLES: [f64; 3] = [-10.0, 70.0, 5.0];
/// That point, ahead of the axis, of the transepicondylar width [-].
const AHEAD: f64 = 0.1;
/// The groove lies within this of the middle, of the transepicondylar width [-].
const BESIDE: f64 = 0.2;
/// Fewer steps of the groove than this are no trochlea [-].
const LEAST_STEPS: usize = 6;

/// The groove.
pub(crate) struct Trochlea {
    /// A point of the axis about which it runs.
    pub(crate) centre: Point,
    /// Its radius [mm].
    pub(crate) radius: f64,
    /// Lateral to medial place of its bottom, from the femur's origin, by angle below the front [deg, mm].
    bottom: Vec<(f64, f64)>,
}

impl Trochlea {
    /// Place of its bottom at an angle below the front about its own axis [rad]: on the circle.
    pub(crate) fn at(&self, angle: f64, femur: &AnatomicalFrame) -> Point {
        let degrees = angle.to_degrees();
        let nearest = self.bottom.iter().min_by(|a, b| (a.0 - degrees).abs().total_cmp(&(b.0 - degrees).abs()));
        let medial = nearest.map_or(0.0, |b| b.1) - (self.centre - femur.origin).dot(&femur.medial);
        let out = femur.anterior * angle.cos() - femur.superior * angle.sin();
        self.centre + out * self.radius + femur.medial * medial
    }
}

/// The groove of a femur's articular face.
///
/// # Errors
/// A face that does not cover the trochlea.
pub(super) fn trochlea(face: &TriMesh, femur: &AnatomicalFrame, width: f64) -> Result<Trochlea, StageError> {
    let about = femur.origin + femur.anterior * (AHEAD * width);
    let [from, to, step] = ANGLES;
    let mut bottoms: Vec<(f64, f64, f64, f64)> = Vec::new();
    let places: Vec<[f64; 3]> = face
        .vertices
        .iter()
        .map(|p| [femur.medial, femur.anterior, femur.superior].map(|axis| (p - about).dot(&axis)))
        .filter(|[m, ..]| m.abs() < BESIDE * width)
        .collect();
    for k in 0..=((to - from) / step) as usize {
        let angle = from + step * k as f64;
        let mut row: Vec<&[f64; 3]> =
            places.iter().filter(|[_, a, s]| ((-s).atan2(*a).to_degrees() - angle).abs() < 0.5 * step).collect();
        row.sort_by(|p, q| p[1].hypot(p[2]).total_cmp(&q[1].hypot(q[2])));
        row.truncate(5);
        if row.len() == 5 {
            let mean = |c: usize| row.iter().map(|p| p[c]).sum::<f64>() / 5.0;
            bottoms.push((angle, mean(0), mean(1), mean(2)));
        }
    }
    if bottoms.len() < LEAST_STEPS {
        return Err(StageError::Knee(format!(
            "patella: the femoral cartilage covers the trochlea at {} of {} angles, expected {LEAST_STEPS}; a patella needs the scan of the whole trochlea",
            bottoms.len(),
            ((to - from) / step) as usize + 1
        )));
    }
    let (a, s, radius) = circle(&bottoms)
        .ok_or_else(|| StageError::Knee("patella: the bottom of the trochlea's groove is straight".into()))?;
    let centre = about + femur.anterior * a + femur.superior * s;
    let bottom = bottoms
        .iter()
        .map(|b| ((s - b.3).atan2(b.2 - a).to_degrees(), b.1 + (about - femur.origin).dot(&femur.medial)))
        .collect();
    Ok(Trochlea { centre, radius, bottom })
}

/// The circle of least algebraic distance [kasa1976]: centre and radius.
fn circle(bottoms: &[(f64, f64, f64, f64)]) -> Option<(f64, f64, f64)> {
    let (mut m, mut r) = (Matrix3::zeros(), Vector3::zeros());
    for &(_, _, a, s) in bottoms {
        let row = Vector3::new(a, s, 1.0);
        m += row * row.transpose();
        r += row * (a * a + s * s);
    }
    let x = m.lu().solve(&r)?;
    let (a, s) = (0.5 * x[0], 0.5 * x[1]);
    let radius = (x[2] + a * a + s * s).sqrt();
    (radius.is_finite() && radius < 200.0).then_some((a, s, radius))
}

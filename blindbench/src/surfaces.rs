//! Other surfaces: tilted plateaus and another form of the cartilage, as a build may have them wrong.

use crate::knee::{KneeInput, axes, local, normal};
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use nalgebra::{Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How far a knee's surfaces may be from the copied ones, as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfaces {
    /// Tilt of each tibial surface about its medial and its anterior axis [deg].
    pub tilt_deg: f64,
    /// Height of waves on the femur and on each tibial surface [mm].
    pub form_mm: f64,
}

impl Surfaces {
    /// Declared, not measured.
    pub const OTHER: Surfaces = Surfaces { tilt_deg: 2.0, form_mm: 0.5 };

    /// A knee with other surfaces; its ligaments and frames stay.
    pub fn of(&self, input: &KneeInput, seed: u64) -> KneeInput {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut out = input.clone();
        let (femur, tibia) = &input.frames;
        let waves = Waves::drawn(self.form_mm, &mut random);
        waves.raise(&mut out.femur, femur);
        for part in &mut out.tibia {
            let about = [normal(&mut random), normal(&mut random)].map(|n| (self.tilt_deg * n).to_radians());
            tilt(part, tibia, &Rotation3::new(Vector3::new(about[0], about[1], 0.0)));
            let waves = Waves::drawn(self.form_mm, &mut random);
            waves.raise(part, tibia);
        }
        out
    }
}

/// Turns a surface about the mean of its points; the turn is told in the bone's frame.
fn tilt(mesh: &mut TriMesh, frame: &AnatomicalFrame, turn: &Rotation3<f64>) {
    let count = mesh.vertices.len().max(1) as f64;
    let middle = mesh.vertices.iter().map(|p| local(frame, p)).sum::<Vector3<f64>>() / count;
    for p in &mut mesh.vertices {
        *p = frame.origin + axes(frame) * (middle + turn * (local(frame, p) - middle));
    }
}

/// Waves in one form [-].
const WAVES: usize = 6;
/// Shortest and longest of them [mm]: between a dimple of the cartilage and a condyle.
const LENGTHS_MM: [f64; 2] = [25.0, 45.0];

/// Waves through space: the number of each along the bone's axes [rad/mm], and its phase [rad].
struct Waves {
    height: f64,
    each: Vec<(Vector3<f64>, f64)>,
}

/// One of them, of any direction.
fn wave(random: &mut ChaCha8Rng) -> (Vector3<f64>, f64) {
    let way = Vector3::from_fn(|_, _| normal(random)).normalize();
    let length = LENGTHS_MM[0] + (LENGTHS_MM[1] - LENGTHS_MM[0]) * random.random::<f64>();
    let turn = 2.0 * std::f64::consts::PI;
    (way * (turn / length), turn * random.random::<f64>())
}

impl Waves {
    fn drawn(form_mm: f64, random: &mut ChaCha8Rng) -> Waves {
        // the mean square of a cosine is a half
        Waves { height: form_mm * (2.0 / WAVES as f64).sqrt(), each: (0..WAVES).map(|_| wave(random)).collect() }
    }

    /// Moves each point of a surface along its normal.
    fn raise(&self, mesh: &mut TriMesh, frame: &AnatomicalFrame) {
        let normals = mesh.vertex_normals();
        for (p, out) in mesh.vertices.iter_mut().zip(normals) {
            let place = local(frame, p);
            let sum: f64 = self.each.iter().map(|(way, phase)| (way.dot(&place) + phase).cos()).sum();
            *p += out * (self.height * sum);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flat;

    /// Height of each tibial point over where it was, for many draws [mm].
    fn heights(surfaces: Surfaces) -> Vec<Vec<f64>> {
        let input = flat::input();
        let of = |seed: u64| {
            let other = surfaces.of(&input, seed);
            let pairs = other.tibia[0].vertices.iter().zip(&input.tibia[0].vertices);
            pairs.map(|(a, b)| (a - b).z).collect()
        };
        (0..300).map(of).collect()
    }

    #[test]
    fn waves_are_as_high_as_told_and_slow() {
        let all = heights(Surfaces { tilt_deg: 0.0, form_mm: 0.5 });
        let squares: Vec<f64> = all.iter().flatten().map(|h| h * h).collect();
        let height = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!((height - 0.5).abs() < 0.05, "{height} mm");
        // 5 mm apart, neighbours of a row are nearly as high
        let steps: Vec<f64> = all.iter().map(|h| (h[41] - h[40]).powi(2)).collect();
        let step = (steps.iter().sum::<f64>() / steps.len() as f64).sqrt();
        assert!(step < 0.7 * height && step > 0.0, "{step} mm");
    }

    #[test]
    fn a_tilted_surface_keeps_its_middle_and_its_form() {
        let input = flat::input();
        let (mut squares, mut count) = (0.0, 0.0);
        for seed in 0..300 {
            let other = Surfaces { tilt_deg: 2.0, form_mm: 0.0 }.of(&input, seed);
            let (a, b) = (&other.tibia[0], &input.tibia[0]);
            let middle =
                |m: &TriMesh| m.vertices.iter().map(|p| p.coords).sum::<Vector3<f64>>() / m.vertices.len() as f64;
            assert!((middle(a) - middle(b)).norm() < 1e-9);
            let apart = |m: &TriMesh| (m.vertices[0] - m.vertices[80]).norm();
            assert!((apart(a) - apart(b)).abs() < 1e-9);
            assert_eq!(other.femur.vertices, input.femur.vertices);
            squares += a.triangle_normals()[0].angle(&b.triangle_normals()[0]).to_degrees().powi(2);
            count += 1.0;
        }
        // about two axes, 2 deg each
        let tilt = (squares / count).sqrt();
        assert!((tilt - 2.0 * 2.0f64.sqrt()).abs() < 0.35, "{tilt} deg");
    }

    #[test]
    fn the_mirror_image_of_a_knee_gets_the_mirror_image_of_its_surfaces() {
        let left = flat::input();
        let right = flat::mirrored(&left);
        let [a, b] = [&left, &right].map(|knee| Surfaces::OTHER.of(knee, 7));
        let pairs = a.tibia[0].vertices.iter().chain(&a.femur.vertices);
        for (p, q) in pairs.zip(b.tibia[0].vertices.iter().chain(&b.femur.vertices)) {
            assert!((p.x + q.x).abs() < 1e-9 && (p.y - q.y).abs() < 1e-9 && (p.z - q.z).abs() < 1e-9, "{p} {q}");
        }
    }
}

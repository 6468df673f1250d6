//! Bones with truth for registration, and variants of them whose only error is one that is drawn.

use meshes::registration::{bare, target::Target};
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Translation3, UnitQuaternion};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// A bone by CT and by scanner, with the true pose.
#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) ct: TriMesh,
    pub(crate) scan: ColouredMesh,
    pub(crate) truth: Isometry,
    pub(crate) pairs: Vec<(Point, Point)>,
}

/// What a CT's error is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Noise {
    /// Of each vertex by itself [mm].
    White(f64),
    /// A Gaussian field of this deviation and length [mm] that falls off as a Gaussian.
    Smooth(f64, f64),
    /// A field of this deviation and length [mm] with Matern's correlation of this order, two and a half or one and a half.
    Matern(f64, f64, f64),
}

/// The bone of a specimen whose files `read` gives by their path.
pub(crate) fn case(read: impl Fn(&str) -> Vec<u8>, bone: &str) -> Case {
    let ct = formats::stl::read(&read(&format!("ct/{bone}.stl"))).unwrap();
    let scan = formats::ply::read(&read(&format!("scans/{bone}.ply"))).unwrap();
    let truth: serde_json::Value = serde_json::from_slice(&read("truth/truth.json")).unwrap();
    let at = |r: usize, c: usize| truth["scan_to_ct"][bone][r][c].as_f64().unwrap();
    let turn = UnitQuaternion::from_matrix(&Matrix3::from_fn(at));
    let truth = Isometry::from_parts(Translation3::new(at(0, 3), at(1, 3), at(2, 3)), turn);
    let text = String::from_utf8(read("landmarks.csv")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|l| l.split(',').collect()).collect();
    let point = |r: &[&str]| Point::from(Vector::from_fn(|k, _| r[2 + k].parse::<f64>().unwrap()));
    let in_scan = rows.iter().filter(|r| r[1] == format!("scan_{bone}"));
    let pairs = in_scan
        .filter_map(|r| rows.iter().find(|c| c[1] == "ct" && c[0] == r[0]).map(|c| (point(r), point(c))))
        .collect();
    Case { ct, scan, truth, pairs }
}

/// A standard normal number.
pub(crate) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

/// A turn by any angle about any axis, and a shift of up to 200 mm each way.
pub(crate) fn random_pose(rng: &mut ChaCha8Rng) -> Isometry {
    let turn = nalgebra::Quaternion::new(normal(rng), normal(rng), normal(rng), normal(rng));
    let shift = Vector::from_fn(|_, _| rng.random_range(-200.0..200.0));
    Isometry::from_parts(shift.into(), UnitQuaternion::from_quaternion(turn))
}

/// The case with the scan's bare bone laid exactly on the CT bone but for the scanner's own noise [mm], so that no other
/// error is left; cartilage, screws and the ragged edge stay as they are.
pub(crate) fn exact_twin(case: &Case, scanner: f64, rng: &mut ChaCha8Rng) -> Case {
    let target = Target::new(&case.ct, 6000).unwrap();
    let told = bare::classify(&target, &bare::prepare(&case.scan), &case.truth);
    let mut twin = case.clone();
    let back = case.truth.inverse();
    for ((p, at), bare) in twin.scan.mesh.vertices.iter_mut().zip(&told.standing).zip(&told.bare) {
        let by = scanner * normal(rng);
        if *bare {
            *p = back * (at.foot + at.normal * by);
        }
    }
    twin
}

/// The surface with each vertex moved along its normal by a drawn error.
pub(crate) fn noisy(ct: &TriMesh, noise: Noise, rng: &mut ChaCha8Rng) -> TriMesh {
    let normals = ct.vertex_normals();
    let mut error: Box<dyn FnMut(&Point) -> f64> = match noise {
        Noise::White(deviation) => Box::new(move |_| deviation * normal(rng)),
        Noise::Smooth(deviation, length) => waves(deviation, rng, |rng| Vector::from_fn(|_, _| normal(rng)) / length),
        Noise::Matern(order, deviation, length) => waves(deviation, rng, |rng| {
            // The spectrum of Matern's function is Student's distribution of twice the order.
            let square: f64 = (0..(2.0 * order) as usize).map(|_| normal(rng).powi(2)).sum();
            Vector::from_fn(|_, _| normal(rng)) / length / (square / (2.0 * order)).sqrt()
        }),
    };
    let vertices = ct.vertices.iter().zip(&normals).map(|(p, n)| p + n * error(p)).collect();
    TriMesh { vertices, triangles: ct.triangles.clone() }
}

/// A Gaussian field of 300 random waves.
fn waves(
    deviation: f64,
    rng: &mut ChaCha8Rng,
    wave: impl Fn(&mut ChaCha8Rng) -> Vector,
) -> Box<dyn FnMut(&Point) -> f64> {
    let waves: Vec<(Vector, f64)> = (0..300).map(|_| (wave(rng), rng.random_range(0.0..TAU))).collect();
    let size = deviation * (2.0 / waves.len() as f64).sqrt();
    Box::new(move |p| size * waves.iter().map(|(k, phase)| (k.dot(&p.coords) + phase).cos()).sum::<f64>())
}

/// The scan without the share of its vertices that lies least far along a direction.
pub(crate) fn part(scan: &ColouredMesh, direction: &Vector, missing: f64) -> ColouredMesh {
    let mesh = &scan.mesh;
    let mut heights: Vec<f64> = mesh.vertices.iter().map(|p| p.coords.dot(direction)).collect();
    heights.sort_by(f64::total_cmp);
    let cut = heights[(heights.len() as f64 * missing) as usize];
    let kept = |t: usize| mesh.triangles[t].iter().all(|&v| mesh.vertices[v as usize].coords.dot(direction) > cut);
    let (mesh, from) = mesh.submesh(kept);
    ColouredMesh { mesh, colours: from.iter().map(|&v| scan.colours[v as usize]).collect() }
}

/// Mean distance over the scan [mm] and angle [deg] between two poses.
pub(crate) fn apart(a: &Isometry, b: &Isometry, scan: &TriMesh) -> (f64, f64) {
    let sum: f64 = scan.vertices.iter().map(|p| (a * p - b * p).norm()).sum();
    (sum / scan.vertices.len() as f64, a.rotation.angle_to(&b.rotation).to_degrees())
}

/// A generator of its own for each number.
pub(crate) fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

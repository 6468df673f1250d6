//! Surfaces for the page: in the tibia's anatomical axes, thinned, quantised and packed once however often they are shown.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion};
use serde_json::{Value, json};
use stages::frames::Frames;
use std::collections::BTreeMap;

/// The surfaces of a page by name, and the axes they are in: x to the patient's right, y forwards, z up; mm.
pub(crate) struct Pool {
    axes: Isometry,
    meshes: BTreeMap<String, Value>,
}

impl Pool {
    /// An empty pool in the tibia's axes, or in CT's where frames have not been found.
    pub(crate) fn new(frames: Option<&Frames>) -> Pool {
        frames.map_or(Pool { axes: Isometry::identity(), meshes: BTreeMap::new() }, |f| Pool::of(&f.tibia))
    }

    /// An empty pool in a tibia's axes.
    pub(crate) fn of(t: &AnatomicalFrame) -> Pool {
        let right = t.anterior.cross(&t.superior);
        let rows = Matrix3::from_rows(&[right.transpose(), t.anterior.transpose(), t.superior.transpose()]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rows));
        let axes = Isometry::from_parts(Translation3::from(-(turn * t.origin.coords)), turn);
        Pool { axes, meshes: BTreeMap::new() }
    }

    /// The page's axes from CT.
    pub(crate) fn axes(&self) -> Isometry {
        self.axes
    }

    /// A CT point in the page's axes.
    pub(crate) fn point(&self, p: &Point) -> Point {
        self.axes * p
    }

    /// A motion of CT points as the rows of a 3 x 4 matrix in the page's axes.
    pub(crate) fn motion(&self, motion: &Isometry) -> Vec<f64> {
        let m = (self.axes * motion * self.axes.inverse()).to_homogeneous();
        (0..12).map(|i| rounded(m[(i / 4, i % 4)], 1e6)).collect()
    }

    /// Keeps a surface under `name`; at most one of a name.
    pub(crate) fn keep(&mut self, name: &str, mesh: &TriMesh) {
        if !self.meshes.contains_key(name) {
            let packed = packed(&mesh.moved(&self.axes));
            self.meshes.insert(name.to_owned(), packed);
        }
    }

    /// All of it.
    pub(crate) fn json(self) -> Value {
        json!(self.meshes)
    }
}

/// `x` to one part in `parts` of a unit.
pub(crate) fn rounded(x: f64, parts: f64) -> f64 {
    (x * parts).round() / parts
}

/// Corners as 16-bit steps in the bounding box, triangles as 16- or 32-bit indices; little-endian, base64.
fn packed(mesh: &TriMesh) -> Value {
    let (low, high) = mesh.bounds().unwrap_or((Point::origin(), Point::origin()));
    let step = (high - low).map(|x| (x / 65535.0).max(1e-9));
    let corners: Vec<u8> = mesh
        .vertices
        .iter()
        .flat_map(|p| {
            (0..3).flat_map(|k| (((p[k] - low[k]) / step[k]).round() as u16).to_le_bytes()).collect::<Vec<_>>()
        })
        .collect();
    let wide = mesh.vertices.len() > 65536;
    let indices = mesh.triangles.iter().flatten();
    let triangles: Vec<u8> = if wide {
        indices.flat_map(|i| i.to_le_bytes()).collect()
    } else {
        indices.flat_map(|i| (*i as u16).to_le_bytes()).collect()
    };
    json!({
        "low": low.coords.map(|x| rounded(x, 1e4)).as_slice(),
        "step": step.as_slice(),
        "corners": STANDARD.encode(corners),
        "triangles": STANDARD.encode(triangles),
        "wide": wide,
    })
}

/// Values as 8-bit steps from `low` to `high`, base64.
pub(crate) fn packed_values(values: &[f64], low: f64, high: f64) -> String {
    let bytes: Vec<u8> =
        values.iter().map(|v| (255.0 * (v - low) / (high - low)).round().clamp(0.0, 255.0) as u8).collect();
    STANDARD.encode(bytes)
}

/// A surface with the corners of every cube of `cell` mm drawn together to their mean, and the means of their values.
pub(crate) fn thinned(mesh: &TriMesh, values: &[&[f64]], cell: f64) -> (TriMesh, Vec<Vec<f64>>) {
    let mut cells: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut sums: Vec<(Vector, f64)> = Vec::new();
    let mut means = vec![Vec::new(); values.len()];
    let mut new_of = Vec::with_capacity(mesh.vertices.len());
    for (v, p) in mesh.vertices.iter().enumerate() {
        let key = [0, 1, 2].map(|k| (p[k] / cell).floor() as i64);
        let n = *cells.entry(key).or_insert(sums.len() as u32) as usize;
        if n == sums.len() {
            sums.push((Vector::zeros(), 0.0));
            means.iter_mut().for_each(|m: &mut Vec<f64>| m.push(0.0));
        }
        sums[n].0 += p.coords;
        sums[n].1 += 1.0;
        values.iter().zip(&mut means).for_each(|(from, to)| to[n] += from.get(v).copied().unwrap_or(0.0));
        new_of.push(n as u32);
    }
    means.iter_mut().for_each(|m| m.iter_mut().zip(&sums).for_each(|(x, (_, n))| *x /= n));
    let vertices = sums.iter().map(|(sum, n)| Point::from(sum / *n)).collect();
    let triangles = mesh
        .triangles
        .iter()
        .map(|t| t.map(|v| new_of[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    (TriMesh { vertices, triangles }, means)
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::shapes::icosphere;

    #[test]
    fn thinning_keeps_the_shape_and_the_values() {
        let ball = icosphere(20.0, 5);
        let heights: Vec<f64> = ball.vertices.iter().map(|p| p.z).collect();
        let (thin, values) = thinned(&ball, &[&heights], 2.0);
        assert!(thin.vertices.len() < ball.vertices.len() / 2);
        assert!(thin.vertices.iter().all(|p| (p.coords.norm() - 20.0).abs() < 0.2));
        assert!(thin.vertices.iter().zip(&values[0]).all(|(p, z)| (p.z - z).abs() < 1e-9));
        assert!((thin.area() / ball.area() - 1.0).abs() < 0.02);
    }

    #[test]
    fn packing_is_finer_than_a_hundredth_of_a_millimetre() {
        let ball = icosphere(50.0, 3);
        let packed = packed(&ball);
        let bytes = STANDARD.decode(packed["corners"].as_str().unwrap()).unwrap();
        let step = packed["step"][0].as_f64().unwrap();
        let low = packed["low"][0].as_f64().unwrap();
        assert!(step < 0.01);
        for (v, p) in ball.vertices.iter().enumerate() {
            let x = low + step * f64::from(u16::from_le_bytes([bytes[6 * v], bytes[6 * v + 1]]));
            assert!((x - p.x).abs() < 0.01);
        }
        assert_eq!(packed["wide"], false);
    }
}

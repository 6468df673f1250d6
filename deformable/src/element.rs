//! The element: uniform gradient, volume, hourglass vectors, stiffness bound.

use super::law::Material;
use meshes::hex::FACES;
use meshes::{Point, Vector};
use nalgebra::{Matrix3, SMatrix};

/// Natural coordinates of the nodes.
const NATURAL: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// Reference values of an element.
#[derive(Clone, Debug)]
pub(super) struct Element {
    /// Volume [mm3].
    pub(super) volume: f64,
    /// Mean gradients of the shape functions [1/mm]: the derivative of the volume by each node's place, over the volume.
    pub(super) gradient: [Vector; 8],
    /// Sum over nodes of each hourglass vector times place [mm].
    pub(super) warp: [Vector; 4],
}

/// The four hourglass vectors at node `n`: products of natural coordinates.
pub(super) fn hourglass_signs(n: usize) -> [f64; 4] {
    let [x, y, z] = NATURAL[n];
    [y * z, x * z, x * y, x * y * z]
}

impl Element {
    /// Exact means of the trilinear element, by integrals over its faces.
    pub(super) fn new(p: &[Point; 8]) -> Element {
        let mut area = [Vector::zeros(); 8];
        for face in FACES {
            let q = face.map(|k| p[k] - p[0]);
            for (k, part) in face.iter().zip(face_areas(&q)) {
                area[*k] += part;
            }
        }
        let volume = (0..8).map(|k| area[k].dot(&(p[k] - p[0]))).sum::<f64>() / 3.0;
        let mut warp = [Vector::zeros(); 4];
        for (n, place) in p.iter().enumerate() {
            for (w, sign) in warp.iter_mut().zip(hourglass_signs(n)) {
                *w += (place - p[0]) * sign;
            }
        }
        Element { volume, gradient: area.map(|a| a / volume), warp }
    }

    /// Upper bound of the element's stiffness against its nodes' motion, over volume [MPa/mm2]: `lambda tr G + 2 mu max G`, `G` the sum
    /// over nodes of the gradients' squares.
    pub(super) fn stiffness_bound(&self, material: &Material, deformation: &Matrix3<f64>) -> f64 {
        let turned = deformation.try_inverse().unwrap_or_else(Matrix3::identity).transpose();
        let mut b = SMatrix::<f64, 3, 8>::zeros();
        for (k, g) in self.gradient.iter().enumerate() {
            b.set_column(k, &(turned * g));
        }
        let g = b * b.transpose();
        let largest = g.symmetric_eigenvalues().max();
        material.lambda() * g.trace() + 2.0 * material.mu() * largest
    }

    /// Sum of the squares of the gradients [1/mm2].
    pub(super) fn squares(&self) -> f64 {
        self.gradient.iter().map(Vector::norm_squared).sum()
    }

    /// Deformation gradient with nodes at `x`.
    pub(super) fn deformation(&self, x: &[Point; 8]) -> Matrix3<f64> {
        x.iter().zip(&self.gradient).map(|(p, g)| p.coords * g.transpose()).sum()
    }
}

/// Integrals of shape function times area vector over a bilinear face.
fn face_areas(q: &[Vector; 4]) -> [Vector; 4] {
    let g = 1.0 / 3f64.sqrt();
    let corner = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mut out = [Vector::zeros(); 4];
    for [s, t] in corner.map(|c| c.map(|x| x * g)) {
        let (mut a, mut b) = (Vector::zeros(), Vector::zeros());
        for (k, c) in corner.iter().enumerate() {
            a += q[k] * (c[0] * (1.0 + c[1] * t) / 4.0);
            b += q[k] * (c[1] * (1.0 + c[0] * s) / 4.0);
        }
        let normal = a.cross(&b);
        for (o, c) in out.iter_mut().zip(corner) {
            *o += normal * ((1.0 + c[0] * s) * (1.0 + c[1] * t) / 4.0);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distorted() -> [Point; 8] {
        std::array::from_fn(|k| {
            let [x, y, z] = NATURAL[k];
            let n = k as f64;
            Point::new(x + 0.1 * (3.1 * n).sin(), y + 0.12 * (1.7 * n).cos(), 0.7 * z + 0.1 * (2.3 * n).sin())
        })
    }

    #[test]
    fn gradients_are_exact_for_linear_fields_and_blind_to_hourglass_vectors_made_orthogonal() {
        let p = distorted();
        let e = Element::new(&p);
        let sum: Vector = e.gradient.iter().sum();
        assert!(sum.norm() < 1e-14);
        let f = e.deformation(&p);
        assert!((f - Matrix3::identity()).amax() < 1e-14);
        // the derivative of the volume
        let mut moved = p;
        moved[5].y += 1e-6;
        let slope = (Element::new(&moved).volume - e.volume) / 1e-6;
        assert!((slope - e.gradient[5].y * e.volume).abs() < 1e-6);
    }

    #[test]
    fn the_bound_is_exact_for_a_cube() {
        let p = std::array::from_fn(|k| Point::from(Vector::from(NATURAL[k]) * 0.5));
        let material = Material::cartilage();
        let bound = Element::new(&p).stiffness_bound(&material, &Matrix3::identity());
        assert!((bound - 0.5 * (3.0 * material.lambda() + 2.0 * material.mu())).abs() < 1e-10);
    }
}

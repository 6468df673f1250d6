//! Hexahedral meshes as plain values, and their quality.

use crate::{Point, Vector};
use serde::{Deserialize, Serialize};

/// A hexahedral mesh swept from a bony to an articular face. Node order of an element is VTK's and Abaqus' (C3D8):
/// 0..3 the bony quadrilateral counter-clockwise seen from the articular side, 4..7 above them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HexMesh {
    /// Node positions, n x 3 [mm].
    pub nodes: Vec<Point>,
    /// Node indices of each element, m x 8.
    pub elements: Vec<[u32; 8]>,
    /// Nodes of the bony face, ascending: fixed to the bone.
    pub bony_nodes: Vec<u32>,
    /// Nodes of the articular face, ascending.
    pub articular_nodes: Vec<u32>,
    /// Articular quadrilaterals, outward normals, k x 4.
    pub articular_quads: Vec<[u32; 4]>,
    /// Bony quadrilaterals, outward normals (into the bone), k x 4.
    pub bony_quads: Vec<[u32; 4]>,
}

/// At each corner: the corner, then its three edge neighbours in right-handed order.
const CORNERS: [[usize; 4]; 8] =
    [[0, 1, 3, 4], [1, 2, 0, 5], [2, 3, 1, 6], [3, 0, 2, 7], [4, 7, 5, 0], [5, 4, 6, 1], [6, 5, 7, 2], [7, 6, 4, 3]];

/// The six faces of an element, outward normals.
pub const FACES: [[usize; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];

impl HexMesh {
    /// Smallest corner scaled Jacobian of element `e` [-]: 1 for a cube, <= 0 inverted [stimpson2007].
    pub fn scaled_jacobian(&self, e: usize) -> f64 {
        let p = self.elements[e].map(|n| self.nodes[n as usize]);
        CORNERS
            .iter()
            .map(|&[o, a, b, c]| {
                let (u, v, w): (Vector, Vector, Vector) = (p[a] - p[o], p[b] - p[o], p[c] - p[o]);
                let lengths = u.norm() * v.norm() * w.norm();
                if lengths > 0.0 { u.cross(&v).dot(&w) / lengths } else { -1.0 }
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Volume of element `e` [mm3], by its six faces split about their centres.
    pub fn element_volume(&self, e: usize) -> f64 {
        let p = self.elements[e].map(|n| self.nodes[n as usize]);
        let origin = p[0];
        FACES
            .iter()
            .map(|face| {
                let q = face.map(|k| p[k] - origin);
                let centre = (q[0] + q[1] + q[2] + q[3]) / 4.0;
                (0..4).map(|k| centre.dot(&q[k].cross(&q[(k + 1) % 4])) / 6.0).sum::<f64>()
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_perfect_and_a_turned_one_inverted() {
        let corner = |x: f64, y: f64, z: f64| Point::new(2.0 * x, 3.0 * y, z);
        let mut mesh = HexMesh {
            nodes: vec![
                corner(0.0, 0.0, 0.0),
                corner(1.0, 0.0, 0.0),
                corner(1.0, 1.0, 0.0),
                corner(0.0, 1.0, 0.0),
                corner(0.0, 0.0, 1.0),
                corner(1.0, 0.0, 1.0),
                corner(1.0, 1.0, 1.0),
                corner(0.0, 1.0, 1.0),
            ],
            elements: vec![[0, 1, 2, 3, 4, 5, 6, 7]],
            ..HexMesh::default()
        };
        assert!((mesh.scaled_jacobian(0) - 1.0).abs() < 1e-12);
        assert!((mesh.element_volume(0) - 6.0).abs() < 1e-12);
        mesh.elements[0] = [4, 5, 6, 7, 0, 1, 2, 3];
        assert!(mesh.scaled_jacobian(0) < 0.0);
    }
}

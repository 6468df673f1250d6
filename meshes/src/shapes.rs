//! Simple closed shapes for tests and examples.

use crate::Point;
use crate::surface::TriMesh;
use std::collections::BTreeMap;

/// A sphere about the origin: an icosahedron subdivided `levels` times, `20 * 4^levels` triangles, radius in mm.
pub fn icosphere(radius: f64, levels: u32) -> TriMesh {
    let g = f64::midpoint(1.0, 5f64.sqrt());
    let corner = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ];
    let mut mesh = TriMesh {
        vertices: corner.iter().map(|&(x, y, z)| Point::new(x, y, z)).collect(),
        triangles: vec![
            [0, 11, 5],
            [0, 5, 1],
            [0, 1, 7],
            [0, 7, 10],
            [0, 10, 11],
            [1, 5, 9],
            [5, 11, 4],
            [11, 10, 2],
            [10, 7, 6],
            [7, 1, 8],
            [3, 9, 4],
            [3, 4, 2],
            [3, 2, 6],
            [3, 6, 8],
            [3, 8, 9],
            [4, 9, 5],
            [2, 4, 11],
            [6, 2, 10],
            [8, 6, 7],
            [9, 8, 1],
        ],
    };
    for _ in 0..levels {
        mesh = subdivided(&mesh);
    }
    for p in &mut mesh.vertices {
        *p = Point::from(p.coords.normalize() * radius);
    }
    mesh
}

/// Each triangle split into four at its edge midpoints (flat subdivision); neighbours stay joined.
pub fn subdivided(mesh: &TriMesh) -> TriMesh {
    let mut vertices = mesh.vertices.clone();
    let mut midpoint = BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *midpoint.entry((a.min(b), a.max(b))).or_insert_with(|| {
            vertices.push(nalgebra::center(&vertices[a as usize], &vertices[b as usize]));
            (vertices.len() - 1) as u32
        })
    };
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for &[a, b, c] in &mesh.triangles {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    TriMesh { vertices, triangles }
}

/// An axis-aligned box from the origin to `size` [mm], 12 triangles, outward normals.
pub fn cuboid(size: [f64; 3]) -> TriMesh {
    let [x, y, z] = size;
    TriMesh {
        vertices: (0..8)
            .map(|i| {
                Point::new(
                    if i & 1 != 0 { x } else { 0.0 },
                    if i & 2 != 0 { y } else { 0.0 },
                    if i & 4 != 0 { z } else { 0.0 },
                )
            })
            .collect(),
        triangles: vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::Topology;

    #[test]
    fn shapes_are_closed_and_outward() {
        for mesh in [icosphere(2.0, 2), cuboid([1.0, 2.0, 3.0]), subdivided(&cuboid([1.0, 1.0, 1.0]))] {
            assert!(Topology::of(&mesh).is_closed());
            assert!(mesh.volume() > 0.0);
        }
        assert!((cuboid([1.0, 2.0, 3.0]).volume() - 6.0).abs() < 1e-12);
    }
}

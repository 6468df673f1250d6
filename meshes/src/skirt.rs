//! An open patch continued past its rim.

use crate::Vector;
use crate::surface::TriMesh;
use std::collections::BTreeMap;

/// Rings of triangles in a skirt.
const RINGS: usize = 3;
/// Rounds in which the ways outward are averaged with their neighbours'.
const ROUNDS: usize = 5;

/// `mesh` with a skirt of `width` [mm] along its rim, in the plane of the triangles there. Where the rim touches itself there is none.
pub fn skirted(mesh: &TriMesh, width: f64) -> TriMesh {
    let mut count: BTreeMap<(u32, u32), (usize, [u32; 2], usize)> = BTreeMap::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            count.entry((a.min(b), a.max(b))).or_insert((0, [a, b], t)).0 += 1;
        }
    }
    let mut touched = vec![0; mesh.vertices.len()];
    let rim: Vec<([u32; 2], usize)> = count.into_values().filter(|c| c.0 == 1).map(|(_, e, t)| (e, t)).collect();
    rim.iter().flat_map(|(e, _)| e).for_each(|&v| touched[v as usize] += 1);
    let plain: Vec<&([u32; 2], usize)> =
        rim.iter().filter(|(e, _)| e.iter().all(|&v| touched[v as usize] == 2)).collect();
    let outward = outward(mesh, &plain);
    let mut out = mesh.clone();
    let mut rings: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (&v, way) in &outward {
        let mut ring = vec![v];
        for k in 1..=RINGS {
            ring.push(out.vertices.len() as u32);
            out.vertices.push(mesh.vertices[v as usize] + way * (width * k as f64 / RINGS as f64));
        }
        rings.insert(v, ring);
    }
    for ([a, b], _) in plain {
        let (a, b) = (&rings[a], &rings[b]);
        for k in 0..RINGS {
            out.triangles.push([b[k], a[k], a[k + 1]]);
            out.triangles.push([b[k], a[k + 1], b[k + 1]]);
        }
    }
    out
}

/// The way outward at each end of the rim's edges.
fn outward(mesh: &TriMesh, rim: &[&([u32; 2], usize)]) -> BTreeMap<u32, Vector> {
    let normals = mesh.triangle_normals();
    let mut out: BTreeMap<u32, Vector> = BTreeMap::new();
    for ([a, b], t) in rim {
        let along = mesh.vertices[*b as usize] - mesh.vertices[*a as usize];
        let way = along.cross(&normals[*t]).try_normalize(0.0).unwrap_or_default();
        *out.entry(*a).or_default() += way;
        *out.entry(*b).or_default() += way;
    }
    for _ in 0..ROUNDS {
        let mut sum = out.clone();
        for ([a, b], _) in rim {
            *sum.entry(*a).or_default() += out[b];
            *sum.entry(*b).or_default() += out[a];
        }
        sum.values_mut().for_each(|v| *v = v.try_normalize(0.0).unwrap_or_default());
        out = sum;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;
    use crate::topology::Topology;

    #[test]
    fn a_square_grows_on_every_side_and_stays_oriented() {
        let n = 5;
        let at = |i: usize, j: usize| (i * n + j) as u32;
        let vertices = (0..n * n).map(|k| Point::new((k / n) as f64, (k % n) as f64, 0.0)).collect();
        let quads = (0..n - 1).flat_map(|i| (0..n - 1).map(move |j| (i, j)));
        let triangles = quads
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        let square = TriMesh { vertices, triangles };
        let grown = skirted(&square, 2.0);
        let topology = Topology::of(&grown);
        assert_eq!((topology.irregular_edges, topology.components), (0, 1));
        let (low, high) = grown.bounds().unwrap();
        assert!(low.x < -1.2 && low.y < -1.2 && high.x > 5.2 && high.y > 5.2, "{low} {high}");
        assert!(grown.triangle_normals().iter().all(|v| v.z > 0.99));
    }
}

//! Cuts by a plane, and flat faces.

use crate::surface::TriMesh;
use crate::{Point, Vector};
use std::collections::BTreeMap;

/// The part of `mesh` on the side of the plane that `normal` points to, left open where it is cut.
///
/// Vertices that lie on the plane to rounding count as on that side, so no triangle is degenerate by more than rounding.
pub fn clipped(mesh: &TriMesh, origin: &Point, normal: &Vector) -> TriMesh {
    let height: Vec<f64> = mesh
        .vertices
        .iter()
        .map(|p| {
            let d = (p - origin).dot(normal);
            if d.abs() < 1e-7 { 1e-7 } else { d }
        })
        .collect();
    let mut vertices = mesh.vertices.clone();
    let mut cut: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut crossing = |a: u32, b: u32| {
        *cut.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let (a, b) = (a.min(b) as usize, a.max(b) as usize);
            let s = height[a] / (height[a] - height[b]);
            vertices.push(mesh.vertices[a] + (mesh.vertices[b] - mesh.vertices[a]) * s);
            (vertices.len() - 1) as u32
        })
    };
    let mut triangles = Vec::new();
    for &t in &mesh.triangles {
        let above = t.map(|v| height[v as usize] > 0.0);
        match above.iter().filter(|x| **x).count() {
            3 => triangles.push(t),
            0 => {}
            count => {
                // turn the triangle until its odd corner comes first
                let odd = (0..3).find(|&k| above[k] == (count == 1)).unwrap_or(0);
                let [a, b, c] = [t[odd], t[(odd + 1) % 3], t[(odd + 2) % 3]];
                let (ab, ca) = (crossing(a, b), crossing(c, a));
                if count == 1 {
                    triangles.push([a, ab, ca]);
                } else {
                    triangles.extend([[ab, b, c], [ab, c, ca]]);
                }
            }
        }
    }
    TriMesh { vertices, triangles }.submesh(|_| true).0
}

/// Labels the flat, sharply bounded faces of `mesh` (sawn ends): 0 elsewhere, then 1, 2, ... a face.
///
/// A face grows from a triangle over neighbours whose normal lies within 20 degrees of its own and whose corners lie within
/// `tolerance` [mm] of its plane; it counts when its area is at least `min_area` [mm2] and the surface turns by more than
/// 45 degrees over most of its border.
pub fn flat_faces(mesh: &TriMesh, tolerance: f64, min_area: f64) -> Vec<u32> {
    let normals = mesh.triangle_normals();
    let neighbours = triangle_neighbours(mesh);
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t).norm() / 2.0).collect();
    let mut order: Vec<usize> = (0..mesh.triangles.len()).collect();
    order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]).then(a.cmp(&b)));
    let mut tried = vec![false; mesh.triangles.len()];
    let mut label = vec![0; mesh.triangles.len()];
    let mut count = 0;
    let mut seen = Seen { stamp: vec![0; mesh.triangles.len()], now: 0 };
    for seed in order {
        if tried[seed] || areas[seed] <= 0.0 {
            continue;
        }
        let mut plane = (mesh.corners(seed)[0], normals[seed]);
        let mut face = vec![seed];
        // grow, fit, grow again: the seed's own plane is as noisy as the seed
        for _ in 0..3 {
            face = grown((mesh, &neighbours, &normals), seed, plane, tolerance, &mut seen);
            let (mut n, mut c, mut a) = (Vector::zeros(), Vector::zeros(), 0.0);
            for &t in &face {
                n += normals[t] * areas[t];
                c += mesh.corners(t).iter().map(|p| p.coords).sum::<Vector>() / 3.0 * areas[t];
                a += areas[t];
            }
            let Some(n) = n.try_normalize(0.0) else { break };
            plane = (Point::from(c / a), n);
            if a < min_area / 4.0 {
                break;
            }
        }
        face.iter().for_each(|&t| tried[t] = true);
        let area: f64 = face.iter().map(|&t| areas[t]).sum();
        if area >= min_area && label[seed] == 0 && is_sharply_bounded(mesh, &neighbours, &normals, &face, &plane.1) {
            count += 1;
            face.iter().for_each(|&t| label[t] = count);
        }
    }
    label
}

fn triangle_neighbours(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut edges: Vec<(u32, u32, u32)> = mesh
        .triangles
        .iter()
        .enumerate()
        .flat_map(|(t, &[a, b, c])| [(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q), t as u32)))
        .collect();
    edges.sort_unstable();
    let mut neighbours = vec![Vec::new(); mesh.triangles.len()];
    for pair in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let [(_, _, t), (_, _, u)] = *pair {
            neighbours[t as usize].push(u);
            neighbours[u as usize].push(t);
        }
    }
    neighbours
}

/// Which triangles a face has met, told apart from earlier faces by a number, so that nothing is cleared between them.
struct Seen {
    stamp: Vec<u32>,
    now: u32,
}

fn grown(
    (mesh, neighbours, normals): (&TriMesh, &[Vec<u32>], &[Vector]),
    seed: usize,
    (origin, normal): (Point, Vector),
    tolerance: f64,
    seen: &mut Seen,
) -> Vec<usize> {
    let least = 20f64.to_radians().cos();
    let flat = |t: usize| {
        normals[t].dot(&normal) > least && mesh.corners(t).iter().all(|p| (p - origin).dot(&normal).abs() < tolerance)
    };
    seen.now += 1;
    seen.stamp[seed] = seen.now;
    let mut face = vec![seed];
    let mut done = 0;
    while let Some(&t) = face.get(done) {
        done += 1;
        for &u in &neighbours[t] {
            let u = u as usize;
            if seen.stamp[u] != seen.now && flat(u) {
                seen.stamp[u] = seen.now;
                face.push(u);
            }
        }
    }
    face
}

/// Whether over most of the border of `face` the surface just beyond (two triangles on) turns away from its plane.
fn is_sharply_bounded(
    mesh: &TriMesh,
    neighbours: &[Vec<u32>],
    normals: &[Vector],
    face: &[usize],
    normal: &Vector,
) -> bool {
    let own: std::collections::BTreeSet<usize> = face.iter().copied().collect();
    let (mut sharp, mut border) = (0.0, 0.0);
    for &t in face {
        for &u in neighbours[t].iter().filter(|&&u| !own.contains(&(u as usize))) {
            let beyond = neighbours[u as usize].iter().filter(|&&w| !own.contains(&(w as usize)));
            let steepest =
                beyond.map(|&w| normals[w as usize].dot(normal)).fold(normals[u as usize].dot(normal), f64::min);
            let weight = mesh.area_vector(t).norm().sqrt();
            border += weight;
            if steepest < 45f64.to_radians().cos() {
                sharp += weight;
            }
        }
    }
    border > 0.0 && sharp > 0.7 * border
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::holes::fill_holes;
    use crate::shapes::{cuboid, icosphere, subdivided};
    use crate::topology::Topology;

    #[test]
    fn half_a_sphere_has_half_its_volume_and_one_flat_face() {
        let sphere = icosphere(10.0, 4);
        let normal = Vector::new(1.0, 2.0, 2.0) / 3.0;
        let mut half = clipped(&sphere, &Point::origin(), &normal);
        assert_eq!(fill_holes(&mut half, f64::INFINITY).len(), 1);
        assert!(Topology::of(&half).is_closed());
        assert!((half.volume() / sphere.volume() - 0.5).abs() < 1e-3);
        let label = flat_faces(&half, 0.1, 100.0);
        assert_eq!(label.iter().max(), Some(&1));
        let area: f64 = (0..label.len()).filter(|&t| label[t] == 1).map(|t| half.area_vector(t).norm() / 2.0).sum();
        assert!((area / (100.0 * std::f64::consts::PI) - 1.0).abs() < 0.02, "{area}");
        assert!(flat_faces(&sphere, 0.1, 100.0).iter().all(|&l| l == 0));
    }

    #[test]
    fn a_cut_through_vertices_and_one_that_misses() {
        let cube = subdivided(&cuboid([2.0, 2.0, 2.0]));
        let mut half = clipped(&cube, &Point::new(0.0, 0.0, 1.0), &Vector::z());
        half = crate::repair::solidify(&half, 0.0).mesh;
        assert!((half.volume() - 4.0).abs() < 1e-5);
        assert_eq!(clipped(&cube, &Point::new(0.0, 0.0, -1.0), &Vector::z()).triangles.len(), cube.triangles.len());
        assert_eq!(clipped(&cube, &Point::new(0.0, 0.0, 3.0), &Vector::z()).triangles.len(), 0);
    }
}

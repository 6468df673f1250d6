//! Boundary loops of an open surface, and their filling.

use crate::surface::TriMesh;
use crate::{Point, Vector};
use std::collections::{BTreeMap, BTreeSet};

/// A hole that was filled.
#[derive(Clone, Debug, PartialEq)]
pub struct FilledHole {
    /// Length of its edge [mm].
    pub perimeter_mm: f64,
    /// Centre of its edge [mm].
    pub centre: Point,
    /// The first of the triangles that fill it.
    pub first_triangle: usize,
    /// Number of triangles that fill it.
    pub triangles: usize,
}

/// The boundary loops of `mesh`: vertex indices in the order of the surface's own half-edges, longest loop (in vertices) first.
/// Each vertex must lie in one fan of triangles ([`crate::repair::clean`] sees to it).
pub fn boundary_loops(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut directed: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    directed.sort_unstable();
    let mut following: BTreeMap<u32, u32> =
        directed.iter().filter(|&&(a, b)| directed.binary_search(&(b, a)).is_err()).copied().collect();
    let mut loops = Vec::new();
    while let Some((&first, _)) = following.iter().next() {
        let mut line = vec![first];
        let mut at = first;
        while let Some(to) = following.remove(&at) {
            if to == first {
                break;
            }
            line.push(to);
            at = to;
        }
        if line.len() > 2 {
            loops.push(line);
        }
    }
    loops.sort_by_key(|l| (std::cmp::Reverse(l.len()), l[0]));
    loops
}

/// Length of a closed line of vertices [mm].
pub fn perimeter(mesh: &TriMesh, line: &[u32]) -> f64 {
    (0..line.len())
        .map(|i| (mesh.vertices[line[i] as usize] - mesh.vertices[line[(i + 1) % line.len()] as usize]).norm())
        .sum()
}

/// Fills every boundary loop no longer than `longest_mm` around; the new triangles follow the old ones.
///
/// Method: ears are cut off the loop in its best plane (Newell); where the loop is not simple there, or an ear would double an
/// edge of the surface, a fan about the loop's centre closes it.
pub fn fill_holes(mesh: &mut TriMesh, longest_mm: f64) -> Vec<FilledHole> {
    let loops = boundary_loops(mesh);
    let mut edges: BTreeSet<(u32, u32)> = BTreeSet::new();
    if !loops.is_empty() {
        for &[a, b, c] in &mesh.triangles {
            edges.extend([(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q))));
        }
    }
    let mut filled = Vec::new();
    for line in loops {
        let perimeter_mm = perimeter(mesh, &line);
        if perimeter_mm > longest_mm {
            continue;
        }
        let first_triangle = mesh.triangles.len();
        let centre =
            Point::from(line.iter().map(|&v| mesh.vertices[v as usize].coords).sum::<Vector>() / line.len() as f64);
        let patch = cut_ears(mesh, &line, &edges).unwrap_or_else(|| {
            let middle = mesh.vertices.len() as u32;
            mesh.vertices.push(centre);
            (0..line.len()).map(|i| [line[(i + 1) % line.len()], line[i], middle]).collect()
        });
        for &[a, b, c] in &patch {
            edges.extend([(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q))));
        }
        mesh.triangles.extend_from_slice(&patch);
        filled.push(FilledHole { perimeter_mm, centre, first_triangle, triangles: patch.len() });
    }
    filled
}

/// Triangles that close `line`, turned against it; `None` when ears run out.
fn cut_ears(mesh: &TriMesh, line: &[u32], edges: &BTreeSet<(u32, u32)>) -> Option<Vec<[u32; 3]>> {
    // the patch runs against the surface's own half-edges
    let mut ring: Vec<u32> = line.iter().rev().copied().collect();
    let at = |v: u32| mesh.vertices[v as usize].coords;
    let origin = at(ring[0]);
    let newell: Vector =
        (0..ring.len()).map(|i| (at(ring[i]) - origin).cross(&(at(ring[(i + 1) % ring.len()]) - origin))).sum();
    let normal = newell.try_normalize(0.0)?;
    let first = (at(ring[1]) - origin).cross(&normal).try_normalize(0.0)?;
    let second = normal.cross(&first);
    let flat: BTreeMap<u32, [f64; 2]> = ring
        .iter()
        .map(|&v| {
            let d = at(v) - origin;
            (v, [first.dot(&d), second.dot(&d)])
        })
        .collect();
    let mut patch = Vec::new();
    let mut here = 0;
    let mut misses = 0;
    while ring.len() > 3 {
        let n = ring.len();
        let [a, b, c] = [ring[(here + n - 1) % n], ring[here % n], ring[(here + 1) % n]];
        let [p, q, r] = [a, b, c].map(|v| flat[&v]);
        let doubles = edges.contains(&(a.min(c), a.max(c)));
        if !doubles
            && turn(p, q, r) > 0.0
            && !ring.iter().any(|&v| ![a, b, c].contains(&v) && inside(flat[&v], p, q, r))
        {
            patch.push([a, b, c]);
            ring.remove(here % n);
            // step on, so that ears are taken all round rather than as one fan
            here = (here + 1) % ring.len();
            misses = 0;
        } else {
            here = (here + 1) % n;
            misses += 1;
            if misses > n {
                return None;
            }
        }
    }
    patch.push([ring[0], ring[1], ring[2]]);
    Some(patch)
}

fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn inside(p: [f64; 2], a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> bool {
    turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;
    use crate::topology::Topology;

    #[test]
    fn holes_of_a_sphere_are_closed_and_counted() {
        let sphere = icosphere(10.0, 4);
        let (mut open, _) = sphere.submesh(|t| {
            let [a, b, c] = sphere.corners(t);
            let z = (a.z + b.z + c.z) / 3.0;
            z < 6.0 && z > -9.5
        });
        assert_eq!(boundary_loops(&open).len(), 2);
        let filled = fill_holes(&mut open, f64::INFINITY);
        assert_eq!(filled.len(), 2);
        assert!(Topology::of(&open).is_closed());
        assert_eq!(Topology::of(&open).euler_characteristic, 2);
        // sphere of radius 10 between the planes z = -9.5 and 6
        let cap = |h: f64| std::f64::consts::PI * h * h * (10.0 - h / 3.0);
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 1000.0 - cap(4.0) - cap(0.5);
        assert!((open.volume() / expected - 1.0).abs() < 0.02, "{} {expected}", open.volume());
    }

    #[test]
    fn a_saddle_shaped_hole_is_closed_too() {
        let sphere = icosphere(10.0, 4);
        let (mut open, _) = sphere.submesh(|t| {
            let [a, b, c] = sphere.corners(t);
            let p = (a.coords + b.coords + c.coords) / 3.0;
            p.z < 2.0 + 0.5 * (p.x * p.x - p.y * p.y).clamp(-6.0, 6.0)
        });
        open = crate::repair::clean(&open).mesh;
        fill_holes(&mut open, f64::INFINITY);
        assert!(Topology::of(&open).is_closed());
    }
}

//! Puts right what is plainly wrong in a surface read from a file: doubled vertices and triangles, triangles without area,
//! triangles turned the wrong way. Fills no hole and removes no piece.

use crate::query::SurfaceQuery;
use crate::surface::{ColouredMesh, TriMesh};
use crate::topology::Topology;
use std::collections::{BTreeMap, BTreeSet};

/// What [`tidy`] found and did.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Vertices joined to another of the same position, or used by no triangle.
    pub dropped_vertices: usize,
    /// Triangles without area, dropped.
    pub degenerate_triangles: usize,
    /// Triangles that were there already, dropped.
    pub doubled_triangles: usize,
    /// Triangles turned over.
    pub turned_triangles: usize,
    /// Closed inward-turned pieces inside the largest one, left as they are.
    pub cavities: usize,
}

/// The surface with vertices welded, triangles without area and doubled ones dropped, each piece turned consistently
/// where its edges allow it, and outward (by its volume about its centroid, so that a cut end does not matter).
///
/// Cost O(n log n).
pub fn tidy(scan: &ColouredMesh) -> (ColouredMesh, Repairs) {
    let welded = scan.welded();
    let mut repairs = Repairs::default();
    let mut seen = BTreeSet::new();
    let keep: Vec<bool> = (0..welded.mesh.triangles.len())
        .map(|t| {
            if welded.mesh.area_vector(t).norm() <= f64::EPSILON * scale(&welded.mesh, t) {
                repairs.degenerate_triangles += 1;
                return false;
            }
            let mut key = welded.mesh.triangles[t];
            key.sort_unstable();
            let new = seen.insert(key);
            repairs.doubled_triangles += usize::from(!new);
            new
        })
        .collect();
    let mut used = vec![false; welded.mesh.vertices.len()];
    welded
        .mesh
        .triangles
        .iter()
        .zip(&keep)
        .filter(|(_, k)| **k)
        .flat_map(|(t, _)| t)
        .for_each(|&v| used[v as usize] = true);
    // Where nothing goes, the vertices keep the file's order.
    let (mut mesh, old) = if keep.iter().chain(&used).all(|&k| k) {
        (welded.mesh.clone(), (0..used.len() as u32).collect())
    } else {
        welded.mesh.submesh(|t| keep[t])
    };
    repairs.dropped_vertices = scan.mesh.vertices.len() - mesh.vertices.len();
    let colours =
        if welded.colours.is_empty() { Vec::new() } else { old.iter().map(|&v| welded.colours[v as usize]).collect() };
    let before = mesh.triangles.clone();
    turn_alike(&mut mesh);
    repairs.cavities = turn_outward(&mut mesh);
    repairs.turned_triangles = before.iter().zip(&mesh.triangles).filter(|(a, b)| a != b).count();
    (ColouredMesh { mesh, colours }, repairs)
}

/// Square of the longest coordinate difference of triangle `t`.
fn scale(mesh: &TriMesh, t: usize) -> f64 {
    let [a, b, c] = mesh.corners(t);
    (b - a).amax().max((c - a).amax()).powi(2)
}

/// Turns triangles so that neighbours across an edge of two run it opposite ways; the first of a patch decides.
fn turn_alike(mesh: &mut TriMesh) {
    let mut edges: BTreeMap<(u32, u32), Vec<u32>> = BTreeMap::new();
    for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            edges.entry((p.min(q), p.max(q))).or_default().push(t as u32);
        }
    }
    let runs = |t: [u32; 3], p: u32, q: u32| (0..3).any(|k| t[k] == p && t[(k + 1) % 3] == q);
    let mut done = vec![false; mesh.triangles.len()];
    let mut patch = Vec::new();
    for start in 0..mesh.triangles.len() {
        if done[start] {
            continue;
        }
        done[start] = true;
        let mut turned = 0;
        patch.clear();
        patch.push(start);
        let mut next = 0;
        while let Some(&t) = patch.get(next) {
            next += 1;
            let [a, b, c] = mesh.triangles[t];
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let around = &edges[&(p.min(q), p.max(q))];
                let [x, y] = *around.as_slice() else { continue };
                let other = if x as usize == t { y } else { x } as usize;
                if done[other] {
                    continue;
                }
                done[other] = true;
                if runs(mesh.triangles[other], p, q) {
                    mesh.triangles[other].swap(1, 2);
                    turned += 1;
                }
                patch.push(other);
            }
        }
        // The patch follows its majority, not the triangle that happened to come first.
        if 2 * turned > patch.len() {
            patch.iter().for_each(|&t| mesh.triangles[t].swap(1, 2));
        }
    }
}

/// Turns each inward piece outward; gives the number of cavities left alone.
fn turn_outward(mesh: &mut TriMesh) -> usize {
    let topology = Topology::of(mesh);
    let mut largest = None;
    let mut cavities = 0;
    let mut triangles_of = vec![Vec::new(); topology.components];
    for (t, &c) in topology.component_of_triangle.iter().enumerate() {
        triangles_of[c as usize].push(t);
    }
    for (c, triangles) in triangles_of.iter().enumerate() {
        let (piece, _) = mesh.submesh(|t| topology.component_of_triangle[t] == c as u32);
        let Some(centre) = piece.centroid() else { continue };
        let volume: f64 = (0..piece.triangles.len())
            .map(|t| {
                let [p, q, r] = piece.corners(t).map(|x| x - centre);
                p.dot(&q.cross(&r)) / 6.0
            })
            .sum();
        let inside = c > 0
            && volume < 0.0
            && largest.as_ref().is_some_and(|q: &SurfaceQuery| q.signed_distance(&piece.vertices[0]) < 0.0);
        if inside {
            cavities += 1;
        } else if volume < 0.0 {
            triangles.iter().for_each(|&t| mesh.triangles[t].swap(1, 2));
        }
        if c == 0 {
            largest = SurfaceQuery::new(&if volume < 0.0 { piece.flipped() } else { piece });
        }
        // Hundreds of crumbs are not worth a look each.
        if c >= 64 {
            break;
        }
    }
    cavities
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cuboid, icosphere};

    fn plain(mesh: TriMesh) -> ColouredMesh {
        ColouredMesh { mesh, colours: Vec::new() }
    }

    #[test]
    fn a_sound_surface_stays_to_the_last_bit() {
        let sphere = plain(icosphere(10.0, 2));
        let (same, repairs) = tidy(&sphere);
        assert_eq!(repairs, Repairs::default());
        assert_eq!(same.mesh.triangles.len(), sphere.mesh.triangles.len());
        assert!((same.mesh.volume() - sphere.mesh.volume()).abs() < 1e-9);
    }

    #[test]
    fn inward_mixed_split_and_doubled_triangles_are_put_right() {
        let sphere = icosphere(10.0, 2);
        let mut soup = TriMesh::default();
        for t in 0..sphere.triangles.len() {
            let k = soup.vertices.len() as u32;
            soup.vertices.extend(sphere.corners(t));
            soup.triangles.push(if t % 3 == 0 { [k, k + 1, k + 2] } else { [k, k + 2, k + 1] });
        }
        soup.triangles.push([0, 1, 2]);
        soup.triangles.push([0, 1, 0]);
        let (mesh, repairs) = tidy(&plain(soup));
        assert!(Topology::of(&mesh.mesh).is_closed());
        assert!((mesh.mesh.volume() - sphere.volume()).abs() < 1e-9);
        assert_eq!((repairs.doubled_triangles, repairs.degenerate_triangles), (1, 1));
        assert_eq!(mesh.mesh.vertices.len(), sphere.vertices.len());
    }

    #[test]
    fn an_open_surface_is_turned_outward_and_a_cavity_left() {
        let (open, _) = icosphere(10.0, 3).submesh(|t| t % 320 > 20);
        let (mesh, _) = tidy(&plain(open.clone().flipped()));
        assert!(mesh.mesh.volume() > 0.0);
        let shell = TriMesh::joined([&icosphere(10.0, 3), &icosphere(5.0, 2).flipped()]);
        let (kept, repairs) = tidy(&plain(shell.clone()));
        assert_eq!(repairs, Repairs { cavities: 1, ..Repairs::default() });
        assert!(kept.mesh == shell);
        assert!(tidy(&plain(cuboid([1.0; 3]).flipped())).0.mesh.volume() > 0.0);
    }
}

//! Repair of a surface from the wild: what hangs together wrongly is taken out, holes are filled, bodies turned outward.

use crate::holes::{FilledHole, fill_holes};
use crate::query::SurfaceQuery;
use crate::surface::TriMesh;
use crate::topology::Topology;
use std::collections::BTreeMap;

/// A surface whose edges have at most two triangles, turned alike, and whose vertices one fan each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cleaned {
    /// The surface; it may be open.
    pub mesh: TriMesh,
    /// Triangles dropped: degenerate, doubled, or on an edge of more than two.
    pub dropped_triangles: usize,
    /// Triangles turned over to agree with their neighbours.
    pub turned_triangles: usize,
}

/// Drops degenerate and doubled triangles and those on edges of more than two triangles, turns the rest alike,
/// and gives each fan of triangles its own vertex.
pub fn clean(mesh: &TriMesh) -> Cleaned {
    let (welded, valid) = welded(mesh);
    let triangles = without_crowded_edges(valid);
    let mut result =
        Cleaned { mesh: TriMesh { vertices: welded, triangles }, dropped_triangles: 0, turned_triangles: 0 };
    result.dropped_triangles = mesh.triangles.len() - result.mesh.triangles.len();
    result.turned_triangles = turn_alike(&mut result.mesh.triangles);
    split_fans(&mut result.mesh);
    result.mesh = result.mesh.submesh(|_| true).0;
    result
}

/// Vertices at the same place to the last bit become one; triangles that are finite, in range and not degenerate, each once.
fn welded(mesh: &TriMesh) -> (Vec<crate::Point>, Vec<[u32; 3]>) {
    let mut place: BTreeMap<[u64; 3], u32> = BTreeMap::new();
    let index: Vec<u32> = mesh
        .vertices
        .iter()
        .enumerate()
        .map(|(i, p)| *place.entry([p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())).or_insert(i as u32))
        .collect();
    let finite = |v: u32| mesh.vertices.get(v as usize).is_some_and(|p| p.coords.iter().all(|x| x.is_finite()));
    let mut keyed: Vec<([u32; 3], usize, [u32; 3])> = mesh
        .triangles
        .iter()
        .enumerate()
        .filter(|(_, t)| t.iter().all(|&v| finite(v)))
        .map(|(i, t)| {
            let t = t.map(|v| index[v as usize]);
            let mut key = t;
            key.sort_unstable();
            (key, i, t)
        })
        .filter(|(key, ..)| key[0] != key[1] && key[1] != key[2])
        .collect();
    keyed.sort_unstable();
    let mut kept: Vec<(usize, [u32; 3])> = Vec::with_capacity(keyed.len());
    for same in keyed.chunk_by(|a, b| a.0 == b.0) {
        // two that face each other enclose nothing; two alike are one
        let turns =
            |t: &[u32; 3], key: &[u32; 3]| key.iter().position(|v| *v == t[0]).map(|k| key[(k + 1) % 3] == t[1]);
        let alike = same.iter().all(|s| turns(&s.2, &s.0) == turns(&same[0].2, &same[0].0));
        if alike {
            kept.push((same[0].1, same[0].2));
        }
    }
    kept.sort_unstable();
    (mesh.vertices.clone(), kept.into_iter().map(|(_, t)| t).collect())
}

fn edge_list(triangles: &[[u32; 3]]) -> Vec<(u32, u32, u32)> {
    let mut edges: Vec<(u32, u32, u32)> = triangles
        .iter()
        .enumerate()
        .flat_map(|(t, &[a, b, c])| [(a, b), (b, c), (c, a)].map(|(p, q)| (p.min(q), p.max(q), t as u32)))
        .collect();
    edges.sort_unstable();
    edges
}

fn without_crowded_edges(triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let mut crowded = vec![false; triangles.len()];
    for edge in edge_list(&triangles).chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if edge.len() > 2 {
            edge.iter().for_each(|e| crowded[e.2 as usize] = true);
        }
    }
    triangles.into_iter().zip(crowded).filter(|(_, c)| !c).map(|(t, _)| t).collect()
}

/// Turns triangles over until neighbours agree, body by body, following the majority of each body; the number turned.
fn turn_alike(triangles: &mut [[u32; 3]]) -> usize {
    let mut neighbours = vec![Vec::new(); triangles.len()];
    for edge in edge_list(triangles).chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let [(a, b, t), (_, _, u)] = *edge {
            let runs =
                |t: u32| (0..3).any(|k| triangles[t as usize][k] == a && triangles[t as usize][(k + 1) % 3] == b);
            let agree = runs(t) != runs(u);
            neighbours[t as usize].push((u, agree));
            neighbours[u as usize].push((t, agree));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut total = 0;
    for seed in 0..triangles.len() {
        if turned[seed].is_some() {
            continue;
        }
        turned[seed] = Some(false);
        let mut body = vec![seed as u32];
        let mut done = 0;
        while let Some(&t) = body.get(done) {
            done += 1;
            let own = turned[t as usize] == Some(true);
            for &(u, agree) in &neighbours[t as usize] {
                if turned[u as usize].is_none() {
                    turned[u as usize] = Some(own == agree);
                    body.push(u);
                }
            }
        }
        let minority = body.iter().filter(|&&t| turned[t as usize] == Some(true)).count() * 2 > body.len();
        for &t in &body {
            if (turned[t as usize] == Some(true)) != minority {
                triangles[t as usize].swap(1, 2);
                total += 1;
            }
        }
    }
    total
}

/// Gives each fan of triangles about a vertex its own copy of the vertex. Edges whose two triangles still run alike are parted.
fn split_fans(mesh: &mut TriMesh) {
    let mut corners: Vec<Vec<(u32, u32)>> = vec![Vec::new(); mesh.vertices.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            corners[triangle[k] as usize].push((t as u32, k as u32));
        }
    }
    for (v, list) in corners.iter().enumerate() {
        // fans: triangles about v joined where one enters by the vertex the other leaves by
        let ends: Vec<(u32, u32)> = list
            .iter()
            .map(|&(t, k)| {
                let tri = mesh.triangles[t as usize];
                (tri[(k as usize + 1) % 3], tri[(k as usize + 2) % 3])
            })
            .collect();
        let mut fan = vec![usize::MAX; list.len()];
        let mut fans = 0;
        for seed in 0..list.len() {
            if fan[seed] != usize::MAX {
                continue;
            }
            fan[seed] = fans;
            let mut todo = vec![seed];
            while let Some(i) = todo.pop() {
                for j in 0..list.len() {
                    if fan[j] == usize::MAX && (ends[i].1 == ends[j].0 || ends[i].0 == ends[j].1) {
                        fan[j] = fans;
                        todo.push(j);
                    }
                }
            }
            fans += 1;
        }
        for extra in 1..fans {
            let copy = mesh.vertices.len() as u32;
            mesh.vertices.push(mesh.vertices[v]);
            for (&(t, k), _) in list.iter().zip(&fan).filter(|(_, f)| **f == extra) {
                mesh.triangles[t as usize][k as usize] = copy;
            }
        }
    }
}

/// A surface made solid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solidified {
    /// Closed bodies side by side, outward normals.
    pub mesh: TriMesh,
    /// What [`clean`] dropped.
    pub dropped_triangles: usize,
    /// What [`clean`] turned.
    pub turned_triangles: usize,
    /// Holes filled.
    pub holes: Vec<FilledHole>,
    /// Bodies dropped as specks.
    pub specks: usize,
    /// Bodies dropped because they lie within another.
    pub inner_shells: usize,
}

/// Makes `mesh` solid: cleaned, holes filled, bodies of less than the share `speck` of the largest one's volume dropped, and
/// shells inside another body (a marrow canal, a scanner's double wall) too; all turned outward.
pub fn solidify(mesh: &TriMesh, speck: f64) -> Solidified {
    let cleaned = clean(mesh);
    let mut whole = cleaned.mesh;
    let holes = fill_holes(&mut whole, f64::INFINITY);
    let topology = Topology::of(&whole);
    let bodies: Vec<TriMesh> = (0..topology.components as u32)
        .map(|c| whole.submesh(|t| topology.component_of_triangle[t] == c).0)
        .map(|b| if b.volume() < 0.0 { b.flipped() } else { b })
        .collect();
    let largest = bodies.iter().map(TriMesh::volume).fold(0.0, f64::max);
    let count = bodies.len();
    let big: Vec<TriMesh> = bodies.into_iter().filter(|b| b.volume() > 0.0 && b.volume() >= speck * largest).collect();
    let specks = count - big.len();
    let outer: Vec<&TriMesh> = big
        .iter()
        .enumerate()
        .filter(|(i, b)| !big.iter().enumerate().any(|(j, o)| j != *i && o.volume() > b.volume() && lies_within(b, o)))
        .map(|(_, b)| b)
        .collect();
    Solidified {
        inner_shells: big.len() - outer.len(),
        mesh: TriMesh::joined(outer),
        dropped_triangles: cleaned.dropped_triangles,
        turned_triangles: cleaned.turned_triangles,
        holes,
        specks,
    }
}

/// Whether closed `body` lies inside closed `other`: most of a few of its vertices do.
fn lies_within(body: &TriMesh, other: &TriMesh) -> bool {
    let (Some((lo, hi)), Some((low, high))) = (body.bounds(), other.bounds()) else { return false };
    if (0..3).any(|k| lo[k] < low[k] || hi[k] > high[k]) {
        return false;
    }
    let Some(query) = SurfaceQuery::new(other) else { return false };
    let step = (body.vertices.len() / 25).max(1);
    let probes: Vec<_> = body.vertices.iter().step_by(step).collect();
    let within = probes.iter().filter(|p| query.signed_distance(p) < 0.0).count();
    2 * within > probes.len()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cuboid, icosphere};
    use crate::{Isometry, Vector};

    #[test]
    fn turned_triangles_doubles_and_holes_are_mended() {
        let sphere = icosphere(10.0, 3);
        let mut broken = sphere.clone();
        for t in (0..broken.triangles.len()).step_by(7) {
            broken.triangles[t].swap(0, 1);
        }
        broken.triangles.push(sphere.triangles[5]);
        broken.triangles.push([3, 3, 4]);
        broken.triangles.swap_remove(100);
        let solid = solidify(&broken, 0.01);
        assert!(Topology::of(&solid.mesh).is_closed());
        assert!((solid.mesh.volume() / sphere.volume() - 1.0).abs() < 1e-3);
        assert_eq!(solid.holes.len(), 1);
        assert!(solid.turned_triangles > 100);
    }

    #[test]
    fn bodies_that_touch_in_an_edge_or_a_vertex_are_parted() {
        let cube = cuboid([1.0, 1.0, 1.0]);
        let by_edge = cube.moved(&Isometry::translation(1.0, 1.0, 0.0));
        let by_corner = cube.moved(&Isometry::translation(-1.0, -1.0, -1.0));
        let solid = solidify(&TriMesh::joined([&cube, &by_edge, &by_corner]), 0.01);
        let topology = Topology::of(&solid.mesh);
        assert!(topology.is_closed());
        assert_eq!(topology.components, 3);
        assert!(solid.mesh.volume() > 1.4);
    }

    #[test]
    fn specks_and_inner_shells_go_and_inside_out_bodies_turn() {
        let big = icosphere(10.0, 3);
        let canal = icosphere(4.0, 2).flipped();
        let speck = icosphere(0.3, 1).moved(&Isometry::new(Vector::new(30.0, 0.0, 0.0), Vector::zeros()));
        let second = icosphere(5.0, 3).moved(&Isometry::new(Vector::new(0.0, 30.0, 0.0), Vector::zeros())).flipped();
        let solid = solidify(&TriMesh::joined([&big, &canal, &speck, &second]), 0.01);
        assert_eq!((solid.specks, solid.inner_shells), (1, 1));
        assert!((solid.mesh.volume() - big.volume() - second.volume().abs()).abs() < 1e-9);
    }
}

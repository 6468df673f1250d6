//! Cartilage solids and the articular faces of contact.

use super::model::DeckModel;
use crate::DeckError;
use meshes::hex::HexMesh;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};
use sim::mesh::{MeshValue, TetMesh};
use std::collections::BTreeMap;

/// Faces of Abaqus' elements, S1 first, outward normals.
const HEX_FACES: [[usize; 4]; 6] = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
const TET_FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
/// An outer face of tetrahedra is articular where its normal and the bone's make a cosine above this [-].
const FACING: f64 = 0.3;
/// A contact face made of a solid's faces is subdivided until nine edges in ten are no longer than this [mm].
const LONGEST_EDGE: f64 = 1.0;
/// The same where the faces are split quadrilaterals, whose diagonals count [mm].
const LONGEST_QUAD_EDGE: f64 = 1.75;
/// Subdivision stops here [triangles].
const MOST_TRIANGLES: usize = 200_000;

/// Elements with compact node numbers.
struct Compact {
    nodes: Vec<Point>,
    /// Type and node numbers of each element.
    elements: Vec<(String, Vec<u32>)>,
}

fn compact(model: &DeckModel, elset: &str) -> Result<Compact, DeckError> {
    let places = model.elsets.get(elset).filter(|e| !e.is_empty());
    let places = places.ok_or_else(|| DeckError::whole(format!("element set {elset} is empty or not defined")))?;
    let labels: std::collections::BTreeSet<u64> =
        places.iter().flat_map(|&e| model.elements[e].nodes.iter().copied()).collect();
    let mut index = BTreeMap::new();
    let mut nodes = Vec::new();
    for label in labels {
        index.insert(label, nodes.len() as u32);
        nodes.push(super::bodies::position(model, label)?);
    }
    let elements = places
        .iter()
        .map(|&e| (model.elements[e].kind.clone(), model.elements[e].nodes.iter().map(|n| index[n]).collect()))
        .collect();
    Ok(Compact { nodes, elements })
}

/// A rigid surface: the triangles (and split quadrilaterals) of an element set.
pub(super) fn rigid_surface(model: &DeckModel, elset: &str) -> Result<TriMesh, DeckError> {
    let part = compact(model, elset)?;
    let mut mesh = TriMesh { vertices: part.nodes, triangles: Vec::new() };
    for (kind, n) in &part.elements {
        match n[..] {
            [a, b, c] => mesh.triangles.push([a, b, c]),
            [a, b, c, d] if kind.contains("3D4") && !kind.starts_with('C') || kind.starts_with("S4") => {
                mesh.triangles.extend([[a, b, c], [a, c, d]]);
            }
            _ => return Err(DeckError::whole(format!("element set {elset}: {kind} is no surface element"))),
        }
    }
    Ok(mesh)
}

/// A cartilage solid as a value, with its outer faces.
pub(super) struct Solid {
    pub(super) mesh: MeshValue,
    /// Outer faces, outward: face number from 1, corners; of a swept mesh the articular ones only.
    faces: Vec<(usize, Vec<u32>)>,
    nodes: Vec<Point>,
}

/// Reads the solid of an element set; `bone` tells articular from bony faces.
pub(super) fn solid(model: &DeckModel, elset: &str, bone: &SurfaceQuery) -> Result<Solid, DeckError> {
    let part = compact(model, elset)?;
    let mut faces = outer_faces(elset, &part)?;
    let all = |kind: &str, n: usize| part.elements.iter().all(|(k, e)| k.starts_with(kind) && e.len() == n);
    let mesh = if all("C3D8", 8) {
        let elements = part.elements.iter().filter_map(|(_, e)| <[u32; 8]>::try_from(e.as_slice()).ok()).collect();
        MeshValue::Hex(swept(HexMesh { nodes: part.nodes.clone(), elements, ..HexMesh::default() }, &mut faces, bone))
    } else if all("C3D4", 4) {
        let elements = part.elements.iter().filter_map(|(_, e)| <[u32; 4]>::try_from(e.as_slice()).ok()).collect();
        MeshValue::Tet(TetMesh { nodes: part.nodes.clone(), elements })
    } else {
        return Err(DeckError::whole(format!("element set {elset}: expected C3D8 or C3D4 elements throughout")));
    };
    Ok(Solid { mesh, faces, nodes: part.nodes })
}

/// Faces that belong to one element only, outward normals.
fn outer_faces(elset: &str, part: &Compact) -> Result<Vec<(usize, Vec<u32>)>, DeckError> {
    let mut seen: BTreeMap<Vec<u32>, (usize, usize, Vec<u32>)> = BTreeMap::new();
    let mut order = 0;
    for (kind, nodes) in &part.elements {
        let faces: Vec<Vec<usize>> = match nodes.len() {
            8 => HEX_FACES.iter().map(|f| f.to_vec()).collect(),
            4 if kind.starts_with("C3D4") => TET_FACES.iter().map(|f| f.to_vec()).collect(),
            _ => return Err(DeckError::whole(format!("element set {elset}: {kind} is no solid that is understood"))),
        };
        let centre = mean(nodes.iter().map(|&n| part.nodes[n as usize]));
        for (k, face) in faces.iter().enumerate() {
            let mut corners: Vec<u32> = face.iter().map(|&i| nodes[i]).collect();
            if normal(&part.nodes, &corners).dot(&(mean(corners.iter().map(|&n| part.nodes[n as usize])) - centre))
                < 0.0
            {
                corners.reverse();
            }
            let mut key = corners.clone();
            key.sort_unstable();
            order += 1;
            if seen.remove(&key).is_none() {
                seen.insert(key, (order, k + 1, corners));
            }
        }
    }
    let mut outer: Vec<(usize, usize, Vec<u32>)> = seen.into_values().collect();
    outer.sort_by_key(|(order, ..)| *order);
    Ok(outer.into_iter().map(|(_, k, corners)| (k, corners)).collect())
}

fn mean(points: impl Iterator<Item = Point>) -> Point {
    let (sum, n) = points.fold((Vector::zeros(), 0.0), |(s, n), p| (s + p.coords, n + 1.0));
    Point::from(sum / f64::max(n, 1.0))
}

/// Normal of a triangle or quadrilateral, not unit.
fn normal(nodes: &[Point], c: &[u32]) -> Vector {
    let p = |i: usize| nodes[c[i] as usize];
    if c.len() == 3 { (p(1) - p(0)).cross(&(p(2) - p(0))) } else { (p(2) - p(0)).cross(&(p(3) - p(1))) }
}

/// Cosine between a face's normal and the nearest bone's.
fn facing(nodes: &[Point], corners: &[u32], bone: &SurfaceQuery) -> f64 {
    let centre = mean(corners.iter().map(|&n| nodes[n as usize]));
    let near = bone.nearest(&centre);
    normal(nodes, corners).try_normalize(0.0).map_or(0.0, |n| n.dot(&bone.smooth_normal(&near)))
}

/// Names the articular and bony faces of a swept hexahedral mesh and turns its elements to begin at the bone.
/// The faces at the two ends of the columns have one label each; which is articular is told by the bone.
fn swept(mut mesh: HexMesh, faces: &mut Vec<(usize, Vec<u32>)>, bone: &SurfaceQuery) -> HexMesh {
    let vote = |label: usize| -> f64 {
        faces.iter().filter(|(k, _)| *k == label).map(|(_, c)| facing(&mesh.nodes, c, bone).signum()).sum()
    };
    let (top, bottom) = if vote(1) > vote(2) { (1, 2) } else { (2, 1) };
    for (k, corners) in faces.iter() {
        let Ok(quad) = <[u32; 4]>::try_from(corners.as_slice()) else { continue };
        if *k == top {
            mesh.articular_quads.push(quad);
            mesh.articular_nodes.extend(quad);
        } else if *k == bottom {
            mesh.bony_quads.push(quad);
            mesh.bony_nodes.extend(quad);
        }
    }
    faces.retain(|(k, _)| *k == top);
    if top == 1 {
        for e in &mut mesh.elements {
            let [a, b, c, d, f, g, h, i] = *e;
            *e = [f, i, h, g, a, d, c, b];
        }
    }
    for list in [&mut mesh.articular_nodes, &mut mesh.bony_nodes] {
        list.sort_unstable();
        list.dedup();
    }
    mesh
}

impl Solid {
    /// The articular face for contact: outer faces turned away from the bone, their largest patch, finely enough divided.
    pub(super) fn articular(&self, bone: &SurfaceQuery) -> TriMesh {
        let swept = matches!(self.mesh, MeshValue::Hex(_));
        let mut mesh = TriMesh { vertices: self.nodes.clone(), triangles: Vec::new() };
        for (_, c) in self.faces.iter().filter(|(_, c)| swept || facing(&self.nodes, c, bone) > FACING) {
            mesh.triangles.push([c[0], c[1], c[2]]);
            if c.len() == 4 {
                mesh.triangles.push([c[0], c[2], c[3]]);
            }
        }
        let topology = Topology::of(&mesh);
        let (mut patch, _) = mesh.submesh(|t| topology.component_of_triangle[t] == 0);
        let longest = if swept { LONGEST_QUAD_EDGE } else { LONGEST_EDGE };
        while long_edge(&patch) > longest && patch.triangles.len() * 4 <= MOST_TRIANGLES {
            patch = subdivided(&patch);
        }
        patch
    }
}

/// The length nine edges in ten stay below [mm].
fn long_edge(mesh: &TriMesh) -> f64 {
    let mut lengths: Vec<f64> = (0..mesh.triangles.len())
        .flat_map(|t| {
            let [a, b, c] = mesh.corners(t);
            [(a - b).norm(), (b - c).norm(), (c - a).norm()]
        })
        .collect();
    lengths.sort_by(f64::total_cmp);
    lengths.get(lengths.len() * 9 / 10).copied().unwrap_or(0.0)
}

/// Every triangle split into four at the middles of its edges; the surface stays as flat as it was.
fn subdivided(mesh: &TriMesh) -> TriMesh {
    let mut fine = TriMesh { vertices: mesh.vertices.clone(), triangles: Vec::with_capacity(4 * mesh.triangles.len()) };
    let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for &[a, b, c] in &mesh.triangles {
        let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                fine.vertices.push(nalgebra::center(&mesh.vertices[p as usize], &mesh.vertices[q as usize]));
                (fine.vertices.len() - 1) as u32
            })
        });
        fine.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    fine
}

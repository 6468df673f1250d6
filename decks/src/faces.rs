//! Faces in contact, and the solids that stand for bones.

use meshes::Vector;
use meshes::surface::TriMesh;
use sim::mesh::MeshValue;
use sim::spec::{ContactSpec, FramesSpec};
use std::collections::{BTreeMap, BTreeSet};

/// Laws that differ by less than this share are one.
const SAME: f64 = 1e-9;
/// How thick a contact surface is made where it stands for a bone [mm]. Ours: only pictures and wrapping look at bones.
pub(crate) const SOLID_MM: f64 = 5.0;

pub(crate) fn same(a: &ContactSpec, b: &ContactSpec) -> bool {
    let close = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME * (1.0 + b.abs()))
    };
    close(&a.overclosure_mm, &b.overclosure_mm) && close(&a.pressure_mpa, &b.pressure_mpa)
}

pub(crate) fn free_path(bone: &str, taken: &BTreeMap<String, MeshValue>) -> String {
    let name = |n: usize| match n {
        0 => format!("meshes/articular_{bone}.ply"),
        n => format!("meshes/articular_{bone}_{}.ply", n + 1),
    };
    (0..).map(name).find(|n| !taken.contains_key(n)).unwrap_or_default()
}

/// The side of a closed cartilage towards the joint: of the tibia what looks up, of the femur what looks away from its axis.
pub(crate) fn facing(surface: &TriMesh, femoral: bool, frames: &FramesSpec) -> TriMesh {
    let (origin, across) = (frames.femur.origin, frames.femur.medial);
    let keep = |t: usize| {
        let [a, b, c] = surface.corners(t);
        let from = (a.coords + b.coords + c.coords) / 3.0 - origin.coords;
        let way = if femoral { from - across * from.dot(&across) } else { frames.tibia.superior };
        surface.area_vector(t).dot(&way) > 0.0
    };
    surface.submesh(keep).0
}

pub(crate) fn behind(surface: &TriMesh, depth: f64) -> TriMesh {
    let normals = surface.vertex_normals();
    let vertices = surface.vertices.iter().zip(&normals).map(|(p, n)| p - n * depth).collect();
    TriMesh { vertices, triangles: surface.triangles.clone() }
}

pub(crate) fn extent(mesh: &TriMesh) -> f64 {
    mesh.bounds().map_or(0.0, |(low, high)| (high - low).norm())
}

/// An open face made a closed solid: the face, the same `depth` mm behind it turned over, and walls along the border.
pub fn thickened(face: &TriMesh, depth: f64) -> TriMesh {
    let normals = face.vertex_normals();
    let n = face.vertices.len() as u32;
    let mut vertices = face.vertices.clone();
    vertices.extend(face.vertices.iter().zip(&normals).map(|(p, normal): (_, &Vector)| p - normal * depth));
    let mut triangles = face.triangles.clone();
    triangles.extend(face.triangles.iter().map(|&[a, b, c]| [a + n, c + n, b + n]));
    let directed: BTreeSet<(u32, u32)> =
        face.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
    for &(a, b) in directed.iter().filter(|(a, b)| !directed.contains(&(*b, *a))) {
        triangles.extend([[b, a, a + n], [b, a + n, b + n]]);
    }
    TriMesh { vertices, triangles }
}

//! Cartilage as the paper has it: the closed scan minus the bone, cleaned.

use super::solid::finished;
use super::{CartilageOptions, CartilageSolid, Covered, Made};
use crate::StageError;
use meshes::boolean::difference;
use meshes::repair::solidify;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Point, Vector};

/// Bodies below this share of the largest volume are films and specks [-]; the smaller plateau has half of the larger's.
const SPECK_SHARE: f64 = 0.1;

/// The cartilages of a bone by Boolean difference.
///
/// The scan is closed at its cut end and holes. The bone is grown by the least thickness first, so that the films between two surfaces
/// that nearly coincide vanish, and the bony face is moved back after. What stays are the largest bodies.
pub(super) fn of_bone(of: &Covered, options: &CartilageOptions) -> Result<Made, StageError> {
    let fail = |why: String| StageError(format!("cartilage: {} by Boolean difference: {why}", of.name));
    let margin = options.least_thickness_mm;
    let scan = of.fit.ct_from_scan.mesh(&of.scan.mesh);
    let closed = solidify(&scan, 0.01).mesh;
    let normals = of.bone.vertex_normals();
    let grown = TriMesh {
        vertices: of.bone.vertices.iter().zip(&normals).map(|(p, n)| p + n * margin).collect(),
        triangles: of.bone.triangles.clone(),
    };
    let made = difference(&closed, &grown).map_err(|e| fail(e.to_string()))?;
    let topology = Topology::of(&made.mesh);
    let mut bodies: Vec<(f64, TriMesh, Vec<bool>)> = Vec::new();
    for k in 0..topology.components {
        let own: Vec<usize> =
            (0..made.mesh.triangles.len()).filter(|&t| topology.component_of_triangle[t] as usize == k).collect();
        let flags: Vec<bool> = own.iter().map(|&t| made.of_first[t]).collect();
        let mesh = made.mesh.submesh(|t| topology.component_of_triangle[t] as usize == k).0;
        if flags.iter().any(|f| *f) && flags.iter().any(|f| !*f) && faces(&mesh, &flags, of.facing) {
            bodies.push((mesh.volume(), mesh, flags));
        }
    }
    bodies.sort_by(|a, b| b.0.total_cmp(&a.0));
    let largest = bodies.first().map_or(0.0, |b| b.0);
    let kept: Vec<_> = bodies.iter().take(of.count).filter(|b| b.0 > SPECK_SHARE * largest).collect();
    if kept.len() < of.count {
        return Err(fail(format!(
            "{} bodies of cartilage, expected {}: both plateaus may hang together by a film; use cartilage.method = thickness_field",
            kept.len(),
            of.count
        )));
    }
    let dropped = topology.components - kept.len();
    let mut warnings = Vec::new();
    if dropped > 0 {
        warnings.push(format!("{}: {dropped} films and specks of the Boolean difference left out", of.name));
    }
    let one = |(_, mesh, flags): &(f64, TriMesh, Vec<bool>)| -> Result<(CartilageSolid, Point), StageError> {
        let back = moved_back(mesh, flags, margin);
        let centre = back.centroid().ok_or_else(|| fail("a body without area".into()))?;
        Ok((finished(of.name, &back, flags, options)?, centre))
    };
    let solids = kept.into_iter().map(one).collect::<Result<_, _>>()?;
    Ok(Made { solids, bare_sd: 0.0, warnings })
}

/// Whether a body's articular face looks the way that this bone's cartilage does.
fn faces(mesh: &TriMesh, of_scan: &[bool], facing: Option<Vector>) -> bool {
    let sum: Vector = (0..mesh.triangles.len()).filter(|&t| of_scan[t]).map(|t| mesh.area_vector(t)).sum();
    facing.is_none_or(|f| sum.dot(&f) > 0.0)
}

/// The body with its bony face moved back onto the bone; the rim, which both faces share, goes with it.
fn moved_back(mesh: &TriMesh, of_scan: &[bool], by: f64) -> TriMesh {
    let mut push = vec![Vector::zeros(); mesh.vertices.len()];
    for (t, corners) in mesh.triangles.iter().enumerate().filter(|(t, _)| !of_scan[*t]) {
        corners.iter().for_each(|&v| push[v as usize] += mesh.area_vector(t));
    }
    let vertices =
        mesh.vertices.iter().zip(&push).map(|(p, n)| n.try_normalize(1e-12).map_or(*p, |n| p + n * by)).collect();
    TriMesh { vertices, triangles: mesh.triangles.clone() }
}

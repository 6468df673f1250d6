//! Thickness of cartilage at the vertices of its articular face.

use crate::error::SimError;
use meshes::Vector;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;

/// More than this is no cartilage [mm].
const MOST: f64 = 20.0;

/// Height of each vertex of `articular` above the nearest point of the face on bone, along its normal there [mm], `least` at least.
///
/// The height and not the distance, so that a face that is continued past its rim keeps the rim's thickness.
pub(super) fn above_bone(
    (name, articular): (&str, &TriMesh),
    (bony_name, bony): (&str, &TriMesh),
    least: f64,
) -> Result<Vec<f64>, SimError> {
    let query = SurfaceQuery::new(bony)
        .ok_or_else(|| SimError::Spec(format!("surface {bony_name} of contact.layer has no triangles")))?;
    let normals = bony.vertex_normals();
    let height = |p: &meshes::Point| {
        let near = query.nearest(p);
        let corners = bony.triangles[near.triangle as usize];
        let normal: Vector = (0..3).map(|k| normals[corners[k] as usize] * near.barycentric[k]).sum();
        (p - near.point).dot(&normal.try_normalize(0.0).unwrap_or_else(Vector::zeros)).abs()
    };
    let heights: Vec<f64> = articular.vertices.iter().map(height).collect();
    if let Some(i) = heights.iter().position(|h| h.is_nan() || *h >= MOST) {
        return Err(SimError::Spec(format!(
            "surface {name}: vertex {i} lies {:.1} mm above {bony_name}, expected less than {MOST} mm; are both of one cartilage?",
            heights[i]
        )));
    }
    Ok(heights.into_iter().map(|h| h.max(least)).collect())
}

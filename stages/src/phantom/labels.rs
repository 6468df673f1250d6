//! A label map of the phantom: what a perfect segmentation of MRI would give, voxel by voxel.

use super::bone::Solid;
use super::files::{cover_name, stl_bytes};
use super::shape::{self, Cover};
use crate::StageError;
use formats::nifti;
use meshes::surface::TriMesh;
use meshes::volume::{Grid, Labels};
use meshes::{Isometry, Point, Vector};
use nalgebra::{Matrix3, Rotation3};

/// Distances of voxels of a DESS series: in the plane, and from slice to slice [mm].
const SPACING_MM: [f64; 3] = [0.36, 0.36, 0.7];
/// How the picture stands in the patient: obliquely, as pictures do [rad].
const TURN: [f64; 3] = [0.06, -0.09, 0.12];
/// Picture beyond the bones where they do not run out of it [mm].
const MARGIN_MM: f64 = 4.0;

/// Labels of the map and the keys of `[segmentation]`.
pub(super) const LABELS: [(u8, &str); 6] = [
    (1, "femoral_cartilage"),
    (2, "tibial_cartilage_medial"),
    (3, "tibial_cartilage_lateral"),
    (5, "femur"),
    (6, "tibia"),
    (7, "patella"),
];

type Files = Vec<(String, Vec<u8>)>;

/// Puts a label map in place of CT, scans and points; the surfaces that were voxelised go to `truth/`.
pub(super) fn with_labels(files: &mut Files, bones: [&Solid; 2]) -> Result<(), StageError> {
    let fail = |e: &dyn std::fmt::Display| StageError::Knee(format!("phantom: {e}"));
    let mut parts: Vec<(u8, TriMesh)> = Vec::new();
    for bone in bones {
        for (cover, solid) in &bone.cartilage {
            let label = match cover {
                Cover::Femur => 1,
                Cover::Medial => 2,
                Cover::Lateral => 3,
            };
            parts.push((label, solid.moved(&bone.ct_from_knee)));
        }
    }
    let patella = shape::patella();
    let place = |p: &Point| bones[0].ct_from_knee * bones[0].knee(p);
    parts.push((7, TriMesh { vertices: patella.vertices.iter().map(place).collect(), triangles: patella.triangles }));
    // Bones last: what they share with cartilage is bone.
    parts.push((5, bones[0].in_ct()));
    parts.push((6, bones[1].in_ct()));
    let labels = voxels(&parts).ok_or_else(|| fail(&"the label map came out empty"))?;
    let mut bytes = Vec::new();
    nifti::write_labels(&mut bytes, &labels).map_err(|e| fail(&e))?;
    files.retain(|(name, _)| !name.starts_with("ct/") && !name.starts_with("scans/") && !name.ends_with(".csv"));
    files.push(("mri/labels.nii.gz".into(), bytes));
    for (name, mesh) in [("femur", bones[0].in_ct()), ("tibfib", bones[1].in_ct())] {
        files.push((format!("truth/bone_{name}.stl"), stl_bytes(&mesh).map_err(|e| fail(&e))?));
    }
    debug_assert!(files.iter().any(|(name, _)| name.contains(cover_name(Cover::Femur))));
    if let Some((_, toml)) = files.iter_mut().find(|(name, _)| name == "specimen.toml") {
        let text = String::from_utf8_lossy(toml);
        let head = text.split("[ct]").next().unwrap_or_default();
        let keys: String = LABELS.iter().map(|(n, key)| format!("{key} = {n}\n")).collect();
        *toml = format!("{head}[segmentation]\nlabels = \"mri/labels.nii.gz\"\n{keys}").into_bytes();
    }
    Ok(())
}

/// The labels of closed surfaces, the last first where they overlap.
fn voxels(parts: &[(u8, TriMesh)]) -> Option<Labels> {
    let turn = Rotation3::new(Vector::from(TURN));
    let axes = turn.matrix() * Matrix3::from_diagonal(&Vector::from(SPACING_MM));
    let back = axes.try_inverse()?;
    let (mut low, mut high) = (Vector::repeat(f64::INFINITY), Vector::repeat(f64::NEG_INFINITY));
    for p in parts.iter().flat_map(|(_, mesh)| &mesh.vertices) {
        let at = back * p.coords;
        (low, high) = (low.inf(&at), high.sup(&at));
    }
    let margin = Vector::from(SPACING_MM).map(|s| MARGIN_MM / s);
    let (low, high) = (low - margin, high + margin);
    let size = [0, 1, 2].map(|k| (high[k] - low[k]).ceil() as usize + 1);
    let grid = Grid { size, origin: Point::from(axes * low), axes };
    let mut labels = Labels { values: vec![0; grid.count()], grid };
    let origin = Isometry::translation(-labels.grid.origin.x, -labels.grid.origin.y, -labels.grid.origin.z);
    for (label, mesh) in parts {
        let corners: Vec<Vector> = mesh.vertices.iter().map(|p| back * (origin * p).coords).collect();
        fill(&mut labels, *label, mesh, &corners);
    }
    Some(labels)
}

/// Off the rows of voxels, so that none runs through an edge [voxel].
const OFF: [f64; 2] = [1.234_567e-5, 2.345_678e-5];

/// Fills the inside of a closed surface along the rows of the grid, between pairs of crossings; `corners` in voxels.
fn fill(labels: &mut Labels, label: u8, mesh: &TriMesh, corners: &[Vector]) {
    let [nx, ny, nz] = labels.grid.size;
    let mut crossings: Vec<Vec<f64>> = vec![Vec::new(); ny * nz];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| corners[v as usize]);
        let range = |k: usize, n: usize| {
            let (lo, hi) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            lo.ceil().max(0.0) as usize..=(hi.floor().max(-1.0) + 1.0).min(n as f64 - 1.0) as usize
        };
        let area = (b.y - a.y) * (c.z - a.z) - (b.z - a.z) * (c.y - a.y);
        if area == 0.0 {
            continue;
        }
        for k in range(2, nz) {
            for j in range(1, ny) {
                let (y, z) = (j as f64 + OFF[0], k as f64 + OFF[1]);
                let part = |p: &Vector, q: &Vector| ((q.y - p.y) * (z - p.z) - (q.z - p.z) * (y - p.y)) / area;
                let [w, u, v] = [part(&a, &b), part(&b, &c), part(&c, &a)];
                if w >= 0.0 && u >= 0.0 && v >= 0.0 {
                    crossings[k * ny + j].push(u * a.x + v * b.x + w * c.x);
                }
            }
        }
    }
    for (row, list) in crossings.iter_mut().enumerate() {
        list.sort_by(f64::total_cmp);
        for pair in list.chunks_exact(2) {
            let (from, to) = (pair[0].ceil().max(0.0) as usize, pair[1].floor().min(nx as f64 - 1.0));
            if to >= from as f64 {
                labels.values[row * nx + from..=row * nx + to as usize].fill(label);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::shapes::icosphere;

    #[test]
    fn a_ball_fills_its_volume() {
        let mut ball = icosphere(20.0, 4);
        ball.vertices.iter_mut().for_each(|p| p.coords += Vector::new(100.0, -50.0, 30.0));
        let labels = voxels(&[(3, ball.clone())]).unwrap();
        let count = labels.values.iter().filter(|l| **l == 3).count() as f64;
        let volume = count * labels.grid.voxel_mm3();
        assert!((volume / ball.volume() - 1.0).abs() < 1e-3, "{volume} {}", ball.volume());
        for (i, _) in labels.values.iter().enumerate().filter(|(_, l)| **l == 3) {
            let p = labels.grid.point(&Vector::from(labels.grid.voxel(i).map(|x| x as f64)));
            assert!((p - Point::new(100.0, -50.0, 30.0)).norm() < 20.01);
        }
    }
}

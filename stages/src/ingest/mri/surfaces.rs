//! Surfaces of cartilage that another program made.

use super::Read;
use crate::ingest::{space, surfaces};
use crate::specimen::MriMetrics;
use crate::specimen::{CartilageFrame, CartilagePaths, Mri};
use crate::specimen::{IngestOptions, RawSpecimen};
use crate::{PerBone, PerCartilage, StageError};
use formats::read_surface;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::tidy::tidy;
use meshes::topology::Topology;
use notices::Notice;
use std::collections::BTreeMap;

/// Least area of a surface of cartilage [mm2].
const LEAST_AREA_MM2: f64 = 150.0;
/// Farthest that a cartilage may lie from its bone in the median [mm]; a thick one's far side is 5 mm off.
const MOST_OFF_MM: f64 = 8.0;

/// Reads the surfaces that `[cartilage]` names; `ct` are the bones of CT.
///
/// # Errors
/// As the readers; a surface that is too small, or lies off its bone.
pub(in crate::ingest) fn from_surfaces(
    table: &CartilagePaths,
    raw: &RawSpecimen,
    ct: PerBone<&TriMesh>,
    options: &IngestOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Read, StageError> {
    let in_ct = table.frame == CartilageFrame::Ct;
    let mut bone = |key: &str, path: &Option<String>, ct: &TriMesh| match path {
        Some(path) if !in_ct => surfaces::checked(key, path, &raw.files, options, warnings).map(|s| s.0.mesh),
        _ => Ok(ct.clone()),
    };
    let bones = PerBone {
        femur: bone("cartilage.femur_bone", &table.femur_bone, ct.femur)?,
        tibfib: bone("cartilage.tibfib_bone", &table.tibfib_bone, ct.tibfib)?,
    };
    let one = |key: &str, path: &str, bone: &TriMesh| cartilage(key, path, raw, bone, options);
    let covers = PerCartilage {
        femur: one("cartilage.femur", &table.femur, &bones.femur)?,
        tibia_medial: one("cartilage.tibia_medial", &table.tibia_medial, &bones.tibfib)?,
        tibia_lateral: one("cartilage.tibia_lateral", &table.tibia_lateral, &bones.tibfib)?,
    };
    let volume = |m: &TriMesh| if Topology::of(m).is_closed() { m.volume() } else { 0.0 };
    let given_mm3 = PerCartilage {
        femur: volume(&covers.femur),
        tibia_medial: volume(&covers.tibia_medial),
        tibia_lateral: volume(&covers.tibia_lateral),
    };
    let metrics = MriMetrics { cartilage_volume_mm3: Some(given_mm3.clone()), ..MriMetrics::default() };
    let mri = Mri { in_ct, covers, with_bone: false, bodies: BTreeMap::new(), given_mm3 };
    Ok(Read { bones, patella: None, mri, metrics })
}

/// A surface of cartilage, put right, that lies on its bone.
fn cartilage(
    key: &str,
    path: &str,
    raw: &RawSpecimen,
    bone: &TriMesh,
    options: &IngestOptions,
) -> Result<TriMesh, StageError> {
    let refuse = |what: String| StageError::named(path, key, what);
    let bytes = raw.files.get(path).ok_or_else(|| refuse("the file is not there".into()))?;
    let mut read = read_surface(path, bytes, &raw.files).map_err(|e| refuse(e.to_string()))?;
    space::to_lps(&mut read.mesh, key, path, bytes, options);
    let mesh = tidy(&read).0.mesh;
    if mesh.area() < LEAST_AREA_MM2 {
        return Err(refuse(format!(
            "its area is {:.1} mm2; expected {LEAST_AREA_MM2} mm2 or more: check that it is cartilage, in mm",
            mesh.area()
        )));
    }
    let query = SurfaceQuery::new(bone).ok_or_else(|| refuse("its bone has no triangles".into()))?;
    let mut off: Vec<f64> = mesh.vertices.iter().map(|p| query.nearest(p).distance).collect();
    let median = meshes::measure::percentile(&mut off, 0.5);
    if median > MOST_OFF_MM {
        return Err(refuse(format!(
            "it lies {median:.0} mm off its bone in the median, expected less than {MOST_OFF_MM} mm; {}",
            space::mend(&mesh.vertices, &query, median)
        )));
    }
    Ok(mesh)
}

//! Specimens with truth for the geometry stages' tests.
#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../../../tests/common/phantoms.rs"]
pub(crate) mod phantoms;
pub(crate) mod registration;
#[path = "../../../tests/common/shared.rs"]
mod shared;

use formats::{ply, stl};
use meshes::frame::Side;
use meshes::surface::{ColouredMesh, TriMesh};
use stages::PerBone;
use stages::specimen::{Identity, Specimen};
use std::path::Path;

pub(crate) use shared::shared;

#[expect(clippy::disallowed_methods, reason = "tests read the shared data")]
pub(crate) fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap()
}

/// A specimen's surfaces, as they stand.
pub(crate) fn specimen(dir: &Path, side: Side) -> Specimen {
    let scan = |b: &str| ply::read(&bytes(&dir.join(format!("scans/{b}.ply")))).unwrap();
    let ct = |b: &str| stl::read(&bytes(&dir.join(format!("ct/{b}.stl")))).unwrap();
    of(
        PerBone { femur: ct("femur"), tibfib: ct("tibfib") },
        PerBone { femur: scan("femur"), tibfib: scan("tibfib") },
        side,
    )
}

pub(crate) fn of(ct: PerBone<TriMesh>, scans: PerBone<ColouredMesh>, side: Side) -> Specimen {
    Specimen {
        identity: Identity {
            id: "test".into(),
            side,
            sex: None,
            age_years: None,
            height_cm: None,
            mass_kg: None,
            provenance: None,
            note: None,
        },
        ct,
        scans,
        mri: None,
        patella: None,
        capsule: None,
        landmarks: Vec::new(),
        marks: Vec::new(),
        given_fibres: Vec::new(),
        given_frames: None,
        ligaments: Default::default(),
        warnings: Vec::new(),
        metrics: Default::default(),
    }
}

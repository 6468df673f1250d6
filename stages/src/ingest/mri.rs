//! What MRI gives in place of scans: a label map, or surfaces of cartilage.

mod clean;
mod gaps;
mod labels;
mod surfaces;
mod tibial;

pub(super) use labels::from_labels;
pub(super) use surfaces::from_surfaces;

use crate::PerBone;
use crate::specimen::{Mri, MriMetrics};
use meshes::surface::TriMesh;

/// What is read of a label map or of surfaces.
pub(super) struct Read {
    /// Bones in MRI's frame.
    pub(super) bones: PerBone<TriMesh>,
    /// The patella.
    pub(super) patella: Option<TriMesh>,
    pub(super) mri: Mri,
    pub(super) metrics: MriMetrics,
}

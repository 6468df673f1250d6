//! Stage 2, register: each scan onto its CT bone.

use meshes::frame::{Ct, Pose, Scan};
use serde::{Deserialize, Serialize};

/// How one scan came to lie on its CT bone, with its grade.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BoneRegistration {
    /// Scan to CT.
    pub ct_from_scan: Pose<Scan, Ct>,
    /// Root mean square distance of the fitted bare-bone points [mm].
    pub rms_bare_bone_mm: f64,
    /// Share of the scan's bone-like vertices that lie on the CT bone.
    pub inlier_fraction: f64,
    /// Root mean square distance of bare-bone points kept out of the fit [mm].
    pub held_out_rms_mm: f64,
    /// Predicted mean error of the registration over the scan's vertices [mm].
    pub predicted_error_mm: f64,
    /// Signed distance of each scan vertex to the CT bone [mm], the residual map.
    pub residual_mm: Vec<f64>,
    /// Whether each scan vertex counts as bare bone.
    pub bare_bone: Vec<bool>,
}

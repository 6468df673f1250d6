//! Stage 5, frames: transepicondylar and tibial frames, Grood-Suntay pose in CT.

use meshes::frame::AnatomicalFrame;
use serde::{Deserialize, Serialize};

/// Grood-Suntay coordinates in clinical signs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroodSuntayPose {
    /// Flexion [deg].
    pub fe_deg: f64,
    /// Valgus [deg].
    pub vv_deg: f64,
    /// External rotation of the tibia [deg].
    pub ie_deg: f64,
    /// Lateral [mm].
    pub ml_mm: f64,
    /// Anterior [mm].
    pub ap_mm: f64,
    /// Superior [mm].
    pub si_mm: f64,
}

/// The anatomical frames, CT coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// The femur's: medial along the transepicondylar axis, origin on it.
    pub femur: AnatomicalFrame,
    /// The tibia's, after [groodsuntay1983].
    pub tibia: AnatomicalFrame,
    /// The pose in CT.
    pub gs_ct_pose: GroodSuntayPose,
    /// A point [mm] and the unit direction (medial) of the axis of the cylinder fitted to the posterior condyles.
    pub condylar_axis: (meshes::Point, meshes::Vector),
    /// Its radius [mm].
    pub condylar_radius_mm: f64,
    /// Angle between it and the transepicondylar axis, in the axial plane [deg].
    pub condylar_angle_deg: f64,
    /// Epicondyles used, medial then lateral [mm].
    pub epicondyles: [meshes::Point; 2],
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// For metrics.json.
    pub metrics: serde_json::Value,
}

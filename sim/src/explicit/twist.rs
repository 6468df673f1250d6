//! Velocity and momentum of the femur from the rates of the coordinates.

use crate::coordinate::Six;
use crate::joint::{Joint, Pose};
use crate::model::Model;
use meshes::Vector;
use nalgebra::Matrix6;

/// Angular velocity of the femur and velocity of its centre (its frame's origin) for each coordinate, as columns.
pub(super) fn twists(model: &Model, pose: &Pose) -> Matrix6<f64> {
    let centre = centre(&model.joint, pose);
    let mut out = Matrix6::zeros();
    for (j, s) in pose.screws.iter().enumerate() {
        let v = s.at(&centre);
        out.set_column(j, &Six::new(s.angular.x, s.angular.y, s.angular.z, v.x, v.y, v.z));
    }
    out
}

/// Momentum of a velocity.
pub(super) fn mass_times(twist: &Six, mass: f64, inertia: f64) -> Six {
    Six::from_fn(|c, _| twist[c] * if c < 3 { inertia } else { mass })
}

/// The centre of the femur: the origin of its frame.
fn centre(joint: &Joint, pose: &Pose) -> Vector {
    (pose.femur * joint.femur_origin()).coords
}

//! `femur_frame` and `tibia_frame`: poses read through frames that stand turned.

use super::Reading;
use inference::trial::Trial;
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::Deserialize;
use sim::coordinate::{AP, FE, IE, ML, SI, Six, VV};

/// The effect of the femur's frame.
pub(super) type FemurFrame = TurnedFrame<true>;
/// The effect of the tibia's frame.
pub(super) type TibiaFrame = TurnedFrame<false>;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TurnedFrame<const FEMUR: bool> {
    vv_deg: f64,
    ie_deg: f64,
}

impl<const FEMUR: bool> Reading for TurnedFrame<FEMUR> {
    fn read(&self, gs: &Six, _: &Trial) -> Six {
        turned(gs, self.vv_deg.to_radians(), self.ie_deg.to_radians(), FEMUR)
    }
}

/// The Grood-Suntay pose read when the femur's (or the tibia's) frame is turned by `vv` about its anterior and `ie` about its superior axis [rad].
pub(crate) fn turned(gs: &Six, vv: f64, ie: f64, femur: bool) -> Six {
    let (r, t) = matrix(gs);
    let turn = rotation(Vector3::y(), vv) * rotation(Vector3::z(), ie);
    if femur { coordinates(&(turn.transpose() * r), &(turn.transpose() * t)) } else { coordinates(&(r * turn), &t) }
}

fn rotation(axis: Vector3<f64>, angle: f64) -> Matrix3<f64> {
    Rotation3::new(axis * angle).into_inner()
}

/// Rotation and origin of the tibial frame in the femoral one, axes medial, anterior, superior [grood1983].
fn matrix(gs: &Six) -> (Matrix3<f64>, Vector3<f64>) {
    let r = rotation(Vector3::x(), -gs[FE]) * rotation(Vector3::y(), gs[VV]) * rotation(Vector3::z(), gs[IE]);
    let (sin, cos) = gs[FE].sin_cos();
    let along = (gs[SI] + gs[VV].sin() * gs[ML]) / gs[VV].cos();
    (r, Vector3::new(-gs[ML], gs[AP] * cos + along * sin, -gs[AP] * sin + along * cos))
}

/// The way back.
fn coordinates(r: &Matrix3<f64>, t: &Vector3<f64>) -> Six {
    let fe = r[(1, 2)].atan2(r[(2, 2)]);
    let vv = r[(0, 2)].clamp(-1.0, 1.0).asin();
    let ie = (-r[(0, 1)]).atan2(r[(0, 0)]);
    Six::new(fe, vv, ie, -t.x, t.y * fe.cos() - t.z * fe.sin(), r.column(2).dot(t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unturned_frames_read_the_pose_itself() {
        let gs = Six::new(1.1, 0.07, -0.2, 1.5, 9.0, -21.0);
        assert!((turned(&gs, 0.0, 0.0, true) - gs).amax() < 1e-12);
        assert!((turned(&gs, 0.0, 0.0, false) - gs).amax() < 1e-12);
    }

    #[test]
    fn a_turned_tibia_adds_its_turn_and_a_turned_femur_leaks_with_flexion() {
        let straight = Six::new(0.0, 0.0, 0.0, 0.0, 3.0, -20.0);
        let tibia = turned(&straight, 0.0, 0.05, false);
        assert!((tibia[IE] - 0.05).abs() < 1e-12);
        let bent = Six::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0, 3.0, -20.0);
        let femur = turned(&bent, 0.0, 0.05, true);
        assert!(femur[VV].abs() > 0.049 && femur[IE].abs() < 1e-3, "{femur}");
    }
}

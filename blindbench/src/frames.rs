//! Frames of a data set's own: sensors are calibrated anew and points are probed again, so no two data sets of one knee read it in the same frames.

use crate::pose::Pose;
use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

/// How well a data set's frames repeat, as standard deviations about and along each axis of femur and tibia; 0 and 0: all data sets share them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repeat {
    /// Turns [deg].
    pub turn_deg: f64,
    /// Shifts of the origins [mm].
    pub shift_mm: f64,
}

/// A data set's frames from those of the knee, femur's and tibia's, in their own axes (medial, anterior, superior).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Frames {
    /// Turns [deg].
    pub turn_deg: [[f64; 3]; 2],
    /// Shifts of the origins [mm].
    pub shift_mm: [[f64; 3]; 2],
}

impl Frames {
    /// Where one bone's frame stands in the frame that it is counted from: its turn and its origin.
    fn stand(&self, bone: usize) -> (Rotation3<f64>, Vector3<f64>) {
        (Rotation3::new(Vector3::from(self.turn_deg[bone]).map(f64::to_radians)), Vector3::from(self.shift_mm[bone]))
    }

    /// A point of a bone in these frames.
    pub(crate) fn point(&self, bone: usize, p: &Vector3<f64>) -> Vector3<f64> {
        let (turn, origin) = self.stand(bone);
        turn.inverse() * (p - origin)
    }

    /// A pose in these frames.
    pub(crate) fn pose(&self, p: &Pose) -> Pose {
        let [(femur, from), (tibia, to)] = [0, 1].map(|bone| self.stand(bone));
        let back = femur.inverse();
        Pose { turn: back.matrix() * p.turn * tibia.matrix(), origin: back * (p.turn * to + p.origin - from) }
    }
}

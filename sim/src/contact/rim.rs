//! Whether the femur still bears on the plateau: the centre of each pair's pressure against the extent of its tibial patch.

use super::Contact;
use crate::joint::Pose;
use meshes::{Point, Vector};

impl Contact {
    /// Of each pair that bears load, how far the centre of pressure lies inside the tibial patch's extent, front to back and side to side
    /// [mm]; negative outside.
    pub fn inside_rim(&self, pose: &Pose) -> Vec<f64> {
        let press = self.press(pose);
        let mut out = Vec::new();
        for (n, pair) in self.pairs.iter().enumerate() {
            let mut sum = (0.0, Vector::zeros());
            for spot in press.spots.iter().filter(|s| s.key.0 == n) {
                sum.0 += spot.total;
                sum.1 += spot.centre * spot.total;
            }
            if sum.0 > 0.0 {
                let to_tibia = &pair.tibia.field.local_from_ct;
                let centre = to_tibia * Point::from(sum.1 / sum.0);
                let (low, high) = pair.tibia.nodes.extent_in(to_tibia);
                let inside = (0..2).map(|a| (centre[a] - low[a]).min(high[a] - centre[a]));
                out.push(inside.fold(f64::INFINITY, f64::min));
            }
        }
        out
    }
}

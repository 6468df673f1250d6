//! What is odd about a patella's place: off its groove, about to snap elsewhere, or one place of several.

use super::Patella;
use crate::condensed::{Rest, condense};
use crate::coordinate::{FE, Six};
use crate::joint::Pose;
use meshes::{Point, Vector};

/// A patella is off the groove where its middle lies further aside than this from its place in the CT pose [mm]; ours: a quarter of its width.
const MOST_ASIDE_MM: f64 = 12.0;
/// So it is where its front leans further than this from the way out of the groove [deg]; ours. On the groove of phantoms it leans by up to 35 deg, in
/// the notch by 55 and more.
const MOST_LEAN_DEG: f64 = 45.0;
/// A step of a patella's coordinates: more than this in a degree of flexion [deg, mm]; ours.
pub(crate) const STEP: [f64; 2] = [5.0, 3.0];
/// The degree of flexion [rad].
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// From this far on either side in flexion the patella is sought a second time [rad]; ours: 15 deg.
const OTHER_SIDE: f64 = 15.0 * DEGREE;

/// What is odd about a patella's place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Doubts {
    /// It lies beside its groove, or in the notch.
    pub(crate) off_groove: bool,
    /// It rests elsewhere a degree of flexion further, either way, or where it is sought from the other side.
    pub(crate) snaps: bool,
}

impl Patella {
    /// What is odd about the patella at rest at `inner`, with the knee at its coordinates `q`.
    pub(crate) fn doubts(&self, q: &Six, inner: &[f64]) -> Doubts {
        Doubts { off_groove: self.is_off_groove(inner), snaps: self.snaps(q, inner) }
    }

    /// Whether it has left its groove.
    fn is_off_groove(&self, inner: &[f64]) -> bool {
        let [aside, lean] = self.on_groove(&self.joint.pose(&super::unscaled(inner)));
        let [aside_ct, _] = self.on_groove(&self.joint.pose(&Six::zeros()));
        (aside - aside_ct).abs() > MOST_ASIDE_MM || lean.to_degrees() > MOST_LEAN_DEG
    }

    /// Place of the patella's middle along the groove's axis [mm], and the angle of its front against the way from that axis to it [rad].
    fn on_groove(&self, own: &Pose) -> [f64; 2] {
        let frame = self.joint.tibia();
        let middle: Point = own.femur.inverse_transform_point(&frame.origin);
        let front: Vector = own.femur.rotation.inverse() * frame.anterior;
        let axis = &self.wrap.axes[0];
        let r: Vector = middle.coords - self.wrap.point;
        let (aside, out) = (r.dot(axis), r - axis * r.dot(axis));
        [aside, libm::atan2(front.cross(&out).norm(), front.dot(&out))]
    }

    /// Whether it steps within a degree of flexion, or is found elsewhere when it comes from the other side. The knee's other coordinates are held.
    fn snaps(&self, q: &Six, inner: &[f64]) -> bool {
        let here = self.coordinates(inner);
        let flexed = |by: f64| {
            let mut at = *q;
            at[FE] += by;
            at
        };
        let to = |at: &Six, rest: &mut Rest| condense(self, (at, &self.knee.pose(at)), rest).inner;
        [-1.0, 1.0].into_iter().any(|side| {
            // its motion with flexion is known once it was sought here
            let mut rest = Rest::known(q, inner.to_vec());
            to(q, &mut rest);
            let next = to(&flexed(side * DEGREE), &mut rest);
            to(&flexed(side * OTHER_SIDE), &mut rest);
            let back = to(q, &mut rest);
            [next, back].iter().any(|found| are_apart(&self.coordinates(found), &here))
        })
    }

    /// Its coordinates as results tell them.
    fn coordinates(&self, inner: &[f64]) -> Six {
        self.joint.grood_suntay(&super::unscaled(inner))
    }
}

/// Whether two places are a step apart.
fn are_apart(a: &Six, b: &Six) -> bool {
    let by = a - b;
    let [most_deg, most_mm] = STEP;
    (0..3).any(|i| by[i].to_degrees().abs() > most_deg) || (3..6).any(|i| by[i].abs() > most_mm)
}

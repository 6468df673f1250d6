//! The rigid knee, and the poses in which it is pressed.

use super::{ContactLawOptions, PUBLISHED, fault};
use crate::StageError;
use crate::assemble::{LayerMaterial, articular_face, bony_face, frames_spec};
use crate::frames::Frames;
use crate::overclosure::Separated;
use meshes::frame::Side;
use meshes::{Isometry, Vector};
use nalgebra::Translation3;
use sim::contact::{Contact, ContactOptions, ContactResponse};
use sim::coordinate::{Coordinate, FE, SI, Six, VV};
use sim::joint::{Joint, Pose};
use sim::spec::{ContactSpec, PairSpec};
use std::collections::BTreeMap;

/// Rigid cartilages on the joint's chain.
pub(super) struct Rigid {
    pub(super) joint: Joint,
    /// With the published law.
    pub(super) contact: Contact,
    /// By thickness, with the option's material.
    pub(super) layers: Contact,
    /// Towards the femur along the tibia's axis.
    pub(super) up: Vector,
}

/// A pose from which the knee is pressed: the cartilages just touch.
#[derive(Clone, Debug)]
pub(super) struct Start {
    pub(super) flexion_deg: f64,
    pub(super) pose: Pose,
    /// Approach at which the rigid knee with the published law would carry the force wanted [mm].
    pub(super) reach_mm: f64,
}

/// Valgus beyond this says that one compartment only bears [rad].
const MOST_TILT: f64 = 0.2;

impl Rigid {
    pub(super) fn new(
        side: Side,
        frames: &Frames,
        separated: &Separated,
        o: &ContactLawOptions,
    ) -> Result<Rigid, StageError> {
        let frames = frames_spec(frames);
        let joint = Joint::new(&frames, side).map_err(fault)?;
        let mut surfaces: BTreeMap<String, _> =
            separated.meshes.named().into_iter().map(|(name, mesh)| (name.to_owned(), articular_face(mesh))).collect();
        let pair = |tibia: &str| PairSpec { femur: "femur".into(), tibia: tibia.into() };
        let spec = ContactSpec {
            overclosure_mm: PUBLISHED.0.to_vec(),
            pressure_mpa: PUBLISHED.1.to_vec(),
            friction: o.friction,
            damping: 0.0,
            layer: None,
            pairs: vec![pair("tibia_medial"), pair("tibia_lateral")],
        };
        let contact = Contact::between(&frames, &spec, &surfaces, &ContactOptions::default()).map_err(fault)?;
        let bony = |name: &str| format!("{name}_bony");
        surfaces.extend(separated.meshes.named().into_iter().map(|(name, mesh)| (bony(name), bony_face(mesh))));
        let faces = separated.meshes.named().map(|(name, _)| (name.to_owned(), bony(name)));
        let material = LayerMaterial { least_thickness_mm: o.least_thickness_mm, ..LayerMaterial::default() };
        let layered = ContactSpec { layer: Some(material.spec(faces.into())), ..spec };
        let layers = Contact::between(&frames, &layered, &surfaces, &ContactOptions::default()).map_err(fault)?;
        let up = joint.axes()[0].direction;
        Ok(Rigid { joint, contact, layers, up })
    }

    /// The femur `approach` further down the tibia's axis.
    pub(super) fn pressed(&self, pose: &Pose, approach_mm: f64) -> Pose {
        let femur = Translation3::from(self.up * -approach_mm) * pose.femur;
        Pose { femur, screws: pose.screws }
    }

    /// The pose at a flexion: varus-valgus such that both plateaus share half the wanted force without a moment, the other coordinates as in
    /// CT; then lifted along the tibia's axis until nothing overlaps.
    pub(super) fn pose(&self, flexion_deg: f64, o: &ContactLawOptions) -> Result<Start, StageError> {
        let mut q = Six::zeros();
        q[FE] = flexion_deg.to_radians() - self.joint.ct_pose()[FE];
        let unmet = || {
            StageError::part(
                format_args!("flexion {flexion_deg} deg"),
                "the cartilages do not meet along the tibia's axis; check the frames, or leave this flexion out of flexions_deg",
            )
        };
        // apart, then together
        q[SI] = -15.0;
        while self.at(&q).deepest < 0.3 {
            q[SI] += 0.2;
            if q[SI] > 25.0 {
                return Err(unmet());
            }
        }
        self.balance(&mut q, 0.5 * o.force_n).ok_or_else(unmet)?;
        let pose = self.joint.pose(&q);
        // lifted out of contact, then down to where it begins
        let deepest = |lift: f64| self.contact.evaluate(&self.pressed(&pose, -lift)).deepest;
        let (mut low, mut high) = (0.0, 0.0);
        while deepest(high) > 0.0 {
            high += 0.5;
        }
        while high - low > 1e-4 {
            let middle = f64::midpoint(low, high);
            if deepest(middle) > 0.0 { low = middle } else { high = middle }
        }
        let start = self.pressed(&pose, -high);
        let mut reach_mm = 0.0;
        while self.force(&self.contact, &start, reach_mm).0 < o.force_n && reach_mm < 5.0 {
            reach_mm += 0.02;
        }
        Ok(Start { flexion_deg, pose: start, reach_mm })
    }

    /// Force up the tibia's axis [N] and contact area [mm2] at an approach.
    pub(super) fn force(&self, contact: &Contact, start: &Pose, approach_mm: f64) -> (f64, f64) {
        let press = contact.press(&self.pressed(start, approach_mm));
        (press.force.dot(&self.up), press.area)
    }

    fn at(&self, q: &Six) -> ContactResponse {
        self.contact.evaluate(&self.joint.pose(q))
    }

    /// Newton's method for valgus and compression under a force; steps are kept short.
    fn balance(&self, q: &mut Six, force_n: f64) -> Option<()> {
        for _ in 0..200 {
            let r = self.at(q);
            let (g0, g1) = (-r.gradient[VV], force_n - r.gradient[SI]);
            if g1.abs() < 1e-3 * force_n && g0.abs() < 1e-2 * force_n {
                return Some(());
            }
            let h = &r.hessian;
            // a little stiffness keeps a knee that bears on one side only from tipping over
            let at = |j: Coordinate, k: Coordinate| h[(j.index(), k.index())];
            let (a, b, d) = (at(VV, VV).max(0.0) + 1e3, at(VV, SI), at(SI, SI).max(0.0) + 10.0);
            let det = a * d - b * b;
            let (det, b) = if det > 1e-3 * a * d { (det, b) } else { (a * d, 0.0) };
            let (vv, si) = ((d * g0 - b * g1) / det, (a * g1 - b * g0) / det);
            let share = (0.01 / vv.abs().max(1e-12)).min(0.1 / si.abs().max(1e-12)).min(1.0);
            q[VV] += vv * share;
            q[SI] += si * share;
            if q[VV].abs() > MOST_TILT {
                return None;
            }
        }
        None
    }
}

/// The femur's motion from CT.
pub(super) fn motion(pose: &Pose) -> Isometry {
    pose.femur
}

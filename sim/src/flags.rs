//! What is odd about an answer, in the words of its flags: a knee that has left its plateau, turned further than any knee, torn a ligament, or that
//! might as well rest elsewhere.
//!
//! Flags change no number. Where the limits come from: docs/theory/solver.md.

use crate::contact::rim::Bearing;
use crate::coordinate::{AP, FE, IE, ML, SI, Six, VV};
pub use crate::flag::{Cause, Difference, Flag, each_once, sentences};
use crate::model::{Evaluation, Model};
use crate::names::is_of;

/// Internal and external rotation to which living knees are turned by hand [deg], at 5 deg of flexion (those without ACL, the looser) and from 30 deg
/// on; means of 17 and 19 persons [zarins1983].
const TURNS_DEG: [[f64; 2]; 2] = [[14.0, 41.0], [25.0, 45.0]];
/// Between these flexions the limits go from the one to the other [deg]; [zarins1983].
const TURNS_AT_DEG: [f64; 2] = [5.0, 30.0];
/// A rotation is odd this far beyond those means [deg]; ours: for the scatter of persons and for another zero of the frames.
const TURNS_SPARE_DEG: f64 = 15.0;
/// Varus and valgus beyond this from the CT pose are odd [deg]; ours, no source was read.
const OPENS_DEG: f64 = 25.0;
/// Flexion below this is of a knee that has turned over [deg]: valgus reads up to 90 deg, and beyond it flexion reads 180 deg less. Ours.
const LEAST_FLEXION_DEG: f64 = -45.0;
/// A compartment that bears less of the load than this is not asked where [-]; ours.
const LEAST_SHARE: f64 = 0.1;

/// A tibia lies beyond the condyle from this part of [`Limits::rim_mm`] on [-]; ours: a condyle's cartilage ends on bone as round as itself, and
/// sound knees bear within 2 mm of such an end (S193761 at 80 deg).
const CONDYLE_END: f64 = 0.5;

/// Half the depth of a plateau [mm]: 38 mm in Specimen 1. A contact that was in its middle has come to the rim when AP is as far from the CT pose.
///
/// A knee that bears on one compartment alone is subluxed beyond it: such a contact slides on without coming near a rim that is asked. Measured on
/// tables of calibrated knees: of 879 rows of intact knees none is so, of 529 rows of cut ones 121 are.
pub const HALF_PLATEAU_MM: f64 = 19.0;

/// A ligament, all its bundles together, and the tension at which it fails [N].
///
/// ACL: persons of 22 to 35 years [woo1991]. PCL: what [race1994] expects of young persons. MCL, as the superficial one: [cho2020]. LCL, PFL:
/// [laprade2005]. ALS: [helito2016]. Of the deep MCL, POL and capsule no source was read: they have no flag.
pub const FAILURE_N: [(&str, f64); 6] =
    [("ACL", 2160.0), ("PCL", 4000.0), ("LCL", 295.0), ("PFL", 298.0), ("ALS", 204.8), ("sMCL", 498.5)];

/// Where a femur has left its plateau; the fields of [`crate::trials::TrialOptions`] of the same names.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// ML and SI from the CT pose [mm].
    pub dislocation_mm: f64,
    /// AP from the CT pose [mm].
    pub dislocation_ap_mm: f64,
    /// From a rim [mm].
    pub rim_mm: f64,
    /// Of a compartment's load, so near to a rim [-].
    pub rim_share: f64,
}

/// What is odd about an answer at Grood-Suntay coordinates `gs` [rad, mm].
pub fn flags(model: &Model, gs: &Six, evaluation: &Evaluation, limits: &Limits) -> Vec<Flag> {
    let mut out: Vec<Flag> = place(model, gs, evaluation, limits).into_iter().collect();
    out.extend(is_turned_too_far(model, gs).then_some(Flag::Rotated));
    out.extend(torn(model, evaluation));
    out.extend(patella(model, gs, evaluation));
    out
}

/// What is odd about the patella.
fn patella(model: &Model, gs: &Six, evaluation: &Evaluation) -> Vec<Flag> {
    let Some(state) = model.patella_state(evaluation) else { return Vec::new() };
    let doubts = model.patella_doubts(gs, evaluation).unwrap_or_default();
    let flags = [
        (!state.is_balanced(), Flag::PatellaUnbalanced),
        (doubts.off_groove, Flag::PatellaOffGroove),
        (doubts.snaps, Flag::PatellaSnaps),
        (state.is_held(), Flag::PatellaHeld),
    ];
    flags.into_iter().filter(|f| f.0).map(|f| f.1).collect()
}

/// Whether the femur has left the plateau, wholly or in part.
fn place(model: &Model, gs: &Six, evaluation: &Evaluation, limits: &Limits) -> Option<Flag> {
    let ct = model.joint.ct_pose();
    let most = [(ML, limits.dislocation_mm), (SI, limits.dislocation_mm), (AP, limits.dislocation_ap_mm)];
    if is_turned_over(gs) || most.into_iter().any(|(c, limit)| (gs[c] - ct[c]).abs() > limit) {
        return Some(Flag::Dislocated);
    }
    let frames = [model.joint.femur(), model.joint.tibia()];
    let bearings = model.contact.bearings(&evaluation.pose, frames, limits.rim_mm);
    let load: f64 = bearings.iter().map(|b| b.load_n).sum();
    let asked: Vec<&Bearing> = bearings.iter().filter(|b| b.load_n >= LEAST_SHARE * load).collect();
    let between =
        || model.bodies.iter().zip(&evaluation.bodies).any(|(b, rest)| b.bears(&evaluation.pose, &rest.inner));
    let leaves = |b: &Bearing| {
        let [plateau, condyle] = b.inside_mm;
        plateau < limits.rim_mm || b.at_rim[0] > limits.rim_share || condyle < CONDYLE_END * limits.rim_mm
    };
    match (asked.len(), asked.iter().filter(|b| leaves(b)).count()) {
        (0, _) if !between() => Some(Flag::Dislocated),
        (1.., leaving) if leaving == asked.len() => Some(Flag::Dislocated),
        (_, 1..) => Some(Flag::Subluxed),
        _ if (gs[AP] - ct[AP]).abs() > HALF_PLATEAU_MM && bears_on_one(&bearings) => Some(Flag::Subluxed),
        _ => None,
    }
}

/// Whether the knee has turned over: its flexion is of no knee.
fn is_turned_over(gs: &Six) -> bool {
    gs[FE].to_degrees() < LEAST_FLEXION_DEG
}

/// Whether one compartment bears less of the load than [`LEAST_SHARE`].
fn bears_on_one(bearings: &[Bearing]) -> bool {
    let of = |compartment: usize| -> f64 {
        bearings.iter().filter(|b| b.compartment == compartment).map(|b| b.load_n).sum()
    };
    let (medial, lateral) = (of(0), of(1));
    medial.min(lateral) < LEAST_SHARE * (medial + lateral)
}

/// Whether the tibia is turned further than knees turn.
fn is_turned_too_far(model: &Model, gs: &Six) -> bool {
    if is_turned_over(gs) || (gs[VV] - model.joint.ct_pose()[VV]).to_degrees().abs() > OPENS_DEG {
        return true;
    }
    let [low, high] = TURNS_AT_DEG;
    let along = ((gs[FE].to_degrees() - low) / (high - low)).clamp(0.0, 1.0);
    let [internal, external] =
        [0, 1].map(|k| TURNS_DEG[0][k] + (TURNS_DEG[1][k] - TURNS_DEG[0][k]) * along + TURNS_SPARE_DEG);
    let turned = gs[IE].to_degrees();
    turned < -internal || turned > external
}

/// Ligaments that bear more than they can.
fn torn(model: &Model, evaluation: &Evaluation) -> Vec<Flag> {
    let forces = model.bundle_forces(&evaluation.fibres);
    let bears = |ligament: &str| -> f64 {
        model.bundles.iter().zip(&forces).filter(|(b, _)| is_of(&b.name, ligament)).map(|(_, f)| *f).sum()
    };
    FAILURE_N
        .iter()
        .filter(|(name, most)| bears(name) > *most)
        .map(|(name, _)| Flag::Torn((*name).to_owned()))
        .collect()
}

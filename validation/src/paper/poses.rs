//! Ligament forces at the poses that the paper prints: fibres, law and parameters put to the test without cartilage.

use super::{grid, header, rms};
use crate::published;
use crate::validate::Source;
use attachments::groups::{GROUPS, group_forces};
use sim::SimError;
use sim::coordinate::{Load, SI, Six, VV};
use sim::model::{Evaluation, Model};
use sim::protocols::ProtocolOptions;
use sim::spec::PoseSpec;

/// A row of Table 6, and what its pose means for a model.
#[derive(Clone, Debug, PartialEq)]
pub struct AtPose {
    /// The paper's model.
    pub source: String,
    /// Intact, or without ACL.
    pub acl: bool,
    /// Forces of the paper's ligaments [N].
    pub forces_n: [f64; 9],
    /// Table 7's [N].
    pub published_n: [f64; 9],
    /// What the cartilage must bear along the tibia for rest under the paper's loads [N], and how far lateral of its axis [mm].
    pub needed: [f64; 2],
    /// What this model's cartilage bears at the pose: the same; zeros where it does not touch.
    pub borne: [f64; 2],
    /// What it bears where the model itself comes to rest under these loads: the same; NaN where it did not.
    pub at_rest: [f64; 2],
}

/// What a model's ligaments and cartilage do at the poses of Table 6 of its knee, and its cartilage where the model rests (`source` holds its answers).
///
/// # Errors
/// A pose that the joint cannot take; no ACL to cut.
pub fn at_published_poses(source: &Source, model: &Model, loads: &ProtocolOptions) -> Result<Vec<AtPose>, SimError> {
    let evaluate = |cut: &Model, pose: PoseSpec| -> Result<Evaluation, SimError> {
        Ok(cut.evaluate(&cut.joint.coordinates(&pose.six())?))
    };
    let load = Load::new(loads.pivot_valgus_nm, -loads.pivot_internal_nm, 0.0, 0.0, loads.compression_n).generalised();
    let mut out = Vec::new();
    for acl in [true, false] {
        let Some(row) = published::pivot_shift(&source.specimen, &source.name, acl) else { continue };
        let cut = if acl { model.clone() } else { model.without(&["ACL".to_owned()])? };
        let there = evaluate(&cut, row.pose())?;
        let rest = source.pivot_end(acl).map(|r| evaluate(&cut, r.pose));
        let ligaments = there.gradient - there.contact.gradient;
        // at rest the gradients of ligaments and cartilage add up to the load
        let cartilage = load - ligaments;
        let resultant = |g: &Six| [g[SI].abs(), if g[SI].abs() > 1.0 { g[VV] / g[SI] } else { 0.0 }];
        let forces_n = group_forces(&cut.bundle_names(), &cut.bundle_forces(&there.fibres));
        out.push(AtPose {
            source: source.name.clone(),
            acl,
            forces_n,
            published_n: GROUPS.map(|(g, _)| row.forces_n.get(g).copied().unwrap_or(0.0)),
            needed: resultant(&cartilage),
            borne: resultant(&there.contact.gradient),
            at_rest: rest.transpose()?.map_or([f64::NAN; 2], |e| resultant(&e.contact.gradient)),
        });
    }
    Ok(out)
}

/// The rows as a table, and the root mean square miss of their forces [N].
pub fn poses(all: &[AtPose]) -> (String, f64) {
    let mut rows = Vec::new();
    let mut miss = Vec::new();
    for p in all {
        let mut row = vec![p.source.clone(), if p.acl { "intact" } else { "none" }.to_owned()];
        for (a, b) in p.forces_n.iter().zip(p.published_n) {
            miss.push(a - b);
            row.push(if *a < 0.5 && b < 0.5 { "0".into() } else { format!("{a:.0} ({b:.0})") });
        }
        rows.push(row);
    }
    (grid(&header(&["model", "ACL"], GROUPS.iter().map(|(g, _)| (*g).to_owned())), &rows), rms(&miss))
}

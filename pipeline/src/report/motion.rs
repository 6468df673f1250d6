//! The knee's motions for the slider: the femur's place and the fibres' forces at every step of every protocol.

use super::geometry::{Pool, rounded};
use crate::stage::Values;
use crate::stage::list::Calibration;
use crate::validate::Validation;
use serde::Serialize;
use sim::joint::Joint;
use sim::laxity::TrialResult;
use sim::spec::ModelSpec;

/// A way of moving the knee.
#[derive(Serialize)]
pub(super) struct Motion {
    name: String,
    steps: Vec<Step>,
}

#[derive(Serialize)]
struct Step {
    label: String,
    /// Rows of the 3 x 4 matrix that moves the femur.
    femur: Vec<f64>,
    /// Force of each fibre [N].
    force: Vec<f64>,
}

const PROTOCOLS: [(&str, &str); 4] = [
    ("passive_flexion", "passive flexion"),
    ("ap_laxity", "AP laxity"),
    ("pivot_shift", "pivot shift"),
    ("pivot_shift_no_acl", "pivot shift without ACL"),
];

/// The protocols of every calibrated model.
pub(super) fn motions(v: &Values, pool: &Pool) -> Vec<Motion> {
    let (Some(validation), Some(calibration)) = (v.of::<Validation>(), v.of::<Calibration>()) else { return vec![] };
    let mut out = Vec::new();
    for source in &validation.sources {
        let Some(outcome) = calibration.sources.get(&source.name) else { continue };
        let Ok(joint) = Joint::new(&outcome.spec.frames, outcome.spec.side) else { continue };
        for (file, words) in PROTOCOLS {
            let rows = source.protocols().into_iter().find(|(name, _)| *name == file).map_or(&[][..], |(_, rows)| rows);
            let steps: Vec<Step> =
                rows.iter().filter_map(|r| step(r, &joint, &outcome.spec, &source.bundles, pool)).collect();
            if !steps.is_empty() {
                out.push(Motion { name: format!("{}: {words}", source.name), steps });
            }
        }
    }
    out
}

fn step(r: &TrialResult, joint: &Joint, spec: &ModelSpec, bundles: &[String], pool: &Pool) -> Option<Step> {
    let q = joint.coordinates(&r.pose.six()).ok()?;
    let force = spec
        .fibres
        .iter()
        .map(|f| {
            let count = spec.fibres.iter().filter(|g| g.bundle == f.bundle).count() as f64;
            let place = bundles.iter().position(|b| *b == f.bundle);
            rounded(place.and_then(|i| r.forces_n.get(i)).map_or(0.0, |n| n / count), 10.0)
        })
        .collect();
    let p = &r.pose;
    let flags = if r.flags.is_empty() { String::new() } else { format!(" ({})", r.flags.join(", ")) };
    let label = format!(
        "{}: flexion {:.0}, valgus {:.1}, external {:.1} deg; lateral {:.1}, anterior {:.1}, superior {:.1} mm{flags}",
        r.trial.trial, p.fe_deg, p.vv_deg, p.ie_deg, p.ml_mm, p.ap_mm, p.si_mm
    );
    Some(Step { label, femur: pool.motion(&joint.pose(&q).femur), force })
}

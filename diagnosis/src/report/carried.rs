//! What each ligament carries in the tests of a laboratory, with ligaments alone recalibrated and with the answer: what naming an effect is for.

use crate::effect::bench::Bench;
use crate::effect::{Active, Place};
use crate::error::DiagnosisError;
use crate::report::Carried;
use crate::report::predict::acting;
use attachments::groups::{GROUPS, group_forces};
use inference::trial::Trial;
use sim::Model;
use sim::coordinate::Load;
use sim::laxity::{LaxityTrial, Test};
use sim::protocols::ProtocolOptions;
use sim::spec::ModelSpec;

/// Forces below this in every knee are left out [N].
pub const LEAST_N: f64 = 5.0;

/// Ligament forces under the paper's anterior drawers and pivot shift; `knees` are the model with its ligaments recalibrated alone and with the answer,
/// each with its specification, whose components act as in any prediction of the knee alone ([`acting`]): not those of an apparatus or of one data set. A test in which either knee finds no rest is left out.
///
/// Errors: a component that cannot be read.
pub fn carried(knees: [(&Model, &ModelSpec); 2]) -> Result<Vec<Carried>, DiagnosisError> {
    let mut effects = Vec::new();
    for (_, spec) in knees {
        effects.push(acting(spec, None)?.into_iter().map(|(_, active)| active).collect::<Vec<Active>>());
    }
    let mut out = Vec::new();
    for (words, trial) in tests() {
        let force = |k: usize| under(knees[k].0, knees[k].1, &effects[k], &trial);
        let (Some(without), Some(with)) = (force(0), force(1)) else { continue };
        for (g, (ligament, _)) in GROUPS.iter().enumerate() {
            if without[g].max(with[g]) >= LEAST_N {
                let (without_n, with_n) = (without[g], with[g]);
                out.push(Carried { ligament: (*ligament).into(), test: words.clone(), without_n, with_n });
            }
        }
    }
    Ok(out)
}

/// The tests [andreassen2025, sections 2.6.2 and 2.6.4].
fn tests() -> Vec<(String, LaxityTrial)> {
    let o = ProtocolOptions::default();
    let trial = |name: &str, test: Test, flexion: f64, [vv, ie, ap]: [f64; 3]| {
        LaxityTrial::asked(name.into(), test, flexion, Load::new(vv, ie, 0.0, ap, o.compression_n))
    };
    let drawer = |fe: &f64| {
        let words = format!("{:.0} N forward at {fe:.0} deg", o.ap_load_n);
        (words, trial("drawer", Test::Anterior, *fe, [0.0, 0.0, o.ap_load_n]))
    };
    let (fe, valgus, internal) = (o.pivot_flexion_deg, o.pivot_valgus_nm, o.pivot_internal_nm);
    let pivot =
        format!("{valgus:.0} N m of valgus and {internal:.0} N m of internal rotation (pivot shift) at {fe:.0} deg");
    let mut out: Vec<(String, LaxityTrial)> = o.ap_flexions_deg.iter().map(drawer).collect();
    out.push((pivot, trial("pivot", Test::Valgus, fe, [valgus, -internal, 0.0])));
    out
}

/// Forces of the groups [N] at rest under a trial; none where there is no rest.
fn under(model: &Model, spec: &ModelSpec, effects: &[Active], trial: &LaxityTrial) -> Option<[f64; 9]> {
    let place = Place { femur: spec.frames.femur, tibia: spec.frames.tibia };
    let mut trial = Trial::alone(trial.clone());
    let plain = Bench { model, effects: &[], place: &place };
    trial.unloaded = plain.neutral(&trial).start();
    let rest = Bench { effects, ..plain }.walk(&trial);
    let mut forces = model.bundle_forces(&model.fibre_states(&model.joint.pose(&rest.q)));
    let names = model.bundle_names();
    // what a structure has lost it does not carry, though the model's own fibres do not know of it
    let left = |name: &str| effects.iter().map(|e| 1.0 - e.lost(name)).product::<f64>();
    forces.iter_mut().zip(&names).for_each(|(force, name)| *force *= left(name));
    rest.balanced.then(|| group_forces(&names, &forces))
}

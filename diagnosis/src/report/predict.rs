//! What the components of a model do to its predictions: simulate, calibrate and validate add it to what the solver finds.
//!
//! An apparatus' component acts only where that apparatus' data set is asked for; a specimen's and a session's act wherever their scope allows.

use crate::effect::bench::Bench;
use crate::effect::catalogue::Catalogue;
use crate::effect::{Active, Place};
use crate::error::DiagnosisError;
use crate::problem::reading;
use crate::report::component::{Component, of_model};
use inference::trial::Trial;
use rayon::prelude::*;
use sim::Model;
use sim::coordinate::Free;
use sim::laxity::{LaxityTrial, TrialResult};
use sim::spec::ModelSpec;

/// The components that act in a prediction: of a data set, or (`None`) of the knee itself. Those of no size are left out.
///
/// Errors: a component that cannot be read.
pub fn acting(spec: &ModelSpec, data_set: Option<&str>) -> Result<Vec<(Component, Active)>, DiagnosisError> {
    let acts = |c: &Component| {
        let here = c.scope == "both" || data_set == Some(c.scope.as_str());
        let kept = data_set.is_some() || c.kept != "apparatus";
        here && kept && c.parameters.values().any(|v| v.value != 0.0)
    };
    let mut all = of_model(spec, &Catalogue::shipped())?;
    all.retain(|(component, _)| acts(component));
    Ok(all)
}

/// How far the effects move the reading of each trial: VV, IE [deg], ML, AP, SI [mm]. Without friction, at the model's rest.
pub fn displacements(model: &Model, spec: &ModelSpec, effects: &[Active], trials: &[LaxityTrial]) -> Vec<Free<f64>> {
    if effects.is_empty() {
        return vec![Free::all(0.0); trials.len()];
    }
    let place = Place { femur: spec.frames.femur, tibia: spec.frames.tibia };
    trials
        .par_iter()
        .map(|t| {
            let mut trial = Trial::alone(t.clone());
            let plain = Bench { model, effects: &[], place: &place };
            trial.unloaded = plain.neutral(&trial).start();
            let without = plain.walk(&trial);
            let with = Bench { effects, ..plain }.settle(&trial, &without.start());
            let (a, b) = (reading(&without), reading(&with));
            Free::from_fn(|c| b[c] - a[c])
        })
        .collect()
}

/// Moves predicted poses by what the components do.
///
/// Errors: a component that cannot be read.
pub fn apply(
    model: &Model,
    spec: &ModelSpec,
    data_set: Option<&str>,
    results: &mut [TrialResult],
) -> Result<(), DiagnosisError> {
    let effects: Vec<Active> = acting(spec, data_set)?.into_iter().map(|(_, a)| a).collect();
    if effects.is_empty() {
        return Ok(());
    }
    let trials: Vec<LaxityTrial> = results.iter().map(|r| r.trial.clone()).collect();
    for (r, d) in results.iter_mut().zip(displacements(model, spec, &effects, &trials)) {
        r.pose = r.pose.moved(&d);
    }
    Ok(())
}

/// Measurements with what the components do taken off, for a calibration that knows the solver alone.
///
/// Errors: a component that cannot be read.
pub fn taken_off(
    model: &Model,
    spec: &ModelSpec,
    data_set: Option<&str>,
    trials: &[LaxityTrial],
) -> Result<Vec<LaxityTrial>, DiagnosisError> {
    let effects: Vec<Active> = acting(spec, data_set)?.into_iter().map(|(_, a)| a).collect();
    let mut out = trials.to_vec();
    if !effects.is_empty() {
        let unloaded: Vec<LaxityTrial> = trials.iter().filter_map(LaxityTrial::unloaded).collect();
        let mut there = displacements(model, spec, &effects, &unloaded).into_iter();
        for (t, d) in out.iter_mut().zip(displacements(model, spec, &effects, trials)) {
            let zero = t.reference.as_ref().and_then(|_| there.next()).unwrap_or(Free::all(0.0));
            t.measured.iter_mut().zip(d).zip(zero).for_each(|((m, by), zero)| *m = m.map(|m| m - (by - zero)));
        }
    }
    Ok(out)
}

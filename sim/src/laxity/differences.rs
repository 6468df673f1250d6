//! Readings that are displacements: which trial each counts from.

use super::columns::LaxityError;
use super::format::Readings;
use super::{LaxityTrial, Reference, Test};
use crate::coordinate::{Free, Load};
use notices::plain;

/// Nominal flexions within this are one flexion [deg].
const SAME_FLEXION: f64 = 0.5;

/// A load in a trial's own direction below this counts as none; the twentieth of a usual test's.
const NO_LOAD: Load = Load::new(0.5, 0.25, 5.0, 6.65, 5.0);

/// Gives every trial whose readings are displacements the trial that they count from: as the column `reference` names it, or, in a file of
/// differences, the unloaded trial of its flexion.
pub(super) fn resolve(trials: &mut [LaxityTrial], named: &[String], readings: Readings) -> Result<(), LaxityError> {
    let mut from: Vec<Option<usize>> = Vec::with_capacity(named.len());
    for (i, name) in named.iter().enumerate() {
        from.push(match (name.is_empty(), readings) {
            (false, _) => Some(by_name(trials, i, name)?),
            (true, Readings::Difference) => by_flexion(trials, i)?,
            (true, Readings::Pose) => None,
        });
    }
    for (i, reference) in from.iter().enumerate() {
        let Some(k) = *reference else { continue };
        let (t, r) = (&trials[i], &trials[k]);
        if from[k].is_some() {
            return refuse(t, &format!("\"{}\" counts from another trial itself; name the first of them", r.trial));
        }
        if (t.nominal_flexion_deg - r.nominal_flexion_deg).abs() > SAME_FLEXION {
            let (here, there) = (t.nominal_flexion_deg, r.nominal_flexion_deg);
            return refuse(
                t,
                &format!(
                    "\"{}\" is at {} deg, this trial at {} deg; expected one flexion",
                    r.trial,
                    plain(there),
                    plain(here)
                ),
            );
        }
        if t.load == r.load {
            return refuse(t, &format!("\"{}\" has the same loads, so nothing was displaced", r.trial));
        }
        let reference = Reference { trial: r.trial.clone(), load: r.load, fe_deg: r.fe_deg };
        trials[i].reference = Some(reference);
    }
    for k in 0..trials.len() {
        if from.contains(&Some(k)) || (readings == Readings::Difference && from[k].is_none()) {
            zeros(trials, k, readings)?;
        }
    }
    Ok(())
}

fn refuse<T>(t: &LaxityTrial, what: &str) -> Result<T, LaxityError> {
    Err(LaxityError::trial(t, Some("reference"), what.into()))
}

/// The trial that the column names.
fn by_name(trials: &[LaxityTrial], i: usize, name: &str) -> Result<usize, LaxityError> {
    match trials.iter().position(|t| t.trial == name) {
        Some(k) if k == i => refuse(&trials[i], "the trial counts from itself; name the unloaded trial"),
        Some(k) => Ok(k),
        None => refuse(
            &trials[i],
            &format!(
                "no trial \"{name}\" in the file; add its row with test, flexion and loads (its readings may be empty)"
            ),
        ),
    }
}

/// The unloaded trial of the same flexion: of the same test where there is one, the last one above; none for an unloaded trial.
fn by_flexion(trials: &[LaxityTrial], i: usize) -> Result<Option<usize>, LaxityError> {
    let t = &trials[i];
    if is_unloaded(t) {
        return Ok(None);
    }
    let fits = |k: usize, test: Test| {
        let r = &trials[k];
        let here = (r.nominal_flexion_deg - t.nominal_flexion_deg).abs() <= SAME_FLEXION;
        here && r.test == test && is_unloaded(r)
    };
    let near = |test: Test| (0..i).rev().chain(i..trials.len()).find(|&k| fits(k, test));
    match near(t.test).or_else(|| near(Test::Neutral)) {
        Some(k) => Ok(Some(k)),
        None => Err(LaxityError::trial(
            t,
            None,
            format!(
                "its reading is a difference, but the file has no unloaded trial at {} deg; add a row with test neutral, this flexion and \
                 its loads (its readings may be empty)",
                plain(t.nominal_flexion_deg)
            ),
        )),
    }
}

/// Whether a trial has no load in the direction of its test.
fn is_unloaded(t: &LaxityTrial) -> bool {
    t.test.coordinate().is_none_or(|c| t.load[c].abs() < NO_LOAD[c])
}

/// Readings of 0 of a trial that others count from are the zero of the instrument, not a pose.
fn zeros(trials: &mut [LaxityTrial], k: usize, readings: Readings) -> Result<(), LaxityError> {
    let t = &mut trials[k];
    let given: Vec<f64> = t.measured.iter().flatten().copied().collect();
    if given.iter().all(|v| *v == 0.0) {
        t.measured = Free::all(None);
        return Ok(());
    }
    match readings {
        Readings::Pose => Ok(()),
        Readings::Difference => Err(LaxityError::trial(
            t,
            None,
            format!(
                "an unloaded trial reads {}; in a file of differences it is 0 or empty (are the readings poses?)",
                given.iter().find(|v| **v != 0.0).unwrap_or(&0.0)
            ),
        )),
    }
}

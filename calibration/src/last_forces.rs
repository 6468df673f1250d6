//! Forces of trials that nobody measured, by the final mechanics: samples are asked by the search's, and moved by what that changes of the most probable
//! knee.

use crate::knee::Knee;
use inference::knee::{Trials, models_at};
use sim::laxity::LaxityTrial;
use sim::trials::solve_trials;
use std::ops::Range;

/// Bundle forces of the most probable knee in the trials at `places` by the final mechanics, as `simulate` has them; none where it has no equilibrium.
pub(crate) fn last_forces(knee: &Knee, trials: &Trials, values: &[f64], places: Range<usize>) -> Vec<Option<Vec<f64>>> {
    let asked: Vec<LaxityTrial> = trials.trials[places].iter().map(|t| t.record.clone()).collect();
    let Ok(models) = models_at(&knee.model, &knee.spec, trials.parameters, values) else {
        return vec![None; asked.len()];
    };
    solve_trials(models.shared(), &asked, &knee.options).into_iter().map(|a| a.ok().map(|a| a.forces_n)).collect()
}

/// Bundle forces of a sample in a trial, moved by what the final mechanics change of the most probable knee's.
pub(crate) fn moved(sample: &[f64], mode: &[f64], last: Option<&Vec<f64>>) -> Vec<f64> {
    let Some(last) = last else { return sample.to_vec() };
    sample.iter().zip(mode).zip(last).map(|((f, from), to)| (f + (to - from)).max(0.0)).collect()
}

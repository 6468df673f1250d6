//! Answers of the most probable knee by the final mechanics, as `simulate` gives them: with friction, and with every node of the contact. The search that
//! finds the knee has neither; samples are asked by the search's, and moved by what the final mechanics change of the most probable knee's.

use crate::knee::Knee;
use crate::mechanics::ELSEWHERE;
use inference::knee::{Answers, Trials, models_at};
use nalgebra::DVector;
use sim::SimError;
use sim::coordinate::{FREE, Free};
use sim::laxity::LaxityTrial;
use sim::trials::solve_trials;
use std::collections::BTreeSet;
use std::ops::Range;

/// Bundle forces in the trials at `places`; none where there is no equilibrium.
pub(crate) fn last_forces(knee: &Knee, trials: &Trials, values: &[f64], places: Range<usize>) -> Vec<Option<Vec<f64>>> {
    let asked: Vec<LaxityTrial> = trials.trials[places].iter().map(|t| t.record.clone()).collect();
    let Ok(models) = models_at(&knee.model, &knee.spec, trials.parameters, values) else {
        return vec![None; asked.len()];
    };
    solve_trials(models.shared(), &asked, &knee.options).into_iter().map(|a| a.ok().map(|a| a.forces_n)).collect()
}

/// What the most probable knee reads by the final mechanics in the measured trials.
pub(crate) struct LastReadings {
    /// One for each measured trial, in the frames of its data set; none where there is no equilibrium.
    pub(crate) predicted: Vec<Option<Free<f64>>>,
    /// Those of them whose path ends far from the equilibrium that the search, which begins close by, found.
    pub(crate) elsewhere: Vec<usize>,
}

/// Readings of the first `measured` trials at `z`, of which the search found the equilibria `near`.
///
/// # Errors
/// Values at which there is no knee.
pub(crate) fn last_readings(
    knee: &Knee,
    trials: &Trials,
    z: &DVector<f64>,
    (measured, near): (usize, &Answers),
) -> Result<LastReadings, SimError> {
    let values: Vec<f64> = trials.values(z).into_iter().map(|v| v.0).collect();
    let wanted = trials.trials[..measured].iter().enumerate().flat_map(|(i, t)| std::iter::once(i).chain(t.from));
    let wanted: BTreeSet<usize> = wanted.collect();
    let sources: BTreeSet<Option<usize>> = wanted.iter().map(|&i| trials.trials[i].source).collect();
    let mut poses: Vec<Option<Free<f64>>> = vec![None; trials.trials.len()];
    for source in sources {
        let here: Vec<usize> = wanted.iter().copied().filter(|&i| trials.trials[i].source == source).collect();
        let asked: Vec<LaxityTrial> = here.iter().map(|&i| trials.bearing(&values, &trials.trials[i])).collect();
        let model = knee.model.respecified(&trials.spec_at(z, source)?)?;
        let answers = solve_trials(&model, &asked, &knee.options);
        here.iter().zip(answers).for_each(|(&i, a)| poses[i] = a.ok().map(|a| a.predicted()));
    }
    let reading = |i: usize| {
        let zero = match trials.trials[i].from {
            Some(from) => Some(poses[from]?),
            None => None,
        };
        Some(trials.reading(&values, i, &poses[i]?, zero.as_ref()))
    };
    let is_far =
        |i: usize| poses[i].is_some_and(|p| FREE.into_iter().any(|c| (p[c] - near[i].predicted[c]).abs() > ELSEWHERE));
    let is_elsewhere = |i: usize| is_far(i) || trials.trials[i].from.is_some_and(is_far);
    Ok(LastReadings {
        predicted: (0..measured).map(reading).collect(),
        elsewhere: (0..measured).filter(|&i| is_elsewhere(i)).collect(),
    })
}

/// Bundle forces of a sample in a trial, moved by what the final mechanics change of the most probable knee's.
pub(crate) fn moved(sample: &[f64], mode: &[f64], last: Option<&Vec<f64>>) -> Vec<f64> {
    let Some(last) = last else { return sample.to_vec() };
    sample.iter().zip(mode).zip(last).map(|((f, from), to)| (f + (to - from)).max(0.0)).collect()
}

//! Two trials whose readings fit each other's place: records that were mixed up, which no effect of the knee or the apparatus explains.

use crate::covariance::Readings;
use crate::error::DiscrepancyError;
use crate::fit::Fit;
use crate::problem::{Problem, reading};
use crate::robust::Mixture;
use crate::search::Search;
use nalgebra::DVector;

/// Two trials exchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// The two, by index.
    pub trials: [usize; 2],
    /// Log Bayes factor against the records as they are, as loud as the data may speak, each pair as likely as another [-].
    pub log_bayes_factor: f64,
}

/// The exchange that a fit of the search gains most from, where it sets a trial aside and would set neither aside after. A fit that leaves `loud` times
/// what it should lets the data speak as much less loud: where nothing fits, some pair always fits better than another.
///
/// Errors: a covariance that is not positive definite.
pub fn exchange(
    problem: &Problem,
    search: &Search,
    fit: &Fit,
    loud: f64,
) -> Result<Option<Exchange>, DiscrepancyError> {
    if fit.odd.is_empty() {
        return Ok(None);
    }
    let readings = &search.readings;
    let mixture = Mixture::new(readings, readings.block_of(&search.covariance), &problem.trials)?;
    let rows = rows(readings, problem.trials.len());
    let predicted = predicted(problem, readings, fit)?;
    let now = mixture.weigh(&fit.residual).cost;
    let pairs = (problem.trials.len() * problem.trials.len().saturating_sub(1)) as f64 / 2.0;
    let others = |one: usize| (0..problem.trials.len()).map(move |other| [one, other]);
    let gains = fit.odd.iter().flat_map(|&one| others(one)).filter_map(|trials| {
        let measured = changed(readings, &rows, trials)?;
        let [mut rest, there] = [&predicted.0, &predicted.1].map(|p| &measured - p);
        trials.iter().for_each(|&t| take_the_nearer(&mut rest, &there, &rows[t], &problem.trials[t].sd));
        let exchanged = mixture.weigh(&rest);
        let fits = trials.iter().all(|t| !exchanged.odd.contains(t));
        fits.then_some(Exchange { trials, log_bayes_factor: (now - exchanged.cost) / loud - pairs.ln() })
    });
    Ok(gains.max_by(|a, b| a.log_bayes_factor.total_cmp(&b.log_bayes_factor)))
}

/// What the fit predicts, and what it does where every trial goes the whole way from the unloaded knee. Trials set aside may have been taken next to their
/// measured pose, where the knee does not stay: those go the whole way in both.
fn predicted(
    problem: &Problem,
    readings: &Readings,
    fit: &Fit,
) -> Result<(DVector<f64>, DVector<f64>), DiscrepancyError> {
    let mut here = &readings.measured - &fit.residual;
    let walked = problem.rests(&fit.hypothesis, &fit.unknowns, &[])?;
    let there: Vec<f64> = walked.iter().flat_map(reading).collect();
    let there = readings.pick(&there);
    for (row, (trial, _)) in readings.rows.iter().enumerate() {
        if fit.odd.contains(trial) {
            here[row] = there[row];
        }
    }
    Ok((here, there))
}

/// Another residual of a trial's rows where it is the smaller in noises: what a trial rests at next to one measured pose is not where it does next to another.
fn take_the_nearer(residual: &mut DVector<f64>, other: &DVector<f64>, rows: &[(usize, usize)], sd: &[f64; 5]) {
    let size = |of: &DVector<f64>| rows.iter().map(|&(row, c)| (of[row] / sd[c]).powi(2)).sum::<f64>();
    if size(other) < size(residual) {
        rows.iter().for_each(|&(row, _)| residual[row] = other[row]);
    }
}

/// Rows and coordinates of each trial.
fn rows(readings: &Readings, trials: usize) -> Vec<Vec<(usize, usize)>> {
    let mut out = vec![Vec::new(); trials];
    readings.rows.iter().enumerate().for_each(|(row, &(trial, c))| out[trial].push((row, c)));
    out
}

/// What was measured with two trials exchanged; none where they are one, or have not read the same coordinates.
fn changed(readings: &Readings, rows: &[Vec<(usize, usize)>], [one, other]: [usize; 2]) -> Option<DVector<f64>> {
    let alike = rows[one].iter().map(|r| r.1).eq(rows[other].iter().map(|r| r.1));
    if one == other || !alike {
        return None;
    }
    let mut out = readings.measured.clone();
    rows[one].iter().zip(&rows[other]).for_each(|(a, b)| out.swap_rows(a.0, b.0));
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_rests_that_nearer_in_noises_counts() {
        let mut residual = DVector::from_vec(vec![1.0, 6.0, 3.0]);
        let other = DVector::from_vec(vec![4.0, 0.5, 9.0]);
        take_the_nearer(&mut residual, &other, &[(0, 0), (1, 3)], &[2.0, 1.0, 1.0, 1.0, 1.0]);
        assert_eq!(residual.as_slice(), [4.0, 0.5, 3.0]);
        take_the_nearer(&mut residual, &DVector::from_vec(vec![9.0, 9.0, 9.0]), &[(0, 0)], &[2.0; 5]);
        assert_eq!(residual.as_slice(), [4.0, 0.5, 3.0]);
    }

    #[test]
    fn two_trials_change_places_where_they_read_the_same() {
        let readings = Readings {
            rows: vec![(0, 1), (0, 3), (1, 1), (1, 3), (2, 1)],
            measured: DVector::from_vec(vec![1.0, 2.0, 3.0, 4.0, 5.0]),
        };
        let rows = rows(&readings, 3);
        assert_eq!(changed(&readings, &rows, [0, 1]).unwrap().as_slice(), [3.0, 4.0, 1.0, 2.0, 5.0]);
        assert_eq!(changed(&readings, &rows, [0, 0]), None);
        assert_eq!(changed(&readings, &rows, [0, 2]), None);
    }
}

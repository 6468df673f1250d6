//! Two trials whose readings fit each other's place: records that were mixed up, which no effect of the knee or the apparatus explains.

use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::covariance::Readings;
use crate::problem::outlier::Mixture;
use crate::problem::{Problem, reading};
use crate::search::Search;
use nalgebra::DVector;
use sim::coordinate::{Coordinate, Free};

/// Two trials exchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// The two, by index.
    pub trials: [usize; 2],
    /// Log Bayes factor against the records as they are, of one condition also against one of the two alone in the other's place (a load that was not
    /// reached), as loud as the data may speak, each pair as likely as another [-].
    pub log_bayes_factor: f64,
}

/// The exchange that a fit of the search gains most from, where it sets a trial aside and would set neither aside after. Of one condition both records must
/// ask for it: one that reads what another load asks for, while the record of that load fits its own place, is a load that was not reached, or an outlier.
/// A fit that leaves `loud` times what it should lets the data speak as much less loud: where nothing fits, some pair always fits better than another.
///
/// Errors: a covariance that is not positive definite.
pub fn exchange(problem: &Problem, search: &Search, fit: &Fit, loud: f64) -> Result<Option<Exchange>, DiagnosisError> {
    if fit.outliers.is_empty() {
        return Ok(None);
    }
    let readings = &search.readings;
    let mixture = Mixture::new(readings, readings.block_of(&search.covariance), &problem.trials)?;
    let rows = rows(readings, problem.trials.len());
    let predicted = predicted(problem, readings, fit)?;
    let now = mixture.weigh(&fit.residual).cost;
    let pairs = (problem.trials.len() * problem.trials.len().saturating_sub(1)) as f64 / 2.0;
    let others = |one: usize| (0..problem.trials.len()).map(move |other| [one, other]);
    let gains = fit.outliers.iter().flat_map(|&one| others(one)).filter_map(|trials| {
        let measured = changed(readings, &rows, trials)?;
        let [mut rest, there] = [&predicted.0, &predicted.1].map(|p| &measured - p);
        trials.iter().for_each(|&t| take_the_nearer(&mut rest, &there, &rows[t], &problem.trials[t].sd));
        let exchanged = mixture.weigh(&rest);
        if trials.iter().any(|t| exchanged.outliers.contains(t)) {
            return None;
        }
        let alone = |record| mixture.weigh(&moved(&rest, &fit.residual, &rows, trials, record)).cost;
        let [one, other] = trials.map(|t| problem.trials[t].condition);
        let alone = (one == other).then(|| [alone(0), alone(1)]);
        Some(Exchange { trials, log_bayes_factor: odds(exchanged.cost, now, alone, loud, pairs) })
    });
    Ok(gains.max_by(|a, b| a.log_bayes_factor.total_cmp(&b.log_bayes_factor)))
}

/// What the fit predicts, and what it does where every trial goes the whole way from the unloaded knee. Trials set aside may have been taken next to their
/// measured pose, where the knee does not stay: those go the whole way in both.
fn predicted(
    problem: &Problem,
    readings: &Readings,
    fit: &Fit,
) -> Result<(DVector<f64>, DVector<f64>), DiagnosisError> {
    let mut here = &readings.measured - &fit.residual;
    let walked = problem.rests(&fit.hypothesis, &fit.unknowns, &[])?;
    let there: Vec<f64> = walked.iter().flat_map(reading).collect();
    let there = readings.pick(&there);
    for (row, (trial, _)) in readings.rows.iter().enumerate() {
        if fit.outliers.contains(trial) {
            here[row] = there[row];
        }
    }
    Ok((here, there))
}

/// Log odds of an exchange of one of so many `pairs` by what the records cost exchanged, as they are, and with either alone in the other's place where that
/// may be.
fn odds(exchanged: f64, as_they_are: f64, alone: Option<[f64; 2]>, loud: f64, pairs: f64) -> f64 {
    // of a pair either may be the one: twice as many ways
    let either = alone.into_iter().flatten().map(|cost| (cost - exchanged) / loud + f64::ln(2.0));
    either.fold((as_they_are - exchanged) / loud - pairs.ln(), f64::min)
}

/// What is left where of two exchanged records, whose residuals are `exchanged`, the one alone is in the other's place: the other leaves in its own what it
/// did as things were.
fn moved(
    exchanged: &DVector<f64>,
    as_they_are: &DVector<f64>,
    rows: &[Vec<(usize, Coordinate)>],
    trials: [usize; 2],
    record: usize,
) -> DVector<f64> {
    let [own, taken] = [trials[record], trials[1 - record]];
    let mut out = as_they_are.clone();
    rows[own].iter().zip(&rows[taken]).for_each(|(to, from)| out[to.0] = exchanged[from.0]);
    out
}

/// Another residual of a trial's rows where it is the smaller in noises: what a trial rests at next to one measured pose is not where it does next to another.
fn take_the_nearer(residual: &mut DVector<f64>, other: &DVector<f64>, rows: &[(usize, Coordinate)], sd: &Free<f64>) {
    let size = |of: &DVector<f64>| rows.iter().map(|&(row, c)| (of[row] / sd[c]).powi(2)).sum::<f64>();
    if size(other) < size(residual) {
        rows.iter().for_each(|&(row, _)| residual[row] = other[row]);
    }
}

/// Rows and coordinates of each trial.
fn rows(readings: &Readings, trials: usize) -> Vec<Vec<(usize, Coordinate)>> {
    let mut out = vec![Vec::new(); trials];
    readings.rows.iter().enumerate().for_each(|(row, &(trial, c))| out[trial].push((row, c)));
    out
}

/// What was measured with two trials exchanged; none where they are one, or have not read the same coordinates.
fn changed(readings: &Readings, rows: &[Vec<(usize, Coordinate)>], [one, other]: [usize; 2]) -> Option<DVector<f64>> {
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
    use sim::coordinate::{AP, IE, VV};

    #[test]
    fn of_two_rests_that_nearer_in_noises_counts() {
        let mut residual = DVector::from_vec(vec![1.0, 6.0, 3.0]);
        let other = DVector::from_vec(vec![4.0, 0.5, 9.0]);
        take_the_nearer(&mut residual, &other, &[(0, VV), (1, AP)], &Free([2.0, 1.0, 1.0, 1.0, 1.0]));
        assert_eq!(residual.as_slice(), [4.0, 0.5, 3.0]);
        take_the_nearer(&mut residual, &DVector::from_vec(vec![9.0, 9.0, 9.0]), &[(0, VV)], &Free::all(2.0));
        assert_eq!(residual.as_slice(), [4.0, 0.5, 3.0]);
    }

    #[test]
    fn an_exchange_must_be_likelier_than_either_record_alone_in_the_others_place() {
        // both records ask for it
        assert!((odds(10.0, 40.0, Some([28.0, 26.0]), 1.0, 100.0) - (16.0 + f64::ln(2.0))).abs() < 1e-12);
        // one that lies where the other should, which fits where it is
        assert!(odds(10.0, 25.0, Some([9.0, 30.0]), 1.0, 100.0) < 0.0);
        assert!((odds(10.0, 25.0, None, 1.0, 100.0) - (15.0 - f64::ln(100.0))).abs() < 1e-12);
        // against the records as they are a choice of pairs is paid for
        assert!((odds(10.0, 16.0, Some([40.0, 40.0]), 1.0, 100.0) - (6.0 - f64::ln(100.0))).abs() < 1e-12);
        assert!((odds(10.0, 40.0, Some([50.0, 50.0]), 2.0, 100.0) - (15.0 - f64::ln(100.0))).abs() < 1e-12);
    }

    #[test]
    fn a_record_alone_in_the_others_place_leaves_the_other_in_its_own() {
        let rows = [vec![(0, VV), (1, AP)], vec![(2, VV), (3, AP)]];
        let exchanged = DVector::from_vec(vec![1.0, 2.0, 3.0, 4.0]);
        let as_they_are = DVector::from_vec(vec![10.0, 20.0, 30.0, 40.0]);
        // the first record's residual in the second's place stands in the second's rows
        assert_eq!(moved(&exchanged, &as_they_are, &rows, [0, 1], 0).as_slice(), [3.0, 4.0, 30.0, 40.0]);
        assert_eq!(moved(&exchanged, &as_they_are, &rows, [0, 1], 1).as_slice(), [10.0, 20.0, 1.0, 2.0]);
    }

    #[test]
    fn two_trials_change_places_where_they_read_the_same() {
        let readings = Readings {
            rows: vec![(0, IE), (0, AP), (1, IE), (1, AP), (2, IE)],
            measured: DVector::from_vec(vec![1.0, 2.0, 3.0, 4.0, 5.0]),
        };
        let rows = rows(&readings, 3);
        assert_eq!(changed(&readings, &rows, [0, 1]).unwrap().as_slice(), [3.0, 4.0, 1.0, 2.0, 5.0]);
        assert_eq!(changed(&readings, &rows, [0, 0]), None);
        assert_eq!(changed(&readings, &rows, [0, 2]), None);
    }
}

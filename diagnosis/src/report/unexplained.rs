//! Where no effect of the catalogue is enough: whether the data sets agree with each other, and what each effect by itself would explain.

use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::covariance::Readings;
use crate::problem::outlier::Mixture;
use crate::problem::trial::row_of;
use crate::report::against::{as_the_answer, is_believed};
use crate::report::verdict::temper;
use crate::report::{DataSetAlone, Left, Tried, Unexplained, named};
use crate::search::contradiction::witness;
use crate::search::held_out::{HeldOut, closed, held_out};
use crate::search::{Search, Searcher, TRIES};

/// Rows whose share is asked on held-out trials, too, the likeliest first [-]: five effects and three pairs. Each costs a refit a fold. A row that earns
/// nothing is not asked; one that earns a name always is, for what stands against it takes that share.
const HELD_OUT: usize = 8;
/// Readings told that the best leaves most of, one a trial [-].
const LEFT: usize = 5;

/// Why nothing is named, where each effect was tried by itself; `before` is the score of nothing missing on held-out trials, `exchanged` the log Bayes
/// factor of two records exchanged.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn unexplained(
    searcher: &Searcher,
    search: &Search,
    (before, exchanged): (&HeldOut, f64),
    each: Option<&[Fit]>,
) -> Result<Option<Unexplained>, DiagnosisError> {
    let Some(each) = each else { return Ok(None) };
    let (data_sets, two_knees) = alone(searcher, search)?;
    let tried = tried(searcher, search, (before, exchanged), each)?;
    Ok(Some(Unexplained { data_sets, two_knees, tried, left: left(searcher, search) }))
}

/// The readings that the best leaves most of, one a trial, the furthest off first.
fn left(searcher: &Searcher, search: &Search) -> Vec<Left> {
    let best = search.rivals.first().unwrap_or(&search.base);
    let rows = search.readings.rows.iter().zip(best.residual.iter());
    let mut all: Vec<(usize, f64, Left)> = rows
        .zip(search.readings.measured.iter())
        .map(|((&(trial, dof), off), value)| {
            let at = row_of(trial, dof);
            let z = off / search.covariance[(at, at)].sqrt();
            let reading = witness(searcher.problem, trial, *value);
            (trial, z.abs(), Left { dof: dof.name().to_owned(), reading, expected: best.linear.value[at], z })
        })
        .collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut seen: Vec<usize> = Vec::new();
    all.retain(|(trial, _, _)| {
        let is_new = !seen.contains(trial);
        seen.push(*trial);
        is_new
    });
    all.into_iter().take(LEFT).map(|(_, _, left)| left).collect()
}

/// Each data set with a knee of its own.
fn alone(searcher: &Searcher, search: &Search) -> Result<(Vec<DataSetAlone>, Option<f64>), DiagnosisError> {
    let (problem, base) = (searcher.problem, &search.base);
    let best = search.rivals.first().unwrap_or(base);
    let mut out = Vec::new();
    let mut evidence = 0.0;
    if problem.sources.len() < 2 {
        return Ok((out, None));
    }
    for (s, source) in problem.sources.iter().enumerate() {
        let readings = Readings::of(problem, &|i| problem.trials[i].source == Some(s));
        if readings.rows.is_empty() {
            continue;
        }
        let rests = base.coordinates();
        let of = |from: &[f64]| searcher.fit(&[], from, &rests, &search.covariance, &readings, TRIES);
        let [one, other] = [of(&base.unknowns)?, of(&problem.nuisance.given)?];
        let own = if other.log_evidence > one.log_evidence { other } else { one };
        let own = searcher.led_on(search, own, &readings)?;
        let count = readings.rows.len();
        let mixture = Mixture::new(&readings, readings.block_of(&search.covariance), &problem.trials)?;
        let left_by = |fit: &Fit| {
            let shared = &readings.measured - readings.pick(&fit.linear.value);
            2.0 * mixture.weigh(&shared).cost / count as f64
        };
        evidence += own.log_evidence;
        out.push(DataSetAlone {
            source: source.clone(),
            readings: count,
            alone: own.misfit / count as f64,
            cost: problem.nuisance.squares(&own.unknowns) / count as f64,
            together: left_by(base),
            with_best: Some(left_by(best)),
        });
    }
    Ok((out, Some(evidence - base.log_evidence)))
}

/// Each effect by itself, and what was found together, each asked as if it were the answer.
fn tried(
    searcher: &Searcher,
    search: &Search,
    (before, exchanged): (&HeldOut, f64),
    each: &[Fit],
) -> Result<Vec<Tried>, DiagnosisError> {
    let mut fits = each.to_vec();
    if let Some(found) = search.rivals.iter().find(|f| f.hypothesis.len() > 1) {
        let is_it = |f: &Fit| {
            f.hypothesis.len() == found.hypothesis.len() && f.hypothesis.iter().all(|c| found.hypothesis.contains(c))
        };
        fits.retain(|f| !is_it(f));
        fits.push(found.clone());
    }
    fits.sort_by(|a, b| searcher.gain(b, &search.base).total_cmp(&searcher.gain(a, &search.base)));
    let folds = searcher.options.folds;
    let one = |(k, fit): (usize, &Fit)| {
        let is_asked = k < HELD_OUT || is_believed(searcher, search, fit);
        let unseen = if is_asked && searcher.gain(fit, &search.base) > 0.0 {
            Some(closed(before, &held_out(searcher, &search.covariance, fit, folds, folds)?))
        } else {
            None
        };
        Ok(Tried {
            effects: named(searcher.problem, fit, temper(searcher, fit)),
            closes: searcher.closes(fit, &search.base),
            closes_held_out: unseen,
            leaves: Some(searcher.total(fit) / fit.residual.len() as f64),
            log_bayes_factor: searcher.gain(fit, &search.base),
            against: as_the_answer(searcher, search, fit, (unseen.unwrap_or(0.0), exchanged))?,
        })
    };
    fits.iter().enumerate().map(one).collect()
}

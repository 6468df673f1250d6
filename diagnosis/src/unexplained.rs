//! Where no effect of the catalogue is enough: whether the data sets agree with each other, and what each effect by itself would explain.

use crate::covariance::Readings;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::held_out::{HeldOut, closed, held_out};
use crate::outlier::Mixture;
use crate::report::{DataSetAlone, Tried, Unexplained, named};
use crate::search::{Search, Searcher, TRIES};
use crate::verdict::temper;

/// Rows whose share is asked on held-out trials, too, the likeliest first [-]: five effects and three pairs. Each costs a refit a fold. A row that earns
/// nothing is not asked.
const HELD_OUT: usize = 8;

/// Why nothing is named, where each effect was tried by itself; `before` is the score of nothing missing on held-out trials.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn unexplained(
    searcher: &Searcher,
    search: &Search,
    before: &HeldOut,
    each: Option<&[Fit]>,
) -> Result<Option<Unexplained>, DiagnosisError> {
    let Some(each) = each else { return Ok(None) };
    let (data_sets, two_knees) = alone(searcher, search)?;
    Ok(Some(Unexplained { data_sets, two_knees, tried: tried(searcher, search, before, each)? }))
}

/// Each data set with a knee of its own.
fn alone(searcher: &Searcher, search: &Search) -> Result<(Vec<DataSetAlone>, Option<f64>), DiagnosisError> {
    let (problem, base) = (searcher.problem, &search.base);
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
        let shared = &readings.measured - readings.pick(&base.linear.value);
        evidence += own.log_evidence;
        out.push(DataSetAlone {
            source: source.clone(),
            readings: count,
            alone: own.misfit / count as f64,
            cost: problem.nuisance.squares(&own.unknowns) / count as f64,
            together: 2.0 * mixture.weigh(&shared).cost / count as f64,
        });
    }
    Ok((out, Some(evidence - base.log_evidence)))
}

/// Each effect by itself, and what was found together.
fn tried(searcher: &Searcher, search: &Search, before: &HeldOut, each: &[Fit]) -> Result<Vec<Tried>, DiagnosisError> {
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
        let unseen = if k < HELD_OUT && searcher.gain(fit, &search.base) > 0.0 {
            Some(closed(before, &held_out(searcher, &search.covariance, fit, folds, folds)?))
        } else {
            None
        };
        Ok(Tried {
            effects: named(searcher.problem, fit, temper(searcher, fit)),
            closes: searcher.closes(fit, &search.base),
            closes_held_out: unseen,
            log_bayes_factor: searcher.gain(fit, &search.base),
        })
    };
    fits.iter().enumerate().map(one).collect()
}

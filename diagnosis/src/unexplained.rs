//! Where no effect of the catalogue is enough: whether the data sets agree with each other, and what each effect by itself would explain.

use crate::covariance::Readings;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::held_out::{HeldOut, closed, held_out};
use crate::report::{Named, Verdict, named};
use crate::robust::Mixture;
use crate::search::{Search, Searcher, TRIES};
use crate::verdict::temper;
use serde::{Deserialize, Serialize};

/// Effects whose share is asked on held-out trials, too, the likeliest first [-]: each costs a refit a fold.
const HELD_OUT: usize = 5;

/// What a knee leaves of one data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DataSetAlone {
    /// Data set.
    pub source: String,
    /// Its readings [-].
    pub readings: usize,
    /// Sum of squares that a knee of its own leaves of it, over the number of readings: 1 or less where it fits [-].
    pub alone: f64,
    /// What the ligaments, sites and frames of that knee cost, by their priors, over the same number [-].
    pub cost: f64,
    /// What the one knee of all data sets leaves of it [-].
    pub together: f64,
}

/// What the best fit of an effect, or of several, explains.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tried {
    /// The effects.
    pub effects: Vec<Named>,
    /// Share that it closes of what recalibrated ligaments leave beyond noise [-].
    pub closes: f64,
    /// The same on trials that it was not fitted to; of the likeliest alone [-].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub closes_held_out: Option<f64>,
    /// Log Bayes factor against nothing missing [-].
    pub log_bayes_factor: f64,
}

/// Why nothing is named.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Unexplained {
    /// What a knee leaves of each data set; empty where there is one alone.
    pub data_sets: Vec<DataSetAlone>,
    /// Log odds for a knee of its own in each data set against one knee in all [nats].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_knees: Option<f64>,
    /// Each effect of the catalogue, fitted from both ends, and the best that was found together; the likeliest first.
    pub tried: Vec<Tried>,
}

/// Why nothing is named, where the verdict is that; `before` is the score of nothing missing on held-out trials.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn unexplained(
    searcher: &Searcher,
    search: &Search,
    before: &HeldOut,
    verdict: Verdict,
) -> Result<Option<Unexplained>, DiagnosisError> {
    if verdict != Verdict::Unnamed {
        return Ok(None);
    }
    let (data_sets, two_knees) = alone(searcher, search)?;
    Ok(Some(Unexplained { data_sets, two_knees, tried: tried(searcher, search, before)? }))
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
        let readings = Readings::of(problem, &|i| problem.trials[i].source == s);
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
fn tried(searcher: &Searcher, search: &Search, before: &HeldOut) -> Result<Vec<Tried>, DiagnosisError> {
    let mut fits = searcher.each_effect(search)?;
    fits.extend(search.rivals.first().filter(|f| f.hypothesis.len() > 1).cloned());
    fits.sort_by(|a, b| searcher.gain(b, &search.base).total_cmp(&searcher.gain(a, &search.base)));
    let folds = searcher.options.folds;
    let one = |(k, fit): (usize, &Fit)| {
        let unseen = if k < HELD_OUT {
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

//! Measurement noise as the data have it: what a file states is a prior.
//!
//! Only what is rough along a loading speaks: of each condition the mean and the slope along the load are taken off, so that neither repositioning nor a
//! missing effect passes for noise ([`inference::noise::contrasts`]). A data set with one load a condition keeps what its file states.
//! Another scale is taken where it gains more than [`OTHER_NOISE`].

use crate::criteria::OTHER_NOISE;
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::problem::trial::{NoiseScale, row_of};
use inference::noise::contrasts::{self, Contrast};
use nalgebra::{DMatrix, DVector};
use sim::coordinate::{Coordinate, FREE};

/// Fewest readings of a condition that leave a difference beside their mean and slope.
const LEAST_READINGS: usize = 3;

/// Scales of the stated noise, from `residual` (measured minus predicted) with its `covariance` (five rows a trial).
pub(crate) fn scales(
    problem: &Problem,
    readings: &Readings,
    residual: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Vec<NoiseScale> {
    let mut out = Vec::new();
    for (s, source) in problem.sources.iter().enumerate() {
        for c in FREE {
            let own: Vec<f64> = problem.trials.iter().filter(|t| t.source == Some(s)).map(|t| t.sd[c]).collect();
            if own.is_empty() {
                continue;
            }
            let stated = own.iter().sum::<f64>() / own.len() as f64;
            let found = contrasts::scale(&differences(problem, readings, (residual, covariance), (s, c)));
            out.push(NoiseScale {
                source: source.clone(),
                coordinate: c.name().to_owned(),
                stated,
                inferred: stated * found.scale,
                lower: stated * found.interval.0,
                upper: stated * found.interval.1,
                taken: found.gain > OTHER_NOISE,
            });
        }
    }
    out
}

/// Differences of coordinate `c` in the conditions of data set `s`.
fn differences(
    problem: &Problem,
    readings: &Readings,
    (residual, covariance): (&DVector<f64>, &DMatrix<f64>),
    (s, c): (usize, Coordinate),
) -> Vec<Contrast> {
    let conditions = problem.trials.iter().map(|t| t.condition).max().map_or(0, |c| c + 1);
    let mut out = Vec::new();
    for condition in 0..conditions {
        let is_of = |i: usize, d: Coordinate| {
            d == c && problem.trials[i].source == Some(s) && problem.trials[i].condition == condition
        };
        let rows: Vec<usize> =
            readings.rows.iter().enumerate().filter(|(_, at)| is_of(at.0, at.1)).map(|(r, _)| r).collect();
        let n = rows.len();
        if n < LEAST_READINGS {
            continue;
        }
        let trial = |k: usize| &problem.trials[readings.rows[rows[k]].0];
        let load = |k: usize| trial(k).load().iter().map(|l| l * l).sum::<f64>().sqrt();
        let smooth = DMatrix::from_fn(n, 2, |k, column| if column == 0 { 1.0 } else { load(k) });
        let at = |k: usize| row_of(readings.rows[rows[k]].0, c);
        let of_rows = DMatrix::from_fn(n, n, |a, b| covariance[(at(a), at(b))]);
        let residual = DVector::from_fn(n, |k, _| residual[rows[k]]);
        let sd: Vec<f64> = (0..n).map(|k| trial(k).sd[c]).collect();
        out.extend(contrasts::contrasts(smooth, &residual, &sd, &of_rows));
    }
    out
}

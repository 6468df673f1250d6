//! Measurement noise as the data have it: what a file states is a prior.
//!
//! Only what is rough along a loading speaks: of each condition the mean and the slope along the load are taken off, so that neither repositioning nor a
//! missing effect passes for noise. A data set with one load a condition keeps what its file states.

use crate::criteria::OTHER_NOISE;
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::problem::trial::{NoiseScale, row_of};
use nalgebra::{DMatrix, DVector};
use sim::coordinate::{Coordinate, FREE};

/// Standard deviation of the log of a scale before the data: twice or half the stated noise is one away. A calibration believes more in what is stated
/// ([`inference::noise`]); here that has the benefit of the doubt in [`OTHER_NOISE`].
const PRIOR_LOG_SD: f64 = std::f64::consts::LN_2;
/// Probability and width of outliers among the differences [-]: as wide as a trial's ([`crate::problem::outlier`]), twice as many.
const OUTLIERS: (f64, f64) = (0.02, 100.0);
/// Logs of scales that are tried, from a third to twenty times [-].
const GRID: (f64, f64, usize) = (-1.1, 3.0, 165);

/// A difference along a loading: its value, its variance by the stated noise and by all else.
struct Contrast {
    value: f64,
    noise: f64,
    other: f64,
}

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
            let found = scale(&contrasts(problem, readings, (residual, covariance), (s, c)));
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
fn contrasts(
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
        if n < 3 {
            continue;
        }
        let load = |r: usize| problem.trials[readings.rows[r].0].load().iter().map(|l| l * l).sum::<f64>().sqrt();
        let smooth = DMatrix::from_fn(n, 2, |k, col| if col == 0 { 1.0 } else { load(rows[k]) });
        // directions across the mean and the slope: eigenvectors of the projection that takes both off
        let q = smooth.qr().q();
        let off = DMatrix::identity(n, n) - &q * q.transpose();
        let eigen = off.symmetric_eigen();
        let at = |k: usize| row_of(readings.rows[rows[k]].0, c);
        for way in (0..n).filter(|&k| eigen.eigenvalues[k] > 0.5) {
            let v = eigen.eigenvectors.column(way);
            let noise: f64 = (0..n).map(|k| (v[k] * problem.trials[readings.rows[rows[k]].0].sd[c]).powi(2)).sum();
            let all: f64 = (0..n)
                .flat_map(|a| (0..n).map(move |b| (a, b)))
                .map(|(a, b)| v[a] * v[b] * covariance[(at(a), at(b))])
                .sum();
            let value = (0..n).map(|k| v[k] * residual[rows[k]]).sum();
            out.push(Contrast { value, noise, other: (all - noise).max(0.0) });
        }
    }
    out
}

/// A scale with its 90 % interval and its log likelihood ratio against 1.
struct Scale {
    scale: f64,
    interval: (f64, f64),
    gain: f64,
}

/// The most probable scale of the noise in some differences.
fn scale(contrasts: &[Contrast]) -> Scale {
    let density = |x: f64, variance: f64| (-0.5 * x * x / variance).exp() / variance.sqrt();
    let log = |u: f64| -> f64 {
        let (share, wider) = OUTLIERS;
        let one = |c: &Contrast| {
            let v = (2.0 * u).exp() * c.noise + c.other;
            ((1.0 - share) * density(c.value, v) + share * density(c.value, wider * v)).max(1e-300).ln()
        };
        contrasts.iter().map(one).sum::<f64>()
    };
    let (low, high, steps) = GRID;
    let at = |k: usize| low + (high - low) * k as f64 / (steps - 1) as f64;
    let posterior: Vec<f64> = (0..steps).map(|k| log(at(k)) - 0.5 * (at(k) / PRIOR_LOG_SD).powi(2)).collect();
    let best = (0..steps).max_by(|&a, &b| posterior[a].total_cmp(&posterior[b])).unwrap_or(0);
    let weights: Vec<f64> = posterior.iter().map(|p| (p - posterior[best]).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let quantile = |share: f64| {
        let mut left = share * sum;
        let k = weights.iter().position(|w| {
            left -= w;
            left <= 0.0
        });
        at(k.unwrap_or(steps - 1)).exp()
    };
    let gain = if contrasts.is_empty() { 0.0 } else { log(at(best)) - log(0.0) };
    Scale { scale: at(best).exp(), interval: (quantile(0.05), quantile(0.95)), gain }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_scale_is_found_from_rough_differences_and_without_them_the_stated_one_stays() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut drawn = |scale: f64| -> Vec<Contrast> {
            let one = |_| Contrast {
                value: scale * 0.5 * crate::problem::covariance::normal(&mut random),
                noise: 0.25,
                other: 0.01,
            };
            (0..40).map(one).collect()
        };
        let found = scale(&drawn(4.0));
        assert!(found.gain > 20.0 && (3.0..5.3).contains(&found.scale), "{}", found.scale);
        assert!(found.interval.0 < 4.0 && found.interval.1 > 4.0);
        let found = scale(&drawn(1.0));
        assert!(found.gain < OTHER_NOISE && (0.7..1.4).contains(&found.scale), "{}", found.scale);
        let nothing = scale(&[]);
        assert!(nothing.gain == 0.0 && (nothing.scale - 1.0).abs() < 0.03 && nothing.interval.1 > 2.0);
        // one outlier makes no noise
        let mut jumped = drawn(1.0);
        jumped[3].value = 9.0;
        assert!(scale(&jumped).gain < OTHER_NOISE);
    }
}

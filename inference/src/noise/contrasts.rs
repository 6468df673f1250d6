//! The scale of the noise where a model may lack something: what is rough along a loading speaks alone.
//!
//! [`Likelihood::infer_scales`](super::Likelihood::infer_scales) integrates over the parameters of a model that is believed to hold all there is. What
//! such a model lacks would pass for noise. A search for what it lacks cannot use that. So of each run of readings the smooth part is taken off, whatever
//! makes it, and the rest is compared with what is stated. This is restricted maximum likelihood too [gilmour1995], with the smooth part as what is
//! unknown. Two scales are compared, so outliers have a density: they are a mixture, not a bound.

use nalgebra::{DMatrix, DVector};

/// Standard deviation of the log of a scale before the data: twice or half the stated noise is one away. It is wider than an inference's, since few
/// differences speak; a caller asks for a clear gain before it takes another scale than the stated one.
const PRIOR_LOG_SD: f64 = std::f64::consts::LN_2;
/// Probability of outliers among the differences [-], and their variance over that of others [-]: ten times as wide [box1968]. They are twice as many as
/// among trials, since a difference holds several readings.
const OUTLIERS: (f64, f64) = (0.02, 100.0);
/// Logs of scales that are tried, from a third to twenty times [-].
const GRID: (f64, f64, usize) = (-1.1, 3.0, 165);
/// Eigenvalues of a projection are 0 or 1; this parts them [-].
const IS_KEPT: f64 = 0.5;

/// A difference of readings across what is smooth.
#[derive(Clone, Copy, Debug)]
pub struct Contrast {
    /// Its value.
    pub value: f64,
    /// Its variance by the stated noise.
    pub noise: f64,
    /// Its variance by all else.
    pub other: f64,
}

/// Differences of some readings across the columns of `smooth`, a row a reading; `residual` scatters by `sd` each by itself, by `covariance` in all.
pub fn contrasts(
    smooth: DMatrix<f64>,
    residual: &DVector<f64>,
    sd: &[f64],
    covariance: &DMatrix<f64>,
) -> Vec<Contrast> {
    let n = sd.len();
    // directions across the smooth ones: eigenvectors of the projection that takes those off
    let q = smooth.qr().q();
    let off = DMatrix::identity(n, n) - &q * q.transpose();
    let eigen = off.symmetric_eigen();
    let of = |way: usize| {
        let v = eigen.eigenvectors.column(way);
        let noise: f64 = (0..n).map(|k| (v[k] * sd[k]).powi(2)).sum();
        let all: f64 =
            (0..n).flat_map(|a| (0..n).map(move |b| (a, b))).map(|(a, b)| v[a] * v[b] * covariance[(a, b)]).sum();
        Contrast { value: (0..n).map(|k| v[k] * residual[k]).sum(), noise, other: (all - noise).max(0.0) }
    };
    (0..n).filter(|&k| eigen.eigenvalues[k] > IS_KEPT).map(of).collect()
}

/// A scale with its 90 % interval and its log likelihood ratio against 1.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// The scale [-].
    pub scale: f64,
    /// Ends of its interval [-].
    pub interval: (f64, f64),
    /// The log likelihood ratio [nats].
    pub gain: f64,
}

/// The most probable scale of the noise in some differences.
pub fn scale(contrasts: &[Contrast]) -> Scale {
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
    use crate::random::{normal, stream};

    /// A gain that a diagnosis calls clear [nats].
    const CLEAR: f64 = 3.0;

    #[test]
    fn a_scale_is_found_from_rough_differences_and_without_them_the_stated_one_stays() {
        let mut random = stream(4, 0);
        let mut drawn = |scale: f64| -> Vec<Contrast> {
            let one = |_| Contrast { value: scale * 0.5 * normal(&mut random), noise: 0.25, other: 0.01 };
            (0..40).map(one).collect()
        };
        let found = scale(&drawn(4.0));
        assert!(found.gain > 20.0 && (3.0..5.3).contains(&found.scale), "{}", found.scale);
        assert!(found.interval.0 < 4.0 && found.interval.1 > 4.0);
        let found = scale(&drawn(1.0));
        assert!(found.gain < CLEAR && (0.7..1.4).contains(&found.scale), "{}", found.scale);
        let nothing = scale(&[]);
        assert!(nothing.gain == 0.0 && (nothing.scale - 1.0).abs() < 0.03 && nothing.interval.1 > 2.0);
        // one outlier makes no noise
        let mut jumped = drawn(1.0);
        jumped[3].value = 9.0;
        assert!(scale(&jumped).gain < CLEAR);
    }

    #[test]
    fn what_is_smooth_along_a_load_is_no_noise_however_large_it_is() {
        let (n, mut random) = (12, stream(5, 0));
        let noise = DVector::from_fn(n, |_, _| 0.5 * normal(&mut random));
        let smooth = DMatrix::from_fn(n, 2, |k, c| if c == 0 { 1.0 } else { k as f64 });
        let covariance = DMatrix::identity(n, n) * 0.25;
        let of = |residual: &DVector<f64>| contrasts(smooth.clone(), residual, &vec![0.5; n], &covariance);
        let plain = of(&noise);
        let lacking = of(&(&noise + smooth.column(1) * 3.0 + smooth.column(0) * 7.0));
        assert_eq!(plain.len(), n - 2);
        assert!(plain.iter().zip(&lacking).all(|(a, b)| (a.value - b.value).abs() < 1e-9));
        assert!(plain.iter().all(|c| (c.noise - 0.25).abs() < 1e-9 && c.other < 1e-9));
        let squares: f64 = plain.iter().map(|c| c.value * c.value).sum();
        assert!(squares <= noise.norm_squared() && squares > 0.0);
    }
}

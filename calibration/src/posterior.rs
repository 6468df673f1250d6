//! What the data determine: intervals of parameters and bundle forces, and how much narrower they are than the ranges alone would have
//! them.

pub(crate) mod share;

use self::share::{Removed, Spread};
use crate::cost::FAILED;
use crate::design::{Design, Kind};
use crate::error::CalibrationError;
use crate::experiment::Experiment;
use crate::options::IntervalOptions;
use crate::problem::Probes;
use crate::problem::Problem;
use inference::parameter::Prior;
use inference::random::{normal, stream};
use nalgebra::DVector;
use notices::Notice;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::coordinate::Free;

/// Points of the posterior and of the prior, unit coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Samples of the posterior.
    pub samples: Vec<Vec<f64>>,
    /// Points spread evenly over the ranges.
    pub prior: Vec<Vec<f64>>,
    /// Factor of the noise, a coordinate each [-].
    pub noise_scale: Free<f64>,
    /// What other starts found, lowest cost first.
    pub rivals: Vec<(f64, Vec<f64>)>,
    /// What is odd.
    pub warnings: Vec<Notice>,
}

/// A design variable after a calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterEstimate {
    /// The n of X_n.
    pub number: u32,
    /// Its bundle, or the ligament that shares it.
    pub bundle: String,
    /// Which number of the bundle.
    pub kind: Kind,
    /// The value chosen [- or N/mm].
    pub value: f64,
    /// Lower end of its interval.
    pub lower: f64,
    /// Upper end of its interval.
    pub upper: f64,
    /// The range it was sought in.
    pub range: [f64; 2],
    /// Share of the variance with nothing measured that the data removed, 0 (no more than chance may give) to 1 (determined) [-]; by the recipes of
    /// the range's, cut off at 0.
    pub determined: f64,
}

/// A bundle's force in a probe trial after a calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForceEstimate {
    /// The trial.
    pub trial: String,
    /// Index of the bundle.
    pub bundle: usize,
    /// The least wrong number to tell [N]: the mean over the samples; of the recipes, and where no samples count, that of the values chosen. `None` where
    /// the trial has no answer there.
    pub value_n: Option<f64>,
    /// Mean over the samples that count ([`crate::plateau`]) [N]; `None` where none do.
    pub mean_n: Option<f64>,
    /// Of the single most probable model, or of the values chosen [N].
    pub mode_n: Option<f64>,
    /// Ends of its interval [N]; `None` where more than half of the samples leave the plateau, and of fewer than two samples.
    pub interval_n: Option<[f64; 2]>,
    /// Samples whose femur leaves the plateau in the trial, which do not count; 0 by the recipes, which do not look.
    pub leaving: usize,
    /// Share of the variance with nothing measured which the data removed, 0 to 1 [-]: of all that is believed before, by an inference; of parameters
    /// spread over their ranges, by the recipes. 0 where chance alone may give as much, by so few samples.
    pub determined: f64,
    /// The same share as the samples have it, below zero where the variance has grown [-]; `None` where there is nothing to compare.
    #[serde(default)]
    pub removed: Option<f64>,
    /// Share of the parameters' own variance which beliefs about forces removed before anything was measured, 0 to 1 [-]; 0 by the recipes, and where
    /// chance alone may give as much.
    pub believed: f64,
    /// Mean and ends of the interval with nothing measured [N]; `None` by the recipes and without samples.
    pub unmeasured: Option<[f64; 3]>,
}

/// A number of the knee that is no ligament's, after a calibration: of a frame, of the contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OtherEstimate {
    /// Its name: `tibia.anterior.shift_mm`, `kla.femur.medial.turn_deg`, `contact.scale`.
    pub name: String,
    /// The value chosen.
    pub value: f64,
    /// Lower end of its interval.
    pub lower: f64,
    /// Upper end of its interval.
    pub upper: f64,
    /// Interval of the same probability before anything was measured.
    pub prior: [f64; 2],
    /// Share of the prior's variance that the data removed [-]; 0 where chance alone may give as much.
    pub determined: f64,
    /// How far the value lies from its prior's middle, in the prior's standard deviations [-].
    #[serde(default)]
    pub z: f64,
}

impl OtherEstimate {
    /// A warning where it lies outside the interval it had before.
    pub fn outside_prior(&self) -> Option<Notice> {
        let outside = self.value < self.prior[0] || self.value > self.prior[1];
        // without samples its interval is still the prior's
        let interval = match [self.lower, self.upper] == self.prior {
            true => String::new(),
            false => format!(" ({:.2} to {:.2})", self.lower, self.upper),
        };
        outside.then(|| {
            notices::Kind::OutsidePrior
                .notice(format!(
                    "{} is {:.2}{interval}, expected {:.2} to {:.2} before anything was measured",
                    self.name, self.value, self.prior[0], self.prior[1]
                ))
                .of(&self.name)
        })
    }
}

/// Noise of a coordinate of a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NoiseEstimate {
    /// The data set.
    pub source: String,
    /// The coordinate with its unit.
    pub coordinate: String,
    /// Standard deviation as the file states it.
    pub stated: f64,
    /// As the data have it.
    pub inferred: f64,
    /// Lower end of its interval.
    pub lower: f64,
    /// Upper end of its interval.
    pub upper: f64,
}

/// Times the noise in which readings miss, root mean square, beyond which most count as outliers to it [-]; ours: repositioning and loads make up to
/// five on knees that are met.
const OUTLYING: f64 = 20.0;

impl NoiseEstimate {
    /// What is told where readings miss by `rms` in the root mean square, and that is far more than their noise was found to be.
    pub fn outlying(&self, rms: f64) -> Option<Notice> {
        (rms > OUTLYING * self.inferred).then(|| {
            notices::Kind::NoiseStated
                .notice(format!(
                    "{}: {} misses by {rms:.2}, and its noise is found to be {}: most readings count as outliers. {} was stated; state what they scatter by, or leave it out",
                    self.source,
                    self.coordinate,
                    in_digits(self.inferred),
                    in_digits(self.stated)
                ))
                .of(&self.source)
                .column(&self.coordinate)
        })
    }

    /// What is told where the interval does not hold what is stated, by a factor of 1.5 or more.
    pub fn not_as_stated(&self, interval: f64) -> Option<Notice> {
        let off = self.stated < self.lower || self.stated > self.upper;
        let far = self.inferred > 1.5 * self.stated || self.inferred < self.stated / 1.5;
        (off && far).then(|| {
            notices::Kind::NoiseStated
                .notice(format!(
                    "{}: {} scatters by {:.2} ({:.2} to {:.2}, {:.0} %), {} was taken",
                    self.source,
                    self.coordinate,
                    self.inferred,
                    self.lower,
                    self.upper,
                    100.0 * interval,
                    in_digits(self.stated)
                ))
                .of(&self.source)
                .column(&self.coordinate)
        })
    }
}

/// A noise in words: with two digits after the point, and as a power of ten where these would be zeros.
fn in_digits(noise: f64) -> String {
    if noise < 0.01 { format!("{noise:.1e}") } else { format!("{noise:.2}") }
}

/// Tension of all ligaments together at rest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RestEstimate {
    /// Flexion [deg].
    pub fe_deg: f64,
    /// Mean over the samples that count ([`crate::plateau`]) [N]; of the single most probable model where none do.
    pub value_n: f64,
    /// Ends of its interval [N]; `None` where more than half of the samples leave the plateau, and of fewer than two samples.
    pub interval_n: Option<[f64; 2]>,
    /// Of the single most probable model [N].
    pub mode_n: f64,
    /// Samples whose femur leaves the plateau, which do not count.
    pub leaving: usize,
}

/// Whether a value lies outside an interval by what a table shows.
pub fn is_outside(value: f64, [lower, upper]: [f64; 2]) -> bool {
    value < lower - SHOWN || value > upper + SHOWN
}

/// Tables have three digits after the point [N, deg, mm].
const SHOWN: f64 = 1e-3;

/// A force whose interval reaches no further than this from its value is called determined [N].
pub const FORCE_DETERMINED_N: f64 = 15.0;

impl ForceEstimate {
    /// Whether there is an interval of less scatter than with nothing measured, and it stays within [`FORCE_DETERMINED_N`] of the value.
    pub fn is_determined(&self) -> bool {
        let near = |end: f64| self.value_n.is_some_and(|v| (end - v).abs() <= FORCE_DETERMINED_N);
        self.removed.unwrap_or(self.determined) > 0.0 && self.interval_n.is_some_and(|ends| ends.into_iter().all(near))
    }

    /// Whether the single most probable model lies outside the interval of the samples: it is one knee, and no middle of theirs.
    pub fn mode_is_outside(&self) -> bool {
        self.mode_n.zip(self.interval_n).is_some_and(|(mode, interval)| is_outside(mode, interval))
    }

    /// Upper end of the interval, or the value where there is none [N].
    pub fn most_n(&self) -> f64 {
        self.interval_n.map_or(self.value_n.unwrap_or(0.0), |i| i[1])
    }
}

/// Laplace's approximation [tierney1986] at the point of lowest cost: a normal posterior from the solver's derivatives there, cut off at the
/// ranges.
///
/// # Errors
/// Noise that cannot be inferred.
pub fn of_recipe(
    problem: &Problem,
    point: &[f64],
    rivals: Vec<(f64, Vec<f64>)>,
    options: &IntervalOptions,
    seed: u64,
) -> Result<Found, CalibrationError> {
    let n = point.len();
    let noise_scale = if options.scale_noise { problem.noise_scale(point)? } else { Free::all(1.0) };
    let prior: Vec<Vec<f64>> = (0..options.samples).map(|s| prior_point(seed, s, n)).collect();
    let rivals = rivals.into_iter().filter(|r| r.0 < FAILED).collect();
    let chol = problem.jacobian(point, &noise_scale).and_then(|j| j.tr_mul(&j).cholesky());
    let Some(chol) = chol else {
        let warnings =
            vec![notices::Kind::NoDerivatives.notice("the solver has no derivatives at the best point: no intervals")];
        return Ok(Found { samples: vec![], prior, noise_scale, rivals, warnings });
    };
    let mut random = stream(seed, u64::MAX);
    let upper = chol.l().transpose();
    let draw = |random: &mut ChaCha8Rng| -> Vec<f64> {
        let z = DVector::from_fn(n, |_, _| normal(random));
        let step = upper.solve_upper_triangular(&z).unwrap_or_else(|| DVector::zeros(n));
        point.iter().zip(step.iter()).map(|(x, d)| reflect(x + d)).collect()
    };
    let samples = (0..options.samples).map(|_| draw(&mut random)).collect();
    Ok(Found { samples, prior, noise_scale, rivals, warnings: vec![] })
}

/// A point spread evenly over the unit box.
fn prior_point(seed: u64, sample: usize, n: usize) -> Vec<f64> {
    let mut random = stream(seed, 1 + sample as u64);
    (0..n).map(|_| random.random_range(0.0..1.0)).collect()
}

/// A coordinate mirrored at the walls of 0 to 1.
fn reflect(x: f64) -> f64 {
    let y = x.rem_euclid(2.0);
    if y > 1.0 { 2.0 - y } else { y }
}

/// Every design variable with its interval of probability `interval`.
pub fn parameters(design: &Design, point: &[f64], found: &Found, interval: f64) -> Vec<ParameterEstimate> {
    let values = design.at(point);
    let of = |k: usize| {
        let v = &design.variables[k];
        let units: Vec<f64> = found.samples.iter().map(|s| s[k]).collect();
        let (low, high) = ends(&units, interval).unwrap_or((0.0, 1.0));
        let determined = if units.len() < 2 { 0.0 } else { (1.0 - 12.0 * variance(&units)).clamp(0.0, 1.0) };
        ParameterEstimate {
            number: v.number,
            bundle: v.bundle(),
            kind: v.kind,
            value: values[k],
            lower: (v.lower + low * v.width()).min(values[k]),
            upper: (v.lower + high * v.width()).max(values[k]),
            range: [v.lower, v.upper],
            determined,
        }
    };
    (0..design.len()).map(of).collect()
}

/// Bundle forces in the probe trials with their intervals of probability `interval`; bundles slack at every sample and point are left out.
pub fn forces(probes: &Probes, design: &Design, point: &[f64], found: &Found, interval: f64) -> Vec<ForceEstimate> {
    let at = |experiment: &Experiment, p: &[f64]| -> Vec<Option<Vec<f64>>> {
        experiment.answers(&design.at(p), false).into_iter().map(|a| a.ok().map(|a| a.forces_n)).collect()
    };
    let best = at(&probes.experiment, point);
    let after: Vec<_> = found.samples.par_iter().map(|p| at(&probes.experiment, p)).collect();
    // only their variance is used
    let before: Vec<_> = found.prior.par_iter().map(|p| at(&probes.search, p)).collect();
    let bundles = best.iter().chain(after.iter().flatten()).flatten().map(Vec::len).max().unwrap_or(0);
    let mut out = Vec::new();
    for (i, name) in probes.names.iter().enumerate() {
        for bundle in 0..bundles {
            let of = |all: &[Vec<Option<Vec<f64>>>]| -> Vec<f64> {
                all.iter().filter_map(|a| a.get(i)?.as_ref()?.get(bundle).copied()).collect()
            };
            let (posterior, prior) = (of(&after), of(&before));
            let value_n = best.get(i).and_then(|f| f.as_ref()?.get(bundle).copied());
            let here = value_n.unwrap_or(0.0);
            let interval_n = ends(&posterior, interval).map(|(lower, upper)| [lower.min(here), upper.max(here)]);
            if interval_n.map_or(here, |[_, upper]| upper) < 1.0 {
                continue;
            }
            let removed = Removed::of(Spread::of(&posterior), Spread::of(&prior));
            out.push(ForceEstimate {
                trial: name.clone(),
                bundle,
                value_n,
                mean_n: (!posterior.is_empty()).then(|| mean(&posterior)),
                mode_n: value_n,
                interval_n,
                leaving: 0,
                determined: removed.map_or(0.0, Removed::told),
                removed: removed.map(|r| r.share),
                believed: 0.0,
                unmeasured: None,
            });
        }
    }
    out
}

/// Ends of the interval that holds the middle `share` of the values, by linear interpolation; `None` of fewer than two.
pub fn ends(values: &[f64], share: f64) -> Option<(f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1).filter(|l| *l > 0)? as f64;
    let at = |p: f64| {
        // places (k + 1/2) / n, as the percentile of the cost
        let x = (p * (last + 1.0) - 0.5).clamp(0.0, last);
        let (k, t) = (x.floor() as usize, x.fract());
        sorted[k] + t * (sorted[(k + 1).min(sorted.len() - 1)] - sorted[k])
    };
    Some((at(0.5 - 0.5 * share), at(0.5 + 0.5 * share)))
}

/// Standard error of an end of an interval by so many samples, as a share of half the interval [-]: that of a quantile of a normal distribution, by its
/// density there; `None` of fewer than two samples.
pub fn error_of_ends(samples: usize, interval: f64) -> Option<f64> {
    let z = Prior::Normal { mean: 0.0, sd: 1.0 }.interval(interval).1;
    let (tail, density) = (0.5 * (1.0 - interval), (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt());
    (samples > 1 && z > 0.0).then(|| (tail * (1.0 - tail) / samples as f64).sqrt() / (density * z))
}

/// Mean of values; 0 of none.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Variance of values; 0 of fewer than two.
pub fn variance(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if n < 2.0 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / n;
    values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use inference::random::normals;

    #[test]
    fn ends_by_few_samples_err_as_much_as_is_told() {
        let (n, share, of) = (48, 0.9, 4000);
        let lower = |k: u64| ends(normals(&mut stream(3, k), n).as_slice(), share).unwrap().0;
        let all: Vec<f64> = (0..of).map(lower).collect();
        let half = Prior::Normal { mean: 0.0, sd: 1.0 }.interval(share).1;
        let (found, told) = (variance(&all).sqrt() / half, error_of_ends(n, share).unwrap());
        // the formula is that of many samples
        assert!((found / told - 1.0).abs() < 0.1, "{found} {told}");
        assert!((told - 0.185).abs() < 0.001, "{told}");
        assert!(error_of_ends(1, share).is_none());
    }

    #[test]
    fn noise_that_makes_outliers_of_most_readings_is_told_with_its_digits() {
        let noise = NoiseEstimate {
            source: "kla".into(),
            coordinate: "ap_mm".into(),
            stated: 0.001,
            inferred: 0.001,
            lower: 0.0007,
            upper: 0.0015,
        };
        assert!(noise.not_as_stated(0.9).is_none(), "it is found as it was stated");
        let told = noise.outlying(0.56).unwrap();
        assert!(told.text.contains("misses by 0.56") && told.text.contains("1.0e-3 was stated"), "{}", told.text);
        assert!(noise.outlying(0.019).is_none());
        let taken = NoiseEstimate { inferred: 0.2, lower: 0.1, upper: 0.3, ..noise };
        assert!(taken.not_as_stated(0.9).unwrap().text.ends_with("1.0e-3 was taken"));
    }

    #[test]
    fn a_single_model_outside_the_samples_interval_is_told() {
        let at = |mode_n: f64, interval_n: Option<[f64; 2]>| ForceEstimate {
            trial: "anterior_30".into(),
            bundle: 0,
            value_n: Some(20.0),
            mean_n: Some(20.0),
            mode_n: Some(mode_n),
            interval_n,
            leaving: 0,
            determined: 0.5,
            removed: Some(0.5),
            believed: 0.0,
            unmeasured: None,
        };
        let inside = |mode: f64| !at(mode, Some([10.0, 30.0])).mode_is_outside();
        assert!(inside(10.0) && inside(30.0) && !inside(9.9) && !inside(30.1));
        assert!(
            !at(50.0, None).mode_is_outside() && at(50.0, None).most_n() == 20.0 && !at(50.0, None).is_determined()
        );
    }
}

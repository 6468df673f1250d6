//! Parameters and their priors.
//!
//! Every parameter is a rising function of a number `z` that is standard normal before anything is measured (its quantile function after the normal
//! distribution's). So the prior of all parameters together is one normal distribution, there are no walls to run against, and a parameter that the
//! data do not touch keeps its prior exactly.

use crate::error::InferenceError;
use serde::{Deserialize, Serialize};
use statrs::function::erf::{erfc, erfc_inv};
use std::f64::consts::{PI, SQRT_2};

/// What is believed of a parameter before anything is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Prior {
    /// Equally likely between two bounds.
    Uniform {
        /// Least value.
        lower: f64,
        /// Largest value.
        upper: f64,
    },
    /// Normal.
    Normal {
        /// Mean.
        mean: f64,
        /// Standard deviation.
        sd: f64,
    },
    /// Normal, cut off at two bounds.
    Truncated {
        /// Mean of the normal distribution that is cut off.
        mean: f64,
        /// Its standard deviation.
        sd: f64,
        /// Least value.
        lower: f64,
        /// Largest value.
        upper: f64,
    },
    /// Zero or more: the size of a normal number of mean 0.
    HalfNormal {
        /// Standard deviation of that number.
        sd: f64,
    },
    /// The logarithm is normal.
    LogNormal {
        /// Median.
        median: f64,
        /// Standard deviation of the natural logarithm [-].
        log_sd: f64,
    },
}

/// A parameter: its name, what of the model it is, its prior.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter<Q> {
    /// Its name in files and messages.
    pub name: String,
    /// What it changes.
    pub quantity: Q,
    /// Its prior.
    pub prior: Prior,
}

/// The normal distribution function.
fn below(x: f64) -> f64 {
    0.5 * erfc(-x / SQRT_2)
}

/// Its inverse.
fn quantile(p: f64) -> f64 {
    -SQRT_2 * erfc_inv(2.0 * p)
}

/// The normal density.
fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * PI).sqrt()
}

/// Furthest from 0 that a `z` is told apart [-]: beyond, the tail's probability is 1e-12.
const FURTHEST: f64 = 7.0;

impl Prior {
    /// The value at `z`, and its derivative.
    pub fn at(&self, z: f64) -> (f64, f64) {
        let p = below(z.clamp(-FURTHEST, FURTHEST));
        let d = density(z);
        match *self {
            Prior::Uniform { lower, upper } => (lower + (upper - lower) * p, (upper - lower) * d),
            Prior::Normal { mean, sd } => (mean + sd * z, sd),
            Prior::Truncated { mean, sd, lower, upper } => {
                let (a, b) = (below((lower - mean) / sd), below((upper - mean) / sd));
                let x = quantile((a + (b - a) * p).clamp(1e-300, 1.0 - 1e-16));
                ((mean + sd * x).clamp(lower, upper), sd * (b - a) * d / density(x).max(1e-300))
            }
            Prior::HalfNormal { sd } => {
                let x = quantile(0.5 + 0.5 * p.min(1.0 - 1e-15));
                (sd * x, sd * 0.5 * d / density(x))
            }
            Prior::LogNormal { median, log_sd } => {
                let x = median * (log_sd * z).exp();
                (x, x * log_sd)
            }
        }
    }

    /// The `z` of a value; of one out of bounds that of the bound.
    pub fn z_of(&self, value: f64) -> f64 {
        let z = match *self {
            Prior::Uniform { lower, upper } => quantile(((value - lower) / (upper - lower)).clamp(1e-12, 1.0 - 1e-12)),
            Prior::Normal { mean, sd } => (value - mean) / sd,
            Prior::Truncated { mean, sd, lower, upper } => {
                let (a, b) = (below((lower - mean) / sd), below((upper - mean) / sd));
                quantile(((below((value - mean) / sd) - a) / (b - a)).clamp(1e-12, 1.0 - 1e-12))
            }
            Prior::HalfNormal { sd } => quantile((2.0 * below(value.max(0.0) / sd) - 1.0).clamp(1e-12, 1.0 - 1e-12)),
            Prior::LogNormal { median, log_sd } => (value.max(1e-300) / median).ln() / log_sd,
        };
        z.clamp(-FURTHEST, FURTHEST)
    }

    /// The values that hold the middle `share` of the prior.
    pub fn interval(&self, share: f64) -> (f64, f64) {
        let z = quantile(0.5 + 0.5 * share);
        (self.at(-z).0, self.at(z).0)
    }

    /// Refuses what is no distribution; `name` is the parameter's.
    ///
    /// # Errors
    /// The name and the numbers.
    pub fn check(&self, name: &str) -> Result<(), InferenceError> {
        let fine = match *self {
            Prior::Uniform { lower, upper } => lower.is_finite() && upper.is_finite() && lower < upper,
            Prior::Normal { mean, sd } => mean.is_finite() && sd.is_finite() && sd > 0.0,
            Prior::Truncated { mean, sd, lower, upper } => {
                [mean, sd, lower, upper].iter().all(|x| x.is_finite())
                    && sd > 0.0
                    && lower < upper
                    && below((upper - mean) / sd) - below((lower - mean) / sd) > 1e-9
            }
            Prior::HalfNormal { sd } => sd.is_finite() && sd > 0.0,
            Prior::LogNormal { median, log_sd } => {
                median.is_finite() && median > 0.0 && log_sd.is_finite() && log_sd > 0.0
            }
        };
        if fine {
            return Ok(());
        }
        let what = format!("{self:?} is no distribution; expected finite numbers, lower < upper, sd above 0");
        Err(InferenceError::Prior { name: name.to_owned(), what })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Prior; 5] = [
        Prior::Uniform { lower: 0.7, upper: 1.05 },
        Prior::Normal { mean: 2.0, sd: 3.0 },
        Prior::Truncated { mean: 1.0, sd: 0.05, lower: 0.9, upper: 1.05 },
        Prior::HalfNormal { sd: 4.0 },
        Prior::LogNormal { median: 60.0, log_sd: 0.3 },
    ];

    #[test]
    fn values_come_back_rise_and_slope_as_they_should() {
        for prior in ALL {
            let mut before = f64::NEG_INFINITY;
            for k in -30..=30 {
                let z = f64::from(k) / 10.0;
                let (x, slope) = prior.at(z);
                assert!(x > before, "{prior:?} at {z}");
                before = x;
                assert!((prior.z_of(x) - z).abs() < 1e-6, "{prior:?} at {z}: {}", prior.z_of(x));
                let h = 1e-4;
                let numeric = (prior.at(z + h).0 - prior.at(z - h).0) / (2.0 * h);
                assert!((numeric - slope).abs() < 1e-4 * (1.0 + slope), "{prior:?} at {z}: {slope} {numeric}");
            }
        }
    }

    #[test]
    fn a_uniform_prior_is_uniform_and_bounds_are_kept() {
        let prior = Prior::Uniform { lower: 0.0, upper: 10.0 };
        let (low, high) = prior.interval(0.9);
        assert!((low - 0.5).abs() < 1e-9 && (high - 9.5).abs() < 1e-9);
        assert!((0.0..=10.0).contains(&prior.at(40.0).0) && (0.0..=10.0).contains(&prior.at(-40.0).0));
        assert!(Prior::Uniform { lower: 1.0, upper: 1.0 }.check("x").unwrap_err().to_string().contains('x'));
        assert!(Prior::Normal { mean: f64::NAN, sd: 1.0 }.check("x").is_err());
    }
}

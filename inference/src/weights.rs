//! How far samples are from the posterior: importance weights, and whether a mean by them can be trusted [vehtari2024].
//!
//! A sample of randomised maximum likelihood is a draw of the posterior where the model is linear. Elsewhere the linear model about a sample gives
//! another evidence than the linear model about the mode that it was drawn about. The ratio of both is the sample's weight [badewiljes2022]; in a linear model
//! it is one for all.

use crate::linear::{Linear, Shift};
use crate::noise::Likelihood;
use nalgebra::{Cholesky, DVector};
use serde::{Deserialize, Serialize};

/// Least numbers in a tail that a generalised Pareto distribution is fitted to [-] [vehtari2024].
const LEAST_TAIL: usize = 5;
/// Weight of the prior of the shape, in numbers of the tail, and its middle [-] [vehtari2024].
const SHAPE_PRIOR: (f64, f64) = (10.0, 0.5);
/// Largest shape at which weights are of use, however many samples there are [-] [vehtari2024].
const LARGEST_SHAPE: f64 = 0.7;

/// Weights, the largest of which is 1, that differ by less are alike [-].
const ROUNDED: f64 = 1e-12;

/// What the weights of samples say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weighed {
    /// How many samples have a weight.
    pub samples: usize,
    /// Shape of the weights' upper tail: above [`Weighed::limit`] the weights say little [-]. Infinite where one sample outweighs all.
    pub k_hat: f64,
    /// The largest shape at which so many weighted samples can be trusted [-].
    pub limit: f64,
    /// How many samples of equal weight are worth as much [-].
    pub effective_samples: f64,
    /// Standard deviation of the logarithms of the weights [-]; 0 in a linear model.
    pub spread: f64,
}

impl Weighed {
    /// Of logarithms of weights; `None` where there are too few for a tail.
    pub fn of(log_weights: &[f64]) -> Option<Weighed> {
        let n = log_weights.len();
        let most = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = log_weights.iter().map(|w| (w - most).exp()).collect();
        let k_hat = shape_of_tail(&weights)?;
        let (sum, squares) = weights.iter().fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
        let mean = log_weights.iter().sum::<f64>() / n as f64;
        let variance = log_weights.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
        let limit = (1.0 - 1.0 / (n as f64).log10()).min(LARGEST_SHAPE);
        Some(Weighed { samples: n, k_hat, limit, effective_samples: sum * sum / squares, spread: variance.sqrt() })
    }

    /// Whether the weights can be trusted.
    pub fn is_reliable(&self) -> bool {
        self.k_hat <= self.limit
    }
}

/// Shape of the upper tail of weights; `None` where it has too few numbers.
fn shape_of_tail(weights: &[f64]) -> Option<f64> {
    let n = weights.len() as f64;
    let tail = (0.2 * n).min(3.0 * n.sqrt()).ceil() as usize;
    if tail < LEAST_TAIL {
        return None;
    }
    let mut sorted = weights.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = sorted[sorted.len() - tail - 1];
    let beyond: Vec<f64> = sorted[sorted.len() - tail..].iter().map(|w| w - cut).collect();
    let m = tail as f64;
    // a tail of equal weights has no excess to go by
    let shape = pareto_shape(&beyond).unwrap_or(0.0);
    Some((m * shape + SHAPE_PRIOR.0 * SHAPE_PRIOR.1) / (m + SHAPE_PRIOR.0))
}

/// Shape of the generalised Pareto distribution of rising excesses, by the mean over a profile of likelihoods [zhang2009]; `None` where there is no
/// excess, infinite where all but few are too small for a number.
fn pareto_shape(excess: &[f64]) -> Option<f64> {
    let n = excess.len();
    let (quartile, largest) = (excess[((n as f64) / 4.0 + 0.5).floor() as usize - 1], *excess.last()?);
    if quartile <= 0.0 || largest <= ROUNDED {
        return (largest > ROUNDED).then_some(f64::INFINITY);
    }
    let points = 30 + (n as f64).sqrt().floor() as usize;
    let shape = |theta: f64| excess.iter().map(|x| (-theta * x).ln_1p()).sum::<f64>() / n as f64;
    let theta = |j: usize| 1.0 / largest + (1.0 - (points as f64 / (j as f64 + 0.5)).sqrt()) / (3.0 * quartile);
    let thetas: Vec<f64> = (0..points).map(theta).filter(|t| *t != 0.0).collect();
    let likelihood = |t: f64| n as f64 * ((-t / shape(t)).ln() - shape(t) - 1.0);
    let logs: Vec<f64> = thetas.iter().map(|t| likelihood(*t)).collect();
    let most = logs.iter().copied().filter(|l| l.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    let weights = logs.iter().map(|l| if l.is_finite() { (l - most).exp() } else { 0.0 });
    let (sum, mean) = weights.zip(&thetas).fold((0.0, 0.0), |(s, m), (w, t)| (s + w, m + w * t));
    (sum > 0.0).then(|| shape(mean / sum))
}

/// Logarithm of a sample's weight, up to what all samples share: the evidence by the linear model about it over that by the linear model about the mode
/// that it was drawn about, both under the sample's own noise. `shift` says which beliefs of one side were drawn as normal terms; where the sample
/// has others, or does not have these, their terms are made good. `None` where a Hessian is not positive definite.
pub fn log_weight(likelihood: &Likelihood, (sample, mode): (&Linear, &Linear), shift: &Shift) -> Option<f64> {
    let drawn = |at: &Linear| {
        let mut at = at.clone();
        for j in 0..at.belief.len() {
            if at.one_side[j] && !shift.both_sides.get(j).unwrap_or(&false) {
                at.belief[j] = 0.0;
                at.belief_jacobian.row_mut(j).fill(0.0);
            }
        }
        at.one_side.fill(false);
        at
    };
    let normal = drawn(sample);
    let told = heard(&normal).norm_squared() - heard(sample).norm_squared();
    Some(log_evidence(likelihood, &normal)? - log_evidence(likelihood, &drawn(mode))? + 0.5 * told)
}

fn heard(at: &Linear) -> DVector<f64> {
    Shift::none(at.z.len()).heard(at).0
}

/// Logarithm of the evidence if the model were as linear as it is at a point, up to what depends on the noise alone.
fn log_evidence(likelihood: &Likelihood, at: &Linear) -> Option<f64> {
    let form = likelihood.form(at, &Shift::none(at.z.len()));
    let factor = Cholesky::new(form.hessian)?;
    let to_least = 0.5 * form.gradient.dot(&factor.solve(&form.gradient));
    let half_log = factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
    Some(to_least - form.value - half_log)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{normal, stream, uniform};
    use nalgebra::DMatrix;

    #[test]
    fn the_shape_of_a_pareto_tail_comes_back() {
        // excesses of a generalised Pareto distribution of shape k: (u^-k - 1) / k
        for k in [-0.3, 0.1, 0.5, 1.0] {
            let mut random = stream(4, 1);
            let mut excess: Vec<f64> = (0..4000).map(|_| (uniform(&mut random).powf(-k) - 1.0) / k).collect();
            excess.sort_by(f64::total_cmp);
            let found = pareto_shape(&excess).unwrap();
            assert!((found - k).abs() < 0.06, "{k}: {found}");
        }
    }

    #[test]
    fn equal_weights_are_worth_all_samples_and_have_no_tail() {
        let w = Weighed::of(&[0.3; 48]).unwrap();
        assert!((w.effective_samples - 48.0).abs() < 1e-9 && w.is_reliable() && w.spread < 1e-12, "{w:?}");
        assert_eq!(Weighed::of(&[0.0; 8]), None);
    }

    #[test]
    fn wider_weights_are_worth_fewer_samples_and_are_not_trusted() {
        let of = |spread: f64| {
            let mut random = stream(5, 1);
            Weighed::of(&(0..1000).map(|_| spread * normal(&mut random)).collect::<Vec<_>>()).unwrap()
        };
        let all = [0.1, 0.5, 1.0, 3.0].map(of);
        assert!(all.windows(2).all(|w| w[1].effective_samples < w[0].effective_samples && w[1].k_hat > w[0].k_hat));
        assert!(all[0].is_reliable() && !all[3].is_reliable(), "{all:?}");
    }

    #[test]
    fn a_linear_model_gives_every_point_one_weight() {
        let n = 3;
        let at = |z: [f64; 3]| {
            let z = DVector::from_row_slice(&z);
            let (j, b) = (
                DMatrix::from_fn(4, n, |r, c| (r as f64 - 1.3 * c as f64).sin()),
                DMatrix::from_fn(2, n, |r, c| 0.5 + (r * c) as f64),
            );
            Linear {
                reading: &j * &z,
                belief: (&b * &z).add_scalar(-0.2),
                jacobian: j,
                belief_jacobian: b,
                one_side: vec![true, false],
                z,
            }
        };
        let mut likelihood = Likelihood::independent(DVector::from_element(4, 0.7), vec![0.5; 4], vec![0; 4]);
        likelihood.prepare().unwrap();
        for (point, above) in [([1.0, 0.4, 0.3], true), ([-1.0, -0.5, 0.1], false)] {
            let (sample, mode) = (at(point), at([0.1, 0.2, -0.1]));
            assert_eq!(sample.belief[0] > 0.0, above);
            let shift = Shift { both_sides: vec![above, false], ..Shift::none(n) };
            let weight = log_weight(&likelihood, (&sample, &mode), &shift).unwrap();
            assert!(weight.abs() < 1e-10, "{weight}");
        }
    }
}

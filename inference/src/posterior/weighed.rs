//! What the weights of samples say of models that are linear, and of one that is not.

use super::tests::{likelihood, toy};
use super::*;
use crate::weights::Weighed;

/// One number, read once along a curve.
struct Curved(f64);

impl Curved {
    fn reading(&self, z: f64) -> f64 {
        z + self.0 * z * z.abs()
    }

    /// Mean and standard deviation of the posterior, by a sum.
    fn exact(&self, measured: f64, sd: f64) -> (f64, f64) {
        let density = |z: f64| (-0.5 * (z * z + ((self.reading(z) - measured) / sd).powi(2))).exp();
        let grid: Vec<f64> = (-8_000..=8_000).map(|i| f64::from(i) * 1e-3).collect();
        let weights: Vec<f64> = grid.iter().map(|z| density(*z)).collect();
        moments(&grid, &weights)
    }
}

impl Forward for Curved {
    type State = ();
    fn size(&self) -> usize {
        1
    }
    fn at(&self, z: &DVector<f64>, _: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
        let of = |x: f64| DMatrix::from_element(1, 1, x);
        let reading = DVector::from_element(1, self.reading(z[0]));
        let jacobian = of(1.0 + 2.0 * self.0 * z[0].abs());
        Some(Point { reading, jacobian, belief_jacobian: DMatrix::zeros(0, 1), ..Point::default() })
    }
}

fn moments(values: &[f64], weights: &[f64]) -> (f64, f64) {
    let sum = |f: &dyn Fn(f64) -> f64| values.iter().zip(weights).map(|(v, w)| w * f(*v)).sum::<f64>();
    let all = weights.iter().sum::<f64>();
    let mean = sum(&|v| v) / all;
    (mean, (sum(&|v| (v - mean).powi(2)) / all).sqrt())
}

fn log_weights<S>(found: &Found<S>) -> Vec<f64> {
    found.samples.iter().filter_map(|s| s.log_weight).collect()
}

#[test]
fn samples_of_a_linear_model_weigh_the_same() {
    let toy = toy(12, 6, 0.0, 1);
    let mut l = likelihood(&toy, &normals(&mut stream(1, 9), 6), 0.5, 1);
    let found = infer(&toy, &mut l, &[], &PosteriorOptions::default()).unwrap();
    let weights = log_weights(&found);
    assert!(weights.len() == 48 && weights.iter().all(|w| w.abs() < 1e-6), "{weights:?}");
    let w = Weighed::of(&weights).unwrap();
    assert!(w.is_reliable() && w.effective_samples > 47.999, "{w:?}");
}

#[test]
fn weights_bring_the_mean_of_a_curved_models_samples_nearer_to_the_exact_one() {
    let options = PosteriorOptions { scale_noise: false, samples: 20_000, ..PosteriorOptions::default() };
    let spread = [0.1, 0.3].map(|curve| {
        let (toy, measured, sd) = (Curved(curve), 1.5, 0.8);
        let mut l = Likelihood::independent(DVector::from_element(1, measured), vec![sd], vec![0]);
        l.robust = 1e9;
        let found = infer(&toy, &mut l, &[], &options).unwrap();
        let log_weights = log_weights(&found);
        let values: Vec<f64> = found.samples.iter().map(|s| s.z[0]).collect();
        let by = |weights: &[f64]| {
            let ((mean, width), (exact, exact_width)) = (moments(&values, weights), toy.exact(measured, sd));
            ((mean - exact).abs() / exact_width, (width / exact_width).ln().abs())
        };
        let plain = by(&vec![1.0; values.len()]);
        let weighted = by(&log_weights.iter().map(|w| w.exp()).collect::<Vec<_>>());
        // by 20,000 samples a mean errs by 0.007 standard deviations
        assert!(weighted.0 < 0.5 * plain.0 && plain.0 > 0.03, "{curve}: {plain:?} {weighted:?}");
        // a weight leaves out how the curve itself bends, so widths are no better by it: within a tenth either way
        assert!(weighted.1 < 0.1 && plain.1 < 0.1, "{curve}: {plain:?} {weighted:?}");
        Weighed::of(&log_weights).unwrap().spread
    });
    assert!(spread[0] > 0.0 && spread[1] > spread[0], "the more a model bends, the wider its weights: {spread:?}");
}

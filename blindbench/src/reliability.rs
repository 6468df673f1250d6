//! Whether weights are to be believed: of answers that were given 80 % of the belief, 80 % should be right.

use crate::share::Share;
use serde::{Deserialize, Serialize};

/// Bins of weights between 0 and 1 [-].
pub const BINS: usize = 10;

/// Answers whose weights fall into one bin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Least weight [-].
    pub from: f64,
    /// Greatest weight [-].
    pub to: f64,
    /// Mean of the weights [-].
    pub weight: f64,
    /// Answers that say just what is hidden, among all.
    pub right: Share,
}

/// Bins that hold answers, of weights and whether each answer is right.
pub fn bins(answers: &[(f64, bool)]) -> Vec<Bin> {
    let width = 1.0 / BINS as f64;
    let place = |weight: f64| ((weight * BINS as f64) as usize).min(BINS - 1);
    let of = |k: usize| {
        let inside: Vec<&(f64, bool)> = answers.iter().filter(|a| place(a.0) == k).collect();
        let of = inside.len();
        let weight = inside.iter().map(|a| a.0).sum::<f64>() / of.max(1) as f64;
        let hits = inside.iter().filter(|a| a.1).count();
        Bin { from: k as f64 * width, to: (k + 1) as f64 * width, weight, right: Share { hits, of } }
    };
    (0..BINS).map(of).filter(|b| b.right.of > 0).collect()
}

/// Expected calibration error: by how much the mean weight of a bin and its share of right answers differ, in the mean over answers [-].
pub fn calibration_error(bins: &[Bin]) -> Option<f64> {
    let all: usize = bins.iter().map(|b| b.right.of).sum();
    let apart = |b: &Bin| (b.weight * b.right.of as f64 - b.right.hits as f64).abs();
    (all > 0).then(|| bins.iter().map(apart).sum::<f64>() / all as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_error_of_a_list_done_by_hand() {
        let answers = [(0.95, true), (0.97, false), (1.0, true), (0.3, false), (0.0, false)];
        let bins = bins(&answers);
        let seen: Vec<(usize, usize)> = bins.iter().map(|b| (b.right.hits, b.right.of)).collect();
        assert_eq!(seen, [(0, 1), (0, 1), (2, 3)]);
        // nothing, 0.3, and 2.92 against two right
        assert!((calibration_error(&bins).unwrap() - (0.0 + 0.3 + 0.92) / 5.0).abs() < 1e-12);
        assert_eq!(calibration_error(&[]), None);
    }

    #[test]
    fn weights_that_are_meant_have_a_small_error_and_bold_ones_a_large_one() {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let meant: Vec<f64> = (0..4000).map(|_| random.random()).collect();
        let right: Vec<bool> = meant.iter().map(|w| random.random::<f64>() < *w).collect();
        let error = |tell: &dyn Fn(f64) -> f64| {
            let told: Vec<(f64, bool)> = meant.iter().map(|w| tell(*w)).zip(right.iter().copied()).collect();
            calibration_error(&bins(&told)).unwrap()
        };
        // the standard deviation of a bin of 400 is 0.025 and less
        assert!(error(&|w| w) < 0.03, "{}", error(&|w| w));
        // whoever tells the root of what is meant is bolder by a sixth in the mean
        assert!((error(&|w| w.sqrt()) - 1.0 / 6.0).abs() < 0.03, "{}", error(&|w| w.sqrt()));
    }
}

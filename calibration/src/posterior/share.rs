//! What share of a variance data or beliefs removed, where both variances are of a few samples.
//!
//! Samples with the data and without are as if drawn apart: their random numbers begin alike, but the slices of a sample ([`inference::shift`])
//! part as soon as one is accepted here and refused there. From there on nothing is common. So their variances differ by chance. By 48 and 48
//! normal samples the share that is gone has a standard error of 0.29 where nothing was removed. Cut off at zero it is 0.10 in the mean, and
//! more of forces that are mostly slack. So a share is told only where it is more than chance gives once in twenty, and then as it is.

use crate::posterior::{mean, variance};

/// Fewer samples tell no share [-]: by 12 chance passes [`BEYOND_CHANCE`] once in ten, by two every other time. They tell no correlation either.
pub(crate) const LEAST: usize = 12;
/// Standard errors above which a share is more than chance [-]; ours: a normal number is greater once in twenty.
const BEYOND_CHANCE: f64 = 1.645;

/// A variance by samples, and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spread {
    variance: f64,
    error: f64,
}

impl Spread {
    /// Of values, by how their own squares scatter; `None` of fewer than [`LEAST`].
    pub(crate) fn of(values: &[f64]) -> Option<Spread> {
        let middle = mean(values);
        let squares: Vec<f64> = values.iter().map(|v| (v - middle).powi(2)).collect();
        let error = (variance(&squares) / values.len().max(1) as f64).sqrt();
        (values.len() >= LEAST).then(|| Spread { variance: variance(values), error })
    }

    /// Of so many normal samples, of which the variance alone is known.
    pub(crate) fn of_normal(variance: f64, samples: usize) -> Spread {
        Spread { variance, error: variance * (2.0 / (samples.max(2) - 1) as f64).sqrt() }
    }
}

/// What is gone of a variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Removed {
    /// As the samples have it [-]: 1 where all of it is gone, below zero where it has grown.
    pub(crate) share: f64,
    /// Its standard error [-], with what remains of the variance as it is.
    error: f64,
}

impl Removed {
    /// Of the variance `before`; `None` where either is not known, or there was none.
    pub(crate) fn of(after: Option<Spread>, before: Option<Spread>) -> Option<Removed> {
        let (after, before) = (after?, before.filter(|b| b.variance > 0.0)?);
        let share = 1.0 - after.variance / before.variance;
        Some(Removed { share, error: after.error.hypot(before.error) / before.variance })
    }

    /// The share that is told [-]: 0 where chance may give as much.
    pub(crate) fn told(self) -> f64 {
        if self.share > BEYOND_CHANCE * self.error { self.share } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use inference::random::{normals, stream};

    /// Samples of each of two sets, as many as a calibration draws.
    const SAMPLES: usize = 48;
    /// Pairs of sets.
    const PAIRS: u64 = 400;

    /// A force by how taut its bundle is: of a parameter, of a bundle that is slack in none, half or four fifths of the samples.
    const KINDS: [fn(f64) -> f64; 4] = [|z| z, |z| (z + 4.0).max(0.0), |z| z.max(0.0), |z| (z - 0.84).max(0.0)];

    fn drawn(kind: fn(f64) -> f64, times: f64, set: u64) -> Vec<f64> {
        normals(&mut stream(17, set), SAMPLES).iter().map(|z| kind(times * z)).collect()
    }

    /// What was removed of a kind whose numbers are `times` as wide afterwards, a value a pair of sets drawn apart.
    fn removed(kind: fn(f64) -> f64, times: f64) -> Vec<Removed> {
        let of = |pair: u64| {
            let (after, before) = (drawn(kind, times, 2 * pair), drawn(kind, 1.0, 2 * pair + 1));
            Removed::of(Spread::of(&after), Spread::of(&before)).expect("samples that differ")
        };
        (0..PAIRS).map(of).collect()
    }

    fn mean_told(all: &[Removed]) -> f64 {
        mean(&all.iter().map(|r| r.told()).collect::<Vec<_>>())
    }

    #[test]
    fn of_data_that_say_nothing_no_share_is_told_for_chance() {
        let all: Vec<Vec<Removed>> = KINDS.iter().map(|kind| removed(*kind, 1.0)).collect();
        let told: Vec<f64> = all.iter().map(|a| mean_told(a)).collect();
        assert!(mean(&told) < 0.05, "{told:?}");
        // what stood in its place: the share as it is, cut off at zero
        for a in &all {
            let cut = mean(&a.iter().map(|r| r.share.max(0.0)).collect::<Vec<_>>());
            assert!(cut > 0.07, "{cut}");
            assert!(mean_told(a) < 0.5 * cut, "{} beside {cut}", mean_told(a));
        }
    }

    #[test]
    fn what_data_remove_is_told_as_it_is() {
        for kind in &KINDS[..2] {
            for share in [0.8, 0.9] {
                let all = removed(*kind, f64::sqrt(1.0 - share));
                assert!((mean_told(&all) - share).abs() < 0.03, "{share}: {}", mean_told(&all));
                let told = all.iter().filter(|r| r.told() > 0.0);
                told.for_each(|r| assert!(r.told() == r.share));
            }
        }
    }

    #[test]
    fn a_variance_that_grows_is_below_zero_and_nothing_of_it_is_told() {
        for r in removed(|z| z, 2.0) {
            assert!(r.share < 0.0 && r.told() == 0.0, "{r:?}");
        }
        let same = drawn(|z| z, 1.0, 3);
        let none = Removed::of(Spread::of(&same), Spread::of(&same)).unwrap();
        assert!(none.share == 0.0 && none.told() == 0.0);
    }

    #[test]
    fn too_few_samples_tell_no_share() {
        for kind in &KINDS {
            let of = |set: u64, samples: usize| Spread::of(&drawn(*kind, 1.0, set)[..samples]);
            assert!((1..LEAST).all(|few| Removed::of(of(0, few), of(1, SAMPLES)).is_none()));
            assert!((1..LEAST).all(|few| Removed::of(of(0, SAMPLES), of(1, few)).is_none()));
            let is_told = |pair: &u64| {
                let (after, before) = (of(2 * pair, LEAST), of(2 * pair + 1, LEAST));
                Removed::of(after, before).is_some_and(|r| r.told() > 0.0)
            };
            // of data that say nothing: once in nine at most of many pairs, and what so few pairs leave open
            let told = (0..PAIRS).filter(is_told).count();
            assert!((told as f64) < 0.16 * PAIRS as f64, "{told} of {PAIRS}");
        }
    }

    #[test]
    fn no_variance_before_tells_nothing_and_one_odd_sample_is_chance() {
        assert!(Removed::of(Spread::of(&drawn(|z| z, 1.0, 5)), Spread::of(&[3.0; SAMPLES])).is_none());
        // a bundle that is slack in all samples now and was taut in one before
        let (slack, mut one) = (vec![0.0; SAMPLES], vec![0.0; SAMPLES]);
        one[5] = 8.0;
        let removed = Removed::of(Spread::of(&slack), Spread::of(&one)).unwrap();
        assert!(removed.share == 1.0 && removed.told() == 0.0, "{removed:?}");
    }

    #[test]
    fn the_error_by_the_scatter_of_squares_is_that_of_normal_numbers() {
        let all: Vec<f64> = (0..PAIRS).map(|k| Spread::of(&drawn(|z| z, 1.0, k)).unwrap().error).collect();
        let wanted = Spread::of_normal(1.0, SAMPLES).error;
        assert!((mean(&all) / wanted - 1.0).abs() < 0.12, "{} {wanted}", mean(&all));
    }
}

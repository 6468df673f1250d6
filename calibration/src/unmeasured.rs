//! What is known of a knee's forces when nothing is measured: the prior with its beliefs, against which the data are counted.

use crate::last_forces::moved;
use crate::options::CalibrateOptions;
use crate::posterior::{ForceEstimate, ends, mean, variance};
use crate::unknown::UNLIKE_STREAM;
use inference::knee::{Answers, Asked, Belief, Trials};
use inference::noise::Likelihood;
use inference::posterior::{Forward, Found, Options, infer};
use inference::random::{normals, stream};
use inference::shift::centre_of;
use nalgebra::DVector;
use rayon::prelude::*;
use sim::coordinate::Free;
use std::ops::Range;

/// Samples of the knee before it was measured. They are drawn by the same random numbers as those of the posterior: of data that say nothing both are the
/// same, so no share is told for chance.
#[derive(Default)]
pub(crate) struct Unmeasured {
    /// Numbers of each sample.
    z: Vec<DVector<f64>>,
    /// Forces of each: trial, bundle [N].
    forces: Vec<Vec<Vec<f64>>>,
    /// Forces without beliefs, too: the parameters' own distributions alone.
    alone: Vec<Vec<Vec<f64>>>,
}

/// Force by which fibres, toe and contact of another simulator change a bundle's variance [N], and the share of the force that they change it by [-]:
/// measured between two simulators of the same knee (docs/theory/inference.md).
const UNLIKE_N: f64 = 1.5;
/// See [`UNLIKE_N`].
const UNLIKE_SHARE: f64 = 0.1;

/// Standard deviation of a bundle's force when the knee is known [N]; a slack one stays slack.
pub(crate) fn force_sd(force_n: f64) -> f64 {
    (UNLIKE_N * force_n + (UNLIKE_SHARE * force_n).powi(2)).max(0.0).sqrt()
}

/// Share of a variance that values have lost [-]; 0 where nothing is known of them.
pub(crate) fn share_removed(values: &[f64], before: f64) -> f64 {
    if values.len() < 2 || before <= 0.0 { 0.0 } else { (1.0 - variance(values) / before).clamp(0.0, 1.0) }
}

impl Unmeasured {
    /// Samples with nothing measured, in the trials at `places` that nobody measured, `drawers` first; none where the posterior has none.
    pub(crate) fn of(
        trials: &Trials,
        (places, drawers): (Range<usize>, usize),
        options: &CalibrateOptions,
    ) -> Unmeasured {
        let (asked, beliefs) = imagined(trials, places);
        let of = Trials { trials: &asked, beliefs: &beliefs, ..*trials };
        let mut nothing = Likelihood::independent(DVector::zeros(0), Vec::new(), Vec::new());
        let inference = search(options);
        if inference.samples == 0 {
            return Unmeasured::default();
        }
        let Ok(found) = infer(&of, &mut nothing, &[], &inference) else { return Unmeasured::default() };
        let in_drawers = |state: &Answers| state.iter().take(drawers).map(|a| a.forces_n.clone()).collect::<Vec<_>>();
        let forces = found.samples.iter().map(|s| in_drawers(&s.state)).collect();
        let plain = Trials { trials: &asked[..drawers], beliefs: &[], on_fit: None, ..*trials };
        let alone = (0..inference.samples)
            .into_par_iter()
            .map(|s| Some(in_drawers(&plain.at(&centre_of(options.seed, s as u64, plain.size()), None)?.state)));
        let alone: Vec<Option<_>> = alone.collect();
        Unmeasured {
            z: found.samples.into_iter().map(|s| s.z).collect(),
            forces,
            alone: alone.into_iter().flatten().collect(),
        }
    }

    /// Variance of a number with nothing measured [-]; 1, the prior's own, where there are no samples.
    pub(crate) fn variance(&self, k: usize) -> f64 {
        if self.z.len() < 2 { 1.0 } else { variance(&self.z.iter().map(|z| z[k]).collect::<Vec<_>>()) }
    }

    /// Bundle forces in the drawers: mean and interval over the samples, moved to the final mechanics' `last` ones, and the same with nothing measured.
    pub(crate) fn forces(
        &self,
        found: &Found<Answers>,
        (measured, names): (usize, &[String]),
        last: &[Option<Vec<f64>>],
        (interval, seed): (f64, u64),
    ) -> Vec<ForceEstimate> {
        let bundles = found.modes[0].state[measured].forces_n.len();
        let samples = found.samples.len().max(self.forces.len());
        let own = |s: usize| normals(&mut stream(seed, UNLIKE_STREAM + s as u64), bundles);
        let unlike: Vec<DVector<f64>> = (0..samples).map(own).collect();
        let mut out = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let mode = &found.modes[0].state[measured + i].forces_n;
            let to_last = |forces_n: &[f64]| moved(forces_n, mode, last[i].as_ref());
            let chosen = to_last(mode);
            let after: Vec<Vec<f64>> = found.samples.iter().map(|s| to_last(&s.state[measured + i].forces_n)).collect();
            for bundle in 0..bundles {
                let told = |all: Vec<f64>| told(all, chosen[bundle], &unlike, bundle, interval);
                let of = |all: &[Vec<Vec<f64>>]| all.iter().map(|f| f[i][bundle]).collect::<Vec<f64>>();
                let after = told(after.iter().map(|f| f[bundle]).collect());
                let before = told(of(&self.forces));
                let alone = variance(&told(of(&self.alone)).scattered);
                out.push(ForceEstimate {
                    trial: name.clone(),
                    bundle,
                    value_n: Some(after.value),
                    lower_n: after.lower,
                    upper_n: after.upper,
                    determined: share_removed(&after.scattered, variance(&before.scattered)),
                    believed: share_removed(&before.scattered, alone),
                    unmeasured: (!self.forces.is_empty()).then_some([before.value, before.lower, before.upper]),
                });
            }
        }
        out
    }
}

/// How the knee is sought when nothing is measured: from its prior's centre alone.
fn search(options: &CalibrateOptions) -> Options {
    let of = options.inference.clone();
    Options { starts: 0, finalists: 1, rounds: 0, scale_noise: false, seed: options.seed, ..of }
}

/// How many fits [`Unmeasured::of`] tells of.
pub(crate) fn fits(options: &CalibrateOptions) -> usize {
    let search = search(options);
    if search.samples == 0 { 0 } else { search.fits(0) }
}

/// A force over samples.
struct Told {
    value: f64,
    lower: f64,
    upper: f64,
    scattered: Vec<f64>,
}

/// Mean and interval of a bundle's force, each sample scattered as another simulator would have it; `chosen` where there is no sample.
fn told(mut all: Vec<f64>, chosen: f64, unlike: &[DVector<f64>], bundle: usize, interval: f64) -> Told {
    if all.is_empty() {
        all.push(chosen);
    }
    let value = mean(&all);
    if all.len() > 1 {
        all.iter_mut().zip(unlike).for_each(|(f, z)| *f = (*f + force_sd(*f) * z[bundle]).max(0.0));
    }
    let (lower, upper) = ends(&all, interval).unwrap_or((value, value));
    Told { value, lower: lower.min(value), upper: upper.max(value), scattered: all }
}

/// The imagined trials, and measured ones of which something is believed, as mere loads; and the beliefs about them.
fn imagined(trials: &Trials, places: Range<usize>) -> (Vec<Asked>, Vec<Belief>) {
    let mere = |t: &Asked| Asked { reads: Free::all(false), from: None, ..t.clone() };
    let measured = places.start;
    let mut places: Vec<usize> = places.collect();
    places.extend((0..measured).filter(|i| trials.beliefs.iter().any(|b| b.trial == *i)));
    let asked = places.iter().map(|&i| mere(&trials.trials[i])).collect();
    let place = |i: usize| places.iter().position(|p| *p == i).unwrap_or(0);
    let beliefs = trials.beliefs.iter().map(|b| Belief { trial: place(b.trial), ..b.clone() }).collect();
    (asked, beliefs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slack_bundle_stays_slack_and_a_taut_one_is_known_to_a_tenth_at_best() {
        assert!(force_sd(0.0).abs() < 1e-12);
        for pair in [1.0, 10.0, 100.0, 400.0].windows(2) {
            assert!(force_sd(pair[0]) < force_sd(pair[1]));
            assert!(force_sd(pair[1]) / pair[1] < force_sd(pair[0]) / pair[0]);
        }
        assert!(force_sd(400.0) >= UNLIKE_SHARE * 400.0);
    }
}

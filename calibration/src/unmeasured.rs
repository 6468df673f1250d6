//! What is known of a knee's forces when nothing is measured: the prior with its beliefs, against which the data are counted.

use crate::last::moved;
use crate::options::CalibrateOptions;
use crate::plateau::Staying;
use crate::posterior::share::{Removed, Spread};
use crate::posterior::{ForceEstimate, ends, mean, variance};
use crate::unknown::UNLIKE_STREAM;
use inference::knee::{Answers, Belief, Trials};
use inference::noise::Likelihood;
use inference::parameter::Prior;
use inference::posterior::{Forward, Found, PosteriorOptions, infer};
use inference::random::{normals, stream};
use inference::shift::centre_of;
use inference::trial::Trial;
use nalgebra::DVector;
use rayon::prelude::*;
use sim::coordinate::Free;
use std::ops::Range;

/// Samples of the knee before it was measured. They have the posterior's streams of random numbers, but modes of their own, and slices of beliefs
/// that soon part from its. So of data that say nothing both sets are as if drawn apart, and what chance gives is not told ([`Removed::told`]).
#[derive(Default)]
pub(crate) struct Unmeasured {
    /// Numbers of each sample.
    z: Vec<DVector<f64>>,
    /// What each does in the drawers.
    drawn: Vec<InDrawers>,
    /// The same without beliefs, too: the parameters' own distributions alone.
    alone: Vec<InDrawers>,
}

/// What a sample does in the drawers.
pub(crate) struct InDrawers {
    /// Forces: trial, bundle [N].
    forces_n: Vec<Vec<f64>>,
    /// Whether its femur leaves the plateau, by trial; `None` where that cannot be told.
    leaves: Vec<Option<bool>>,
}

impl InDrawers {
    /// Of a sample at `z` with its answers, the first `drawers` of which are of drawers.
    fn of(trials: &Trials, z: &DVector<f64>, state: &Answers, drawers: usize) -> InDrawers {
        let forces_n = state.iter().take(drawers).map(|a| a.forces_n.clone()).collect();
        InDrawers { forces_n, leaves: trials.leaving(z, state, 0..drawers) }
    }
}

/// The samples of all that count in a trial.
fn staying(all: &[InDrawers], trial: usize) -> Staying {
    Staying::of(all.iter().map(|s| s.leaves[trial]))
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

/// Share of a variance that values have lost, beyond what chance gives [-]; 0 where nothing is known of them. `before` is of as many samples of a
/// number that is normal before anything is known.
pub(crate) fn share_removed(values: &[f64], before: f64) -> f64 {
    let before = Spread::of_normal(before, values.len());
    Removed::of(Spread::of(values), Some(before)).map_or(0.0, Removed::told)
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
        let drawn = found.samples.par_iter().map(|s| InDrawers::of(&of, &s.z, &s.state, drawers)).collect();
        let plain = Trials { trials: &asked[..drawers], beliefs: &[], on_fit: None, ..*trials };
        let alone = (0..inference.samples).into_par_iter().map(|s| {
            let z = centre_of(options.seed, s as u64, plain.size());
            Some(InDrawers::of(&plain, &z, &plain.at(&z, None)?.state, drawers))
        });
        let alone: Vec<Option<_>> = alone.collect();
        Unmeasured {
            z: found.samples.into_iter().map(|s| s.z).collect(),
            drawn,
            alone: alone.into_iter().flatten().collect(),
        }
    }

    /// Values of a parameter in each sample, by its place.
    pub(crate) fn values(&self, k: usize, prior: &Prior) -> Vec<f64> {
        self.z.iter().map(|z| prior.at(z[k]).0).collect()
    }

    /// Variance of a number with nothing measured [-]; 1, the prior's own, where there are no samples.
    pub(crate) fn variance(&self, k: usize) -> f64 {
        if self.z.len() < 2 { 1.0 } else { variance(&self.z.iter().map(|z| z[k]).collect::<Vec<_>>()) }
    }

    /// Bundle forces in the drawers: mean and interval over the samples that stay on the plateau (`leaves`, by sample and trial), moved to the final
    /// mechanics' `last` ones, and the same with nothing measured. Shares are of forces by the search's mechanics, of which all samples are.
    pub(crate) fn forces(
        &self,
        found: &Found<Answers>,
        (measured, names, leaves): (usize, &[String], &[Vec<Option<bool>>]),
        last: &[Option<Vec<f64>>],
        (interval, seed): (f64, u64),
    ) -> Vec<ForceEstimate> {
        let bundles = found.modes[0].state[measured].forces_n.len();
        let samples = found.samples.len().max(self.drawn.len()).max(self.alone.len());
        let own = |s: usize| normals(&mut stream(seed, UNLIKE_STREAM + s as u64), bundles);
        let unlike: Vec<DVector<f64>> = (0..samples).map(own).collect();
        let mut out = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let mode = &found.modes[0].state[measured + i].forces_n;
            let to_last = |forces_n: &[f64]| moved(forces_n, mode, last[i].as_ref());
            let chosen = to_last(mode);
            let staying = Staying::of(leaves.iter().map(|l| l[i]));
            let searched = |s: usize| &found.samples[s].state[measured + i].forces_n;
            let moved: Vec<(usize, Vec<f64>)> = staying.here.iter().map(|&s| (s, to_last(searched(s)))).collect();
            for bundle in 0..bundles {
                let of = |all: &[InDrawers]| {
                    let here = self::staying(all, i).here.into_iter();
                    told(here.map(|s| (s, all[s].forces_n[i][bundle])), (&unlike, bundle), interval)
                };
                let after = told(moved.iter().map(|(s, f)| (*s, f[bundle])), (&unlike, bundle), interval);
                let as_asked = scattered(staying.here.iter().map(|&s| (s, searched(s)[bundle])), (&unlike, bundle));
                let (before, alone) = (of(&self.drawn), of(&self.alone));
                let by_data = Removed::of(Spread::of(&as_asked), Spread::of(&before.scattered));
                let by_beliefs = Removed::of(Spread::of(&before.scattered), Spread::of(&alone.scattered));
                let value = after.mean.unwrap_or(chosen[bundle]);
                out.push(ForceEstimate {
                    trial: name.clone(),
                    bundle,
                    value_n: Some(value),
                    mean_n: after.mean,
                    mode_n: Some(chosen[bundle]),
                    interval_n: after.interval,
                    leaving: staying.leaving,
                    determined: by_data.map_or(0.0, Removed::told),
                    removed: by_data.map(|r| r.share),
                    believed: by_beliefs.map_or(0.0, Removed::told),
                    unmeasured: before.mean.zip(before.interval).map(|(mean, [lower, upper])| [mean, lower, upper]),
                });
            }
        }
        out
    }
}

/// How the knee is sought when nothing is measured: from its prior's centre alone.
fn search(options: &CalibrateOptions) -> PosteriorOptions {
    let of = options.inference.clone();
    PosteriorOptions { starts: 0, finalists: 1, rounds: 0, scale_noise: false, seed: options.seed, ..of }
}

/// How many fits [`Unmeasured::of`] tells of.
pub(crate) fn fits(options: &CalibrateOptions) -> usize {
    let search = search(options);
    if search.samples == 0 { 0 } else { search.fits(0) }
}

/// A force over samples; without a mean where there is none, without an interval where there is but one.
struct Told {
    mean: Option<f64>,
    interval: Option<[f64; 2]>,
    scattered: Vec<f64>,
}

/// Forces of a bundle in samples by their numbers, each scattered as another simulator would have it.
fn scattered(forces: impl Iterator<Item = (usize, f64)>, (unlike, bundle): (&[DVector<f64>], usize)) -> Vec<f64> {
    forces.map(|(s, f)| (f + force_sd(f) * unlike[s][bundle]).max(0.0)).collect()
}

/// Their mean and interval.
fn told(forces: impl Iterator<Item = (usize, f64)> + Clone, of: (&[DVector<f64>], usize), interval: f64) -> Told {
    let plain: Vec<f64> = forces.clone().map(|(_, f)| f).collect();
    let mean = (!plain.is_empty()).then(|| mean(&plain));
    let scattered = scattered(forces, of);
    let ends = mean.zip(ends(&scattered, interval));
    Told { mean, interval: ends.map(|(m, (lower, upper))| [lower.min(m), upper.max(m)]), scattered }
}

/// The imagined trials, and measured ones of which something is believed, as mere loads; and the beliefs about them.
fn imagined(trials: &Trials, places: Range<usize>) -> (Vec<Trial>, Vec<Belief>) {
    let mere = |t: &Trial| Trial { reads: Free::all(false), from: None, ..t.clone() };
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

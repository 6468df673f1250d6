//! The whole way of many trials to their rests: what is the same for several of them is gone once.

use crate::effect::Active;
use crate::effect::bench::Bench;
use inference::trial::Trial;
use rayon::prelude::*;
use sim::coordinate::SI;
use sim::equilibrium::{Equilibrium, Start};
use std::collections::BTreeMap;

/// What decides the way to a flexion under compression alone: data set, flexion, compression, tension of the quadriceps, by their bits.
type Way = (Option<usize>, [u64; 3]);

/// Rests of trials, each the whole way from the CT pose; `bench` is the knee that a trial is put to, the same for all trials of a data set. Where effects know
/// the trial itself, each trial goes its own way.
pub(crate) fn walked<'a>(trials: &[Trial], bench: impl Fn(usize) -> Bench<'a> + Sync) -> Vec<Equilibrium> {
    let mut firsts: BTreeMap<Way, usize> = BTreeMap::new();
    for (i, trial) in trials.iter().enumerate() {
        if bench(i).effects.iter().all(Active::is_of_the_knee) {
            firsts.entry(way(trial)).or_insert(i);
        }
    }
    let flexed: BTreeMap<Way, Start> =
        firsts.into_par_iter().map(|(way, i)| (way, bench(i).flexed(&trials[i]))).collect();
    let rest = |(i, trial): (usize, &Trial)| match flexed.get(&way(trial)) {
        Some(from) => bench(i).loaded(trial, from),
        None => bench(i).walk(trial),
    };
    trials.par_iter().enumerate().map(rest).collect()
}

fn way(trial: &Trial) -> Way {
    let of = [trial.flexion(), trial.load()[SI], trial.record.quadriceps_n];
    (trial.source, of.map(f64::to_bits))
}

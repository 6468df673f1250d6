//! The knee of a hypothesis, where its trials rest, and from where rests are sought.

use crate::effect::bench::Bench;
use crate::effect::ways::walked;
use crate::effect::{Active, Place};
use inference::knee::Models;
use inference::trial::Trial;
use nalgebra::DMatrix;
use rayon::prelude::*;
use sim::equilibrium::{Equilibrium, Start, starts_of};
use std::borrow::Cow;

/// The knee of a hypothesis.
pub(super) struct Knee<'a> {
    /// The model with its ligaments.
    pub(super) models: Models,
    /// What acts in each data set.
    pub(super) effects: Vec<Vec<Active>>,
    /// The trials with its unloaded poses.
    pub(super) trials: Cow<'a, [Trial]>,
    pub(super) place: &'a Place,
}

impl Knee<'_> {
    pub(super) fn bench(&self, trial: &Trial) -> Bench<'_> {
        let effects = trial.source.map_or(&[][..], |s| &self.effects[s]);
        Bench { model: self.models.of(trial.source), effects, place: self.place }
    }

    /// Rests of its trials from nearby poses; the whole way where there is none.
    pub(super) fn rests(&self, starts: &[Start]) -> Vec<Equilibrium> {
        if starts.is_empty() {
            return walked(&self.trials, |i| self.bench(&self.trials[i]));
        }
        let rest = |(i, trial): (usize, &Trial)| {
            let bench = self.bench(trial);
            starts.get(i).map_or_else(|| bench.walk(trial), |start| bench.settle(trial, start))
        };
        self.trials.par_iter().enumerate().map(rest).collect()
    }
}

/// Predictions and derivatives at an answer.
#[derive(Clone, Debug)]
pub struct Linear {
    /// Five readings a trial [deg, mm].
    pub value: Vec<f64>,
    /// Derivatives by the unknowns: a row a reading.
    pub jacobian: DMatrix<f64>,
    /// Where each trial rests.
    pub rests: Vec<Equilibrium>,
    /// For which trials a rest near the measured pose was sought and not found.
    pub in_vain: Vec<bool>,
}

/// Where the rests of all trials are sought from.
#[derive(Clone, Copy)]
pub enum Begin<'a> {
    /// From these poses, or the whole way where there are none.
    At(&'a [Start]),
    /// From the rests of another answer close by. A knee that found none near the measured pose there is not let go slowly from it again.
    After(&'a Linear),
}

impl Begin<'_> {
    pub(super) fn starts(&self) -> Cow<'_, [Start]> {
        match self {
            Begin::At(starts) => Cow::Borrowed(*starts),
            Begin::After(last) => Cow::Owned(starts_of(&last.rests)),
        }
    }

    pub(super) fn is_in_vain(&self, trial: usize) -> bool {
        matches!(self, Begin::After(last) if last.in_vain[trial])
    }
}

//! Each effect of the catalogue by itself, where none is enough: what the best fit of each explains, whatever the screens promise.

use super::refit::start_with;
use super::{Screened, Search, Searcher, TRIES};
use crate::candidate::Candidate;
use crate::covariance::Readings;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// How often a fit is led on [-].
const MOST_ROUNDS: usize = 3;
/// What a round must gain for another to be worth it [nats].
const WORTH_A_ROUND: f64 = 1.0;
/// A size that is next to nothing, in units of its prior [-].
const NEXT_TO_NOTHING: f64 = 0.05;

/// A start of a fit: hypothesis, unknowns, and the fit whose rests it begins from.
type Begun<'a> = (Vec<Candidate>, Vec<f64>, &'a Fit);

impl Searcher<'_> {
    /// The best fit of each effect of the catalogue, the likeliest first. Each begins from two ends: beside the recalibrated ligaments with the size that a
    /// screen there asks for, and beside the model where it stands, with the size that explains the force out of balance at the measured poses. It also
    /// begins from next to nothing, so that it never ends behind nothing missing, and, where its shape is free or it may be whole, from a typical size. What
    /// the search itself has met counts as well. The best of each is led on to its end.
    pub(crate) fn each_effect(&self, search: &Search) -> Result<Vec<Fit>, DiagnosisError> {
        let candidates = self.problem.candidates();
        let held = self.at_the_measured(search)?;
        let mut begun: Vec<Begun> = Vec::new();
        for at in [&search.base, &held] {
            let (list, _) = self.screen(at, &search.readings, &search.covariance, &candidates)?;
            begun.extend(first_of_each(&list, &candidates).map(|item| {
                let (hypothesis, start) = start_with(at, item, &candidates);
                (hypothesis, start, at)
            }));
        }
        let open = |c: &Candidate| c.effect.parameter.iter().any(|p| p.shape || p.whole.is_some());
        let typical: Vec<Begun> = begun
            .iter()
            .filter(|(of, _, at)| open(&of[0]) && std::ptr::eq(*at, &search.base))
            .map(|(of, _, at)| (of.clone(), [&at.unknowns[..], &of[0].typical()].concat(), *at))
            .collect();
        let beside = begun.iter().filter(|(_, _, at)| std::ptr::eq(*at, &search.base));
        let from_nothing: Vec<Begun> =
            beside.map(|(of, _, at)| (of.clone(), next_to_nothing(at, &of[0]), *at)).collect();
        begun.extend(typical);
        begun.extend(from_nothing);
        let mut fits: Vec<Fit> = begun
            .par_iter()
            .map(|(of, start, at)| {
                let rests = at.coordinates();
                let fit = self.fit(of, start, &rests, &search.covariance, &search.readings, TRIES)?;
                Ok(fit.earned(search.base.log_evidence, of[0].size()))
            })
            .collect::<Result<_, DiagnosisError>>()?;
        fits.extend(search.rivals.iter().filter(|f| f.hypothesis.len() == 1).cloned());
        fits.retain(|f| self.deserves_its_names(f));
        fits.sort_by(|a, b| self.log(b).total_cmp(&self.log(a)));
        let mut seen: Vec<String> = Vec::new();
        fits.retain(|f| {
            let id = &f.hypothesis[0].effect.id;
            let is_new = !seen.contains(id);
            seen.push(id.clone());
            is_new
        });
        let mut fits: Vec<Fit> =
            fits.into_par_iter().map(|f| self.led_on(search, f, &search.readings)).collect::<Result<_, _>>()?;
        fits.sort_by(|a, b| self.log(b).total_cmp(&self.log(a)));
        Ok(fits)
    }

    /// A fit led on to where it gains no more: one that explains little ends early, which is no proof.
    pub(crate) fn led_on(&self, search: &Search, fit: Fit, readings: &Readings) -> Result<Fit, DiagnosisError> {
        let mut here = fit;
        for _ in 0..MOST_ROUNDS {
            let rests = here.coordinates();
            let on = self.fit(&here.hypothesis, &here.unknowns, &rests, &search.covariance, readings, TRIES)?;
            let gain = on.log_evidence - here.log_evidence;
            if gain > 0.0 {
                here = on;
            }
            if gain < WORTH_A_ROUND {
                break;
            }
        }
        Ok(here)
    }

    /// The model where it stands, linear about the measured poses.
    fn at_the_measured(&self, search: &Search) -> Result<Fit, DiagnosisError> {
        let linear = self.problem.linear_held()?;
        let n = self.problem.nuisances();
        Ok(Fit {
            unknowns: vec![0.0; n],
            means: self.problem.means(n),
            residual: &search.readings.measured - search.readings.pick(&linear.value),
            outliers: vec![],
            posterior: DMatrix::identity(n, n),
            linear,
            ..search.base.clone()
        })
    }

    /// The share that a fit closes of what nothing missing leaves beyond noise [-].
    pub(crate) fn closes(&self, fit: &Fit, base: &Fit) -> f64 {
        let [before, after] = [base, fit].map(|f| self.total(f));
        let gap = before - base.residual.len() as f64;
        if gap > 0.0 { ((before - after) / gap).clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// The knee of a fit with next to nothing of an effect.
fn next_to_nothing(at: &Fit, effect: &Candidate) -> Vec<f64> {
    let sizes = effect.nothing().into_iter().zip(&effect.effect.parameter);
    let little = sizes.map(|(x, p)| if p.shape { x } else { x + NEXT_TO_NOTHING });
    at.unknowns.iter().copied().chain(little).collect()
}

/// The first of each effect in a screen, the best first: its likeliest variant and scope.
fn first_of_each<'a>(list: &'a [Screened], candidates: &'a [Candidate]) -> impl Iterator<Item = &'a Screened> {
    let mut seen: Vec<&str> = Vec::new();
    list.iter().filter(move |item| {
        let id = candidates[item.candidates[0]].effect.id.as_str();
        let is_new = !seen.contains(&id);
        seen.push(id);
        is_new
    })
}

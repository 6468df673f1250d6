//! Each effect of the catalogue by itself, where none is enough: what the best fit of each explains, whatever the screens promise.

use super::refit::start_with;
use super::{Screened, Search, Searcher, TRIES};
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::covariance::Readings;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// How often a fit is led on [-].
const MOST_ROUNDS: usize = 3;
/// What a round must gain for another to be worth it [nats].
const WORTH_A_ROUND: f64 = 1.0;
/// A size that is next to nothing, in units of its prior [-].
const NEXT_TO_NOTHING: f64 = 0.05;
/// Evaluations after which the starts of an effect are held against each other [-]: the best alone is led to its end.
const FIRST_STEPS: usize = 3;
/// Starts of an effect that are led to their end at most [-]: the second where the first ends beyond what its name allows.
const MOST_LED: usize = 2;

/// A start of a fit: hypothesis, unknowns, and the fit whose rests it begins from.
type Begun<'a> = (Vec<Candidate>, Vec<f64>, &'a Fit);

impl Searcher<'_> {
    /// The best fit of each effect of the catalogue, the likeliest first. The starts of each go a few steps; the best is led on to its end.
    pub(super) fn each_effect(&self, search: &Search) -> Result<Vec<Fit>, DiagnosisError> {
        let held = self.at_the_measured(search)?;
        let first: Vec<Fit> = self
            .starts_of_each(search, &held)?
            .par_iter()
            .map(|(of, start, at)| {
                self.fit(of, start, &at.coordinates(), &search.covariance, &search.readings, FIRST_STEPS)
            })
            .collect::<Result<_, DiagnosisError>>()?;
        self.at_their_ends(search, first)
    }

    /// The starts of each effect. It begins beside the recalibrated ligaments: from next to nothing, from the size that a screen there asks for, and, where its
    /// shape is free or it may be whole, from a typical size. It also begins where the search ended that refitted it. What the search never refitted begins
    /// from the other end: beside the model where it stands, with the size that explains the force out of balance at the measured poses.
    fn starts_of_each<'a>(&self, search: &'a Search, held: &'a Fit) -> Result<Vec<Begun<'a>>, DiagnosisError> {
        let candidates = self.problem.candidates();
        let is_rival = |f: &Fit| search.rivals.iter().any(|r| r.hypothesis == f.hypothesis);
        let is_met = |of: &Candidate| search.met.fits().any(|f| f.hypothesis[0] == *of);
        let is_effect_met = |of: &Candidate| search.met.fits().any(|f| f.hypothesis[0].effect.id == of.effect.id);
        // rivals stand in the scatter of the search already
        let met = search.met.fits().filter(|f| !is_rival(f));
        let mut begun: Vec<Begun> = met.map(|f| (f.hypothesis.clone(), f.unknowns.clone(), f)).collect();
        let screened = |at: &Fit| self.screen(at, &search.readings, &search.covariance, &candidates);
        let [(beside, _), (there, _)] = [screened(&search.base)?, screened(held)?];
        for item in first_of_each(&beside, &candidates) {
            let of = &candidates[item.candidates[0]];
            begun.extend(from_base(&search.base, of));
            begun.extend((!is_met(of)).then(|| begin(&search.base, item, &candidates)));
        }
        let never = first_of_each(&there, &candidates).filter(|l| !is_effect_met(&candidates[l.candidates[0]]));
        begun.extend(never.map(|item| begin(held, item, &candidates)));
        Ok(begun)
    }

    /// Of some fits the best of each effect, led on to its end in the scatter of a search, the likeliest first; what the search itself has counts as well. A
    /// fit that ends where it is not its effect any more gives way to the next of the same effect.
    pub(super) fn at_their_ends(&self, search: &Search, mut fits: Vec<Fit>) -> Result<Vec<Fit>, DiagnosisError> {
        fits.extend(search.rivals.iter().filter(|f| f.hypothesis.len() == 1).cloned());
        fits.sort_by(|a, b| self.log(b).total_cmp(&self.log(a)));
        let mut of_each: Vec<Vec<Fit>> = Vec::new();
        for fit in fits {
            let is_same = |own: &&mut Vec<Fit>| own[0].hypothesis[0].effect.id == fit.hypothesis[0].effect.id;
            match of_each.iter_mut().find(is_same) {
                Some(own) => own.push(fit),
                None => of_each.push(vec![fit]),
            }
        }
        let first_end = |of_one: Vec<Fit>| -> Result<Option<Fit>, DiagnosisError> {
            for fit in of_one.into_iter().take(MOST_LED) {
                let size = fit.hypothesis[0].size();
                let end = self.led_on(search, fit, &search.readings)?.earned(search.base.log_evidence, size);
                if self.deserves_its_names(&end) {
                    return Ok(Some(end));
                }
            }
            Ok(None)
        };
        let ends: Vec<Option<Fit>> = of_each.into_par_iter().map(first_end).collect::<Result<_, DiagnosisError>>()?;
        let mut ends: Vec<Fit> = ends.into_iter().flatten().collect();
        ends.sort_by(|a, b| self.log(b).total_cmp(&self.log(a)));
        Ok(ends)
    }

    /// A fit led on to where it gains no more: one that explains little ends early, which is no proof. An effect that is behind nothing missing after a round is
    /// led no further.
    pub(crate) fn led_on(&self, search: &Search, fit: Fit, readings: &Readings) -> Result<Fit, DiagnosisError> {
        let mut here = fit;
        let is_behind = |f: &Fit| !f.hypothesis.is_empty() && self.log(f) < self.log(&search.base);
        for _ in 0..MOST_ROUNDS {
            let rests = here.coordinates();
            let on = self.fit(&here.hypothesis, &here.unknowns, &rests, &search.covariance, readings, TRIES)?;
            let gain = on.log_evidence - here.log_evidence;
            if gain > 0.0 {
                here = on;
            }
            if gain < WORTH_A_ROUND || is_behind(&here) {
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

/// A start that a screen about a fit asks for.
fn begin<'a>(at: &'a Fit, item: &Screened, candidates: &[Candidate]) -> Begun<'a> {
    let (hypothesis, start) = start_with(at, item, candidates);
    (hypothesis, start, at)
}

/// Starts of an effect beside a fit of nothing missing that no screen asks for: next to nothing of it, and, where its shape is free or it may be whole, a
/// typical size.
fn from_base<'a>(base: &'a Fit, effect: &Candidate) -> Vec<Begun<'a>> {
    let sizes = effect.nothing().into_iter().zip(&effect.effect.parameter);
    let mut of = vec![sizes.map(|(x, p)| if p.shape { x } else { x + NEXT_TO_NOTHING }).collect()];
    if effect.effect.parameter.iter().any(|p| p.shape || p.whole.is_some()) {
        of.push(effect.typical());
    }
    of.into_iter().map(|size| (vec![effect.clone()], [&base.unknowns[..], &size].concat(), base)).collect()
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

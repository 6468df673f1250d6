//! Each effect of the catalogue by itself, where none is enough: what the best fit of each explains, whatever the screens promise.

use super::refit::start_with;
use super::{Screened, Search, Searcher, TRIES};
use crate::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// A start of a fit: hypothesis, unknowns, and the fit whose rests it begins from.
type Begun<'a> = (Vec<Candidate>, Vec<f64>, &'a Fit);

impl Searcher<'_> {
    /// The best fit of each effect of the catalogue, the likeliest first. Each begins from two ends: beside the recalibrated ligaments with the size that a
    /// screen there asks for, and beside the model where it stands, with the size that explains the force out of balance at the measured poses. An effect
    /// whose shape is free, or that may be whole, begins from a typical size, too. What the search itself has met counts as well.
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
        begun.extend(typical);
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
        Ok(fits)
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

//! A search that is led on from every start that the table of tried effects has: it stays behind none of them.

use super::steps::{Found, Given};
use super::{Search, Searcher};
use crate::error::DiagnosisError;
use crate::fit::Fit;
use rayon::prelude::*;

/// What a fit of the table must be ahead for the search to begin again there [nats].
const WORTH_BEGINNING: f64 = 1.0;
/// How often a search begins again [-].
const MOST_AGAIN: usize = 2;

impl Searcher<'_> {
    /// Remembers the single effects among what was found.
    pub(super) fn meet(&self, found: &mut Found) {
        for fit in found.rivals.iter().filter(|f| f.hypothesis.len() == 1) {
            found.met.take(self.gain(fit, &found.base), fit);
        }
    }

    /// The search, and each effect of the catalogue by itself, the likeliest first. Where one of these is ahead of the best that the search has, the search
    /// begins again from them, so that it is never behind. Then each two of the likeliest are tried together; the best pairs stand behind the single effects.
    ///
    /// Errors: a model that cannot be evaluated.
    pub fn widened(&self, mut search: Search) -> Result<(Search, Vec<Fit>), DiagnosisError> {
        let mut alone = self.each_effect(&search)?;
        for _ in 0..MOST_AGAIN {
            let Some(again) = self.begun_again(&search, &alone)? else { break };
            search = again;
            alone = self.tried_again(&search, &alone)?;
        }
        let pairs = self.pairs_tried(&search, &alone)?;
        if let Some(paired) = self.with_a_pair(&search, &pairs)? {
            search = paired;
            alone = self.tried_again(&search, &alone)?;
        }
        self.take_in(&mut search, &alone);
        alone.extend(self.pairs_told(&search, &pairs)?);
        Ok((search, alone))
    }

    /// The rows of a table in the scatter of a search.
    fn tried_again(&self, search: &Search, alone: &[Fit]) -> Result<Vec<Fit>, DiagnosisError> {
        let in_its_scatter: Vec<Fit> = alone
            .par_iter()
            .map(|f| self.in_scatter(f, &search.readings, &search.covariance))
            .collect::<Result<_, DiagnosisError>>()?;
        self.at_their_ends(search, in_its_scatter)
    }

    /// The search begun again beside fits of single effects, where the first of them is ahead of its best; none where that effect does not last in the scatter
    /// at its own fit.
    fn begun_again(&self, search: &Search, alone: &[Fit]) -> Result<Option<Search>, DiagnosisError> {
        let best = search.rivals.first().unwrap_or(&search.base);
        let Some(ahead) = alone.first().filter(|f| self.log(f) >= self.log(best) + WORTH_BEGINNING) else {
            return Ok(None);
        };
        let candidates = self.problem.candidates();
        let (extra, threshold) = (&search.start.extra, search.threshold);
        let given = Given { readings: &search.readings, candidates: &candidates, extra, threshold };
        let (base, cov, met) = (search.base.clone(), search.covariance.clone(), search.met.clone());
        let rivals = search.rivals.iter().chain(alone).cloned().collect();
        let found = self.renewed(Found { base, rivals, cov, met }, given)?;
        if found.rivals.iter().all(|f| f.hypothesis != ahead.hypothesis) {
            return Ok(None);
        }
        let found = self.grown(&search.start, self.fairly(found, given)?, given)?;
        let Found { base, rivals, cov, met } = found;
        Ok(Some(Search { base, rivals, covariance: cov, met, ..search.clone() }))
    }

    /// Rivals in whose place a better fit of the same hypothesis stands, and what is ahead of the best.
    pub(crate) fn take_in(&self, search: &mut Search, alone: &[Fit]) {
        let best = self.log(search.rivals.first().unwrap_or(&search.base));
        for fit in alone {
            match search.rivals.iter_mut().find(|f| f.hypothesis == fit.hypothesis) {
                Some(own) if self.log(own) < self.log(fit) => *own = fit.clone(),
                Some(_) => {}
                None if self.log(fit) > best => search.rivals.push(fit.clone()),
                None => {}
            }
        }
        self.sort(&mut search.rivals);
    }
}

//! Two effects at once, of those that the table of tried effects has one by one: screens of pairs are linear, and see little of effects that are large.

use super::steps::{Found, Given, HOPELESS};
use super::{Search, Searcher, TRIES};
use crate::error::DiagnosisError;
use crate::fit::Fit;
use rayon::prelude::*;

/// Effects of the table that are joined, the likeliest first [-]: six pairs of four, each a fit.
const JOINED: usize = 4;
/// Pairs that a table has at most, the likeliest first [-].
const TOLD: usize = 3;
/// What a pair must be ahead of another pair to take its place [nats].
const WORTH_A_PLACE: f64 = 1.0;

/// Each two of so many.
fn pairs_of(count: usize) -> Vec<[usize; 2]> {
    (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b])).collect()
}

impl Searcher<'_> {
    /// Fits of each two of the likeliest effects of a table, begun where both end, beside the ligaments of the likelier; the best first. Both are large enough
    /// for their names, and have a size of their own.
    pub fn joined(&self, search: &Search, alone: &[Fit]) -> Result<Vec<Fit>, DiagnosisError> {
        let n = self.problem.nuisances();
        let likely: Vec<&Fit> = alone.iter().filter(|f| self.gain(f, &search.base) > 0.0).take(JOINED).collect();
        let fit = |[a, b]: &[usize; 2]| {
            let (one, other) = (likely[*a], likely[*b]);
            let hypothesis = [&one.hypothesis[..], &other.hypothesis[..]].concat();
            let start = [&one.unknowns[..], &other.unknowns[n..]].concat();
            self.fit(&hypothesis, &start, &one.coordinates(), &search.covariance, &search.readings, TRIES)
        };
        let mut fits: Vec<Fit> = pairs_of(likely.len()).par_iter().map(fit).collect::<Result<_, DiagnosisError>>()?;
        fits.retain(|f| self.deserves_its_names(f) && self.each_has_a_size(f));
        self.sort(&mut fits);
        Ok(fits)
    }

    /// Pairs beside a table, the best first: its likeliest effects two by two, and the best pair of the search with either effect exchanged for what does
    /// better in its place. A search leaves that out where much is left. None where no two effects may be named.
    pub(super) fn pairs_tried(&self, search: &Search, alone: &[Fit]) -> Result<Vec<Fit>, DiagnosisError> {
        if self.options.most_effects < 2 {
            return Ok(vec![]);
        }
        let mut fits = self.joined(search, alone)?;
        let is_open = |f: &&Fit| f.hypothesis.len() == 2 && self.leaves(f) < HOPELESS[1];
        if let Some(best) = search.rivals.first().filter(is_open) {
            let candidates = self.problem.candidates();
            let data = (&search.readings, &search.covariance);
            let exchanged = self.exchanged(best, data, &candidates, &mut Vec::new())?;
            fits.extend(exchanged.into_iter().filter(|f| self.each_has_a_size(f)));
        }
        self.sort(&mut fits);
        Ok(fits)
    }

    /// The likeliest pairs as rows of a table, in the scatter of a search; none is ahead of its best.
    pub(super) fn pairs_told(&self, search: &Search, pairs: &[Fit]) -> Result<Vec<Fit>, DiagnosisError> {
        let best = search.rivals.first().unwrap_or(&search.base);
        let is_best = |f: &&Fit| f.hypothesis.iter().all(|c| best.hypothesis.contains(c));
        let others = pairs.iter().filter(|f| !is_best(f)).take(TOLD).collect::<Vec<_>>();
        let mut out: Vec<Fit> = others
            .par_iter()
            .map(|f| self.in_scatter(f, &search.readings, &search.covariance))
            .collect::<Result<_, DiagnosisError>>()?;
        out.retain(|f| self.log(f) <= self.log(best));
        Ok(out)
    }

    /// The search with one of some pairs in front; none where no pair is ahead of its best. Beside a single effect a pair must gain what is asked of a further
    /// effect where much is left, and predict trials that it has not seen.
    pub(super) fn with_a_pair(&self, search: &Search, pairs: &[Fit]) -> Result<Option<Search>, DiagnosisError> {
        let best = search.rivals.first().unwrap_or(&search.base);
        let effects = best.hypothesis.len();
        if !(1..=2).contains(&effects) {
            return Ok(None);
        }
        let least = if effects == 1 { self.options.least_further } else { WORTH_A_PLACE };
        let fits: Vec<Fit> = pairs.iter().filter(|f| self.log(f) >= self.log(best) + least).cloned().collect();
        let first = match effects {
            1 => self.first_that_predicts((&fits, best), &search.covariance, 0..fits.len())?,
            _ => (!fits.is_empty()).then_some(0),
        };
        let Some(first) = first else { return Ok(None) };
        let candidates = self.problem.candidates();
        let (extra, threshold) = (&search.start.extra, search.threshold);
        let given = Given { readings: &search.readings, candidates: &candidates, extra, threshold };
        let (base, cov, met) = (search.base.clone(), search.covariance.clone(), search.met.clone());
        let rivals = std::iter::once(&fits[first]).chain(&search.rivals).cloned().collect();
        let Found { base, rivals, cov, met } = self.renewed(Found { base, rivals, cov, met }, given)?;
        // in the scatter of the pair a single effect may be the likelier again
        let stays = rivals.first().is_some_and(|f| f.hypothesis == fits[first].hypothesis);
        Ok(stays.then(|| Search { base, rivals, covariance: cov, met, ..search.clone() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_two_are_joined_once_and_none_with_itself() {
        let of = pairs_of(JOINED);
        assert_eq!(of.len(), JOINED * (JOINED - 1) / 2);
        assert!(of.iter().all(|[a, b]| a < b && *b < JOINED));
        assert!(pairs_of(1).is_empty() && pairs_of(0).is_empty());
    }
}

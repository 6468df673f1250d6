//! Kin of an answer: what these trials could not tell from it, whatever this draw of their noise says. A set of answers is closed under it.

use super::refit::proposed;
use super::{FEW, Search, Searcher, TRIES};
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::covariance::Readings;
use nalgebra::DVector;

/// Most members of a set whose kin are looked for [-].
const MOST_MEMBERS: usize = 3;
/// Most kin of a member that are refitted [-].
const NEAREST: usize = 4;
/// Nats by which a screen may be wrong about a kin [-]: it is linear, about the rests of the member.
const SCREEN_ERRS: f64 = 5.0;

impl Searcher<'_> {
    /// Answers that the trials cannot tell from the first, and those that they cannot tell from these in turn: the expected log odds on readings without
    /// noise, both refitted, are less than `told_apart`. Each is refitted to the data. Those of one effect only; what stands beside others has been exchanged.
    pub(crate) fn kin(&self, search: &Search, first: &Fit, told_apart: f64) -> Result<Vec<Fit>, DiagnosisError> {
        let mut members = vec![first.clone()];
        let mut next = 0;
        while next < members.len().min(MOST_MEMBERS) {
            let near = self.near(search, &members[next], &members, told_apart)?;
            members.extend(near);
            next += 1;
        }
        members.remove(0);
        Ok(members)
    }

    /// Kin of one member that are not in the set yet.
    fn near(&self, search: &Search, member: &Fit, known: &[Fit], told_apart: f64) -> Result<Vec<Fit>, DiagnosisError> {
        if member.hypothesis.len() != 1 {
            return Ok(vec![]);
        }
        let (cov, candidates) = (&search.covariance, self.problem.candidates());
        let readings = Readings { measured: search.readings.pick(&member.linear.value), ..search.readings.clone() };
        let exact = Fit { residual: DVector::zeros(member.residual.len()), outliers: vec![], ..member.clone() };
        let at = self.stripped(&exact, &readings);
        let (mut list, _) = self.screen(&at, &readings, cov, &candidates)?;
        let of = |k: usize| std::slice::from_ref(&candidates[k]);
        let own = list.iter().find(|l| of(l.candidates[0]) == member.hypothesis).map_or(0.0, |l| l.gain);
        let is_known = |c: &[Candidate]| known.iter().any(|f| f.hypothesis == c);
        list.retain(|l| l.gain > own - told_apart - SCREEN_ERRS && !is_known(of(l.candidates[0])));
        if proposed(&list, &candidates, 1).is_empty() {
            return Ok(vec![]);
        }
        let fit =
            |f: &Fit, readings: &Readings| self.fit(&f.hypothesis, &f.unknowns, &f.coordinates(), cov, readings, TRIES);
        let own = fit(member, &readings)?;
        let base = self.fit(&[], &search.base.unknowns, &at.coordinates(), cov, &readings, FEW)?;
        let near = self.refits(&at, (&readings, cov), &candidates, (&list, NEAREST), base.log_evidence)?;
        let mut out = Vec::new();
        for kin in near.iter().filter(|f| self.log(&own) - self.log(f) < told_apart) {
            let found = search.rivals.iter().find(|f| f.hypothesis == kin.hypothesis).cloned();
            let found = found.map_or_else(
                || Ok(fit(kin, &search.readings)?.earned(search.base.log_evidence, kin.hypothesis[0].size())),
                Ok::<Fit, DiagnosisError>,
            )?;
            out.extend(self.deserves_its_names(&found).then_some(found));
        }
        Ok(out)
    }

    /// A search whose rivals hold the kin of its best, and the kin; none where the best earns no name.
    pub(crate) fn closed(&self, mut search: Search, told_apart: f64) -> Result<(Search, Vec<Fit>), DiagnosisError> {
        let Some(first) = search.rivals.first().cloned() else { return Ok((search, vec![])) };
        let kin = self.kin(&search, &first, told_apart)?;
        search.rivals.extend(kin.iter().cloned());
        self.sort(&mut search.rivals);
        Ok((search, kin))
    }
}

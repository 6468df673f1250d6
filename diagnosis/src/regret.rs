//! Regret: by how much a search stays behind the truth of its own catalogue. For benches, where the truth is known.

use crate::candidate::{Candidate, Scope};
use crate::catalogue::Catalogue;
use crate::covariance::Readings;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::search::{Search, Searcher, TRIES};
use sim::equilibrium::starts_of;

/// An effect that is there in all data sets: its name, its variant, and its parameters in the catalogue's units.
pub type Hidden<'a> = (&'a str, &'a str, Vec<f64>);

/// Log Bayes factors against nothing missing, in the scatter at the best answer [nats].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regret {
    /// Of the best answer that was found.
    pub found: f64,
    /// Of a fit that starts at the truth: the model as it was given, with what is hidden; or the same beside the ligaments where nothing missing fits best.
    pub truth: f64,
    /// What these trials tell of the truth: the same on readings without noise, both sides refitted. Where this is little, `none` is the right answer.
    pub information: f64,
    /// Sum of squares that the fit from the truth leaves, over the number of readings [-]. Well above 1 the data are not what the diagnosis' own model
    /// would answer with the truth, and no search can do better.
    pub leaves: f64,
}

impl Regret {
    /// By how much the search stays behind.
    pub fn short(&self) -> f64 {
        (self.truth - self.found).max(0.0)
    }
}

/// The hidden effects as a hypothesis, with sizes in units of their priors.
fn hypothesis(catalogue: &Catalogue, truth: &[Hidden]) -> Result<(Vec<Candidate>, Vec<f64>), DiagnosisError> {
    let (mut out, mut sizes) = (Vec::new(), Vec::new());
    for (name, structure, values) in truth {
        let (effect, variant) = catalogue.find(name)?;
        let variant = effect.variants.iter().position(|v| v == structure).unwrap_or(variant);
        sizes.extend(effect.parameter.iter().zip(values).map(|(p, v)| v / p.sd));
        out.push(Candidate { effect: effect.clone(), variant, scope: Scope::Both });
    }
    Ok((out, sizes))
}

/// The regret of a search; none where nothing is hidden.
///
/// Errors: an effect that the catalogue has not, a model that cannot be evaluated.
pub fn regret(
    problem: &Problem,
    (searcher, search): (&Searcher, &Search),
    truth: &[Hidden],
) -> Result<Option<Regret>, DiagnosisError> {
    if truth.is_empty() {
        return Ok(None);
    }
    let (hypothesis, sizes) = hypothesis(&problem.catalogue, truth)?;
    let start = [&problem.nuisance.given[..], &sizes].concat();
    let rests = starts_of(&problem.nearer(&hypothesis, &start, &[])?);
    let own = searcher.fit(&hypothesis, &start, &rests, &search.covariance, &search.readings, TRIES)?;
    let beside = beside((searcher, search), &hypothesis, &sizes, &search.readings)?;
    let fit = if beside.log_evidence > own.log_evidence { beside } else { own };
    let best = search.rivals.first().unwrap_or(&search.base);
    Ok(Some(Regret {
        found: searcher.gain(best, &search.base).max(0.0),
        truth: searcher.gain(&fit, &search.base),
        information: information(problem, (searcher, search), (&hypothesis, &start))?,
        leaves: searcher.total(&fit) / fit.residual.len() as f64,
    }))
}

/// A fit from true sizes beside the knee that fits best with nothing missing.
fn beside(
    (searcher, search): (&Searcher, &Search),
    hypothesis: &[Candidate],
    sizes: &[f64],
    readings: &Readings,
) -> Result<Fit, DiagnosisError> {
    let knee = hypothesis.first().map_or(vec![], |c| searcher.put_back(&search.base, c));
    let start = [&knee[..], sizes].concat();
    searcher.fit(hypothesis, &start, &search.base.coordinates(), &search.covariance, readings, TRIES)
}

/// What the trials tell of a hypothesis that is true at some unknowns, against nothing missing: both are refitted to what it would read without noise, nothing
/// missing from the model as given and from where it fits the data at hand.
fn information(
    problem: &Problem,
    (searcher, search): (&Searcher, &Search),
    (hypothesis, truth): (&[Candidate], &[f64]),
) -> Result<f64, DiagnosisError> {
    let at = searcher.standing(hypothesis, truth.to_vec(), &search.readings)?;
    let readings = Readings { measured: search.readings.pick(&at.linear.value), ..search.readings.clone() };
    let rests = at.coordinates();
    let fit = |hypothesis: &[Candidate], start: &[f64]| {
        searcher.fit(hypothesis, start, &rests, &search.covariance, &readings, TRIES)
    };
    let mut with = fit(hypothesis, truth)?;
    let other = beside((searcher, search), hypothesis, &truth[problem.nuisances()..], &readings)?;
    if other.log_evidence > with.log_evidence {
        with = other;
    }
    let mut without = fit(&[], &problem.nuisance.given)?;
    let other = fit(&[], &search.base.unknowns)?;
    if other.log_evidence > without.log_evidence {
        without = other;
    }
    Ok(searcher.gain(&with, &without))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_ahead_of_the_truth_regrets_nothing() {
        assert_eq!(Regret { found: 12.0, truth: 10.0, information: 10.0, leaves: 1.0 }.short(), 0.0);
        assert_eq!(Regret { found: 12.0, truth: 32.0, information: 32.0, leaves: 1.0 }.short(), 20.0);
    }

    #[test]
    fn what_is_hidden_is_told_in_the_catalogues_units() {
        let (of, sizes) = hypothesis(&Catalogue::shipped(), &[("structure_loss", "PCL", vec![1.0])]).unwrap();
        assert_eq!((of[0].variant_name().as_deref(), sizes), (Some("PCL"), vec![2.0]));
        assert!(hypothesis(&Catalogue::shipped(), &[("ghost", "", vec![1.0])]).is_err());
    }
}

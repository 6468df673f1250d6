//! Regret: by how much a search stays behind the truth of its own catalogue. For benches, where the truth is known.

use crate::candidate::{Candidate, Scope};
use crate::catalogue::Catalogue;
use crate::error::DiagnosisError;
use crate::problem::Problem;
use crate::search::{Search, Searcher, TRIES};
use sim::coordinate::Six;

/// An effect that is there in all data sets: its name, its variant, and its parameters in the catalogue's units.
pub type Hidden<'a> = (&'a str, &'a str, Vec<f64>);

/// Log Bayes factors against nothing missing, in the scatter at the best answer [nats].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Regret {
    /// Of the best answer that was found.
    pub found: f64,
    /// Of a fit that starts at the truth: the model as it was given, with what is hidden.
    pub truth: f64,
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
    let rests: Vec<Six> = problem.nearer(&hypothesis, &start, &[])?.iter().map(|r| r.q).collect();
    let fit = searcher.fit(&hypothesis, &start, &rests, &search.covariance, &search.readings, TRIES)?;
    let best = search.rivals.first().unwrap_or(&search.base);
    Ok(Some(Regret { found: searcher.gain(best, &search.base).max(0.0), truth: searcher.gain(&fit, &search.base) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_ahead_of_the_truth_regrets_nothing() {
        assert_eq!(Regret { found: 12.0, truth: 10.0 }.short(), 0.0);
        assert_eq!(Regret { found: 12.0, truth: 32.0 }.short(), 20.0);
    }

    #[test]
    fn what_is_hidden_is_told_in_the_catalogues_units() {
        let (of, sizes) = hypothesis(&Catalogue::shipped(), &[("structure_loss", "PCL", vec![1.0])]).unwrap();
        assert_eq!((of[0].variant_name().as_deref(), sizes), (Some("PCL"), vec![2.0]));
        assert!(hypothesis(&Catalogue::shipped(), &[("ghost", "", vec![1.0])]).is_err());
    }
}

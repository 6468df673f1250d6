//! Regret: by how much a search stays behind the truth of its own catalogue. For benches, where the truth is known.

use crate::effect::candidate::{Candidate, Scope};
use crate::effect::catalogue::Catalogue;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::search::{Search, Searcher, TRIES};
use serde::{Deserialize, Serialize};
use sim::equilibrium::starts_of;
use std::collections::BTreeMap;

/// An effect that is there, as whoever made the data tells it.
#[derive(Clone, Debug, PartialEq)]
pub struct Hidden {
    /// Its name in answers.
    pub effect: String,
    /// The structure or axis that it is about; the effect's first where nobody tells.
    pub variant: Option<String>,
    /// A data set, or "both".
    pub scope: String,
    /// Its parameters by name, in the catalogue's units. Of others that the catalogue has, a fit takes what it usually starts from.
    pub values: BTreeMap<String, f64>,
}

impl Hidden {
    /// In all data sets, with one parameter.
    pub fn of_all(effect: &str, variant: &str, (key, value): (&str, f64)) -> Hidden {
        Hidden {
            effect: effect.to_owned(),
            variant: Some(variant.to_owned()),
            scope: "both".to_owned(),
            values: [(key.to_owned(), value)].into(),
        }
    }
}

/// Log Bayes factors against nothing missing, in the scatter at the best answer [nats].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
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

/// The hidden effects as a hypothesis, with sizes in units of their priors; `sources` are the names of the data sets.
fn hypothesis(
    catalogue: &Catalogue,
    sources: &[String],
    truth: &[Hidden],
) -> Result<(Vec<Candidate>, Vec<f64>), DiagnosisError> {
    let (mut out, mut sizes) = (Vec::new(), Vec::new());
    for hidden in truth {
        let (effect, first) = catalogue.find(&hidden.effect)?;
        let told = hidden.variant.as_ref().and_then(|told| effect.variants.iter().position(|v| v == told));
        let scope = match sources.iter().position(|s| *s == hidden.scope) {
            Some(one) => Scope::Only(one),
            None if hidden.scope == "both" => Scope::Both,
            None => return Err(DiagnosisError::Component(format!("there is no data set {:?}", hidden.scope))),
        };
        let candidate = Candidate { effect: effect.clone(), variant: told.unwrap_or(first), scope };
        let usual = candidate.typical();
        sizes.extend(
            effect.parameter.iter().zip(usual).map(|(p, usual)| hidden.values.get(&p.key).map_or(usual, |v| v / p.sd)),
        );
        out.push(candidate);
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
    let (hypothesis, sizes) = hypothesis(&problem.catalogue, &problem.sources, truth)?;
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
    fn what_is_hidden_is_told_in_the_catalogues_units_and_where_it_is_hidden() {
        let sources = ["kla".to_owned(), "rks".to_owned()];
        let of = |hidden: Hidden| hypothesis(&Catalogue::shipped(), &sources, &[hidden]);
        let cut = Hidden::of_all("structure_loss", "PCL", ("loss", 1.0));
        let (told, sizes) = of(cut.clone()).unwrap();
        assert_eq!((told[0].variant_name().as_deref(), told[0].scope, sizes), (Some("PCL"), Scope::Both, vec![2.0]));
        let (told, _) = of(Hidden { scope: "rks".into(), ..cut.clone() }).unwrap();
        assert_eq!(told[0].scope, Scope::Only(1));
        // what a maker's own form does not have starts where fits do; what the catalogue does not have is no matter
        let values = [("k".to_owned(), 30.0), ("structure".to_owned(), 1.0)].into();
        let bundle = Hidden { effect: "extra_bundle".into(), variant: None, scope: "both".into(), values };
        let (told, sizes) = of(bundle).unwrap();
        let mut usual = told[0].typical();
        usual[0] = 0.5;
        assert_eq!((told[0].variant, sizes), (0, usual));
        assert!(of(Hidden { effect: "ghost".into(), ..cut.clone() }).is_err());
        assert!(of(Hidden { scope: "mri".into(), ..cut }).is_err());
    }
}

//! What the data do not exclude, whatever the verdict: one list for a reader and for a judge. A verdict of `none` says that no name has earned its place. It
//! does not say that the knee is whole: where trials barely feel a tear, recalibrated ligaments take it up, and the tear fits as well.

use crate::criteria::told_apart;
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::report::excluded::{best_torn, structures};
use crate::report::verdict::temper;
use crate::report::{MayBeTorn, Named, Value, Verdict, named, scope_name};
use crate::search::{Search, Searcher};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A state of the knee and of its measurement that the data do not exclude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NotExcluded {
    /// Its effects; none where nothing is missing.
    pub effects: Vec<Named>,
    /// The structure, where the state is a whole tear of one and nothing else.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torn: Option<String>,
    /// Log odds of the data against what the verdict rests on, both refitted: against nothing missing where the verdict is `none`, else against the best
    /// that was found. Of a tear before any prior of one [nats].
    pub log_odds: f64,
}

/// What is not excluded, the likeliest first. Of `open`, which a verdict of `none` comes with, those whose tear fits as well; for other verdicts the rivals
/// of the best and the tears that these data do not tell from it.
///
/// Errors: a model that cannot be evaluated.
pub(crate) fn not_excluded(
    searcher: &Searcher,
    search: &Search,
    verdict: Verdict,
    open: &[MayBeTorn],
) -> Result<Vec<NotExcluded>, DiagnosisError> {
    let mut out = if verdict == Verdict::None {
        let tears = open.iter().filter(|t| !t.fits_worse_torn).map(|t| (t.structure.clone(), t.log_odds));
        std::iter::once(nothing_missing(0.0)).chain(told(searcher, tears)).collect()
    } else {
        beside_the_best(searcher, search)?
    };
    // a stable order: of equals what stood first
    out.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
    Ok(out)
}

fn nothing_missing(log_odds: f64) -> NotExcluded {
    NotExcluded { effects: vec![], torn: None, log_odds }
}

/// Tears as states, each with its log odds.
fn told(searcher: &Searcher, tears: impl Iterator<Item = (String, f64)>) -> Vec<NotExcluded> {
    let losses = structures(searcher.problem);
    tears
        .filter_map(|(structure, log_odds)| {
            let of = losses.iter().find(|c| c.variant_name().as_deref() == Some(structure.as_str()))?;
            Some(NotExcluded { effects: vec![all_of(searcher, of)], torn: Some(structure), log_odds })
        })
        .collect()
}

/// A whole loss, told as an effect. It is held where it is, so its size has no scatter.
fn all_of(searcher: &Searcher, loss: &Candidate) -> Named {
    let whole = loss.effect.parameter.iter().map(|p| {
        let value = p.whole.unwrap_or(0.0);
        (p.key.clone(), Value { value, sd: 0.0, unit: p.unit.clone() })
    });
    Named {
        effect: loss.name(),
        scope: scope_name(searcher.problem, loss),
        variant: loss.variant_name(),
        parameters: whole.collect(),
    }
}

/// The best that was found, its rivals, nothing missing, and tears: what these data do not tell from the best.
fn beside_the_best(searcher: &Searcher, search: &Search) -> Result<Vec<NotExcluded>, DiagnosisError> {
    let (problem, base) = (searcher.problem, &search.base);
    let best = search.rivals.first().filter(|f| searcher.gain(f, base) > 0.0).unwrap_or(base);
    let temper = temper(searcher, best);
    let least = -told_apart() * temper;
    let top = searcher.gain(best, base);
    let rivals: Vec<(&Fit, f64)> =
        search.rivals.iter().map(|f| (f, searcher.gain(f, base) - top)).filter(|(_, odds)| *odds > least).collect();
    let mut out: Vec<NotExcluded> = rivals
        .iter()
        .map(|(f, log_odds)| NotExcluded { effects: named(problem, f, temper), torn: None, log_odds: *log_odds })
        .collect();
    out.extend((-top > least).then(|| nothing_missing(-top)));
    // a loss that stands there by itself already is told with its size
    let is_told = |c: &&Candidate| !rivals.iter().any(|(f, _)| f.hypothesis == std::slice::from_ref(*c));
    let losses = structures(problem);
    let tears: Vec<(String, f64)> = losses
        .par_iter()
        .filter(is_told)
        .filter_map(|c| Some((c, c.variant_name()?)))
        .map(|(c, structure)| {
            let torn = best_torn(searcher, search, c, best.log_evidence + least)?;
            Ok((structure, torn.log_evidence - best.log_evidence))
        })
        .collect::<Result<_, DiagnosisError>>()?;
    out.extend(told(searcher, tears.into_iter().filter(|(_, odds)| *odds > least)));
    Ok(out)
}

/// The tears of a list that no answer tells, in words: "a torn sMCL"; and, where it is there, that nothing is missing.
pub(crate) fn in_words(of: &[NotExcluded]) -> Vec<String> {
    let words = |n: &NotExcluded| match &n.torn {
        Some(structure) => Some(format!("a torn {structure}")),
        None if n.effects.is_empty() => Some("nothing missing".to_owned()),
        None => None,
    };
    of.iter().filter_map(words).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn torn(structure: &str, log_odds: f64) -> NotExcluded {
        NotExcluded { effects: vec![], torn: Some(structure.into()), log_odds }
    }

    #[test]
    fn what_is_not_excluded_is_told_in_its_order_and_effects_of_answers_are_not_told_twice() {
        let band = Named { effect: "itb".into(), scope: "kla".into(), variant: None, parameters: [].into() };
        let answer = NotExcluded { effects: vec![band], torn: None, log_odds: 0.0 };
        let list = [torn("sMCL", 0.4), nothing_missing(0.0), answer, torn("PCL", -2.0)];
        assert_eq!(in_words(&list), ["a torn sMCL", "nothing missing", "a torn PCL"]);
        assert!(in_words(&[]).is_empty());
    }

    #[test]
    fn the_file_tells_a_tear_by_its_structure_and_leaves_the_field_out_elsewhere() {
        let tear = serde_json::to_value(torn("PCL", -0.5)).unwrap();
        assert_eq!((tear["torn"].as_str(), tear["log_odds"].as_f64()), (Some("PCL"), Some(-0.5)));
        let nothing = serde_json::to_value(nothing_missing(0.0)).unwrap();
        assert!(nothing.get("torn").is_none() && nothing["effects"].as_array().is_some_and(Vec::is_empty));
    }
}

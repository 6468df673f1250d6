//! What the data do not exclude, whatever the verdict: one list for a reader and for a judge. A verdict of `none` says that no name has earned its place. It
//! does not say that the knee is whole: where trials barely feel a tear, recalibrated ligaments take it up, and the tear fits as well.

use crate::criteria::{TEMPER, WORTH_TELLING, told_apart};
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::report::excluded::{best_torn, structures};
use crate::report::verdict::temper;
use crate::report::words::listed;
use crate::report::{Diagnosis, MayBeTorn, Named, Value, Verdict, named, scope_name};
use crate::search::{Search, Searcher};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Odds above which no figure is worth giving [to one]. Ours: as good as certain to any reader.
const MOST_ODDS: f64 = 10_000.0;
/// Odds from which they are given as whole numbers [to one]. Ours: two figures.
const WHOLE_ODDS: f64 = 10.0;

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

impl NotExcluded {
    /// The structure of a tear that the data prefer to what the verdict rests on, and its log odds [nats].
    pub fn tear_ahead(&self) -> Option<(&str, f64)> {
        self.torn.as_deref().filter(|_| self.log_odds > 0.0).map(|structure| (structure, self.log_odds))
    }

    /// Whether it is the knee that lacks nothing.
    pub fn is_nothing(&self) -> bool {
        self.torn.is_none() && self.effects.is_empty()
    }
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

/// Log odds down to which a state is in the list [nats], below 0: the odds that tell answers apart, as loud as the data may speak.
pub fn least_log_odds(d: &Diagnosis) -> f64 {
    let [nothing, best] = d.misfit;
    let earns = d.verdict != Verdict::None && d.best_log_bayes_factor.is_some_and(|earned| earned > 0.0);
    let leaves = if earns { best } else { nothing };
    -told_apart() * TEMPER * leaves.max(1.0)
}

/// Log odds [nats] as odds in words: "75 to 1".
pub fn to_one(log_odds: f64) -> String {
    match log_odds.exp() {
        odds if odds >= MOST_ODDS => format!("more than {MOST_ODDS:.0} to 1"),
        odds if odds >= WHOLE_ODDS => format!("{odds:.0} to 1"),
        odds => format!("{odds:.1} to 1"),
    }
}

/// Tears of a list whose log odds [nats] are above 0, in its order.
pub(crate) fn ahead(of: &[NotExcluded]) -> Vec<(&str, f64)> {
    of.iter().filter_map(NotExcluded::tear_ahead).collect()
}

/// That tears fit better than a knee that lacks nothing, though no effect is proven; nothing where none is three times as likely. The list is one of a verdict of `none`.
/// `best`: log Bayes factor of the best effect that was found [nats]; it may fit better still.
pub(crate) fn fits_best(of: &[NotExcluded], best: Option<f64>) -> String {
    let told = ahead(of);
    let first = told.split_first().filter(|(first, _)| first.1 >= WORTH_TELLING);
    let Some((&(first, log_odds), others)) = first else { return String::new() };
    let odds = format!("({} by these trials alone, too little to name it)", to_one(log_odds));
    let mut out = if best.is_some_and(|earned| earned > log_odds) {
        format!("No effect is proven by these trials. Of tears, a torn {first} fits best {odds}.")
    } else {
        format!("No effect is proven by these trials. What fits best is a torn {first} {odds}.")
    };
    if !others.is_empty() {
        let each = others.iter().map(|(structure, log_odds)| format!("a torn {structure} ({})", to_one(*log_odds)));
        let comes = if others.len() == 1 { "comes" } else { "come" };
        let _ = write!(
            out,
            " After it {comes} {}, then a knee that lacks nothing.",
            list(&each.collect::<Vec<_>>(), "and")
        );
    }
    out
}

/// What a list holds that no answer tells, in words: the tears ahead of a knee that lacks nothing, that knee, then the tears behind it.
pub(crate) fn in_words(of: &[NotExcluded]) -> String {
    let Some(at) = of.iter().position(NotExcluded::is_nothing) else { return list(&tears(of), "or") };
    let (ahead, behind) = (tears(&of[..at]), tears(&of[at + 1..]));
    let first = if ahead.is_empty() {
        "that nothing is missing".to_owned()
    } else {
        format!("{}, or a knee that lacks nothing", ahead.join(", "))
    };
    if behind.is_empty() { first } else { format!("{first}; nor, less likely, {}", list(&behind, "or")) }
}

/// Tears as words: "a torn sMCL".
fn tears(of: &[NotExcluded]) -> Vec<String> {
    of.iter().filter_map(|n| n.torn.as_ref()).map(|structure| format!("a torn {structure}")).collect()
}

fn list(of: &[String], last: &str) -> String {
    listed(&of.iter().map(String::as_str).collect::<Vec<_>>(), last)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn torn(structure: &str, log_odds: f64) -> NotExcluded {
        NotExcluded { effects: vec![], torn: Some(structure.into()), log_odds }
    }

    #[test]
    fn what_is_not_excluded_has_its_order_in_words_and_effects_of_answers_are_not_told_twice() {
        let band = Named { effect: "itb".into(), scope: "kla".into(), variant: None, parameters: [].into() };
        let answer = NotExcluded { effects: vec![band], torn: None, log_odds: 0.0 };
        let list = [torn("sMCL", 0.4), nothing_missing(0.0), answer, torn("PCL", -2.0)];
        assert_eq!(in_words(&list), "a torn sMCL, or a knee that lacks nothing; nor, less likely, a torn PCL");
        // where nothing comes first it is a sentence; where it is excluded there is no word of it
        assert_eq!(in_words(&list[1..]), "that nothing is missing; nor, less likely, a torn PCL");
        let two = [torn("ACL", -0.1), torn("PCL", -2.0)];
        assert_eq!(in_words(&two), "a torn ACL or a torn PCL");
        assert_eq!(
            in_words(&[torn("ACL", 2.0), torn("PCL", 1.0), nothing_missing(0.0)]),
            "a torn ACL, a torn PCL, or a knee that lacks nothing"
        );
        assert!(in_words(&[]).is_empty());
    }

    #[test]
    fn tears_that_fit_better_than_nothing_stand_first_with_their_odds_and_no_other() {
        let list = [torn("PCL", 4.315), torn("ALS", 1.62), torn("POL", 0.07), nothing_missing(0.0), torn("PFL", -3.42)];
        let told = fits_best(&list, Some(-3.5));
        assert_eq!(
            told,
            "No effect is proven by these trials. What fits best is a torn PCL (75 to 1 by these trials alone, too little to name it). \
             After it come a torn ALS (5.1 to 1) and a torn POL (1.1 to 1), then a knee that lacks nothing."
        );
        // an effect that fits better still keeps its place
        assert!(fits_best(&list, Some(4.5)).contains("Of tears, a torn PCL fits best (75 to 1"));
        assert!(fits_best(&list[1..], None).contains("What fits best is a torn ALS"));
        assert_eq!(fits_best(&list[3..], None), "");
        // as likely as nothing is not ahead of it
        assert_eq!(fits_best(&[nothing_missing(0.0), torn("PCL", 0.0)], None), "");
        assert_eq!(to_one(40.0), "more than 10000 to 1");
    }

    #[test]
    fn the_file_tells_a_tear_by_its_structure_and_leaves_the_field_out_elsewhere() {
        let tear = serde_json::to_value(torn("PCL", -0.5)).unwrap();
        assert_eq!((tear["torn"].as_str(), tear["log_odds"].as_f64()), (Some("PCL"), Some(-0.5)));
        let nothing = serde_json::to_value(nothing_missing(0.0)).unwrap();
        assert!(nothing.get("torn").is_none() && nothing["effects"].as_array().is_some_and(Vec::is_empty));
    }
}

//! What `none` means, in plain words: whether all is explained, and which tears such trials leave open.

use super::clauses::bare;
use crate::criteria::told_apart;
use crate::effect::catalogue::Catalogue;
use crate::report::not_excluded::{fits_best, to_one};
use crate::report::words::{listed, place_of};
use crate::report::{Diagnosis, MayBeTorn};
use std::fmt::Write;

/// What `none` means: whether all is explained, and which tears fit better all the same.
pub(super) fn nothing(d: &Diagnosis) -> String {
    let worst = d.map.iter().filter(|c| c.significant).max_by(|a, b| a.z.abs().total_cmp(&b.z.abs()));
    let missed =
        worst.map(|c| format!("The model misses these trials in places by more than noise, most in {}.", place_of(c)));
    let better = fits_best(&d.not_excluded, d.best_log_bayes_factor);
    match missed {
        Some(missed) if !better.is_empty() => format!("{missed} {better}"),
        Some(missed) => format!("{missed} No effect of the catalogue explains that."),
        None if !better.is_empty() => better,
        None => "Nothing is missing from the model that these trials show.".to_owned(),
    }
}

/// The effect that comes nearest to a name, where these trials make it as much likelier than nothing as a finding that is taken for sure; its bench check. Tears
/// are told by themselves.
pub(super) fn nearest(catalogue: &Catalogue, d: &Diagnosis) -> String {
    let earned = d.best_log_bayes_factor.unwrap_or_default();
    if earned < told_apart() || d.best.iter().all(|e| e.effect == "structure_loss") {
        return String::new();
    }
    let effects: Vec<String> = d.best.iter().map(|e| bare(catalogue, e)).collect();
    let bench = d.best.first().and_then(|e| catalogue.find(&e.effect).ok()).map_or("", |(found, _)| &found.bench);
    format!(
        "Of all effects the nearest is: {}. These trials make it {} likelier than that nothing is missing; a name takes {}. To look at, at the bench: {bench}",
        effects.join(", with "),
        to_one(earned),
        to_one(d.threshold)
    )
}

/// Of `none`: structures that the data want slacker, which may be torn, and tears that such trials would not have named.
pub(super) fn open_tears(d: &Diagnosis) -> String {
    let mut out = String::new();
    let (slack, open): (Vec<&MayBeTorn>, Vec<&MayBeTorn>) = d.may_be_torn.iter().partition(|t| t.is_slackened());
    for (k, t) in slack.iter().enumerate() {
        // the test that would tell stands before it, so it is no "but" to the first sentence
        let lead = if k == 0 { "The model fits" } else { "And it fits" };
        let _ = write!(out, "\n{lead} only with {}", slackened(t));
    }
    out += &missed_tears(&open, d.threshold);
    if !d.may_be_torn.is_empty() && d.before.is_empty() {
        out += "\nData of the same knee from while it was whole would tell: add them by --before NAME=FILE.";
    }
    out
}

/// Which tears such trials would not name, and which of these the readings speak against all the same. Others that are open stand in what is not excluded.
fn missed_tears(open: &[&MayBeTorn], threshold: f64) -> String {
    let names = |of: &[&MayBeTorn]| listed(&of.iter().map(|t| t.structure.as_str()).collect::<Vec<_>>(), "or");
    let missed: Vec<&MayBeTorn> = open.iter().copied().filter(|t| t.would_be_missed(threshold)).collect();
    if missed.is_empty() {
        return String::new();
    }
    let against: Vec<&MayBeTorn> = missed.iter().copied().filter(|t| t.fits_worse_torn).collect();
    let mut out = format!("\nA whole tear of the {} would not be named by these trials.", names(&missed));
    if !against.is_empty() {
        let _ = write!(out, " These readings speak against a tear of the {} all the same.", names(&against));
    }
    out
}

/// A structure slacker than it was given, with which alone the model fits, and what that may be.
fn slackened(t: &MayBeTorn) -> String {
    let MayBeTorn { structure, now_n, given_n, slack, .. } = t;
    format!(
        "a slacker {structure} than it was given: it carries {now_n:.0} N at most in these trials, not {given_n:.0} N. It is torn, or slack by {:.0} % \
         of its length or more; these trials cannot tell which.",
        100.0 * slack
    )
}

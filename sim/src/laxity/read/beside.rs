//! Words beside the numbers: rows that are flagged as no readings, and rows that sum up others.

use crate::laxity::LaxityTrial;
use notices::{Kind, Notice};

/// Words of a flag that says that the row is no reading.
const EXCLUDED: [&str; 18] = [
    "exclude",
    "excluded",
    "bad",
    "invalid",
    "reject",
    "rejected",
    "discard",
    "discarded",
    "fail",
    "failed",
    "outlier",
    "omit",
    "omitted",
    "artefact",
    "artifact",
    "slipped",
    "ausgeschlossen",
    "verworfen",
];
/// Words that say the opposite, up to [`REACH`] words before them: "did not fail".
const NOT: [&str; 12] =
    ["not", "no", "non", "never", "without", "nicht", "kein", "keine", "ohne", "didn", "isn", "wasn"];
const REACH: usize = 3;
/// Words that say the opposite right behind them: "bad=0".
const FALSE: [&str; 5] = ["0", "false", "falsch", "free", "safe"];
/// The same, where nothing follows that they may belong to: "excluded: no", but not "excluded: no signal".
const NO: [&str; 4] = ["no", "n", "nein", "none"];
/// Words that say the opposite wherever they stand.
const KEPT: [&str; 2] = ["kept", "behalten"];
/// Words that the name of a row of means begins or ends with.
const MEANS: [&str; 6] = ["mean", "average", "avg", "median", "mittelwert", "moyenne"];
/// Words that the name of a row of standard deviations or their like begins or ends with.
const SCATTERS: [&str; 5] = ["sd", "std", "stdev", "sem", "cv"];
/// Single trials that a row sums up, at least.
const LEAST_SINGLES: usize = 2;

fn words(text: &str) -> Vec<String> {
    let small = text.to_lowercase();
    small.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).map(str::to_owned).collect()
}

fn is_in(word: &str, list: &[&str]) -> bool {
    list.contains(&word)
}

/// Whether words beside the one at `at` say the opposite of it.
fn is_negated(words: &[String], at: usize) -> bool {
    let next = words.get(at + 1).map_or("", String::as_str);
    let ends = words.get(at + 2).is_none_or(|w| is_in(w, &EXCLUDED));
    let before = &words[at.saturating_sub(REACH)..at];
    before.iter().any(|w| is_in(w, &NOT)) || is_in(next, &FALSE) || ends && is_in(next, &NO)
}

/// Whether a text says that its row is no reading.
fn excludes(text: &str) -> bool {
    let of_part = |part: &str| {
        let words = words(part);
        (0..words.len()).any(|at| is_in(&words[at], &EXCLUDED) && !is_negated(&words, at))
    };
    !words(text).iter().any(|w| is_in(w, &KEPT)) && text.split([';', ',', '|', '.', '(']).any(of_part)
}

/// What is said of a row whose flag or comment says that it is no reading.
pub(super) fn excluded(row: usize, column: &str, text: &str) -> Option<Notice> {
    excludes(text).then(|| {
        let what = "says that the row is no reading, and it is read as one: leave the row out";
        Kind::RowFlagged.notice(format!("row {row}, column \"{column}\": \"{text}\" {what}")).row(row).column(column)
    })
}

/// Whether a name begins or ends with one of these words.
fn is_called(name: &str, list: &[&str]) -> bool {
    let words = words(name);
    [words.first(), words.last()].into_iter().flatten().any(|w| is_in(w, list))
}

/// Whether a row sums up others, by its name.
pub(super) fn is_summary(name: &str) -> bool {
    is_called(name, &MEANS) || is_called(name, &SCATTERS)
}

/// Whether a row sums up the single trials of its test and flexion, by its name and its reading: a mean lies among theirs, a standard deviation is no
/// more than their range. Names that begin with somebody's initials are none.
fn sums_up(t: &LaxityTrial, all: &[LaxityTrial]) -> bool {
    let reading = t.test.coordinate().and_then(|c| Some((c, t.measured[c]?)));
    let Some((c, reading)) = reading.filter(|_| is_summary(&t.trial)) else { return false };
    let flexion = |t: &LaxityTrial| t.nominal_flexion_deg.round() as i64;
    let is_single = |o: &&LaxityTrial| {
        let numbered = o.trial.ends_with(|x: char| x.is_ascii_digit());
        o.test == t.test && flexion(o) == flexion(t) && numbered && !is_summary(&o.trial)
    };
    let singles: Vec<f64> = all.iter().filter(is_single).filter_map(|o| o.measured[c]).collect();
    let (low, high) = singles.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let is_among = (low..=high).contains(&reading);
    let is_scatter = !is_among && (0.0..=high - low).contains(&reading);
    singles.len() >= LEAST_SINGLES && if is_called(&t.trial, &MEANS) { is_among } else { is_scatter }
}

/// What is said of rows that sum up others, where most rows do not.
pub(super) fn summaries(trials: &[LaxityTrial]) -> Option<Notice> {
    let found: Vec<&LaxityTrial> = trials.iter().filter(|t| sums_up(t, trials)).collect();
    let first = found.first().filter(|_| 2 * found.len() < trials.len())?;
    let text = format!(
        "{} trials sum up others by their names, the first \"{}\", and count as measurements of their own: leave rows of means and standard deviations out",
        found.len(),
        first.trial
    );
    Some(Kind::RowFlagged.notice(text).count(found.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_understood_with_their_negations() {
        for text in
            ["exclude", "bad=1", "Outlier; redo", "excluded: no signal", "no load, bad", "verworfen", "ausgeschlossen"]
        {
            assert!(excludes(text), "{text}");
        }
        for text in [
            "",
            "moving",
            "bad=False",
            "reject=0",
            "not excluded",
            "no outlier",
            "did not fail",
            "good; not bad",
            "outlier: no",
            "bad=no outlier=no",
            "outlier, but kept",
            "fail-safe",
            "outlier free",
            "nicht verworfen",
        ] {
            assert!(!excludes(text), "{text}");
        }
    }
}

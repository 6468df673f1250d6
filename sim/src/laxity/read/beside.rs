//! Words beside the numbers: rows that are flagged as no readings, and rows that sum up others.

use crate::laxity::LaxityTrial;
use notices::{Kind, Notice};

/// Words of a flag that says that the row is no reading.
const EXCLUDED: [&str; 16] = [
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
];
/// Words of the name of a row that sums up others.
const SUMMARIES: [&str; 11] =
    ["mean", "average", "avg", "sd", "std", "stdev", "median", "sem", "cv", "mittelwert", "moyenne"];

fn says(text: &str, words: &[&str]) -> bool {
    text.to_lowercase().split(|c: char| !c.is_alphanumeric()).any(|word| words.contains(&word))
}

/// What is told of a row whose flag says that it is no reading.
pub(super) fn excluded(row: usize, flags: &str) -> Option<Notice> {
    says(flags, &EXCLUDED).then(|| {
        let what = "says that the row is no reading, and it is read as one: leave the row out";
        Kind::RowFlagged.notice(format!("row {row}, column \"flags\": \"{flags}\" {what}")).row(row).column("flags")
    })
}

/// Whether a row sums up others, by its name.
pub(super) fn is_summary(name: &str) -> bool {
    says(name, &SUMMARIES)
}

/// What is told of rows that sum up others, where most rows do not.
pub(super) fn summaries(trials: &[LaxityTrial]) -> Option<Notice> {
    let found: Vec<&LaxityTrial> = trials.iter().filter(|t| is_summary(&t.trial)).collect();
    let first = found.first().filter(|_| 2 * found.len() < trials.len())?;
    let text = format!(
        "{} trials sum up others by their names, the first \"{}\", and count as measurements of their own: leave rows of means and standard deviations out",
        found.len(),
        first.trial
    );
    Some(Kind::RowFlagged.notice(text).count(found.len()))
}

//! The standard columns of a laxity file, and its errors.

use super::LaxityTrial;
use crate::coordinate::{Coordinate, FREE};
use std::collections::BTreeSet;

/// What is wrong with a laxity file, in words for the person who owns it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LaxityError {
    /// A row is at fault.
    #[error("row {row}{}{}: {what}", in_brackets(trial), after_comma(column))]
    Row {
        /// Its number, the header being row 1.
        row: usize,
        /// The trial's name, where that is known.
        trial: Option<String>,
        /// The column: its name in quotes, or its number.
        column: Option<String>,
        /// What is wrong, what was expected, what to do.
        what: String,
    },
    /// The file as a whole, or the declaration of its shape.
    #[error("{0}")]
    File(String),
}

fn in_brackets(trial: &Option<String>) -> String {
    trial.as_ref().map_or(String::new(), |name| format!(" ({name})"))
}

fn after_comma(column: &Option<String>) -> String {
    column.as_ref().map_or(String::new(), |name| format!(", column {name}"))
}

impl LaxityError {
    /// A row at fault.
    pub(super) fn row(row: usize, what: String) -> LaxityError {
        LaxityError::Row { row, trial: None, column: None, what }
    }

    /// A cell at fault; `column` is a name in quotes or a number.
    pub(super) fn cell(row: usize, column: String, what: String) -> LaxityError {
        LaxityError::Row { row, trial: None, column: Some(column), what }
    }

    /// A trial at fault.
    pub(super) fn trial(t: &LaxityTrial, column: Option<&str>, what: String) -> LaxityError {
        let column = column.map(|c| format!("\"{c}\""));
        LaxityError::Row { row: t.row.unwrap_or(0), trial: Some(t.trial.clone()), column, what }
    }
}

/// Tension of the quadriceps [N], optional.
pub(super) const QUADRICEPS_COLUMN: &str = "load_quadriceps_n";
/// Ligaments and bundles that were cut, as [`cut_cell`] joins them; optional.
pub const WITHOUT_COLUMN: &str = "without";
/// Between two names of the column [`WITHOUT_COLUMN`].
pub(super) const AND: char = '+';

/// Names of what was cut as the column [`WITHOUT_COLUMN`] has them: `ACL+ALS`; empty for a whole knee.
pub fn cut_cell(names: &[String]) -> String {
    names.join(&AND.to_string())
}

/// Whether a column is what a model answered: the model's name, forces of bundles and groups, contact, what bodies tell of themselves, and bands of all these and of
/// poses. It is passed over.
pub(super) fn is_output(name: &str) -> bool {
    let band = ["_mean", "_lower", "_upper"].iter().find_map(|end| name.strip_suffix(end));
    let column = band.unwrap_or(name);
    let of_a_body = ["patella_", "patellar_", "meniscus_", "contact_"].iter().any(|body| column.starts_with(body));
    let of_a_pose = band.is_some() && FREE.into_iter().any(|c| c.column() == column);
    name == "model"
        || of_a_body
        || of_a_pose
        || (["force_", "group_"].iter().any(|k| column.starts_with(k)) && column.ends_with("_n"))
}

/// Columns of free text.
const COMMENTS: [&str; 6] = ["comment", "comments", "note", "notes", "remark", "remarks"];

/// Whether a column is free text. Words that exclude its row are looked for in it, as in flags.
pub(super) fn is_comment(name: &str) -> bool {
    COMMENTS.iter().any(|comment| name.eq_ignore_ascii_case(comment))
}

/// Every column that a laxity file may have.
pub(super) fn known_columns() -> BTreeSet<String> {
    let mut known: BTreeSet<String> = required_columns().into_iter().collect();
    known.extend(["branch", "order", "time_s", "flags", "reference"].map(String::from));
    known.extend([QUADRICEPS_COLUMN, WITHOUT_COLUMN].map(String::from));
    known.extend(FREE.map(sd_column));
    known
}

/// `sd_vv_deg` and its fellows.
pub(super) fn sd_column(c: Coordinate) -> String {
    format!("sd_{}", c.column())
}

/// The columns every laxity file has, in order.
pub(super) fn required_columns() -> Vec<String> {
    let mut names = vec!["trial".to_owned(), "test".to_owned(), "nominal_flexion_deg".to_owned()];
    names.extend(FREE.map(Coordinate::load_column));
    names.push("fe_deg".to_owned());
    names.extend(FREE.map(Coordinate::column));
    names
}

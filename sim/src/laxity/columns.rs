//! The standard columns of a laxity file, and its errors.

use crate::coordinate::{Coordinate, FREE};
use std::collections::BTreeSet;

/// What is wrong with a laxity file, in words for the person who owns it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct LaxityError(pub String);

/// Every column that a laxity file may have.
pub(super) fn known_columns() -> BTreeSet<String> {
    let mut known: BTreeSet<String> = required_columns().into_iter().collect();
    known.extend(["branch", "order", "time_s", "flags", "reference"].map(String::from));
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

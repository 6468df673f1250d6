//! The standard columns of a laxity file, and its errors.

use crate::coordinate::{Coordinate, FREE};
use std::collections::BTreeSet;

/// What is wrong with a laxity file, in words for the person who owns it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct LaxityError(pub String);

/// Tension of the quadriceps [N], optional.
pub(super) const QUADRICEPS_COLUMN: &str = "load_quadriceps_n";

/// Whether a column is what a model answered: forces of bundles, and what bodies tell of themselves. It is passed over.
pub(super) fn is_output(name: &str) -> bool {
    let of_a_body = ["patella_", "patellar_", "meniscus_"].iter().any(|body| name.starts_with(body));
    of_a_body || (name.starts_with("force_") && name.ends_with("_n"))
}

/// Every column that a laxity file may have.
pub(super) fn known_columns() -> BTreeSet<String> {
    let mut known: BTreeSet<String> = required_columns().into_iter().collect();
    known.extend(["branch", "order", "time_s", "flags", "reference"].map(String::from));
    known.insert(QUADRICEPS_COLUMN.to_owned());
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

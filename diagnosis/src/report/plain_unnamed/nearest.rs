//! What the best that was found closes and leaves, and which others close most of a gap, in plain words.

use super::rows::row;
use crate::report::words::{figures, with_unit};
use crate::report::{Against, DataSetAlone, Diagnosis, Left, Named, Tried, Unexplained};
use sim::coordinate::Coordinate;

/// Readings that the nearest leaves most of, in the head [-].
const LEFT_IN_HEAD: usize = 3;
/// Share of the gap on unseen trials, or of what data sets differ by, that is most of it [-].
pub(super) const MOST_OF_IT: f64 = 0.5;
/// Answers beside the best that are told as closing most of it, at most [-].
const OTHERS: usize = 2;

/// Where even the best that was found leaves most; nothing where nobody asked.
pub(crate) fn leaves_most(d: &Diagnosis) -> String {
    let is_too_much = best_row(d).is_some_and(|t| t.against.contains(&Against::LeavesTooMuch));
    d.unexplained.as_ref().map_or(String::new(), |why| leaves_most_of(why, is_too_much))
}

/// The row of the best that was found, where it was tried.
pub(super) fn best_row(d: &Diagnosis) -> Option<&Tried> {
    d.unexplained.iter().flat_map(|why| &why.tried).find(|t| is_best(t, &d.best))
}

/// Whether a row is of the effects of the best, each in its place and about the same structure or axis.
fn is_best(row: &Tried, best: &[Named]) -> bool {
    let what = |e: &Named| (e.effect.clone(), e.variant.clone(), e.scope.clone());
    row.effects.iter().map(what).eq(best.iter().map(what))
}

/// The same of a table; `is_too_much` where that stands against the best.
fn leaves_most_of(why: &Unexplained, is_too_much: bool) -> String {
    if why.left.is_empty() {
        return String::new();
    }
    let one = |l: &Left| {
        let unit = Coordinate::named(&l.dof).map_or("", Coordinate::unit);
        let (read, given) = (with_unit(l.reading.value, unit), with_unit(l.expected, unit));
        format!("{} reads {read} of {}, it gives {given}", row(&l.reading), l.dof.to_uppercase())
    };
    let told: Vec<String> = why.left.iter().take(LEFT_IN_HEAD).map(one).collect();
    let of_set = |s: &DataSetAlone| Some(format!("{} {}", s.source, figures(s.with_best?)));
    let by_set: Vec<String> = why.data_sets.iter().filter_map(of_set).collect();
    let units = "in units of what noise leaves";
    let sets = if by_set.is_empty() { String::new() } else { format!(" ({}, {units})", by_set.join(", ")) };
    let told = told.join("; ");
    if is_too_much {
        format!("\nEven it leaves too much{sets}, most in these rows: {told}.")
    } else {
        format!("\nWhat it leaves{sets} is most in these rows: {told}.")
    }
}

/// What the best that was found closes on trials that it was not fitted to; nothing where nobody asked.
pub(crate) fn closing(d: &Diagnosis) -> String {
    let Some(unseen) = best_row(d).and_then(|t| t.closes_held_out) else { return String::new() };
    format!("; it closes {:.0} % of that gap", 100.0 * unseen.max(0.0))
}

/// Answers beside the best that close most of the gap on trials that they were not fitted to, with their shares, the largest first.
pub(crate) fn closing_most(d: &Diagnosis) -> Vec<(&[Named], f64)> {
    let rows = d.unexplained.iter().flat_map(|why| &why.tried).filter(|t| !is_best(t, &d.best));
    let shares = rows.filter_map(|t| Some((t.effects.as_slice(), t.closes_held_out?)));
    let mut out: Vec<(&[Named], f64)> = shares.filter(|(_, share)| *share >= MOST_OF_IT).collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.truncate(OTHERS);
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::contradiction::Witness;
    use std::collections::BTreeMap;

    /// A reading without load; a load that a row does not tell counts as none.
    fn unloaded(source: &str, row: usize, value: f64) -> Witness {
        let (source, trial) = (source.to_owned(), "Passive_30deg".to_owned());
        Witness { source, row: Some(row), trial, flexion_deg: 30.0, loads: BTreeMap::new(), value }
    }

    #[test]
    fn what_even_the_best_leaves_is_told_by_its_rows_and_data_sets() {
        let left = |k: usize| Left { dof: "ie".into(), reading: unloaded("rks", k, -31.5), expected: -20.1, z: -9.0 };
        let set = DataSetAlone {
            source: "rks".into(),
            readings: 125,
            alone: 3.0,
            cost: 1.0,
            together: 5.0,
            with_best: Some(4.25),
        };
        let why =
            Unexplained { data_sets: vec![set], two_knees: None, tried: vec![], left: (9..14).map(left).collect() };
        let told = leaves_most_of(&why, true);
        assert!(
            told.contains("Even it leaves too much (rks 4.25")
                && told.contains("row 9 of rks reads -31.5 deg of IE, it gives -20.1 deg"),
            "{told}"
        );
        assert_eq!(told.matches(" reads ").count(), LEFT_IN_HEAD, "{told}");
        // where something else stands against it, what it leaves is not called too much
        let told = leaves_most_of(&why, false);
        assert!(told.contains("What it leaves (rks 4.25") && !told.contains("too much"), "{told}");
        assert_eq!(leaves_most_of(&Unexplained { left: vec![], ..why }, true), "");
    }

    /// The share that one ligament's loss closes is never told of another's.
    #[test]
    fn a_row_is_of_the_best_only_where_it_is_about_the_same_structure() {
        let lost = |structure: &str| Named {
            effect: "structure_loss".into(),
            scope: "both".into(),
            variant: Some(structure.into()),
            parameters: BTreeMap::new(),
        };
        let row = Tried {
            effects: vec![lost("ACL")],
            closes: 0.6,
            closes_held_out: Some(0.6),
            leaves: Some(2.0),
            log_bayes_factor: 9.0,
            against: vec![Against::LeavesTooMuch],
        };
        assert!(is_best(&row, &[lost("ACL")]));
        assert!(!is_best(&row, &[lost("PCL")]) && !is_best(&row, &[]));
        assert!(!is_best(&row, &[Named { scope: "kla".into(), ..lost("ACL") }]));
    }
}

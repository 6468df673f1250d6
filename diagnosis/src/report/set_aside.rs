//! Trials that jumped: what neither nothing missing nor the best hypothesis explains, told by its row and by the reading that is furthest off.

use crate::problem::Problem;
use crate::problem::trial::row_of;
use crate::report::SetAside;
use crate::report::plain_unnamed::row;
use crate::report::words::{figures, with_unit};
use crate::search::Search;
use crate::search::contradiction::witness;
use sim::coordinate::Coordinate;

/// Coordinates that turn.
const TURNS: [&str; 2] = ["vv", "ie"];

/// In words: "row 13 of rks (Valgus_60deg) reads 3.10 deg of VV in place of 9.40 deg (sd 0.600)".
pub(crate) fn in_words(of: &SetAside) -> String {
    let unit = if TURNS.contains(&of.dof.as_str()) { "deg" } else { "mm" };
    let trial = if of.at.row.is_some() { format!(" ({})", of.at.trial) } else { String::new() };
    format!(
        "{}{trial} reads {} of {} in place of {} (sd {})",
        row(&of.at),
        with_unit(of.at.value, unit),
        of.dof.to_uppercase(),
        with_unit(of.expected, unit),
        figures(of.sd)
    )
}

/// Those that neither nothing missing nor the best explains, in the order in which they were set aside.
pub(crate) fn set_aside(problem: &Problem, search: &Search) -> Vec<SetAside> {
    let best = search.rivals.first().unwrap_or(&search.base);
    let in_both = best.outliers.iter().filter(|i| search.base.outliers.contains(i));
    let of = |&trial: &usize| {
        let sd = |dof: Coordinate| search.covariance[(row_of(trial, dof), row_of(trial, dof))].sqrt();
        let own = search.readings.rows.iter().enumerate().filter(|(_, (t, _))| *t == trial);
        let off = own.map(|(r, (_, dof))| (best.residual[r].abs() / sd(*dof), r, *dof));
        let (_, r, dof) = off.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let at = witness(problem, trial, search.readings.measured[r]);
        let expected = best.linear.value[row_of(trial, dof)];
        Some(SetAside { at, dof: dof.name().to_owned(), expected, sd: sd(dof) })
    };
    in_both.filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::contradiction::Witness;
    use sim::coordinate::VV;
    use std::collections::BTreeMap;

    #[test]
    fn a_trial_that_jumped_is_told_by_its_row_and_one_of_no_file_by_its_name() {
        let at = |row: Option<usize>| Witness {
            source: "rks".into(),
            row,
            trial: "Valgus_60deg".into(),
            flexion_deg: 60.0,
            loads: BTreeMap::new(),
            value: 3.1,
        };
        let told = |row| in_words(&SetAside { at: at(row), dof: VV.name().to_owned(), expected: 9.4, sd: 0.6 });
        let reads = "reads 3.10 deg of VV in place of 9.40 deg (sd 0.600)";
        assert_eq!(told(Some(13)), format!("row 13 of rks (Valgus_60deg) {reads}"));
        assert_eq!(told(None), format!("Valgus_60deg of rks {reads}"));
    }
}

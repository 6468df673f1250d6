//! What a knee predicts of loads that its own data did not have: other flexions, other directions.

use super::figures::half_width;
use super::read::{Build, Read, Rows, flexions, share};
use std::collections::{BTreeMap, BTreeSet};

type Row = BTreeMap<String, String>;

/// Tests of a data set that load the knee: kind and nominal flexion [deg], rounded as the table of ranges has it.
type Tests = BTreeSet<(String, i64)>;

/// A load below this share of the other end's is none [-]. Ours: an apparatus at rest reads a few newtons.
const NO_LOAD: f64 = 0.1;

/// The share within their intervals of ranges at flexions that the predicting knee's data did not load.
pub(super) fn at_other_flexions(build: &Build) -> Option<(f64, Read)> {
    of_ranges(build, is_at_another_flexion, within)
}

/// How wide those intervals are.
pub(super) fn width_at_other_flexions(build: &Build) -> Option<(f64, Read)> {
    of_ranges(build, is_at_another_flexion, half_width)
}

/// The share of ranges in directions that these data did not load at any flexion.
pub(super) fn in_other_directions(build: &Build) -> Option<(f64, Read)> {
    of_ranges(build, is_in_another_direction, within)
}

/// How wide those intervals are.
pub(super) fn width_in_other_directions(build: &Build) -> Option<(f64, Read)> {
    of_ranges(build, is_in_another_direction, half_width)
}

fn is_at_another_flexion(range: &Row, own: &Tests) -> bool {
    flexion(range, "flexion [deg]").is_some_and(|fe| own.iter().all(|(_, f)| *f != fe))
}

fn is_in_another_direction(range: &Row, own: &Tests) -> bool {
    spanned(range).iter().any(|kind| own.iter().all(|(k, _)| k != kind))
}

/// The share of ranges within their intervals.
fn within(ranges: &Rows) -> Option<f64> {
    share(ranges, |r| r.get("inside").is_some_and(|i| i == "yes"))
}

/// A number of the ranges that are chosen by the tests of the knee that predicts them.
fn of_ranges(
    build: &Build,
    is_chosen: fn(&Row, &Tests) -> bool,
    number: fn(&Rows) -> Option<f64>,
) -> Option<(f64, Read)> {
    let mut read = build.file("validate", "cross_prediction.csv")?;
    let rows = read.rows();
    let models: BTreeSet<&String> = rows.iter().filter_map(|r| r.get("model")).collect();
    let mut chosen = Rows::new();
    for model in models {
        let fit = build.file("calibrate", &format!("{model}/fit.csv"))?;
        read.as_built &= fit.as_built;
        let own = loaded(&fit.rows());
        chosen.extend(rows.iter().filter(|r| r.get("model") == Some(model) && is_chosen(r, &own)).cloned());
    }
    read.flexions_deg = flexions(&chosen, "flexion [deg]");
    Some((number(&chosen)?, read))
}

/// The tests of a data set that load the knee.
fn loaded(fit: &Rows) -> Tests {
    let one = |r: &Row| Some((r.get("test").filter(|t| *t != "neutral")?.clone(), flexion(r, "nominal_flexion_deg")?));
    fit.iter().filter_map(one).collect()
}

fn flexion(row: &Row, column: &str) -> Option<i64> {
    row.get(column)?.parse::<f64>().ok().map(|fe| fe.round() as i64)
}

/// Kinds of tests that a range spans, by its coordinate and the signs of its two loads.
fn spanned(range: &Row) -> Vec<&'static str> {
    let word = |column: &str| range.get(column).and_then(|cell| cell.split(' ').next()).unwrap_or("");
    let [negative, positive] = match word("change of") {
        "ap" => ["posterior", "anterior"],
        "ie" => ["internal", "external"],
        "vv" => ["varus", "valgus"],
        _ => return vec![],
    };
    let loads = ["from", "to"].map(|end| word(end).parse::<f64>().unwrap_or(0.0));
    let least = NO_LOAD * loads[0].abs().max(loads[1].abs());
    let kind = |load: f64| (load.abs() > least).then_some(if load < 0.0 { negative } else { positive });
    loads.into_iter().filter_map(kind).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(cells: &[(&str, &str)]) -> Row {
        cells.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
    }

    #[test]
    fn a_range_spans_the_directions_of_its_loads_and_rest_is_none() {
        let of = |what, from, to| spanned(&row(&[("change of", what), ("from", from), ("to", to)]));
        assert_eq!(of("ap [mm]", "-203.9 N", "196.6 N"), ["posterior", "anterior"]);
        assert_eq!(of("ap [mm]", "0.3 N", "177.9 N"), ["anterior"]);
        assert_eq!(of("ie [deg]", "0.0 N m", "-5.0 N m"), ["internal"]);
        assert_eq!(of("vv [deg]", "-10.1 N m", "9.8 N m"), ["varus", "valgus"]);
        assert!(of("si [mm]", "0 N", "50 N").is_empty());
    }

    #[test]
    fn an_unloaded_position_is_no_flexion_that_was_loaded() {
        let fit = |test, fe| row(&[("test", test), ("nominal_flexion_deg", fe)]);
        let own = loaded(&vec![fit("neutral", "0"), fit("anterior", "30"), fit("anterior", "30")]);
        assert_eq!(own.into_iter().collect::<Vec<_>>(), [("anterior".to_owned(), 30)]);
    }
}

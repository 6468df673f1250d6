//! How a number of evidence is read from a stage's files.

use super::read::{Build, Read, Rows, largest, numbers, share, smallest};
use crate::stage::BETWEEN_TEAMS;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;

/// Design variables that are reference strains, and those that are stiffnesses, by their numbers [andreassen2025, table 3].
const STRAINS: RangeInclusive<u32> = 1..=14;
const STIFFNESSES: RangeInclusive<u32> = 15..=26;

/// A number of a stage's metrics.json, at each of some paths of two keys; `*` is every key, an empty key ends the path.
pub(super) fn metrics(
    build: &Build,
    stage: &str,
    paths: &[[&str; 2]],
    by: fn(Vec<f64>) -> Option<f64>,
) -> Option<(f64, Read)> {
    let read = build.file(stage, "metrics.json")?;
    let json = read.json();
    let at = |path: &[&str; 2]| -> Vec<f64> {
        let first = &json[path[0]];
        match path[1] {
            "" => first.as_f64().into_iter().collect(),
            "*" => first.as_object().into_iter().flat_map(|m| m.values()).filter_map(|v| v.as_f64()).collect(),
            key => first[key].as_f64().into_iter().collect(),
        }
    };
    Some((by(paths.iter().flat_map(at).collect())?, read))
}

/// A figure of the calibrated model's metrics, or the worst of several.
pub(super) fn of_model(build: &Build, key: &str, by: fn(Vec<f64>) -> Option<f64>) -> Option<(f64, Read)> {
    let read = build.file("calibrate", "metrics.json")?;
    let value = read.json()[build.model.as_ref()?][key].clone();
    let each = match value.as_object() {
        Some(map) => map.values().filter_map(|v| v.as_f64()).collect(),
        None => value.as_f64().into_iter().collect(),
    };
    Some((by(each)?, read))
}

/// A number of a stage's table.
pub(super) fn table(build: &Build, stage: &str, file: &str, of: impl Fn(&Rows) -> Option<f64>) -> Option<(f64, Read)> {
    let read = build.file(stage, file)?;
    Some((of(&read.rows())?, read))
}

pub(super) fn cell(row: &BTreeMap<String, String>, column: &str) -> Option<f64> {
    row.get(column)?.parse().ok()
}

/// The largest move of AP in a drawer by what is changed.
pub(super) fn sensitive(build: &Build, changed: &str) -> Option<(f64, Read)> {
    table(build, "validate", "sensitivity.csv", |rows| {
        let own = rows.iter().filter(|r| r.get("changed").is_some_and(|c| c == changed));
        largest(own.filter(|r| r.get("drawer").is_some_and(|d| d == "yes")).filter_map(|r| cell(r, "ap_mm")))
    })
}

/// The largest change of a bundle's force, in drawers and pivot shift, by what is changed.
pub(super) fn force_moved(build: &Build, changed: &str) -> Option<(f64, Read)> {
    table(build, "validate", "sensitivity.csv", |rows| {
        let own = rows.iter().filter(|r| r.get("changed").is_some_and(|c| c == changed));
        largest(own.filter_map(|r| cell(r, "force_n")))
    })
}

/// How far the ends of several starts lie apart in a reference strain, of its least [%]; none of one start.
pub(super) fn strains_of_starts(rows: &Rows) -> Option<f64> {
    spread_of_starts(rows, STRAINS)
}

/// The same in a stiffness.
pub(super) fn stiffnesses_of_starts(rows: &Rows) -> Option<f64> {
    spread_of_starts(rows, STIFFNESSES)
}

fn spread_of_starts(rows: &Rows, variables: RangeInclusive<u32>) -> Option<f64> {
    let each = variables.map(|k| numbers(rows, &format!("X{k}")));
    let spread = |all: Vec<f64>| {
        let (least, most) = (smallest(all.iter().copied())?, largest(all)?);
        (least > 0.0).then(|| 100.0 * (most - least) / least)
    };
    if rows.len() < 2 { None } else { largest(each.filter_map(spread)) }
}

/// The share of rows that end oddly; none of a table that does not tell.
pub(super) fn odd(rows: &Rows) -> Option<f64> {
    share(rows, |r| r.get("odd").is_some_and(|odd| odd == "yes")).filter(|_| rows.iter().all(|r| r.contains_key("odd")))
}

/// The share of rows that explicit dynamics were stopped in; none of a table that does not tell.
pub(super) fn stopped(rows: &Rows) -> Option<f64> {
    let is = |r: &BTreeMap<String, String>| r.get("solver").is_some_and(|s| s == "quasistatic");
    share(rows, is).filter(|_| rows.iter().all(|r| r.contains_key("solver")))
}

/// How many different words stand in a column.
pub(super) fn kinds(rows: &Rows, column: &str) -> Option<f64> {
    let all: BTreeSet<&String> = rows.iter().filter_map(|r| r.get(column)).collect();
    (!all.is_empty()).then_some(all.len() as f64)
}

/// The worst difference from measured passive flexion, in spreads between teams.
pub(super) fn passive(rows: &Rows) -> Option<f64> {
    let measured = |r: &&BTreeMap<String, String>| {
        r.get("protocol").is_some_and(|p| p == "passive_flexion")
            && r.get("against").is_some_and(|a| a == "measurement")
    };
    largest(rows.iter().filter(measured).filter_map(|r| {
        let quantity = r.get("quantity")?;
        let (_, spread) = BETWEEN_TEAMS.iter().find(|(name, _)| name == quantity)?;
        Some(cell(r, "rmsd")? / spread)
    }))
}

/// The median of half the widths of intervals, in times the range that was measured.
pub(super) fn half_width(rows: &Rows) -> Option<f64> {
    let each = rows.iter().filter_map(|r| {
        let measured = cell(r, "measured")?.abs();
        Some(0.5 * (cell(r, "upper")? - cell(r, "lower")?) / measured).filter(|share| share.is_finite())
    });
    let mut all: Vec<f64> = each.collect();
    all.sort_unstable_by(f64::total_cmp);
    all.get(all.len().checked_sub(1)? / 2).copied()
}

/// What two readings must differ by to be two, in times the scatter of one [-]: 1.96 times the root of two [weir2005].
const DETECTABLE: f64 = 2.77;

/// The smallest detectable change of a measurement, in spreads between teams; the worst of the coordinates that have one.
pub(super) fn detectable(rows: &Rows) -> Option<f64> {
    largest(rows.iter().filter_map(|r| {
        let coordinate = r.get("coordinate")?.split('_').next()?;
        let (_, spread) = BETWEEN_TEAMS.iter().find(|(name, _)| *name == coordinate)?;
        Some(DETECTABLE * cell(r, "inferred")? / spread)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_that_end_apart_are_told_and_one_start_tells_nothing() {
        let row =
            |x: &str, y: &str| BTreeMap::from([("X1".to_owned(), x.to_owned()), ("X15".to_owned(), y.to_owned())]);
        let two = vec![row("1.00", "50"), row("1.03", "60")];
        assert!((strains_of_starts(&two).unwrap() - 3.0).abs() < 1e-9, "stiffnesses do not count");
        assert!((stiffnesses_of_starts(&two).unwrap() - 20.0).abs() < 1e-9, "strains do not count");
        assert_eq!(strains_of_starts(&two[..1].to_vec()), None);
    }

    #[test]
    fn a_wide_interval_and_a_large_scatter_are_told_by_the_range_and_the_spread() {
        let of = |cells: &[(&str, &str)]| cells.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        let range = |measured, lower, upper| of(&[("measured", measured), ("lower", lower), ("upper", upper)]);
        let ranges = vec![range("20", "15", "25"), range("-10", "-20", "0"), range("8", "6", "10")];
        assert!((half_width(&ranges).unwrap() - 0.25).abs() < 1e-12, "of 0.25, 1 and 0.25");
        assert_eq!(half_width(&vec![range("0", "1", "2")]), None, "a range of none has no share");
        let noise = |coordinate, sd| of(&[("coordinate", coordinate), ("inferred", sd)]);
        let found = detectable(&vec![noise("ap_mm", "1"), noise("ie_deg", "1"), noise("ml_mm", "99")]).unwrap();
        assert!((found - 2.77 / 6.2).abs() < 1e-12, "{found}: no team's spread of ML is known");
    }
}

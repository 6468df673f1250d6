//! How a number of evidence is read from a stage's files.

use super::read::{Build, Read, Rows, flexions, largest, numbers, share, smallest};
use crate::stage::BETWEEN_TEAMS;
use sim::spec::{ModelSpec, SharedPriorSpec};
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
    moved(build, changed, "ap_mm", |r| r.get("drawer").is_some_and(|d| d == "yes"))
}

/// The largest change of a bundle's force, in drawers and pivot shift, by what is changed.
pub(super) fn force_moved(build: &Build, changed: &str) -> Option<(f64, Read)> {
    moved(build, changed, "force_n", |_| true)
}

/// The largest number of a column of sensitivity.csv by what is changed, and the flexions of its rows.
fn moved(
    build: &Build,
    changed: &str,
    column: &str,
    counts: fn(&BTreeMap<String, String>) -> bool,
) -> Option<(f64, Read)> {
    let mut read = build.file("validate", "sensitivity.csv")?;
    let mut rows = read.rows();
    rows.retain(|r| r.get("changed").is_some_and(|c| c == changed) && counts(r) && cell(r, column).is_some());
    read.flexions_deg = flexions(&rows, "flexion_deg");
    Some((largest(numbers(&rows, column))?, read))
}

/// The prior that other knees gave the calibration of the model that is judged, as its model.json says.
pub(super) fn shared_prior(build: &Build) -> Option<SharedPriorSpec> {
    let model: ModelSpec = serde_json::from_str(&build.file("calibrate", "MODEL/model.json")?.text).ok()?;
    model.calibrated?.shared_prior
}

/// How much less likely than the best an end of the search may be and still be another answer [nats]: 6 are 400 times less likely by the
/// noise that is told. The samples of the posterior leave out the same ends.
const FITS_NATS: f64 = 6.0;

/// The ends of the search: those that fit as well as the best within the noise that is told, and how many do not. A recipe's cost is of no
/// noise: all its ends are taken.
fn fitting(rows: Rows, is_of_noise: bool) -> (Rows, usize) {
    let least = smallest(numbers(&rows, "cost")).filter(|_| is_of_noise);
    let fits = |r: &BTreeMap<String, String>| {
        least.is_none_or(|least| cell(r, "cost").is_some_and(|c| c <= least + FITS_NATS))
    };
    let (inside, outside): (Rows, Rows) = rows.into_iter().partition(fits);
    (inside, outside.len())
}

/// The ends of a calibration's search.
struct Ends {
    /// Those that fit as well as the best.
    fits: Rows,
    /// How many do not.
    others: usize,
    /// Whether they were judged by the noise that is told.
    is_of_noise: bool,
    /// Their file, with the flexions that they were fitted in.
    read: Read,
}

fn ends(build: &Build) -> Option<Ends> {
    let mut read = build.file("calibrate", "MODEL/starts.csv")?;
    let metrics = build.file("calibrate", "metrics.json")?;
    let fit = build.file("calibrate", "MODEL/fit.csv")?;
    read.as_built &= metrics.as_built && fit.as_built;
    read.flexions_deg = flexions(&fit.rows(), "nominal_flexion_deg");
    let is_of_noise = metrics.json()[build.model.as_ref()?]["method"] == "posterior";
    let (fits, others) = fitting(read.rows(), is_of_noise);
    Some(Ends { fits, others, is_of_noise, read })
}

/// How many ends of the search do not fit as well as the best; none where it is not known.
pub(super) fn did_not_fit(build: &Build) -> Option<usize> {
    ends(build).filter(|ends| ends.read.as_built && ends.is_of_noise).map(|ends| ends.others)
}

/// The share of the search's ends that fit as well as the best, itself among them; none of one end, and of a recipe.
pub(super) fn ends_that_fit(build: &Build) -> Option<(f64, Read)> {
    let Ends { fits, others, is_of_noise, read } = ends(build)?;
    let all = fits.len() + others;
    (is_of_noise && all > 1).then(|| (fits.len() as f64 / all as f64, read))
}

/// How far the ends of several starts lie apart in a reference strain, of its least [%]; none of one end that fits.
pub(super) fn strains_of_starts(build: &Build) -> Option<(f64, Read)> {
    let ends = ends(build)?;
    Some((spread_of_starts(&ends.fits, STRAINS)?, ends.read))
}

/// The same in a stiffness.
pub(super) fn stiffnesses_of_starts(build: &Build) -> Option<(f64, Read)> {
    let ends = ends(build)?;
    Some((spread_of_starts(&ends.fits, STIFFNESSES)?, ends.read))
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
        assert!((spread_of_starts(&two, STRAINS).unwrap() - 3.0).abs() < 1e-9, "stiffnesses do not count");
        assert!((spread_of_starts(&two, STIFFNESSES).unwrap() - 20.0).abs() < 1e-9, "strains do not count");
        assert_eq!(spread_of_starts(&two[..1].to_vec(), STRAINS), None);
    }

    /// A worse fit is no other answer: it is counted, and moves nothing. Costs are known up to a constant alone.
    #[test]
    fn an_end_that_does_not_fit_within_the_noise_is_no_alternative() {
        let row = |(cost, x): (f64, f64)| {
            BTreeMap::from([("cost".to_owned(), cost.to_string()), ("X1".to_owned(), x.to_string())])
        };
        for best in [-40.0, 0.0, 214.9] {
            for worse in [0.0, 2.0, 5.9, 6.1, 20.0, 1e4] {
                let rows: Rows = [(best + worse, 1.1), (best, 1.0), (best + 1.0, 1.02)].map(row).to_vec();
                let (fits, others) = fitting(rows.clone(), true);
                let spread = spread_of_starts(&fits, STRAINS).unwrap();
                let (told, counted) = if worse > FITS_NATS { (2.0, 1) } else { (10.0, 0) };
                assert!((spread - told).abs() < 1e-9 && others == counted, "{best} {worse}: {spread} % {others}");
                assert_eq!(fitting(rows, false).1, 0, "a recipe's cost has no noise");
            }
        }
        assert!(fitting(vec![], true).0.is_empty());
    }

    #[test]
    fn flexions_are_each_told_once_in_order() {
        let row = |fe: &str| BTreeMap::from([("flexion_deg".to_owned(), fe.to_owned())]);
        let rows = vec![row("90"), row("0"), row("90.0"), row("30"), row("")];
        assert_eq!(flexions(&rows, "flexion_deg"), [0.0, 30.0, 90.0]);
        assert!(flexions(&rows, "other").is_empty());
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

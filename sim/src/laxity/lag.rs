//! Whether poses, loads and flexions belong to one row: a knee goes where it is pushed, and best where load and pose are of one moment.

use super::motion::LEAST_SPREAD;
use super::{LaxityTrial, SignDoubt};
use crate::coordinate::{AP, Coordinate, IE, VV};
use std::collections::{BTreeMap, BTreeSet};

/// Coordinates that tests load.
const LOADED: [Coordinate; 3] = [VV, IE, AP];
/// Rows by which a log may lag. Ours: more is a column that was sorted.
const MOST_ROWS: usize = 5;
/// A position with fewer trials than these shows no slope.
const LEAST_AT_A_POSITION: usize = 4;
/// A shift must make readings follow their loads by so much more of their spread in the mean [-]. In two published knees and their phantoms, in
/// three orders of rows, a lag of a row costs 0.13 and more, and without a lag every shift costs as much. Ours.
const LEAST_GAIN: f64 = 0.08;
/// And no coordinate by so much less [-]. Ours: the rows that a shift loses at the ends change as much.
const MOST_LOSS: f64 = 0.03;
/// A longer shift is told in place of a shorter one where readings follow their loads by so much more [-]. Ours: tests in one order at each
/// flexion fit nearly as well a whole round away.
pub(super) const LIKELIER: f64 = 0.05;
/// One coordinate alone may follow by chance.
const LEAST_COORDINATES: usize = 2;
/// Flexion so far from nominal is another position's [deg]: half of a usual step of 30.
const FAR_DEG: f64 = 15.0;
/// Rows with such a flexion, from which on a shift is looked for, and the share of them that may stay so [-]. Ours.
const LEAST_FAR: usize = 2;
const MOST_STAY: f64 = 0.1;
/// A name's flexion may lie this far from nominal [deg].
const NEAR_DEG: f64 = 5.0;
/// Names lie off nominal alike within this [deg]: rounding.
const ALIKE_DEG: f64 = 1.0;
/// Names with a flexion, from which on they are compared.
const LEAST_NAMES: usize = 4;

/// What part of the readings' spread follows the load [-]: in each position along a line of its own, which rises, or falls where `turned` is allowed.
/// Rows are position, load and reading; loads that differ by less than `least` show nothing.
pub(super) fn follows(rows: impl Iterator<Item = (i64, f64, f64)>, least: f64, turned: bool) -> Option<f64> {
    let mut positions: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
    rows.for_each(|(at, load, value)| positions.entry(at).or_default().push([load, value]));
    let (mut total, mut left) = (0.0, 0.0);
    for of in positions.into_values().filter(|of| of.len() >= LEAST_AT_A_POSITION) {
        let [x, y] = [0, 1].map(|k| of.iter().map(|p| p[k]).sum::<f64>() / of.len() as f64);
        if of.iter().all(|p| (p[0] - x).abs() < least) {
            continue;
        }
        let sum = |of_point: fn(f64, f64) -> f64| of.iter().map(|p| of_point(p[0] - x, p[1] - y)).sum::<f64>();
        let (loads, both, values) = (sum(|l, _| l * l), sum(|l, v| l * v), sum(|_, v| v * v));
        total += values;
        left += values - if both > 0.0 || turned { both * both / loads } else { 0.0 };
    }
    (total > 1e-9).then(|| 1.0 - left / total)
}

/// [`follows`] of a coordinate whose loads stand in the rows `load` and its readings in the rows `pose`.
pub(super) fn follows_in<'a>(
    c: Coordinate,
    rows: impl Iterator<Item = (&'a LaxityTrial, &'a LaxityTrial)>,
    turned: bool,
) -> Option<f64> {
    let least = LEAST_SPREAD.iter().find(|(of, _)| *of == c).map_or(f64::INFINITY, |(_, least)| *least);
    let poses = rows.filter(|(_, pose)| pose.reference.is_none());
    let cells = poses.filter_map(|(load, pose)| Some((position(load), load.load[c], pose.measured[c]?)));
    follows(cells, least, turned)
}

fn position(t: &LaxityTrial) -> i64 {
    t.nominal_flexion_deg.round() as i64
}

/// Each row beside the one that stands so many rows below it, or above it where negative.
fn beside(trials: &[LaxityTrial], by: isize) -> impl Iterator<Item = (&LaxityTrial, &LaxityTrial)> {
    let [own, other] = [by.min(0).unsigned_abs(), by.max(0).unsigned_abs()];
    trials.iter().skip(own).zip(trials.iter().skip(other))
}

/// Shifts that are tried, the shortest first.
fn shifts(rows: usize) -> impl Iterator<Item = isize> {
    let most = MOST_ROWS.min(rows / LEAST_AT_A_POSITION) as isize;
    (1..=most).flat_map(|by| [by, -by])
}

/// Where rows stand that belong together.
fn place(by: isize) -> String {
    let rows = if by.unsigned_abs() == 1 { "row" } else { "rows" };
    format!("{} {rows} {} it", by.unsigned_abs(), if by > 0 { "below" } else { "above" })
}

/// Poses that follow the loads of other rows better than those of their own.
pub(super) fn late(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let fits = |by: isize, turned: bool| LOADED.map(|c| follows_in(c, beside(trials, by), turned));
    // signs that are turned are no lag
    let here = fits(0, true);
    let gain = |by: isize| {
        let there = fits(by, false);
        let steps: Vec<f64> = there.iter().zip(&here).filter_map(|(t, h)| Some((*t)? - (*h)?)).collect();
        let mean = steps.iter().sum::<f64>() / steps.len().max(1) as f64;
        let all = steps.len() >= LEAST_COORDINATES && steps.iter().all(|s| *s > -MOST_LOSS);
        (all && mean > LEAST_GAIN).then_some((mean, by))
    };
    let found = shifts(trials.len()).filter_map(gain);
    let (_, by) = found.reduce(|best, other| if other.0 > best.0 + LIKELIER { other } else { best })?;
    let shares = |of: [Option<f64>; 3]| {
        let one = |(c, share): (Coordinate, Option<f64>)| Some(format!("{} {:.0} %", c.column(), 100.0 * share?));
        LOADED.into_iter().zip(of).filter_map(one).collect::<Vec<_>>().join(", ")
    };
    Some(SignDoubt {
        column: "test".into(),
        words: format!(
            "the loads are out of step with the poses: each load fits the pose that stands {} better than that of its own row. So much of the readings follows the loads then: {}; and as they stand: {}. Does one of the logs lag, or was a column shifted or sorted alone? Expected name, loads and pose of one trial in each row",
            place(by),
            shares(fits(by, false)),
            shares(here)
        ),
    })
}

/// Flexion that is nominal in other rows than its own.
pub(super) fn flexion(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let far = |nominal: &LaxityTrial, own: &LaxityTrial| (own.fe_deg - nominal.nominal_flexion_deg).abs() > FAR_DEG;
    let positions: BTreeSet<i64> = trials.iter().map(position).collect();
    let gain = |by: isize| {
        let (mut now, mut then) = (0usize, 0usize);
        for (nominal, own) in beside(trials, by) {
            now += usize::from(far(own, own));
            then += usize::from(far(nominal, own));
        }
        let mends = now >= LEAST_FAR && then as f64 <= MOST_STAY * now as f64;
        mends.then(|| (now - then, now, by))
    };
    let found = shifts(trials.len()).filter_map(gain);
    let best = found.reduce(|best, other| if other.0 > best.0 { other } else { best });
    // one zero for all is no lag, though the next position's flexion may fit then
    let (_, now, by) = best.filter(|_| positions.len() > 1 && !super::flexion::is_offset(trials))?;
    Some(SignDoubt {
        column: "fe_deg".into(),
        words: format!(
            "fe_deg is out of step with nominal_flexion_deg: in {now} trials it is another position's, and the values that stand {} fit. Does a log lag, with the poses or without them, or was a column shifted or sorted alone? Expected name, flexion, loads and pose of one trial in each row",
            place(by)
        ),
    })
}

/// The flexion that a trial's name says, as `anterior_30deg_133` does [deg].
fn named_deg(name: &str) -> Option<f64> {
    let lower = name.to_lowercase();
    let end = ["deg", "\u{b0}"].into_iter().find_map(|unit| lower.find(unit))?;
    let before = lower[..end].trim_end_matches([' ', '_', '-']);
    let digits = before.rfind(|c: char| !c.is_ascii_digit() && c != '.').map_or(before, |at| {
        let next = before[at..].chars().next().map_or(1, char::len_utf8);
        &before[at + next..]
    });
    digits.parse().ok()
}

/// By how much nominal flexion lies off what the names say, where it does so alike in all of them and the names have several flexions [deg].
fn shifted_names(named: &[(&LaxityTrial, f64)]) -> Option<f64> {
    let off = |(t, deg): &(&LaxityTrial, f64)| t.nominal_flexion_deg - deg;
    let first = off(named.first()?);
    let alike = named.iter().all(|n| (off(n) - first).abs() < ALIKE_DEG);
    let several = named.iter().any(|n| (n.1 - named[0].1).abs() > NEAR_DEG);
    (alike && several && first.abs() > NEAR_DEG).then_some(first)
}

/// Trials whose names and measured flexion agree, and whose nominal flexion is another.
fn by_names_and_flexion(named: &[(&LaxityTrial, f64)]) -> Option<SignDoubt> {
    let odd = |(t, deg): &&(&LaxityTrial, f64)| {
        (t.nominal_flexion_deg - deg).abs() > NEAR_DEG && (t.fe_deg - deg).abs() <= NEAR_DEG
    };
    let off: Vec<&(&LaxityTrial, f64)> = named.iter().filter(odd).collect();
    let (first, deg) = off.first().filter(|_| off.len() >= LEAST_FAR)?;
    Some(SignDoubt {
        column: "nominal_flexion_deg".into(),
        words: format!(
            "{} trials are filed under another flexion than their names say and fe_deg is, the first \"{}\": nominal {:.0} deg, {deg:.0} by its name, {:.0} measured. Expected the flexion of the test in all three",
            off.len(),
            first.trial,
            first.nominal_flexion_deg,
            first.fe_deg
        ),
    })
}

/// Trials that are filed under another flexion than their names say, where names and column have the same flexions.
pub(super) fn names(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let named: Vec<(&LaxityTrial, f64)> = trials.iter().filter_map(|t| Some((t, named_deg(&t.trial)?))).collect();
    let has = |t: &LaxityTrial, deg: f64| (t.nominal_flexion_deg - deg).abs() <= NEAR_DEG;
    let known = |(_, deg): &(&LaxityTrial, f64)| named.iter().any(|(t, _)| has(t, *deg));
    let used = |(t, _): &(&LaxityTrial, f64)| named.iter().any(|(_, deg)| has(t, *deg));
    let enough = named.len() >= LEAST_NAMES;
    if let Some(by) = shifted_names(&named).filter(|_| enough) {
        return Some(SignDoubt {
            column: "nominal_flexion_deg".into(),
            words: format!(
                "nominal_flexion_deg lies {by:+.0} deg from the flexion that the names of all {} trials say: it counts from another zero than they do. Expected the flexion of the knee in both",
                named.len()
            ),
        });
    }
    let comparable = enough && named.iter().all(known) && named.iter().all(used);
    let off: Vec<&(&LaxityTrial, f64)> = named.iter().filter(|(t, deg)| !has(t, *deg)).collect();
    let Some((first, _)) = off.first().filter(|_| comparable && off.len() >= LEAST_FAR) else {
        return by_names_and_flexion(&named).filter(|_| enough);
    };
    Some(SignDoubt {
        column: "nominal_flexion_deg".into(),
        words: format!(
            "{} trials are filed under another flexion than their names say, the first \"{}\" under {:.0} deg: nominal_flexion_deg is out of step with the names. Was a column shifted or sorted alone? Expected name, flexion, loads and pose of one trial in each row",
            off.len(),
            first.trial,
            first.nominal_flexion_deg
        ),
    })
}

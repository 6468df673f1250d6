//! Whether the names of tests, the loads and the poses of a file belong together, row by row: a column that lags, or was sorted alone.

use super::lag::{LIKELIER, follows_in};
use super::usual_tests::USUAL_LOADS;
use super::{LaxityTrial, SignDoubt, Test};
use crate::coordinate::{AP, Coordinate, IE, Load, ML, SI, VV};
use std::collections::BTreeMap;

/// Share of its usual size below which a load counts as none [-], and from which on another coordinate's is what was tested. Ours.
const NO_LOAD: f64 = 0.05;
const TESTED: f64 = 0.2;
/// Rows that load another coordinate than they test, from which on columns are out of step. Ours: one alone may be a slip of the pen.
const LEAST_ROWS: usize = 2;
/// And what share of all rows they are where no shift mends them [-]. Ours.
const LEAST_SHARE: f64 = 0.1;
/// Rows by which columns may have been shifted, as a share of all [-]: more leaves too few rows to see that the shift mends them. Ours.
const MOST_SHIFT: f64 = 0.4;
/// But no more than these rows: time.
const MOST_ROWS: usize = 100;
/// Readings must follow the loads by so much more of their spread for a shift to be told by them [-]. Ours: in two published knees and their
/// phantoms a lag of a row costs 0.13 and more.
const MORE_FOLLOWS: f64 = 0.08;
/// Two unloaded trials in a row differ by less than this share of what their test moves [-]. Ours: noise is a tenth, and a lag of a
/// row leaves the first step of the load between them, half and more.
const MOST_UNLOADED: f64 = 0.4;
/// Trials of a test and flexion from which on what it moves is known.
const LEAST_TRIALS: usize = 4;
/// Tests at a flexion whose unloaded trials differ so, from which on it is told.
const LEAST_TESTS: usize = 2;

/// A load's share of the usual size along the test's own direction, and the largest share of another coordinate's [-].
fn shares(test: Test, load: &Load) -> Option<[f64; 2]> {
    let own = test.coordinate()?;
    let share = |(c, usual, minus, _): &(Coordinate, f64, Test, Test)| {
        let along = if *minus == test { -load[*c] } else { load[*c] };
        (*c == own, along / usual)
    };
    let all = USUAL_LOADS.iter().map(share);
    let along: f64 = all.clone().filter(|(is_own, _)| *is_own).map(|(_, s)| s).sum();
    let other = all.filter(|(is_own, _)| !is_own).map(|(_, s)| s.abs()).fold(0.0, f64::max);
    Some([along, other])
}

/// Whether a row by this name loads another coordinate and not its own.
fn elsewhere(test: Test, load: &Load) -> bool {
    shares(test, load).is_some_and(|[along, other]| along.abs() < NO_LOAD && other >= TESTED)
}

/// Whether a load may be that of a row by this name: not against it, and along no other coordinate.
fn fits(test: Test, load: &Load) -> bool {
    shares(test, load).is_none_or(|[along, other]| along > -NO_LOAD && other < TESTED)
}

/// Whether a row loads another coordinate than its test's, alone or beside it.
fn strays(t: &LaxityTrial) -> bool {
    shares(t.test, &t.load).is_some_and(|[_, other]| other >= TESTED)
}

/// A shift of columns of loads: which, by how many rows, and whether each row's own load stands below it or above.
#[derive(Clone, Copy)]
struct Shift {
    columns: &'static [Coordinate],
    by: usize,
    below: bool,
}

/// Columns that may have been shifted: all loads, or that of one coordinate.
const SHIFTED: [&[Coordinate]; 4] = [&[VV, IE, ML, AP, SI], &[VV], &[IE], &[AP]];

impl Shift {
    /// How many rows more load their own test once the loads are put back; none where a row does not fit its name then, or few are gained.
    fn gain(&self, trials: &[LaxityTrial]) -> Option<usize> {
        let loads = |t: &LaxityTrial, load: &Load| shares(t.test, load).is_some_and(|[along, _]| along >= NO_LOAD);
        let (mut before, mut after) = (0usize, 0usize);
        for (upper, lower) in trials.iter().zip(trials.iter().skip(self.by)) {
            let (name, from) = if self.below { (upper, lower) } else { (lower, upper) };
            let own = Load::from_fn(|c| if self.columns.contains(&c) { from.load[c] } else { name.load[c] });
            if !fits(name.test, &own) {
                return None;
            }
            before += usize::from(loads(name, &name.load));
            after += usize::from(loads(name, &own));
        }
        after.checked_sub(before).filter(|more| *more >= LEAST_ROWS)
    }

    /// What part of the readings follows the loads once these are put back, in the mean of the coordinates [-].
    fn follows(&self, trials: &[LaxityTrial]) -> Option<f64> {
        let rows = || trials.iter().zip(trials.iter().skip(self.by));
        let put_back = |(upper, lower): (&LaxityTrial, &LaxityTrial)| {
            let (own, from) = if self.below { (upper, lower) } else { (lower, upper) };
            LaxityTrial { load: from.load, ..own.clone() }
        };
        let mended: Vec<LaxityTrial> = rows().map(put_back).collect();
        let one = |c: &Coordinate| follows_in(*c, mended.iter().map(|t| (t, t)), false);
        let shares: Vec<f64> = self.columns.iter().filter_map(one).collect();
        (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
    }

    fn words(&self) -> String {
        let what = match self.columns {
            [one] => format!("the values of {}", one.load_column()),
            _ => "the loads".into(),
        };
        let rows = if self.by == 1 { "row" } else { "rows" };
        format!("{what} that stand {} {rows} {} it", self.by, if self.below { "below" } else { "above" })
    }
}

/// Rows whose load is another test's, where a shift of columns mends them all. That doubt explains many another one.
pub(super) fn shifted(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let odd: Vec<&LaxityTrial> = trials.iter().filter(|t| strays(t)).collect();
    let first = odd.first().filter(|_| odd.len() >= LEAST_ROWS)?;
    let most = ((MOST_SHIFT * trials.len() as f64) as usize).min(MOST_ROWS);
    let all = (1..=most).flat_map(|by| {
        let both = move |columns: &'static [Coordinate]| [true, false].map(|below| Shift { columns, by, below });
        SHIFTED.into_iter().flat_map(both)
    });
    let mends: Vec<(usize, Shift)> = all.filter_map(|shift| Some((shift.gain(trials)?, shift))).collect();
    let shift = likeliest(trials, &mends)?;
    Some(SignDoubt {
        column: "test".into(),
        words: format!(
            "{} trials load another coordinate than their test's, the first \"{}\", {} by name. Every row fits with {}: the loads are out of step with the names of the tests, or with these and the poses. Was a column shifted or sorted alone, or does the log lag? Expected name, loads and pose of one trial in each row",
            odd.len(),
            first.trial,
            first.test.name(),
            shift.words()
        ),
    })
}

/// The shift that gains most, of those that gain as much the shortest. Where trials without load make several fit, the one is meant after which the
/// poses follow the loads best; but not where they follow them as they stand, as with names that are out of step.
fn likeliest(trials: &[LaxityTrial], mends: &[(usize, Shift)]) -> Option<Shift> {
    let (most, first) = mends.iter().copied().reduce(|best, other| if other.0 > best.0 { other } else { best })?;
    let rivals = mends.iter().filter(|(gain, shift)| 2 * gain >= most && shift.columns == first.columns);
    let fits = rivals.filter_map(|(_, shift)| Some((shift.follows(trials)?, *shift)));
    let best = fits.reduce(|best, other| if other.0 > best.0 + LIKELIER { other } else { best });
    let unshifted = Shift { by: 0, ..first }.follows(trials).unwrap_or(0.0);
    Some(best.filter(|(share, _)| *share > unshifted + MORE_FOLLOWS).map_or(first, |(_, shift)| shift))
}

/// Rows whose load is another test's where no shift mends them.
pub(super) fn unlike(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let all = rows_elsewhere(trials);
    let least = LEAST_ROWS.max((LEAST_SHARE * trials.len() as f64).ceil() as usize);
    let first = all.first().filter(|_| all.len() >= least)?;
    Some(SignDoubt {
        column: "test".into(),
        words: format!(
            "{} trials load another coordinate than their test's, and not that one, the first \"{}\", {} by name. Were columns exchanged, or is the column of tests out of step with the loads, sorted alone? Expected name, loads and pose of one trial in each row",
            all.len(),
            first.trial,
            first.test.name()
        ),
    })
}

/// Trials without a test by name that are loaded as a test is: they count as unloaded ones.
pub(super) fn loaded_neutral(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let share = |t: &LaxityTrial, (c, usual, ..): &(Coordinate, f64, Test, Test)| t.load[*c].abs() / usual;
    let is_loaded = |t: &&LaxityTrial| USUAL_LOADS.iter().any(|usual| share(t, usual) >= TESTED);
    let found: Vec<&LaxityTrial> = trials.iter().filter(|t| t.test == Test::Neutral).filter(is_loaded).collect();
    let first = found.first()?;
    Some(SignDoubt {
        column: "test".into(),
        words: format!(
            "{} trials are neutral by name and loaded, the first \"{}\", by {:.1} N m VV, {:.1} N m IE and {:.0} N AP. Expected no load but compression: name the test that each of them is",
            found.len(),
            first.trial,
            first.load[VV],
            first.load[IE],
            first.load[AP]
        ),
    })
}

fn rows_elsewhere(trials: &[LaxityTrial]) -> Vec<&LaxityTrial> {
    trials.iter().filter(|t| elsewhere(t.test, &t.load)).collect()
}

/// Unloaded trials that stand in a row and differ by much of what their test moves: poses that the load had not reached, or a late load.
pub(super) fn unloaded_differ(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let mut groups: BTreeMap<(Test, i64), Vec<&LaxityTrial>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.reference.is_none()) {
        groups.entry((t.test, t.nominal_flexion_deg.round() as i64)).or_default().push(t);
    }
    let found: Vec<[&LaxityTrial; 2]> = groups.values().filter_map(|group| differ(group)).collect();
    let [a, b] = found.first().filter(|_| found.len() >= LEAST_TESTS)?;
    let c = a.test.coordinate()?;
    Some(SignDoubt {
        column: c.load_column(),
        words: format!(
            "unloaded trials differ: {} is {:.1} {unit} in \"{}\" and {:.1} {unit} in \"{}\", and so in {} tests. Are the loads out of step with the poses, as where a log of loads lags by a row? Expected load and pose of one moment in each row",
            c.column(),
            a.measured[c].unwrap_or(0.0),
            a.trial,
            b.measured[c].unwrap_or(0.0),
            b.trial,
            found.len(),
            unit = c.unit()
        ),
    })
}

/// Two unloaded trials of one branch, one below the other, that lie apart by much of what these trials move.
fn differ<'a>(group: &[&'a LaxityTrial]) -> Option<[&'a LaxityTrial; 2]> {
    let c = group.first()?.test.coordinate()?;
    let read: Vec<(&LaxityTrial, f64)> = group.iter().filter_map(|t| Some((*t, t.measured[c]?))).collect();
    let most = read.iter().map(|(t, _)| t.load[c].abs()).fold(0.0, f64::max);
    let values = read.iter().map(|(_, x)| *x);
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let unloaded = |t: &LaxityTrial| t.load[c].abs() < NO_LOAD * most;
    let apart = |w: &&[(&LaxityTrial, f64)]| {
        let [(a, x), (b, y)] = w else { return false };
        unloaded(a) && unloaded(b) && a.branch == b.branch && (x - y).abs() > MOST_UNLOADED * (high - low)
    };
    let found = read.windows(2).find(apart).filter(|_| read.len() >= LEAST_TRIALS)?;
    Some([found[0].0, found[1].0])
}

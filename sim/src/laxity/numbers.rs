//! What the numbers themselves show: zeros and nines that stand for nothing, coarse steps, loads that are round in another unit.

use super::{LaxityTrial, SignDoubt, Test, text};
use crate::coordinate::{AP, Coordinate, FREE, Free, IE, SI, VV};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

/// Readings from which on zeros among them are looked at.
const LEAST_READINGS: usize = 6;
/// Share of readings that may be 0 and still stand out [-]: a coordinate that is held, or one that no test moves, is 0 throughout. Ours.
const MOST_ZEROS: f64 = 0.1;
/// A reading is round where this many times it is a whole number: two decimals. One of more decimals is 0 by chance in fewer than one of 1000.
const ROUND: f64 = 100.0;
/// A zero lies outside of the others of its test and flexion by more than this share of their range [-]. Ours.
const OUTSIDE: f64 = 0.5;
/// Others of its test and flexion with which a zero is compared.
const LEAST_OTHERS: usize = 3;
/// Readings with decimals that two trials must share to be one written twice: whole numbers agree by chance. Ours.
const LEAST_FINE: usize = 3;
/// Different loads that must all be round in the other unit [-]: of a number with four digits one in 50 is by chance. Ours.
const LEAST_LOADS: usize = 2;
/// How near a load is to a round number [-], as written with four digits.
const NEAR: f64 = 1.5e-4;
/// Round loads: as read in N m and N, to two decimals; and what tests apply in the other unit, in steps of 0.05. Ours.
const STEP_READ: f64 = 0.01;
const STEP_MEANT: f64 = 0.05;
/// What tests apply at the most, to which a number in the other unit is held [N m], [N]: of a larger one nearly every number is round to four digits. Ours.
const MOST_NM: f64 = 20.0;
const MOST_N: f64 = 300.0;
/// A load that is one number in all its trials: no multiple of the first as it is read, and in the other unit one of the second, up to the third: VV, IE
/// [N m], SI [N]. Ours: a number with four digits is so by chance in one of 100 at the most.
const ROUND_OF_ONE: [(Coordinate, [f64; 3]); 3] =
    [(VV, [STEP_READ, 0.5, MOST_NM]), (IE, [STEP_READ, 0.5, MOST_NM]), (SI, [0.1, 5.0, 200.0])];
/// Trials that have it.
const LEAST_OF_ONE: usize = 4;
/// Steps of readings that are told, the coarsest first [mm] or [deg]: half a drawer and more, in cm, or in inches, their halves and quarters.
/// Ours; instruments read in steps of 1 and less.
const STEPS_MM: [f64; 5] = [25.4, 12.7, 10.0, 6.35, 5.0];
const STEPS_DEG: [f64; 2] = [10.0, 5.0];
/// The least of them that is told: VV, IE [deg], ML, AP, SI [mm]. Ours: a knee rotates by 30 deg and more, and goniometers have 5.
const LEAST_STEP: Free<f64> = Free([5.0, 10.0, 5.0, 5.0, 5.0]);
/// Units in which loads may be given, and what they are in N m or N.
const MOMENTS: [(&str, f64); 3] =
    [("ft lbf", 1.355_817_948_331_4), ("lbf in", 0.112_984_829_027_616_7), ("kgf m", 9.806_65)];
const FORCES: [(&str, f64); 2] = [("lbf", 4.448_221_615_260_5), ("kgf", 9.806_65)];

/// Doubts about single readings and about the unit of loads.
pub(super) fn doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let zeros = FREE.iter().filter_map(|c| zeros(trials, *c));
    let units = [(&[VV, IE][..], &MOMENTS[..], MOST_NM), (&[AP][..], &FORCES[..], MOST_N)];
    let round = units.iter().filter_map(|(of, units, limit)| round_elsewhere(trials, of, units, *limit));
    let mut round: Vec<SignDoubt> = round.collect();
    let single: Vec<SignDoubt> = ROUND_OF_ONE.into_iter().filter_map(|kind| one_load(trials, kind)).collect();
    if round.is_empty() {
        round = single;
    }
    let ended = FREE.iter().filter_map(|c| ended(trials, *c));
    zeros.chain(round).chain(twice(trials)).chain(ended).collect()
}

/// Readings of nines alone, which stand for a missing one.
pub(super) fn codes(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let one = |c: Coordinate| {
        let found = |t: &&LaxityTrial| t.measured[c].is_some_and(text::is_code);
        let first = trials.iter().find(found)?;
        Some(SignDoubt {
            column: c.column(),
            words: format!(
                "{} is exactly {} in {} of {} readings, the first in trial \"{}\": a code for not measured? Expected an empty cell where nothing was read",
                c.column(),
                first.measured[c].unwrap_or(0.0),
                trials.iter().filter(found).count(),
                trials.iter().filter(|t| t.measured[c].is_some()).count(),
                first.trial
            ),
        })
    };
    FREE.into_iter().filter_map(one).collect()
}

/// Readings of a coordinate that are all whole multiples of a coarse step.
struct Rounded {
    of: Coordinate,
    step: f64,
    readings: usize,
    /// A coordinate that is held is one number throughout.
    varies: bool,
}

fn rounded(trials: &[LaxityTrial], of: Coordinate) -> Option<Rounded> {
    let given: Vec<f64> = trials.iter().filter_map(|t| t.measured[of]).collect();
    let whole = |step: f64| given.iter().all(|x| ((x / step).round() * step - x).abs() < 1e-9);
    let steps = if of.unit() == "mm" { &STEPS_MM[..] } else { &STEPS_DEG[..] };
    let step = steps.iter().copied().find(|s| *s >= LEAST_STEP[of] && whole(*s))?;
    let different: BTreeSet<i64> = given.iter().map(|x| (x / step).round() as i64).collect();
    let enough = given.len() >= LEAST_READINGS;
    enough.then_some(Rounded { of, step, readings: given.len(), varies: different.len() > 1 })
}

/// Columns that are rounded coarsely, and the one line that says so: rounded, or written in cm or inches.
pub(super) fn coarse(trials: &[LaxityTrial]) -> (Vec<String>, Option<SignDoubt>) {
    let all: Vec<Rounded> = FREE.into_iter().filter_map(|c| rounded(trials, c)).collect();
    let varies: Vec<&Rounded> = all.iter().filter(|r| r.varies).collect();
    let Some(first) = varies.first() else { return (Vec::new(), None) };
    let one = |r: &&Rounded| format!("{} comes in steps of {} {}", r.of.column(), r.step, r.of.unit());
    let words = format!(
        "{}: all of their {} readings are whole multiples. A knee's laxity is of that size, so that little of it is left. Were they rounded, or written in whole cm, inches or tens? Expected readings to a tenth",
        varies.iter().map(one).collect::<Vec<_>>().join(", "),
        varies.iter().map(|r| r.readings).sum::<usize>()
    );
    (all.iter().map(|r| r.of.column()).collect(), Some(SignDoubt { column: first.of.column(), words }))
}

/// What two trials have in common where one was written twice: test, flexion, loads and readings, number by number.
type Written = (Test, u64, [u64; 5], [Option<u64>; 5]);

/// Trials that hold the loads and readings of an earlier one, to the last digit. Samples of a log have times and are none.
fn twice(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let fine = |t: &LaxityTrial| t.measured.iter().flatten().filter(|x| x.fract() != 0.0).count() >= LEAST_FINE;
    let mut seen: BTreeMap<Written, &LaxityTrial> = BTreeMap::new();
    let mut found: Vec<[&LaxityTrial; 2]> = Vec::new();
    for t in trials.iter().filter(|t| t.time_s.is_none() && fine(t)) {
        let loads = FREE.map(|c| t.load[c].to_bits());
        let readings = FREE.map(|c| t.measured[c].map(f64::to_bits));
        match seen.entry((t.test, t.fe_deg.to_bits(), loads, readings)) {
            Entry::Occupied(first) => found.push([*first.get(), t]),
            Entry::Vacant(place) => {
                place.insert(t);
            }
        }
    }
    let [a, b] = found.first()?;
    Some(SignDoubt {
        column: "trial".into(),
        words: format!(
            "{} trials hold the loads and readings of an earlier one to the last digit, the first \"{}\" those of \"{}\": were rows pasted twice? Each trial counts as a measurement of its own. Expected each measurement once",
            found.len(),
            b.trial,
            a.trial
        ),
    })
}

/// Readings this far apart and more are steps of an instrument [mm] or [deg]: encoders and rulers. Ours.
const LEAST_RULED: f64 = 0.05;
/// Readings no further apart are one number [mm] or [deg]: thirty steps of an instrument, each written with six decimals.
const SAME: f64 = 1e-4;
/// Readings at one end of a coordinate's range that are one number, from which on the instrument ended there; and what share of all they are [-].
/// Ours: readings with three decimals and more agree by chance in fewer than one of 1000.
const LEAST_AT_AN_END: usize = 3;
const SHARE_AT_AN_END: f64 = 0.1;

/// Readings of the loaded coordinate that end at one number, though the knee is otherwise in other poses: an instrument at its stop, or numbers that were
/// clipped.
fn ended(trials: &[LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    // samples of a log stand still in their holds
    let poses = trials.iter().filter(|t| t.reference.is_none() && t.time_s.is_none() && t.test.coordinate() == Some(c));
    let poses: Vec<(f64, &LaxityTrial)> = poses.filter_map(|t| Some((t.measured[c]?, t))).collect();
    let given: Vec<f64> = poses.iter().map(|p| p.0).collect();
    let fine = given.iter().filter(|x| ((*x * ROUND).round() - *x * ROUND).abs() > 1e-6).count();
    if 2 * fine <= given.len() || has_step(&given) {
        return None;
    }
    let ends = [f64::min as fn(f64, f64) -> f64, f64::max].map(|f| given.iter().copied().reduce(f).unwrap_or(0.0));
    let there = |end: f64| {
        let is_end = |x: f64| x.to_bits() == end.to_bits();
        // a test that reads one number throughout goes to a displacement
        let goes_on = |t: &LaxityTrial| poses.iter().any(|p| p.1.test == t.test && loaded(p.1) && !is_end(p.0));
        let at_end = poses.iter().filter(|p| is_end(p.0)).map(|p| p.1).filter(|t| goes_on(t));
        at_end.map(|t| FREE.map(|c| t.measured[c].map(f64::to_bits))).collect::<BTreeSet<_>>().len()
    };
    let at_stop = |end: &f64| {
        let count = there(*end);
        *end != 0.0 && count >= LEAST_AT_AN_END && count as f64 >= SHARE_AT_AN_END * given.len() as f64
    };
    let end = ends.into_iter().find(at_stop).filter(|_| ends[0] < ends[1])?;
    Some(SignDoubt {
        column: c.column(),
        words: format!(
            "{} is exactly {end} {} in {} of {} readings, and none lies beyond: did the instrument reach its stop, or were readings clipped there? Leave cells empty where the range had ended",
            c.column(),
            c.unit(),
            there(end),
            given.len()
        ),
    })
}

/// Whether readings are steps of an instrument apart, whatever their zero: such readings agree often.
fn has_step(given: &[f64]) -> bool {
    let first = given.first().copied().unwrap_or(0.0);
    given.iter().map(|x| (x - first).abs()).fold(0.0, common) >= LEAST_RULED
}

/// The largest number of which both are multiples, to within [`SAME`]; neither is below 0.
fn common(mut a: f64, mut b: f64) -> f64 {
    while b > SAME {
        let rest = (a - (a / b).round() * b).abs();
        (a, b) = (b, rest);
    }
    a
}

/// Whether the trial loads what it tests: without load a displacement may well be 0.
fn loaded(t: &LaxityTrial) -> bool {
    t.test.coordinate().is_some_and(|c| t.load[c] != 0.0)
}

/// A few readings of exactly 0 under load among others that are not: cells that were filled for want of a reading.
fn zeros(trials: &[LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let given: Vec<(&LaxityTrial, f64)> = trials.iter().filter_map(|t| Some((t, t.measured[c]?))).collect();
    let is_zero = |x: f64| x == 0.0;
    let found: Vec<&LaxityTrial> = given.iter().filter(|(t, x)| is_zero(*x) && loaded(t)).map(|(t, _)| *t).collect();
    let count = given.iter().filter(|(_, x)| is_zero(*x)).count();
    if given.len() < LEAST_READINGS || count as f64 > (MOST_ZEROS * given.len() as f64).max(1.0) {
        return None;
    }
    let fine = |x: f64| ((x * ROUND).round() - x * ROUND).abs() > 1e-6;
    let mostly_fine = 2 * given.iter().filter(|(_, x)| fine(*x)).count() > given.len();
    let odd = |t: &&&LaxityTrial| mostly_fine || outside(&given, t);
    let odd: Vec<&&LaxityTrial> = found.iter().filter(odd).collect();
    let first = odd.first()?;
    Some(SignDoubt {
        column: c.column(),
        words: format!(
            "{} is exactly 0 in {} of {} readings, the first in trial \"{}\", and not near 0 beside it: was it not read? Expected an empty cell where nothing was read",
            c.column(),
            odd.len(),
            given.len(),
            first.trial
        ),
    })
}

/// Whether 0 lies outside of what the other readings of the trial's test and flexion are.
fn outside(given: &[(&LaxityTrial, f64)], zero: &LaxityTrial) -> bool {
    let position = |t: &LaxityTrial| (t.test, t.nominal_flexion_deg.round() as i64, t.reference.is_some());
    let others = given.iter().filter(|(t, x)| *x != 0.0 && position(t) == position(zero)).map(|(_, x)| *x);
    let others: Vec<f64> = others.collect();
    let (low, high) = others.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let out = low.max(-high);
    others.len() >= LEAST_OTHERS && out > OUTSIDE * (high - low) && out > 0.0
}

/// A load that is one number in all trials that apply it: round in another unit, and not as it is read. All trials apply compression.
fn one_load(trials: &[LaxityTrial], (c, [read, step, most]): (Coordinate, [f64; 3])) -> Option<SignDoubt> {
    let own = trials.iter().filter(|t| (c == SI || t.test.coordinate() == Some(c)) && t.load[c] != 0.0);
    let loads: Vec<f64> = own.map(|t| t.load[c].abs()).collect();
    let load = *loads.first().filter(|first| loads.iter().all(|l| l.to_bits() == first.to_bits()))?;
    if loads.len() < LEAST_OF_ONE || is_round(load, read) {
        return None;
    }
    let units = if c.turns() { &MOMENTS[..] } else { &FORCES[..] };
    let fits = |(_, factor): &&(&str, f64)| load * factor <= most && is_round(load * factor, step);
    let (unit, factor) = units.iter().find(fits)?;
    Some(SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is {load:.4} {n} in all {} trials that apply it, no round number; in {unit} it would be round: {:.2} {n}. Is {unit} its unit? Declare the unit by [laxity_format.NAME.columns]",
            c.load_column(),
            loads.len(),
            load * factor,
            n = c.load_unit()
        ),
    })
}

/// Whether a number is a multiple of a step, as written with four digits.
fn is_round(number: f64, step: f64) -> bool {
    ((number / step).round() * step - number).abs() < NEAR * number
}

/// Loads that are round numbers in another unit and none as they are read.
fn round_elsewhere(trials: &[LaxityTrial], of: &[Coordinate], units: &[(&str, f64)], limit: f64) -> Option<SignDoubt> {
    let mut loads: BTreeMap<u64, (Coordinate, f64)> = BTreeMap::new();
    for t in trials {
        let own = t.test.coordinate().filter(|c| of.contains(c));
        if let Some((c, load)) = own.map(|c| (c, t.load[c].abs())).filter(|(_, load)| *load > 0.0) {
            loads.entry(load.to_bits()).or_insert((c, load));
        }
    }
    let fits = |load: f64, step: f64| load <= limit && is_round(load, step);
    let all = |factor: f64, step: f64| loads.values().all(|(_, load)| fits(load * factor, step));
    if loads.len() < LEAST_LOADS || loads.values().any(|(_, load)| is_round(*load, STEP_READ)) {
        return None;
    }
    let (unit, factor) = units.iter().find(|(_, factor)| all(*factor, STEP_MEANT))?;
    let (c, most) = loads.values().max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is {most:.4} {n} at most, no round number; in {unit} it and {} other loads would be round: {:.2} {n}. Is {unit} its unit? Declare the unit by [laxity_format.NAME.columns]",
            c.load_column(),
            loads.len() - 1,
            most * factor,
            n = c.load_unit()
        ),
    })
}

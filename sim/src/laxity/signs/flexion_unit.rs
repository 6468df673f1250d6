//! Whether the loads of one flexion or of one test there, or the place of the tibia, are in another unit than at the other flexions.

use crate::coordinate::{AP, Coordinate, IE, SI, VV};
use crate::laxity::motion::USUAL_SI_MM;
use crate::laxity::{LaxityTrial, SignDoubt, Test};
use std::collections::BTreeMap;

/// Loads of a flexion are below this share of the others' where they may be in another unit [-], and move the knee by more than that share of its motion at
/// the others. In 173 files of published and simulated knees a load of 0.25 of the others moves a knee by 0.16. A knee that is loose at first may move by
/// 0.7. Ours.
const LEAST_LOAD: f64 = 0.25;
const LEAST_MOTION: f64 = 0.75;
/// The others' load is within this factor of what the smaller one would be in the other unit [-]; ours: a laboratory means one load at all flexions.
/// 1 N m beside 5 N m is no unit's factor.
const ALIKE: f64 = 1.1;
/// SI at a flexion lies nearer to 0 than this share of where it is at the others, throughout [-]: in those files it has 0.57 and more. Ours.
const NEAR_ZERO: f64 = 0.25;
/// Trials of a flexion from which on it is compared: of one test's coordinate, and of all.
const LEAST_OWN: usize = 2;
const LEAST_TRIALS: usize = 4;
/// What a force, a moment or a length in another unit is in N, N m or mm.
const FORCES: [(&str, f64); 3] = [("lbf", 4.448_221_615_260_5), ("kgf", 9.806_65), ("kN", 1000.0)];
const MOMENTS: [(&str, f64); 2] = [("kgf m", 9.806_65), ("kN m", 1000.0)];
const LENGTHS: [(&str, f64); 3] = [("cm", 10.0), ("inches", 25.4), ("m", 1000.0)];
/// Largest loads of a test at other flexions agree to this share, where one alone is compared with them [-]: loads that were meant, not reached. Ours.
const MEANT: f64 = 2e-3;
/// One load is off by a unit's factor to this share [-]: four digits of each number. 30 N beside 133 N is off from lbf by 3e-3. Ours.
const EXACT: f64 = 1e-3;
/// Other flexions of a test beside which one load is compared.
const LEAST_OTHERS: usize = 2;
/// A moment in this unit is near to one in N m: only an exact factor shows it.
const FOOT_POUND: (&str, f64) = ("ft lbf", 1.355_817_948_331_4);

/// Doubts about the unit at one flexion.
pub(super) fn doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let poses: Vec<&LaxityTrial> = trials.iter().filter(|t| t.reference.is_none() && t.test != Test::Neutral).collect();
    let loads = [VV, IE, AP].into_iter().filter_map(|c| loads(&poses, c).or_else(|| one_load(&poses, c)));
    loads.chain(place(&poses)).collect()
}

/// Values by nominal flexion.
fn by_flexion<T>(of: &[&LaxityTrial], value: impl Fn(&LaxityTrial) -> Option<T>) -> BTreeMap<i64, Vec<T>> {
    let mut all: BTreeMap<i64, Vec<T>> = BTreeMap::new();
    for t in of {
        all.entry(t.nominal_flexion_deg.round() as i64).or_default().extend(value(t));
    }
    all
}

/// Loads of a flexion that are far smaller than the others' and move the knee as far.
fn loads(poses: &[&LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let own: Vec<&LaxityTrial> = poses.iter().copied().filter(|t| t.test.coordinate() == Some(c)).collect();
    let all = by_flexion(&own, |t| Some([t.load[c].abs(), t.measured[c]?]));
    let one = |of: &Vec<[f64; 2]>| {
        let load = of.iter().map(|p| p[0]).fold(0.0, f64::max);
        let [low, high] = of.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p[1]), h.max(p[1])]);
        (of.len() >= LEAST_OWN && load > 0.0).then_some([load, high - low])
    };
    let all: BTreeMap<i64, [f64; 2]> = all.iter().filter_map(|(at, of)| Some((*at, one(of)?))).collect();
    let units = if c.turns() { &MOMENTS[..] } else { &FORCES[..] };
    let small = |(at, here): (&i64, &[f64; 2])| {
        let others = |k: usize| middle(all.iter().filter(|(other, _)| *other != at).map(|(_, v)| v[k]).collect());
        let there = [others(0)?, others(1)?];
        let (unit, factor) = nearest(units, there[0] / here[0])?;
        let is_unit = (there[0] / here[0] / factor).ln().abs() < ALIKE.ln();
        let is_small = here[0] < LEAST_LOAD * there[0] && here[1] > LEAST_MOTION * there[1];
        (is_small && is_unit).then_some((*at, *here, there, unit))
    };
    let (at, here, there, unit) = all.iter().find_map(small)?;
    Some(SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is at most {:.2} {n} at {at} deg, and {:.1} {n} at the other flexions, and the knee moves by {:.1} {m} there and by {:.1} {m} at the others: maybe it is in {unit} there. Expected one unit in the whole column: look at the record, and write it in {n} if so",
            c.load_column(),
            here[0],
            there[0],
            here[1],
            there[1],
            n = c.load_unit(),
            m = c.unit()
        ),
    })
}

/// The largest load of one test at one flexion that is a unit's factor below those at the other flexions, which are all one number.
fn one_load(poses: &[&LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let mut tests: BTreeMap<Test, BTreeMap<i64, &LaxityTrial>> = BTreeMap::new();
    for t in poses.iter().copied().filter(|t| t.test.coordinate() == Some(c)) {
        let largest = tests.entry(t.test).or_default().entry(t.nominal_flexion_deg.round() as i64).or_insert(t);
        if t.load[c].abs() > largest.load[c].abs() {
            *largest = t;
        }
    }
    let units = if c.turns() { [&MOMENTS[..], &[FOOT_POUND]].concat() } else { FORCES.to_vec() };
    let (t, there, unit) = tests.values().find_map(|of| odd_load(of, c, &units))?;
    Some(SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is {:.3} {n} in trial \"{}\", and {there:.1} {n} in the {} trials at all other flexions, which is the same in {unit}: maybe it is in {unit} there. Expected one unit in the whole column: look at the record, and write it in {n} if so",
            c.load_column(),
            t.load[c].abs(),
            t.trial,
            t.test.name(),
            n = c.load_unit()
        ),
    })
}

/// Of the largest loads of a test by flexion: the trial whose load is off by a unit's factor, the load of the others, and the unit.
fn odd_load<'a>(
    of: &BTreeMap<i64, &'a LaxityTrial>,
    c: Coordinate,
    units: &[(&'static str, f64)],
) -> Option<(&'a LaxityTrial, f64, &'static str)> {
    of.iter().find_map(|(at, t)| {
        let others: Vec<f64> =
            of.iter().filter(|(other, _)| *other != at).map(|(_, other)| other.load[c].abs()).collect();
        let [low, high] = others.iter().fold([f64::INFINITY, 0.0], |[l, h], x| [f64::min(l, *x), f64::max(h, *x)]);
        let is_one = others.len() >= LEAST_OTHERS && high - low <= MEANT * high && t.load[c] != 0.0;
        let there = f64::midpoint(low, high);
        let factor = there / t.load[c].abs();
        let fits = units.iter().find(|(_, of_unit)| (factor / of_unit).ln().abs() < EXACT);
        fits.filter(|_| is_one).map(|(unit, _)| (*t, there, *unit))
    })
}

/// SI of a flexion that lies far nearer to 0 than at the others.
fn place(poses: &[&LaxityTrial]) -> Option<SignDoubt> {
    let mut all = by_flexion(poses, |t| t.measured[SI].map(f64::abs));
    all.retain(|_, of| of.len() >= LEAST_TRIALS);
    let small = |(at, here): (&i64, &Vec<f64>)| {
        let rest = all.iter().filter(|(other, _)| *other != at);
        let others = middle(rest.filter_map(|(_, of)| middle(of.clone())).collect())?;
        let most = here.iter().copied().fold(0.0, f64::max);
        let middle_here = middle(here.clone())?;
        let (unit, _) = nearest(&LENGTHS, others / middle_here)?;
        // another doubt tells of SI that counts from another zero at all flexions
        let is_usual = (-USUAL_SI_MM[1]..=-USUAL_SI_MM[0]).contains(&others);
        (most < NEAR_ZERO * others && is_usual).then_some((*at, middle_here, others, unit))
    };
    let (at, here, others, unit) = all.iter().find_map(small)?;
    Some(SignDoubt {
        column: SI.column(),
        words: format!(
            "si_mm lies {here:.2} mm from 0 at {at} deg, and {others:.1} mm at the other flexions: maybe it is in {unit} there, or counted from another zero. Expected the place of the tibia's origin in the femur's frame, in mm throughout"
        ),
    })
}

/// The unit whose factor is nearest to this one, with its factor.
fn nearest(units: &[(&'static str, f64)], factor: f64) -> Option<(&'static str, f64)> {
    let off = |of: f64| (factor / of).ln().abs();
    units.iter().copied().min_by(|a, b| off(a.1).total_cmp(&off(b.1)))
}

/// The middle of a list; none of an empty one, nor where it is nothing.
fn middle(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().filter(|m| *m > 0.0)
}

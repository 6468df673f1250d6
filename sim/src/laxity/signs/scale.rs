//! Whether the readings of one test, or of one flexion, are in another unit than the rest: they vary far less than the others, and would not in that unit.

use crate::coordinate::{AP, Coordinate, IE, ML, VV};
use crate::laxity::median::median;
use crate::laxity::{LaxityTrial, SignDoubt, Test};
use std::collections::{BTreeMap, BTreeSet};

/// A coordinate whose readings may be in another unit in a part of a file.
struct Scale {
    of: Coordinate,
    /// Other units and what they are in mm or deg.
    units: &'static [(&'static str, f64)],
    /// Readings of the part vary by less than this share of what the others do [-].
    share: f64,
    /// The same where the part's tests do not load the coordinate; it also lies nearer to 0 than this share of where the others do [-].
    coupled: f64,
    /// Readings lie no further from 0 than this, once they are in mm or deg.
    farthest: f64,
    /// The coordinate's own tests move a knee by no more than this at a flexion, once they are in mm or deg.
    widest: f64,
    /// The others vary by this much and more: over all of a test, and at a flexion [mm] or [deg].
    least: [f64; 2],
}

/// All limits are ours. They were tried on 173 files of published and simulated knees, cut ones among them. A test varies by 0.12 (VV), 0.17 (IE) and
/// 0.49 (AP) of the others at the least, and a flexion by 0.23, 0.33 and 0.32. A degree read from radians is 0.017 of itself; a millimetre read from
/// inches is 0.04 and from cm 0.1. Knees without a cruciate move by up to 30 mm and 104 deg at a flexion, and others by up to 30 deg VV.
///
/// Readings that a test does not load may vary far less than the others, or lie far nearer to 0. In 108 such files none does both: the larger of the
/// two shares is 0.20 (VV), 0.17 (IE), 0.22 (ML) and 0.19 (AP) at the least. No test loads ML, so that its `share` and `widest` judge nothing.
const SCALES: [Scale; 4] = [
    Scale { of: VV, units: &RADIANS, share: 0.09, coupled: 0.1, farthest: 30.0, widest: 45.0, least: [0.7, 1.0] },
    Scale { of: IE, units: &RADIANS, share: 0.09, coupled: 0.1, farthest: 60.0, widest: 110.0, least: [3.0, 3.0] },
    Scale { of: ML, units: &LENGTHS, share: 0.2, coupled: 0.15, farthest: 30.0, widest: 30.0, least: [1.0, 1.0] },
    Scale { of: AP, units: &LENGTHS, share: 0.2, coupled: 0.15, farthest: 40.0, widest: 38.0, least: [5.0, 2.0] },
];
const RADIANS: [(&str, f64); 1] = [("radians", 57.295_779_513_082_32)];
const LENGTHS: [(&str, f64); 2] = [("cm", 10.0), ("inches", 25.4)];
/// Readings of a test from which on what they vary by is no chance.
const LEAST_READINGS: usize = 4;
/// Readings of a flexion: of the tests that load the coordinate, and of the others.
const LEAST_AT_A_FLEXION: [usize; 2] = [2, 3];
/// Flexions over which a test varies.
const LEAST_FLEXIONS: usize = 2;
/// Other tests beside which a test's coupled readings are small.
const LEAST_OTHER_TESTS: usize = 2;
/// Once it is in the other unit, a part varies by more than this share of what the others do [-]; of less, no unit is the cause. Below the least of
/// those files. Ours.
const LEAST_EXPLAINED: f64 = 0.1;

/// A reading of a pose: its test, nominal flexion [deg], load and value.
struct Reading {
    test: Test,
    at: i64,
    load: f64,
    value: f64,
}

/// A part of the readings that varies too little: what it is called, by how much it and the others vary, and the unit that would explain it.
#[derive(Clone)]
struct Small {
    part: String,
    varies: f64,
    others: f64,
    unit: &'static str,
    /// Whether its tests load the coordinate: one that none of them loads may be held.
    loaded: bool,
}

/// Coordinates of which one test or one flexion may be in another unit. Displacements are left out: they do not show where a knee lies.
pub(super) fn doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let one = |scale: &Scale| {
        let poses = trials.iter().filter(|t| t.reference.is_none() && t.test != Test::Neutral);
        let reading = |t: &LaxityTrial| {
            let at = t.nominal_flexion_deg.round() as i64;
            Some(Reading { test: t.test, at, load: t.load[scale.of], value: t.measured[scale.of]? })
        };
        let all: Vec<Reading> = poses.filter_map(reading).collect();
        let of_tests = of_a_test(&all, scale);
        let of_flexions = || [of_a_flexion(&all, scale), of_a_coupled_flexion(&all, scale)].concat();
        let found = if of_tests.is_empty() { of_flexions() } else { of_tests };
        told(&found, scale)
    };
    SCALES.iter().filter_map(one).collect()
}

/// Tests whose readings hardly vary over loads and flexions, beside those of the other tests.
fn of_a_test(all: &[Reading], scale: &Scale) -> Vec<Small> {
    let mut tests: BTreeMap<Test, Vec<&Reading>> = BTreeMap::new();
    all.iter().for_each(|r| tests.entry(r.test).or_default().push(r));
    tests.retain(|_, of| of.iter().map(|r| r.at).collect::<BTreeSet<_>>().len() >= LEAST_FLEXIONS);
    let one = |(test, of): (&Test, &Vec<&Reading>)| {
        let loaded = test.coordinate() == Some(scale.of);
        let rest: Vec<[f64; 2]> =
            tests.iter().filter(|(other, _)| *other != test).map(|(_, there)| size(there)).collect();
        let enough = of.len() >= LEAST_READINGS && (loaded || rest.len() >= LEAST_OTHER_TESTS);
        let small = small(of, &rest, scale, loaded)?;
        let unit = scale.unit(small.share, small.most, all, |r| r.test == *test)?;
        let part = format!("in the {} trials", test.name());
        let shown = enough && small.others >= scale.least[0];
        shown.then_some(Small { part, varies: small.varies, others: small.others, unit, loaded })
    };
    tests.iter().filter_map(one).collect()
}

/// Flexions at which readings hardly vary and lie near 0, beside the other flexions, in a file without a test that loads the coordinate.
fn of_a_coupled_flexion(all: &[Reading], scale: &Scale) -> Vec<Small> {
    if all.iter().any(|r| r.test.coordinate() == Some(scale.of)) {
        return Vec::new();
    }
    let [_, least_rest] = LEAST_AT_A_FLEXION;
    let mut flexions: BTreeMap<i64, Vec<&Reading>> = BTreeMap::new();
    all.iter().for_each(|r| flexions.entry(r.at).or_default().push(r));
    flexions.retain(|_, of| of.len() >= least_rest);
    let one = |(at, of): (&i64, &Vec<&Reading>)| {
        let rest: Vec<[f64; 2]> =
            flexions.iter().filter(|(other, _)| *other != at).map(|(_, there)| size(there)).collect();
        let small = small(of, &rest, scale, false)?;
        let unit = scale.unit(small.share, small.most, all, |r| r.at == *at)?;
        let part = format!("at {at} deg");
        let shown = small.others >= scale.least[1];
        shown.then_some(Small { part, varies: small.varies, others: small.others, unit, loaded: false })
    };
    flexions.iter().filter_map(one).collect()
}

/// How far readings vary, and how far from 0 they lie at most.
fn size(of: &[&Reading]) -> [f64; 2] {
    [span(of.iter().map(|r| r.value)), of.iter().map(|r| r.value.abs()).fold(0.0, f64::max)]
}

/// A part of the readings beside the others: by how much both vary, the part's share, and the largest share that shows another unit.
struct Beside {
    varies: f64,
    others: f64,
    share: f64,
    most: f64,
}

/// How small a part is beside `rest`, the [`size`] of each of the others; none where it does not vary at all.
fn small(of: &[&Reading], rest: &[[f64; 2]], scale: &Scale, loaded: bool) -> Option<Beside> {
    let [varies, lies] = size(of);
    let [others, there] = [0, 1].map(|k| middle(rest.iter().map(|size| size[k]).collect()));
    let (others, there) = (others?, there?);
    // what no test moves may stand still; in another unit it lies near 0 as well
    let (share, most) =
        if loaded { (varies / others, scale.share) } else { ((varies / others).max(lies / there), scale.coupled) };
    (varies > 0.0).then_some(Beside { varies, others, share, most })
}

/// How far readings vary at a flexion: under the coordinate's own loads, by load, and under the other tests' loads.
struct AtFlexion {
    own: f64,
    by_load: f64,
    coupled: f64,
}

/// Flexions at which the coordinate hardly varies, in its own tests and in the others, beside the other flexions.
fn of_a_flexion(all: &[Reading], scale: &Scale) -> Vec<Small> {
    let flexions: BTreeSet<i64> = all.iter().map(|r| r.at).collect();
    let vary: BTreeMap<i64, AtFlexion> =
        flexions.into_iter().filter_map(|at| Some((at, at_flexion(all, at, scale.of)?))).collect();
    let one = |(at, here): (&i64, &AtFlexion)| {
        let others = |of: fn(&AtFlexion) -> f64| {
            middle(vary.iter().filter(|(other, _)| *other != at).map(|(_, there)| of(there)).collect())
        };
        let own = others(|v| v.own)?;
        // a knee may be stiff in one of them; a unit makes all of them less
        let shares = [here.own / own, here.by_load / others(|v| v.by_load)?, here.coupled / others(|v| v.coupled)?];
        let share = shares.into_iter().fold(0.0, f64::max);
        let unit = scale.unit(share, scale.share, all, |r| r.at == *at)?;
        let part = format!("at {at} deg");
        (own >= scale.least[1]).then_some(Small { part, varies: here.own, others: own, unit, loaded: true })
    };
    vary.iter().filter_map(one).collect()
}

fn at_flexion(all: &[Reading], at: i64, c: Coordinate) -> Option<AtFlexion> {
    let here = all.iter().filter(|r| r.at == at);
    let (own, rest): (Vec<&Reading>, Vec<&Reading>) = here.partition(|r| r.test.coordinate() == Some(c));
    let [least_own, least_rest] = LEAST_AT_A_FLEXION;
    let load = span(own.iter().map(|r| r.load));
    let varies = span(own.iter().map(|r| r.value));
    let coupled = span(rest.iter().map(|r| r.value));
    let enough = own.len() >= least_own && rest.len() >= least_rest;
    (enough && load > 0.0 && varies > 0.0).then_some(AtFlexion { own: varies, by_load: varies / load, coupled })
}

impl Scale {
    /// The unit in which a part's readings would vary most as the others do, by the share of these that they vary by; none where the share is no unit's,
    /// or no knee would be so in that unit.
    fn unit(&self, share: f64, most: f64, all: &[Reading], is_part: impl Fn(&Reading) -> bool) -> Option<&'static str> {
        let explains = |factor: f64| share < most && share * factor > LEAST_EXPLAINED;
        let fits = self.units.iter().filter(|(_, f)| explains(*f) && self.is_a_knee(all, &is_part, *f));
        let off = |factor: f64| (share * factor).ln().abs();
        fits.min_by(|a, b| off(a.1).total_cmp(&off(b.1))).map(|(unit, _)| *unit)
    }

    /// Whether a knee may lie and move so, if a part's readings are this many times what they are: a ligament that is torn makes one test small
    /// beside its fellow, and in another unit that test would be wider than any knee's.
    fn is_a_knee(&self, all: &[Reading], is_part: impl Fn(&Reading) -> bool, factor: f64) -> bool {
        let most = all.iter().filter(|r| is_part(r)).map(|r| factor * r.value.abs()).fold(0.0, f64::max);
        let mut flexions: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
        for r in all.iter().filter(|r| r.test.coordinate() == Some(self.of)) {
            flexions.entry(r.at).or_default().push(if is_part(r) { factor * r.value } else { r.value });
        }
        most <= self.farthest && flexions.into_values().all(|of| span(of.into_iter()) <= self.widest)
    }
}

fn told(found: &[Small], scale: &Scale) -> Option<SignDoubt> {
    let first = found.first()?;
    let (column, unit) = (scale.of.column(), scale.of.unit());
    let parts: Vec<&str> = found.iter().map(|small| small.part.as_str()).collect();
    let (or_held, then) = if found.iter().all(|small| small.loaded) {
        (String::new(), "")
    } else {
        (format!(", or the apparatus held {column} there"), ", and leave its cells empty where it was held")
    };
    let words = format!(
        "{column} varies by {:.2} {unit} {}, and by {:.1} {unit} in the others: maybe these readings are in {}, and the rest in {unit}{or_held}. Expected one unit in the whole column: look at their record, and write them in {unit} if so{then}",
        first.varies,
        parts.join(" and "),
        first.others,
        first.unit
    );
    Some(SignDoubt { column, words })
}

/// The largest less the smallest; 0 of nothing.
fn span(values: impl Iterator<Item = f64>) -> f64 {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(x), h.max(x)]);
    (high - low).max(0.0)
}

/// The middle of a list; none of an empty one, nor where it is nothing.
fn middle(values: Vec<f64>) -> Option<f64> {
    median(values).filter(|m| *m > 0.0)
}

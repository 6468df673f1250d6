//! Whether a laxity file's zeros, units and columns are the expected ones, judged by what every knee does.

use super::motion::{LEAST_MOTION, USUAL_MEAN, USUAL_SI_MM, WORKING_LOAD, mean, range, tests};
use super::{LaxityTrial, SignDoubt, Test};
use crate::coordinate::{AP, Coordinate, FREE, IE, ML, SI, VV};
use notices::plain;
use std::collections::{BTreeMap, BTreeSet};

/// Coordinates that are all nothing together in a trial; three at once are no coincidence. Ours.
const LEAST_ZEROS: usize = 3;
/// Below these, the largest load of a coordinate's tests is of another unit: VV, IE [N m], AP [N]. Arthrometers begin at 67 N (15 lbf), robots at
/// 5 N m; of moments two fifths and a fifth, since some are turned by hand. Ours.
const LEAST_LOAD: [(Coordinate, f64); 3] = [(VV, 2.0), (IE, 1.0), (AP, 60.0)];
/// Where the largest loads of tests lie: VV, IE [N m], AP [N]. From arthrometers (67 to 178 N) and robots (5 to 15 N m); a unit that brings a load
/// there is named. Ours.
const USUAL_LOAD: [(Coordinate, [f64; 2]); 3] = [(VV, [4.0, 20.0]), (IE, [2.5, 15.0]), (AP, [60.0, 300.0])];
/// Units of a force and of a moment that a number may be in, or be turned from for nothing, and what they are in N or N m.
const FORCES: [(&str, f64); 5] = [
    ("kN", 1000.0),
    ("lbf", 4.448_221_615_260_5),
    ("kgf", 9.806_65),
    ("N, not in lbf", 0.224_808_943_1),
    ("mN", 0.001),
];
const MOMENTS: [(&str, f64); 5] = [
    ("kN m", 1000.0),
    ("N mm", 0.001),
    ("N cm", 0.01),
    ("lbf in", 0.112_984_829_027_616_7),
    ("N m, not in lbf in", 8.850_745_791_3),
];
/// Loads beyond these are of another unit: VV, IE [N m], ML, AP, SI [N]. Twice what arthrometers and robots apply; of SI three times the
/// weight of a heavy person. Ours.
const MOST_LOAD: [(Coordinate, f64); 5] = [(VV, 60.0), (IE, 30.0), (ML, 500.0), (AP, 500.0), (SI, 3000.0)];
/// A knee's whole range under its tests is less, by the largest load: VV [N m], IE [N m], AP [N] up to which, and VV, IE [deg], AP [mm]. Ours, all of
/// them: under usual loads about a third more than the loosest of two published knees and their phantoms; where the load has no limit, one and a half
/// times what knees without their cruciates show.
const MOST_MOTION: [(Coordinate, f64, f64); 8] = [
    (VV, 10.5, 28.0),
    (VV, f64::INFINITY, 45.0),
    (IE, 6.0, 65.0),
    (IE, 8.0, 80.0),
    (IE, f64::INFINITY, 110.0),
    (AP, 140.0, 30.0),
    (AP, 210.0, 38.0),
    (AP, f64::INFINITY, 60.0),
];
/// A compression of less is none, and one that is not 0 of another unit [N]: robots hold 20 to 50 N, a standing person 400.
const LEAST_COMPRESSION_N: f64 = 1.0;
/// The largest load of a test over that of its fellow, which loads the other way [-]. Ours: published and simulated knees have 0.96 and more, and one may be
/// loaded by the limb's weight alone.
const LEAST_OF_FELLOW: f64 = 0.05;
/// ML moves by more than this over the loaded tests of a position [mm]: in two published knees and their phantoms by 2.7 to 12. Ours.
const LEAST_ML_MM: f64 = 1.0;
/// A load along a coordinate that no trial of other tests is without: more than these in each of them is a sensor that was not zeroed. VV, IE [N m],
/// ML, AP [N]. Twice what a published robot leaves there in the median, and above its noise. Ours.
const LEAST_TARE: [(Coordinate, f64); 4] = [(VV, 1.0), (IE, 0.75), (ML, 15.0), (AP, 8.0)];
/// Trials of other tests, and how many such tests, from which on a load that all have in common shows.
const LEAST_BESIDE: usize = 6;
const LEAST_TESTS_BESIDE: usize = 2;
/// Trials of a position from which on its ML shows that: all six tests, or one in steps.
const LEAST_OF_A_POSITION: usize = 6;

/// What looks zeroed, scaled or exchanged.
pub(super) fn doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let unlike = super::order::unlike(trials);
    // readings whose cause is known need no other word
    let mut known = super::numbers::codes(trials);
    if unlike.is_none() && is_whole(trials) {
        known.extend(super::outliers::of_one_test(trials));
        let alone = super::one_reading::doubts(trials).into_iter();
        let unknown: Vec<SignDoubt> = alone.filter(|d| known.iter().all(|k| k.column != d.column)).collect();
        known.extend(unknown);
    }
    let (coarse, rounded) = super::numbers::coarse(trials);
    let column = |d: &SignDoubt| known.iter().map(|k| &k.column).chain(&coarse).all(|known| *known != d.column);
    let more: Vec<SignDoubt> = more(trials, &known).into_iter().filter(column).collect();
    unlike.into_iter().chain(known).chain(rounded).chain(more).collect()
}

/// Whether nothing was cut. A cut knee gives way: one trial may lie far from the next, and farther than any whole knee goes.
fn is_whole(trials: &[LaxityTrial]) -> bool {
    trials.iter().all(|t| t.without.is_empty())
}

/// What is told of a column that no other cause explains.
fn more(trials: &[LaxityTrial], known: &[SignDoubt]) -> Vec<SignDoubt> {
    let mut found: Vec<SignDoubt> = super::flexion::doubt(trials).into_iter().collect();
    found.extend(pose_zero(trials));
    found.extend(super::order::unloaded_differ(trials));
    let tares: Vec<SignDoubt> = LEAST_TARE.iter().filter_map(|limit| tare(trials, *limit)).collect();
    // a load that all trials have makes no test of a neutral one
    found.extend(super::order::loaded_neutral(trials).filter(|_| tares.is_empty()));
    found.extend(super::numbers::doubts(trials));
    found.extend(super::stated::doubts(trials));
    found.extend(no_compression(trials));
    found.extend(tares);
    found.extend(LEAST_LOAD.iter().filter_map(|limit| small_load(trials, *limit)));
    found.extend([VV, IE, AP].into_iter().filter_map(|c| unlike_loads(trials, c)));
    found.extend(LEAST_MOTION.iter().filter_map(|limit| small_motion(trials, *limit)));
    found.extend(MOST_LOAD.iter().filter_map(|limit| large_load(trials, *limit)));
    found.extend(far_origin(trials));
    found.extend(USUAL_MEAN.iter().filter_map(|usual| far_mean(trials, *usual)));
    found.extend(still(trials));
    if is_whole(trials) {
        found.extend(super::outliers::doubts(trials));
        found.extend([VV, IE, AP].into_iter().filter_map(|c| large_motion(trials, c)));
        found.extend(super::between::side_of_a_flexion(trials));
    }
    found.extend(super::lag::names(trials));
    found.extend(super::exchanged::likely(trials, known));
    found
}

/// A trial whose whole pose is nothing: poses are counted from it.
fn pose_zero(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let zeroed = |t: &&LaxityTrial| {
        let given: Vec<f64> = FREE.iter().filter_map(|c| t.measured[*c]).collect();
        t.reference.is_none() && given.len() >= LEAST_ZEROS && given.iter().all(|x| x.abs() < 1e-9)
    };
    let own: Vec<&LaxityTrial> = trials.iter().filter(zeroed).collect();
    let first = own.first().filter(|_| trials.iter().any(|t| t.reference.is_none() && !zeroed(&t)))?;
    Some(SignDoubt {
        column: "vv_deg".into(),
        words: format!(
            "the pose of trial \"{}\" is 0 in every coordinate: poses are zeroed there, counted from that trial. Expected the pose of the tibia in the femur's frame; declare readings = \"difference\" if they count from the unloaded trial",
            first.trial
        ),
    })
}

/// A load that all trials have which do not test its coordinate: what the sensor reads of nothing.
fn tare(trials: &[LaxityTrial], (c, least): (Coordinate, f64)) -> Option<SignDoubt> {
    let beside: Vec<&LaxityTrial> = trials.iter().filter(|t| t.test.coordinate() != Some(c)).collect();
    let tests: BTreeSet<Test> = beside.iter().map(|t| t.test).collect();
    let mut loads: Vec<f64> = beside.iter().map(|t| t.load[c]).collect();
    loads.sort_by(f64::total_cmp);
    let (low, high) = (*loads.first()?, *loads.last()?);
    let enough = loads.len() >= LEAST_BESIDE && tests.len() >= LEAST_TESTS_BESIDE;
    (enough && (low > least || high < -least)).then(|| SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is {:+.2} {unit} in the median of the {} trials that do not test {}, and 0 in none of them: was the sensor not zeroed (tare, or the limb's weight)? Expected 0 where nothing is applied: take it off the whole column",
            c.load_column(),
            loads[loads.len() / 2],
            loads.len(),
            c.name().to_uppercase(),
            unit = c.load_unit()
        ),
    })
}

fn largest_load(of: &[&LaxityTrial], c: Coordinate) -> f64 {
    of.iter().map(|t| t.load[c].abs()).fold(0.0, f64::max)
}

/// Tests whose loads are far too small.
fn small_load(trials: &[LaxityTrial], (c, least): (Coordinate, f64)) -> Option<SignDoubt> {
    let own = tests(trials, c);
    let largest = largest_load(&own, c);
    (!own.is_empty() && largest < least).then(|| SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is at most {} {} in the tests by that name. Expected more than {least}: is its unit another, or are columns exchanged?{} Declare the unit by [laxity_format.NAME.columns]",
            c.load_column(),
            plain(largest),
            c.load_unit(),
            likely_unit(c, largest)
        ),
    })
}

/// A test whose loads are of another unit than those of its fellow, or were not recorded.
fn unlike_loads(trials: &[LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let mut largest: BTreeMap<Test, f64> = BTreeMap::new();
    for t in tests(trials, c) {
        let most = largest.entry(t.test).or_default();
        *most = most.max(t.load[c].abs());
    }
    let by_load = |a: &(&Test, &f64), b: &(&Test, &f64)| a.1.total_cmp(b.1);
    let ((small, less), (large, more)) = (largest.iter().min_by(by_load)?, largest.iter().max_by(by_load)?);
    (*less < LEAST_OF_FELLOW * more).then(|| SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is at most {} {unit} in the tests called {}, and {} {unit} in those called {}: is one of them in another unit, or was its load not recorded? Expected loads of one size both ways",
            c.load_column(),
            plain(*less),
            small.name(),
            plain(*more),
            large.name(),
            unit = c.load_unit()
        ),
    })
}

/// The units in which a test's largest load would be a usual one, in words; nothing where there are none.
fn likely_unit(c: Coordinate, load: f64) -> String {
    let Some((_, [least, most])) = USUAL_LOAD.iter().find(|(i, _)| *i == c) else { return String::new() };
    let units = if c.load_unit() == "N" { FORCES } else { MOMENTS };
    let fits = units.iter().filter(|(_, factor)| (*least..=*most).contains(&(load * factor)));
    fits.map(|(unit, factor)| format!(" In {unit} it would be {:.3} {}, as tests have.", load * factor, c.load_unit()))
        .collect()
}

/// A load that no laxity test applies.
fn large_load(trials: &[LaxityTrial], (c, most): (Coordinate, f64)) -> Option<SignDoubt> {
    let worst = trials.iter().max_by(|a, b| a.load[c].abs().total_cmp(&b.load[c].abs()))?;
    (worst.load[c].abs() > most).then(|| SignDoubt {
        column: c.load_column(),
        words: format!(
            "{} is {:.0} {} in trial \"{}\". Expected at most {most}: is its unit another (in lbf, N mm, kN), or are columns exchanged?{} Declare the unit by [laxity_format.NAME.columns]",
            c.load_column(),
            worst.load[c],
            c.load_unit(),
            worst.trial,
            likely_unit(c, worst.load[c].abs())
        ),
    })
}

/// Compression that is given and is next to nothing.
fn no_compression(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let most = trials.iter().map(|t| t.load[SI].abs()).fold(0.0, f64::max);
    (most > 0.0 && most < LEAST_COMPRESSION_N).then(|| SignDoubt {
        column: SI.load_column(),
        words: format!(
            "load_si_n is at most {} N and not 0. Expected 0, or the compression of the joint, 20 N and more: is its unit another (kN)? Declare the unit by [laxity_format.NAME.columns]",
            plain(most)
        ),
    })
}

/// Tests whose readings move farther than any knee does.
fn large_motion(trials: &[LaxityTrial], c: Coordinate) -> Option<SignDoubt> {
    let own = tests(trials, c);
    let load = largest_load(&own, c);
    let (_, _, most) = MOST_MOTION.into_iter().find(|(of, up_to, _)| *of == c && load <= *up_to)?;
    let moved = range(&own, c).filter(|r| *r > most)?;
    Some(SignDoubt {
        column: c.column(),
        words: format!(
            "{} moves by {moved:.0} {} in its own tests, under {} {} at most. Expected at most {most}: is its unit another, is it counted twice, or are columns exchanged? Declare the unit by [laxity_format.NAME.columns]",
            c.column(),
            c.unit(),
            plain(load),
            c.load_unit()
        ),
    })
}

/// Poses about another zero than a knee's.
fn far_mean(trials: &[LaxityTrial], (c, [least, most]): (Coordinate, [f64; 2])) -> Option<SignDoubt> {
    let mean = mean(trials, c).filter(|m| !(least..=most).contains(m))?;
    Some(SignDoubt {
        column: c.column(),
        words: format!(
            "{} is {mean:.1} {unit} in the mean. Expected {least:.0} to {most:.0} {unit}: does it have an offset, counted from another zero, or another unit? Take the offset off, or declare readings = \"difference\"",
            c.column(),
            unit = c.unit()
        ),
    })
}

/// Poses whose SI is that of no pair of origins: another unit, or another zero.
fn far_origin(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let mean = mean(trials, SI)?;
    let [least, most] = USUAL_SI_MM;
    (!(least..=most).contains(&mean)).then(|| SignDoubt {
        column: SI.column(),
        words: format!(
            "si_mm is {mean:.1} mm in the mean. The tibia's origin lies 20 to 35 mm below the femur's: expected {least:.0} to {most:.0}. Is the unit another (cm, in), or do poses count from another zero? Declare the unit by [laxity_format.NAME.columns], or readings = \"difference\""
        ),
    })
}

/// Tests whose readings hardly move under their full load.
fn small_motion(trials: &[LaxityTrial], (c, least): (Coordinate, f64)) -> Option<SignDoubt> {
    let own = tests(trials, c);
    let working = WORKING_LOAD.iter().find(|(i, _)| *i == c).map_or(f64::INFINITY, |(_, l)| *l);
    let moved = range(&own, c).filter(|r| *r < least && largest_load(&own, c) > working)?;
    Some(SignDoubt {
        column: c.column(),
        words: format!(
            "{} moves by {moved:.3} {} in its own tests. Expected more than {least}: is its unit another (rad, cm, m), or are columns exchanged? Declare the unit by [laxity_format.NAME.columns]",
            c.column(),
            c.unit()
        ),
    })
}

/// ML that hardly moves at any position, and yet is not held.
fn still(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let mut positions: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.reference.is_none() && t.test.coordinate().is_some()) {
        positions.entry(t.nominal_flexion_deg.round() as i64).or_default().extend(t.measured[ML]);
    }
    let span = |of: &Vec<f64>| of.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(*x), h.max(*x)]);
    let full = positions.values().filter(|of| of.len() >= LEAST_OF_A_POSITION);
    let moved = full.map(span).map(|[low, high]| high - low).max_by(f64::total_cmp)?;
    (moved > 0.0 && moved < LEAST_ML_MM).then(|| SignDoubt {
        column: ML.column(),
        words: format!(
            "ml_mm moves by {moved:.3} mm at most over all tests of a position. Expected more than {LEAST_ML_MM}, though no test loads it: is its unit another (cm, m)? Declare the unit by [laxity_format.NAME.columns]"
        ),
    })
}

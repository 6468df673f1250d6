//! Whether one reading is in another unit than those about it: it lies far from where they say it would be, and near to it once it is in that unit.

use super::median::median;
use super::{LaxityTrial, SignDoubt, Test};
use crate::coordinate::{AP, Coordinate, IE, ML, SI, VV};
use std::collections::BTreeMap;

/// A unit's name, and what one of it is in deg or mm.
type Unit = (&'static str, f64);

/// A coordinate, how far a reading of it must lie from what is expected [deg] or [mm], and other units with what they are in deg or mm. Ours: ten times an
/// instrument's noise and more, and less than a reading that jumped.
const KINDS: [(Coordinate, f64, &[Unit]); 5] =
    [(VV, 3.0, &[RADIANS]), (IE, 12.0, &[RADIANS]), (ML, 2.5, &LENGTHS), (AP, 4.0, &LENGTHS), (SI, 8.0, &LENGTHS)];
const RADIANS: Unit = ("radians", 57.295_779_513_082_32);
const LENGTHS: [Unit; 2] = [("cm", 10.0), ("inches", 25.4)];
/// Once it is in the other unit, a reading lies off by less than this share of what it does as it stands [-]. Ours.
const NEARER: f64 = 0.35;
/// It is this many times as far off as any reading of another test [-]. With all limits 108 files of published and simulated knees have no such reading.
/// One that lies near to 0 in its own unit tells nothing in another, and is not found. Ours.
const ALONE: f64 = 1.5;
/// Other tests whose step from one flexion to another says where a test's reading goes.
const LEAST_STEPS: usize = 3;

/// A reading under the largest load of its test and flexion.
type Readings<'a> = BTreeMap<(Test, i64), (&'a LaxityTrial, f64)>;

/// A reading, and where those about it say that it would be.
struct Place<'a> {
    trial: &'a LaxityTrial,
    read: f64,
    expected: f64,
}

impl Place<'_> {
    fn off(&self) -> f64 {
        (self.read - self.expected).abs()
    }
}

/// Readings that are in another unit, one of each coordinate at most. Displacements are left out: they do not show where a knee lies.
pub(super) fn doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    let poses: Vec<&LaxityTrial> = trials.iter().filter(|t| t.reference.is_none() && t.test != Test::Neutral).collect();
    let one = |(c, least, units): (Coordinate, f64, &[(&'static str, f64)])| {
        let flexions = along_flexion(&poses, c);
        odd(&flexions, c, least, units).or_else(|| odd(&along_load(&poses, c), c, least, units))
    };
    KINDS.into_iter().filter_map(one).collect()
}

/// Readings of each test over flexion. What the test reads at another flexion, and how far other tests go from there, says what is expected.
fn along_flexion<'a>(poses: &[&'a LaxityTrial], c: Coordinate) -> Vec<Place<'a>> {
    let mut readings: Readings = BTreeMap::new();
    for t in poses.iter().copied() {
        let (Some(own), Some(read)) = (t.test.coordinate(), t.measured[c]) else { continue };
        let largest = readings.entry((t.test, t.nominal_flexion_deg.round() as i64)).or_insert((t, read));
        if t.load[own].abs() > largest.0.load[own].abs() {
            *largest = (t, read);
        }
    }
    let place = |(key, (trial, read)): (&(Test, i64), &(&'a LaxityTrial, f64))| {
        Some(Place { trial, read: *read, expected: expected(&readings, *key)? })
    };
    readings.iter().filter_map(place).collect()
}

/// Where the others say that a reading would be: in the middle of what each other flexion says, so that one odd reading there does not count.
fn expected(readings: &Readings, (test, at): (Test, i64)) -> Option<f64> {
    let flexions = readings.keys().filter(|key| key.0 == test && key.1 != at).map(|key| key.1);
    let from = |there: i64| {
        let others = readings.iter().filter(|((other, flexion), _)| *other != test && *flexion == at);
        let step = |((other, _), (_, read)): (&(Test, i64), &(&LaxityTrial, f64))| {
            readings.get(&(*other, there)).map(|(_, start)| read - start)
        };
        let steps: Vec<f64> = others.filter_map(step).collect();
        let enough = steps.len() >= LEAST_STEPS;
        let (_, start) = readings.get(&(test, there)).filter(|_| enough)?;
        Some(start + median(steps)?)
    };
    let all: Vec<f64> = flexions.filter_map(from).collect();
    median(all)
}

/// A size of a load, what is read under it, and the trial.
type Loaded<'a> = (f64, f64, &'a LaxityTrial);

/// Readings of the coordinate's own tests over load. The loads beside say what is expected.
fn along_load<'a>(poses: &[&'a LaxityTrial], c: Coordinate) -> Vec<Place<'a>> {
    let mut ramps: BTreeMap<(Test, i64), Vec<Loaded>> = BTreeMap::new();
    for t in poses.iter().copied().filter(|t| t.test.coordinate() == Some(c)) {
        let Some(read) = t.measured[c] else { continue };
        ramps.entry((t.test, t.nominal_flexion_deg.round() as i64)).or_default().push((t.load[c].abs(), read, t));
    }
    ramps.values_mut().for_each(|ramp| ramp.sort_by(|a, b| a.0.total_cmp(&b.0)));
    let place = |three: &[Loaded<'a>]| {
        let [(low, before, _), (load, read, trial), (high, after, _)] = three else { return None };
        let expected = before + (load - low) / (high - low) * (after - before);
        (high > low).then_some(Place { trial, read: *read, expected })
    };
    ramps.values().flat_map(|ramp| ramp.windows(3)).filter_map(place).collect()
}

/// The reading that lies far off alone, where another unit explains it.
fn odd(places: &[Place], c: Coordinate, least: f64, units: &[(&str, f64)]) -> Option<SignDoubt> {
    // a reading that jumped may put those beside it off by half as much
    let farthest = places.iter().max_by(|a, b| a.off().total_cmp(&b.off()))?;
    let others = places.iter().filter(|other| other.trial.test != farthest.trial.test);
    // nothing is alone without others: no number is above NaN
    let next = others.map(Place::off).fold(f64::NAN, f64::max);
    let alone = Some(farthest).filter(|place| place.off() >= least && place.off() >= ALONE * next);
    let fits =
        |place: &Place| units.iter().find(|(_, f)| (place.read * f - place.expected).abs() < NEARER * place.off());
    let (place, (unit, _)) = alone.and_then(|place| Some((place, fits(place)?)))?;
    Some(SignDoubt {
        column: c.column(),
        words: format!(
            "trial \"{}\" reads {} {:.2} {n}, and the readings about it say {:.1} {n}: maybe this one is in {unit}, or it slipped, or its load was not applied. Expected one unit in the whole column: look at its record, write it in {n} if it is in {unit}, and leave the row out if it is no reading",
            place.trial.trial,
            c.column(),
            place.read,
            place.expected,
            n = c.unit()
        ),
    })
}

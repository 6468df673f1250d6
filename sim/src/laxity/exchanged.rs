//! Whether two columns of readings stand in each other's place: which follows the load, and which has the place of the tibia's origin.

use super::lag::follows_in;
use super::motion::{LEAST_MOTION, USUAL_MEAN, USUAL_SI_MM, mean, range, tests};
use super::{LaxityTrial, SignDoubt};
use crate::coordinate::{AP, Coordinate, IE, ML, SI, VV};

/// A coordinate this many times as far moved as the one that the test loads was exchanged for it [-]. Ours: coupled motion is less.
const EXCHANGED: f64 = 2.0;
/// A coordinate that tests load, and one that may stand in its column.
const PAIRS: [(Coordinate, Coordinate); 3] = [(AP, ML), (AP, SI), (IE, VV)];
/// The other column must follow the load by so much more of its spread [-]. Ours: a coupled coordinate follows it less than the loaded one.
const LEAST_GAIN: f64 = 0.3;

/// Columns that are exchanged beyond doubt, and which two. What else looks odd in these columns follows from it.
pub(super) fn sure(trials: &[LaxityTrial]) -> Option<(SignDoubt, [Coordinate; 2])> {
    let pairs =
        PAIRS.into_iter().filter_map(|pair| Some((moved(trials, pair, "are the two columns exchanged?")?, pair)));
    let by_load = pairs.filter(|(_, (c, other))| in_place(trials, *c, *other)).map(|(d, (c, other))| (d, [c, other]));
    by_load.chain([ML, AP].into_iter().filter_map(|c| origin(trials, c))).next()
}

/// Whether the readings of `other` follow the loads of `c`, and those of `c` do not.
fn in_place(trials: &[LaxityTrial], c: Coordinate, other: Coordinate) -> bool {
    let read_as = |t: &LaxityTrial| {
        let mut taken = t.clone();
        taken.measured[c] = t.measured[other];
        taken
    };
    let swapped: Vec<LaxityTrial> = trials.iter().map(read_as).collect();
    let theirs = follows_in(c, swapped.iter().map(|t| (t, t)), false);
    // a column that does not move at all follows nothing
    let own = follows_in(c, trials.iter().map(|t| (t, t)), true).unwrap_or(0.0);
    theirs.is_some_and(|theirs| theirs - own > LEAST_GAIN)
}

/// SI that has the mean of another coordinate, which has SI's.
fn origin(trials: &[LaxityTrial], c: Coordinate) -> Option<(SignDoubt, [Coordinate; 2])> {
    let (_, [least, most]) = USUAL_MEAN.into_iter().find(|(of, _)| *of == c)?;
    let [low, high] = USUAL_SI_MM;
    let (mine, si) = (mean(trials, c)?, mean(trials, SI)?);
    let is_si = |x: f64| (low..=high).contains(&x);
    let is_mine = |x: f64| (least..=most).contains(&x);
    (is_si(mine) && !is_mine(mine) && is_mine(si) && !is_si(si)).then(|| {
        let words = format!(
            "{} is {mine:.0} mm in the mean and si_mm {si:.0} mm: are the two columns exchanged? The tibia's origin lies 20 to 35 mm below the femur's",
            c.column()
        );
        (SignDoubt { column: c.column(), words }, [c, SI])
    })
}

/// Tests in which another coordinate moves far more than the loaded one.
pub(super) fn likely(trials: &[LaxityTrial], known: &[SignDoubt]) -> Vec<SignDoubt> {
    let pairs = PAIRS.into_iter().filter(|(_, other)| known.iter().all(|k| k.column != other.column()));
    let ask = |(c, other): (Coordinate, Coordinate)| {
        let ask = format!("are the two columns exchanged, or is {} in another unit?", c.column());
        moved(trials, (c, other), &ask)
    };
    pairs.filter_map(ask).collect()
}

fn moved(trials: &[LaxityTrial], (c, other): (Coordinate, Coordinate), ask: &str) -> Option<SignDoubt> {
    let own = tests(trials, c);
    let (mine, theirs) = (range(&own, c)?, range(&own, other)?);
    let least = LEAST_MOTION.iter().find(|(i, _)| *i == c).map_or(0.0, |(_, l)| *l);
    (theirs > EXCHANGED * mine.max(least)).then(|| SignDoubt {
        column: c.column(),
        words: format!(
            "{} moves by {theirs:.1} {} and {} by {mine:.1} in the tests that load {}: {ask}",
            other.column(),
            other.unit(),
            c.column(),
            c.name().to_uppercase()
        ),
    })
}

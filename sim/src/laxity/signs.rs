//! Whether the signs of a laxity file are the clinical ones, judged by what every knee does: it goes where it is pushed.

use super::motion::{LEAST_MOTION, LEAST_SPREAD, WORKING_LOAD};
use super::read::agrees;
use super::{LaxityTrial, SignDoubt};
use crate::coordinate::{AP, Coordinate, IE, SI, VV};
use std::collections::BTreeMap;

mod flexion_unit;
mod scale;

/// Words for the positive and the negative sign of each loaded coordinate.
const WORDS: [(Coordinate, &str, &str); 3] =
    [(VV, "valgus", "varus"), (IE, "external", "internal"), (AP, "anterior", "posterior")];
/// Mean SI beyond this says that the tibia's origin lies above the femur's [mm]; in a knee it lies 20 to 35 below.
const ABOVE_MM: f64 = 5.0;
/// Mean SI load below this is traction, which no laxity test applies [N].
const TRACTION_N: f64 = -5.0;
/// No knee is extended further than this beyond straight in a laxity test [deg]. Ours: 10 to 15 is the most of healthy ones.
const MOST_HYPEREXTENSION_DEG: f64 = 20.0;
/// No laxity is tested at so much flexion [deg]: a heel at the buttock is 150 to 160. Ours.
const MOST_FLEXION_DEG: f64 = 140.0;
/// The angle between the shafts is 180 deg less flexion; a mean nearer to it than this shows that it was given [deg]. Ours.
const NEAR_SUPPLEMENT_DEG: f64 = 20.0;

/// What looks turned round, coordinate by coordinate. A file whose loads, displacements and names of tests are all turned is not found.
pub fn sign_doubts(trials: &[LaxityTrial]) -> Vec<SignDoubt> {
    // what else looks odd follows from it
    let out_of_step = super::order::shifted(trials).or_else(|| super::lag::late(trials));
    if let Some(out_of_step) = out_of_step.or_else(|| super::lag::flexion(trials)) {
        return vec![out_of_step];
    }
    // nor does a unit of a part of a column show a sign, or another column
    let scaled = [scale::doubts(trials), flexion_unit::doubts(trials)].concat();
    let is_scaled = |column: &str| scaled.iter().any(|known| known.column == column);
    let exchanged =
        super::exchanged::sure(trials).filter(|(_, both)| both.iter().all(|c| !is_scaled(c.column().as_str())));
    let of_both: Vec<String> = exchanged.iter().flat_map(|(_, both)| both.map(Coordinate::column)).collect();
    let axes = WORDS.iter().filter_map(|w| axis(trials, *w)).filter(|d| !is_scaled(&d.column));
    let mut doubts: Vec<SignDoubt> = axes.collect();
    doubts.extend(scaled.iter().cloned());
    doubts.extend(flexion(trials));
    let mean = |of: &dyn Fn(&LaxityTrial) -> Option<f64>| {
        let values: Vec<f64> = trials.iter().filter_map(of).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    if let Some(si) = mean(&|t| t.measured[SI].filter(|_| t.reference.is_none())).filter(|v| *v > ABOVE_MM) {
        doubts.push(SignDoubt {
            column: "si_mm".into(),
            words: format!(
                "si_mm is {si:.0} mm in the mean: the tibia's origin would lie above the femur's. Expected superior +, distraction -: declare positive = \"inferior\" if the laboratory counts distraction positive"
            ),
        });
    }
    if let Some(load) = mean(&|t| Some(t.load[SI])).filter(|v| *v < TRACTION_N) {
        doubts.push(SignDoubt {
            column: "load_si_n".into(),
            words: format!(
                "load_si_n is {load:.0} N in the mean, which pulls the joint apart. Expected compression +: declare positive = \"distraction\" if the laboratory counts traction positive"
            ),
        });
    }
    // a column whose sign is turned round needs no other word
    let more =
        super::doubts::doubts(trials).into_iter().filter(|d| doubts.iter().all(|known| known.column != d.column));
    let more: Vec<SignDoubt> = more.collect();
    doubts.extend(more);
    // nor does one that stands in another's place
    doubts.retain(|d| !of_both.contains(&d.column));
    exchanged.into_iter().map(|(doubt, _)| doubt).chain(doubts).collect()
}

/// One loaded coordinate: whether displacement follows load, and load follows the names of the tests.
fn axis(trials: &[LaxityTrial], (c, plus, minus): (Coordinate, &str, &str)) -> Option<SignDoubt> {
    let (load, value) = (c.load_column(), c.column());
    let mine: Vec<&LaxityTrial> = trials.iter().filter(|t| t.test.coordinate() == Some(c)).collect();
    let against = mine.iter().filter(|t| !agrees(t.test, &t.load)).count();
    let misnamed = 2 * against > mine.len();
    let (with, opposed) = slopes(trials, c);
    let dropped = dropped(trials, c, opposed);
    let declare = |column: &str| format!("declare columns.{column} = {{ name = \"...\", positive = \"{minus}\" }}");
    let seen = format!("{} of {} tests by name have a {load} of the other sign", against, mine.len());
    let words = match (opposed > with, misnamed) {
        // turning sizes mends nothing
        (true, false) if dropped => format!(
            "the knee moves against its load in {value} at {opposed} of {} flexions, and no reading is below 0: were signs dropped, and sizes written? Expected {plus} +, {minus} -",
            with + opposed
        ),
        (true, false) => format!(
            "the knee moves against its load in {value} at {opposed} of {} flexions. Expected {plus} +: {}",
            with + opposed,
            declare(&value)
        ),
        (true, true) => {
            format!(
                "{seen}, and the knee moves against it. Expected {plus} +: {}, or loads_on = \"femur\"",
                declare(&load)
            )
        }
        (false, true) => {
            format!(
                "{seen}, and the knee moves with it: load and displacement are both turned, or the names of the tests are exchanged. Expected {plus} +: {}, and the same for {value}",
                declare(&load)
            )
        }
        (false, false) if dropped => format!(
            "no reading of {value} is below 0, and the knee moves against its load in some: were signs dropped, and sizes written? Expected {plus} +, {minus} -"
        ),
        (false, false) => {
            let at = turned_at(trials, c);
            let first = at.first()?;
            format!(
                "the knee moves against its load in {value} at {} of {} flexions, the first {first} deg, and with it at {with}: was its sign turned there? Expected {plus} +, {minus} - throughout",
                at.len(),
                with + opposed
            )
        }
    };
    Some(SignDoubt {
        column: if misnamed { load } else { value },
        words: format!("{}: {words}", c.name().to_uppercase()),
    })
}

/// Whether readings are sizes without their signs: none is below 0, though the knee is pushed both ways and moves against its load in some.
fn dropped(trials: &[LaxityTrial], c: Coordinate, opposed: usize) -> bool {
    let own = || trials.iter().filter(move |t| t.test.coordinate() == Some(c) && t.load[c] != 0.0);
    let both_ways = own().any(|t| t.load[c] > 0.0) && own().any(|t| t.load[c] < 0.0);
    let sizes = trials.iter().filter_map(|t| t.measured[c]).all(|x| x >= 0.0);
    // displacements count from the unloaded pose, so that each shows its sign
    let against = own().any(|t| t.reference.is_some() && t.load[c] < 0.0 && t.measured[c].is_some_and(|x| x > 0.0));
    both_ways && sizes && (opposed > 0 || against)
}

/// At how many nominal flexions displacement rises with load, and at how many it falls, beyond doubt.
fn slopes(trials: &[LaxityTrial], c: Coordinate) -> (usize, usize) {
    let mut groups: BTreeMap<(i64, bool), Vec<(f64, f64)>> = BTreeMap::new();
    let least = LEAST_SPREAD.iter().find(|(i, _)| *i == c).map_or(f64::INFINITY, |(_, l)| *l);
    for t in trials.iter().filter(|t| t.test.coordinate().is_none_or(|own| own == c)) {
        if let Some(value) = t.measured[c] {
            let group = groups.entry((t.nominal_flexion_deg.round() as i64, t.reference.is_some())).or_default();
            group.push((t.load[c], value));
            group.extend(t.reference.as_ref().map(|r| (r.load[c], 0.0)));
        }
    }
    let (mut with, mut opposed) = (0, 0);
    for points in groups.values() {
        let n = points.len() as f64;
        let (x, y) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let spread = points.iter().map(|p| (p.0 - x).abs()).fold(0.0, f64::max);
        let along: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
        if spread < least || along.abs() < 1e-9 {
            continue;
        }
        if along > 0.0 { with += 1 } else { opposed += 1 }
    }
    (with, opposed)
}

/// Correlation of load and displacement below which one is turned [-]. Ours: in 504 positions of published and simulated knees it is 0.86 and more.
const TURNED: f64 = -0.5;

/// Nominal flexions [deg] at which the knee moves against its load, under loads both ways. Only a position under a working load counts, in which the knee
/// moves: loads of nothing, and a motion of nothing, are noise with any sign.
fn turned_at(trials: &[LaxityTrial], c: Coordinate) -> Vec<i64> {
    let mut positions: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
    for t in trials.iter().filter(|t| t.reference.is_none() && t.test.coordinate().is_none_or(|own| own == c)) {
        let reading = t.measured[c].map(|value| [t.load[c], value]);
        positions.entry(t.nominal_flexion_deg.round() as i64).or_default().extend(reading);
    }
    let limit = |of: &[(Coordinate, f64)]| of.iter().find(|(i, _)| *i == c).map_or(f64::INFINITY, |(_, l)| *l);
    let (least, works, moves) = (limit(&LEAST_SPREAD), limit(&WORKING_LOAD), limit(&LEAST_MOTION));
    let shows = |of: &[[f64; 2]]| {
        let most = |k: usize, sign: f64| of.iter().map(|p| sign * p[k]).fold(f64::NEG_INFINITY, f64::max);
        let (plus, minus) = (most(0, 1.0), most(0, -1.0));
        plus.min(minus) >= least && plus.max(minus) >= works && most(1, 1.0) + most(1, -1.0) >= moves
    };
    // one reading that jumped, or a code for what was not read, makes no turn: each lies on the other side of the middle of the other positions
    let is_beyond = |flexion: i64, of: &[[f64; 2]]| {
        let others = || positions.iter().filter(move |(there, _)| **there != flexion).flat_map(|(_, of)| of);
        let mean = |sign: f64| {
            let pushed: Vec<f64> = others().filter(|p| sign * p[0] >= least).map(|p| p[1]).collect();
            pushed.iter().sum::<f64>() / pushed.len() as f64
        };
        let middle = f64::midpoint(mean(1.0), mean(-1.0));
        of.iter().filter(|p| p[0].abs() >= least).all(|p| p[0] * (p[1] - middle) < 0.0)
    };
    let is_turned = |flexion: i64, of: &[[f64; 2]]| shows(of) && falls(of) && is_beyond(flexion, of);
    positions.iter().filter(|(flexion, of)| is_turned(**flexion, of)).map(|(flexion, _)| *flexion).collect()
}

/// Whether displacements fall where loads rise, beyond [`TURNED`].
fn falls(of: &[[f64; 2]]) -> bool {
    let mean = |k: usize| of.iter().map(|p| p[k]).sum::<f64>() / of.len() as f64;
    let means = [mean(0), mean(1)];
    let product = |i: usize, j: usize| of.iter().map(|p| (p[i] - means[i]) * (p[j] - means[j])).sum::<f64>();
    product(0, 1) < TURNED * (product(0, 0) * product(1, 1)).sqrt()
}

/// Whether flexion is the angle between the shafts, or falls where nominal flexion rises.
fn flexion(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let n = trials.len() as f64;
    let off =
        |of: fn(&LaxityTrial) -> f64| trials.iter().map(|t| (of(t) - t.nominal_flexion_deg).abs()).sum::<f64>() / n;
    let (own, other) = (off(|t| t.fe_deg), off(|t| 180.0 - t.fe_deg));
    let supplement = other < NEAR_SUPPLEMENT_DEG && own > 2.0 * NEAR_SUPPLEMENT_DEG;
    if let Some(t) = trials.iter().find(|t| supplement || t.fe_deg > MOST_FLEXION_DEG) {
        return Some(SignDoubt {
            column: "fe_deg".into(),
            words: format!(
                "fe_deg is {:.0} deg in trial \"{}\": the angle between the shafts (180 deg less flexion)? Expected flexion, 0 in a straight knee: write 180 less the angle, and the same for nominal_flexion_deg where it is such an angle",
                t.fe_deg, t.trial
            ),
        });
    }
    if trials.iter().all(|t| t.fe_deg.max(t.nominal_flexion_deg) <= 0.0)
        && trials
            .iter()
            .any(|t| t.fe_deg < -MOST_HYPEREXTENSION_DEG && t.nominal_flexion_deg < -MOST_HYPEREXTENSION_DEG)
    {
        return Some(SignDoubt {
            column: "fe_deg".into(),
            words: "fe_deg and nominal_flexion_deg are negative throughout: flexion counts negative. Expected flexion +: write both with the other sign".into(),
        });
    }
    let mean = |of: fn(&LaxityTrial) -> f64| trials.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|t| t.nominal_flexion_deg), mean(|t| t.fe_deg));
    let along: f64 = trials.iter().map(|t| (t.nominal_flexion_deg - x) * (t.fe_deg - y)).sum();
    let spread: f64 = trials.iter().map(|t| (t.nominal_flexion_deg - x).powi(2)).sum();
    (along < -0.5 * spread && spread > 0.0).then(|| SignDoubt {
        column: "fe_deg".into(),
        words: "fe_deg falls where nominal flexion rises. Expected flexion +: declare columns.fe_deg = { name = \"...\", positive = \"extension\" }".into(),
    })
}

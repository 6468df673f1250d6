//! Flexion held against the nominal one: from another zero, in proportion, or counted from each test position. One cause gives one doubt.

use super::{LaxityTrial, SignDoubt};
use std::collections::BTreeMap;

/// Flexion may lie this far from the nominal one in the median of a test position [deg]; a published knee lies 16 off at 90 deg. Ours.
const MOST_OFF_NOMINAL_DEG: f64 = 20.0;
/// Positions that show how flexion is counted.
const LEAST_POSITIONS: usize = 2;
/// Flexion that lies this far from nominal at every position counts from another zero [deg]; feet and cuffs hold a knee within 5.
const OFFSET_DEG: f64 = 8.0;
/// And does so alike at all of them within this [deg].
const OFFSET_ALIKE_DEG: f64 = 2.0;
/// Positions from this nominal flexion on show a proportion [deg]. Ours: 5 deg of a cuff are a fourth of it.
const LEAST_NOMINAL_DEG: f64 = 20.0;
/// Flexion that is off its nominal one by this share at every such position is off in proportion [-]. Ours: 6 deg at 90.
const OFF_SHARE: f64 = 0.07;
/// And is so alike at all of them within this [-]. Ours: in a published knee that is off alike by sign, its shares lie 0.12 apart.
const SHARE_ALIKE: f64 = 0.02;
/// Shares within which a sensor may be off [-]; beyond them flexion is counted from the position, or is in another unit.
const SENSOR_SHARE: [f64; 2] = [0.5, 2.0];

/// Nominal flexions up to this [rad], with one beyond the least, are angles in radians: 160 deg and 17 deg. Ours: no file tests at 3 deg alone.
const MOST_RAD: f64 = 2.8;
const LEAST_RAD: f64 = 0.3;

/// Nominal flexions that are small and fractional at all positions.
fn radians(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    let [low, high] = ends(trials.iter().map(|t| t.nominal_flexion_deg));
    let fractional = trials.iter().any(|t| t.nominal_flexion_deg.fract() != 0.0);
    (low > -LEAST_RAD && (LEAST_RAD..=MOST_RAD).contains(&high) && fractional).then(|| SignDoubt {
        column: "nominal_flexion_deg".into(),
        words: format!(
            "nominal_flexion_deg is at most {high:.4} deg in all of {} trials: is its unit radians? It would be {:.0} deg then. Expected degrees, here and in fe_deg: declare columns.nominal_flexion_deg = {{ name = \"nominal_flexion_deg\", unit = \"rad\" }}, and the same for fe_deg",
            trials.len(),
            high.to_degrees()
        ),
    })
}

/// Whether flexion is off, and how: the likeliest of the ways.
pub(super) fn doubt(trials: &[LaxityTrial]) -> Option<SignDoubt> {
    if let Some(radians) = radians(trials) {
        return Some(radians);
    }
    let poses: Vec<&LaxityTrial> = trials.iter().filter(|t| t.reference.is_none()).collect();
    let all: Vec<&LaxityTrial> = trials.iter().collect();
    let (of_poses, of_all) = (medians(&poses), medians(&all));
    let words = offset(&of_poses).or_else(|| in_proportion(&of_poses)).or_else(|| far(&of_all))?;
    Some(SignDoubt { column: "fe_deg".into(), words })
}

/// Whether flexion is off by as much at every position.
pub(super) fn is_offset(trials: &[LaxityTrial]) -> bool {
    offset(&medians(&trials.iter().collect::<Vec<_>>())).is_some()
}

/// Nominal and measured flexion of each position, the measured one in the median [deg].
fn medians(trials: &[&LaxityTrial]) -> Vec<[f64; 2]> {
    let mut positions: BTreeMap<i64, Vec<[f64; 2]>> = BTreeMap::new();
    for t in trials {
        let off = t.fe_deg - t.nominal_flexion_deg;
        positions.entry(t.nominal_flexion_deg.round() as i64).or_default().push([off, t.nominal_flexion_deg]);
    }
    let middle = |mut of: Vec<[f64; 2]>| {
        of.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let [off, nominal] = of[of.len() / 2];
        [nominal, nominal + off]
    };
    positions.into_values().map(middle).collect()
}

fn ends(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// Off by as much at every position.
fn offset(medians: &[[f64; 2]]) -> Option<String> {
    let [low, high] = ends(medians.iter().map(|[nominal, fe]| fe - nominal));
    let far = low > OFFSET_DEG || high < -OFFSET_DEG;
    let middle = f64::midpoint(low, high);
    (medians.len() >= LEAST_POSITIONS && far && high - low < OFFSET_ALIKE_DEG).then(|| {
        format!(
            "fe_deg lies {middle:+.0} deg from nominal_flexion_deg at all of {} positions alike: it counts from another zero than the femur's and tibia's frames, or was zeroed at a test position. Expected the flexion in the frames, within {OFFSET_DEG} deg of nominal: add {:.0} deg to fe_deg, if nominal_flexion_deg is right",
            medians.len(),
            -middle
        )
    })
}

/// Off by the same share at every position.
fn in_proportion(medians: &[[f64; 2]]) -> Option<String> {
    let bent: Vec<[f64; 2]> = medians.iter().copied().filter(|[nominal, _]| *nominal >= LEAST_NOMINAL_DEG).collect();
    let [low, high] = ends(bent.iter().map(|[nominal, fe]| fe / nominal));
    let far = low > 1.0 + OFF_SHARE || high < 1.0 - OFF_SHARE;
    let sensor = low > SENSOR_SHARE[0] && high < SENSOR_SHARE[1];
    let [nominal, fe] = *bent.last()?;
    (bent.len() >= LEAST_POSITIONS && far && sensor && high - low < SHARE_ALIKE).then(|| {
        format!(
            "fe_deg is {:.2} times nominal_flexion_deg at all of {} positions alike, {fe:.0} deg at {nominal:.0}: it is off nominal in proportion, as by a sensor's gain or a scale. Expected the flexion in the femur's and tibia's frames: divide fe_deg by that number, if nominal_flexion_deg is right",
            f64::midpoint(low, high),
            bent.len()
        )
    })
}

/// Far off at one position: counted from there.
fn far(medians: &[[f64; 2]]) -> Option<String> {
    let off = |[nominal, fe]: &[f64; 2]| fe - nominal;
    let worst = medians.iter().max_by(|a, b| off(a).abs().total_cmp(&off(b).abs()))?;
    (off(worst).abs() > MOST_OFF_NOMINAL_DEG).then(|| {
        format!(
            "fe_deg lies {:+.0} deg from nominal_flexion_deg in the median at {:.0} deg. Expected the flexion of the knee, within {MOST_OFF_NOMINAL_DEG} deg: it may be zeroed, counted from the test position; add that position to fe_deg",
            off(worst),
            worst[0]
        )
    })
}

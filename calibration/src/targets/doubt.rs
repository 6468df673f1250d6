//! Rows that cannot be what they say.

use super::{Targets, row};
use notices::{Kind, plain};
use sim::coordinate::{AP, Coordinate, FREE, Free, IE, Load, SI, VV};
use sim::laxity::{LaxityTrial, Test};
use sim::spec::PoseSpec;
use std::collections::BTreeMap;

/// Two rows of one condition may differ by this many times their noise (times the root of 2) before they are refused: repeats
/// scatter, and laboratories understate their noise.
const REFUSE: f64 = 10.0;
/// And before a warning.
const WARN: f64 = 5.0;
/// Differences up to these are never refused: VV, IE [deg], ML, AP, SI [mm].
const HARMLESS: Free<f64> = Free::all(5.0);
/// Loads within these (or 3 %) are one load.
const SAME_LOAD: Load = Load::new(0.3, 0.3, 5.0, 5.0, 10.0);
/// Flexions within this are one flexion [deg].
const SAME_FLEXION: f64 = 2.0;

/// Trials flexed beyond what the model is made for.
pub(super) fn beyond_flexion(targets: &Targets, limits: [f64; 2]) -> Vec<String> {
    let beyond = |t: &&LaxityTrial| !(limits[0]..=limits[1]).contains(&t.fe_deg);
    let trials = targets.trials.iter();
    trials
        .filter(beyond)
        .map(|t| {
            format!(
                "row {} ({}): fe_deg {} is beyond the model, which is made for {} to {} deg (option targets.flexion_deg)",
                row(t), t.trial, plain(t.fe_deg), limits[0], limits[1]
            )
        })
        .collect()
}

/// Columns that look like radians, metres or centimetres.
pub(super) fn other_units(targets: &Targets, ct: &PoseSpec) -> Vec<String> {
    let mut out = Vec::new();
    for (c, test, least) in [(IE, [Test::Internal, Test::External], 2.0), (VV, [Test::Varus, Test::Valgus], 4.0)] {
        let rows = loaded(targets, c, &test, least);
        // both ways under load within 0.7: no knee is that stiff (10 deg and more are usual), but 0.35 rad is 20 deg
        if rows.len() >= 2 && rows.iter().all(|r| r.1.abs() < 0.7) {
            let names: Vec<String> = rows.iter().map(|r| format!("row {}: {}", r.0, plain(r.1))).collect();
            out.push(format!(
                "{} stays within 0.7 deg under {least} N m and more ({}): is it in radians? degrees expected",
                c.column(),
                names.join(", ")
            ));
        }
    }
    let ap = loaded(targets, AP, &[Test::Anterior, Test::Posterior], 40.0);
    if ap.len() >= 2 && ap.iter().all(|r| r.1.abs() < 0.05) {
        out.push(format!("ap_mm stays within 0.05 mm under 40 N and more (row {} on): is it in metres?", ap[0].0));
    }
    let si: Vec<(usize, f64)> = measured(targets, SI);
    let ratio = |v: f64| v / ct.si_mm;
    if ct.si_mm.abs() > 5.0 && si.len() >= 2 && si.iter().all(|(_, v)| ratio(*v).abs() < 0.2) {
        let (row, value) = si[0];
        out.push(format!(
            "row {row} on: si_mm is {value}, the model's in CT {:.1} mm: is it in centimetres or metres, or counted from another origin?",
            ct.si_mm
        ));
    }
    out
}

/// Row and measured value of a coordinate, of the tests under at least this load.
fn loaded(targets: &Targets, c: Coordinate, tests: &[Test], least: f64) -> Vec<(usize, f64)> {
    let trials = targets.trials.iter().filter(|t| tests.contains(&t.test) && t.load[c].abs() >= least);
    trials.filter_map(|t| t.measured[c].map(|v| (row(t), v))).collect()
}

/// Row and value of a coordinate where its pose is measured.
fn measured(targets: &Targets, c: Coordinate) -> Vec<(usize, f64)> {
    let poses = targets.trials.iter().filter(|t| t.reference.is_none());
    poses.filter_map(|t| t.measured[c].map(|v| (row(t), v))).collect()
}

/// Rows of one test, flexion, load and branch whose answers differ beyond all noise; smaller differences are warned of.
pub(super) fn contradictions(targets: &mut Targets) -> Vec<String> {
    let (mut faults, mut warnings) = (Vec::new(), Vec::new());
    for i in 0..targets.trials.len() {
        for j in i + 1..targets.trials.len() {
            let (a, b) = (&targets.trials[i], &targets.trials[j]);
            if !is_repeat(a, b) {
                continue;
            }
            for (c, harmless) in HARMLESS.each() {
                let (Some(x), Some(y)) = (a.measured[c], b.measured[c]) else { continue };
                let sd = targets.noise(a)[c].hypot(targets.noise(b)[c]);
                let gap = (x - y).abs();
                let text = format!(
                    "rows {} and {} ({}, {}) repeat one load but differ by {gap:.2} in {}, {:.0} times their noise of {sd:.2}",
                    row(a),
                    row(b),
                    a.trial,
                    b.trial,
                    c.column(),
                    gap / sd
                );
                if gap > (REFUSE * sd).max(*harmless) {
                    faults.push(format!("{text}: one of them is wrong; correct or remove it"));
                } else if gap > WARN * sd {
                    warnings.push(Kind::RepeatsDiffer.notice(text).row(row(b)));
                }
            }
        }
    }
    targets.warnings.extend(warnings);
    faults
}

/// Whether two rows measured the same thing.
fn is_repeat(a: &LaxityTrial, b: &LaxityTrial) -> bool {
    let same = |c: Coordinate| {
        let (x, y) = (a.load[c], b.load[c]);
        (x - y).abs() <= SAME_LOAD[c].min(0.5 * x.abs().max(y.abs())).max(0.03 * x.abs().max(y.abs())).max(1e-9)
            || x.abs().max(y.abs()) < SAME_LOAD[c]
    };
    a.test == b.test
        && a.reference == b.reference
        && a.branch == b.branch
        && (a.nominal_flexion_deg - b.nominal_flexion_deg).abs() < 0.5
        && (a.fe_deg - b.fe_deg).abs() < SAME_FLEXION
        && FREE.into_iter().all(same)
}

/// Warns of groups whose knee moves against the load, as with a wrong sign.
pub(super) fn against_the_load(targets: &mut Targets) {
    type Condition = Vec<(f64, f64, f64, usize)>;
    let mut by_coordinate: BTreeMap<(Coordinate, i64, bool), Condition> = BTreeMap::new();
    for t in &targets.trials {
        let Some(c) = t.test.coordinate() else { continue };
        let Some(value) = t.measured[c] else { continue };
        let key = (c, t.nominal_flexion_deg.round() as i64, t.reference.is_some());
        let condition = by_coordinate.entry(key).or_default();
        let (noise, row) = (targets.noise(t)[c], row(t));
        condition.push((t.load[c], value, noise, row));
        condition.extend(t.reference.as_ref().map(|r| (r.load[c], 0.0, noise, row)));
    }
    for ((c, flexion, _), rows) in by_coordinate {
        let least = rows.iter().fold(rows[0], |a, b| if b.0 < a.0 { *b } else { a });
        let most = rows.iter().fold(rows[0], |a, b| if b.0 > a.0 { *b } else { a });
        let fall = least.1 - most.1;
        if most.0 > least.0 && fall > WARN * least.2.hypot(most.2) {
            targets.warnings.push(Kind::AgainstTheLoad.notice(format!(
                "rows {} and {}: at {flexion} deg {} falls by {fall:.1} while its load grows from {} to {}; is a sign wrong?",
                least.3,
                most.3,
                c.column(),
                plain(least.0),
                plain(most.0)
            )).row(most.3));
        }
    }
}

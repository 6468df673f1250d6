//! A knee of springs for tests: answers are smooth functions of the design variables and the load.

use crate::design::Design;
use crate::experiment::{Answer, Jacobian};
use sim::SimError;
use sim::coordinate::{AP, Coordinate, FREE, Free, IE, Load, SI};
use sim::laxity::{LaxityTrial, Test};

/// Trials like the published KLA set: anterior, internal, external at 30 and 90 deg with five loads, neutral at 0.
pub(crate) fn trials() -> Vec<LaxityTrial> {
    let mut out = Vec::new();
    for (test, c, full) in [(Test::Anterior, AP, 180.0), (Test::Internal, IE, -6.0), (Test::External, IE, 6.0)] {
        for fe in [30.0, 90.0] {
            for k in 0..5 {
                let mut load = Load::compression(20.0);
                load[c] = full * f64::from(k) / 4.0;
                out.push(trial(test, fe, load, k));
            }
        }
    }
    out.push(trial(Test::Neutral, 0.0, Load::compression(20.0), 0));
    out
}

fn trial(test: Test, fe: f64, load: Load, k: i32) -> LaxityTrial {
    let name = format!("{}_{fe}_{k}", test.name());
    LaxityTrial { measured: Free::all(Some(0.0)), ..LaxityTrial::asked(name, test, fe, load) }
}

/// The answers to all trials.
pub(crate) fn answers(design: &Design, trials: &[LaxityTrial], values: &[f64]) -> Vec<Result<Answer, SimError>> {
    (0..trials.len()).map(|i| answer(design, trials, values, i)).collect()
}

/// The answer: each coordinate a mildly curved mixture of the variables, scaled by the load; half of the mixtures do not know half of
/// the variables.
pub(crate) fn answer(design: &Design, trials: &[LaxityTrial], values: &[f64], i: usize) -> Result<Answer, SimError> {
    let unit = design.unit(values);
    let n = unit.len();
    let size = Free([4.0, 12.0, 2.0, 8.0, 3.0]);
    let t = &trials[i];
    let drive: f64 = t.load[AP] / 180.0 + t.load[IE] / 6.0 + 0.3;
    let mix = |c: Coordinate, k: usize| {
        let c = c.free_index();
        let phase = (1.3 + c as f64) * (k as f64 + 0.7) + t.fe_deg / 40.0 * (1.0 + (k % 3) as f64) + drive;
        if (k + c).is_multiple_of(2) { phase.sin() / (n as f64).sqrt() } else { 0.0 }
    };
    let mut predicted = Free::all(0.0);
    let mut jacobian = vec![Free::all(0.0); n];
    for c in FREE {
        let s: f64 = unit.iter().enumerate().map(|(k, u)| mix(c, k) * u).sum();
        let y = s + 0.3 * s * s;
        predicted[c] = size[c] * (drive + y) + if c == SI { -20.0 } else { 0.0 };
        for (k, slope) in jacobian.iter_mut().enumerate() {
            slope[c] = size[c] * (1.0 + 0.6 * s) * mix(c, k) / design.variables[k].width();
        }
    }
    let forces_n = vec![100.0 * unit[0], 50.0 * unit[1]];
    let mut by = vec![vec![0.0; 2]; n];
    by[0][0] = 100.0 / design.variables[0].width();
    by[1][1] = 50.0 / design.variables[1].width();
    Ok(Answer { predicted, forces_n, flags: vec![], jacobian: Some(Jacobian { predicted: jacobian, forces_n: by }) })
}

//! What the calibrated knee says of measurements that it has not seen.

use super::super::Values;
use super::super::calibrate::Calibration;
use super::super::diagnose::Diagnosed;
use crate::report::check::at_most;
use crate::validate::Validation;
use validation::cross::counts;

/// A prediction beside what was measured.
pub(crate) struct Prediction {
    /// In a sentence.
    pub(crate) words: String,
    /// True within its limit; `None` where there is none.
    pub(crate) good: Option<bool>,
}

/// Most that passive flexion may be missed by, root mean square: 3 mm of AP is the side-to-side difference that is taken for a torn ACL
/// [milano2022]; the turns are ours, as much at 35 mm, half the width of a knee.
const MOST_PASSIVE: [(&str, &str, f64); 3] = [("ap", "mm AP", 3.0), ("vv", "deg VV", 5.0), ("ie", "deg IE", 5.0)];
/// Most that held-out trials may be missed by, in times the scatter that the diagnosis counts with. Ours, as for the misfit.
const MOST_SCATTER: f64 = 2.0;

/// Spread of passive flexion between five teams' models of one knee [mm or deg] (doi 10.1115/1.4063627).
pub(crate) const BETWEEN_TEAMS: [(&str, f64); 3] = [("ap", 6.2), ("ie", 14.9), ("vv", 6.8)];

/// All of them: passive flexion as measured, trials left out in turn; and how far models of single sources agree where neither was calibrated.
pub(crate) fn predictions(v: &Values) -> Vec<Prediction> {
    passive(v).into_iter().chain(held_out(v)).chain(across(v)).chain(agreement(v)).collect()
}

/// Passive flexion, to which nothing is calibrated.
fn passive(v: &Values) -> Option<Prediction> {
    let (validation, calibration) = (v.of::<Validation>()?, v.of::<Calibration>()?);
    let (name, _) = calibration.main()?;
    let mine = |d: &&validation::validate::Difference| d.a == name && d.measured && d.protocol == "passive_flexion";
    let (mut told, mut good) = (Vec::new(), true);
    for (quantity, unit, most) in MOST_PASSIVE {
        let all = validation.differences.iter().filter(mine).filter(|d| d.quantity == quantity);
        let Some(worst) = all.map(|d| d.rmsd).max_by(f64::total_cmp) else { continue };
        good &= at_most(worst, most, 1);
        told.push(format!("{worst:.1} {unit} (limit {most:.0})"));
    }
    (!told.is_empty()).then(|| Prediction {
        words: format!(
            "Passive flexion was measured and not used to calibrate: the knee's path misses it by {}.",
            told.join(", ")
        ),
        good: Some(good),
    })
}

/// Intervals that hold, by themselves, of what they say [-]: those of samples are of 90 %.
const HOLD: f64 = 0.9;
/// Chance below which more intervals than were counted would fail by chance [-]; ours.
const BY_CHANCE: f64 = 0.01;

/// Laxity of one data set as the knee calibrated to another predicts it.
fn across(v: &Values) -> Vec<Prediction> {
    let Some(validation) = v.of::<Validation>() else { return vec![] };
    let told = |((model, data), [inside, of]): ((&str, &str), [usize; 2])| Prediction {
        words: format!(
            "Calibrated to {model} alone, the knee puts {inside} of {of} ranges of laxity that {data} measured within its 90 % intervals."
        ),
        good: Some(fail_by_chance(of, of - inside) >= BY_CHANCE),
    };
    counts(&validation.cross).into_iter().map(told).collect()
}

/// Chance that at least `failed` of so many intervals fail, each by itself.
fn fail_by_chance(of: usize, failed: usize) -> f64 {
    let mut exactly = HOLD.powi(of as i32);
    let mut fewer = 0.0;
    for k in 0..failed {
        fewer += exactly;
        exactly *= (of - k) as f64 / (k + 1) as f64 * (1.0 - HOLD) / HOLD;
    }
    1.0 - fewer
}

/// How far models of single sources differ in the pivot shift, which nobody measured.
fn agreement(v: &Values) -> Option<Prediction> {
    let validation = v.of::<Validation>()?;
    let is_single = |name: &str| v.of::<Calibration>().is_some_and(|c| c.sources.contains_key(name));
    let pair = validation.differences.iter().find(|d| is_single(&d.a) && is_single(&d.b))?;
    let of = |quantity: &str| {
        let mine = |d: &&validation::validate::Difference| {
            (&d.a, &d.b) == (&pair.a, &pair.b) && d.protocol == "pivot_shift" && d.quantity == quantity
        };
        validation.differences.iter().find(mine).map(|d| d.rmsd)
    };
    let (ap, ie) = (of("ap")?, of("ie")?);
    let beyond = |name: &str, x: f64| BETWEEN_TEAMS.iter().any(|(n, spread)| *n == name && x > *spread);
    let apart = beyond("ap", ap) || beyond("ie", ie);
    let more = if apart { ": more than five teams' models of one knee do" } else { "" };
    Some(Prediction {
        words: format!(
            "Models of {} alone and of {} alone differ in the pivot shift, to which neither was fitted, by {ap:.1} mm AP, {ie:.1} deg IE and {:.0} N a ligament{more}.",
            pair.a,
            pair.b,
            of("ligament_forces")?
        ),
        // that two models agree shows nothing; that they do not shows that one of them errs
        good: apart.then_some(false),
    })
}

/// Trials that a calibration to all others has not seen, where a diagnosis left them out in turn.
fn held_out(v: &Values) -> Option<Prediction> {
    let gap = &v.of::<Diagnosed>()?.diagnosis.gap.held_out;
    let miss = gap.before.max(0.0).sqrt();
    (miss > 0.0 && miss.is_finite()).then(|| Prediction {
        words: format!(
            "Trials left out in turn are missed by {miss:.1} times their scatter (limit {MOST_SCATTER:.0}; noise alone leaves {:.1}).",
            gap.floor.max(0.0).sqrt()
        ),
        good: Some(at_most(miss, MOST_SCATTER, 1)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_ten_intervals_of_nine_tenths_three_may_fail_and_five_may_not() {
        assert!((fail_by_chance(10, 0) - 1.0).abs() < 1e-12);
        assert!((fail_by_chance(10, 1) - (1.0 - 0.9_f64.powi(10))).abs() < 1e-12);
        assert!(fail_by_chance(10, 3) > BY_CHANCE && fail_by_chance(10, 5) < BY_CHANCE);
        assert!((fail_by_chance(3, 3) - 0.001).abs() < 1e-12);
    }
}

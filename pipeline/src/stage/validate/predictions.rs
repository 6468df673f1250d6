//! What the calibrated knee says of measurements that it has not seen.

use super::super::Values;
use super::super::calibrate::Calibration;
use super::super::diagnose::Diagnosed;
use crate::report::check::at_most;
use crate::validate::Validation;

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

/// All of them: passive flexion as measured, trials left out in turn; and how far models of single sources agree where neither was calibrated.
pub(crate) fn predictions(v: &Values) -> Vec<Prediction> {
    passive(v).into_iter().chain(held_out(v)).chain(agreement(v)).collect()
}

/// Passive flexion, to which nothing is calibrated.
fn passive(v: &Values) -> Option<Prediction> {
    let (validation, calibration) = (v.of::<Validation>()?, v.of::<Calibration>()?);
    let (name, _) = calibration.main()?;
    let mine = |d: &&validation::validate::Difference| {
        d.a == name && d.b.starts_with("measured ") && d.protocol == "passive_flexion"
    };
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
    Some(Prediction {
        words: format!(
            "Models of {} alone and of {} alone differ in the pivot shift, to which neither was fitted, by {:.1} mm AP, {:.1} deg IE and {:.0} N a ligament.",
            pair.a,
            pair.b,
            of("ap")?,
            of("ie")?,
            of("ligament_forces")?
        ),
        good: None,
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

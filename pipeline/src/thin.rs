//! A raw log as readings: rows of one test, flexion and branch are averaged by their load, and what is lost is told.

use notices::{Kind, Notice};
use sim::coordinate::{AP, Coordinate, FREE, Free};
use sim::laxity::LaxityTrial;
use std::collections::BTreeMap;

/// Files of more readings are thinned: a calibration's time grows with their number, and a static test has a few dozen a flexion. Ours.
const MOST_READINGS: usize = 400;
/// Readings that a thinned file keeps, about. Ours.
const KEPT: usize = 240;

/// Rows that one reading stands for: test, nominal flexion and branch, by number.
type Key = (u8, i64, u8);

/// The trials as they are; of a file of too many, the means of rows of like load, and what is said of it.
pub(crate) fn thinned(trials: Vec<LaxityTrial>) -> (Vec<LaxityTrial>, Option<Notice>) {
    // displacements count from a trial by its name, and each stands for itself
    if trials.len() <= MOST_READINGS || trials.iter().any(|t| t.reference.is_some()) {
        return (trials, None);
    }
    let rows = trials.len();
    let mut groups: BTreeMap<Key, Vec<LaxityTrial>> = BTreeMap::new();
    for t in trials {
        let key = (t.test as u8, t.nominal_flexion_deg.round() as i64, t.branch.map_or(0, |b| b as u8 + 1));
        groups.entry(key).or_default().push(t);
    }
    let each = (KEPT / groups.len().max(1)).max(2);
    let (mut kept, mut lost) = (Vec::new(), Free::all(0.0f64));
    for group in groups.into_values() {
        for bin in bins(group, each) {
            let mean = mean(&bin);
            for c in FREE {
                lost[c] = lost[c].max(scatter(&bin, c));
            }
            kept.push(mean);
        }
    }
    let lost: Vec<String> = FREE.iter().map(|c| format!("{} {:.2} {}", c.column(), lost[*c], c.unit())).collect();
    let words = format!(
        "{rows} rows are averaged to {} readings, by test, flexion, branch and load; within a reading they scatter by up to {} (root mean square): give static readings to keep what is lost, such as hysteresis without a column branch",
        kept.len(),
        lost.join(", ")
    );
    (kept, Some(Kind::Averaged.notice(words).count(rows)))
}

/// Rows of like load, at most `count` sets between the least and the largest load.
fn bins(group: Vec<LaxityTrial>, count: usize) -> Vec<Vec<LaxityTrial>> {
    let axis = group.first().and_then(|t| t.test.coordinate()).unwrap_or(AP);
    let ends = group
        .iter()
        .map(|t| t.load[axis])
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)));
    let width = (ends.1 - ends.0) / count as f64;
    let mut bins: BTreeMap<usize, Vec<LaxityTrial>> = BTreeMap::new();
    for t in group {
        let at = if width > 0.0 { ((t.load[axis] - ends.0) / width) as usize } else { 0 };
        bins.entry(at.min(count - 1)).or_default().push(t);
    }
    bins.into_values().collect()
}

/// The first row with the means of all; what some rows have not measured is not.
fn mean(rows: &[LaxityTrial]) -> LaxityTrial {
    let n = rows.len() as f64;
    let mut out = rows[0].clone();
    out.fe_deg = rows.iter().map(|t| t.fe_deg).sum::<f64>() / n;
    out.quadriceps_n = rows.iter().map(|t| t.quadriceps_n).sum::<f64>() / n;
    for c in FREE {
        out.load[c] = rows.iter().map(|t| t.load[c]).sum::<f64>() / n;
        let measured: Option<Vec<f64>> = rows.iter().map(|t| t.measured[c]).collect();
        out.measured[c] = measured.map(|x| x.iter().sum::<f64>() / n);
    }
    out
}

/// Root mean square of the rows about their mean.
fn scatter(rows: &[LaxityTrial], c: Coordinate) -> f64 {
    let values: Vec<f64> = rows.iter().filter_map(|t| t.measured[c]).collect();
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::Load;
    use sim::laxity::Test;

    #[test]
    fn a_log_of_6000_rows_becomes_a_few_hundred_with_the_loss_told() {
        let row = |k: usize| {
            let load = 100.0 * (k as f64 / 300.0).sin();
            let push = Load::from_fn(|c| if c == AP { load } else { 0.0 });
            let test = if load < 0.0 { Test::Posterior } else { Test::Anterior };
            let mut t = LaxityTrial::asked(format!("r{k}"), test, 30.0, push);
            t.measured = Free::from_fn(|c| Some(if c == AP { 0.05 * load } else { 0.0 }));
            t
        };
        let (kept, told) = thinned((0..6000).map(row).collect());
        assert!((100..=KEPT + 10).contains(&kept.len()), "{}", kept.len());
        assert!(kept.iter().all(|t| (t.measured[AP].unwrap_or(9.0) - 0.05 * t.load[AP]).abs() < 1e-6));
        assert!(told.is_some_and(|w| w.contains("6000") && w.contains("scatter")));
        assert!(thinned((0..50).map(row).collect()).1.is_none());
    }
}

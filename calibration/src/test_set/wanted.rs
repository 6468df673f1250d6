//! What one wants to know of a knee, as trials and as numbers of each sample.

use super::{Asking, PIVOT, Wanted, trial};
use crate::inferred::{DRAWER_N, DRAWERS_DEG};
use inference::knee::predict::Prediction;
use nalgebra::DVector;
use sim::coordinate::{AP, Coordinate, IE, Load, VV};
use sim::laxity::LaxityTrial;

/// Trials in which the wanted numbers are.
pub(super) fn trials(asking: &Asking) -> Vec<LaxityTrial> {
    let rest = Load::compression(asking.compression_n);
    let drawn = |by: f64| move |fe: &f64| trial(*fe, with(rest, AP, by));
    match asking.wanted {
        Wanted::Force(_) => {
            DRAWERS_DEG.iter().map(drawn(DRAWER_N)).chain(DRAWERS_DEG.iter().map(drawn(-DRAWER_N))).collect()
        }
        Wanted::Drawer => DRAWERS_DEG.iter().map(drawn(0.0)).chain(DRAWERS_DEG.iter().map(drawn(DRAWER_N))).collect(),
        Wanted::PivotShift => {
            let (fe, valgus, internal) = PIVOT;
            vec![trial(fe, rest), trial(fe, with(with(rest, VV, valgus), IE, -internal))]
        }
    }
}

fn with(load: Load, c: Coordinate, size: f64) -> Load {
    let mut load = load;
    load[c] = size;
    load
}

/// Names of the wanted numbers, and each by sample.
pub(super) fn numbers(
    wanted: &Wanted,
    here: &[usize],
    known: &[Vec<Option<Prediction>>],
) -> (Vec<String>, Vec<DVector<f64>>) {
    let of = |trial: usize, value: &dyn Fn(&Prediction) -> f64| {
        DVector::from_iterator(here.len(), here.iter().map(|s| known[*s][trial].as_ref().map_or(0.0, value)))
    };
    let ap = |trial: usize, zero: usize, c: Coordinate| of(trial, &|p| p.pose[c]) - of(zero, &|p| p.pose[c]);
    match wanted {
        Wanted::Force(bundles) => {
            let sum = |p: &Prediction| bundles.iter().map(|b| p.forces_n[*b]).sum::<f64>();
            let names = ["anterior", "posterior"].into_iter().flat_map(|t| DRAWERS_DEG.map(|f| format!("{t}_{f}_n")));
            (names.collect(), (0..2 * DRAWERS_DEG.len()).map(|k| of(k, &sum)).collect())
        }
        Wanted::Drawer => {
            let n = DRAWERS_DEG.len();
            let names = DRAWERS_DEG.map(|f| format!("anterior_{f}_ap_mm")).to_vec();
            (names, (0..n).map(|k| ap(n + k, k, AP)).collect())
        }
        Wanted::PivotShift => {
            let names = [AP, IE].map(|c| format!("pivot_shift_{}", c.column())).to_vec();
            (names, [AP, IE].map(|c| ap(1, 0, c)).to_vec())
        }
    }
}

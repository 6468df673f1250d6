//! Where a knee's readings usually lie, and how far they move: what other files judge by.

use super::LaxityTrial;
use crate::coordinate::{AP, Coordinate, IE, ML, VV};
use std::collections::BTreeMap;

/// Fewest trials of a coordinate's tests from which its range is taken.
pub(super) const LEAST_TRIALS: usize = 4;
/// Where other coordinates lie in the mean of poses: VV, IE [deg], ML, AP [mm]. Twice the range of knees under load in their frames; ours.
pub(super) const USUAL_MEAN: [(Coordinate, [f64; 2]); 4] =
    [(VV, [-15.0, 15.0]), (IE, [-40.0, 40.0]), (ML, [-12.0, 12.0]), (AP, [-20.0, 30.0])];
/// The tibia's origin lies so far below the femur's in the mean of poses [mm]: 20 to 35 in knees, with room for children and giants. Ours.
pub(super) const USUAL_SI_MM: [f64; 2] = [-60.0, -8.0];
/// A knee moves by more than this under the loads of its tests: VV, IE [deg], AP [mm]. A tenth of a stiff knee's; ours.
pub(super) const LEAST_MOTION: [(Coordinate, f64); 3] = [(VV, 0.3), (IE, 1.0), (AP, 0.5)];
/// Loads that differ by less show no direction: VV, IE [N m], AP [N]. A fifth of the smallest of the paper's loads. Ours.
pub(super) const LEAST_SPREAD: [(Coordinate, f64); 3] = [(VV, 1.0), (IE, 0.5), (AP, 10.0)];
/// Loads from which on that motion is expected: VV, IE [N m], AP [N]; half of the paper's protocols.
pub(super) const WORKING_LOAD: [(Coordinate, f64); 3] = [(VV, 5.0), (IE, 2.5), (AP, 60.0)];

/// The tests that load a coordinate and count poses.
pub(super) fn tests(trials: &[LaxityTrial], c: Coordinate) -> Vec<&LaxityTrial> {
    trials.iter().filter(|t| t.test.coordinate() == Some(c)).collect()
}

/// The largest range of a coordinate within one test position: of enough trials, or of a test that was loaded both ways, which shows its range in two.
pub(super) fn range(of: &[&LaxityTrial], c: Coordinate) -> Option<f64> {
    let mut groups: BTreeMap<(i64, bool), Vec<&LaxityTrial>> = BTreeMap::new();
    for t in of.iter().filter(|t| t.measured[c].is_some()) {
        groups.entry((t.nominal_flexion_deg.round() as i64, t.reference.is_some())).or_default().push(t);
    }
    let span = |((_, displaced), group): ((i64, bool), Vec<&LaxityTrial>)| {
        // displacements count from the unloaded pose
        let zero = displaced.then_some(0.0);
        let values = group.iter().filter_map(|t| t.measured[c]).chain(zero);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        (displaced || group.len() >= LEAST_TRIALS || both_ways(&group)).then_some(high - low)
    };
    groups.into_iter().filter_map(span).max_by(f64::total_cmp)
}

/// The mean of a coordinate over poses; none of few.
pub(super) fn mean(trials: &[LaxityTrial], c: Coordinate) -> Option<f64> {
    let poses = trials.iter().filter(|t| t.reference.is_none());
    let values: Vec<f64> = poses.filter_map(|t| t.measured[c]).collect();
    (values.len() >= LEAST_TRIALS).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Whether the tests of a position reach the working load of their coordinate in both directions.
fn both_ways(group: &[&LaxityTrial]) -> bool {
    let works = |sign: f64| {
        group.iter().any(|t| {
            let own = t.test.coordinate().and_then(|c| WORKING_LOAD.iter().find(|(i, _)| *i == c));
            own.is_some_and(|(c, least)| sign * t.load[*c] >= *least)
        })
    };
    works(1.0) && works(-1.0)
}

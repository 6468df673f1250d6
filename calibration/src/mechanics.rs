//! From the search's mechanics to the final ones.
//!
//! Samples are asked by the search: without friction, with merged contact nodes, from equilibria close by. What is told of a knee is by the final mechanics:
//! with friction, with all contact nodes, along the path of loading. The most probable knee is asked both ways, and every sample is moved by the difference.

use inference::knee::predict::Prediction;
use sim::coordinate::{Coordinate, FREE, Free};
use sim::laxity::force_column;
use std::collections::BTreeMap;

/// What the final mechanics change of the search's answers to a trial, by column.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mechanics(BTreeMap<String, Change>);

/// Further apart than this in a coordinate the two rest in different equilibria [deg or mm], of which one says nothing of the other; ours: friction moves a
/// slack knee by 3 mm.
pub(crate) const ELSEWHERE: f64 = 8.0;

/// A change of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    /// So much is added; what cannot be negative ends at 0.
    Added(f64),
    /// The number is so many times as large: contact area and pressure, which fewer contact nodes spread.
    Times(f64),
}

impl Mechanics {
    /// The change from what the search tells of a knee to what the final mechanics tell of it; none where they rest in different equilibria.
    pub(crate) fn between(search: &[(String, f64)], last: &[(String, f64)]) -> Mechanics {
        let pose = |told: &[(String, f64)], c: Coordinate| told.iter().find(|t| t.0 == c.column()).map(|t| t.1);
        let apart = |c: Coordinate| Some((pose(search, c)? - pose(last, c)?).abs());
        if FREE.into_iter().filter_map(apart).any(|x| x > ELSEWHERE) {
            return Mechanics::default();
        }
        let of = |(name, from): &(String, f64)| {
            let to = last.iter().find(|l| l.0 == *name)?.1;
            let is_spread = ["_area_mm2", "_mean_mpa", "_peak_mpa"].iter().any(|end| name.ends_with(end));
            // a compartment that one of the two leaves unloaded has no factor
            let has_factor = is_spread && *from > 0.0 && to > 0.0;
            let change = if has_factor { Change::Times(to / from) } else { Change::Added(to - from) };
            Some((name.clone(), change))
        };
        Mechanics(search.iter().filter_map(of).collect())
    }

    /// A number of a column after the change.
    pub(crate) fn of(&self, name: &str, x: f64) -> f64 {
        let is_size = |name: &str| {
            ["force_", "group_"].iter().any(|begin| name.starts_with(begin))
                || ["_force_n", "_area_mm2", "_mpa"].iter().any(|end| name.ends_with(end))
        };
        match self.0.get(name) {
            Some(Change::Times(factor)) => factor * x,
            Some(Change::Added(d)) if is_size(name) => (x + d).max(0.0),
            Some(Change::Added(d)) => x + d,
            None => x,
        }
    }

    /// A sample's prediction after the change.
    pub(crate) fn moved(&self, bundles: &[String], p: &Prediction) -> Prediction {
        let mut outputs: Vec<(String, f64)> =
            p.outputs.iter().map(|(name, x)| (name.clone(), self.of(name, *x))).collect();
        unload(&mut outputs);
        Prediction {
            pose: Free::from_fn(|c| self.of(&c.column(), p.pose[c])),
            forces_n: bundles.iter().zip(&p.forces_n).map(|(b, f)| self.of(&force_column(b), *f)).collect(),
            outputs,
            ..p.clone()
        }
    }
}

/// What is told of the size of a compartment's contact.
const SIZES: [&str; 4] = ["_force_n", "_area_mm2", "_mean_mpa", "_peak_mpa"];

/// A compartment that bears on no area, or no force, bears nothing: its force, area and pressures are 0 together.
fn unload(outputs: &mut [(String, f64)]) {
    let stem = |name: &str| SIZES.iter().find_map(|end| name.strip_suffix(end)).map(str::to_owned);
    let empty = |(name, x): &(String, f64)| if *x <= 0.0 { stem(name) } else { None };
    let unloaded: Vec<String> = outputs.iter().filter_map(empty).collect();
    for (name, x) in outputs.iter_mut() {
        if stem(name).is_some_and(|s| unloaded.contains(&s)) {
            *x = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(ap: f64, force: f64, area: f64) -> Vec<(String, f64)> {
        [("ap_mm", ap), ("force_ACL_AM_n", force), ("contact_medial_area_mm2", area)].map(|(n, x)| (n.into(), x)).into()
    }

    #[test]
    fn the_most_probable_knee_ends_at_its_final_answer_and_no_size_below_nought() {
        let change = Mechanics::between(&told(3.0, 30.0, 200.0), &told(2.5, 20.0, 100.0));
        let last = |ap: f64, force: f64, area: f64| {
            [change.of("ap_mm", ap), change.of("force_ACL_AM_n", force), change.of("contact_medial_area_mm2", area)]
        };
        assert_eq!(last(3.0, 30.0, 200.0), [2.5, 20.0, 100.0]);
        assert_eq!(last(-1.0, 4.0, 50.0), [-1.5, 0.0, 25.0]);
        assert!((change.of("ie_deg", 7.0) - 7.0).abs() < 1e-12, "what the final mechanics do not tell stays");
    }

    #[test]
    fn a_knee_that_rests_elsewhere_moves_no_sample() {
        let (here, there) = (told(3.0, 30.0, 200.0), told(3.0 + 1.01 * ELSEWHERE, 0.0, 10.0));
        let none = Mechanics::between(&here, &there);
        assert_eq!([none.of("ap_mm", 3.0), none.of("force_ACL_AM_n", 30.0)], [3.0, 30.0]);
        let change = Mechanics::between(&here, &told(5.0, 24.0, 100.0));
        assert_eq!([change.of("ap_mm", 3.0), change.of("force_ACL_AM_n", 30.0)], [5.0, 24.0]);
    }

    #[test]
    fn a_compartment_bears_force_area_and_pressure_together_or_none() {
        let told = |force: f64, area: f64, mean: f64, peak: f64| -> Vec<(String, f64)> {
            let values = [force, area, mean, peak];
            SIZES.iter().zip(values).map(|(end, x)| (format!("contact_medial{end}"), x)).collect()
        };
        let sample = |outputs: &[(String, f64)]| Prediction {
            pose: Free::all(0.0),
            forces_n: vec![],
            outputs: outputs.to_vec(),
            leaves_the_plateau: false,
            is_subluxed: false,
            is_rotated: false,
        };
        let (loaded, heavier, none) =
            (told(50.0, 40.0, 1.25, 3.0), told(90.0, 60.0, 1.5, 4.0), told(0.0, 0.0, 0.0, 0.0));
        for [search, last] in [[&loaded, &none], [&none, &loaded], [&loaded, &heavier]] {
            let change = Mechanics::between(search, last);
            for from in [&loaded, &heavier, &none] {
                let moved = change.moved(&[], &sample(from)).outputs;
                let bears = moved.iter().map(|(_, x)| *x > 0.0).collect::<Vec<_>>();
                assert!(bears.iter().all(|b| *b) || bears.iter().all(|b| !*b), "{moved:?}");
            }
            // the most probable knee ends at its final answer
            let end = change.moved(&[], &sample(search)).outputs;
            assert!(end.iter().zip(last).all(|(a, b)| (a.1 - b.1).abs() < 1e-12), "{end:?}");
        }
    }
}

//! Readings of a knee that has left its joint. There the diagnosis has no contact to speak of: plateaus that it continues past their rims, a knee that
//! hangs in its ligaments. Two solvers of one model part there by degrees. So what such a trial reads is left out of every hypothesis alike, and told.

use crate::problem::Problem;
use inference::trial::Trial;
use sim::Model;
use sim::coordinate::{SI, Six};
use sim::flags::Flag;
use sim::trials::{TrialOptions, flags};

/// Largest share of a data set's trials that may be left out of it [-]. Declared: where more lie out of the joint, its frames or its origin are off, and that
/// is for the diagnosis to find.
const MOST: f64 = 0.5;
/// Fewest trials of all data sets that stay [-]: fewer are no data.
const FEWEST: usize = 4;

/// How far a reading's noise may lift a femur off its plateau [mm], in steps: four standard deviations of the usual noise along the axis of the tibia.
const LIFTED_MM: [f64; 4] = [0.0, 0.5, 1.0, 1.5];

/// Whether the femur lies off its plateau at some coordinates, and also where it is pressed down by what noise may have lifted it.
fn is_out(model: &Model, q: &Six) -> bool {
    LIFTED_MM.iter().all(|by| {
        let mut q = *q;
        q[SI] += by;
        let found = flags(model, &model.joint.grood_suntay(&q), &model.evaluate(&q), &TrialOptions::default());
        found.contains(&Flag::Dislocated)
    })
}

/// Which of so many trials stay, those out of the joint given with their data sets: all of a set where most of it would go.
fn staying(out: &[(Option<usize>, bool)]) -> Vec<bool> {
    let count =
        |source: Option<usize>, only_out: bool| out.iter().filter(|(s, o)| *s == source && (*o || !only_out)).count();
    let may_go = |source: Option<usize>| count(source, true) as f64 <= MOST * count(source, false) as f64;
    let stay: Vec<bool> = out.iter().map(|(source, is_out)| !is_out || !may_go(*source)).collect();
    if stay.iter().filter(|s| **s).count() < FEWEST { vec![true; out.len()] } else { stay }
}

impl Problem {
    /// The same question without the trials whose reading lies out of the joint, as near to it as the load and the contact hold the knee.
    pub fn within_the_joint(mut self) -> Problem {
        let is_trial_out =
            |(t, q): (&Trial, Option<Six>)| (t.source, q.is_some_and(|q| is_out(self.models.of(t.source), &q)));
        let out: Vec<(Option<usize>, bool)> =
            self.trials.iter().zip(self.held_coordinates()).map(is_trial_out).collect();
        let stay = staying(&out);
        let name = |t: &Trial| format!("{} {}", self.source_of(t), t.record.trial);
        self.astray = self.trials.iter().zip(&stay).filter(|(_, s)| !**s).map(|(t, _)| name(t)).collect();
        self.keep(&stay);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_trials_of_a_set_are_left_out_and_never_most_of_it() {
        let set =
            |source: usize, out: usize, all: usize| (0..all).map(move |i| (Some(source), i < out)).collect::<Vec<_>>();
        let stay = staying(&[set(0, 3, 10), set(1, 6, 10), set(2, 0, 10)].concat());
        let of = |source: usize| stay[10 * source..10 * (source + 1)].iter().filter(|s| **s).count();
        assert_eq!([of(0), of(1), of(2)], [7, 10, 10]);
        assert!(!stay[0] && stay[3]);
        // too few would stay
        assert_eq!(staying(&set(0, 3, 6)), [true; 6]);
    }
}

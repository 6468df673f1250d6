//! A trial, as every inference has it: what was done to the knee, what was read, and what belongs together.

use sim::coordinate::{Free, SI, Six};
use sim::equilibrium::Start;
use sim::laxity::{Branch, LaxityTrial, Test};
use std::collections::BTreeMap;

/// A trial.
#[derive(Clone, Debug)]
pub struct Trial {
    /// What was done and what was read, as a file has it or as it is asked for. A new column of a file stands here.
    pub record: LaxityTrial,
    /// Its data set; of none where it is only imagined.
    pub source: Option<usize>,
    /// Scatter of a reading by itself: VV, IE [deg], ML, AP, SI [mm].
    pub sd: Free<f64>,
    /// Which coordinates are readings that count.
    pub reads: Free<bool>,
    /// Place of the trial from whose pose the readings count; none where they are poses.
    pub from: Option<usize>,
    /// Number of its condition: data set, test and nominal flexion. Trials of a condition share their repositioning.
    pub condition: usize,
    /// Place in the order of testing, from 0 to 1, where known.
    pub order: Option<f64>,
    /// Time of testing, from 0 to 1, where known.
    pub time: Option<f64>,
    /// The unloaded pose at its flexion, where somebody found it.
    pub unloaded: Start,
}

impl Trial {
    /// A trial by itself, of no data set; it reads what was measured.
    pub fn alone(record: LaxityTrial) -> Trial {
        Trial {
            reads: record.measured.map(|m| m.is_some()),
            record,
            source: None,
            sd: Free::all(1.0),
            from: None,
            condition: 0,
            order: None,
            time: None,
            unloaded: Start::at(Six::zeros()),
        }
    }

    /// A trial that somebody imagines, of which nothing is read.
    pub fn imagined(record: LaxityTrial) -> Trial {
        Trial { reads: Free::all(false), ..Trial::alone(record) }
    }

    /// Recorded load on the tibia as generalised forces [N mm, N].
    pub fn load(&self) -> Six {
        self.record.load.generalised()
    }

    /// Recorded flexion [rad].
    pub fn flexion(&self) -> f64 {
        self.record.fe_deg.to_radians()
    }

    /// +1 loading, -1 unloading, where known.
    pub fn branch(&self) -> Option<f64> {
        self.record.branch.map(|branch| if branch == Branch::Loading { 1.0 } else { -1.0 })
    }

    /// The same trial with its compression alone.
    pub fn compressed(&self) -> Trial {
        let mut out = self.clone();
        out.record.load = sim::coordinate::Load::compression(self.record.load[SI]);
        out
    }
}

/// The trials of data sets, in order, that read something; `noise` is the scatter of a reading of a data set by itself.
pub fn of_data_sets<'a>(
    sets: impl IntoIterator<Item = &'a [LaxityTrial]>,
    noise: impl Fn(usize, &LaxityTrial) -> Free<f64>,
) -> Vec<Trial> {
    let mut out = Vec::new();
    let mut conditions: BTreeMap<(usize, Test, i64), usize> = BTreeMap::new();
    for (s, trials) in sets.into_iter().enumerate() {
        let orders = Span::of(trials.iter().filter_map(|t| t.order.map(|o| o as f64)));
        let times = Span::of(trials.iter().filter_map(|t| t.time_s));
        for t in trials.iter().filter(|t| t.measured.iter().any(Option::is_some)) {
            let next = conditions.len();
            let condition = *conditions.entry((s, t.test, t.nominal_flexion_deg.round() as i64)).or_insert(next);
            out.push(Trial {
                source: Some(s),
                sd: noise(s, t),
                condition,
                order: orders.place(t.order.map(|o| o as f64)),
                time: times.place(t.time_s),
                ..Trial::alone(t.clone())
            });
        }
    }
    out
}

/// The least and the most of some numbers.
struct Span(f64, f64);

impl Span {
    fn of(all: impl Iterator<Item = f64>) -> Span {
        all.fold(Span(f64::INFINITY, f64::NEG_INFINITY), |Span(low, high), x| Span(low.min(x), high.max(x)))
    }

    /// Where a number lies between them, from 0 to 1; nowhere where all are one.
    fn place(&self, x: Option<f64>) -> Option<f64> {
        x.filter(|_| self.1 > self.0).map(|x| (x - self.0) / (self.1 - self.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::{AP, Load};

    #[test]
    fn trials_of_a_condition_share_its_number_and_those_that_read_nothing_are_left_out() {
        let trial = |test: Test, fe_deg: f64, order: i64, read: bool| {
            let mut t = LaxityTrial::asked(String::new(), test, fe_deg, Load::compression(20.0));
            t.measured[AP] = read.then_some(1.0);
            t.order = Some(order);
            t
        };
        let one = [
            trial(Test::Anterior, 30.4, 1, true),
            trial(Test::Anterior, 60.0, 2, false),
            trial(Test::Anterior, 29.6, 5, true),
            trial(Test::Posterior, 30.0, 4, true),
        ];
        let all = of_data_sets([&one[..], &one[..1]], |_, _| Free::all(0.4));
        assert_eq!(all.iter().map(|t| t.condition).collect::<Vec<_>>(), [0, 0, 1, 2]);
        assert_eq!(all.iter().map(|t| t.source).collect::<Vec<_>>(), [Some(0), Some(0), Some(0), Some(1)]);
        // the second data set has one place alone
        assert_eq!(all.iter().map(|t| t.order).collect::<Vec<_>>(), [Some(0.0), Some(1.0), Some(0.75), None]);
        assert!(all.iter().all(|t| t.reads == Free::from_fn(|c| c == AP) && t.sd == Free::all(0.4)));
    }
}

//! Cross-prediction: what a knee calibrated to one data set says of the laxity that another one measured.

use calibration::samples::Change;
use calibration::targets::TargetOptions;
use serde::{Deserialize, Serialize};
use sim::coordinate::{AP, Coordinate, IE, VV};
use sim::laxity::{Band, LaxityTrial};
use std::collections::BTreeMap;

/// A range of laxity as one data set measured it, and as a knee that has not seen these data predicts it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrossPrediction {
    /// The data set that the knee was calibrated to.
    pub model: String,
    /// The data set that measured.
    pub data: String,
    /// vv, ie or ap.
    pub coordinate: String,
    /// Bundles and ligaments that were cut when it was measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
    /// Flexion that the trials are filed under [deg].
    pub flexion_deg: f64,
    /// Least and most load along the coordinate [N m, N].
    pub loads: [f64; 2],
    /// Change of the coordinate between them as measured [deg, mm].
    pub measured: f64,
    /// The same as predicted, with the noise of its reading.
    pub predicted: Band,
}

impl CrossPrediction {
    /// Whether the interval holds what was measured.
    pub fn is_inside(&self) -> bool {
        (self.predicted.lower..=self.predicted.upper).contains(&self.measured)
    }
}

/// A range of laxity that was measured.
#[derive(Clone, Debug)]
pub struct Range {
    /// Between which trials, of what.
    pub change: Change,
    /// Flexion that they are filed under [deg].
    pub flexion_deg: f64,
    /// As measured [deg, mm].
    pub measured: f64,
}

impl Range {
    /// Loads along its coordinate [N m, N].
    pub fn loads(&self) -> [f64; 2] {
        self.change.trials.each_ref().map(|t| t.load[self.change.coordinate])
    }

    /// What was cut at both its ends.
    pub fn without(&self) -> &[String] {
        &self.change.trials[1].without
    }

    /// In words: "AP at 30 deg without ACL".
    pub fn in_words(&self) -> String {
        let cut = match self.without() {
            [] => String::new(),
            cut => format!(" without {}", cut.join(" and ")),
        };
        format!("{} at {:.0} deg{cut}", self.change.coordinate.name().to_uppercase(), self.flexion_deg)
    }
}

/// Loads closer than this are one [N m, N]; ours: ten times what a protocol's numbers are rounded to.
const SAME_LOAD: f64 = 0.1;

/// Ranges of a data set, at each flexion between the least and the most load along the coordinate that a test loads; of displacements, from the trial
/// that they count from. A data set is of one state of the knee.
pub fn ranges(trials: &[LaxityTrial], options: &TargetOptions) -> Vec<Range> {
    let mut out: Vec<Range> = trials.iter().filter_map(|t| displaced(t, options)).collect();
    for c in [AP, IE, VV] {
        let mut by_flexion: BTreeMap<i64, Vec<&LaxityTrial>> = BTreeMap::new();
        let mine = |t: &&LaxityTrial| t.reference.is_none() && t.test.coordinate().is_none_or(|of| of == c);
        for t in trials.iter().filter(mine).filter(|t| t.measured[c].is_some()) {
            by_flexion.entry(t.nominal_flexion_deg.round() as i64).or_default().push(t);
        }
        out.extend(by_flexion.values().filter_map(|here| between_ends(here, c, options)));
    }
    out
}

/// From the least to the most load along a coordinate.
fn between_ends(here: &[&LaxityTrial], c: Coordinate, options: &TargetOptions) -> Option<Range> {
    let by_load = |a: &&&LaxityTrial, b: &&&LaxityTrial| a.load[c].total_cmp(&b.load[c]);
    let (least, most) = (here.iter().min_by(by_load)?, here.iter().max_by(by_load)?);
    if most.load[c] - least.load[c] < SAME_LOAD {
        return None;
    }
    let noise = |t: &LaxityTrial| t.sd[c].unwrap_or(options.noise[c]);
    Some(Range {
        flexion_deg: most.nominal_flexion_deg,
        measured: most.measured[c]? - least.measured[c]?,
        change: Change {
            trials: [(*least).clone(), (*most).clone()],
            coordinate: c,
            noise: noise(least).hypot(noise(most)),
        },
    })
}

/// A displacement from the pose of another trial.
fn displaced(t: &LaxityTrial, options: &TargetOptions) -> Option<Range> {
    let (from, c) = (t.unloaded()?, t.test.coordinate()?);
    Some(Range {
        flexion_deg: t.nominal_flexion_deg,
        measured: t.measured[c]?,
        change: Change {
            trials: [from, t.clone()],
            coordinate: c,
            noise: t.sd[c].unwrap_or(options.noise_of_displacements[c]),
        },
    })
}

/// How many intervals hold, of how many, by the data set calibrated to and the one that measured.
pub fn counts(all: &[CrossPrediction]) -> BTreeMap<(&str, &str), [usize; 2]> {
    let mut out: BTreeMap<(&str, &str), [usize; 2]> = BTreeMap::new();
    for c in all {
        let [inside, of] = out.entry((&c.model, &c.data)).or_default();
        (*inside, *of) = (*inside + usize::from(c.is_inside()), *of + 1);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::Load;
    use sim::laxity::{Reference, Test};

    fn trial(test: Test, fe_deg: f64, ap: f64, reading: f64) -> LaxityTrial {
        let mut t = LaxityTrial::asked(format!("{fe_deg} {ap}"), test, fe_deg, Load::new(0.0, 0.0, 0.0, ap, 20.0));
        t.measured[AP] = Some(reading);
        t
    }

    #[test]
    fn a_range_is_from_the_least_to_the_most_load_of_a_flexion() {
        let trials = [
            trial(Test::Anterior, 30.0, 100.0, 6.0),
            trial(Test::Anterior, 30.0, 50.0, 4.0),
            trial(Test::Neutral, 30.0, 0.0, 1.0),
            trial(Test::Posterior, 30.0, -80.0, -3.0),
            trial(Test::Anterior, 90.0, 100.0, 5.0),
            trial(Test::Internal, 30.0, 300.0, 50.0),
        ];
        let found = ranges(&trials, &TargetOptions::default());
        assert_eq!(found.len(), 1, "one flexion has two loads");
        assert_eq!((found[0].measured, found[0].loads(), found[0].flexion_deg), (9.0, [-80.0, 100.0], 30.0));
        assert!((found[0].change.noise - 0.4 * 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_range_of_a_cut_knee_says_so() {
        let mut trials = [trial(Test::Anterior, 30.0, 133.0, 16.0), trial(Test::Posterior, 30.0, -133.0, -3.5)];
        assert_eq!(ranges(&trials, &TargetOptions::default())[0].in_words(), "AP at 30 deg");
        trials.iter_mut().for_each(|t| t.without = vec!["ACL".into()]);
        let found = ranges(&trials, &TargetOptions::default());
        assert_eq!(
            (found[0].in_words().as_str(), found[0].without()),
            ("AP at 30 deg without ACL", &["ACL".to_owned()][..])
        );
    }

    #[test]
    fn a_displacement_counts_from_its_own_trial() {
        let mut t = trial(Test::Anterior, 30.0, 133.0, 5.5);
        t.reference = Some(Reference { trial: "rest".into(), load: Load::default(), fe_deg: 30.0 });
        let found = ranges(&[t], &TargetOptions::default());
        assert_eq!((found[0].measured, found[0].loads()), (5.5, [0.0, 133.0]));
        assert!((found[0].change.noise - 0.7).abs() < 1e-12);
    }

    #[test]
    fn what_lies_beyond_an_interval_is_counted_so() {
        let of = |measured: f64| CrossPrediction {
            model: "a".into(),
            data: "b".into(),
            coordinate: "ap".into(),
            without: vec![],
            flexion_deg: 30.0,
            loads: [-133.0, 133.0],
            measured,
            predicted: Band { mean: 10.0, lower: 8.0, upper: 12.5 },
        };
        let all = [of(8.0), of(12.6), of(7.9)];
        let counted = counts(&all);
        assert_eq!(counted[&("a", "b")], [1, 3]);
    }
}

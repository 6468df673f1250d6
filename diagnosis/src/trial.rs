//! Measured trials in the solver's units, with what belongs together.

use crate::error::DiagnosisError;
use serde::{Deserialize, Serialize};
use sim::contact::Nearby;
use sim::coordinate::{Coordinate, FREE, Free, Six};
use sim::equilibrium::Start;
use sim::laxity::{Branch, LaxityTrial, Test};
use std::collections::BTreeMap;

/// Row of a reading where every trial has one for each free coordinate.
pub fn row_of(trial: usize, c: Coordinate) -> usize {
    FREE.len() * trial + c.free_index()
}

/// The trial and the coordinate of such a row.
pub fn at_row(row: usize) -> (usize, Coordinate) {
    (row / FREE.len(), FREE[row % FREE.len()])
}

/// Turns of a degree into radians and back, by coordinate.
pub const PER_UNIT: Free<f64> = Free([std::f64::consts::PI / 180.0, std::f64::consts::PI / 180.0, 1.0, 1.0, 1.0]);

/// A data set: the trials of one apparatus.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Its name: kla, rks, ...
    pub name: String,
    /// Its trials, as read.
    pub trials: Vec<LaxityTrial>,
    /// Whether it was measured before what is asked about: no effect acts in it, and the knee's ligaments, sites and frames are the same.
    pub before: bool,
}

impl Source {
    /// A data set that is asked about.
    pub fn new(name: impl Into<String>, trials: Vec<LaxityTrial>) -> Source {
        Source { name: name.into(), trials, before: false }
    }

    /// One that was measured before what is asked about.
    pub fn before(name: impl Into<String>, trials: Vec<LaxityTrial>) -> Source {
        Source { name: name.into(), trials, before: true }
    }
}

/// Noise of one coordinate of one data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseScale {
    /// The data set.
    pub source: String,
    /// The coordinate: vv, ie, ml, ap, si.
    pub coordinate: String,
    /// Mean noise that the file states [deg, mm].
    pub stated: f64,
    /// What the data say [deg, mm].
    pub inferred: f64,
    /// Its 90 % interval [deg, mm].
    pub lower: f64,
    /// And its end.
    pub upper: f64,
    /// Whether the diagnosis takes the inferred one: the data ask for it clearly.
    pub taken: bool,
}

/// A trial as the solver sees it.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Index of its data set.
    pub source: usize,
    /// Row of its file, the header being row 1; none where no file holds it.
    pub row: Option<usize>,
    /// Its name in the file.
    pub name: String,
    /// What it tests.
    pub test: Test,
    /// The flexion it is filed under [deg].
    pub nominal: f64,
    /// Recorded load on the tibia [N mm, N].
    pub load: Six,
    /// Recorded flexion [rad].
    pub flexion: f64,
    /// Measured VV, IE [deg], ML, AP, SI [mm].
    pub measured: Free<Option<f64>>,
    /// Measurement noise, same units.
    pub sd: Free<f64>,
    /// Index of its condition: data set, test and nominal flexion.
    pub condition: usize,
    /// +1 loading, -1 unloading, where known.
    pub branch: Option<f64>,
    /// Place in the order of testing, from 0 to 1, where known.
    pub order: Option<f64>,
    /// Time of testing, from 0 to 1, where known.
    pub time: Option<f64>,
    /// Tension of the quadriceps [N].
    pub quadriceps_n: f64,
    /// The unloaded pose at its flexion, chain coordinates; set once for the model as given.
    pub neutral: Six,
    /// Where cartilage nearly touches there.
    pub near: Nearby,
}

impl Trial {
    /// A trial by itself: no data set, nothing measured, no history.
    pub fn alone(t: &LaxityTrial) -> Trial {
        Trial {
            source: 0,
            row: t.row,
            name: t.trial.clone(),
            test: t.test,
            nominal: t.nominal_flexion_deg,
            load: t.load.generalised(),
            flexion: t.fe_deg.to_radians(),
            measured: t.measured,
            sd: Free::all(1.0),
            condition: 0,
            branch: t.branch.map(sign),
            order: None,
            time: None,
            quadriceps_n: t.quadriceps_n,
            neutral: Six::zeros(),
            near: Nearby::default(),
        }
    }

    /// The unloaded pose, to begin from.
    pub fn unloaded(&self) -> Start {
        Start { q: self.neutral, near: self.near.clone() }
    }

    /// Sets the unloaded pose.
    pub fn rest_at(&mut self, unloaded: Start) {
        (self.neutral, self.near) = (unloaded.q, unloaded.near);
    }
}

fn sign(branch: Branch) -> f64 {
    if branch == Branch::Loading { 1.0 } else { -1.0 }
}

/// All trials of all data sets, in the order given; `usual` is the measurement noise where a file gives none: VV, IE [deg], ML, AP, SI [mm].
///
/// Errors: no data set, fewer than four trials in all, a noise of zero.
pub fn trials(sources: &[Source], usual: &Free<f64>) -> Result<Vec<Trial>, DiagnosisError> {
    let mut out = Vec::new();
    let mut conditions: BTreeMap<(usize, Test, i64), usize> = BTreeMap::new();
    for (s, source) in sources.iter().enumerate() {
        let place = |value: Option<f64>, all: Vec<f64>| {
            let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
            value.filter(|_| high > low).map(|v| (v - low) / (high - low))
        };
        let orders: Vec<f64> = source.trials.iter().filter_map(|t| t.order.map(|o| o as f64)).collect();
        let times: Vec<f64> = source.trials.iter().filter_map(|t| t.time_s).collect();
        for t in &source.trials {
            if t.measured.iter().all(Option::is_none) {
                continue;
            }
            if let Some(r) = &t.reference {
                return Err(DiagnosisError::Data(format!(
                    "{} trial {}: its readings are displacements from trial \"{}\", a diagnosis needs poses: leave this data set out",
                    source.name, t.trial, r.trial
                )));
            }
            let sd: Free<f64> = Free::from_fn(|c| t.sd[c].unwrap_or(usual[c]));
            if let Some(c) = FREE.into_iter().find(|&c| !(sd[c] > 0.0 && sd[c].is_finite())) {
                return Err(DiagnosisError::Data(format!(
                    "{} trial {}: measurement noise of {c} is {}, expected above 0",
                    source.name, t.trial, sd[c]
                )));
            }
            let next = conditions.len();
            let key = (s, t.test, t.nominal_flexion_deg.round() as i64);
            out.push(Trial {
                source: s,
                sd,
                condition: *conditions.entry(key).or_insert(next),
                order: place(t.order.map(|o| o as f64), orders.clone()),
                time: place(t.time_s, times.clone()),
                ..Trial::alone(t)
            });
        }
    }
    if sources.iter().all(|s| s.before) {
        return Err(DiagnosisError::Data(
            "no data set to ask about: all of them were measured before; give what was measured since".into(),
        ));
    }
    if out.len() < 4 {
        return Err(DiagnosisError::Data(format!(
            "{} trials with a measured coordinate in all data sets, at least 4 are needed",
            out.len()
        )));
    }
    Ok(out)
}

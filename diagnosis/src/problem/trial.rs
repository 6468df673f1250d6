//! The data sets of a question, and the rows of its readings.

use crate::error::DiagnosisError;
pub use inference::trial::Trial;
use inference::trial::of_data_sets;
use serde::{Deserialize, Serialize};
use sim::coordinate::{Coordinate, FREE, Free};
use sim::laxity::LaxityTrial;

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

/// Trials that a diagnosis needs at least [-]; ours.
const LEAST: usize = 4;

/// All trials of all data sets, in the order given; `usual` is the measurement noise where a file gives none: VV, IE [deg], ML, AP, SI [mm].
///
/// Errors: no data set, fewer than four trials in all, a noise of zero.
pub fn trials(sources: &[Source], usual: &Free<f64>) -> Result<Vec<Trial>, DiagnosisError> {
    for (source, t) in sources.iter().flat_map(|s| s.trials.iter().map(move |t| (s, t))) {
        if t.measured.iter().all(Option::is_none) {
            continue;
        }
        if let Some(r) = &t.reference {
            return Err(DiagnosisError::Data(format!(
                "{} trial {}: its readings are displacements from trial \"{}\", a diagnosis needs poses: leave this data set out",
                source.name, t.trial, r.trial
            )));
        }
        let sd = t.noise(usual);
        if let Some(c) = FREE.into_iter().find(|&c| !(sd[c] > 0.0 && sd[c].is_finite())) {
            return Err(DiagnosisError::Data(format!(
                "{} trial {}: measurement noise of {c} is {}, expected above 0",
                source.name, t.trial, sd[c]
            )));
        }
    }
    let out = of_data_sets(sources.iter().map(|s| &s.trials[..]), |_, t| t.noise(usual));
    if sources.iter().all(|s| s.before) {
        return Err(DiagnosisError::Data(
            "no data set to ask about: all of them were measured before; give what was measured since".into(),
        ));
    }
    if out.len() < LEAST {
        return Err(DiagnosisError::Data(format!(
            "{} with a measured coordinate in {}, at least {LEAST} are needed; add trials",
            if out.len() == 1 { "1 trial".to_owned() } else { format!("{} trials", out.len()) },
            sources.iter().map(|s| s.name.as_str()).collect::<Vec<_>>().join(" and ")
        )));
    }
    Ok(out)
}

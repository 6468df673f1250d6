//! How far two solvers lie apart on the protocols of a knee, with the place.

use serde::{Deserialize, Serialize};
use sim::flags::Cause;
use sim::laxity::TrialResult;

/// The quasi-static rows of a source that is told by explicit dynamics, and how far both lie apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checked {
    /// Quasi-static rows, in the order of [`crate::validate::Source::protocols`].
    pub quasistatic: [Vec<TrialResult>; 4],
    /// The largest difference of each protocol in mm, deg and N.
    pub largest: Vec<Apart>,
}

/// The largest difference of two solvers in a protocol and a unit, with its place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Apart {
    /// The protocol, by its file.
    pub protocol: String,
    /// What is cut; empty for the intact knee.
    pub cut: String,
    /// The row's name.
    pub step: String,
    /// Its flexion [deg].
    pub flexion_deg: f64,
    /// The coordinate, by its name in files, or the bundle.
    pub quantity: String,
    /// Its column.
    pub column: String,
    /// mm, deg or N.
    pub unit: String,
    /// By explicit dynamics.
    pub explicit: f64,
    /// By the quasi-static solver.
    pub quasistatic: f64,
    /// How far apart they may lie.
    pub limit: f64,
    /// Why they lie further apart; none where they do not.
    pub cause: Option<Cause>,
}

impl Apart {
    /// Explicit less quasi-static.
    pub fn difference(&self) -> f64 {
        self.explicit - self.quasistatic
    }

    /// The difference over its limit [-].
    pub fn share(&self) -> f64 {
        self.difference().abs() / self.limit
    }
}

impl Checked {
    /// The largest difference of all protocols in a unit.
    pub fn worst(&self, unit: &str) -> Option<&Apart> {
        let more = |a: &&Apart, b: &&Apart| a.share().total_cmp(&b.share());
        self.largest.iter().filter(|a| a.unit == unit).max_by(more)
    }
}

//! Laxity data (FORMAT 2): measured trials in clinical signs, what a model answers to them, and their CSV.
//!
//! Loads act on the tibia in the signs of the coordinates, N m for VV and IE, N for ML, AP and SI; poses in degrees and mm.

mod between;
mod columns;
mod differences;
mod doubts;
mod exchanged;
mod flexion;
mod format;
mod headers;
mod lag;
mod median;
mod motion;
mod numbers;
mod one_reading;
mod order;
mod outliers;
mod read;
mod sign_doubt;
mod signs;
mod stated;
mod text;
mod tracked;
mod units;
mod usual_tests;
mod write;

pub use between::{Named, against_model, between, repeated};
pub use columns::{LaxityError, WITHOUT_COLUMN, cut_cell};
pub use format::{Bone, Column, FullColumn, LaxityFormat, Readings};
pub use read::{LaxityTable, read, read_as, read_asked};
pub use sign_doubt::SignDoubt;
pub use signs::sign_doubts;
pub use tracked::{BuiltBone, Tracked, TrackedBone};
pub use write::{Band, TrialResult, force_column, protocol_csv, results_csv, trials_csv};

use crate::coordinate::{AP, Coordinate, Free, IE, Load, VV};
use serde::{Deserialize, Serialize};

/// What a trial tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Test {
    /// The tibia pushed forwards.
    Anterior,
    /// The tibia pushed backwards.
    Posterior,
    /// The tibia turned inwards.
    Internal,
    /// The tibia turned outwards.
    External,
    /// The tibia tilted inwards.
    Varus,
    /// The tibia tilted outwards.
    Valgus,
    /// No load but compression.
    Neutral,
}

/// Every test, with its name in files.
pub const TESTS: [(Test, &str); 7] = [
    (Test::Anterior, "anterior"),
    (Test::Posterior, "posterior"),
    (Test::Internal, "internal"),
    (Test::External, "external"),
    (Test::Varus, "varus"),
    (Test::Valgus, "valgus"),
    (Test::Neutral, "neutral"),
];

impl Test {
    /// The name in files.
    pub fn name(self) -> &'static str {
        TESTS[self as usize].1
    }

    /// The coordinate that it loads; `None` for neutral.
    pub fn coordinate(self) -> Option<Coordinate> {
        match self {
            Test::Anterior | Test::Posterior => Some(AP),
            Test::Internal | Test::External => Some(IE),
            Test::Varus | Test::Valgus => Some(VV),
            Test::Neutral => None,
        }
    }
}

/// Whether the load of a trial was reached from below or from above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Branch {
    /// The load was growing.
    Loading,
    /// The load was falling.
    Unloading,
}

/// One measured trial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LaxityTrial {
    /// Row of the file it was read from, the header being row 1; none for a trial that no file holds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row: Option<usize>,
    /// The trial's name, unique in its file.
    pub trial: String,
    /// What it tests.
    pub test: Test,
    /// The flexion it is filed under [deg].
    pub nominal_flexion_deg: f64,
    /// Loads on the tibia; +20 N SI is 20 N of compression.
    pub load: Load,
    /// Flexion, prescribed in a simulation [deg].
    pub fe_deg: f64,
    /// Measured VV, IE [deg], ML, AP, SI [mm]; `None` is not measured.
    pub measured: Free<Option<f64>>,
    /// Standard deviation of the measurement noise, same order and units.
    #[serde(default)]
    pub sd: Free<Option<f64>>,
    /// Which way the load was going.
    #[serde(default)]
    pub branch: Option<Branch>,
    /// Place in the order of testing.
    #[serde(default)]
    pub order: Option<i64>,
    /// When it was read [s].
    #[serde(default)]
    pub time_s: Option<f64>,
    /// Tension of the quadriceps [N]; 0 where no column gives it.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub quadriceps_n: f64,
    /// Ligaments and bundles that were cut before it, as [`crate::Model::without`] takes them; in order, each once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
    /// The trial from whose pose the readings count: displacements, as an arthrometer gives them. None where they are poses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<Reference>,
}

/// The trial from whose pose displacements count; mostly the unloaded one of the same flexion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Its name.
    pub trial: String,
    /// Its loads on the tibia.
    pub load: Load,
    /// Its flexion [deg].
    pub fe_deg: f64,
}

/// What is done to a knee in a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Imposed {
    /// Loads on the tibia.
    pub load: Load,
    /// Flexion [deg].
    pub fe_deg: f64,
    /// Tension of the quadriceps [N].
    pub quadriceps_n: f64,
    /// Ligaments and bundles that were cut.
    pub without: Vec<String>,
}

/// Whether a number is left out of what is written.
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

impl LaxityTrial {
    /// A trial that is asked for: its name, its test, its flexion [deg] and its loads, with nothing measured.
    pub fn asked(trial: String, test: Test, fe_deg: f64, load: Load) -> LaxityTrial {
        LaxityTrial {
            row: None,
            trial,
            test,
            nominal_flexion_deg: fe_deg,
            load,
            fe_deg,
            measured: Free::all(None),
            sd: Free::all(None),
            branch: None,
            order: None,
            time_s: None,
            quadriceps_n: 0.0,
            without: vec![],
            reference: None,
        }
    }

    /// What is done to the knee. Two trials with the same of it are one equilibrium; what else a trial holds is about its reading and its record.
    pub fn imposed(&self) -> Imposed {
        // taken apart in full, so that a new column has to say which of both it is
        let LaxityTrial {
            load,
            fe_deg,
            quadriceps_n,
            without,
            row: _,
            trial: _,
            test: _,
            nominal_flexion_deg: _,
            measured: _,
            sd: _,
            branch: _,
            order: _,
            time_s: _,
            reference: _,
        } = self;
        Imposed { load: *load, fe_deg: *fe_deg, quadriceps_n: *quadriceps_n, without: without.clone() }
    }

    /// The trial from whose pose the readings count, with nothing measured.
    pub fn unloaded(&self) -> Option<LaxityTrial> {
        self.reference.as_ref().map(|r| LaxityTrial {
            nominal_flexion_deg: self.nominal_flexion_deg,
            quadriceps_n: self.quadriceps_n,
            without: self.without.clone(),
            ..LaxityTrial::asked(r.trial.clone(), Test::Neutral, r.fe_deg, r.load)
        })
    }

    /// Standard deviation of each reading's noise: its own, else the `usual` one.
    pub fn noise(&self, usual: &Free<f64>) -> Free<f64> {
        Free::from_fn(|c| self.sd[c].unwrap_or(usual[c]))
    }

    /// A coordinate's load less that of the trial from which readings count [N m, N].
    pub fn load_step(&self, coordinate: Coordinate) -> f64 {
        self.load[coordinate] - self.reference.as_ref().map_or(0.0, |r| r.load[coordinate])
    }
}

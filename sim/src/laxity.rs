//! Laxity data (FORMAT 2): measured trials in clinical signs, what a model answers to them, and their CSV.
//!
//! The five loaded coordinates stand everywhere in the order of [`COORDINATES`]; loads act on the tibia in the signs of
//! the coordinates, N m for VV and IE, N for ML, AP and SI; poses in degrees and mm.

mod columns;
mod differences;
mod format;
mod read;
mod signs;
mod write;

pub use columns::LaxityError;
pub use format::{Bone, Column, FullColumn, LaxityFormat, Readings};
pub use read::{LaxityTable, read, read_as};
pub use signs::{SignDoubt, sign_doubts};
pub use write::{TrialResult, protocol_csv, results_csv, trials_csv};

use serde::{Deserialize, Serialize};

/// The five loaded coordinates, in the order of every array of five here; flexion is prescribed.
pub const COORDINATES: [&str; 5] = ["vv", "ie", "ml", "ap", "si"];
/// Units of the coordinates' values.
pub const VALUE_UNITS: [&str; 5] = ["deg", "deg", "mm", "mm", "mm"];
/// Units of the loads.
pub const LOAD_UNITS: [&str; 5] = ["nm", "nm", "n", "n", "n"];

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

    /// The coordinate that it loads, as a place in [`COORDINATES`]; `None` for neutral.
    pub fn coordinate(self) -> Option<usize> {
        match self {
            Test::Anterior | Test::Posterior => Some(3),
            Test::Internal | Test::External => Some(1),
            Test::Varus | Test::Valgus => Some(0),
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
    /// Loads on the tibia: VV, IE [N m], ML, AP, SI [N]; +20 N SI is 20 N of compression.
    pub load: [f64; 5],
    /// Flexion, prescribed in a simulation [deg].
    pub fe_deg: f64,
    /// Measured VV, IE [deg], ML, AP, SI [mm]; `None` is not measured.
    pub measured: [Option<f64>; 5],
    /// Standard deviation of the measurement noise, same order and units.
    #[serde(default)]
    pub sd: [Option<f64>; 5],
    /// Which way the load was going.
    #[serde(default)]
    pub branch: Option<Branch>,
    /// Place in the order of testing.
    #[serde(default)]
    pub order: Option<i64>,
    /// When it was read [s].
    #[serde(default)]
    pub time_s: Option<f64>,
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
    /// Its loads on the tibia: VV, IE [N m], ML, AP, SI [N].
    pub load: [f64; 5],
    /// Its flexion [deg].
    pub fe_deg: f64,
}

impl LaxityTrial {
    /// The trial from whose pose the readings count, with nothing measured.
    pub fn unloaded(&self) -> Option<LaxityTrial> {
        self.reference.as_ref().map(|r| LaxityTrial {
            row: None,
            trial: r.trial.clone(),
            test: Test::Neutral,
            load: r.load,
            fe_deg: r.fe_deg,
            measured: [None; 5],
            sd: [None; 5],
            branch: None,
            order: None,
            time_s: None,
            reference: None,
            ..self.clone()
        })
    }

    /// A coordinate's load less that of the trial from which readings count [N m, N].
    pub fn load_step(&self, coordinate: usize) -> f64 {
        self.load[coordinate] - self.reference.as_ref().map_or(0.0, |r| r.load[coordinate])
    }
}

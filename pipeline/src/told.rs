//! What a verb tells: words for a person, and the same as data for a program, of a type that has a schema.

use crate::model_file::{self, LoadedModel};
use crate::which_model::standing;
use notices::Notice;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::fmt::Write;

/// What a verb tells.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// Lines for a person, each with its end.
    pub words: String,
    /// What is odd; beside the words, never among them.
    pub warnings: Vec<Notice>,
    /// The models of the answer, a line each.
    pub models: Vec<String>,
    /// The same for a program; `None` of a verb that has its words only.
    pub data: Option<Value>,
}

impl Told {
    /// Words alone.
    pub fn words(words: impl Into<String>) -> Told {
        Told { words: words.into(), ..Told::default() }
    }

    /// With what is odd.
    pub fn odd(self, warnings: Vec<Notice>) -> Told {
        Told { warnings, ..self }
    }

    /// One more line.
    pub fn line(&mut self, line: &str) {
        let _ = writeln!(self.words, "{line}");
    }

    /// With data.
    pub fn with<T: Serialize>(self, data: &T) -> Told {
        Told { data: serde_json::to_value(data).ok(), ..self }
    }

    /// The warnings in sentences.
    pub fn warning_texts(&self) -> Vec<String> {
        notices::texts(&self.warnings)
    }

    /// The warnings as JSON.
    pub fn warnings_as_json(&self) -> String {
        serde_json::to_string(&self.warnings).unwrap_or_default()
    }

    /// The warnings as lines.
    pub fn warning_lines(&self) -> String {
        self.warnings.iter().map(|w| format!("warning: {w}\n")).collect()
    }

    /// Words and warnings in one text, as a caller in the same process reads them.
    pub fn all_lines(&self) -> String {
        self.warning_lines() + &self.words
    }
}

/// Which model an answer is of.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct ModelTold {
    /// The specimen's name.
    pub id: String,
    /// The stage of the build that made it: assemble or calibrate; none of a model outside a build.
    pub stage: Option<String>,
    /// What was done to it, in words: "calibrated to kla and rks together".
    pub standing: String,
    /// The data sets that it is calibrated to; empty where it is not.
    pub calibrated_to: Vec<String>,
    /// Its file.
    pub file: String,
    /// blake3 of the model and the surfaces it names.
    pub digest: String,
}

impl ModelTold {
    /// Of a model that was read.
    pub fn of(loaded: &LoadedModel) -> ModelTold {
        ModelTold {
            id: loaded.spec.id.clone(),
            stage: loaded.stage(),
            standing: standing(&loaded.spec),
            calibrated_to: loaded.spec.calibrated.as_ref().map(|c| c.to.clone()).unwrap_or_default(),
            file: loaded.file.display().to_string(),
            digest: model_file::digest(loaded),
        }
    }
}

/// What is odd in one row of results.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Flagged {
    /// The trial.
    pub trial: String,
    /// What is odd, in sentences.
    pub flags: Vec<String>,
    /// Whether any of it makes the row odd; else they tell of the single model, of a few samples or of friction.
    pub odd: bool,
}

/// `simulate --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SimulateTold {
    /// simulate/1
    pub schema: &'static str,
    /// The model.
    pub model: ModelTold,
    /// The results' file.
    pub file: String,
    /// Rows of results.
    pub rows: usize,
    /// Their columns, in order.
    pub columns: Vec<String>,
    /// Samples of the posterior by which intervals stand; 0: no intervals.
    pub samples: usize,
    /// Standard error of an end of a 90 % interval by so few samples, as a share of half the interval, of a normal distribution; null without samples.
    pub error_of_ends: Option<f64>,
    /// Rows that are odd, and those in which the single model lies outside its interval.
    pub flagged: Vec<Flagged>,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// `calibrate --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct CalibrateTold {
    /// calibrate/1
    pub schema: &'static str,
    /// The model from which the search began.
    pub model: ModelTold,
    /// The calibrated model.json.
    pub calibrated: String,
    /// Where the tables lie.
    pub folder: String,
    /// The figures of metrics.json.
    pub metrics: Value,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// How far two models, or a model and what was measured, differ.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct DifferenceTold {
    /// The first.
    pub a: String,
    /// The second.
    pub b: String,
    /// The protocol.
    pub protocol: String,
    /// What differs.
    pub quantity: String,
    /// Root of the mean squared difference, in `unit`.
    pub rmsd: f64,
    /// Its unit.
    pub unit: String,
    /// The published figure, in the same unit.
    pub published: Option<f64>,
    /// What must be known of it; empty where nothing.
    pub note: String,
    /// Whether `b` was measured; else it is a model.
    pub measured: bool,
}

/// The largest difference of both solvers in a protocol and a unit, with its place.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct SolversTold {
    /// The model.
    pub model: String,
    /// The protocol.
    pub protocol: String,
    /// What is cut; empty for the intact knee.
    pub cut: String,
    /// The row.
    pub step: String,
    /// Its flexion [deg].
    pub flexion_deg: f64,
    /// The column of the coordinate or of the bundle's force.
    pub column: String,
    /// Its unit.
    pub unit: String,
    /// By explicit dynamics.
    pub explicit: f64,
    /// By the quasi-static solver.
    pub quasistatic: f64,
    /// How far apart they may lie.
    pub limit: f64,
    /// Why they lie further apart; null where they do not.
    pub cause: Option<String>,
}

/// `validate --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ValidateTold {
    /// validate/1
    pub schema: &'static str,
    /// The models, in the order given.
    pub models: Vec<ModelTold>,
    /// Where the tables lie.
    pub folder: String,
    /// How far they differ.
    pub differences: Vec<DifferenceTold>,
    /// Largest differences of explicit dynamics and the quasi-static solver, of the models that were told by both.
    pub solvers: Vec<SolversTold>,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// `export --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ExportTold {
    /// export/1
    pub schema: &'static str,
    /// The model.
    pub model: ModelTold,
    /// Where the files lie.
    pub folder: String,
    /// The files, by their paths below the folder.
    pub files: Vec<String>,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// An error on standard error, where `--json` was asked for.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ErrorTold {
    /// error/1
    pub schema: &'static str,
    /// The kind of fault: stage, file, machine, option, usage, internal.
    pub code: &'static str,
    /// The exit status.
    pub status: u8,
    /// The sentence: what is wrong, what was expected, what to do.
    pub message: String,
    /// The stage of a build that stopped.
    pub stage: Option<String>,
    /// The file at fault.
    pub file: Option<String>,
    /// Its row or line, the first being 1.
    pub row: Option<usize>,
    /// Its column: a name of a table's header, or a number.
    pub column: Option<String>,
    /// The option at fault, with its stage: `bones.edge_mm`.
    pub key: Option<String>,
    /// The value that it was given, as TOML has it.
    pub value: Option<String>,
    /// What the kind of fault asks for.
    pub advice: &'static str,
}

/// Versions of what verbs tell.
pub mod schemas {
    /// Of [`super::SimulateTold`].
    pub const SIMULATE: &str = "simulate/1";
    /// Of [`super::CalibrateTold`].
    pub const CALIBRATE: &str = "calibrate/1";
    /// Of [`super::ValidateTold`].
    pub const VALIDATE: &str = "validate/1";
    /// Of [`super::ExportTold`].
    pub const EXPORT: &str = "export/1";
    /// Of [`crate::init::InitTold`].
    pub const INIT: &str = "init/1";
    /// Of [`crate::import::ImportTold`].
    pub const IMPORT: &str = "import/1";
    /// Of [`crate::phantom::PhantomTold`].
    pub const PHANTOM: &str = "phantom/1";
    /// Of [`crate::diagnose::DiagnoseTold`].
    pub const DIAGNOSE: &str = "diagnose/1";
    /// Of [`crate::cohort::CohortTold`].
    pub const COHORT: &str = "cohort/1";
    /// Of [`crate::report::ReportTold`].
    pub const REPORT: &str = "report/1";
    /// Of [`super::ErrorTold`].
    pub const ERROR: &str = "error/1";
}

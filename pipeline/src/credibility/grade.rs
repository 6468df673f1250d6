//! Grades of evidence and levels of risk.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Low, medium or high.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// Little.
    Low,
    /// Some.
    Medium,
    /// Much.
    High,
}

impl Level {
    /// In a word.
    pub(super) fn word(self) -> &'static str {
        match self {
            Level::Low => "low",
            Level::Medium => "medium",
            Level::High => "high",
        }
    }
}

/// How much a number speaks for the model, worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Grade {
    /// Nothing is known.
    NoEvidence,
    /// Known, and beyond the limit of what is adequate.
    Weak,
    /// Within what is usual in the field.
    Adequate,
    /// Well within.
    Strong,
}

impl Grade {
    /// In words.
    pub fn word(self) -> &'static str {
        match self {
            Grade::NoEvidence => "no evidence",
            Grade::Weak => "weak",
            Grade::Adequate => "adequate",
            Grade::Strong => "strong",
        }
    }
}

impl Level {
    /// The grade that a factor needs where the model risk is so.
    pub fn asks_for(self) -> Grade {
        match self {
            Level::Low => Grade::Weak,
            Level::Medium => Grade::Adequate,
            Level::High => Grade::Strong,
        }
    }
}

/// Whether more of a number is better, by its limits: strong, adequate.
pub(super) fn more_is_better([strong, adequate]: [f64; 2]) -> bool {
    strong >= adequate
}

/// What a number is worth; of what is not finite, nothing.
pub(super) fn grade(value: f64, limits: [f64; 2]) -> Grade {
    let reaches = |limit: f64| if more_is_better(limits) { value >= limit } else { value <= limit };
    match value.is_finite() {
        false => Grade::NoEvidence,
        true if reaches(limits[0]) => Grade::Strong,
        true if reaches(limits[1]) => Grade::Adequate,
        true => Grade::Weak,
    }
}

//! All numbers of a plan, each with what the samples say of it.

use super::knee::Answers;
use super::sampled::{At, Sampled};
use calibration::posterior::is_outside;
use schemars::JsonSchema;
use serde::Serialize;
use sim::coordinate::Coordinate;
use sim::laxity::Band;

/// A number and what is known of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Value {
    /// Of the most probable knee.
    pub value: f64,
    /// Mean over the samples.
    pub mean: Option<f64>,
    /// Lower end of the interval.
    pub lower: Option<f64>,
    /// Its upper end.
    pub upper: Option<f64>,
}

impl Value {
    fn of(value: f64, band: Option<Band>) -> Value {
        Value { value, mean: band.map(|b| b.mean), lower: band.map(|b| b.lower), upper: band.map(|b| b.upper) }
    }

    /// Whether the most probable knee lies outside its own interval.
    pub(super) fn is_outside(&self) -> bool {
        self.lower.zip(self.upper).is_some_and(|(lower, upper)| is_outside(self.value, [lower, upper]))
    }
}

/// All numbers of a plan: of the most probable knee, and of the samples.
pub(super) struct Numbers {
    pub(super) best: Answers,
    pub(super) sampled: Option<Sampled>,
}

impl Numbers {
    /// A column of results and what the samples say of it.
    pub(super) fn value(&self, at: At, column: &str) -> Option<Value> {
        let value = self.best[at[0]][at[1]].as_ref()?.value(column)?;
        Some(Value::of(value, self.sampled.as_ref().and_then(|s| s.band(at, column))))
    }

    /// How far a coordinate comes from one answer to another, and what the samples say of it.
    pub(super) fn change(&self, c: Coordinate, from: At, to: At) -> Option<Value> {
        let value = self.best_change(c, from, to)?;
        Some(Value::of(value, self.sampled.as_ref().and_then(|s| s.change(c, from, to))))
    }

    /// The same of the most probable knee alone.
    pub(super) fn best_change(&self, c: Coordinate, from: At, to: At) -> Option<f64> {
        let pose = |at: At| self.best[at[0]][at[1]].as_ref().map(|f| f.pose);
        Some(pose(to)?[c] - pose(from)?[c])
    }
}

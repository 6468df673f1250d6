//! How explicit dynamics are computed.

use crate::error::SimError;
use serde::{Deserialize, Serialize};

/// What sets the length of an increment.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Increments {
    /// The stable increment, found anew each time; never above the longest.
    Stable,
    /// The longest increment, as it is.
    Fixed,
}

/// Explicit dynamics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExplicitOptions {
    /// Whether increments are stable or fixed.
    pub control: Increments,
    /// Longest increment [s]; the published decks' 1e-3. A step may name its own.
    pub longest_increment_s: f64,
    /// Fraction of the stable increment that is taken [-].
    pub safety: f64,
    /// Factor on the femur's mass and inertia [-]: they are numerical, end states are the physics; 5 halves
    /// the time and moves end states by less than 0.1 mm. Measured: docs/verification.md.
    pub mass_scale: f64,
    /// Slip over which a contact patch reaches its Coulomb limit [mm]; as in the quasi-static solver.
    pub slip_mm: f64,
    /// Most increments of a run before it is stopped [-]; ours: twenty times what a row of the published knee takes.
    pub most_increments: usize,
}

impl Default for ExplicitOptions {
    fn default() -> Self {
        ExplicitOptions {
            control: Increments::Stable,
            longest_increment_s: 1e-3,
            safety: 0.7,
            mass_scale: 1.0,
            slip_mm: 0.02,
            most_increments: 200_000,
        }
    }
}

impl ExplicitOptions {
    /// Refuses numbers out of range.
    pub(crate) fn check(&self) -> Result<(), SimError> {
        for (key, value, low, high) in [
            ("longest_increment_s", self.longest_increment_s, 1e-9, 0.1),
            ("safety", self.safety, 0.01, 1.0),
            ("mass_scale", self.mass_scale, 1e-6, 1e9),
            ("slip_mm", self.slip_mm, 1e-6, 1.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(SimError::Input(format!("explicit.{key} is {value}, expected {low} to {high}")));
            }
        }
        if self.most_increments == 0 {
            return Err(SimError::Input("explicit.most_increments is 0, expected 1 or more".into()));
        }
        Ok(())
    }
}

//! What of a knee a parameter may be.

use serde::{Deserialize, Serialize};
use sim::coordinate::Coordinate;
use sim::sensitivity::{End, Parameter as Number};

/// What of a knee a parameter is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Reference strain of bundles, by index [-].
    ReferenceStrain(Vec<usize>),
    /// Stiffness of bundles, by index [N/mm].
    Stiffness(Vec<usize>),
    /// A turn or shift of a frame, by its place in [`crate::frames::Terms`] [deg or mm]: of one data set, or of all.
    Frame(Option<usize>, usize),
    /// A CT coordinate of a bundle's end, from where the model has it [mm].
    Site(usize, End, usize),
    /// Factor on contact pressures [-].
    ContactScale,
    /// Cartilage thicker than the model's, both of a compartment together [mm].
    Cartilage,
    /// Slope by which the bearing surface leans otherwise than the model's about a flexion [rad]: ML or AP, and place among
    /// [`KNOTS`].
    Lean(Coordinate, usize),
    /// Displacement per load that the apparatus of a data set reads beside the knee's [deg/(N m), mm/N]: data set, coordinate.
    Compliance(usize, Coordinate),
    /// Load that the knee bears in all trials of a data set beside the recorded one [N m, N]: data set, coordinate.
    Resting(usize, Coordinate),
}

impl Quantity {
    /// The model's own numbers that it is, and by how much each changes per unit where it has a value; `None` of what stands beside the model, whose
    /// derivative is another.
    pub fn numbers(&self, value: f64) -> Option<(Vec<Number>, f64)> {
        match self {
            Quantity::ReferenceStrain(of) => Some((of.iter().map(|&b| Number::ReferenceStrain(b)).collect(), 1.0)),
            Quantity::Stiffness(of) => Some((of.iter().map(|&b| Number::Stiffness(b)).collect(), 1.0)),
            Quantity::Site(bundle, end, axis) => Some((vec![Number::Site(*bundle, *end, *axis)], 1.0)),
            // the model counts from its own pressures
            Quantity::ContactScale => Some((vec![Number::ContactScale], 1.0 / value)),
            Quantity::Frame(..)
            | Quantity::Cartilage
            | Quantity::Lean(..)
            | Quantity::Compliance(..)
            | Quantity::Resting(..) => None,
        }
    }

    /// The data set whose frames it turns or shifts, or all; and the term. `None` of all that is no frame.
    pub(crate) fn frame(&self) -> Option<(Option<usize>, usize)> {
        match *self {
            Quantity::Frame(source, term) => Some((source, term)),
            Quantity::ReferenceStrain(_)
            | Quantity::Stiffness(_)
            | Quantity::Site(..)
            | Quantity::ContactScale
            | Quantity::Cartilage
            | Quantity::Lean(..)
            | Quantity::Compliance(..)
            | Quantity::Resting(..) => None,
        }
    }
}

/// Flexions between which leans of the bearing surface are interpolated [deg]; ours: contact wanders over a plateau's third in each.
pub const KNOTS: [f64; 4] = [0.0, 30.0, 60.0, 90.0];

/// Share of each of [`KNOTS`] at a flexion.
pub(crate) fn shares(fe_deg: f64) -> [f64; KNOTS.len()] {
    let mut out = [0.0; KNOTS.len()];
    let x = fe_deg.clamp(KNOTS[0], KNOTS[KNOTS.len() - 1]);
    let k = (0..KNOTS.len() - 2).find(|&k| x < KNOTS[k + 1]).unwrap_or(KNOTS.len() - 2);
    let t = (x - KNOTS[k]) / (KNOTS[k + 1] - KNOTS[k]);
    (out[k], out[k + 1]) = (1.0 - t, t);
    out
}

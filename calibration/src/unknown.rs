//! What samples of the posterior hold: every unknown of a knee, its most probable value and its value in each sample.

use crate::knee::SearchOptions;
use inference::frames::{Terms, corrected};
use inference::knee::Quantity;
use meshes::frame::Side;
use serde::{Deserialize, Serialize};
use sim::SimError;
use sim::spec::FramesSpec;

/// Stream of random numbers of the forces by which another simulator differs, a number a bundle, the same for every question that is asked of a sample.
pub(crate) const UNLIKE_STREAM: u64 = 700_000;

/// One unknown of a knee.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Unknown {
    /// Its name, as in parameters.csv and frames.csv.
    pub name: String,
    /// What of the knee it is.
    pub quantity: Quantity,
    /// Its most probable value, in the unit of the quantity.
    pub most_probable: f64,
    /// Its value in each sample.
    pub samples: Vec<f64>,
    /// Its value in each sample with nothing measured, of numbers that knees can share; empty of others. These samples are not those of the posterior,
    /// one by one, and there need not be as many.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub before: Vec<f64>,
}

/// What samples hold of a knee; `10-calibrate/SOURCE/samples.json` has it beside the model that it is counted from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Unknowns {
    /// Every unknown.
    pub unknowns: Vec<Unknown>,
    /// Seed of what is drawn beside the unknowns.
    pub seed: u64,
    /// Share of the samples between the ends of an interval [-].
    pub interval: f64,
    /// How the search asks the model.
    pub search: SearchOptions,
}

impl Unknowns {
    /// The place of a data set that reads poses in frames of its own.
    pub fn source(&self, name: &str) -> Option<usize> {
        let own = |u: &Unknown| u.name.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'));
        self.unknowns.iter().filter(|u| own(u)).find_map(|u| match u.quantity {
            Quantity::Frame(source, _) => source,
            _ => None,
        })
    }

    /// The frames in which a data set reads poses: `assembled`, those of the model before its calibration, with the most probable turns and shifts of
    /// all data sets and its own.
    ///
    /// # Errors
    /// Frames that make no joint.
    pub fn frames_of(&self, source: usize, assembled: &FramesSpec, side: Side) -> Result<FramesSpec, SimError> {
        let mut terms = Terms::default();
        for u in &self.unknowns {
            match u.quantity {
                Quantity::Frame(of, term) if of.is_none_or(|s| s == source) => terms[term] += u.most_probable,
                _ => {}
            }
        }
        corrected(assembled, side, &terms)
    }
}

//! What the laboratory asks of a knee, and what is hidden from whoever reads it.

use crate::pose::Five;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Loads VV, IE [N mm], ML, AP, SI [N] at a flexion [rad].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked {
    pub(crate) flexion: f64,
    pub(crate) load: Five,
}

/// A hidden effect: its name, and its parameters under the names of the catalogue, in clinical signs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    /// Its name; names that begin with `x_` stand in no catalogue ([`crate::unknown`]).
    pub effect: String,
    /// Values.
    pub parameters: BTreeMap<String, f64>,
}

/// A parameter: its key, a typical size, whether only positive.
pub type Size = (&'static str, f64, bool);

impl Hidden {
    pub(crate) fn value(&self, key: &str) -> f64 {
        self.parameters.get(key).copied().unwrap_or(0.0)
    }
}

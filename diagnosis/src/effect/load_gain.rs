//! `load_gain`: the true load is the recorded one times a factor.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadGain {
    /// The factor less one [-].
    gain: f64,
}

impl Force for LoadGain {
    fn force(&self, here: &Situation) -> Six {
        here.load * self.gain
    }
}

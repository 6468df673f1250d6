//! `viscoelastic`: ligaments pull harder while loading than while unloading.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Viscoelastic {
    /// By which share [-].
    share: f64,
}

impl Force for Viscoelastic {
    fn force(&self, here: &Situation) -> Six {
        let states = here.model.fibre_states(&here.pose);
        let pull = states.iter().fold(Six::zeros(), |sum, s| sum - s.line.gradient * s.response.force);
        pull * (self.share * here.trial.branch().unwrap_or(0.0))
    }
}

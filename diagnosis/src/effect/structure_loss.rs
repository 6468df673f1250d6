//! `structure_loss`: a ligament carries less than the model says.

use super::fibres::belongs;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StructureLoss {
    variant: String,
    /// The share of its load that is lost [-].
    loss: f64,
}

impl Force for StructureLoss {
    fn force(&self, here: &Situation) -> Six {
        let states = here.model.fibre_states(&here.pose);
        let mut out = Six::zeros();
        for (fibre, state) in here.model.fibres.iter().zip(&states) {
            let lost = self.lost(&here.model.bundles[fibre.bundle].name);
            out += state.line.gradient * (state.response.force * lost);
        }
        out
    }

    fn lost(&self, bundle: &str) -> f64 {
        if belongs(bundle, &self.variant) { self.loss.min(1.0) } else { 0.0 }
    }
}

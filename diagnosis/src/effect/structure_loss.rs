//! `structure_loss`: a ligament carries less than the model says.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;
use sim::names::is_of;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StructureLoss {
    variant: String,
    /// The share of its load that is lost [-].
    loss: f64,
}

impl Force for StructureLoss {
    fn force(&self, here: &Situation) -> Six {
        let mut out = Six::zeros();
        for (f, fibre) in here.model.fibres.iter().enumerate() {
            let lost = self.lost(&here.model.bundles[fibre.bundle].name);
            if lost != 0.0 {
                let state = here.model.fibre_state(f, &here.pose);
                out += state.line.gradient * (state.response.force * lost);
            }
        }
        out
    }

    fn is_of_the_knee(&self) -> bool {
        true
    }

    fn lost(&self, bundle: &str) -> f64 {
        if is_of(bundle, &self.variant) { self.loss.min(1.0) } else { 0.0 }
    }
}

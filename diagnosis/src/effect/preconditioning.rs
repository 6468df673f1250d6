//! `preconditioning`: ligaments lengthen as tests follow each other.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Preconditioning {
    strain_percent: f64,
}

impl Force for Preconditioning {
    fn force(&self, here: &Situation) -> Six {
        let spent = 1.0 - (-3.0 * here.trial.order.unwrap_or(0.0)).exp();
        let states = here.model.fibre_states(&here.pose);
        let mut out = Six::zeros();
        for (fibre, state) in here.model.fibres.iter().zip(&states) {
            let mut longer = here.model.bundles[fibre.bundle].clone();
            longer.reference_strain -= 0.01 * self.strain_percent * spent;
            let stretch = state.line.length - fibre.initial_length + longer.initial_stretch();
            out -= state.line.gradient * (longer.response(stretch).force - state.response.force);
        }
        out
    }
}

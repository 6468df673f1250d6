//! `gastroc_tone`: a pull between the femoral condyles and the heel.

use super::lines::pull;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GastrocTone {
    force_n: f64,
}

impl Force for GastrocTone {
    fn force(&self, here: &Situation) -> Six {
        let heel = [0.0, -40.0, -380.0];
        let heads = pull(here, [20.0, -22.0, 10.0], heel) + pull(here, [-20.0, -22.0, 10.0], heel);
        heads * 0.5 * self.force_n
    }
}

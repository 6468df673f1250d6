//! `gravity`: the weight of the shank.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, Six, VV};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Gravity {
    weight_n: f64,
    lever_mm: f64,
}

impl Force for Gravity {
    fn force(&self, here: &Situation) -> Six {
        let mut out = Six::zeros();
        (out[AP], out[VV]) = (-self.weight_n * here.flexion.sin(), self.weight_n * self.lever_mm);
        out
    }
}

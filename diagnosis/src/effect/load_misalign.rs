//! `load_misalign`: the anterior-posterior force acts beside the axis of the tibia.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadMisalign {
    arm_mm: f64,
}

impl Force for LoadMisalign {
    fn force(&self, here: &Situation) -> Six {
        let mut out = Six::zeros();
        out[IE] = here.load[AP] * self.arm_mm;
        out
    }
}

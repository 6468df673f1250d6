//! `guarding_reflex`: hamstrings and quadriceps together pull against a drawer load.

use super::ham_tone::hamstring;
use super::quad_passive::patellar_tendon;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, Six};

/// Drawer load from which the muscles answer [N].
const THRESHOLD_N: f64 = 40.0;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GuardingReflex {
    /// Their pull by the load beyond the threshold [-].
    share: f64,
}

impl Force for GuardingReflex {
    fn force(&self, here: &Situation) -> Six {
        let over = (here.load[AP].abs() - THRESHOLD_N).max(0.0) * self.share;
        (patellar_tendon(here, 0.0, 0.0) + hamstring(here, true) * 0.5 + hamstring(here, false) * 0.5) * over
    }
}

//! `origin_shift`: recorded translations carry a constant offset.

use super::Reading;
use inference::trial::Trial;
use serde::Deserialize;
use sim::coordinate::{AP, ML, SI, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OriginShift {
    ml_mm: f64,
    ap_mm: f64,
    si_mm: f64,
}

impl Reading for OriginShift {
    fn read(&self, gs: &Six, _: &Trial) -> Six {
        let mut out = *gs;
        out[ML] += self.ml_mm;
        out[AP] += self.ap_mm;
        out[SI] += self.si_mm;
        out
    }
}

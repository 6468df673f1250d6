//! `flexion_offset`: the knee was more flexed than recorded, by the same angle in every trial.

use super::Reading;
use inference::trial::Trial;
use serde::Deserialize;
use sim::coordinate::{FE, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FlexionOffset {
    fe_deg: f64,
}

impl Reading for FlexionOffset {
    fn read(&self, gs: &Six, _: &Trial) -> Six {
        let mut out = *gs;
        out[FE] -= self.fe_deg.to_radians();
        out
    }
}

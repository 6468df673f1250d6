//! `strap_tissue`: soft tissue between strap and bone gives way and is read as motion of the joint.

use super::Reading;
use inference::trial::Trial;
use serde::Deserialize;
use sim::coordinate::{AP, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StrapTissue {
    /// How far the calf gives way to a forward pull [mm a 100 N].
    calf_mm_per_100n: f64,
    /// Where the strap lies before any load [mm].
    offset_mm: f64,
}

impl Reading for StrapTissue {
    fn read(&self, gs: &Six, trial: &Trial) -> Six {
        let (mut out, load) = (*gs, trial.load());
        // a backward push lies on the shin, which has hardly any tissue
        out[AP] += self.offset_mm + self.calf_mm_per_100n * load[AP].max(0.0) / 100.0;
        out
    }
}

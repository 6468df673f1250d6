//! `cuff_softening`: a cuff gives way at small load and then holds.

use super::Reading;
use inference::trial::Trial;
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six};

/// Load at which three quarters of the play are gone [N; N mm].
const GIVES_N: f64 = 20.0;
const GIVES_N_MM: f64 = 500.0;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CuffSoftening {
    ap_mm: f64,
    ie_deg: f64,
}

impl Reading for CuffSoftening {
    fn read(&self, gs: &Six, trial: &Trial) -> Six {
        let (mut out, load) = (*gs, trial.load());
        out[AP] += self.ap_mm * (load[AP] / GIVES_N).tanh();
        out[IE] += self.ie_deg.to_radians() * (load[IE] / GIVES_N_MM).tanh();
        out
    }
}

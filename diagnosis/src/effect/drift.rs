//! `drift`: the recorded load drifts with time.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Drift {
    ap_n: f64,
    ie_nm: f64,
}

impl Force for Drift {
    fn force(&self, here: &Situation) -> Six {
        let time = here.trial.time.unwrap_or(0.0);
        let mut out = Six::zeros();
        (out[AP], out[IE]) = (self.ap_n * time, self.ie_nm * 1000.0 * time);
        out
    }
}

//! `load_bias`: a constant beside the recorded load.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadBias {
    ap_n: f64,
    ie_nm: f64,
}

impl Force for LoadBias {
    fn force(&self, _: &Situation) -> Six {
        let mut out = Six::zeros();
        (out[AP], out[IE]) = (self.ap_n, self.ie_nm * 1000.0);
        out
    }
}

//! `friction`: resistance against the direction of motion.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Friction {
    ap_n: f64,
    ie_nm: f64,
}

impl Force for Friction {
    fn force(&self, here: &Situation) -> Six {
        let branch = here.trial.branch().unwrap_or(0.0);
        let way = |load: f64| if load == 0.0 { 0.0 } else { load.signum() };
        let mut out = Six::zeros();
        out[AP] = -branch * self.ap_n * way(here.load[AP]);
        out[IE] = -branch * self.ie_nm * 1000.0 * way(here.load[IE]);
        out
    }
}

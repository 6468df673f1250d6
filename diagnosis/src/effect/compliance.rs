//! `apparatus_compliance` and `bone_compliance`: what yields under load is read as motion, in proportion to the load.

use super::Reading;
use inference::trial::Trial;
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six, VV};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Compliance {
    ap_mm_per_100n: f64,
    ie_deg_per_nm: f64,
    vv_deg_per_nm: f64,
}

impl Reading for Compliance {
    fn read(&self, gs: &Six, trial: &Trial) -> Six {
        let (mut out, load) = (*gs, trial.load());
        out[AP] += self.ap_mm_per_100n * load[AP] / 100.0;
        out[IE] += self.ie_deg_per_nm.to_radians() * load[IE] / 1000.0;
        out[VV] += self.vv_deg_per_nm.to_radians() * load[VV] / 1000.0;
        out
    }
}

//! `capsule_envelope`: springs that stiffen with motion.

use super::fibres::About;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six, VV};

/// Motions at which a capsule of hardening 1 is twice as stiff [mm; rad].
const HARD_AP_MM: f64 = 10.0;
const HARD_IE: f64 = 0.3;
const HARD_VV: f64 = 0.15;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CapsuleEnvelope {
    variant: About,
    /// In anterior-posterior [N/mm].
    ap: f64,
    /// In rotation [N mm/rad].
    ie: f64,
    /// In varus-valgus [N mm/rad].
    vv: f64,
    /// How much stiffer they are further out [-].
    hardening: f64,
}

impl Force for CapsuleEnvelope {
    fn force(&self, here: &Situation) -> Six {
        let d = self.variant.away(here);
        let mut out = Six::zeros();
        for (k, hard, j) in [(self.ap, HARD_AP_MM, AP), (self.ie, HARD_IE, IE), (self.vv, HARD_VV, VV)] {
            out[j] = -k * d[j] * (1.0 + self.hardening.max(0.0) * (d[j] / hard).powi(2));
        }
        out
    }
    fn is_about_unloaded(&self) -> bool {
        self.variant == About::Unloaded
    }
}

//! `meniscus`: wedges round the two compartments that resist sliding on the plateau.

use super::fibres::About;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, ML, Six};

/// A meniscus' lever about the tibial axis [mm].
const LEVER_MM: f64 = 22.0;
/// Play before it resists about the unloaded pose [mm].
const PLAY_UNLOADED_MM: f64 = 1.5;
/// Play about the reference pose, where the condyles' rollback comes first [mm].
const PLAY_REFERENCE_MM: f64 = 5.0;
/// Overrun at which a meniscus of hardening 1 is twice as stiff [mm].
const OVERRUN_MM: f64 = 4.0;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Meniscus {
    variant: About,
    /// Stiffness [N/mm].
    k: f64,
    further_play_mm: f64,
    /// How much stiffer they are further out [-].
    hardening: f64,
    further_lever_mm: f64,
}

impl Force for Meniscus {
    fn force(&self, here: &Situation) -> Six {
        let d = self.variant.away(here);
        let play = match self.variant {
            About::Unloaded => PLAY_UNLOADED_MM,
            About::Reference => PLAY_REFERENCE_MM,
        };
        let (play, lever) = ((play + self.further_play_mm).max(0.0), (LEVER_MM + self.further_lever_mm).max(0.0));
        let mut out = Six::zeros();
        for arm in [lever, -lever] {
            let (across, along) = (d[ML], d[AP] + arm * d[IE]);
            let size = across.hypot(along);
            let over = (size - play).max(0.0);
            // a millimetre of onset, so that the slope is continuous
            let ramp = if over < 1.0 { 0.5 * over * over } else { over - 0.5 };
            let force = self.k * ramp * (1.0 + self.hardening.max(0.0) * over / OVERRUN_MM) / size.max(1e-9);
            out[ML] -= force * across;
            out[AP] -= force * along;
            out[IE] -= force * along * arm;
        }
        out
    }
    fn is_about_unloaded(&self) -> bool {
        self.variant == About::Unloaded
    }
}

//! `ham_tone`: a pull of the hamstrings.

use super::lines::pull;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HamTone {
    med_n: f64,
    lat_n: f64,
}

impl Force for HamTone {
    fn force(&self, here: &Situation) -> Six {
        hamstring(here, true) * self.med_n + hamstring(here, false) * self.lat_n
    }
}

/// Ischium, as the femur carries it.
const ISCHIUM: [f64; 3] = [30.0, -50.0, 360.0];

/// Semimembranosus and pes (medial), biceps (lateral).
pub(super) fn hamstring(here: &Situation, medial: bool) -> Six {
    pull(here, ISCHIUM, if medial { [22.0, -10.0, -30.0] } else { [-38.0, -20.0, -18.0] })
}

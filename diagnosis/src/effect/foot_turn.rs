//! `foot_turn`: foot and ankle turn before the shank does, and that is read as rotation of the joint.

use super::Reading;
use inference::trial::Trial;
use serde::Deserialize;
use sim::coordinate::{IE, Six};

/// Moment at which foot and ankle have turned by three quarters of what they ever do [N mm]. Ours: an ankle is stiff from some 5 N m on.
const TURNED_N_MM: f64 = 4000.0;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FootTurn {
    /// How far they turn outwards in the end [deg].
    out_deg: f64,
    /// And inwards [deg].
    in_deg: f64,
}

impl Reading for FootTurn {
    fn read(&self, gs: &Six, trial: &Trial) -> Six {
        let (mut out, moment) = (*gs, trial.load()[IE]);
        let end = if moment > 0.0 { self.out_deg } else { self.in_deg };
        out[IE] += end.to_radians() * (moment / TURNED_N_MM).tanh();
        out
    }
}

//! `load_axis`: the load turns with the shank, as a strap or a handle does that is fixed to it.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, ML, Six, VV};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadAxis {
    /// 1 where it turns with the shank in full [-].
    turns: f64,
}

impl Force for LoadAxis {
    fn force(&self, here: &Situation) -> Six {
        let rotation = here.q[IE] + here.model.joint.ct_pose()[IE];
        (turned(&here.load, rotation) - here.load) * self.turns
    }
}

/// The load about the joint's axes that acts along the shank's, which stands turned outwards by `rotation` [rad]. A recorded load acts along the floating
/// axis, which does not turn. Of a turned moment of varus or valgus the part about the axis of flexion is held by the apparatus.
fn turned(load: &Six, rotation: f64) -> Six {
    let (sin, cos) = rotation.sin_cos();
    let mut out = *load;
    out[VV] = load[VV] * cos;
    out[AP] = load[AP] * cos - load[ML] * sin;
    out[ML] = load[ML] * cos + load[AP] * sin;
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moments [N mm] and forces [N] of every axis.
    const LOAD: Six = Six::new(0.0, 8000.0, 3000.0, 12.0, 133.0, 20.0);

    #[test]
    fn a_shank_that_is_not_turned_gets_the_load_as_recorded() {
        assert_eq!(turned(&LOAD, 0.0), LOAD);
    }

    #[test]
    fn a_drawer_of_a_turned_shank_pulls_sideways_and_its_force_stays_as_large() {
        let drawer = Six::new(0.0, 0.0, 0.0, 0.0, 133.0, 0.0);
        // 45 N sideways at 20 deg, to the side that the foot points to
        assert!((turned(&drawer, 20f64.to_radians())[ML] - 45.5).abs() < 0.1);
        for rotation in [-0.6, -0.1, 0.2, 0.5] {
            let is = turned(&LOAD, rotation);
            assert!((is[ML].hypot(is[AP]) - LOAD[ML].hypot(LOAD[AP])).abs() < 1e-9, "{rotation}");
            // the other way round it is the load again
            let back = turned(&Six::new(0.0, 0.0, 0.0, is[3], is[4], 0.0), -rotation);
            assert!((back[ML] - LOAD[ML]).abs() < 1e-9 && (back[AP] - LOAD[AP]).abs() < 1e-9, "{rotation}");
            assert!((is[IE], is[5]) == (LOAD[IE], LOAD[5]) && is[VV].abs() < LOAD[VV].abs(), "{rotation}");
        }
    }
}

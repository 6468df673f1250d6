//! `load_sign`: the load of one axis was recorded with the opposite sign.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{AP, IE, Six, VV};

#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Axis {
    VarusValgus,
    Rotation,
    AnteriorPosterior,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadSign {
    variant: Axis,
    /// 1 where it is turned round in full [-].
    turned: f64,
}

impl Force for LoadSign {
    fn force(&self, here: &Situation) -> Six {
        let axis = match self.variant {
            Axis::VarusValgus => VV,
            Axis::Rotation => IE,
            Axis::AnteriorPosterior => AP,
        };
        let mut out = Six::zeros();
        out[axis] = -2.0 * self.turned * here.load[axis];
        out
    }
}

//! `itb`: a pull of the iliotibial band, from Gerdy's tubercle to the tensor.

use super::lines::pull;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Itb {
    force_n: f64,
}

impl Force for Itb {
    fn force(&self, here: &Situation) -> Six {
        pull(here, [-55.0, 10.0, 350.0], [-30.0, 18.0, -18.0]) * self.force_n
    }
}

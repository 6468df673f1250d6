//! `joint_compression`: the joint was pressed together by more than recorded.

use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::{SI, Six};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointCompression {
    si_n: f64,
}

impl Force for JointCompression {
    fn force(&self, _: &Situation) -> Six {
        let mut out = Six::zeros();
        out[SI] = self.si_n;
        out
    }
}

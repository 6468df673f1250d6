//! What stands between a knee and readings of displacements: the apparatus on the skin, and what a limb bears beside the load of the test.
//!
//! Each is a declared unknown with a prior, and is integrated over: an offset of each test as covariance of its readings, compliance and resting loads
//! as parameters.

use crate::error::CalibrationError;
use crate::targets::Targets;
use inference::knee::Quantity;
use inference::parameter::{Parameter, Prior};
use serde::{Deserialize, Serialize};
use sim::coordinate::{FREE, Free, Load, SI};

/// Priors of the apparatus and of the limb, for data sets of displacements; VV, IE, ML, AP, SI. 0 leaves one out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigOptions {
    /// Standard deviation of an offset that all readings of one test at one flexion share [deg, mm]: the device put on again. Half of the variance of
    /// the scatter between sessions; the other half is each reading's own (`targets.noise_of_displacements`).
    pub offset: Free<f64>,
    /// What the apparatus and the soft tissues yield beside the knee [deg/(N m), mm/N]: standard deviation of a half-normal prior. AP: 0.83 mm more than
    /// radiographs at 69 to 88 N [milano2022]; IE: up to 285 % more than CT at 15 N m [neumann2015]; others ours.
    pub compliance: Free<f64>,
    /// Load that the limb bears in all trials of a data set beside the recorded one [N m, N], standard deviation: weight of the shank (AP, normal) and
    /// tone of muscles (SI, half-normal: compression). Ours: a tenth of a shank and foot of 100 N, and twice the compression of the paper's protocols.
    pub resting: Load,
}

impl Default for RigOptions {
    fn default() -> Self {
        RigOptions {
            offset: Free([0.4, 1.4, 0.6, 0.7, 0.6]),
            compliance: Free([0.1, 1.0, 0.01, 0.013, 0.01]),
            resting: Load::new(0.0, 0.0, 0.0, 10.0, 40.0),
        }
    }
}

impl RigOptions {
    /// Refuses what is no standard deviation.
    pub(crate) fn check(&self) -> Result<(), CalibrationError> {
        for (name, all) in [("offset", self.offset), ("compliance", self.compliance), ("resting", *self.resting)] {
            if let Some(sd) = all.iter().find(|sd| !(**sd >= 0.0 && sd.is_finite())) {
                return Err(CalibrationError::Option(format!("rig.{name}: {sd}, expected 0 or more")));
            }
        }
        Ok(())
    }
}

/// Compliance and resting loads of every data set of displacements: of the coordinates that it reads under load.
pub(crate) fn parameters(sources: &[(String, Targets)], options: &RigOptions) -> Vec<Parameter<Quantity>> {
    let mut out = Vec::new();
    for (s, (name, targets)) in sources.iter().enumerate() {
        let displaced: Vec<_> = targets.trials.iter().filter(|t| t.reference.is_some()).collect();
        for c in FREE.into_iter().filter(|&c| options.compliance[c] > 0.0) {
            if displaced.iter().any(|t| t.measured[c].is_some() && t.load_step(c) != 0.0) {
                let name = format!("{name}.compliance.{}_per_{}", c.column(), c.load_suffix());
                let prior = Prior::HalfNormal { sd: options.compliance[c] };
                out.push(Parameter { name, quantity: Quantity::Compliance(s, c), prior });
            }
        }
        for c in FREE.into_iter().filter(|&c| options.resting[c] > 0.0 && !displaced.is_empty()) {
            let sd = options.resting[c];
            let prior = if c == SI { Prior::HalfNormal { sd } } else { Prior::Normal { mean: 0.0, sd } };
            let name = format!("{name}.resting.{c}_{}", c.load_suffix());
            out.push(Parameter { name, quantity: Quantity::Resting(s, c), prior });
        }
    }
    out
}

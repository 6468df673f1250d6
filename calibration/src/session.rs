//! A calibration of one model to one set of measured trials, from trials and options to the calibrated specification.

use crate::calibrate::{Calibrated, Checkpoint, Identity, Probes, calibrate};
use crate::cost::CostFunction;
use crate::design::{Design, Kind};
use crate::error::CalibrationError;
use crate::experiment::Experiment;
use crate::frames::FIRST;
use crate::knee::Knee;
use crate::options::{CalibrateOptions, Method};
use crate::posterior::ParameterEstimate;
use crate::problem::Problem;
use crate::targets::{Targets, targets};
use serde::{Deserialize, Serialize};
use sim::laxity::{LaxityTrial, Test};
use sim::spec::{ModelSpec, PoseSpec};
use std::ops::ControlFlow;

/// A calibration ready to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The design variables and their ranges.
    pub design: Design,
    /// The targets.
    pub targets: Targets,
    /// The cost.
    pub cost: CostFunction,
    identity: Identity,
    probes: Vec<LaxityTrial>,
}

/// A calibrated model and how it came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What was found.
    pub found: Calibrated,
    /// The model with the values chosen.
    pub spec: ModelSpec,
    /// The targets.
    pub trials: Vec<LaxityTrial>,
    /// What is odd but not fatal: about the targets, by row, then about the calibration.
    pub warnings: Vec<String>,
}

/// Anterior and posterior loads of 133 N at 30, 60 and 90 deg [andreassen2025, section 2.6.2], with 20 N of compression.
pub fn ap_probes() -> Vec<LaxityTrial> {
    let mut out = Vec::new();
    for (test, load) in [(Test::Anterior, 133.0), (Test::Posterior, -133.0)] {
        for fe_deg in [30.0, 60.0, 90.0] {
            out.push(LaxityTrial {
                trial: format!("{}_{fe_deg}", test.name()),
                test,
                nominal_flexion_deg: fe_deg,
                load: [0.0, 0.0, 0.0, load, 20.0],
                fe_deg,
                measured: [None; 5],
                sd: [None; 5],
                branch: None,
                order: None,
                time_s: None,
            });
        }
    }
    out
}

impl Session {
    /// Prepares a calibration of the model `spec`, whose digest is `model`, to measured trials.
    ///
    /// # Errors
    /// Unusable targets, by row; options out of range; a model without bundles of Table 3.
    pub fn new(
        spec: &ModelSpec,
        model: &str,
        measured: &[LaxityTrial],
        options: &CalibrateOptions,
    ) -> Result<Session, CalibrationError> {
        options.check()?;
        let ct: &PoseSpec = &spec.frames.gs_ct_pose;
        let mut design = Design::of_model(spec)?;
        if options.method == Method::Gradient && spec.frames.chain.is_none() {
            design = design.with_frames(&options.frames);
        }
        let design = design.with_ranges(&options.ranges)?;
        let targets = targets(measured, ct, &options.cost, &options.targets)?;
        let cost = CostFunction::new(&targets.trials, ct, &options.cost)?;
        let identity = Identity {
            model: model.to_owned(),
            design: design.clone(),
            start: design.values(spec),
            trials: targets.trials.clone(),
            options: options.clone(),
        };
        Ok(Session { design, targets, cost, identity, probes: ap_probes() })
    }

    /// The beginning, or a saved state to go on from.
    ///
    /// # Errors
    /// The state is of another calibration.
    pub fn begin(&self, saved: Option<&[u8]>) -> Result<Checkpoint, CalibrationError> {
        match saved {
            Some(bytes) => Checkpoint::from_bytes(bytes, &self.identity),
            None => Checkpoint::new(self.identity.clone()),
        }
    }

    /// Runs to the end; `watch` sees every state on the way and may stop it.
    ///
    /// # Errors
    /// A load belief about an unknown bundle; no point has an answer; stopped.
    pub fn run(
        &self,
        knee: &Knee,
        mut checkpoint: Checkpoint,
        watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>,
    ) -> Result<Outcome, CalibrationError> {
        let search = knee.searching(&self.design, &self.targets.trials);
        let search = Experiment { design: &self.design, simulate: &search, trials: self.targets.trials.len() };
        let in_full = knee.simulating(&self.design, &self.targets.trials);
        let in_full = Experiment { simulate: &in_full, ..search };
        let bundles = knee.model.bundle_names();
        let options = &self.identity.options;
        let problem = Problem::new((search, in_full), &self.targets, self.cost.clone(), &bundles, options)?;
        let names: Vec<String> = self.probes.iter().map(|t| t.trial.clone()).collect();
        let probed = knee.simulating(&self.design, &self.probes);
        let experiment = Experiment { design: &self.design, simulate: &probed, trials: self.probes.len() };
        let searched = knee.searching(&self.design, &self.probes);
        let probes = Probes { experiment, search: Experiment { simulate: &searched, ..experiment }, names: &names };
        let found = calibrate(&mut checkpoint, &problem, &probes, watch)?;
        let mut warnings = self.targets.warnings.clone();
        warnings.extend(found.warnings.iter().cloned());
        warnings.extend(off(&found.parameters));
        let spec = self.design.apply(&knee.spec, &found.values);
        Ok(Outcome { found, spec, trials: self.targets.trials.clone(), warnings })
    }
}

/// What is told of frames that stand off by more than a standard deviation.
fn off(parameters: &[ParameterEstimate]) -> Vec<String> {
    let far = |p: &&ParameterEstimate| p.number >= FIRST && p.value.abs() > p.range[1] / 3f64.sqrt();
    let words = |p: ParameterEstimate| {
        let turn = p.kind == Kind::FrameTurnDeg;
        let (way, unit) = if turn { ("turned about", "deg") } else { ("shifted along", "mm") };
        let (bone, axis) = p.bundle.split_once('.').unwrap_or((p.bundle.as_str(), ""));
        format!(
            "the {bone}'s frame fits the measured motion {way} its {axis} axis by {:.1} {unit} ({:.1} to {:.1})",
            p.value, p.lower, p.upper
        )
    };
    parameters.iter().filter(far).cloned().map(words).collect()
}

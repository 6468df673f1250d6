//! A calibration of one model to one set of measured trials, from trials and options to the calibrated specification.

use crate::calibrate::{Calibrated, Checkpoint, Identity, calibrate};
use crate::cost::CostFunction;
use crate::design::Design;
use crate::error::CalibrationError;
use crate::experiment::Experiment;
use crate::inferred::{DRAWER_N, DRAWERS_DEG, Question, inferred};
use crate::knee::Knee;
use crate::options::{CalibrateOptions, Method};
use crate::problem::{Probes, Problem};
use crate::shared::SharedPrior;
use crate::targets::{TargetOptions, Targets, targets};
use crate::unknowns::KnownFrames;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::Model;
use sim::SimError;
use sim::coordinate::Load;
use sim::laxity::{LaxityTrial, SignDoubt, Test, against_model};
use sim::spec::{FramesSpec, ModelSpec, PoseSpec};
use sim::trials::cannot_be_put;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// A calibration ready to run.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The design variables and their ranges.
    pub design: Design,
    /// The targets of each data set, by its name.
    pub sources: Vec<(String, Targets)>,
    /// The targets of all.
    pub targets: Targets,
    /// The cost.
    pub cost: CostFunction,
    identity: Identity,
    probes: Vec<LaxityTrial>,
    joint: Option<Joint>,
}

/// What all data sets together say of one of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Frames as this data set has them.
    pub frames: KnownFrames,
    /// Their most probable values, by name: a start.
    pub values: BTreeMap<String, f64>,
}

/// A calibrated model and how it came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// What was found.
    pub found: Calibrated,
    /// The model with the values chosen, in the frames that all data sets share.
    pub spec: ModelSpec,
    /// The targets, one data set after the other.
    pub trials: Vec<LaxityTrial>,
    /// Names of the data sets, and of each target its place among them.
    pub sources: (Vec<String>, Vec<usize>),
    /// Frames as each data set has them; empty where they were not inferred.
    pub frames: Vec<KnownFrames>,
    /// What is odd but not fatal: about the targets, by row, then about the calibration.
    pub warnings: Vec<Notice>,
}

impl Outcome {
    /// A target by its name, with its data set's where there are several.
    pub fn name_of(&self, target: usize) -> String {
        let ((names, of), trial) = (&self.sources, &self.trials[target].trial);
        if names.len() > 1 { format!("{}/{trial}", names[of[target]]) } else { trial.clone() }
    }

    /// The trials of each data set, by its name.
    pub fn data_sets(&self) -> Vec<(&str, Vec<&LaxityTrial>)> {
        let (names, of) = &self.sources;
        let mine = |s: usize| self.trials.iter().zip(of).filter(move |(_, of)| **of == s).map(|(t, _)| t).collect();
        names.iter().enumerate().map(|(s, name)| (name.as_str(), mine(s))).collect()
    }

    /// The data sets in words, each with what was cut before it: "rks and rks_acl (without ACL)".
    pub fn in_words(&self) -> String {
        let one = |(name, trials): (&str, Vec<&LaxityTrial>)| match trials.first() {
            Some(t) if !t.without.is_empty() => format!("{name} (without {})", t.without.join(" and ")),
            _ => name.to_owned(),
        };
        self.data_sets().into_iter().map(one).collect::<Vec<_>>().join(" and ")
    }

    /// The frames in which a data set reads poses: `assembled`, those of the model before its calibration, with the most probable turns and shifts of all
    /// data sets and its own. A recipe takes frames as given.
    ///
    /// # Errors
    /// Frames that make no joint.
    pub fn frames_of(&self, source: usize, assembled: &FramesSpec) -> Result<FramesSpec, SimError> {
        self.found.unknowns.frames_of(source, assembled, self.spec.side)
    }
}

/// Anterior and posterior loads of 133 N at 30, 60 and 90 deg [andreassen2025, section 2.6.2], with 20 N of compression.
pub fn ap_probes() -> Vec<LaxityTrial> {
    let mut out = Vec::new();
    for (test, load) in [(Test::Anterior, DRAWER_N), (Test::Posterior, -DRAWER_N)] {
        for fe_deg in DRAWERS_DEG {
            let name = format!("{}_{fe_deg}", test.name());
            out.push(LaxityTrial::asked(name, test, fe_deg, Load::new(0.0, 0.0, 0.0, load, 20.0)));
        }
    }
    out
}

impl Session {
    /// Prepares a calibration of the model `spec`, whose digest is `model`, to measured trials of data sets by their names.
    ///
    /// # Errors
    /// Unusable targets, by row; options out of range; a model without bundles of Table 3; several data sets for a recipe that knows one.
    pub fn new(
        spec: &ModelSpec,
        model: &str,
        measured: &[(String, Vec<LaxityTrial>)],
        options: &CalibrateOptions,
    ) -> Result<Session, CalibrationError> {
        options.check()?;
        match &options.shared_prior {
            Some(SharedPrior::Read(shared)) => shared.is_for(spec)?,
            Some(SharedPrior::File(path)) => {
                return Err(CalibrationError::Option(format!(
                    "shared_prior: {path} was not read; give what stands in it"
                )));
            }
            None => {}
        }
        if measured.len() > 1 && options.method != Method::Posterior {
            let what = "method: a recipe takes one data set; several together are for the method posterior";
            return Err(CalibrationError::Option(what.into()));
        }
        let ct: &PoseSpec = &spec.frames.gs_ct_pose;
        let design = Design::of_model(spec)?.with_ranges(&options.ranges)?;
        let mut sources = Vec::new();
        for (name, trials) in measured {
            let of = targets(trials, ct, &options.cost, &options.targets).map_err(|e| match e {
                CalibrationError::Targets(what) if measured.len() > 1 => {
                    CalibrationError::Targets(format!("{name}: {what}"))
                }
                other => other,
            })?;
            sources.push((name.clone(), of));
        }
        let targets = together(&sources, &options.targets);
        let cost = CostFunction::new(&targets.trials, ct, &options.cost)?;
        let identity = Identity {
            model: model.to_owned(),
            design: design.clone(),
            start: design.values(spec),
            trials: targets.trials.clone(),
            options: options.clone(),
        };
        Ok(Session { design, sources, targets, cost, identity, probes: ap_probes(), joint: None })
    }

    /// The same where all data sets together have been calibrated to already.
    #[must_use]
    pub fn after(self, joint: Joint) -> Session {
        Session { joint: Some(joint), ..self }
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
        checkpoint: Checkpoint,
        watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>,
    ) -> Result<Outcome, CalibrationError> {
        self.run_told(knee, checkpoint, watch, &|_, _| ())
    }

    /// [`Session::run`]; `on_fit` is told of every fit of the method posterior that has ended, on whatever thread: how many, and of how many.
    ///
    /// # Errors
    /// Those of [`Session::run`].
    pub fn run_told(
        &self,
        knee: &Knee,
        mut checkpoint: Checkpoint,
        watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>,
        on_fit: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Outcome, CalibrationError> {
        self.is_for(&knee.model)?;
        if self.identity.options.method == Method::Posterior {
            return self.infer(knee, &checkpoint, watch, on_fit);
        }
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
        let spec = self.design.apply(&knee.spec, &found.values);
        Ok(self.outcome(found, spec, vec![]))
    }

    /// Refuses trials of what the model does not have: a ligament that was cut, a patella that is pulled.
    fn is_for(&self, model: &Model) -> Result<(), CalibrationError> {
        let fault = |(name, targets): &(String, Targets)| {
            let of = if self.sources.len() > 1 { format!("{name}: ") } else { String::new() };
            Some(CalibrationError::Targets(of + &cannot_be_put(model, &targets.trials)?))
        };
        self.sources.iter().find_map(fault).map_or(Ok(()), Err)
    }

    /// The posterior, in one go.
    fn infer(
        &self,
        knee: &Knee,
        checkpoint: &Checkpoint,
        watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>,
        on_fit: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Outcome, CalibrationError> {
        if watch(checkpoint).is_break() {
            return Err(CalibrationError::Stopped);
        }
        let (sources, options) = (&self.sources, &self.identity.options);
        let (frames, joint) = (self.joint.as_ref().map(|j| &j.frames), self.joint.as_ref().map(|j| &j.values));
        let design = &self.design;
        let question = Question { knee, design, sources, cost: &self.cost, options, frames, joint, on_fit };
        let found = inferred(&question)?;
        Ok(self.outcome(found.found, found.spec, found.frames))
    }

    /// Data sets in which the tibia goes to the other side than the calibrated model's.
    fn sides(&self, found: &Calibrated) -> Vec<Notice> {
        let mut from = 0;
        let mut told = Vec::new();
        for (name, targets) in &self.sources {
            let to = from + targets.trials.len();
            let answers = found.predicted.get(from..to).unwrap_or_default();
            let doubt = against_model(&targets.trials, answers).map(SignDoubt::notice);
            told.extend(doubt.map(|n| if self.sources.len() > 1 { n.whose(name) } else { n }));
            from = to;
        }
        told
    }

    /// Measured loads whose path ends elsewhere than the search has it.
    fn elsewhere(&self, found: &Calibrated) -> Option<Notice> {
        let all = self.sources.iter().flat_map(|(name, t)| t.trials.iter().map(move |trial| (name, &trial.trial)));
        let all: Vec<(&String, &String)> = all.collect();
        let named =
            |&i: &usize| if self.sources.len() > 1 { format!("{}/{}", all[i].0, all[i].1) } else { all[i].1.clone() };
        let names: Vec<String> = found.elsewhere.iter().map(named).collect();
        (!names.is_empty()).then(|| {
            let text = format!(
                "the path of {} of {} measured loads ends in another equilibrium, far from the measured one ({}): the search, which begins close by, holds the knee where it was measured. These loads are not in the misfit; what the model says of loads near them is unreliable",
                names.len(),
                self.targets.trials.len(),
                names.join(", ")
            );
            Kind::PathEndsElsewhere.notice(text).count(names.len())
        })
    }

    fn outcome(&self, found: Calibrated, spec: ModelSpec, frames: Vec<KnownFrames>) -> Outcome {
        let mut warnings = self.targets.warnings.clone();
        warnings.extend(found.warnings.iter().cloned());
        warnings.extend(self.sides(&found));
        warnings.extend(self.elsewhere(&found));
        let names = self.sources.iter().map(|s| s.0.clone()).collect();
        let of = self.sources.iter().enumerate().flat_map(|(s, (_, t))| vec![s; t.trials.len()]).collect();
        Outcome { found, spec, trials: self.targets.trials.clone(), sources: (names, of), frames, warnings }
    }
}

/// The targets of all data sets, one after the other; warnings say whose they are where there are several.
fn together(sources: &[(String, Targets)], options: &TargetOptions) -> Targets {
    let mut out = Targets::none(options);
    for (name, t) in sources {
        out.trials.extend(t.trials.iter().cloned());
        let told = |w: &Notice| if sources.len() > 1 { w.clone().whose(name) } else { w.clone() };
        out.warnings.extend(t.warnings.iter().map(told));
    }
    out
}

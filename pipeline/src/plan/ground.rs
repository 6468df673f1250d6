//! What all plans share that cut the same of one knee and test it alike: bones, models, and what the knee does before a graft is in.

use super::file::PlanFile;
use super::knee::{Asked, Found, Placed, Surfaces, cut, for_solver, placed, tests};
use super::numbers::Numbers;
use super::sampled::{Sampled, SampledBefore};
use super::sites::{Bone, bones};
use calibration::samples::Samples;
use sim::SimError;
use sim::graft::{Graft, with_grafts};
use sim::jumps::flag_jumps;
use sim::laxity::{LaxityTrial, TrialResult};
use sim::model::{Model, compile};
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};

/// Share of the samples between the ends of an interval where no samples tell it [-].
const INTERVAL: f64 = 0.9;

/// A knee on which plans are tried that differ in their grafts alone.
pub(super) struct Ground<'a> {
    spec: &'a ModelSpec,
    /// Femur and tibia.
    pub(super) bones: [Bone<'a>; 2],
    /// By the final mechanics; nothing is cut.
    model: Model,
    /// Bundles that are cut.
    pub(super) cut: Vec<String>,
    /// The tests.
    pub(super) asked: Vec<Asked>,
    trials: Vec<LaxityTrial>,
}

/// What the knee does before a graft is in: intact and deficient.
pub(super) struct Before {
    best: [Vec<Option<Found>>; 2],
    /// None where no samples are asked; else they, or why they say nothing.
    sampled: Option<Result<SampledBefore, String>>,
    /// Share of the samples between the ends of an interval [-].
    pub(super) interval: f64,
}

/// A knee with its grafts put in and fixed.
pub(super) struct Knee {
    /// What is cut is cut, and the grafts are in.
    reconstructed: Model,
    /// Slack length of each graft as it was fixed [mm].
    pub(super) slack_mm: Vec<f64>,
    /// The grafts as they are put in.
    grafts: Vec<Graft>,
    /// Where they are.
    pub(super) placed: Vec<Placed>,
}

impl<'a> Ground<'a> {
    /// Of a knee, for a plan and all that differ from it in their grafts alone.
    ///
    /// # Errors
    /// A name of no ligament, a bone that is no surface, a model that does not compile: a sentence.
    pub(super) fn new(spec: &'a ModelSpec, surfaces: &'a Surfaces, file: &PlanFile) -> Result<Ground<'a>, String> {
        let bones = bones(spec, surfaces)?;
        let model = compile(spec, surfaces).map_err(|e| e.to_string())?;
        let asked = tests(&file.tests);
        let trials = asked.iter().map(|a| a.trial.clone()).collect();
        Ok(Ground { spec, bones, model, cut: cut(spec, file)?, asked, trials })
    }

    /// Where the grafts of a plan leave the bones.
    ///
    /// # Errors
    /// A site that is none: a sentence.
    pub(super) fn placed(&self, file: &PlanFile) -> Result<Vec<Placed>, String> {
        file.graft.iter().map(|g| placed(self.spec, &self.bones, g)).collect()
    }

    /// Puts in the grafts of a plan and fixes them.
    ///
    /// # Errors
    /// A site that is none, a tension that is out of reach, a knee without equilibrium: a sentence.
    pub(super) fn operated(&self, file: &PlanFile) -> Result<Knee, String> {
        // what is at fault names its graft
        let told = |e: SimError| match e {
            SimError::Input(told) => told,
            other => other.to_string(),
        };
        let placed = self.placed(file)?;
        let one = |(g, p)| for_solver(g, p, file.tests.compression_n);
        let grafts: Vec<Graft> = file.graft.iter().zip(&placed).map(one).collect();
        let model = with_grafts(&self.model, &grafts, &self.cut, None).map_err(told)?;
        let slack_mm = model.bundles[self.model.bundles.len()..].iter().map(|b| b.slack_length()).collect();
        Ok(Knee { reconstructed: model.without(&self.cut).map_err(told)?, slack_mm, grafts, placed })
    }

    /// Asks the knee every test before a graft is in: the most probable one, and the samples where there are any.
    pub(super) fn before(&self, surfaces: &Surfaces, samples: Option<Samples>) -> Before {
        let intact = self.answers(&self.model);
        // its names are the model's own
        let deficient = self.model.without(&self.cut).map_or_else(|_| vec![], |model| self.answers(&model));
        let interval = samples.as_ref().map_or(INTERVAL, |s| s.of.interval);
        let best = [intact, deficient];
        let asked = |s: Samples| SampledBefore::of(s, surfaces, (&self.trials, &self.cut), [&best[0], &best[1]]);
        let sampled = samples.map(asked);
        Before { best, sampled, interval }
    }

    /// All numbers of a plan, and why there are no intervals where samples were asked in vain.
    pub(super) fn numbers(&self, before: &Before, knee: &Knee) -> (Numbers, Option<String>) {
        let [intact, deficient] = before.best.clone();
        // without a graft it is the knee that was cut
        let with = if knee.grafts.is_empty() { deficient.clone() } else { self.answers(&knee.reconstructed) };
        let asked = (self.trials.as_slice(), self.cut.as_slice());
        let sampled = match &before.sampled {
            None => Ok(None),
            Some(Err(e)) => Err(e.clone()),
            Some(Ok(samples)) => samples.with(&knee.grafts, asked, &with).map(Some),
        };
        let fault = sampled.as_ref().err().cloned();
        let sampled: Option<Sampled> = sampled.unwrap_or(None);
        (Numbers { best: [intact, deficient, with], sampled }, fault)
    }

    /// What a model answers to every test, along the paths of loading.
    fn answers(&self, model: &Model) -> Vec<Option<Found>> {
        let bundles = model.bundle_names();
        let answers = solve_trials(model, &self.trials, &TrialOptions::default());
        let answered = answers.into_iter().zip(&self.trials).enumerate();
        let (at, mut results): (Vec<usize>, Vec<TrialResult>) =
            answered.filter_map(|(t, (answer, trial))| Some((t, answer.ok()?.result(trial)))).unzip();
        flag_jumps(&mut results);
        let mut out = vec![None; self.trials.len()];
        for (t, r) in at.into_iter().zip(results) {
            out[t] = Some(Found { pose: r.predicted(), told: r.columns(&bundles), flags: r.flags });
        }
        out
    }
}

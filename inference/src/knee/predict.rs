//! What a knee known by samples does in trials that nobody measured: equilibria at every sample, found from those of a point close by.

use super::{Answers, Knee, Trials};
use crate::jacobian::pressed;
use crate::trial::Trial;
use nalgebra::DVector;
use rayon::prelude::*;
use sim::SimError;
use sim::contact::Nearby;
use sim::coordinate::{Free, Six};
use sim::flags::Flag;
use sim::model::{Evaluation, Model};
use sim::quasistatic::{Goal, State, close, increment_near};
use sim::trials::{chain_flexion, flags, pose_spec, solve_trial};
use std::ops::Range;

/// Prediction of a trial at a sample.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// VV, IE [deg], ML, AP, SI [mm].
    pub pose: Free<f64>,
    /// Bundle forces [N].
    pub forces_n: Vec<f64>,
    /// What cartilage and other bodies tell: names with their units, values.
    pub outputs: Vec<(String, f64)>,
    /// Whether the femur has left the plateau.
    pub leaves_the_plateau: bool,
    /// Whether the knee is subluxed: one compartment bears at its rim, or next to nothing far from the CT pose.
    pub is_subluxed: bool,
    /// Whether the tibia is turned further than knees turn.
    pub is_rotated: bool,
}

/// Times that the contact force turned by a leaning surface is brought up to date [-]: a lean of some hundredths makes each error a hundred times less.
const LEAN_ROUNDS: usize = 2;

impl Trials<'_> {
    /// Predictions of all trials at values `z`, from the answers at `near`; `None` where the knee has no equilibrium.
    ///
    /// # Errors
    /// Values at which there is no knee.
    pub fn predicted(
        &self,
        z: &DVector<f64>,
        near: (&DVector<f64>, &Answers),
    ) -> Result<Vec<Option<Prediction>>, SimError> {
        let knee = self.knee(self.values(z).into_iter().map(|v| v.0).collect())?;
        let before = self.knee(self.values(near.0).into_iter().map(|v| v.0).collect())?;
        let of = |(trial, answer): (&Trial, &super::Answer)| {
            let start = self.start(&knee, &before, trial, answer).ok();
            let near = || answer.near.clone();
            let found = start.and_then(|q| self.prediction(&knee, trial, q, (answer.pressed, near())).ok());
            found.or_else(|| {
                let (q, force) = self.along_the_path(&knee, trial).ok()?;
                self.prediction(&knee, trial, q, (force, near())).ok()
            })
        };
        Ok(self.trials.par_iter().zip(near.1).map(of).collect())
    }

    /// The answer along the path of a trial's loading, as coordinates and contact force.
    fn along_the_path(&self, knee: &Knee, trial: &Trial) -> Result<(Six, f64), SimError> {
        let found = solve_trial(knee.of(trial).0, &self.bearing(&knee.values, trial), self.options)?;
        Ok((found.state.q, pressed(&found.evaluation)))
    }

    /// A trial's equilibrium from coordinates close by. The lean of the bearing surface turns a part of the contact force, which is `force` at first and
    /// then what was found.
    fn prediction(
        &self,
        knee: &Knee,
        trial: &Trial,
        start: Six,
        (force, mut near): (f64, Nearby),
    ) -> Result<Prediction, SimError> {
        let (model, _) = knee.of(trial);
        let model = &*model.in_trial(&trial.record)?;
        let lean = self.lean(&knee.values, trial.record.fe_deg);
        let flexion = chain_flexion(model, trial.record.fe_deg, self.options)?;
        let borne = self.borne(&knee.values, trial).generalised();
        let goal = |force: f64| Goal { flexion, load: borne + lean * force, flow: None };
        let (mut start, mut force) = (start, force);
        if lean != Six::zeros() {
            for _ in 0..LEAN_ROUNDS {
                let solved = close(model, start, &goal(force), &self.options.solver, &mut near)?;
                (start, force) = (solved.state.q, pressed(&solved.evaluation));
            }
        }
        let solved = increment_near(model, &State::at(start), &goal(force), &self.options.solver, true, &mut near)?;
        let gs = model.joint.grood_suntay(&solved.state.q);
        let odd = flags(model, &gs, &solved.evaluation, self.options);
        Ok(Prediction {
            pose: pose_spec(&gs).free(),
            forces_n: model.bundle_forces(&solved.evaluation.fibres),
            outputs: model.outputs(&solved.evaluation),
            leaves_the_plateau: odd.contains(&Flag::Dislocated),
            is_subluxed: odd.contains(&Flag::Subluxed),
            is_rotated: odd.contains(&Flag::Rotated),
        })
    }

    /// Whether the femur has left the plateau in an answer at Grood-Suntay coordinates `gs`.
    fn is_off_the_plateau(&self, model: &Model, gs: &Six, evaluation: &Evaluation) -> bool {
        flags(model, gs, evaluation, self.options).contains(&Flag::Dislocated)
    }

    /// Whether the femur has left the plateau in the trials at `places`, of the knee at values `z` with the answers `found`; `None` where there is no
    /// such knee.
    pub fn leaving(&self, z: &DVector<f64>, found: &Answers, places: Range<usize>) -> Vec<Option<bool>> {
        let knee = self.knee(self.values(z).into_iter().map(|v| v.0).collect()).ok();
        let of = |i: usize| {
            let trial = &self.trials[i];
            let model = &*knee.as_ref()?.of(trial).0.in_trial(&trial.record).ok()?;
            let q = &found[i].q;
            Some(self.is_off_the_plateau(model, &model.joint.grood_suntay(q), &model.evaluate(q)))
        };
        places.map(of).collect()
    }
}

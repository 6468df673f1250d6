//! A trial put to a knee: the model's equilibria under its load and the effects of a hypothesis.

use crate::effect::{Active, Place};
use inference::trial::Trial;
use nalgebra::Matrix6;
use sim::Model;
use sim::coordinate::Six;
use sim::equilibrium::{Ask, Equilibrium, Restraint, Rig, Start};
use std::borrow::Cow;

/// Force at which a spring that holds the measured pose gives way by the noise [N].
const HOLD_N: f64 = 100.0;

/// The knee that a trial is put to.
#[derive(Clone, Copy)]
pub struct Bench<'a> {
    /// The model with the hypothesis' ligaments.
    pub model: &'a Model,
    /// The effects that act in this trial's data set.
    pub effects: &'a [Active],
    /// Anatomical frames, for the effects.
    pub place: &'a Place,
}

impl Bench<'_> {
    /// Something done with the knee as the solver sees it.
    fn rigged<T>(&self, trial: &Trial, act: impl FnOnce(&Rig) -> T) -> T {
        // a tension that the model itself can carry is no force beside it
        let is_beside = |effect: &&Active| effect.has_force() && effect.tension(self.model, trial) == 0.0;
        let field = |load: &Six, q: &Six| {
            let here = self.place.situation(self.model, trial, load, q);
            self.effects.iter().filter(is_beside).fold(Six::zeros(), |sum, effect| sum + effect.force(&here))
        };
        let reading = |gs: &Six| self.effects.iter().fold(*gs, |gs, effect| effect.read(&gs, trial));
        let (has_force, has_reading) =
            (self.effects.iter().any(|e| is_beside(&e)), self.effects.iter().any(Active::has_reading));
        act(&Rig {
            model: &self.pulled(trial),
            field: if has_force { Some(&field) } else { None },
            reading: if has_reading { Some(&reading) } else { None },
        })
    }

    /// The model under the tension of the quadriceps in a trial, that of effects included.
    pub fn pulled(&self, trial: &Trial) -> Cow<'_, Model> {
        let more: f64 = self.effects.iter().map(|e| e.tension(self.model, trial)).sum();
        // a model without a patella was refused where the question was put
        self.model.pulled((trial.record.quadriceps_n + more).max(0.0)).unwrap_or(Cow::Borrowed(self.model))
    }

    /// Share of a bundle's force that the effects leave it [-].
    pub fn left(&self, bundle: usize) -> f64 {
        let name = &self.model.bundles[bundle].name;
        1.0 - self.effects.iter().map(|e| e.lost(name)).sum::<f64>()
    }

    /// The equilibrium under `trial`, from nearby coordinates.
    pub fn settle(&self, trial: &Trial, start: &Start) -> Equilibrium {
        self.rigged(trial, |rig| rig.settle(&asked(trial), start))
    }

    /// The whole way from the CT pose.
    pub fn walk(&self, trial: &Trial) -> Equilibrium {
        self.rigged(trial, |rig| rig.walk(&asked(trial)))
    }

    /// The first part of that way, to the trial's flexion under its compression alone.
    pub fn flexed(&self, trial: &Trial) -> Start {
        self.rigged(trial, |rig| rig.flexed(&asked(trial)))
    }

    /// Its second part, from there to the trial's load.
    pub fn loaded(&self, trial: &Trial, from: &Start) -> Equilibrium {
        self.rigged(trial, |rig| rig.loaded(&asked(trial), from))
    }

    /// Only compression and flexion: the pose from which the trial's load departs.
    pub fn neutral(&self, trial: &Trial) -> Equilibrium {
        self.walk(&trial.compressed())
    }

    /// The same from the trial's own unloaded pose.
    pub fn neutral_near(&self, trial: &Trial) -> Equilibrium {
        self.settle(&trial.compressed(), &trial.unloaded)
    }

    /// The pose from `start` that reads next to what was `measured` (Grood-Suntay coordinates [rad, mm]), held there by springs that give way by about
    /// the measurement's noise: what is then out of balance is what the model lacks in that trial, however far it would move the knee.
    pub fn held(&self, trial: &Trial, measured: &Six, start: &Start) -> Equilibrium {
        self.rigged(trial, |rig| rig.restrained(&asked(trial), &restraint(trial, measured), start))
    }

    /// The equilibrium that is reached when those springs are let go little by little.
    pub fn released(&self, trial: &Trial, measured: &Six, start: &Start) -> Equilibrium {
        self.rigged(trial, |rig| rig.released(&asked(trial), &restraint(trial, measured), start))
    }

    /// A tangent no less stiff, in any direction, than springs that give way by some ten noises under the force that holds a pose.
    pub fn stiffened(&self, trial: &Trial, tangent: &Matrix6<f64>) -> Matrix6<f64> {
        restraint(trial, &Six::zeros()).stiffened(tangent)
    }

    /// Generalised force of the effects beside the recorded load, but for what [`Bench::pulled`] has in the model.
    pub fn effects_at(&self, trial: &Trial, load: &Six, q: &Six) -> Six {
        self.rigged(trial, |rig| rig.external(load, q))
    }

    /// Its derivative by the coordinates.
    pub fn effects_tangent(&self, trial: &Trial, load: &Six, q: &Six) -> Matrix6<f64> {
        self.rigged(trial, |rig| rig.external_tangent(load, q))
    }

    /// Derivative of the reading by the coordinates.
    pub fn observe_derivative(&self, trial: &Trial, q: &Six) -> Matrix6<f64> {
        self.rigged(trial, |rig| rig.observe_derivative(q))
    }
}

fn asked(trial: &Trial) -> Ask {
    Ask { load: trial.load(), flexion: trial.flexion() }
}

fn restraint(trial: &Trial, measured: &Six) -> Restraint {
    Restraint { to: *measured, gives: trial.sd, hold_n: HOLD_N }
}

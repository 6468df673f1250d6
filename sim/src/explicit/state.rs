//! Where a run stands.

use super::energy::Energies;
use crate::contact::{FrictionState, Nearby};
use crate::coordinate::Six;
use crate::model::Model;
use serde::{Deserialize, Serialize};

/// All that a run depends on from here: it can be written, read and run on to the same bytes (in an encoding that keeps every bit).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExplicitState {
    /// Index of the step.
    pub step: usize,
    /// Time in the step [s].
    pub time_s: f64,
    /// Increments done, all steps together.
    pub increments: usize,
    /// Coordinates, displacements from the CT pose [rad, mm].
    pub q: Six,
    /// Their rates at the last half increment [rad/s, mm/s].
    pub rate: Six,
    /// Energies.
    pub energies: Energies,
    /// Coordinates at the start of the step; `None` before its first increment.
    pub(crate) step_start: Option<Six>,
    /// Angular (about the femur's centre) and linear momentum at the last half increment [tonne mm2/s, tonne mm/s].
    pub(crate) momentum: Six,
    /// Length of the last increment [s]; 0 at the start.
    pub(crate) last_increment_s: f64,
    /// Change of the coordinates over it.
    pub(crate) last_step: Six,
    /// Tangential forces held by the contact before it.
    pub(crate) friction: FrictionState,
    /// Generalised loads and reactions, damping and friction at the last node [N mm, N].
    pub(crate) last_forces: [Six; 3],
}

impl ExplicitState {
    /// At rest in the CT pose.
    pub fn at_rest() -> Self {
        ExplicitState::default()
    }

    /// Moving from coordinates `q` at `rate`.
    pub fn moving(model: &Model, mass_scale: f64, q: Six, rate: Six) -> Self {
        let (mass, inertia) = model.femur_mass;
        let twist = super::twist::twists(model, &model.joint.pose(&q)) * rate;
        let momentum = super::twist::mass_times(&twist, mass * mass_scale, inertia * mass_scale);
        ExplicitState { q, rate, momentum, ..ExplicitState::default() }
    }

    /// The same place at the start of a program.
    pub fn restarted(&self) -> Self {
        ExplicitState { step: 0, time_s: 0.0, step_start: None, ..self.clone() }
    }

    /// The same place at the start of a program, moving the other way.
    pub fn reversed(&self) -> Self {
        ExplicitState { rate: -self.rate, momentum: -self.momentum, ..self.restarted() }
    }

    /// Angular (about the femur's centre) and linear momentum at the last half increment [tonne mm2/s, tonne mm/s].
    pub fn momentum(&self) -> Six {
        self.momentum
    }

    /// First increment of a step: where it starts from, and what failures and newly defined contact change at once. `before` and `now`
    /// are the model and whether contact is defined.
    pub(super) fn begin(&mut self, before: (&Model, bool), now: (&Model, bool)) {
        if self.step_start.is_some() {
            return;
        }
        self.step_start = Some(self.q);
        let stored = |(model, contact): (&Model, bool)| {
            let pose = model.joint.pose(&self.q);
            let strain: f64 = model.fibre_states(&pose).iter().map(|f| f.response.energy).sum();
            if !contact {
                return strain;
            }
            let bodies = model.bodies_near((&self.q, &pose), &mut Nearby::once());
            strain + model.contact.press(&pose).energy + bodies.iter().map(|b| b.energy).sum::<f64>()
        };
        let held = stored(before);
        if self.increments == 0 {
            self.energies.initial = held;
        }
        self.energies.released += held - stored(now);
    }

    /// End of a step.
    pub(super) fn end(&mut self) {
        (self.step, self.time_s, self.step_start) = (self.step + 1, 0.0, None);
    }
}

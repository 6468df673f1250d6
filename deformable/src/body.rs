//! Rigid bodies: fixed, moved along a path, or loaded.

use meshes::{Isometry, Point, Vector};
use nalgebra::{Translation3, UnitQuaternion};

/// A smooth step in time: `10 s^3 - 15 s^4 + 6 s^5` of `s` from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// When it begins [s].
    pub start_s: f64,
    /// When it ends [s].
    pub end_s: f64,
    /// Value before.
    pub from: f64,
    /// Value after.
    pub to: f64,
}

impl Ramp {
    /// The value at all times.
    pub fn constant(value: f64) -> Ramp {
        Ramp { start_s: 0.0, end_s: 0.0, from: value, to: value }
    }

    /// From 0 to 1 over a duration [s].
    pub fn over(duration_s: f64) -> Ramp {
        Ramp { start_s: 0.0, end_s: duration_s, from: 0.0, to: 1.0 }
    }

    /// Value at `time` [s].
    pub fn at(&self, time: f64) -> f64 {
        let s = if time >= self.end_s {
            1.0
        } else {
            ((time - self.start_s) / (self.end_s - self.start_s)).clamp(0.0, 1.0)
        };
        self.from + (self.to - self.from) * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
    }
}

/// How a body moves.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// Not at all.
    Fixed,
    /// Turned about a point, then shifted, by shares that a ramp gives.
    Prescribed {
        /// Whole turn, axis times angle [rad].
        turn: Vector,
        /// The point turned about [mm].
        about: Point,
        /// Whole shift [mm].
        shift: Vector,
        /// The share.
        ramp: Ramp,
    },
    /// Free under a load; guided along a direction where one is given, otherwise with six degrees of freedom.
    Loaded {
        /// Its own mass [tonne].
        mass_tonne: f64,
        /// Its own rotary inertia, the same about every axis [tonne mm2].
        inertia_tonne_mm2: f64,
        /// Its centre [mm].
        centre: Point,
        /// Unit direction that it is guided along.
        guide: Option<Vector>,
        /// Whole force at the centre [N].
        force: Vector,
        /// Whole moment [N mm].
        moment: Vector,
        /// The share of force and moment.
        ramp: Ramp,
    },
}

/// A body under way.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BodyState {
    /// From its start.
    pub(super) pose: Isometry,
    /// Velocity of its centre [mm/s] and turning rate [rad/s], half an increment back.
    pub(super) velocity: Vector,
    pub(super) spin: Vector,
    /// The same an increment back.
    before: (Vector, Vector),
    /// Force of what it carries and its moment about the CT origin [N, N mm].
    pub(super) force: Vector,
    pub(super) moment: Vector,
    /// Mass and rotary inertia of the nodes it carries, about its centre.
    pub(super) carried: (f64, f64),
    /// Work of its load so far, and what its damping took [N mm].
    pub(super) work: f64,
    pub(super) damped: f64,
}

impl BodyState {
    pub(super) fn new(carried: (f64, f64)) -> BodyState {
        BodyState {
            pose: Isometry::identity(),
            velocity: Vector::zeros(),
            spin: Vector::zeros(),
            before: (Vector::zeros(), Vector::zeros()),
            force: Vector::zeros(),
            moment: Vector::zeros(),
            carried,
            work: 0.0,
            damped: 0.0,
        }
    }

    /// Moves it to `time`, an increment on, with mass damping `alpha`.
    pub(super) fn advance(&mut self, motion: &Motion, (time, dt): (f64, f64), alpha: f64) {
        match motion {
            Motion::Fixed => {}
            Motion::Prescribed { turn, about, shift, ramp } => {
                let share = ramp.at(time);
                let turn = UnitQuaternion::from_scaled_axis(turn * share);
                let move_back = about.coords - turn * about.coords;
                self.pose = Isometry::from_parts(Translation3::from(move_back + shift * share), turn);
            }
            Motion::Loaded { mass_tonne, inertia_tonne_mm2, centre, guide, force, moment, ramp } => {
                let share = ramp.at(time - dt);
                let centre_now = self.pose * centre;
                let mut push = force * share + self.force;
                let (mass, inertia) = (mass_tonne + self.carried.0, inertia_tonne_mm2 + self.carried.1);
                if let Some(guide) = guide {
                    push = guide * guide.dot(&push);
                }
                let (keep, gain) = ((1.0 - alpha * dt / 2.0) / (1.0 + alpha * dt / 2.0), dt / (1.0 + alpha * dt / 2.0));
                let old = (self.velocity, self.spin);
                self.before = old;
                self.velocity = old.0 * keep + push * (gain / mass);
                if guide.is_none() {
                    let moment = moment * share + self.moment - centre_now.coords.cross(&self.force);
                    self.spin = old.1 * keep + moment * (gain / inertia);
                }
                let (v, w) = ((old.0 + self.velocity) / 2.0, (old.1 + self.spin) / 2.0);
                self.work += (v.dot(force) + w.dot(moment)) * share * dt;
                self.damped += alpha * dt * (mass * v.norm_squared() + inertia * w.norm_squared());
                let turn = UnitQuaternion::from_scaled_axis(self.spin * dt) * self.pose.rotation;
                let place = centre_now.coords + self.velocity * dt;
                self.pose = Isometry::from_parts(Translation3::from(place - turn * centre.coords), turn);
            }
        }
    }

    /// Its own kinetic energy, without the nodes it carries [N mm]: the product of neighbouring half increments.
    pub(super) fn kinetic(&self, motion: &Motion) -> f64 {
        match motion {
            Motion::Loaded { mass_tonne, inertia_tonne_mm2, .. } => {
                0.5 * (mass_tonne * self.velocity.dot(&self.before.0)
                    + inertia_tonne_mm2 * self.spin.dot(&self.before.1))
            }
            _ => 0.0,
        }
    }
}

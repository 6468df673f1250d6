//! Coulomb friction along a path, regularised: the contact is divided into patches; each holds a tangential force that sticks elastically
//! over a small slip and slides at the Coulomb limit. Over an increment it derives from a convex potential of the increment (the limit
//! and the patch are those at its start), so an equilibrium with friction is a minimum as well.

use super::press::{Key, Spot};
use super::{Contact, Nearby};
use crate::coordinate::Six;
use crate::joint::{Pose, Screw};
use meshes::Vector;
use nalgebra::{Matrix3, Matrix6};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Tangential force held by each patch, by pair and cell of the tibial frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Vec<(Key, Vector)>", into = "Vec<(Key, Vector)>")]
pub struct FrictionState {
    held: BTreeMap<Key, Vector>,
}

impl From<Vec<(Key, Vector)>> for FrictionState {
    fn from(held: Vec<(Key, Vector)>) -> Self {
        FrictionState { held: held.into_iter().collect() }
    }
}

impl From<FrictionState> for Vec<(Key, Vector)> {
    fn from(state: FrictionState) -> Self {
        state.held.into_iter().collect()
    }
}

/// The patches in contact at the start of an increment.
#[derive(Clone, Debug, Default)]
pub struct Patches {
    patches: Vec<Patch>,
}

#[derive(Clone, Debug)]
struct Patch {
    key: Key,
    normal: Vector,
    limit: f64,
    stick: f64,
    held: Vector,
    /// Velocity of the femur's point for each coordinate, tangential part.
    velocity: [Vector; 6],
}

impl Contact {
    /// Patches at a pose, with the tangential forces `state` holds; stick stiffness reaches the limit within `slip` [mm].
    pub fn patches(&self, pose: &Pose, state: &FrictionState, slip: f64, near: &mut Nearby) -> Patches {
        if self.friction == 0.0 {
            return Patches::default();
        }
        self.patches_of(&self.press_near(pose, near).spots, &pose.screws, state, slip)
    }

    /// [`Contact::patches`] where the contact's forces are known.
    pub fn patches_of(&self, spots: &[Spot], screws: &[Screw; 6], state: &FrictionState, slip: f64) -> Patches {
        if self.friction == 0.0 {
            return Patches::default();
        }
        Patches { patches: spots.iter().map(|spot| self.patch(spot, state, screws, slip)).collect() }
    }

    fn patch(&self, spot: &Spot, state: &FrictionState, screws: &[Screw; 6], slip: f64) -> Patch {
        let normal = spot.normal();
        let across = Matrix3::identity() - normal * normal.transpose();
        let limit = self.friction * spot.total;
        let held = across * state.held.get(&spot.key).copied().unwrap_or_default();
        let held = if held.norm() > limit { held * (limit / held.norm()) } else { held };
        let velocity = screws.map(|s| across * s.at(&spot.centre));
        Patch { key: spot.key, normal, limit, stick: limit / slip, held, velocity }
    }
}

impl Patches {
    /// Potential of the increment `step` of the coordinates, its gradient and Hessian (added to the given).
    pub fn add(&self, step: &Six, energy: &mut f64, gradient: &mut Six, hessian: &mut Matrix6<f64>) {
        for p in &self.patches {
            let z = p.trial(step);
            let (size, reach) = (z.norm(), p.limit / p.stick);
            let (force, along) = if size <= reach {
                *energy += 0.5 * p.stick * size * size;
                (z * p.stick, p.stick)
            } else {
                *energy += p.limit * (size - 0.5 * reach);
                (z * (p.limit / size), p.limit / size)
            };
            let unit = if size > reach { z / size } else { Vector::zeros() };
            let lever: [f64; 6] = std::array::from_fn(|j| p.velocity[j].dot(&unit));
            for j in 0..6 {
                gradient[j] += p.velocity[j].dot(&force);
                for k in 0..6 {
                    hessian[(j, k)] += along * (p.velocity[j].dot(&p.velocity[k]) - lever[j] * lever[k]);
                }
            }
        }
    }

    /// The forces held after the increment `step`; their generalised gradient is [`Patches::add`]'s.
    pub fn after(&self, step: &Six) -> FrictionState {
        let held = self.patches.iter().map(|p| {
            let z = p.trial(step);
            let size = z.norm();
            let force = if size * p.stick <= p.limit { z * p.stick } else { z * (p.limit / size) };
            (p.key, -force)
        });
        FrictionState { held: held.collect() }
    }

    /// Work done against friction over the increment by the forces at its end [N mm].
    pub fn work(&self, step: &Six) -> f64 {
        let mut gradient = Six::zeros();
        self.add(step, &mut 0.0, &mut gradient, &mut Matrix6::zeros());
        gradient.dot(step)
    }
}

impl Patch {
    /// Slip of the increment, the elastic slip held before included.
    fn trial(&self, step: &Six) -> Vector {
        let slip = (0..6).fold(Vector::zeros(), |s, j| s + self.velocity[j] * step[j]);
        debug_assert!(slip.dot(&self.normal).abs() <= 1e-6 * (1.0 + slip.norm()));
        slip - self.held / self.stick
    }
}

//! Coulomb friction along a path, regularised: the contact is divided into patches; each holds a tangential force that sticks elastically
//! over a small slip and slides at the Coulomb limit. Over an increment it derives from a convex potential of the increment (the limit
//! and the patch are those at its start), so an equilibrium with friction is a minimum as well.

use super::{Contact, field::Field, nodes::Nodes};
use crate::joint::{Pose, Screw, Six};
use meshes::{Isometry, Vector};
use nalgebra::{Matrix3, Matrix6};
use std::collections::BTreeMap;

/// Edge of a patch on the tibia [mm].
const PATCH: f64 = 4.0;

/// Tangential force held by each patch, by pair and cell of the tibial frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrictionState {
    held: BTreeMap<Key, Vector>,
}

/// Pair and cell of a patch.
type Key = (usize, i64, i64);

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
    pub fn patches(&self, pose: &Pose, state: &FrictionState, slip: f64) -> Patches {
        let mut found: BTreeMap<Key, (f64, Vector, Vector)> = BTreeMap::new();
        if self.friction == 0.0 {
            return Patches::default();
        }
        for (n, pair) in self.pairs.iter().enumerate() {
            let tibia = &pair.tibia.field;
            let to_tibia = |ct: Vector| tibia.local_from_ct * meshes::Point::from(ct);
            for tibial in [true, false] {
                let (nodes, field) =
                    if tibial { (&pair.tibia.nodes, &pair.femur.field) } else { (&pair.femur.nodes, tibia) };
                self.pressures(nodes, field, pose, tibial, |p, f| {
                    let local = to_tibia(p);
                    let cell = |x: f64| (x / PATCH).floor() as i64;
                    let slot = found.entry((n, cell(local.x), cell(local.y))).or_default();
                    slot.0 += f.norm();
                    slot.1 += p * f.norm();
                    slot.2 += f;
                });
            }
        }
        let patches = found.into_iter().filter(|(_, v)| v.0 > 1e-6);
        let patches = patches.map(|(key, (total, moment, force))| {
            self.patch(key, state, &pose.screws, (total, moment / total, force), slip)
        });
        Patches { patches: patches.collect() }
    }

    fn patch(
        &self,
        key: Key,
        state: &FrictionState,
        screws: &[Screw; 6],
        (total, centre, force): (f64, Vector, Vector),
        slip: f64,
    ) -> Patch {
        let normal = force.try_normalize(0.0).unwrap_or_else(Vector::z);
        let across = Matrix3::identity() - normal * normal.transpose();
        let limit = self.friction * total;
        let held = across * state.held.get(&key).copied().unwrap_or_default();
        let held = if held.norm() > limit { held * (limit / held.norm()) } else { held };
        Patch { key, normal, limit, stick: limit / slip, held, velocity: screws.map(|s| across * s.at(&centre)) }
    }

    /// Calls `visit` with the CT position of each node in contact and the force of its pass (halved) on the femur.
    fn pressures(
        &self,
        nodes: &Nodes,
        field: &Field,
        pose: &Pose,
        tibial: bool,
        mut visit: impl FnMut(Vector, Vector),
    ) {
        let ct_from_field =
            if tibial { pose.femur * field.local_from_ct.inverse() } else { field.local_from_ct.inverse() };
        let to_field = ct_from_field.inverse() * if tibial { Isometry::identity() } else { pose.femur };
        let start = self.law.start();
        nodes.for_each_near(field, &to_field, start, |p, area| {
            if let Some(s) = field.sample(p, -start) {
                let (_, pressure, _) = self.law.at(-s.distance);
                let side = if tibial { -0.5 } else { 0.5 };
                let f = ct_from_field.rotation * Vector::from(s.gradient) * (side * pressure * area * self.scale);
                visit((ct_from_field * meshes::Point::from(*p)).coords, f);
            }
        });
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

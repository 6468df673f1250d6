//! Contact forces alone, in one pass over the nodes: what explicit dynamics and friction need, without the tangent.

use super::{Contact, field::Field, nodes::Nodes};
use crate::joint::Pose;
use meshes::{Isometry, Point, Vector};
use std::collections::BTreeMap;

/// Edge of a patch on the tibia [mm].
const PATCH: f64 = 4.0;

/// Pair and cell of the tibial frame.
pub(crate) type Key = (usize, i64, i64);

/// The contact at a pose.
#[derive(Clone, Debug, Default)]
pub struct Press {
    /// Stored energy [N mm].
    pub energy: f64,
    /// Force on the femur [N].
    pub force: Vector,
    /// Its moment about the CT origin [N mm].
    pub moment: Vector,
    /// Contact area, the mean of both passes [mm2].
    pub area: f64,
    /// Deepest overclosure [mm].
    pub deepest: f64,
    /// What each patch carries, in the order of their cells.
    pub spots: Vec<Spot>,
}

/// What a patch carries.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spot {
    pub(crate) key: Key,
    /// Sum of the nodes' forces, as sizes [N].
    pub total: f64,
    /// Their centre [mm].
    pub centre: Vector,
    /// Force on the femur [N].
    pub force: Vector,
    /// Stiffness along the force [N/mm].
    pub stiffness: f64,
}

impl Spot {
    fn add(&mut self, other: &Spot) {
        self.total += other.total;
        self.centre += other.centre;
        self.force += other.force;
        self.stiffness += other.stiffness;
    }

    /// Direction of its force on the femur.
    pub fn normal(&self) -> Vector {
        self.force.try_normalize(0.0).unwrap_or_else(Vector::z)
    }
}

impl Contact {
    /// Energy and forces at a pose.
    pub fn press(&self, pose: &Pose) -> Press {
        let mut out = Press::default();
        let mut spots: BTreeMap<Key, Spot> = BTreeMap::new();
        for (n, pair) in self.pairs.iter().enumerate() {
            let tibia = &pair.tibia.field;
            self.pass((n, true), (&pair.tibia.nodes, &pair.femur.field), tibia, pose, (&mut out, &mut spots));
            self.pass((n, false), (&pair.femur.nodes, tibia), tibia, pose, (&mut out, &mut spots));
        }
        out.spots = spots.into_values().filter(|s| s.total > 1e-6).collect();
        out.spots.iter_mut().for_each(|s| s.centre /= s.total);
        out
    }

    /// One pass of a pair: `nodes` into `field`, cells counted in the frame of `tibia`.
    fn pass(
        &self,
        (pair, tibial): (usize, bool),
        (nodes, field): (&Nodes, &Field),
        tibia: &Field,
        pose: &Pose,
        (out, spots): (&mut Press, &mut BTreeMap<Key, Spot>),
    ) {
        let own = field.local_from_ct.inverse();
        let ct_from_field = if tibial { pose.femur * own } else { own };
        let to_field = ct_from_field.inverse() * if tibial { Isometry::identity() } else { pose.femur };
        let tibia_from_field = tibia.local_from_ct * ct_from_field;
        let turn = ct_from_field.rotation.to_rotation_matrix();
        let start = self.law.start();
        let side = if tibial { -0.5 } else { 0.5 };
        let mut last = Spot::default();
        nodes.for_each_near(field, &to_field, start, |p, area| {
            let Some(s) = field.sample_to::<false>(p, -start) else { return };
            let (energy, pressure, slope) = self.law.at(-s.distance);
            let weight = 0.5 * area * self.scale;
            let force = turn * Vector::from(s.gradient) * (2.0 * side * pressure * weight);
            let point = Point::from(*p);
            let (ct, local) = ((ct_from_field * point).coords, tibia_from_field * point);
            let cell = |x: f64| (x / PATCH).floor() as i64;
            let total = force.norm();
            out.energy += energy * weight;
            out.force += force;
            out.moment += ct.cross(&force);
            out.area += 0.5 * area;
            out.deepest = out.deepest.max(-s.distance);
            let key = (pair, cell(local.x), cell(local.y));
            let here = Spot { key, total, centre: ct * total, force, stiffness: slope * weight };
            if last.key == key {
                last.add(&here);
            } else {
                flush(spots, &last);
                last = here;
            }
        });
        flush(spots, &last);
    }
}

fn flush(spots: &mut BTreeMap<Key, Spot>, spot: &Spot) {
    if spot.total > 0.0 {
        spots.entry(spot.key).or_insert(Spot { key: spot.key, ..Spot::default() }).add(spot);
    }
}

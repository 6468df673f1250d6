//! Contact forces alone, in one pass over the nodes: what explicit dynamics and friction need, without the tangent.

use super::{Contact, Kept, Nearby, Pass};
use crate::joint::Pose;
use meshes::{Isometry, Vector};

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
    /// Its moment about the CT origin [N mm].
    moment: Vector,
    /// Stiffness along the force [N/mm].
    pub stiffness: f64,
}

impl Spot {
    fn add(&mut self, other: &Spot) {
        self.total += other.total;
        self.centre += other.centre;
        self.force += other.force;
        self.moment += other.moment;
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
        self.press_near(pose, &mut Nearby::once())
    }

    /// [`Contact::press`], quicker where `near` holds the lists of a pose close by.
    pub fn press_near(&self, pose: &Pose, near: &mut Nearby) -> Press {
        let mut out = Press::default();
        for (n, pass) in self.passes(pose).enumerate() {
            self.add(&pass, near.pass(n), &mut out);
        }
        out.spots.retain(|s| s.total > 1e-6);
        out.spots.iter_mut().for_each(|s| s.centre /= s.total);
        out
    }

    /// Adds a pass; cells are counted in the frame of the tibia.
    fn add(&self, pass: &Pass, near: &mut Kept, out: &mut Press) {
        let tibia_from_field = pass.tibia.local_from_ct * pass.ct_from_field;
        let (turn, shift) = (tibia_from_field.rotation.to_rotation_matrix(), tibia_from_field.translation.vector);
        let (start, side) = (self.law.start(), pass.side().signum());
        let cell = |p: &Vector, a: usize| {
            below((turn[(a, 0)] * p.x + turn[(a, 1)] * p.y + turn[(a, 2)] * p.z + shift[a]) / PATCH)
        };
        let mut run = Spot::default();
        let mut put = |out: &mut Press, p: Vector, force: Vector, stiffness: f64| {
            let (total, key) = (force.norm(), (pass.pair, cell(&p, 0), cell(&p, 1)));
            if run.key != key {
                out.flush(&run, &pass.ct_from_field);
                run = Spot { key, ..Spot::default() };
            }
            run.add(&Spot { key, total, centre: p * total, force, moment: p.cross(&force), stiffness });
        };
        if let Some(layer) = &self.layer {
            let (energy, nodes) = self.press_layered(layer, pass, near);
            out.energy += energy * pass.share;
            for n in nodes {
                out.area += pass.share * n.area;
                out.deepest = out.deepest.max(n.deep);
                put(out, Vector::from(n.place), n.force * (side * pass.share), n.stiffness * pass.share);
            }
        } else {
            near.for_each((pass.nodes, pass.field), &pass.field_from_nodes, start, |p, area, _| {
                let Some(s) = pass.field.sample::<false>(p, -start) else { return };
                let (energy, pressure, slope) = self.law.at(-s.distance);
                let weight = pass.share * area * self.scale;
                out.energy += energy * weight;
                out.area += pass.share * area;
                out.deepest = out.deepest.max(-s.distance);
                put(out, Vector::from(*p), Vector::from(s.gradient) * (side * pressure * weight), slope * weight);
            });
        }
        out.flush(&run, &pass.ct_from_field);
    }
}

/// The largest whole number that is not above `x`, for numbers of a patch's size.
#[inline]
fn below(x: f64) -> i64 {
    let cut = x as i64;
    cut - i64::from(cut as f64 > x)
}

impl Press {
    /// Adds a run of nodes of one patch, given in a field's frame.
    fn flush(&mut self, run: &Spot, ct_from_field: &Isometry) {
        if run.total <= 0.0 {
            return;
        }
        let (turn, shift) = (ct_from_field.rotation, ct_from_field.translation.vector);
        let force = turn * run.force;
        let moment = turn * run.moment + shift.cross(&force);
        self.force += force;
        self.moment += moment;
        let at = match self.spots.binary_search_by_key(&run.key, |s| s.key) {
            Ok(at) => at,
            Err(at) => {
                self.spots.insert(at, Spot { key: run.key, ..Spot::default() });
                at
            }
        };
        self.spots[at].add(&Spot { centre: turn * run.centre + shift * run.total, force, moment, ..*run });
    }
}

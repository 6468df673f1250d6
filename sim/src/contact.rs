//! Contact of rigid cartilages by a pressure-overclosure law, the mean of both passes.
//!
//! A pass sums over the nodes of one surface: pressure at the node's overclosure into the other surface's distance field, times its tributary
//! area, along the field's gradient. The force is the gradient of an energy; the tangent is exact. Nodes denser than
//! [`ContactOptions::spacing_mm`] are merged, area kept. Nodes that may touch are listed and the list is kept while the bones move little ([`Nearby`]).

mod cells;
pub mod compartment;
mod compiled;
pub mod field;
pub mod friction;
pub mod law;
pub mod layer;
mod layered;
mod near;
mod nodes;
pub mod press;
pub mod rim;
mod thickness;

use crate::coordinate::Six;
use crate::error::SimError;
use crate::joint::{Pose, Screw, comes_first};
use crate::spec::{ContactSpec, FramesSpec, ModelSpec};
use compiled::Source;
use field::Field;
pub use friction::{FrictionState, Patches};
use law::PressureLaw;
use layer::Layer;
use meshes::surface::TriMesh;
use meshes::{Isometry, Vector};
use nalgebra::{Matrix3, Matrix6};
use near::Kept;
pub use near::Nearby;
use nodes::Nodes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// How contact is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactOptions {
    /// Nodes nearer to each other than this are merged into one of their common area [mm]; 0 keeps all. Measured: docs/verification.md.
    pub spacing_mm: f64,
}

impl Default for ContactOptions {
    fn default() -> Self {
        ContactOptions { spacing_mm: 0.8 }
    }
}

/// Surfaces that may touch, ready for evaluation.
#[derive(Clone, Debug)]
pub struct Contact {
    pub(crate) pairs: Vec<Pair>,
    pub(crate) law: PressureLaw,
    /// Takes the place of `law`, whose start it keeps.
    pub(crate) layer: Option<Layer>,
    /// Coulomb coefficient [-].
    pub friction: f64,
    /// Contact damping, fraction of critical [-].
    pub damping: f64,
    /// Factor on every pressure [-].
    pub scale: f64,
    /// Only the tibia's nodes are passed over, in full.
    pub(crate) tibial_only: bool,
}

/// A femoral and a tibial articular surface.
#[derive(Clone, Debug)]
pub(crate) struct Pair {
    pub(crate) femur: Arc<Side>,
    pub(crate) tibia: Arc<Side>,
}

/// One surface: its nodes and its field.
#[derive(Clone, Debug)]
pub(crate) struct Side {
    pub(crate) nodes: Nodes,
    pub(crate) field: Field,
    /// The edge of an open patch.
    pub(crate) rim: Vec<rim::RimEdge>,
}

/// One pass of a pair at a pose: `nodes` into `field`.
struct Pass<'a> {
    pair: usize,
    /// Whether the nodes are the tibia's.
    tibial: bool,
    /// Its share in the contact [-].
    share: f64,
    nodes: &'a Nodes,
    field: &'a Field,
    /// The pair's tibial field.
    tibia: &'a Field,
    ct_from_field: Isometry,
    field_from_nodes: Isometry,
}

impl Pass<'_> {
    /// Its share as a force on the femur, with its sign.
    fn side(&self) -> f64 {
        if self.tibial { -self.share } else { self.share }
    }
}

/// Energy, generalised gradient and Hessian of the contact, and each pair's share.
#[derive(Clone, Debug, Default)]
pub struct ContactResponse {
    /// Stored energy [N mm].
    pub energy: f64,
    /// Its derivative by each coordinate [N mm, N].
    pub gradient: Six,
    /// Its second derivative.
    pub hessian: Matrix6<f64>,
    /// Force on the femur and its moment about the CT origin, a pair each [N, N mm].
    pub wrench: Vec<(Vector, Vector)>,
    /// Contact area (mean of both passes), a pair each [mm2].
    pub area: Vec<f64>,
    /// Deepest overclosure [mm].
    pub deepest: f64,
}

impl ContactResponse {
    /// The mean with another, whose share is `share`.
    pub(crate) fn blended(mut self, other: &ContactResponse, share: f64) -> ContactResponse {
        let own = 1.0 - share;
        self.energy = own * self.energy + share * other.energy;
        self.gradient = self.gradient * own + other.gradient * share;
        self.hessian = self.hessian * own + other.hessian * share;
        for ((force, moment), (f, m)) in self.wrench.iter_mut().zip(&other.wrench) {
            (*force, *moment) = (*force * own + f * share, *moment * own + m * share);
        }
        self.area.iter_mut().zip(&other.area).for_each(|(a, b)| *a = own * *a + share * b);
        self.deepest = self.deepest.max(other.deepest);
        self
    }
}

/// Sums over a pass in the field's frame.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sums {
    pub(crate) energy: f64,
    pub(crate) force: Vector,
    virial: Matrix3<f64>,
    pub(crate) stiffness: Matrix6<f64>,
    pub(crate) area: f64,
    deepest: f64,
}

impl Contact {
    /// Compiles the contact of a specification; `surfaces` by the names used in `contact.pairs`.
    ///
    /// Errors: a missing, inconsistent or inside-out surface, a bad table.
    pub fn new(
        spec: &ModelSpec,
        surfaces: &BTreeMap<String, TriMesh>,
        options: &ContactOptions,
    ) -> Result<Contact, SimError> {
        Contact::between(&spec.frames, &spec.contact, surfaces, options)
    }

    /// [`Contact::new`] of what it needs of a specification.
    pub fn between(
        frames: &FramesSpec,
        spec: &ContactSpec,
        surfaces: &BTreeMap<String, TriMesh>,
        options: &ContactOptions,
    ) -> Result<Contact, SimError> {
        let law = PressureLaw::new(&spec.overclosure_mm, &spec.pressure_mpa)?;
        let layer = spec.layer.as_ref().map(Layer::new).transpose()?;
        layered::check(spec)?;
        for (key, x) in [("friction", spec.friction), ("damping", spec.damping)] {
            if !(0.0..10.0).contains(&x) {
                return Err(SimError::Spec(format!("contact.{key} is {x}, expected 0 to 10")));
            }
        }
        let mut sides: BTreeMap<(String, bool), Arc<Side>> = BTreeMap::new();
        let mut pairs = Vec::new();
        let along = frames.tabulated();
        for pair in &spec.pairs {
            let mut both = Vec::new();
            for (name, moves) in [(&pair.femur, true), (&pair.tibia, false)] {
                let key = (name.clone(), moves);
                if !sides.contains_key(&key) {
                    let frame = field::bone_frame(if moves { &along.femur } else { &along.tibia });
                    sides.insert(key.clone(), side(name, spec, surfaces, frame, options)?);
                }
                both.push(sides[&key].clone());
            }
            pairs.push(Pair { femur: both[0].clone(), tibia: both[1].clone() });
        }
        let (friction, damping) = (spec.friction, spec.damping);
        Ok(Contact { pairs, law, layer, friction, damping, scale: 1.0, tibial_only: false })
    }

    /// The same surfaces under another pressure-overclosure law; under contact by thickness it says only where contact begins.
    ///
    /// Errors: a bad table.
    pub fn with_law(&self, overclosure_mm: &[f64], pressure_mpa: &[f64]) -> Result<Contact, SimError> {
        Ok(Contact { law: PressureLaw::new(overclosure_mm, pressure_mpa)?, ..self.clone() })
    }

    /// The same surfaces, and their thickness, under another law of layers.
    ///
    /// Errors: numbers out of range; a contact without layers.
    pub fn with_layer(&self, spec: &crate::spec::LayerSpec) -> Result<Contact, SimError> {
        if self.layer.is_none() {
            return Err(SimError::Spec("contact.layer is absent: the surfaces have no thickness".into()));
        }
        Ok(Contact { layer: Some(Layer::new(spec)?), ..self.clone() })
    }

    /// Overclosure at which pressure begins [mm]; below 0 where cartilage is thicker than its surfaces.
    pub fn starts_at(&self) -> f64 {
        self.law.start()
    }

    /// Energy, gradient and Hessian at a pose.
    pub fn evaluate(&self, pose: &Pose) -> ContactResponse {
        self.evaluate_near(pose, &mut Nearby::once())
    }

    /// [`Contact::evaluate`], quicker where `near` holds the lists of a pose close by.
    pub fn evaluate_near(&self, pose: &Pose, near: &mut Nearby) -> ContactResponse {
        self.evaluate_from(pose, near, 0)
    }

    /// [`Contact::evaluate_near`] with the lists of `near` from `first` on.
    pub(crate) fn evaluate_from(&self, pose: &Pose, near: &mut Nearby, first: usize) -> ContactResponse {
        let mut out = ContactResponse::default();
        for (n, pass) in self.passes(pose).enumerate() {
            let kept = near.pass(first + n);
            let sums = match &self.layer {
                None => self.sum(&pass, kept),
                Some(layer) => self.sum_layered(layer, &pass, kept),
            };
            let Pass { ct_from_field, tibial, share, .. } = pass;
            accumulate(&mut out, &sums, &local_screws(pose, &ct_from_field), (tibial, share));
            // force on the femur, CT frame: nodes push what carries the field the other way
            let turn = ct_from_field.rotation;
            let force = turn * sums.force * pass.side();
            let moment = turn * moment(&sums.virial) * pass.side() + ct_from_field.translation.vector.cross(&force);
            if tibial {
                out.wrench.push((force, moment));
                out.area.push(share * sums.area);
            } else if let (Some(wrench), Some(area)) = (out.wrench.last_mut(), out.area.last_mut()) {
                (wrench.0, wrench.1, *area) = (wrench.0 + force, wrench.1 + moment, *area + share * sums.area);
            }
            out.deepest = out.deepest.max(sums.deepest);
        }
        out
    }

    /// Both passes of every pair, that of the tibial nodes first.
    fn passes<'a>(&'a self, pose: &'a Pose) -> impl Iterator<Item = Pass<'a>> {
        self.pairs.iter().enumerate().flat_map(move |(n, pair)| {
            let sides: &[bool] = if self.tibial_only { &[true] } else { &[true, false] };
            let share = 1.0 / sides.len() as f64;
            sides.iter().map(move |&tibial| {
                let (nodes, field) = if tibial {
                    (&pair.tibia.nodes, &pair.femur.field)
                } else {
                    (&pair.femur.nodes, &pair.tibia.field)
                };
                let own = field.local_from_ct.inverse();
                let ct_from_field = if tibial { pose.femur * own } else { own };
                let inverse = ct_from_field.inverse();
                let field_from_nodes = if tibial { inverse } else { inverse * pose.femur };
                Pass { pair: n, tibial, share, nodes, field, tibia: &pair.tibia.field, ct_from_field, field_from_nodes }
            })
        })
    }

    /// Sums over the nodes that overclose.
    fn sum(&self, pass: &Pass, near: &mut Kept) -> Sums {
        let mut sums = Sums::default();
        let (start, mut stiffness) = (self.law.start(), [0.0; 21]);
        near.for_each((pass.nodes, pass.field), &pass.field_from_nodes, start, |p, area, _| {
            let Some(s) = pass.field.sample::<true>(p, -start) else { return };
            let (e, pressure, slope) = self.law.at(-s.distance);
            let force_area = area * self.scale;
            let pressed = [e * force_area, pressure * force_area, slope * force_area];
            sums.add(&mut stiffness, (p, area), &s, pressed);
        });
        sums.stiffness = symmetric(&stiffness);
        sums
    }
}

impl Sums {
    /// Adds a node at a place, with its area, by what it stores, presses and how stiff it is; `stiffness` is an upper triangle by rows.
    #[inline]
    #[expect(clippy::needless_range_loop, reason = "indices of matrices")]
    pub(crate) fn add(
        &mut self,
        stiffness: &mut [f64; 21],
        (p, area): (&[f64; 3], f64),
        s: &field::Sample,
        [energy, f, k]: [f64; 3],
    ) {
        let (g, h) = (s.gradient, s.hessian);
        self.energy += energy;
        self.area += area;
        self.deepest = self.deepest.max(-s.distance);
        for a in 0..3 {
            self.force[a] += f * g[a];
            for b in 0..3 {
                self.virial[(b, a)] += p[b] * f * g[a];
            }
        }
        let t = [
            k * g[0] * g[0] - f * h[0],
            k * g[0] * g[1] - f * h[1],
            k * g[0] * g[2] - f * h[2],
            k * g[1] * g[1] - f * h[3],
            k * g[1] * g[2] - f * h[4],
            k * g[2] * g[2] - f * h[5],
        ];
        add_stiffness(stiffness, &t, p);
    }

    /// Adds an energy of a node's place alone, by its derivatives there; `stiffness` is an upper triangle by rows.
    pub(crate) fn pull(
        &mut self,
        stiffness: &mut [f64; 21],
        place: &Vector,
        energy: f64,
        (gradient, k): (&Vector, &Matrix3<f64>),
    ) {
        self.energy += energy;
        self.force -= gradient;
        self.virial -= place * gradient.transpose();
        let t = [k[(0, 0)], k[(0, 1)], k[(0, 2)], k[(1, 1)], k[(1, 2)], k[(2, 2)]];
        add_stiffness(stiffness, &t, &[place.x, place.y, place.z]);
    }

    /// Adds other sums in the same frame.
    pub(crate) fn join(&mut self, other: &Sums) {
        self.energy += other.energy;
        self.force += other.force;
        self.virial += other.virial;
        self.stiffness += other.stiffness;
        self.area += other.area;
        self.deepest = self.deepest.max(other.deepest);
    }
}

/// The matrix of an upper triangle by rows.
pub(crate) fn symmetric(upper: &[f64; 21]) -> Matrix6<f64> {
    let (mut matrix, mut n) = (Matrix6::zeros(), 0);
    for i in 0..6 {
        for j in i..6 {
            matrix[(i, j)] = upper[n];
            matrix[(j, i)] = upper[n];
            n += 1;
        }
    }
    matrix
}

/// Adds `B' T B` with `B = [I, -p x]`, upper triangle by rows; `t` is symmetric (xx, xy, xz, yy, yz, zz).
#[inline]
fn add_stiffness(k: &mut [f64; 21], t: &[f64; 6], p: &[f64; 3]) {
    let [x, y, z] = *p;
    let rows = [[t[0], t[1], t[2]], [t[1], t[3], t[4]], [t[2], t[4], t[5]]];
    // column c of -[p]x is e_c x p: C = T (-[p]x)
    let c: [[f64; 3]; 3] = std::array::from_fn(|i| {
        let r = rows[i];
        [r[2] * y - r[1] * z, r[0] * z - r[2] * x, r[1] * x - r[0] * y]
    });
    let d = |a: usize, b: usize| match a {
        0 => c[2][b] * y - c[1][b] * z,
        1 => c[0][b] * z - c[2][b] * x,
        _ => c[1][b] * x - c[0][b] * y,
    };
    let add = [
        t[0],
        t[1],
        t[2],
        c[0][0],
        c[0][1],
        c[0][2], //
        t[3],
        t[4],
        c[1][0],
        c[1][1],
        c[1][2], //
        t[5],
        c[2][0],
        c[2][1],
        c[2][2], //
        d(0, 0),
        d(0, 1),
        d(0, 2),
        d(1, 1),
        d(1, 2),
        d(2, 2),
    ];
    for (k, a) in k.iter_mut().zip(add) {
        *k += a;
    }
}

/// The femur's velocity fields in a frame.
pub(crate) fn local_screws(pose: &Pose, ct_from_local: &Isometry) -> [Screw; 6] {
    let (turn, o) = (ct_from_local.rotation.inverse(), ct_from_local.translation.vector);
    pose.screws.map(|s| Screw { angular: turn * s.angular, linear: turn * s.at(&o) })
}

/// Adds a pass to the response. The nodes' motion relative to the field is the femur's (femoral nodes) or its reverse (tibial nodes).
#[expect(clippy::needless_range_loop, reason = "indices of matrices")]
pub(crate) fn accumulate(
    out: &mut ContactResponse,
    sums: &Sums,
    screws: &[Screw; 6],
    (tibial_nodes, share): (bool, f64),
) {
    let sign = if tibial_nodes { -1.0 } else { 1.0 };
    let (v, moment) = (&sums.virial, moment(&sums.virial));
    out.energy += share * sums.energy;
    let twist: [Six; 6] =
        screws.map(|s| Six::new(s.linear.x, s.linear.y, s.linear.z, s.angular.x, s.angular.y, s.angular.z));
    for j in 0..6 {
        out.gradient[j] -= share * sign * (screws[j].linear.dot(&sums.force) + screws[j].angular.dot(&moment));
        let kt = sums.stiffness * twist[j];
        for k in 0..6 {
            let (first, last) = if comes_first(j, k) { (j, k) } else { (k, j) };
            // second derivative of the nodes' path: for femoral nodes first x (last x p), for tibial nodes last x (first x p)
            let (a, b) = if tibial_nodes { (&screws[last], &screws[first]) } else { (&screws[first], &screws[last]) };
            let second = work_of_second(a, b, &sums.force, v);
            out.hessian[(j, k)] += share * (twist[k].dot(&kt) - second);
        }
    }
}

/// Sum over nodes of `p x f` from the virial `sum p f'`.
fn moment(virial: &Matrix3<f64>) -> Vector {
    let v = virial;
    Vector::new(v[(1, 2)] - v[(2, 1)], v[(2, 0)] - v[(0, 2)], v[(0, 1)] - v[(1, 0)])
}

/// Sum over nodes of `f . (a.angular x (b.angular x p + b.linear))`, from the total force and the virial `sum p f'`.
fn work_of_second(a: &Screw, b: &Screw, force: &Vector, virial: &Matrix3<f64>) -> f64 {
    let turn = a.angular.cross_matrix() * b.angular.cross_matrix();
    // sum f_i (turn p)_i = sum turn_ij p_j f_i = sum turn_ij virial_ji
    (turn * virial).trace() + force.dot(&a.angular.cross(&b.linear))
}

/// Nodes and field of one surface.
fn side(
    name: &str,
    spec: &ContactSpec,
    surfaces: &BTreeMap<String, TriMesh>,
    frame: Isometry,
    options: &ContactOptions,
) -> Result<Arc<Side>, SimError> {
    let mesh = surfaces.get(name).ok_or_else(|| SimError::Spec(format!("contact.pairs: no surface {name}")))?;
    let thickness = layered::thickness(name, mesh, spec, surfaces)?;
    compiled::side(Source { mesh: mesh.clone(), thickness, frame, spacing_mm: options.spacing_mm }, name)
}

#[cfg(test)]
mod tests;

//! The state and its increments.

use super::Damping;
use super::body::{BodyState, Motion};
use super::energy::Ledger;
use super::kernel::{BlockForces, BlockState};
use super::model::{FREE, Model};
use super::touch::Contact;
use super::wide::LANES;
use crate::error::DeformableError;
use meshes::{Point, Vector};
use rayon::prelude::*;

/// Nodes, or blocks, that a thread takes at a time.
const CHUNK: usize = 512;
const BLOCKS: usize = 64;
/// Ratio of volumes at which an element counts as turned over [-].
const FLAT: f64 = 1e-3;
/// Factor by which damping may rise from one increment to the next [-].
const FOLLOW: f64 = 1.01;
/// Increments after which the stable increment is looked at again.
const RENEWED: usize = 200;

/// An assembly under way.
#[derive(Clone, Debug)]
pub struct State {
    /// Time [s].
    pub time: f64,
    /// Increments done.
    pub increments: usize,
    /// Energies.
    pub energy: Ledger,
    /// How each body moves; may be changed between increments.
    pub motions: Vec<Motion>,
    pub(super) x: Vec<[f64; 3]>,
    pub(super) v: Vec<[f64; 3]>,
    /// Forces on the nodes at the last place they were computed: of elements, of contact, and their sum before that.
    pub(super) internal: Vec<[f64; 3]>,
    pub(super) touching: Vec<[f64; 3]>,
    last: Vec<[f64; 3]>,
    pub(super) contact: Contact,
    bodies: Vec<BodyState>,
    /// Force on nodes along axes that rollers hold [N].
    held: Vector,
    forces: Vec<BlockForces>,
    told: Vec<BlockState>,
    sums: Vec<Sums>,
    /// Work of elements, contact, and of what carries nodes, so far; mass damping in use [1/s].
    work: Works,
    alpha: f64,
    /// Size of the forces that move free nodes [N].
    unbalanced: f64,
    /// Share of the model's increment in use [-].
    share: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Works {
    internal: f64,
    contact: f64,
    carried: f64,
    damping: f64,
    viscous: f64,
}

/// Sums over a chunk of nodes.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    /// Work over half an increment before and after, by elements and by contact.
    internal: [f64; 2],
    contact: [f64; 2],
    carried: [f64; 2],
    damping: f64,
    kinetic: f64,
    /// Rayleigh's quotient of the velocities.
    stiff: f64,
    heavy: f64,
    unbalanced: f64,
    fastest: f64,
}

impl State {
    /// At rest at the start.
    pub fn new(model: &Model) -> State {
        let n = model.start.len();
        let bodies = (0..model.motions.len()).map(|b| BodyState::new(carried(model, b))).collect();
        State {
            time: 0.0,
            increments: 0,
            energy: Ledger::default(),
            motions: model.motions.clone(),
            x: model.start.clone(),
            v: vec![[0.0; 3]; n],
            internal: vec![[0.0; 3]; n],
            touching: vec![[0.0; 3]; n],
            last: vec![[0.0; 3]; n],
            contact: Contact::new(&model.faces, &model.passes),
            bodies,
            held: Vector::zeros(),
            forces: vec![[0.0; 8 * 3 * LANES]; model.blocks.len()],
            told: vec![BlockState::default(); model.blocks.len()],
            sums: vec![Sums::default(); n.div_ceil(CHUNK)],
            work: Works::default(),
            alpha: 0.0,
            unbalanced: 0.0,
            share: 1.0,
        }
    }

    /// Places of all nodes [mm].
    pub fn places(&self) -> impl Iterator<Item = Point> {
        self.x.iter().map(|p| Point::from(*p))
    }

    /// Puts a free node elsewhere, or gives it a velocity: a start that is not at rest. Node numbers are the model's.
    pub fn set(&mut self, node: usize, place: Point, velocity: Vector) {
        self.x[node] = place.coords.into();
        self.v[node] = velocity.into();
    }

    /// Force of the solids and faces on a body and its moment about the CT origin [N, N mm], at the last increment's start.
    pub fn reaction(&self, body: usize) -> (Vector, Vector) {
        (self.bodies[body].force, self.bodies[body].moment)
    }

    /// Sum of the forces on everything that is not free, bodies and rollers [N]: zero at rest but for loads.
    pub fn missing(&self) -> Vector {
        self.bodies.iter().map(|b| b.force).sum::<Vector>() + self.held
    }

    /// Where a body is, from its start.
    pub fn pose(&self, body: usize) -> meshes::Isometry {
        self.bodies[body].pose
    }

    /// Size of the forces that move free nodes, root of the sum of squares [N].
    pub fn unbalanced(&self) -> f64 {
        self.unbalanced
    }

    /// Mass-proportional damping in use [1/s].
    pub fn damping(&self) -> f64 {
        self.alpha
    }

    /// Force on each node by the elements, as places are [N]: what a patch test looks at.
    pub fn internal_forces(&mut self, model: &Model) -> Result<Vec<Vector>, DeformableError> {
        self.element_forces(model)?;
        Ok(self.internal.iter().map(|f| Vector::from(*f)).collect())
    }

    /// One increment.
    ///
    /// Errors: an element that turns over, a place that is not finite, a node that moves by more than an element's edge.
    pub fn advance(&mut self, model: &Model) -> Result<(), DeformableError> {
        if self.increments % RENEWED == RENEWED - 1 {
            self.share = model.increment_left(&self.x);
        }
        let dt = model.masses().increment_s * self.share;
        self.element_forces(model)?;
        self.touching.fill([0.0; 3]);
        let moving = (self.x.as_slice(), self.v.as_slice(), dt);
        self.contact.forces((&model.faces, &model.passes), moving, &model.options, &mut self.touching);
        let alpha = match model.options.damping {
            Damping::Mass(alpha) => alpha,
            Damping::Critical => self.alpha,
        };
        self.collect_reactions(model);
        for (body, motion) in self.bodies.iter_mut().zip(&self.motions) {
            body.advance(motion, (self.time + dt, dt), alpha);
        }
        self.move_nodes(model, dt, alpha);
        self.book(model, dt, alpha);
        self.time += dt;
        self.increments += 1;
        let fastest = self.sums.iter().fold(0.0, |m: f64, s| if s.fastest >= m { s.fastest } else { m.max(s.fastest) });
        if !self.energy.kinetic.is_finite() || fastest * dt > model.shortest.max(1e-3) {
            return Err(DeformableError::Solver(format!(
                "blew up at increment {}, {:.3e} s: a node moves {:.3e} mm in one increment; {}; shorter increments (safety), lower penalty or slower loading may help",
                self.increments,
                self.time,
                fastest * dt,
                self.energy
            )));
        }
        Ok(())
    }

    fn element_forces(&mut self, model: &Model) -> Result<(), DeformableError> {
        let (x, v) = (&self.x, &self.v);
        self.forces.par_chunks_mut(BLOCKS).zip(self.told.par_chunks_mut(BLOCKS)).enumerate().for_each(
            |(c, (forces, told))| {
                for (k, (force, told)) in forces.iter_mut().zip(told).enumerate() {
                    *told = model.blocks[c * BLOCKS + k].forces(x, v, force);
                }
            },
        );
        if let Some(b) = self.told.iter().position(|t| t.least.is_nan() || t.least <= FLAT) {
            return Err(self.turned_over(model, b));
        }
        let flat = self.forces.as_flattened();
        self.internal.par_chunks_mut(CHUNK).enumerate().for_each(|(c, chunk)| {
            for (k, force) in chunk.iter_mut().enumerate() {
                let n = c * CHUNK + k;
                let mut sum = [0.0; 3];
                for &place in &model.gather[model.offsets[n] as usize..model.offsets[n + 1] as usize] {
                    for (a, s) in sum.iter_mut().enumerate() {
                        *s -= flat[place as usize + a * LANES];
                    }
                }
                *force = sum;
            }
        });
        Ok(())
    }

    fn turned_over(&self, model: &Model, block: usize) -> DeformableError {
        let b = &model.blocks[block];
        let ratio = b.stress(&self.x).1.0;
        let lane = (0..b.count as usize).find(|&k| ratio[k].is_nan() || ratio[k] <= FLAT).unwrap_or(0);
        let name = model.solids().get(b.solid as usize).map_or("", |s| s.name.as_str());
        DeformableError::Solver(format!(
            "solid {name}: element {} turned over at increment {}, {:.3e} s (volume {:.3} of its first); load more slowly, or mend the mesh there",
            b.first as usize + lane,
            self.increments,
            self.time,
            ratio[lane]
        ))
    }

    /// Forces on bodies, of the nodes they carry, in the order of the nodes.
    fn collect_reactions(&mut self, model: &Model) {
        for body in &mut self.bodies {
            (body.force, body.moment) = (Vector::zeros(), Vector::zeros());
        }
        for (n, &carrier) in model.carrier.iter().enumerate().filter(|(_, c)| **c != FREE) {
            let force = Vector::from(self.internal[n]) + Vector::from(self.touching[n]);
            let body = &mut self.bodies[carrier as usize];
            body.force += force;
            body.moment += Vector::from(self.x[n]).cross(&force);
        }
        self.held = Vector::zeros();
        for (n, &held) in model.held.iter().enumerate().filter(|(n, h)| **h != 0 && model.carrier[*n] == FREE) {
            for a in (0..3).filter(|a| held >> a & 1 == 1) {
                self.held[a] += self.internal[n][a] + self.touching[n][a];
            }
        }
    }

    fn move_nodes(&mut self, model: &Model, dt: f64, alpha: f64) {
        let (keep, gain) = ((1.0 - alpha * dt / 2.0) / (1.0 + alpha * dt / 2.0), dt / (1.0 + alpha * dt / 2.0));
        let (bodies, motions) = (&self.bodies, &self.motions);
        let (internal, touching) = (&self.internal, &self.touching);
        let nodes = self.x.par_chunks_mut(CHUNK).zip(self.v.par_chunks_mut(CHUNK)).zip(self.last.par_chunks_mut(CHUNK));
        nodes.zip(self.sums.par_iter_mut()).enumerate().for_each(|(c, (((x, v), last), sums))| {
            let mut sum = Sums::default();
            for k in 0..x.len() {
                let n = c * CHUNK + k;
                let (f, t, m, old) = (internal[n], touching[n], model.mass[n], v[k]);
                let carrier = model.carrier[n];
                if carrier == FREE {
                    for a in 0..3 {
                        if model.held[n] >> a & 1 == 1 {
                            v[k][a] = 0.0;
                            continue;
                        }
                        let push = f[a] + t[a];
                        v[k][a] = old[a] * keep + push * gain / m;
                        x[k][a] += v[k][a] * dt;
                        sum.stiff -= old[a] * (push - last[k][a]);
                        sum.heavy += m * old[a] * old[a];
                        sum.unbalanced += push * push;
                        last[k][a] = push;
                        let mean = 0.5 * (old[a] + v[k][a]);
                        sum.damping += m * mean * mean;
                    }
                } else {
                    let place: [f64; 3] = (bodies[carrier as usize].pose * Point::from(model.start[n])).coords.into();
                    // what a loaded body does to its nodes they do to it
                    let given = !matches!(motions[carrier as usize], Motion::Loaded { .. });
                    for a in 0..3 {
                        v[k][a] = (place[a] - x[k][a]) / dt;
                        let push = if given { m * (v[k][a] - old[a]) / dt - f[a] - t[a] } else { 0.0 };
                        sum.carried[0] += push * old[a];
                        sum.carried[1] += push * v[k][a];
                    }
                    x[k] = place;
                }
                for a in 0..3 {
                    sum.kinetic += 0.5 * m * old[a] * v[k][a];
                    sum.internal[0] += f[a] * old[a];
                    sum.internal[1] += f[a] * v[k][a];
                    sum.contact[0] += t[a] * old[a];
                    sum.contact[1] += t[a] * v[k][a];
                    let speed = v[k][a].abs();
                    sum.fastest = if speed <= sum.fastest { sum.fastest } else { speed };
                }
            }
            *sums = sum;
        });
    }

    /// Books the energies at the increment's start.
    fn book(&mut self, model: &Model, dt: f64, alpha: f64) {
        let mut all = Sums::default();
        for s in &self.sums {
            for h in 0..2 {
                all.internal[h] += s.internal[h];
                all.contact[h] += s.contact[h];
                all.carried[h] += s.carried[h];
            }
            all.damping += s.damping;
            all.kinetic += s.kinetic;
            all.stiff += s.stiff;
            all.heavy += s.heavy;
            all.unbalanced += s.unbalanced;
        }
        let half = 0.5 * dt;
        let (hourglass, viscous) = self.told.iter().fold((0.0, 0.0), |(h, v), t| (h + t.hourglass, v + t.viscous));
        let w = &mut self.work;
        w.internal += half * all.internal[0];
        w.contact += half * all.contact[0];
        w.carried += half * all.carried[0];
        let damped = alpha * dt * all.damping;
        w.damping += 0.5 * damped;
        w.viscous += viscous * half;
        let loaded: Vec<usize> =
            (0..self.motions.len()).filter(|&b| matches!(self.motions[b], Motion::Loaded { .. })).collect();
        let own = |f: &dyn Fn(&BodyState, &Motion) -> f64| -> f64 {
            loaded.iter().map(|&b| f(&self.bodies[b], &self.motions[b])).sum()
        };
        self.energy.kinetic = all.kinetic + own(&|b, m| b.kinetic(m));
        self.energy.hourglass = hourglass;
        self.energy.hourglass_viscous = w.viscous;
        self.energy.strain = -w.internal - hourglass - w.viscous;
        self.energy.contact = self.contact.stored;
        self.energy.friction = self.contact.lost;
        self.energy.damping = w.damping + own(&|b, _| b.damped);
        self.energy.external = w.carried + own(&|b, _| b.work);
        self.energy.note();
        w.internal += half * all.internal[1];
        w.contact += half * all.contact[1];
        w.carried += half * all.carried[1];
        w.damping += 0.5 * damped;
        w.viscous += viscous * half;
        self.unbalanced = all.unbalanced.sqrt();
        if model.options.damping == Damping::Critical {
            self.alpha = critical(all.stiff / dt, all.heavy, dt, self.alpha);
        }
    }
}

/// Twice the frequency by Rayleigh's quotient, within what an increment can bear. The quotient is never below the lowest frequency, and well
/// above it while higher ones ring: what it says is believed at once where it falls, and followed slowly where it rises.
fn critical(stiff: f64, heavy: f64, dt: f64, before: f64) -> f64 {
    if heavy > 0.0 && stiff > 0.0 {
        let now = 2.0 * (stiff / heavy).sqrt().min(0.5 / dt);
        if before > 0.0 { now.min(before * FOLLOW) } else { now }
    } else {
        before
    }
}

/// Mass of the nodes a body carries and their rotary inertia about its centre.
fn carried(model: &Model, body: usize) -> (f64, f64) {
    let Motion::Loaded { centre, .. } = &model.motions[body] else { return (0.0, 0.0) };
    let mut sums = (0.0, 0.0);
    for (n, _) in model.carrier.iter().enumerate().filter(|(_, c)| **c as usize == body) {
        let r = Point::from(model.start[n]) - centre;
        sums.0 += model.mass[n];
        sums.1 += model.mass[n] * r.norm_squared() * 2.0 / 3.0;
    }
    sums
}

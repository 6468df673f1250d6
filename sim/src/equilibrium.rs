//! Equilibrium of a model and an external force field at a read flexion: Newton's method, continuation, restraints. Without friction.
//!
//! Flexion is set so that the prescribed flexion is what a laboratory would read; the five other coordinates balance the model's forces, a load and the
//! external field. Between them and [`crate::quasistatic`] lies friction: there it holds a pose, here it is none.

use crate::contact::Nearby;
use crate::coordinate::{ALL, Coordinate, FE, FREE, Free, IE, LEVER_MM, SI, Six, free_block, free_part};
use crate::model::Model;
use nalgebra::{Matrix5, Matrix6, Vector5};

/// Largest Newton step: rotations [rad], translations [mm].
const LARGEST_STEP: [f64; 6] = [0.1, 0.1, 0.1, 4.0, 4.0, 4.0];
/// Forces are in balance within this: moments [N mm], forces [N].
const BALANCED: [f64; 6] = [0.0, 0.5, 0.5, 0.01, 0.01, 0.01];
/// Flexion agrees within this [rad].
const SAME_FLEXION: f64 = 1e-8;
/// Lever of the springs of a restraint that hold rotations [mm].
const SPRING_LEVER_MM: f64 = 20.0;
/// Most Newton steps to an equilibrium, and to a restrained pose.
const MOST_STEPS: [usize; 2] = [60, 12];
/// Longest step of a restrained pose, over the largest [-].
const RESTRAINED_STEP: f64 = 0.25;
/// Flexion between two equilibria on the way from the CT pose [rad].
const FLEXION_STEP: f64 = 0.1;
/// Parts of the springs of a restraint with which it is let go, one after the other [-].
const LET_GO: [f64; 5] = [1.0, 0.3, 0.1, 0.03, 0.01];
/// Stiffness of a knee on the brink, over that of the springs of a restraint, that counts as enough to stay [-].
const LEAST_STIFFNESS: f64 = 0.1;

/// An equilibrium, or a pose that is held.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Chain coordinates [rad, mm].
    pub q: Six,
    /// What the laboratory would read: FE, VV, IE [rad], ML, AP, SI [mm].
    pub observed: Six,
    /// Derivative of the five balances and of the read flexion by the coordinates; rows in the order of the coordinates.
    pub tangent: Matrix6<f64>,
    /// Whether the balance was reached.
    pub balanced: bool,
    /// What is out of balance there; nearly nothing where the balance was reached.
    pub miss: Six,
    /// Where cartilage nearly touches there, for poses close by.
    pub near: Nearby,
}

impl Equilibrium {
    /// A search that begins here.
    pub fn start(&self) -> Start {
        Start { q: self.q, near: self.near.clone() }
    }
}

/// Where a search for an equilibrium begins.
#[derive(Clone, Debug)]
pub struct Start {
    /// Chain coordinates [rad, mm].
    pub q: Six,
    /// Where cartilage nearly touches there, as far as that is known: it saves time, and no answer depends on it.
    pub near: Nearby,
}

impl Start {
    /// At coordinates of which nothing else is known.
    pub fn at(q: Six) -> Start {
        Start { q, near: Nearby::default() }
    }
}

/// Loads [N mm, N] at a read flexion [rad].
#[derive(Clone, Copy, Debug)]
pub struct Ask {
    /// Generalised load, the order of [`crate::joint`].
    pub load: Six,
    /// Flexion that is read.
    pub flexion: f64,
}

/// Generalised force [N mm, N] of an external field under a load at chain coordinates.
pub type Field<'a> = &'a dyn Fn(&Six, &Six) -> Six;
/// What a laboratory reads where Grood-Suntay coordinates are given [rad, mm].
pub type Reading<'a> = &'a dyn Fn(&Six) -> Six;

/// A model with what acts on it from outside and how it is read.
#[derive(Clone, Copy)]
pub struct Rig<'a> {
    /// The model.
    pub model: &'a Model,
    /// The external field, where there is one.
    pub field: Option<Field<'a>>,
    /// How it is read, where that differs from the Grood-Suntay coordinates.
    pub reading: Option<Reading<'a>>,
}

/// Springs that hold a read pose.
#[derive(Clone, Copy, Debug)]
pub struct Restraint {
    /// The pose: FE, VV, IE [rad], ML, AP, SI [mm].
    pub to: Six,
    /// How far each gives way under `hold_n`: VV, IE [deg], ML, AP, SI [mm]; flexion has no spring.
    pub gives: Free<f64>,
    /// That force [N]; rotations by a lever of 20 mm.
    pub hold_n: f64,
}

impl Rig<'_> {
    /// The equilibrium next to some coordinates.
    pub fn settle(&self, ask: &Ask, start: &Start) -> Equilibrium {
        let (mut q, mut near) = (start.q, start.near.lists());
        let mut trust = 1.0;
        let mut before = f64::INFINITY;
        let mut state = self.balance(ask, &q, &mut near);
        let mut balanced = false;
        for _ in 0..MOST_STEPS[0] {
            let size = state.size();
            if state.is_balanced() {
                balanced = true;
                break;
            }
            trust = if size < before { (trust * 2.0f64).min(1.0) } else { (trust * 0.5f64).max(0.05) };
            before = size;
            let step = limited(&state.step(), trust);
            q += step;
            state = self.balance(ask, &q, &mut near);
        }
        state.at(q, balanced, &near)
    }

    /// The whole way from the CT pose: compression, then flexion, then the load.
    pub fn walk(&self, ask: &Ask) -> Equilibrium {
        self.loaded(ask, &self.flexed(ask))
    }

    /// The way from the CT pose to a flexion under compression alone. It is the same for every load of one flexion and compression.
    pub fn flexed(&self, ask: &Ask) -> Start {
        let compression = compression_of(ask);
        let from = self.model.joint.ct_pose()[FE];
        let steps = ((ask.flexion - from).abs() / FLEXION_STEP).ceil().max(1.0) as usize;
        let mut at = Start::at(Six::zeros());
        for k in 0..=steps {
            let flexion = from + (ask.flexion - from) * k as f64 / steps as f64;
            at = self.settle(&Ask { load: compression, flexion }, &at).start();
        }
        at
    }

    /// The way from there to the whole load.
    pub fn loaded(&self, ask: &Ask, from: &Start) -> Equilibrium {
        let (compression, mut at) = (compression_of(ask), from.clone());
        for part in [0.25, 0.5, 0.75] {
            let load = compression + (ask.load - compression) * part;
            at = self.settle(&Ask { load, ..*ask }, &at).start();
        }
        // the load's last part as the sum above has it, so that the way does not depend on rounding
        let load = compression + (ask.load - compression) * 1.0;
        self.settle(&Ask { load, ..*ask }, &at)
    }

    /// The pose next to some coordinates that springs hold: what is then out of balance is what the model lacks there.
    pub fn restrained(&self, ask: &Ask, by: &Restraint, start: &Start) -> Equilibrium {
        let springs = Matrix6::from_diagonal(&Six::from(by.springs()));
        let (mut q, mut near) = (start.q, start.near.lists());
        let mut state = self.balance(ask, &q, &mut near);
        for _ in 0..MOST_STEPS[1] {
            // the springs act on what is read: a misreading moves where they hold
            let slope = self.observe_derivative(&q);
            let pull = slope.transpose() * springs;
            let (force, stiffness) = (pull * (state.observed - by.to), pull * slope);
            let mut pulled = Balance { miss: state.miss, tangent: state.tangent, observed: state.observed };
            for &j in &FREE {
                pulled.miss[j] += force[j];
                let j = j.index();
                (0..6).for_each(|k| pulled.tangent[(j, k)] += stiffness[(j, k)]);
            }
            if pulled.size() < 1.0 {
                break;
            }
            q += limited(&pulled.step(), RESTRAINED_STEP);
            state = self.balance(ask, &q, &mut near);
        }
        state.at(q, true, &near)
    }

    /// The equilibrium that is reached when the springs are let go little by little: on the branch of the pose that they hold, where a loaded knee has several.
    pub fn released(&self, ask: &Ask, from: &Restraint, start: &Start) -> Equilibrium {
        let held = |at: Start, part: &f64| self.restrained(ask, &from.weaker(*part), &at).start();
        self.settle(ask, &LET_GO.iter().fold(start.clone(), held))
    }

    fn balance(&self, ask: &Ask, q: &Six, near: &mut Nearby) -> Balance {
        let at = self.model.evaluate_near(q, near);
        let extra = self.external(&ask.load, q);
        let observed = self.observe(q);
        let mut tangent = at.hessian;
        if self.field.is_some() {
            tangent -= self.external_tangent(&ask.load, q);
        }
        let mut miss = at.gradient - ask.load - extra;
        miss[FE] = observed[FE] - ask.flexion;
        tangent.set_row(FE.index(), &self.observe_derivative(q).row(FE.index()).into_owned());
        Balance { miss, tangent, observed }
    }

    /// Generalised force of the external field, beside the load.
    pub fn external(&self, load: &Six, q: &Six) -> Six {
        self.field.map_or_else(Six::zeros, |field| field(load, q))
    }

    /// Its derivative by the coordinates, by central differences.
    pub fn external_tangent(&self, load: &Six, q: &Six) -> Matrix6<f64> {
        let mut out = Matrix6::zeros();
        for j in 0..6 {
            let h = if j <= IE.index() { 1e-5 } else { 1e-3 };
            let (mut up, mut down) = (*q, *q);
            up[j] += h;
            down[j] -= h;
            let d = (self.external(load, &up) - self.external(load, &down)) / (2.0 * h);
            out.set_column(j, &d);
        }
        out
    }

    /// What the laboratory reads at `q`.
    pub fn observe(&self, q: &Six) -> Six {
        let gs = self.model.joint.grood_suntay(q);
        self.reading.map_or(gs, |read| read(&gs))
    }

    /// Derivative of the reading by the coordinates.
    pub fn observe_derivative(&self, q: &Six) -> Matrix6<f64> {
        if self.reading.is_none() {
            return self.model.joint.grood_suntay_derivative(q);
        }
        let mut out = Matrix6::zeros();
        for j in 0..6 {
            let h = if j <= IE.index() { 1e-6 } else { 1e-4 };
            let (mut up, mut down) = (*q, *q);
            up[j] += h;
            down[j] -= h;
            out.set_column(j, &((self.observe(&up) - self.observe(&down)) / (2.0 * h)));
        }
        out
    }
}

impl Restraint {
    /// With a part of the force.
    fn weaker(&self, part: f64) -> Restraint {
        Restraint { hold_n: self.hold_n * part, ..*self }
    }

    /// Stiffness of the springs [N mm/rad, N/mm].
    fn springs(&self) -> [f64; 6] {
        ALL.map(|c| match c {
            FE => 0.0,
            c if c.turns() => self.hold_n * SPRING_LEVER_MM / self.gives[c].to_radians(),
            c => self.hold_n / self.gives[c],
        })
    }

    /// A tangent no less stiff, in any direction, than a tenth of the springs: where a knee is about to leave the joint its own may be next to nothing, or
    /// negative, and a force out of balance would move it anywhere.
    pub fn stiffened(&self, tangent: &Matrix6<f64>) -> Matrix6<f64> {
        let springs = self.springs();
        let unit = FREE.map(|c| springs[c.index()].sqrt());
        let free = free_block(tangent);
        let block = Matrix5::from_fn(|a, b| free[(a, b)] / (unit[a] * unit[b]));
        let eigen = ((block + block.transpose()) * 0.5).symmetric_eigen();
        let lacking = eigen.eigenvalues.map(|own| (LEAST_STIFFNESS - own).max(0.0));
        let added = eigen.eigenvectors * Matrix5::from_diagonal(&lacking) * eigen.eigenvectors.transpose();
        let mut out = *tangent;
        for (a, &j) in FREE.iter().enumerate() {
            for (b, &k) in FREE.iter().enumerate() {
                out[(j.index(), k.index())] += added[(a, b)] * unit[a] * unit[b];
            }
        }
        out
    }
}

/// The compression of a load alone.
fn compression_of(ask: &Ask) -> Six {
    let mut compression = Six::zeros();
    compression[SI] = ask.load[SI];
    compression
}

/// Searches that begin at these equilibria.
pub fn starts_of(rests: &[Equilibrium]) -> Vec<Start> {
    rests.iter().map(Equilibrium::start).collect()
}

/// Balance at a pose.
struct Balance {
    /// What is out of balance; the first is the read flexion's miss.
    miss: Six,
    tangent: Matrix6<f64>,
    observed: Six,
}

impl Balance {
    /// The pose as it is told.
    fn at(self, q: Six, balanced: bool, near: &Nearby) -> Equilibrium {
        Equilibrium { q, observed: self.observed, tangent: self.tangent, balanced, miss: self.miss, near: near.lists() }
    }

    fn is_balanced(&self) -> bool {
        self.miss[FE].abs() < SAME_FLEXION && FREE.iter().all(|&c| self.miss[c].abs() < BALANCED[c.index()])
    }

    /// Size of the imbalance [N].
    fn size(&self) -> f64 {
        let lever = |c: Coordinate| if c.turns() { LEVER_MM } else { 1.0 };
        FREE.iter().map(|&j| (self.miss[j] / lever(j)).powi(2)).sum::<f64>().sqrt()
    }

    /// Newton's step; where the free block is not positive definite its eigenvalues are turned up, so that the step goes downhill.
    fn step(&self) -> Six {
        let scale = scales();
        let (tangent, miss) = (free_block(&self.tangent), free_part(&self.miss));
        let by_flexion = free_part(&self.tangent.column(FE.index()).into_owned());
        let block = Matrix5::from_fn(|a, b| tangent[(a, b)] * scale[a] * scale[b]);
        let mut step = Six::zeros();
        // flexion first: the reading depends on it almost alone
        step[FE] = -self.miss[FE] / self.tangent[(FE.index(), FE.index())];
        let rhs = Vector5::from_fn(|a, _| -(miss[a] + by_flexion[a] * step[FE]) * scale[a]);
        let symmetric = (block + block.transpose()) * 0.5;
        let eigen = symmetric.symmetric_eigen();
        let least = 1e-4 * eigen.eigenvalues.amax().max(1e-9);
        let free = if eigen.eigenvalues.min() > least {
            block.lu().solve(&rhs).unwrap_or_else(Vector5::zeros)
        } else {
            let along = eigen.eigenvectors.tr_mul(&rhs);
            let turned = Vector5::from_fn(|a, _| along[a] / eigen.eigenvalues[a].abs().max(least));
            eigen.eigenvectors * turned
        };
        for (a, &j) in FREE.iter().enumerate() {
            step[j] = free[a] * scale[a];
        }
        step
    }
}

/// Unit steps of the free coordinates: a millimetre at the lever.
fn scales() -> [f64; 5] {
    FREE.map(|c| if c.turns() { 1.0 / LEVER_MM } else { 1.0 })
}

/// The step cut to `trust` of the largest.
fn limited(step: &Six, trust: f64) -> Six {
    let ratio = (0..6).map(|j| step[j].abs() / (LARGEST_STEP[j] * trust)).fold(1.0, f64::max);
    step / ratio
}

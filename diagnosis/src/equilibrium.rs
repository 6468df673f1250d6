//! Where the knee rests under a trial's load and the effects of a hypothesis: the way there, and what moves it.
//!
//! Flexion is set so that the recorded flexion is what the laboratory would have read; the five other coordinates balance the model's forces,
//! the trial's load and the effects' generalised forces. Friction is left out: it is a source of scatter here, not of position.

use crate::effect::{Active, Place};
use crate::trial::Trial;
use nalgebra::{Matrix5, Matrix6, SMatrix, Vector5};
use sim::Model;
use sim::contact::Nearby;
use sim::joint::{AP, FE, FREE, IE, ML, SI, Six, VV};

/// Largest Newton step: rotations [rad], translations [mm].
const LARGEST_STEP: [f64; 6] = [0.1, 0.1, 0.1, 4.0, 4.0, 4.0];
/// Forces are in balance within this: moments [N mm], forces [N].
const BALANCED: [f64; 6] = [0.0, 0.5, 0.5, 0.01, 0.01, 0.01];
/// Flexion agrees within this [rad].
const SAME_FLEXION: f64 = 1e-8;

/// Force at which a spring that holds the measured pose gives way by the noise [N]; moments by a lever of 20 mm.
const HOLD: f64 = 100.0;
/// Stiffness of a knee on the brink, over that of those springs, that counts as enough to stay [-].
const LEAST: f64 = 0.1;

/// A resting pose.
#[derive(Clone, Debug)]
pub struct Rest {
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
}

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
    /// The rest under `trial`, from nearby coordinates.
    pub fn settle(&self, trial: &Trial, start: &Six) -> Rest {
        self.settle_with(trial, &trial.load, trial.flexion, start)
    }

    /// The whole way from the CT pose: compression, then flexion, then the trial's load.
    pub fn walk(&self, trial: &Trial) -> Rest {
        let mut compression = Six::zeros();
        compression[SI] = trial.load[SI];
        let from = self.model.joint.ct_pose()[FE];
        let steps = ((trial.flexion - from).abs() / 0.1).ceil().max(1.0) as usize;
        let mut q = Six::zeros();
        for k in 0..=steps {
            let flexion = from + (trial.flexion - from) * k as f64 / steps as f64;
            q = self.settle_with(trial, &compression, flexion, &q).q;
        }
        let mut rest = None;
        for part in [0.25, 0.5, 0.75, 1.0] {
            let load = compression + (trial.load - compression) * part;
            let at = self.settle_with(trial, &load, trial.flexion, &q);
            q = at.q;
            rest = Some(at);
        }
        rest.unwrap_or_else(|| self.settle(trial, &q))
    }

    /// Only compression and flexion: the pose from which the trial's load departs.
    pub fn neutral(&self, trial: &Trial) -> Rest {
        self.walk(&unloaded(trial))
    }

    /// The same from nearby coordinates.
    pub fn neutral_near(&self, trial: &Trial, start: &Six) -> Rest {
        self.settle(&unloaded(trial), start)
    }

    /// The pose from `start` that reads next to what was `measured` (Grood-Suntay coordinates [rad, mm]), held there by springs that give way by about
    /// the measurement's noise: what is then out of balance is what the model lacks in that trial, however far it would move the knee.
    pub fn held(&self, trial: &Trial, measured: &Six, start: &Six) -> Rest {
        self.held_by(trial, measured, start, HOLD)
    }

    /// The rest that is reached when those springs are let go little by little: on the branch of the measured pose, where a loaded knee has several.
    pub fn released(&self, trial: &Trial, measured: &Six, start: &Six) -> Rest {
        let parts = [1.0, 0.3, 0.1, 0.03, 0.01];
        let q = parts.iter().fold(*start, |q, part| self.held_by(trial, measured, &q, HOLD * part).q);
        self.settle(trial, &q)
    }

    /// A tangent no less stiff, in any direction, than springs that give way by some ten noises under the force that holds a pose: where a knee is about
    /// to leave the joint its own may be next to nothing, or negative, and a force out of balance would move it anywhere.
    pub fn stiffened(&self, trial: &Trial, tangent: &Matrix6<f64>) -> Matrix6<f64> {
        let springs = springs(trial, HOLD);
        let unit: [f64; 5] = FREE.map(|j| springs[j].sqrt());
        let block = Matrix5::from_fn(|a, b| tangent[(FREE[a], FREE[b])] / (unit[a] * unit[b]));
        let eigen = ((block + block.transpose()) * 0.5).symmetric_eigen();
        let lacking = eigen.eigenvalues.map(|own| (LEAST - own).max(0.0));
        let added = eigen.eigenvectors * Matrix5::from_diagonal(&lacking) * eigen.eigenvectors.transpose();
        let mut out = *tangent;
        for (a, &j) in FREE.iter().enumerate() {
            for (b, &k) in FREE.iter().enumerate() {
                out[(j, k)] += added[(a, b)] * unit[a] * unit[b];
            }
        }
        out
    }

    /// Held by springs of a force `hold` at the noise [N], from `start`. The springs act on what is read: an effect that misreads moves where they hold.
    fn held_by(&self, trial: &Trial, measured: &Six, start: &Six, hold: f64) -> Rest {
        let springs = Matrix6::from_diagonal(&Six::from(springs(trial, hold)));
        let (mut q, mut near) = (*start, Nearby::default());
        let mut state = self.balance(trial, (&trial.load, trial.flexion), &q, &mut near);
        for _ in 0..12 {
            let by = self.observe_derivative(trial, &q);
            let pull = by.transpose() * springs;
            let (force, stiffness) = (pull * (state.observed - measured), pull * by);
            let mut pulled = Balance { miss: state.miss, tangent: state.tangent, observed: state.observed };
            for &j in &FREE {
                pulled.miss[j] += force[j];
                (0..6).for_each(|k| pulled.tangent[(j, k)] += stiffness[(j, k)]);
            }
            if pulled.size() < 1.0 {
                break;
            }
            q += limited(&pulled.step(), 0.25);
            state = self.balance(trial, (&trial.load, trial.flexion), &q, &mut near);
        }
        Rest { q, observed: state.observed, tangent: state.tangent, balanced: true, miss: state.miss }
    }

    fn settle_with(&self, trial: &Trial, load: &Six, flexion: f64, start: &Six) -> Rest {
        let (mut q, mut near) = (*start, Nearby::default());
        let mut trust = 1.0;
        let mut before = f64::INFINITY;
        let mut state = self.balance(trial, (load, flexion), &q, &mut near);
        let mut balanced = false;
        for _ in 0..60 {
            let size = state.size();
            if state.is_balanced() {
                balanced = true;
                break;
            }
            trust = if size < before { (trust * 2.0f64).min(1.0) } else { (trust * 0.5f64).max(0.05) };
            before = size;
            let step = limited(&state.step(), trust);
            q += step;
            state = self.balance(trial, (load, flexion), &q, &mut near);
        }
        Rest { q, observed: state.observed, tangent: state.tangent, balanced, miss: state.miss }
    }

    fn balance(&self, trial: &Trial, (load, flexion): (&Six, f64), q: &Six, near: &mut Nearby) -> Balance {
        let at = self.model.evaluate_near(q, near);
        let extra = self.effects_at(trial, load, q);
        let observed = self.observe(trial, q);
        let mut tangent = at.hessian;
        if self.effects.iter().any(Active::has_force) {
            tangent -= self.effects_tangent(trial, load, q);
        }
        let mut miss = at.gradient - load - extra;
        miss[FE] = observed[FE] - flexion;
        tangent.set_row(FE, &self.observe_derivative(trial, q).row(FE).into_owned());
        Balance { miss, tangent, observed }
    }

    /// Generalised force of all effects, beside the recorded load.
    pub fn effects_at(&self, trial: &Trial, load: &Six, q: &Six) -> Six {
        let mut out = Six::zeros();
        if self.effects.iter().any(Active::has_force) {
            let here = self.place.situation(self.model, trial, load, q);
            for effect in self.effects {
                out += effect.force(&here);
            }
        }
        out
    }

    /// Its derivative by the coordinates, by central differences.
    pub fn effects_tangent(&self, trial: &Trial, load: &Six, q: &Six) -> Matrix6<f64> {
        let mut out = Matrix6::zeros();
        for j in 0..6 {
            let h = if j <= IE { 1e-5 } else { 1e-3 };
            let (mut up, mut down) = (*q, *q);
            up[j] += h;
            down[j] -= h;
            let d = (self.effects_at(trial, load, &up) - self.effects_at(trial, load, &down)) / (2.0 * h);
            out.set_column(j, &d);
        }
        out
    }

    /// What the laboratory reads at `q`.
    pub fn observe(&self, trial: &Trial, q: &Six) -> Six {
        let mut gs = self.model.joint.grood_suntay(q);
        if self.effects.iter().any(Active::has_reading) {
            for effect in self.effects {
                gs = effect.read(&gs, trial, self.place);
            }
        }
        gs
    }

    /// Derivative of the reading by the coordinates.
    pub fn observe_derivative(&self, trial: &Trial, q: &Six) -> Matrix6<f64> {
        if !self.effects.iter().any(Active::has_reading) {
            return self.model.joint.grood_suntay_derivative(q);
        }
        let mut out = Matrix6::zeros();
        for j in 0..6 {
            let h = if j <= IE { 1e-6 } else { 1e-4 };
            let (mut up, mut down) = (*q, *q);
            up[j] += h;
            down[j] -= h;
            out.set_column(j, &((self.observe(trial, &up) - self.observe(trial, &down)) / (2.0 * h)));
        }
        out
    }
}

/// A trial with its compression alone.
fn unloaded(trial: &Trial) -> Trial {
    let mut load = Six::zeros();
    load[SI] = trial.load[SI];
    Trial { load, ..trial.clone() }
}

/// Balance at a pose.
struct Balance {
    /// What is out of balance; the first is the read flexion's miss.
    miss: Six,
    tangent: Matrix6<f64>,
    observed: Six,
}

impl Balance {
    fn is_balanced(&self) -> bool {
        self.miss[FE].abs() < SAME_FLEXION && FREE.iter().all(|&j| self.miss[j].abs() < BALANCED[j])
    }

    /// Size of the imbalance, moments by a lever of 30 mm [N].
    fn size(&self) -> f64 {
        let lever = |j: usize| if j == VV || j == IE { 30.0 } else { 1.0 };
        FREE.iter().map(|&j| (self.miss[j] / lever(j)).powi(2)).sum::<f64>().sqrt()
    }

    /// Newton's step; where the free block is not positive definite its eigenvalues are turned up, so that the step goes downhill.
    fn step(&self) -> Six {
        let scale = scales();
        let block: Matrix5<f64> = Matrix5::from_fn(|a, b| self.tangent[(FREE[a], FREE[b])] * scale[a] * scale[b]);
        let mut step = Six::zeros();
        // flexion first: the reading depends on it almost alone
        step[FE] = -self.miss[FE] / self.tangent[(FE, FE)];
        let rhs: Vector5<f64> =
            Vector5::from_fn(|a, _| -(self.miss[FREE[a]] + self.tangent[(FREE[a], FE)] * step[FE]) * scale[a]);
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

/// Unit steps of the free coordinates: a millimetre at 30 mm.
fn scales() -> [f64; 5] {
    FREE.map(|j| if j == VV || j == IE { 1.0 / 30.0 } else { 1.0 })
}

/// The step cut to `trust` of the largest.
fn limited(step: &Six, trust: f64) -> Six {
    let ratio = (0..6).map(|j| step[j].abs() / (LARGEST_STEP[j] * trust)).fold(1.0, f64::max);
    step / ratio
}

/// Derivatives of the reading (VV, IE, ML, AP, SI) [rad, mm] by what is out of balance (rows of the tangent): five by six.
pub fn reading_by_balance(rest: &Rest, reading: &Matrix6<f64>) -> Option<SMatrix<f64, 5, 6>> {
    let inverse = rest.tangent.try_inverse()?;
    let all = reading * inverse;
    Some(SMatrix::from_fn(|a, b| all[([VV, IE, ML, AP, SI][a], b)]))
}

/// Springs that give way by a noise of the trial under a force `hold` [N], rotations by a lever of 20 mm.
fn springs(trial: &Trial, hold: f64) -> [f64; 6] {
    std::array::from_fn(|j| match j {
        FE => 0.0,
        VV | IE => hold * 20.0 / trial.sd[j - 1].to_radians(),
        _ => hold / trial.sd[j - 1],
    })
}

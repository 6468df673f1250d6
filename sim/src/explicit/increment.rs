//! One increment.

use super::forces::{self, Forces};
use super::options::{ExplicitOptions, Increments};
use super::program::{Drive, Step};
use super::state::ExplicitState;
use super::twist::twists;
use crate::contact::{FrictionState, Nearby};
use crate::coordinate::{LEVER_MM, Six};
use crate::error::SimError;
use crate::model::Model;
use nalgebra::Matrix6;

/// Furthest a coordinate may go in one increment [rad, mm]; further is a motion out of hand.
const FURTHEST: [f64; 6] = [0.3, 0.3, 0.3, 10.0, 10.0, 10.0];
/// Corrections of the middle of the increment.
const CORRECTIONS: usize = 2;
/// First increment of a step, of the stable one [-].
const FIRST: f64 = 0.1;
/// Most an increment may be longer than the one before [-].
const GROWTH: f64 = 1.25;
/// Furthest a free coordinate may go in one increment, rotations at [`LEVER_MM`] [mm].
const LEAP: f64 = 0.2;
/// Smallest increment, of the longest allowed [-].
const SMALLEST: f64 = 1e-6;

/// Does a step's increments.
pub(super) struct Stepper<'a> {
    model: &'a Model,
    step: &'a Step,
    options: &'a ExplicitOptions,
    longest: f64,
    mass: f64,
    inertia: f64,
}

/// What an increment tells.
pub(super) struct Done {
    /// Its length [s].
    pub(super) increment_s: f64,
    /// Loads; reactions of prescribed coordinates.
    pub(super) drive: Six,
}

/// A node of time and the half increment after it.
struct Node {
    length: f64,
    ends: bool,
    rate: Six,
    momentum: Six,
    drive: Six,
    held: FrictionState,
}

/// Dashpots of an increment: the matrix, and how much of it acts on the new rates.
struct Damping {
    matrix: Matrix6<f64>,
    forward: f64,
}

impl<'a> Stepper<'a> {
    pub(super) fn new(model: &'a Model, step: &'a Step, options: &'a ExplicitOptions) -> Self {
        let (mass, inertia) = model.femur_mass;
        let longest = step.increment_s.unwrap_or(options.longest_increment_s);
        let scale = options.mass_scale;
        Stepper { model, step, options, longest, mass: mass * scale, inertia: inertia * scale }
    }

    /// One increment: forces here, rates at the middle, coordinates at the end.
    pub(super) fn advance(&self, state: &mut ExplicitState, near: &mut Nearby) -> Result<Done, SimError> {
        let node = self.node(state, None, near)?;
        let Node { length, rate, momentum, drive, held, ends } = node;
        state.friction = held;
        state.last_step = rate * length;
        state.q += state.last_step;
        (state.rate, state.momentum, state.last_increment_s) = (rate, momentum, length);
        state.time_s = if ends { self.step.duration_s } else { state.time_s + length };
        state.increments += 1;
        self.check(state)?;
        Ok(Done { increment_s: length, drive })
    }

    /// End of the step: velocities are brought to its last node by half a kick, so that the next step starts from there.
    pub(super) fn close(&self, state: &mut ExplicitState, near: &mut Nearby) -> Result<(), SimError> {
        let node = self.node(state, Some(state.last_increment_s), near)?;
        state.friction = node.held;
        state.momentum = 0.5 * (state.momentum + node.momentum);
        state.rate = 0.5 * (state.rate + node.rate);
        (state.last_step, state.last_increment_s) = (Six::zeros(), 0.0);
        let synchronised = 0.5 * state.momentum.dot(&self.velocity(&state.momentum));
        // the leapfrog's energy and the energy differ by the square of an increment
        state.energies.initial += synchronised - state.energies.kinetic;
        state.energies.kinetic = synchronised;
        Ok(())
    }

    /// Forces at the node of time where `state` stands, booked, and the next half increment's rates.
    fn node(&self, state: &mut ExplicitState, length: Option<f64>, near: &mut Nearby) -> Result<Node, SimError> {
        let pose = self.model.joint.pose(&state.q);
        let here = twists(self.model, &pose);
        let forces = forces::at(self.model, &pose, self.step.contact.then_some(near), self.options, state);
        let mass = here.transpose() * self.mass_matrix() * here;
        let matrix = forces.damping + Matrix6::from_diagonal(&self.step.damping);
        let (length, ends) = match length {
            Some(length) => (length, true),
            None => self.length(state, &forces, &mass, &matrix)?,
        };
        let between = 0.5 * (state.last_increment_s + length);
        let damping = Damping { forward: self.forward(&matrix, &mass, between), matrix };

        let loads = self.loads(state.time_s);
        let push = forces.elastic + forces.friction + loads;
        let (rate, momentum) = self.solve(state, (&here, length), &push, &damping)?;

        let resisted = damping.matrix * (rate * damping.forward + state.rate * (1.0 - damping.forward));
        let reaction = here.transpose() * (momentum - state.momentum) / between - push + resisted;
        let drive = Six::from_fn(|c, _| if self.is_prescribed(c) { reaction[c] } else { loads[c] });
        self.book(state, &forces, &momentum, [drive, -resisted, forces.friction]);
        Ok(Node { length, ends, rate, momentum, drive, held: forces.held })
    }

    /// Rates and momentum at the next half increment.
    fn solve(
        &self,
        state: &ExplicitState,
        (here, length): (&Matrix6<f64>, f64),
        push: &Six,
        damping: &Damping,
    ) -> Result<(Six, Six), SimError> {
        let between = 0.5 * (state.last_increment_s + length);
        let known = here.transpose() * state.momentum
            + (push - damping.matrix * state.rate * (1.0 - damping.forward)) * between;
        let prescribed = self.prescribed(state, length);
        let (mut rate, mut momentum) = (state.rate, state.momentum);
        for _ in 0..CORRECTIONS {
            let middle = self.model.joint.pose(&(state.q + rate * (0.5 * length)));
            let moving = self.mass_matrix() * twists(self.model, &middle);
            let mut system = here.transpose() * moving + damping.matrix * (damping.forward * between);
            let mut right = known;
            for (c, value) in prescribed.iter().enumerate() {
                if let Some(value) = value {
                    system.row_mut(c).fill(0.0);
                    system[(c, c)] = 1.0;
                    right[c] = *value;
                }
            }
            rate = system.lu().solve(&right).ok_or_else(|| self.lost(state))?;
            momentum = moving * rate;
        }
        Ok((rate, momentum))
    }

    /// Isotropic inertia and mass.
    fn mass_matrix(&self) -> Matrix6<f64> {
        let (i, m) = (self.inertia, self.mass);
        Matrix6::from_diagonal(&Six::new(i, i, i, m, m, m))
    }

    fn is_prescribed(&self, coordinate: usize) -> bool {
        matches!(self.step.drive[coordinate], Drive::Motion(_))
    }

    /// Rates that bring prescribed coordinates to where they shall be at the increment's end.
    fn prescribed(&self, state: &ExplicitState, length: f64) -> [Option<f64>; 6] {
        let start = state.step_start.unwrap_or(state.q);
        std::array::from_fn(|c| match &self.step.drive[c] {
            Drive::Motion(course) => {
                let goal = start[c] + course.at(state.time_s + length);
                Some((goal - state.q[c]) / length)
            }
            Drive::Load(_) => None,
        })
    }

    /// Loads at a time of the step.
    fn loads(&self, time: f64) -> Six {
        Six::from_fn(|c, _| match &self.step.drive[c] {
            Drive::Load(course) => course.at(time),
            Drive::Motion(_) => 0.0,
        })
    }

    /// The share of dashpots that acts on the new rates: a half for light ones, all for heavy ones, exact for one alone.
    fn forward(&self, damping: &Matrix6<f64>, mass: &Matrix6<f64>, length: f64) -> f64 {
        let free = (0..6).filter(|&c| !self.is_prescribed(c));
        let z = free.fold(0.0, |z: f64, c| z.max(damping[(c, c)] / mass[(c, c)])) * length;
        if z < 1e-3 { 0.5 + z / 12.0 } else { 1.0 / -(-z).exp_m1() - 1.0 / z }
    }

    /// Length of the next increment [s], and whether it ends the step.
    fn length(
        &self,
        state: &ExplicitState,
        forces: &Forces,
        mass: &Matrix6<f64>,
        damping: &Matrix6<f64>,
    ) -> Result<(f64, bool), SimError> {
        let mut length = self.longest;
        if self.options.control == Increments::Stable {
            let last = state.last_increment_s;
            let mut guess = last;
            for _ in 0..4 {
                // dashpots that act on the new rates stiffen the mass: dt^2 K < 4 M + 2 (2 forward - 1) dt C
                let share = self.forward(damping, mass, guess) - 0.5;
                let heavy = mass + damping * (share * guess);
                length = (self.options.safety * 2.0 / self.fastest(&forces.stiffness, &heavy).sqrt()).min(self.longest);
                if length >= 0.98 * guess {
                    break;
                }
                guess = length;
            }
            // contact that is not there yet is not in the stiffness: start small, grow slowly, do not leap
            length = if last > 0.0 { length.min(GROWTH * last) } else { FIRST * length };
            let speed =
                crate::coordinate::FREE.iter().map(|&c| state.rate[c].abs() * if c.turns() { LEVER_MM } else { 1.0 });
            length = length.min(LEAP / speed.fold(1e-9, f64::max));
        }
        if length.is_nan() || length <= SMALLEST * self.longest {
            return Err(self.lost(state));
        }
        let left = self.step.duration_s - state.time_s;
        let count = (left / length - 1e-9).ceil().max(1.0);
        Ok(if count <= 2.0 { (left / count, count == 1.0) } else { (length, false) })
    }

    /// Largest eigenvalue of stiffness against mass over the free coordinates [1/s2].
    fn fastest(&self, stiffness: &Matrix6<f64>, mass: &Matrix6<f64>) -> f64 {
        let (mut k, mut m) = (*stiffness, *mass);
        for c in (0..6).filter(|&c| self.is_prescribed(c)) {
            for matrix in [&mut k, &mut m] {
                matrix.row_mut(c).fill(0.0);
                matrix.column_mut(c).fill(0.0);
            }
            m[(c, c)] = 1.0;
        }
        let Some(root) = nalgebra::Cholesky::new((m + m.transpose()) * 0.5) else { return f64::NAN };
        let Some(half) = root.l_dirty().solve_lower_triangular(&k) else { return f64::NAN };
        let Some(whole) = root.l_dirty().solve_lower_triangular(&half.transpose()) else { return f64::NAN };
        ((whole + whole.transpose()) * 0.5).symmetric_eigenvalues().max().max(1e-12)
    }

    /// Books the energies of the node at the increment's start: kinetic energy, stored energies, work since the node before.
    fn book(&self, state: &mut ExplicitState, forces: &Forces, momentum: &Six, now: [Six; 3]) {
        let after = self.velocity(momentum);
        let e = &mut state.energies;
        if state.last_increment_s == 0.0 {
            // a synchronised start has half an increment's momentum behind it, mirrored
            let kinetic = state.momentum.dot(&after) - 0.5 * momentum.dot(&after);
            e.initial += kinetic - e.kinetic;
            e.kinetic = kinetic;
        } else {
            let work = |k: usize| 0.5 * (state.last_forces[k] + now[k]).dot(&state.last_step);
            e.external += work(0);
            e.damping -= work(1);
            e.friction -= work(2);
            e.kinetic = 0.5 * state.momentum.dot(&after);
        }
        (e.strain, e.contact) = (forces.strain, forces.contact);
        e.note();
        state.last_forces = now;
    }

    /// Velocity of a momentum.
    fn velocity(&self, momentum: &Six) -> Six {
        Six::from_fn(|c, _| momentum[c] / if c < 3 { self.inertia } else { self.mass })
    }

    /// Refuses a motion out of hand.
    fn check(&self, state: &ExplicitState) -> Result<(), SimError> {
        let sane = (0..6).all(|c| state.last_step[c].abs() <= FURTHEST[c] && state.q[c].is_finite());
        if sane { Ok(()) } else { Err(self.lost(state)) }
    }

    fn lost(&self, state: &ExplicitState) -> SimError {
        SimError::Solver(format!(
            "the motion blew up at increment {} ({:.6} s of step {}; the last increment was {:.2e} s): {}; take shorter increments or check the loads",
            state.increments, state.time_s, self.step.name, state.last_increment_s, state.energies
        ))
    }
}

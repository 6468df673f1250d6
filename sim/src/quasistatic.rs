//! Quasi-static solver: the pose of a model under loads, found along the path of its loading.
//!
//! Inertia is left out; what remains of the explicit dynamics are the dashpots, friction and the stored energy. An increment of implicit
//! Euler is then a minimum over the five free coordinates of
//! `E(q) - f . q + dq' C dq / (2 dt) + friction's potential of dq`, with the stored energy E, loads f, the dashpots' C and the increment dq
//! of the coordinates (flexion's share given) [ortiz1999]. It is found by Newton's method with the exact tangent in a trust region, so that
//! a snap is followed downhill to the branch the damped motion would reach. Without dashpots an increment ends in equilibrium.

use crate::contact::{FrictionState, Nearby, Patches};
use crate::coordinate::{ALL, FE, FREE, LEVER_MM, Six, free_block, free_part};
use crate::error::SimError;
use crate::model::{Evaluation, Model};
use nalgebra::{Matrix5, Matrix6, SymmetricEigen, Vector5};
use serde::{Deserialize, Serialize};

/// Furthest a coordinate may move in one Newton step [mm, or rad times [`LEVER_MM`]].
const LONGEST_STEP: f64 = 2.0;
/// A step below this ends a search that is [`close`], unseen [mm, or rad times [`LEVER_MM`]]: what is left is of its square, about 1e-5 mm.
const CLOSE_STEP: f64 = 3e-3;
/// An increment is halved this often at most.
const MOST_HALVINGS: i32 = 6;

/// How increments are solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SolverOptions {
    /// Slip over which a contact patch reaches its Coulomb limit [mm].
    pub slip_mm: f64,
    /// Newton steps below this end an increment on the way [mm, or rad times 30 mm]; convergence is quadratic.
    pub step_on_the_way_mm: f64,
    /// The same at the end of the path [mm].
    pub step_at_the_end_mm: f64,
    /// Furthest an increment with dashpots may end from the extrapolated motion [mm, or rad times 30 mm] before it is halved.
    pub departure_mm: f64,
    /// Most Newton steps of an increment before it is halved [-].
    pub iterations: usize,
}

impl Default for SolverOptions {
    fn default() -> Self {
        SolverOptions {
            slip_mm: 0.02,
            step_on_the_way_mm: 1e-2,
            step_at_the_end_mm: 1e-7,
            departure_mm: 5.0,
            iterations: 40,
        }
    }
}

impl SolverOptions {
    /// Refuses options that mean nothing.
    pub fn check(&self) -> Result<(), SimError> {
        let lengths = [
            ("slip_mm", self.slip_mm),
            ("step_on_the_way_mm", self.step_on_the_way_mm),
            ("step_at_the_end_mm", self.step_at_the_end_mm),
            ("departure_mm", self.departure_mm),
        ];
        if let Some((key, x)) = lengths.into_iter().find(|(_, x)| !(1e-12..=100.0).contains(x)) {
            return Err(SimError::Input(format!("solver.{key} is {x}, expected 1e-12 to 100 mm")));
        }
        if !(5..=100_000).contains(&self.iterations) {
            return Err(SimError::Input(format!("solver.iterations is {}, expected 5 to 100000", self.iterations)));
        }
        Ok(())
    }
}

/// Where a model stands: all that the next increment depends on.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// Coordinates, displacements from the CT pose [rad, mm].
    pub q: Six,
    /// Tangential forces held by the contact.
    pub friction: FrictionState,
    /// Their generalised force on the coordinates, counted with the gradient of the energy [N mm, N].
    pub friction_gradient: Six,
    /// Rate of the last increment, of time where it had dashpots [1/s], else per increment.
    rate: Six,
}

impl State {
    /// At rest at `q`, without friction.
    pub fn at(q: Six) -> State {
        State { q, ..State::default() }
    }
}

/// Viscous resistance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dashpots {
    /// Whether the fibres' own act.
    pub fibres: bool,
    /// On every translation of the chain [N s/mm].
    pub translation: f64,
    /// On every rotation of the chain [N mm s/rad].
    pub rotation: f64,
}

/// What is imposed at the end of an increment.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Flexion from the CT pose, chain coordinate [rad].
    pub flexion: f64,
    /// Loads conjugate to the coordinates [N mm, N]; that of flexion is not used.
    pub load: Six,
    /// Duration [s] and dashpots; `None` asks for equilibrium.
    pub flow: Option<(f64, Dashpots)>,
}

impl Goal {
    /// The loads, that of flexion left out.
    fn checked_load(&self) -> Result<Six, SimError> {
        let mut load = self.load;
        load[FE] = 0.0;
        if !(load.iter().all(|x| x.is_finite()) && self.flexion.is_finite()) {
            return Err(SimError::Input(format!("loads {:?}, flexion {}: not finite", load.as_slice(), self.flexion)));
        }
        Ok(load)
    }
}

/// One piece of a path: flexion and loads go from where they stand to these.
#[derive(Clone, Debug, PartialEq)]
pub struct Phase {
    /// Flexion at its end, from the CT pose [rad].
    pub flexion: f64,
    /// Loads at its end [N mm, N].
    pub load: Six,
    /// When the loads begin to change, as a fraction of the phase [-]; they end with it, by a smooth step.
    pub load_from: f64,
    /// Duration [s] and dashpots; `None`: a sequence of equilibria.
    pub flow: Option<(f64, Dashpots)>,
    /// Increments.
    pub steps: usize,
}

/// A solved increment.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The state at its end.
    pub state: State,
    /// Energy and derivatives there, without friction; on the way those before the last, short, Newton step.
    pub evaluation: Evaluation,
    /// Distance of its end from the extrapolated motion [mm, angles times 30 mm]; 0 without dashpots.
    pub departure: f64,
    /// Evaluations of the model it took.
    pub evaluations: usize,
}

/// The function that is least at the end of an increment.
struct Increment<'a> {
    model: &'a Model,
    from: &'a State,
    load: Six,
    viscous: Option<Matrix6<f64>>,
    patches: Patches,
}

/// Its value and derivatives over all six coordinates.
struct Value {
    objective: f64,
    gradient: Six,
    hessian: Matrix6<f64>,
    evaluation: Evaluation,
}

impl Increment<'_> {
    fn at(&self, q: &Six, near: &mut Nearby) -> Value {
        let evaluation = self.model.evaluate_near(q, near);
        let step = q - self.from.q;
        let mut objective = evaluation.energy - self.load.dot(&step);
        let mut gradient = evaluation.gradient - self.load;
        let mut hessian = evaluation.hessian;
        if let Some(c) = &self.viscous {
            let force = c * step;
            objective += 0.5 * force.dot(&step);
            gradient += force;
            hessian += c;
        }
        self.patches.add(&step, &mut objective, &mut gradient, &mut hessian);
        Value { objective, gradient, hessian, evaluation }
    }
}

/// Solves one increment from `from` to `goal`; `end` asks for the tolerance of a path's end.
///
/// Errors: loads or flexion that are not finite, no minimum within the iterations allowed.
pub fn increment(
    model: &Model,
    from: &State,
    goal: &Goal,
    options: &SolverOptions,
    end: bool,
) -> Result<Solved, SimError> {
    increment_near(model, from, goal, options, end, &mut Nearby::default())
}

/// [`increment`] with the contact's lists of the increment before.
///
/// # Errors
/// As [`increment`].
pub fn increment_near(
    model: &Model,
    from: &State,
    goal: &Goal,
    options: &SolverOptions,
    end: bool,
    near: &mut Nearby,
) -> Result<Solved, SimError> {
    crate::interrupt::check();
    let load = goal.checked_load()?;
    let pose = model.joint.pose(&from.q);
    let viscous = goal.flow.map(|(seconds, dashpots)| damping(model, &pose, &dashpots, near) / seconds);
    let patches = model.contact.patches(&pose, &from.friction, options.slip_mm, near);
    let problem = Increment { model, from, load, viscous, patches };
    let mut start = from.q;
    if let Some((seconds, _)) = goal.flow {
        start += from.rate * seconds;
    }
    start[FE] = goal.flexion;
    let tolerance = if end { options.step_at_the_end_mm } else { options.step_on_the_way_mm };
    let predicted = start;
    near.set_on_the_way(!end);
    let found = minimise(&problem, start, (tolerance, end), options.iterations, near);
    near.set_on_the_way(false);
    let Minimum { value, q, evaluations, .. } = found?;

    let step = q - from.q;
    let (mut friction_gradient, mut unused) = (Six::zeros(), (0.0, Matrix6::zeros()));
    problem.patches.add(&step, &mut unused.0, &mut friction_gradient, &mut unused.1);
    let rate = goal.flow.map_or(Six::zeros(), |(seconds, _)| step / seconds);
    let state = State { q, friction: problem.patches.after(&step), friction_gradient, rate };
    let departure = if goal.flow.is_some() { distance(&(q - predicted)) } else { 0.0 };
    Ok(Solved { state, evaluation: value.evaluation, departure, evaluations })
}

/// The equilibrium without friction that is sought from `start`, close enough for a search among parameters: the last step, below [`CLOSE_STEP`], is
/// taken unseen. Fibres are those at its end, the gradient is the tangent's; the rest of the evaluation is that of the place before.
///
/// # Errors
/// As [`increment`].
pub fn close(
    model: &Model,
    start: Six,
    goal: &Goal,
    options: &SolverOptions,
    near: &mut Nearby,
) -> Result<Solved, SimError> {
    crate::interrupt::check();
    let from = State::at(start);
    let problem =
        Increment { model, from: &from, load: goal.checked_load()?, viscous: None, patches: Patches::default() };
    let mut start = start;
    start[FE] = goal.flexion;
    let Minimum { value, q, unseen, evaluations } =
        minimise(&problem, start, (CLOSE_STEP, false), options.iterations, near)?;
    let mut evaluation = value.evaluation;
    evaluation.gradient += evaluation.hessian * unseen;
    evaluation.fibres = model.fibre_states_near(&model.joint.pose(&q), near);
    Ok(Solved { state: State::at(q), evaluation, departure: 0.0, evaluations })
}

/// Size of a change of the coordinates [mm], angles times [`LEVER_MM`].
fn distance(step: &Six) -> f64 {
    ALL.map(|c| step[c] * if c.turns() { LEVER_MM } else { 1.0 }).iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Resistance of all dashpots at a pose [N s/mm and its like].
fn damping(model: &Model, pose: &crate::joint::Pose, dashpots: &Dashpots, near: &mut Nearby) -> Matrix6<f64> {
    let (r, t) = (dashpots.rotation, dashpots.translation);
    let mut c = Matrix6::from_diagonal(&Six::new(r, r, r, t, t, t));
    if dashpots.fibres {
        for (fibre, state) in model.fibres.iter().zip(model.fibre_states_near(pose, near)) {
            if !model.is_removed(fibre.bundle) {
                let g = state.line.gradient;
                c += g * g.transpose() * model.bundles[fibre.bundle].damping;
            }
        }
    }
    c
}

/// Where [`minimise`] ended.
struct Minimum {
    /// The last place that was looked at.
    value: Value,
    /// The place.
    q: Six,
    /// The step from the last place that was looked at.
    unseen: Six,
    evaluations: usize,
}

impl Minimum {
    /// At the last place that was looked at.
    fn seen(value: Value, q: Six, evaluations: usize) -> Minimum {
        Minimum { value, q, unseen: Six::zeros(), evaluations }
    }
}

/// Newton's method in a trust region until steps are shorter than `tolerance`; the last is taken without looking where it led unless `checked`; the exact step by the eigenvectors of the scaled Hessian.
fn minimise(
    problem: &Increment,
    start: Six,
    (tolerance, checked): (f64, bool),
    iterations: usize,
    near: &mut Nearby,
) -> Result<Minimum, SimError> {
    let (mut q, mut value) = (start, problem.at(&start, near));
    let mut radius = LONGEST_STEP;
    for evaluations in 1..=iterations {
        let (gradient, hessian) = scaled(&value);
        let eigen = SymmetricEigen::new(hessian);
        let step = trust_step(&eigen, &gradient, radius);
        let length = step.norm();
        let expected = -(gradient.dot(&step) + 0.5 * step.dot(&(hessian * step)));
        let next = q + unscaled(&step);
        if !checked && length < tolerance && length < radius {
            return Ok(Minimum { value, q: next, unseen: next - q, evaluations });
        }
        let tried = problem.at(&next, near);
        let gained = value.objective - tried.objective;
        // below this the objective's digits do not tell; the gradient does
        let noise = 1e-12 * (1.0 + value.objective.abs());
        let better = if expected > 100.0 * noise {
            gained > 0.05 * expected
        } else {
            scaled(&tried).0.norm() <= gradient.norm() || length < tolerance
        };
        if !tried.objective.is_finite() {
            return Err(SimError::Solver("the energy is not finite; check loads and parameters".into()));
        }
        if better {
            (q, value) = (next, tried);
            if length < tolerance && length < radius {
                return Ok(Minimum::seen(value, q, evaluations + 1));
            }
            if gained > 0.7 * expected {
                radius = radius.max((2.0 * length).min(LONGEST_STEP));
            }
        } else {
            radius = 0.3 * length;
            if radius < 1e-12 {
                return Ok(Minimum::seen(value, q, evaluations + 1));
            }
        }
    }
    Err(SimError::Solver(format!("no equilibrium within {iterations} Newton steps")))
}

/// Gradient and Hessian over the free coordinates, angles times [`LEVER_MM`].
fn scaled(value: &Value) -> (Vector5<f64>, Matrix5<f64>) {
    let s = FREE.map(|c| if c.turns() { 1.0 / LEVER_MM } else { 1.0 });
    let gradient = free_part(&value.gradient).component_mul(&Vector5::from(s));
    let free = free_block(&value.hessian);
    let hessian = Matrix5::from_fn(|i, j| free[(i, j)] * s[i] * s[j]);
    (gradient, (hessian + hessian.transpose()) * 0.5)
}

/// A step of the free coordinates as one of all six.
fn unscaled(step: &Vector5<f64>) -> Six {
    let mut out = Six::zeros();
    for (i, &c) in FREE.iter().enumerate() {
        out[c] = step[i] * if c.turns() { 1.0 / LEVER_MM } else { 1.0 };
    }
    out
}

/// The least point of the quadratic model within `radius`.
fn trust_step(eigen: &SymmetricEigen<f64, nalgebra::U5>, gradient: &Vector5<f64>, radius: f64) -> Vector5<f64> {
    let g = eigen.eigenvectors.transpose() * gradient;
    let least = eigen.eigenvalues.min();
    let at = |shift: f64| Vector5::from_fn(|i, _| -g[i] / (eigen.eigenvalues[i] + shift).max(1e-12));
    let mut low = if least > 1e-9 { 0.0 } else { -least + 1e-9 };
    if at(low).norm() <= radius {
        return eigen.eigenvectors * at(low);
    }
    let mut high = low + g.norm() / radius + 1e-9;
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if at(middle).norm() > radius {
            low = middle
        } else {
            high = middle
        }
        if high - low < 1e-3 * high {
            break;
        }
    }
    eigen.eigenvectors * at(high)
}

/// Follows a phase of a path; `observe` sees every increment, `near` is kept along the path. Increments with dashpots are shortened where the motion departs from its
/// extrapolation by more than [`SolverOptions::departure_mm`], as in a snap, and lengthened where it does not.
///
/// Errors: as [`increment`], after halving increments in vain.
pub fn follow(
    model: &Model,
    from: &State,
    load: &Six,
    phase: &Phase,
    (options, near): (&SolverOptions, &mut Nearby),
    observe: &mut dyn FnMut(f64, &Solved),
) -> Result<State, SimError> {
    let mut state = State { rate: Six::zeros(), ..from.clone() };
    let longest = 1.0 / phase.steps.max(1) as f64;
    let shortest = longest * 0.5f64.powi(MOST_HALVINGS);
    let (flexion, mut done, mut size) = (from.q[FE], 0.0, longest);
    while done < 1.0 - 1e-9 {
        let next = if done + size > 1.0 - 1e-9 { 1.0 } else { done + size };
        let x = ((next - phase.load_from) / (1.0 - phase.load_from).max(1e-9)).clamp(0.0, 1.0);
        let share = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        let goal = Goal {
            flexion: flexion + (phase.flexion - flexion) * next,
            load: load + (phase.load - load) * share,
            flow: phase.flow.map(|(seconds, dashpots)| (seconds * (next - done), dashpots)),
        };
        match increment_near(model, &state, &goal, options, false, near) {
            Ok(solved) if solved.departure <= options.departure_mm || size <= shortest => {
                observe(next, &solved);
                let growth = if solved.departure < 0.3 * options.departure_mm { 2.0 } else { 1.0 };
                state = solved.state;
                done = next;
                size = (growth * size).min(longest);
            }
            Err(error) if !matches!(error, SimError::Solver(_)) || size <= shortest => return Err(error),
            _ => size = (0.5 * size).max(shortest),
        }
    }
    Ok(state)
}

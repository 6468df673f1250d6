//! The paper's steps of a trial [andreassen2025, sec. 2.4.5] and a deck's own, as programs.

use super::options::ExplicitOptions;
use super::program::{Course, Drive, Program, Step};
use super::state::ExplicitState;
use super::{Observer, run};
use crate::coordinate::{AP, FE, ML, SI, Six};
use crate::deck::{Control, ControlKind, Curve, DeckProtocol};
use crate::error::SimError;
use crate::flags::Flag;
use crate::joint::Joint;
use crate::laxity::{LaxityTrial, TrialResult};
use crate::model::Model;
use crate::spec::ChainSpec;
use crate::trials;
use serde::{Deserialize, Serialize};

/// Faster than this a trial's end state is not at rest [mm/s, rad/s]: a hundredth of a millimetre takes a second.
const MOVING: f64 = 0.01;
/// How long loads and flexion are held before it is asked again whether the knee is at rest [s]: what the fibres' dashpots need to die away.
pub(super) const REST: f64 = 0.6;
/// How often they are held on at most [-]: a slack knee creeps for 5 s (the published S193761 without load); three times that.
const MOST_RESTS: usize = 25;

/// How a trial is laid out in time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrialSteps {
    /// Duration of the settling step, in which the compression is ramped up [s]; the test deck's.
    pub settle_s: f64,
    /// Dashpots along the coordinates while settling [N s/mm, N mm s/rad]; the paper's 100.
    pub settle_damping: f64,
    /// Longest increment while settling [s]: under heavy dashpots longer ones are stable.
    pub settle_increment_s: f64,
    /// Duration of the loading step [s]; the published decks'.
    pub load_s: f64,
    /// Dashpots while loading and after [N s/mm, N mm s/rad]; the published decks' 0.01.
    pub load_damping: f64,
    /// When flexion starts and is reached, in fractions of the loading step [-]; as in the published decks.
    pub flex: [f64; 2],
    /// When loads start and are reached, in fractions of the loading step [-]; as in the published decks; the paper holds the last 0.3.
    pub load: [f64; 2],
    /// Whether loads follow a fifth-order step, as the decks' do, or a straight ramp. Flexion's is straight.
    pub smooth: bool,
}

impl Default for TrialSteps {
    fn default() -> Self {
        TrialSteps {
            settle_s: 3.0,
            settle_damping: 100.0,
            settle_increment_s: 3e-3,
            load_s: 1.5,
            load_damping: 0.01,
            flex: [0.0, 0.6],
            load: [0.2, 0.6],
            smooth: true,
        }
    }
}

impl TrialSteps {
    /// Settle, then load: flexion and loads (conjugate to the coordinates, N mm and N; that of flexion is not used) from the CT pose.
    ///
    /// Errors: loads that are not finite, a flexion no knee has, fractions out of order.
    pub fn program(&self, joint: &Joint, flexion_deg: f64, load: &Six) -> Result<Program, SimError> {
        if !load.iter().all(|x| x.abs() < 1e7) {
            return Err(SimError::Input(format!("loads {:?} are not finite", load.as_slice())));
        }
        if !(-30.0..=160.0).contains(&flexion_deg) {
            return Err(SimError::Input(format!("flexion {flexion_deg} deg is impossible; expected -30 to 160")));
        }
        for (key, [from, to]) in [("flex", self.flex), ("load", self.load)] {
            if !(0.0 <= from && from < to && to <= 1.0) {
                return Err(SimError::Input(format!("steps.{key} is [{from}, {to}], expected 0 <= from < to <= 1")));
            }
        }
        let turn = flexion_deg.to_radians() - joint.ct_pose()[FE];
        let mut settle = self.step("settle", self.settle_s, self.settle_damping);
        settle.increment_s = Some(self.settle_increment_s);
        settle.drive[SI.index()] = Drive::Load(Course::ramp([0.0, load[SI]], [0.0, self.settle_s], self.curve()));
        let mut push = self.step("load", self.load_s, self.load_damping);
        let during = |part: [f64; 2]| part.map(|x| x * self.load_s);
        push.drive[FE.index()] =
            Drive::Motion(Course::ramp([0.0, turn], during(self.flex), Curve::Linear { smooth: 0.0 }));
        for c in crate::coordinate::FREE {
            push.drive[c.index()] = Drive::Load(Course::ramp([0.0, load[c]], during(self.load), self.curve()));
        }
        push.drive[SI.index()] = Drive::Load(Course::constant(load[SI]));
        Ok(Program { steps: vec![settle, push] })
    }

    /// A further step that takes the AP load from `from` to `from - 2 amplitude` and back [N], `load` held in the other coordinates.
    pub fn ap_cycle(&self, load: &Six, amplitude: f64) -> Step {
        let mut step = self.step("ap-cycle", 2.0 * self.load_s, self.load_damping);
        for c in crate::coordinate::FREE {
            step.drive[c.index()] = Drive::Load(Course::constant(load[c]));
        }
        let t = step.duration_s;
        let points = vec![[0.0, 0.0], [0.4 * t, 1.0], [0.5 * t, 1.0], [0.9 * t, 0.0], [t, 0.0]];
        let amplitude_course = crate::deck::Amplitude { name: String::new(), curve: self.curve(), points };
        step.drive[AP.index()] = Drive::Load(Course {
            base: load[AP],
            magnitude: -2.0 * amplitude,
            amplitude: Some(amplitude_course),
            lost: 0.0,
        });
        step
    }

    pub(super) fn curve(&self) -> Curve {
        if self.smooth { Curve::SmoothStep } else { Curve::Linear { smooth: 0.0 } }
    }

    /// A step with contact that holds flexion and leaves the rest free.
    pub(super) fn step(&self, name: &str, duration_s: f64, damping: f64) -> Step {
        let mut drive = std::array::from_fn(|_| Drive::Load(Course::constant(0.0)));
        drive[FE.index()] = Drive::Motion(Course::constant(0.0));
        let damping = Six::repeat(damping);
        Step { name: name.into(), duration_s, increment_s: None, contact: true, drive, damping, fail: Vec::new() }
    }
}

/// Runs a trial through the paper's steps to rest.
///
/// Errors: as [`run`] and [`TrialSteps::program`], with the trial's name.
pub fn explicit_trial(
    model: &Model,
    trial: &LaxityTrial,
    steps: &TrialSteps,
    options: &ExplicitOptions,
    observer: &mut Observer,
) -> Result<TrialResult, SimError> {
    let named = |e: SimError| e.of_trial(&trial.trial);
    let model = &*model.in_trial(trial).map_err(named)?;
    let program = steps.program(&model.joint, trial.fe_deg, &trial.load.generalised()).map_err(named)?;
    let mut state = ExplicitState::at_rest();
    let load = trial.load.generalised();
    run_to_rest((model, &program), (steps, &load), options, &mut state, observer).map_err(named)?;
    Ok(result(model, trial, &state, &trials::TrialOptions::default()))
}

/// Runs a program, then holds flexion and `load`, to which it led, until the knee is at rest; one that is not after [`MOST_RESTS`] is left as it is.
///
/// Errors: as [`run`]; a femur that nothing holds any more and that moves on: it has no equilibrium.
pub(super) fn run_to_rest(
    (model, program): (&Model, &Program),
    (steps, load): (&TrialSteps, &Six),
    options: &ExplicitOptions,
    state: &mut ExplicitState,
    observer: &mut Observer,
) -> Result<(), SimError> {
    run(model, program, options, state, observer)?;
    let mut hold = steps.step("rest", REST, steps.load_damping);
    for c in crate::coordinate::FREE {
        hold.drive[c.index()] = Drive::Load(Course::constant(load[c]));
    }
    let hold = Program { steps: vec![hold] };
    for _ in 0..MOST_RESTS {
        if is_at_rest(state) {
            return Ok(());
        }
        *state = state.restarted();
        run(model, &hold, options, state, observer)?;
    }
    if is_at_rest(state) || is_held(model, state) { Ok(()) } else { Err(left(model, state)) }
}

/// Whether a run has come to rest.
fn is_at_rest(state: &ExplicitState) -> bool {
    state.rate.amax() <= MOVING
}

/// Whether anything holds the femur where a run stands: cartilage, a ligament, or a body in between. What is slack or apart has no force on it.
fn is_held(model: &Model, state: &ExplicitState) -> bool {
    model.evaluate(&state.q).gradient.amax() > 0.0
}

/// Why a femur that flies off has no equilibrium.
fn left(model: &Model, state: &ExplicitState) -> SimError {
    let off = model.joint.grood_suntay(&state.q) - model.joint.ct_pose();
    let far = [ML, AP, SI].into_iter().map(|c| off[c].abs()).fold(0.0, f64::max);
    let seconds = REST * MOST_RESTS as f64;
    SimError::Solver(format!(
        "after {seconds} s under its loads the femur lies {far:.0} mm from the CT pose and moves on: it has left the tibia, and neither cartilage nor a ligament holds it"
    ))
}

/// What a trial or a protocol's row tells where a run stands.
pub(super) fn result(
    model: &Model,
    trial: &LaxityTrial,
    state: &ExplicitState,
    options: &trials::TrialOptions,
) -> TrialResult {
    let gs = model.joint.grood_suntay(&state.q);
    let evaluation = model.evaluate(&state.q);
    let mut flags = trials::flags(model, &gs, &evaluation, options);
    flags.extend((!is_at_rest(state)).then_some(Flag::Moving));
    let forces_n = model.bundle_forces(&evaluation.fibres);
    TrialResult {
        trial: trial.clone(),
        pose: trials::pose_spec(&gs),
        forces_n,
        outputs: model.outputs(&evaluation),
        flags,
        bands: vec![],
    }
}

/// A deck's own steps, with its quirks: its signs, degree factor, flexion base, lost half increments. `chain` is the specification's.
///
/// Fixed increments become the longest ones: where the decks' are not stable in [`super::Increments::Stable`], shorter ones are taken.
pub fn deck_program(joint: &Joint, chain: Option<&ChainSpec>, protocol: &DeckProtocol) -> Program {
    let steps = protocol.steps.iter().map(|deck| {
        let mut drive: [Drive; 6] = std::array::from_fn(|_| Drive::Load(Course::constant(0.0)));
        // a motion outdoes a load on the same coordinate
        let ordered = [ControlKind::Load, ControlKind::Motion];
        for control in ordered.iter().flat_map(|k| deck.controls.iter().filter(move |c| c.kind == *k)) {
            let (coordinate, sign) = joint.from_chain(control.coordinate, chain);
            let increment = deck.increment_s.filter(|_| protocol.lost_half_increment);
            drive[coordinate.index()] = imposed(control, sign, increment);
        }
        Step {
            name: deck.name.clone(),
            duration_s: deck.duration_s,
            increment_s: deck.increment_s,
            contact: deck.contact,
            drive,
            damping: Six::zeros(),
            fail: Vec::new(),
        }
    });
    Program { steps: steps.collect() }
}

/// A deck's control in clinical sign.
fn imposed(control: &Control, sign: f64, increment: Option<f64>) -> Drive {
    let amplitude = control.amplitude.clone();
    let mut course = Course { base: 0.0, magnitude: sign * control.magnitude, amplitude, lost: 0.0 };
    if control.kind == ControlKind::Load {
        return Drive::Load(course);
    }
    if let (Some(increment), Some(amplitude)) = (increment, &course.amplitude) {
        course.lost = amplitude.at(0.5 * increment) - amplitude.at(0.0);
    }
    Drive::Motion(course)
}

//! What a model's protocols and trials impose over time, in clinical signs: for files of programs that know no deck.

use crate::export::{all_protocols, file_stem, free_name};
use sim::SimError;
use sim::coordinate::{ALL, Coordinate, FE, Load};
use sim::deck::DeckProtocol;
use sim::explicit::{Course, Drive, Step, deck_program};
use sim::joint::Joint;
use sim::laxity::LaxityTrial;
use sim::spec::ModelSpec;

/// Points of a step: straight lines between them leave a ramp by 0.2 % of its height at most.
const POINTS: f64 = 40.0;
/// Times nearer to each other than this share of a step are one.
const NEAR: f64 = 1e-9;

/// A protocol or trial over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Imposed {
    /// Name of its file without an ending, the same as that of its deck.
    pub stem: String,
    /// Of a trial: its name, and its row in the table where it stands in one.
    pub trial: Option<(String, Option<usize>)>,
    /// Whether flexion is held throughout and loads act on all other coordinates.
    pub holds_flexion_alone: bool,
    /// Its steps, one after another.
    pub steps: Vec<ImposedStep>,
    /// What is imposed from the start to the end; straight lines between.
    pub points: Vec<ImposedPoint>,
}

/// A step of a protocol.
#[derive(Clone, Debug, PartialEq)]
pub struct ImposedStep {
    /// Its name.
    pub name: String,
    /// Its start, counted from the start of the protocol [s].
    pub from_s: f64,
    /// Its end [s].
    pub to_s: f64,
    /// The point of its end.
    pub end: usize,
}

/// What is imposed at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct ImposedPoint {
    /// Counted from the start of the protocol [s].
    pub time_s: f64,
    /// Flexion from the CT pose [rad].
    pub turn: f64,
    /// Flexion [deg].
    pub fe_deg: f64,
    /// Loads [N m, N]; 0 where a motion is held.
    pub load: Load,
}

/// The protocols of [`crate::export_with`] and its trials, in the same order and with the same names.
///
/// # Errors
/// Frames that make no joint.
pub fn imposed(spec: &ModelSpec, trials: &[LaxityTrial]) -> Result<Vec<Imposed>, SimError> {
    let joint = Joint::new(&spec.frames, spec.side)?;
    let protocols = all_protocols(spec, &joint, trials);
    let own = protocols.len() - trials.len();
    let mut mains: Vec<String> = Vec::new();
    let mut out = Vec::new();
    for (k, protocol) in protocols.into_iter().enumerate() {
        let main = free_name(&file_stem(&protocol.name), &mains);
        let trial = k.checked_sub(own).map(|n| (trials[n].trial.clone(), trials[n].row));
        let stem = main.strip_suffix(".inp").unwrap_or(&main).to_owned();
        out.push(over_time((spec, &joint), protocol, stem, trial));
        mains.push(main);
    }
    Ok(out)
}

fn over_time(
    (spec, joint): (&ModelSpec, &Joint),
    protocol: DeckProtocol,
    stem: String,
    trial: Option<(String, Option<usize>)>,
) -> Imposed {
    // half an increment is a matter of explicit dynamics
    let program =
        deck_program(joint, spec.frames.chain.as_ref(), &DeckProtocol { lost_half_increment: false, ..protocol });
    let (mut steps, mut points) = (Vec::new(), Vec::new());
    let (mut start, mut turned) = (0.0, 0.0);
    let mut holds_flexion_alone = true;
    for (k, step) in program.steps.iter().enumerate() {
        holds_flexion_alone &= ALL.iter().all(|c| matches!(step.drive[c.index()], Drive::Motion(_)) == (*c == FE));
        let first = (k == 0).then_some(0.0);
        for time in first.into_iter().chain(times(step)) {
            let turn = turned + motion(step, FE, time);
            let load = Load::from_fn(|c| pull(step, c, time) / c.to_force(1.0));
            let fe_deg = (joint.ct_pose()[FE] + turn).to_degrees();
            points.push(ImposedPoint { time_s: start + time, turn, fe_deg, load });
        }
        turned += motion(step, FE, step.duration_s);
        let from_s = start;
        start += step.duration_s;
        steps.push(ImposedStep { name: step.name.clone(), from_s, to_s: start, end: points.len() - 1 });
    }
    Imposed { stem, trial, holds_flexion_alone, steps, points }
}

fn motion(step: &Step, c: Coordinate, time: f64) -> f64 {
    match &step.drive[c.index()] {
        Drive::Motion(course) => course.at(time),
        Drive::Load(_) => 0.0,
    }
}

fn pull(step: &Step, c: Coordinate, time: f64) -> f64 {
    match &step.drive[c.index()] {
        Drive::Load(course) => course.at(time),
        Drive::Motion(_) => 0.0,
    }
}

fn course(drive: &Drive) -> &Course {
    match drive {
        Drive::Load(course) | Drive::Motion(course) => course,
    }
}

/// Times of a step at which a point is taken, the start left out: the corners of its courses, and even parts between them.
fn times(step: &Step) -> Vec<f64> {
    let whole = step.duration_s;
    let corners = step.drive.iter().filter_map(|d| course(d).amplitude.as_ref()).flat_map(|a| &a.points);
    let within = |t: &f64| *t > NEAR * whole && *t < (1.0 - NEAR) * whole;
    let mut ends: Vec<f64> = corners.map(|p| p[0]).filter(within).chain([whole]).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|later, earlier| *later - *earlier < NEAR * whole);
    let (mut out, mut from) = (Vec::new(), 0.0);
    for to in ends {
        let parts = (POINTS * (to - from) / whole).ceil().max(1.0);
        out.extend((1..=parts as usize).map(|k| from + (to - from) * (k as f64 / parts)));
        from = to;
    }
    out
}

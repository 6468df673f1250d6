//! Laxity trials: what a model answers to the loads of a trial, along the path of loading.
//!
//! The path is the paper's [andreassen2025, section 2.4.5]: settle in the CT pose under the trial's compression with heavy damping, then flex
//! and load, then hold. Loads begin to change a third into the flexing, as in the published decks. Signs are clinical, whatever the side.

use crate::contact::Nearby;
use crate::coordinate::{AP, FE, FREE, Free, IE, Load, ML, SI, Six, VV};
use crate::error::SimError;
use crate::flags::{self, Flag, Limits};
use crate::laxity::{LaxityTrial, TrialResult};
use crate::model::{Evaluation, Model};
use crate::quasistatic::{Dashpots, Goal, Phase, Solved, SolverOptions, State, follow, increment_near};
use crate::spec::PoseSpec;
use notices::plain;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// How far a second search turns where it shifts by a millimetre [deg]; ours.
const DEG_PER_MM: f64 = 2.0;
/// Equilibria that are further apart than this in a coordinate are two [mm or deg]; ours: friction holds a knee within less.
const ANOTHER: f64 = 1.0;

/// Times that a knee is held again where it falls further than a search for its rest goes [-]; ours: a knee without ACL and ALS that slides off its
/// plateau comes to rest within the first.
const MOST_HOLDS: usize = 2;

/// Flexions that can be asked for [deg]. Ours: farther than any knee bends.
pub const FLEXION_DEG: [f64; 2] = [-30.0, 160.0];

/// The path of a trial and how it is solved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrialOptions {
    /// Settling under compression [s], as in the published test deck [andreassen2025].
    pub settle_s: f64,
    /// Dashpots on each translation [N s/mm] and rotation [N mm s/rad] while settling; [andreassen2025, section 2.4.5].
    pub settle_damping: f64,
    /// Flexing and loading [s]; the published decks'.
    pub load_s: f64,
    /// Loads begin to change at this fraction of the flexing [-]; the published decks'.
    pub load_from: f64,
    /// Holding [s]; the published decks'.
    pub hold_s: f64,
    /// Dashpots on each translation [N s/mm] and rotation [N mm s/rad] after settling; the published decks'.
    pub damping: f64,
    /// Increments of settling, loading, holding [-]; figures: docs/theory/solver.md.
    pub increments: [usize; 3],
    /// Flexion a model is asked for at most [deg]; ours, beyond any knee.
    pub flexion_deg: [f64; 2],
    /// ML or SI further than this from the CT pose is a dislocation [mm]; the joint limits of the cost.
    pub dislocation_mm: f64,
    /// AP further than this from the CT pose is a dislocation, wherever the contact lies [mm]; ours: the depth of a plateau (38 mm in Specimen 1).
    pub dislocation_ap_mm: f64,
    /// A compartment bears at the rim where its centre of pressure is nearer than this to it [mm]; ours.
    pub rim_mm: f64,
    /// So it does where more than this share of its load lies so near [-]; ours.
    pub rim_share: f64,
    /// A second search begins this far on either side of the answer, AP [mm] and IE [2 deg for each mm]; it flags an answer beside which another
    /// equilibrium is found. 0: none; ours.
    pub second_search_mm: f64,
    /// The solver's.
    pub solver: SolverOptions,
}

impl Default for TrialOptions {
    fn default() -> Self {
        TrialOptions {
            settle_s: 3.0,
            settle_damping: 100.0,
            load_s: 0.9,
            load_from: 1.0 / 3.0,
            hold_s: 0.6,
            damping: 0.01,
            increments: [1, 12, 2],
            flexion_deg: FLEXION_DEG,
            dislocation_mm: 20.0,
            dislocation_ap_mm: 38.0,
            rim_mm: 2.0,
            rim_share: 0.5,
            second_search_mm: 0.0,
            solver: SolverOptions::default(),
        }
    }
}

impl TrialOptions {
    /// Refuses options that mean nothing.
    pub fn check(&self) -> Result<(), SimError> {
        let fault =
            |key: &str, x: f64, what: &str| Err(SimError::Input(format!("trials.{key} is {x}, expected {what}")));
        let times = [("settle_s", self.settle_s), ("load_s", self.load_s), ("hold_s", self.hold_s)];
        if let Some((key, x)) = times.into_iter().find(|(_, x)| !(1e-3..1e6).contains(x)) {
            return fault(key, x, "0.001 to 1e6");
        }
        if let Some(x) = [self.settle_damping, self.damping].into_iter().find(|x| !(0.0..1e9).contains(x)) {
            return fault("damping", x, "0 to 1e9");
        }
        if !(0.0..1.0).contains(&self.load_from) {
            return fault("load_from", self.load_from, "0 to below 1");
        }
        if !(0.0..=50.0).contains(&self.second_search_mm) {
            return fault("second_search_mm", self.second_search_mm, "0 to 50");
        }
        if let Some(n) = self.increments.iter().find(|n| !(1..=100_000).contains(*n)) {
            return fault("increments", *n as f64, "1 to 100000");
        }
        self.solver.check()
    }

    /// Where a femur has left its plateau.
    fn limits(&self) -> Limits {
        Limits {
            dislocation_mm: self.dislocation_mm,
            dislocation_ap_mm: self.dislocation_ap_mm,
            rim_mm: self.rim_mm,
            rim_share: self.rim_share,
        }
    }

    /// Dashpots after settling: the fibres' and the joint's small one.
    pub(crate) fn flowing(&self) -> Dashpots {
        Dashpots { fibres: true, translation: self.damping, rotation: self.damping }
    }
}

/// An answer: the state at the end of a path and what follows from it.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Coordinates, friction held.
    pub state: State,
    /// Energy, gradient and tangent of ligaments and contact there; fibres and contact.
    pub evaluation: Evaluation,
    /// Grood-Suntay pose, clinical signs.
    pub pose: PoseSpec,
    /// Force of each bundle [N], in the order of the model's bundles.
    pub forces_n: Vec<f64>,
    /// What bodies with coordinates of their own tell of themselves: names with their units, values.
    pub outputs: Vec<(String, f64)>,
    /// What is odd; empty when nothing is.
    pub flags: Vec<Flag>,
    /// Evaluations of the model it took.
    pub evaluations: usize,
}

impl Answer {
    /// The answer as a row of results.
    pub fn result(&self, trial: &LaxityTrial) -> TrialResult {
        TrialResult {
            trial: trial.clone(),
            pose: self.pose,
            forces_n: self.forces_n.clone(),
            outputs: self.outputs.clone(),
            flags: self.flags.clone(),
            bands: vec![],
        }
    }

    /// Predicted VV, IE [deg], ML, AP, SI [mm].
    pub fn predicted(&self) -> Free<f64> {
        self.pose.free()
    }
}

/// Grood-Suntay coordinates [rad, mm] as a pose in degrees.
pub fn pose_spec(gs: &Six) -> PoseSpec {
    PoseSpec {
        fe_deg: gs[FE].to_degrees(),
        vv_deg: gs[VV].to_degrees(),
        ie_deg: gs[IE].to_degrees(),
        ml_mm: gs[ML],
        ap_mm: gs[AP],
        si_mm: gs[SI],
    }
}

/// The chain's flexion for a Grood-Suntay flexion [deg].
///
/// Errors: a flexion that is not finite or beyond [`TrialOptions::flexion_deg`].
pub fn chain_flexion(model: &Model, fe_deg: f64, options: &TrialOptions) -> Result<f64, SimError> {
    let [least, most] = options.flexion_deg;
    if !(fe_deg >= least && fe_deg <= most) {
        return Err(SimError::Input(format!(
            "flexion {} deg is impossible; expected {least} to {most}",
            plain(fe_deg)
        )));
    }
    Ok(fe_deg.to_radians() - model.joint.ct_pose()[FE])
}

/// Solves a trial: settle, flex and load, hold, and the equilibrium at the end.
///
/// Errors: loads or flexion out of range, a solver that finds no equilibrium; each names the trial.
pub fn solve_trial(model: &Model, trial: &LaxityTrial, options: &TrialOptions) -> Result<Answer, SimError> {
    let solved = model.in_trial(trial).and_then(|model| solve(&model, trial.fe_deg, &trial.load, options));
    solved.map_err(|e| e.of_trial(&trial.trial))
}

/// What is said of the first trial that asks for what the model does not have, with its row; none where each can be put to it.
pub fn cannot_be_put<'a>(model: &Model, trials: impl IntoIterator<Item = &'a LaxityTrial>) -> Option<String> {
    trials.into_iter().find_map(|trial| {
        let what = match model.in_trial(trial).err()? {
            SimError::Input(what) => what,
            e => e.to_string(),
        };
        Some(format!("row {} ({}): {what}", trial.row.unwrap_or(0), trial.trial))
    })
}

/// Solves trials in parallel, in order; those of one compression, one tension of the quadriceps and one state of the knee share its settling. The same answers as
/// [`solve_trial`]'s.
pub fn solve_trials(model: &Model, trials: &[LaxityTrial], options: &TrialOptions) -> Vec<Result<Answer, SimError>> {
    let order = |a: &&LaxityTrial, b: &&LaxityTrial| {
        let by_load = a.quadriceps_n.total_cmp(&b.quadriceps_n).then(a.load[SI].total_cmp(&b.load[SI]));
        by_load.then_with(|| a.without.cmp(&b.without))
    };
    let mut rests: Vec<&LaxityTrial> = trials.iter().collect();
    rests.sort_by(order);
    rests.dedup_by(|a, b| order(a, b).is_eq());
    let settled = |first: &&LaxityTrial| {
        let model = model.in_trial(first)?;
        let state = settle(&model, first.load[SI], options)?;
        Ok((model, state))
    };
    let settled: Vec<Result<(Cow<Model>, State), SimError>> = rests.par_iter().map(settled).collect();
    let answer = |trial: &LaxityTrial| {
        let at = rests.binary_search_by(|r| order(r, &trial)).unwrap_or_default();
        let (model, state) = settled[at].as_ref().map_err(Clone::clone)?;
        solve_from(model, state, trial.fe_deg, &trial.load, options)
    };
    trials.par_iter().map(|trial| answer(trial).map_err(|e| e.of_trial(&trial.trial))).collect()
}

/// [`solve_trial`] without a trial's name: flexion [deg], loads [N m, N].
pub fn solve(model: &Model, fe_deg: f64, load: &Load, options: &TrialOptions) -> Result<Answer, SimError> {
    solve_from(model, &settle(model, load[SI], options)?, fe_deg, load, options)
}

/// The CT pose settled under a compression [N]: where every trial of that compression begins.
///
/// Errors: options or a load out of range, a solver that cannot go on.
pub fn settle(model: &Model, compression: f64, options: &TrialOptions) -> Result<State, SimError> {
    options.check()?;
    Ok(Path::settled(model, compression, options)?.state)
}

/// [`solve`] from the state that [`settle`] gives for the trial's compression.
pub fn solve_from(
    model: &Model,
    settled: &State,
    fe_deg: f64,
    load: &Load,
    options: &TrialOptions,
) -> Result<Answer, SimError> {
    options.check()?;
    let flexion = chain_flexion(model, fe_deg, options)?;
    let compression = Load::compression(load[SI]).generalised();
    let mut path = Path::at(model, options, settled.clone());
    path.load = compression;
    path.load(flexion, &load.generalised())?;
    path.rest()
}

/// What is odd about an answer at Grood-Suntay coordinates `gs` [rad, mm].
pub fn flags(model: &Model, gs: &Six, evaluation: &Evaluation, options: &TrialOptions) -> Vec<Flag> {
    flags::flags(model, gs, evaluation, &options.limits())
}

/// A path under way.
pub(crate) struct Path<'a> {
    model: &'a Model,
    options: &'a TrialOptions,
    state: State,
    load: Six,
    evaluations: usize,
    near: Nearby,
}

impl<'a> Path<'a> {
    /// At a state without load.
    fn at(model: &'a Model, options: &'a TrialOptions, state: State) -> Path<'a> {
        Path { model, options, state, load: Six::zeros(), evaluations: 0, near: Nearby::default() }
    }

    /// The CT pose settled under a compression [N].
    pub(crate) fn settled(model: &'a Model, compression: f64, options: &'a TrialOptions) -> Result<Path<'a>, SimError> {
        let mut path = Path::at(model, options, State::default());
        let damping = options.settle_damping;
        let heavy = Dashpots { fibres: true, translation: damping, rotation: damping };
        let load = Load::compression(compression).generalised();
        path.follow(&Phase {
            flexion: 0.0,
            load,
            load_from: 0.0,
            flow: Some((options.settle_s, heavy)),
            steps: options.increments[0],
        })?;
        Ok(path)
    }

    /// Flexes and loads, then holds.
    pub(crate) fn load(&mut self, flexion: f64, load: &Six) -> Result<(), SimError> {
        let o = self.options;
        let phase = Phase {
            flexion,
            load: *load,
            load_from: o.load_from,
            flow: Some((o.load_s, o.flowing())),
            steps: o.increments[1],
        };
        self.follow(&phase)?;
        self.hold(flexion)
    }

    /// Holds a flexion and the loads as they are.
    fn hold(&mut self, flexion: f64) -> Result<(), SimError> {
        let o = self.options;
        self.follow(&Phase {
            flexion,
            load: self.load,
            load_from: 0.0,
            flow: Some((o.hold_s, o.flowing())),
            steps: o.increments[2],
        })
    }

    /// Follows a phase.
    pub(crate) fn follow(&mut self, phase: &Phase) -> Result<(), SimError> {
        let mut count = 0;
        let mut observe = |_: f64, s: &Solved| count += s.evaluations;
        self.state =
            follow(self.model, &self.state, &self.load, phase, (&self.options.solver, &mut self.near), &mut observe)?;
        self.load = phase.load;
        self.evaluations += count;
        Ok(())
    }

    /// The equilibrium where the path stands; the path goes on from there. A knee that falls further than one search goes is held again.
    pub(crate) fn rest(&mut self) -> Result<Answer, SimError> {
        let mut held = 0;
        let solved = loop {
            let goal = Goal { flexion: self.state.q[FE], load: self.load, flow: None };
            match increment_near(self.model, &self.state, &goal, &self.options.solver, true, &mut self.near) {
                Err(SimError::Solver(_)) if held < MOST_HOLDS => held += 1,
                found => break found?,
            }
            self.hold(self.state.q[FE])?;
        };
        self.evaluations += solved.evaluations;
        self.state = solved.state.clone();
        let gs = self.model.joint.grood_suntay(&solved.state.q);
        let forces_n = self.model.bundle_forces(&solved.evaluation.fibres);
        let mut flags = flags(self.model, &gs, &solved.evaluation, self.options);
        flags.extend(self.has_another(&solved)?.then_some(Flag::Several));
        let outputs = self.model.outputs(&solved.evaluation);
        let evaluations = self.evaluations;
        Ok(Answer {
            state: solved.state,
            evaluation: solved.evaluation,
            pose: pose_spec(&gs),
            forces_n,
            outputs,
            flags,
            evaluations,
        })
    }

    /// Does a step; where it fails, the path stands where it stood before.
    ///
    /// Errors: the step's.
    pub(crate) fn attempt(
        &mut self,
        step: impl FnOnce(&mut Path<'a>) -> Result<Answer, SimError>,
    ) -> Result<Answer, SimError> {
        let (state, load) = (self.state.clone(), self.load);
        let found = step(self);
        if found.is_err() {
            (self.state, self.load, self.near) = (state, load, Nearby::default());
        }
        found
    }

    /// Whether searches that begin beside an equilibrium end in another: forwards and backwards, turned inwards and outwards.
    fn has_another(&mut self, solved: &Solved) -> Result<bool, SimError> {
        let far = self.options.second_search_mm;
        if far <= 0.0 {
            return Ok(false);
        }
        let here = self.model.joint.grood_suntay(&solved.state.q);
        for (coordinate, by) in [(AP, far), (IE, (DEG_PER_MM * far).to_radians())] {
            for sign in [-1.0, 1.0] {
                let mut from = State::at(solved.state.q);
                from.q[coordinate] += sign * by;
                let goal = Goal { flexion: solved.state.q[FE], load: self.load, flow: None };
                // the way there has its own lists: what the path goes on with stays as it was
                let found =
                    increment_near(self.model, &from, &goal, &self.options.solver, true, &mut Nearby::default());
                let Ok(found) = found else { continue };
                self.evaluations += found.evaluations;
                let apart = self.model.joint.grood_suntay(&found.state.q) - here;
                if FREE.into_iter().any(|c| c.to_file(apart[c]).abs() > ANOTHER) {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

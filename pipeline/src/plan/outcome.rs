//! What comes of a plan: every state in every test, with mean and interval by samples, and the chance that the knee is like the intact one.

pub(super) mod borne;

use super::astray::{Percents, Run, astray, laid_on_the_wall, moved_away};
use super::chances::{ChanceTold, chance_of, chances};
use super::file::{GraftFile, PlanFile};
use super::ground::{Before, Ground, Knee};
use super::knee::{Asked, Found, Placed, STATES, Surfaces, columns, main_coordinate};
use super::numbers::{Numbers, Value};
use super::sampled::{At, Sampled};
use super::sites::Bone;
use crate::bands::is_pose_or_force;
use crate::told::ModelTold;
use borne::too_much;
use calibration::samples::Samples;
use notices::{Kind, Notice};
use schemars::JsonSchema;
use serde::Serialize;
use sim::coordinate::{AP, IE, VV};
use sim::flags::{Flag, sentences};
use sim::ligament::mean_length;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// Version of plan.json.
pub const SCHEMA: &str = "plan/1";

/// plan.json.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Outcome {
    /// plan/1
    pub schema: &'static str,
    /// The plan's name.
    pub plan: String,
    /// The knee.
    pub model: Option<ModelTold>,
    /// What was planned: the file of the plan as it was read, with the defaults of all that it leaves out.
    pub planned: PlanFile,
    /// Bundles that are cut.
    pub cut: Vec<String>,
    /// The grafts, as fixed.
    pub grafts: Vec<GraftTold>,
    /// Samples of the posterior by which intervals stand; 0: no intervals.
    pub samples: usize,
    /// Share of the samples between the ends of an interval [-].
    pub interval: f64,
    /// Every test.
    pub tests: Vec<TestTold>,
    /// How likely the knee is restored.
    pub chances: Vec<ChanceTold>,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// A graft as it was put in.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct GraftTold {
    /// Its name.
    pub name: String,
    /// Where it leaves the femur, the mean of its lines, CT frame [mm].
    pub femur_mm: [f64; 3],
    /// Where it leaves the tibia [mm].
    pub tibia_mm: [f64; 3],
    /// The femoral site by the quadrant method: depth, height [%]; none of a site that is not on the lateral wall of the notch.
    pub quadrant_percent: Option<[f64; 2]>,
    /// The tibial site: from the plateau's front edge, from its medial edge [%].
    pub plateau_percent: Option<[f64; 2]>,
    /// Length between the bones in the CT pose [mm].
    pub length_mm: f64,
    /// Slack length [mm].
    pub slack_length_mm: f64,
    /// [N/mm].
    pub stiffness_n_per_mm: f64,
    /// The bundle whose fibres, force law and reference length it takes over; none: one line, with a toe and then its stiffness.
    pub like: Option<String>,
    /// Where its ends lie by the grids of both bones, on the wall of the notch or not [%].
    #[serde(skip)]
    percents: Percents,
}

impl GraftTold {
    /// Where its ends lie by the quadrant method and of the plateau.
    pub(super) fn percents(&self) -> Percents {
        self.percents
    }

    fn run(&self) -> Run {
        Run { femur_mm: self.femur_mm, length_mm: self.length_mm, slack_mm: self.slack_length_mm }
    }
}

/// A test.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct TestTold {
    /// What is done: "anterior drawer".
    pub test: String,
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// Loads on the tibia: VV, IE [N m], ML, AP, SI [N].
    pub load: [f64; 5],
    /// By state, values by name; `laxity` is the change of the test's own coordinate from the unloaded pose of that state.
    pub states: BTreeMap<String, BTreeMap<String, Value>>,
    /// What is odd, by state.
    pub flags: BTreeMap<String, Vec<String>>,
    /// By how far the reconstructed knee lies from the intact one under the same load.
    pub off: BTreeMap<String, Value>,
    /// Share of the samples in which the reconstructed knee lies within the limits of AP, IE and VV of the intact one in this test, of those whose
    /// intact knee stays on the plateau [-]; absent without samples.
    pub chance: Option<f64>,
    /// In how many samples it does so, and of how many; absent without samples.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counts: Option<[usize; 2]>,
    /// The flags of the reconstructed knee as values.
    #[serde(skip)]
    pub odd: Vec<Flag>,
    /// What is odd about what the grafts bear, in few words.
    #[serde(skip)]
    pub beyond: Vec<String>,
}

/// What comes of a plan for a knee that is known without scatter.
///
/// # Errors
/// A sentence: which key of the plan, and what was expected; or a knee without equilibrium.
pub fn outcome(spec: &ModelSpec, surfaces: &Surfaces, file: &PlanFile) -> Result<Outcome, String> {
    outcome_of(spec, surfaces, file, None)
}

/// [`outcome`], with the samples `which`.
pub(super) fn outcome_of(
    spec: &ModelSpec,
    surfaces: &Surfaces,
    file: &PlanFile,
    samples: Option<(&Samples, &[usize])>,
) -> Result<Outcome, String> {
    file.check().map_err(|wrong| wrong.told)?;
    let ground = Ground::new(spec, surfaces, file)?;
    let knee = ground.operated(file)?;
    let only = samples.map(|(s, which)| s.only(which));
    let before = ground.before(surfaces, only);
    Ok(outcome_on(&ground, &before, (file, &knee)).0)
}

/// What comes of a plan on a knee of which is known what it does before a graft is in; and of how many samples it says less than of the others.
pub(super) fn outcome_on(ground: &Ground, before: &Before, (file, knee): (&PlanFile, &Knee)) -> (Outcome, Left) {
    let (asked, placed) = (&ground.asked, &knee.placed);
    let mut notices = file.odd();
    let grafts = file.graft.iter().zip(placed).zip(&knee.slack_mm);
    let grafts: Vec<GraftTold> = grafts.map(|((g, p), slack)| graft(g, p, *slack, &ground.bones)).collect();
    notices.extend(file.graft.iter().zip(placed).filter_map(|(g, p)| laid_on_the_wall(g, p)));
    let moved = file.graft.iter().zip(placed).zip(&grafts);
    notices.extend(moved.flat_map(|((g, p), told)| moved_away(g, p, told.percents())));
    notices
        .extend(file.graft.iter().zip(&grafts).flat_map(|(g, told)| astray(&ground.bones[0], (file, g), &told.run())));
    let (numbers, fault) = ground.numbers(before, knee);
    notices.extend(fault.map(|e| Kind::NoIntervals.notice(format!("no intervals: {e}"))));
    notices.extend(not_operated(&numbers));
    let told: Vec<TestTold> = (0..asked.len()).map(|t| test(file, asked, t, &numbers)).collect();
    notices.extend(told.iter().flat_map(|t| flagged(t, &STATES)));
    let out = Outcome {
        schema: SCHEMA,
        plan: file.name.clone(),
        model: None,
        planned: file.clone(),
        cut: ground.cut.clone(),
        grafts,
        samples: numbers.sampled.as_ref().map_or(0, Sampled::len),
        interval: before.interval,
        tests: told,
        chances: chances(file, asked, &numbers),
        warnings: notices::texts(&notices),
        notices,
    };
    (out, Left::of(&numbers))
}

/// Samples that say less of the reconstructed knee than the others.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Left {
    /// That leave the plateau, in the test in which most do.
    pub(super) leaving: usize,
    /// That have no equilibrium, in the test in which most have none.
    pub(super) lost: usize,
    /// In which no graft could be fixed.
    pub(super) not_operated: usize,
}

impl Left {
    fn of(numbers: &Numbers) -> Left {
        let Some(sampled) = &numbers.sampled else { return Left::default() };
        let tests = numbers.best[2].len();
        Left {
            leaving: sampled.states[2].bands.leaving.iter().copied().max().unwrap_or(0),
            lost: (0..tests).map(|t| sampled.lost([2, t])).max().unwrap_or(0),
            not_operated: sampled.not_operated(),
        }
    }
}

/// What is odd in the rows of a test, of these states.
pub(super) fn flagged(t: &TestTold, states: &[&str]) -> Vec<Notice> {
    let odd = t.flags.iter().filter(|(state, f)| states.contains(&state.as_str()) && !f.is_empty());
    let notice = |(state, f): (&String, &Vec<String>)| {
        let row = format!("{}, {} deg, {state}", t.test, t.flexion_deg);
        Kind::RowFlagged.notice(f.join("; ")).whose(&row)
    };
    odd.map(notice).collect()
}

/// Samples in which a graft could not be fixed.
fn not_operated(numbers: &Numbers) -> Option<Notice> {
    let sampled = numbers.sampled.as_ref()?;
    let (lost, all) = (sampled.not_operated(), sampled.len());
    let text = format!("{lost} of {all} samples could not be operated on: no equilibrium when the graft is fixed");
    (lost > 0).then(|| Kind::SamplesLost.notice(text).count(lost))
}

/// Percentages to a millionth: the rest is of the arithmetic.
fn rounded(percent: Option<[f64; 2]>) -> Option<[f64; 2]> {
    percent.map(|both| both.map(|p| (p * 1e6).round() / 1e6))
}

fn graft(file: &GraftFile, placed: &Placed, slack: f64, bones: &[Bone; 2]) -> GraftTold {
    let mean = |end: usize| {
        let sum: meshes::Vector = placed.ends.iter().map(|e| e[end].coords).sum();
        meshes::Point::from(sum / placed.ends.len().max(1) as f64)
    };
    let [femur, tibia] = [mean(0), mean(1)];
    let percents = [rounded(bones[0].percent(&femur)), rounded(bones[1].percent(&tibia))];
    GraftTold {
        name: file.name.clone(),
        femur_mm: femur.coords.into(),
        tibia_mm: tibia.coords.into(),
        quadrant_percent: percents[0].filter(|_| bones[0].is_by_the_wall(&femur)),
        plateau_percent: percents[1],
        percents,
        length_mm: mean_length(&placed.ends),
        slack_length_mm: slack,
        stiffness_n_per_mm: placed.stiffness,
        like: placed.whole.clone(),
    }
}

fn test(file: &PlanFile, asked: &[Asked], t: usize, numbers: &Numbers) -> TestTold {
    let one = &asked[t];
    let main = main_coordinate(one.kind);
    let likely = chance_of(file, asked, t, numbers);
    let mut told = TestTold {
        test: one.kind.to_owned(),
        flexion_deg: one.trial.fe_deg,
        load: one.trial.load.0.0,
        states: BTreeMap::new(),
        flags: BTreeMap::new(),
        off: BTreeMap::new(),
        chance: likely.as_ref().and_then(|c| c.chance),
        counts: likely.and_then(|c| c.counts),
        odd: vec![],
        beyond: vec![],
    };
    for c in [AP, IE, VV] {
        told.off.extend(numbers.change(c, [0, t], [2, t]).map(|v| (c.column(), v)));
    }
    for (state, name) in STATES.into_iter().enumerate() {
        let mut values = BTreeMap::new();
        for [own, column] in columns(file) {
            // a graft is none where it is not in
            if state == 2 || !own.starts_with("graft_") {
                let value = numbers.value([state, t], &column);
                values.extend(value.map(|v| (own, v)));
            }
        }
        let laxity = one.rest.and_then(|rest| numbers.change(main, [state, rest], [state, t]));
        values.extend(laxity.map(|v| (LAXITY.to_owned(), v)));
        let outside = outside([&values, &told.off], state == 2);
        let borne = too_much(&file.graft, one.kind, &values);
        told.states.insert(name.to_owned(), values);
        let mut flags = odd(numbers, [state, t], outside);
        flags.extend(one.rest.and_then(|rest| from_nowhere(numbers, [state, rest])));
        told.flags.insert(name.to_owned(), [sentences(&flags), borne.clone()].concat());
        if state == 2 {
            (told.odd, told.beyond) = (flags, borne);
        }
    }
    told
}

/// The laxity of a state, by its name among its values.
const LAXITY: &str = "laxity";

/// What of the most probable knee lies outside its own interval: of a state's values, and of the reconstructed one how far it lies `off` the intact one.
fn outside([values, off]: [&BTreeMap<String, Value>; 2], is_reconstructed: bool) -> Vec<String> {
    let counts = |name: &str| is_pose_or_force(name) || name == LAXITY || name.starts_with("graft_");
    let own = values.iter().filter(|(name, _)| counts(name));
    let own = own.filter(|(_, v)| v.is_outside()).map(|(name, _)| name.clone());
    let off = off.iter().filter(|(_, v)| is_reconstructed && v.is_outside());
    own.chain(off.map(|(name, _)| format!("off_{name}"))).collect()
}

/// What is odd about the unloaded pose from which a laxity counts: off the plateau it is no pose of a knee, nor is where none was found.
fn from_nowhere(numbers: &Numbers, at: At) -> Option<Flag> {
    let flag = match &numbers.best[at[0]][at[1]] {
        None => Flag::NoEquilibrium,
        Some(found) if found.flags.contains(&Flag::Dislocated) => Flag::Dislocated,
        Some(_) => return None,
    };
    Some(Flag::Unloaded(Box::new(flag)))
}

/// What is odd about a state in a test: the most probable knee's flags, how many samples have left the plateau or rest in another way, and what of the
/// knee lies `outside` of its interval.
fn odd(numbers: &Numbers, at: At, outside: Vec<String>) -> Vec<Flag> {
    let none = || vec![Flag::NoEquilibrium];
    let mut flags = numbers.best[at[0]][at[1]].as_ref().map_or_else(none, |f: &Found| f.flags.clone());
    if let Some(sampled) = &numbers.sampled {
        let (bands, all) = (&sampled.states[at[0]].bands, sampled.len());
        let (leaving, lost) = (bands.leaving[at[1]], sampled.lost(at));
        let differing = bands.kinds[at[1]].flags(&flags, all);
        flags.extend(differing);
        flags.extend((leaving > 0).then_some(Flag::SamplesLeave { count: leaving, of: all }));
        flags.extend((lost > 0).then_some(Flag::SamplesLost { count: lost, of: all }));
    }
    flags.extend((!outside.is_empty()).then_some(Flag::OutsideInterval(outside)));
    flags
}

#[cfg(test)]
mod tests {
    use super::super::sampled::tests::{pose, sampled};
    use super::*;

    #[test]
    fn a_laxity_and_a_difference_outside_their_intervals_are_named() {
        let value = |value: f64| Value { value, mean: Some(0.0), lower: Some(-1.0), upper: Some(1.0) };
        let of = |all: &[(&str, f64)]| -> BTreeMap<String, Value> {
            all.iter().map(|(name, x)| ((*name).to_owned(), value(*x))).collect()
        };
        let (inside, contact) = (("ap_mm", 0.5), ("contact_medial_force_n", 9.0));
        let values = of(&[inside, contact, ("graft_g_n", 5.0), ("ie_deg", 3.0), (LAXITY, 2.0)]);
        let off = of(&[("ap_mm", -4.0), ("vv_deg", 0.0)]);
        assert_eq!(outside([&values, &off], false), ["graft_g_n", "ie_deg", "laxity"]);
        assert_eq!(outside([&values, &off], true), ["graft_g_n", "ie_deg", "laxity", "off_ap_mm"]);
    }

    #[test]
    fn a_sample_off_the_plateau_has_no_place_in_a_plans_differences_and_is_counted() {
        // intact and deficient rest at 0 to 8 mm, reconstructed half a mm further; two more are off the plateau
        let off = |state: usize, s: usize| (state == 0 && s == 9) || (state == 2 && s == 10);
        let at =
            |state: usize, s: usize| pose(if s < 9 { s as f64 } else { 90.0 } + if state == 2 { 0.5 } else { 0.0 });
        let best = [0, 1, 2].map(|state| {
            let ap = if state == 2 { 4.5 } else { 4.0 };
            vec![Some(Found { pose: pose(ap), told: vec![("ap_mm".into(), ap)], flags: vec![] })]
        });
        let numbers = |count: usize, off: &dyn Fn(usize, usize) -> bool| Numbers {
            best: best.clone(),
            sampled: Some(sampled(count, &at, off)),
        };
        let with = numbers(11, &off);
        let change = with.change(AP, [0, 0], [2, 0]).unwrap();
        assert!([change.value, change.mean.unwrap(), change.lower.unwrap()].iter().all(|x| (x - 0.5).abs() < 1e-12));
        assert_eq!(sentences(&odd(&with, [0, 0], vec![])), ["1 of 11 samples leaves the plateau"]);
        assert!(odd(&with, [1, 0], vec![]).is_empty());
        // a laxity counts from a pose off the plateau, or from none
        let rests = |found: Option<Found>| {
            let best = [0, 1, 2].map(|_| vec![found.clone()]);
            from_nowhere(&Numbers { best, sampled: None }, [1, 0])
        };
        let at_rest = |flags: Vec<Flag>| Found { pose: pose(0.0), told: vec![], flags };
        let told = |flag: Option<Flag>| flag.map(|f| f.to_string());
        assert_eq!(told(rests(None)).as_deref(), Some("unloaded: no equilibrium"));
        assert_eq!(told(rests(Some(at_rest(vec![Flag::Dislocated])))).as_deref(), Some("unloaded: dislocated"));
        assert!(rests(Some(at_rest(vec![Flag::Subluxed]))).is_none());
        // of more than half off the plateau there is no interval, and the value stays
        let none = numbers(9, &|state, s| state == 0 && s < 5).change(AP, [0, 0], [2, 0]).unwrap();
        assert_eq!((none.value, none.mean, none.lower), (0.5, None, None));
    }
}

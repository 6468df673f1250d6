//! What comes of a plan: every state in every test, with mean and interval by samples, and the chance that the knee is like the intact one.

use super::file::PlanFile;
use super::knee::{Answers, Asked, Found, Knee, Placed, STATES, columns, main_coordinate, pose_of, tests};
use super::sites::{Bone, bones};
use crate::told::ModelTold;
use calibration::kinds::Kinds;
use calibration::plateau::Staying;
use calibration::samples::Samples;
use notices::{Kind, Notice};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use sim::contact::ContactOptions;
use sim::coordinate::{AP, Coordinate, IE, VV};
use sim::flags::{Flag, sentences};
use sim::ligament::mean_length;
use sim::mesh::MeshValue;
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
    /// The femoral site by the quadrant method: depth, height [%].
    pub quadrant_percent: Option<[f64; 2]>,
    /// The tibial site: from the plateau's front edge, from its medial edge [%].
    pub plateau_percent: Option<[f64; 2]>,
    /// Length between the bones in the CT pose [mm].
    pub length_mm: f64,
    /// Slack length [mm].
    pub slack_length_mm: f64,
    /// [N/mm].
    pub stiffness_n_per_mm: f64,
}

/// A number and what is known of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Value {
    /// Of the most probable knee.
    pub value: f64,
    /// Mean over the samples.
    pub mean: Option<f64>,
    /// Lower end of the interval.
    pub lower: Option<f64>,
    /// Its upper end.
    pub upper: Option<f64>,
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
}

/// A chance.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ChanceTold {
    /// What must hold, in words.
    pub of: String,
    /// Share of the samples in which it holds, of those whose intact knee stays on the plateau [-]; absent without samples.
    pub chance: Option<f64>,
    /// Whether it holds in the most probable knee.
    pub most_probable: bool,
}

/// All numbers of a plan: of the most probable knee, of the same by the samples' mechanics, of each sample.
pub(super) struct Numbers {
    pub(super) best: Answers,
    pub(super) mode: Option<Answers>,
    pub(super) samples: Vec<Answers>,
    /// The same without answers that do not count ([`calibration::plateau`]).
    pub(super) counted: Vec<Answers>,
}

/// The surfaces of a model by name.
pub type Surfaces = BTreeMap<String, MeshValue>;

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
    let asked = tests(&file.tests);
    let (knee, placed) = Knee::new(spec, surfaces, file, (&ContactOptions::default(), None))?;
    let best = knee.answers(&asked);
    let mut numbers = Numbers { best, mode: None, samples: vec![], counted: vec![] };
    let mut notices = vec![];
    if let Some((samples, which)) = samples {
        drawn(samples, which, (surfaces, file), &asked, &mut numbers, &mut notices)?;
    }
    let interval = samples.map_or(0.9, |(s, _)| s.of.interval);
    let told: Vec<TestTold> = (0..asked.len()).map(|t| test(file, &asked, t, &numbers, interval)).collect();
    for t in &told {
        let odd = t.flags.iter().filter(|(_, f)| !f.is_empty());
        notices.extend(odd.map(|(state, f)| {
            let row = format!("{}, {} deg, {state}", t.test, t.flexion_deg);
            Kind::RowFlagged.notice(f.join("; ")).whose(&row)
        }));
    }
    let bones = bones(spec, surfaces)?;
    let grafts = file.graft.iter().zip(&placed).zip(&knee.slack_mm);
    Ok(Outcome {
        schema: SCHEMA,
        plan: file.name.clone(),
        model: None,
        cut: super::knee::cut(spec, file)?,
        grafts: grafts.map(|((g, p), slack)| graft(&g.name, p, *slack, &bones)).collect(),
        samples: numbers.samples.len(),
        interval,
        tests: told,
        chances: chances(file, &asked, &numbers),
        warnings: notices::texts(&notices),
        notices,
    })
}

/// The answers of samples, from those of the most probable knee.
fn drawn(
    samples: &Samples,
    which: &[usize],
    (surfaces, file): (&Surfaces, &PlanFile),
    asked: &[Asked],
    numbers: &mut Numbers,
    notices: &mut Vec<Notice>,
) -> Result<(), String> {
    let told = |e: calibration::error::CalibrationError| e.to_string();
    let searched = samples.searched(surfaces).map_err(told)?;
    let (mode, each) = samples.knees(&searched, which).map_err(told)?;
    let coarse = ContactOptions { spacing_mm: samples.of.search.contact_spacing_mm };
    // the samples' knees have no friction
    let one = |spec: &ModelSpec, near: &Answers| -> Result<Answers, String> {
        let (knee, _) = Knee::new(spec, surfaces, file, (&coarse, Some(0.0)))?;
        Ok(knee.answers_near(asked, near))
    };
    let mode = one(&mode, &numbers.best)?;
    let found: Vec<Result<Answers, String>> = each.par_iter().map(|spec| one(spec, &mode)).collect();
    let lost: Vec<&String> = found.iter().filter_map(|f| f.as_ref().err()).collect();
    if let Some(first) = lost.first() {
        let text = format!("{} of {} samples could not be operated on: {first}", lost.len(), which.len());
        notices.push(Kind::SamplesLost.notice(text).count(lost.len()));
    }
    numbers.samples = found.into_iter().filter_map(Result::ok).collect();
    numbers.counted = on_the_plateau(&numbers.samples);
    numbers.mode = Some(mode);
    Ok(())
}

fn graft(name: &str, placed: &Placed, slack: f64, bones: &[Bone; 2]) -> GraftTold {
    let mean = |end: usize| {
        let sum: meshes::Vector = placed.ends.iter().map(|e| e[end].coords).sum();
        meshes::Point::from(sum / placed.ends.len().max(1) as f64)
    };
    let [femur, tibia] = [mean(0), mean(1)];
    GraftTold {
        name: name.to_owned(),
        femur_mm: femur.coords.into(),
        tibia_mm: tibia.coords.into(),
        quadrant_percent: bones[0].percent(&femur),
        plateau_percent: bones[1].percent(&tibia),
        length_mm: mean_length(&placed.ends),
        slack_length_mm: slack,
        stiffness_n_per_mm: placed.stiffness,
    }
}

impl Numbers {
    /// A number of the answers and what the samples say of it: they are moved by what the most probable knee differs by from itself under their
    /// mechanics (friction, mesh).
    fn value(&self, of: &dyn Fn(&Answers) -> Option<f64>, interval: f64) -> Option<Value> {
        let value = of(&self.best)?;
        let moved = self.moved(of);
        if moved.len() < 2 {
            return Some(Value { value, mean: None, lower: None, upper: None });
        }
        let mean = moved.iter().sum::<f64>() / moved.len() as f64;
        let mut sorted = moved;
        sorted.sort_by(f64::total_cmp);
        let tail = 0.5 * (1.0 - interval);
        let (lower, upper) = (quantile(&sorted, tail), quantile(&sorted, 1.0 - tail));
        Some(Value { value, mean: Some(mean), lower: Some(lower.min(mean)), upper: Some(upper.max(mean)) })
    }

    /// A number by sample, moved.
    fn moved(&self, of: &dyn Fn(&Answers) -> Option<f64>) -> Vec<f64> {
        let by = match (of(&self.best), self.mode.as_ref().and_then(of)) {
            (Some(best), Some(mode)) => best - mode,
            _ => 0.0,
        };
        self.counted.iter().filter_map(of).map(|x| x + by).collect()
    }

    /// Whether a sample says nothing of a knee that is restored in a test: its intact knee is off the plateau there.
    fn is_left_out(&self, sample: usize, test: usize) -> bool {
        self.samples[sample][0][test].is_some() && self.counted[sample][0][test].is_none()
    }
}

/// The answers of samples that count: those of knees that stay on the plateau, by state and test.
fn on_the_plateau(samples: &[Answers]) -> Vec<Answers> {
    let mut out = samples.to_vec();
    let tests = samples.first().map_or(0, |a| a[0].len());
    for (state, test) in (0..STATES.len()).flat_map(|s| (0..tests).map(move |t| (s, t))) {
        let staying = Staying::of(samples.iter().map(|a| a[state][test].as_ref().map(Found::leaves_the_plateau)));
        let left_out = out.iter_mut().enumerate().filter(|(sample, _)| !staying.here.contains(sample));
        left_out.for_each(|(_, answers)| answers[state][test] = None);
    }
    out
}

/// A quantile of sorted numbers, between neighbours in proportion.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let at = share * (sorted.len() - 1) as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    sorted[low] + (sorted[high] - sorted[low]) * (at - low as f64)
}

/// A column of an answer.
fn column(answers: &Answers, state: usize, test: usize, k: usize) -> Option<f64> {
    answers[state][test].as_ref().map(|f| f.values[k])
}

/// By how far the reconstructed knee lies from the intact one in a coordinate.
fn off(answers: &Answers, test: usize, c: Coordinate) -> Option<f64> {
    let at = |state: usize| answers[state][test].as_ref().map(pose_of);
    Some(at(2)?[c] - at(0)?[c])
}

fn test(file: &PlanFile, asked: &[Asked], t: usize, numbers: &Numbers, interval: f64) -> TestTold {
    let (one, names) = (&asked[t], columns(file));
    let main = main_coordinate(one.kind);
    let mut told = TestTold {
        test: one.kind.to_owned(),
        flexion_deg: one.trial.fe_deg,
        load: one.trial.load.0.0,
        states: BTreeMap::new(),
        flags: BTreeMap::new(),
        off: BTreeMap::new(),
    };
    for (state, name) in STATES.into_iter().enumerate() {
        let mut values = BTreeMap::new();
        for (k, column_name) in names.iter().enumerate() {
            // a graft is none where it is not in
            if state == 2 || !column_name.starts_with("graft_") {
                let value = numbers.value(&|a| column(a, state, t, k), interval);
                values.extend(value.map(|v| (column_name.clone(), v)));
            }
        }
        if let Some(rest) = one.rest {
            let k = main.free_index();
            let change = |a: &Answers| Some(column(a, state, t, k)? - column(a, state, rest, k)?);
            values.extend(numbers.value(&change, interval).map(|v| ("laxity".to_owned(), v)));
        }
        told.states.insert(name.to_owned(), values);
        told.flags.insert(name.to_owned(), odd(numbers, state, t));
    }
    for c in [AP, IE, VV] {
        told.off.extend(numbers.value(&|a| off(a, t, c), interval).map(|v| (c.column(), v)));
    }
    told
}

/// What is odd about a state in a test: the most probable knee's flags, and how many samples have left the plateau or rest in another way.
fn odd(numbers: &Numbers, state: usize, t: usize) -> Vec<String> {
    let none = || vec![Flag::NoEquilibrium];
    let mut flags = numbers.best[state][t].as_ref().map_or_else(none, |f: &Found| f.flags.clone());
    let of = |is: &dyn Fn(&Option<Found>) -> bool| numbers.samples.iter().filter(|a| is(&a[state][t])).count();
    let leaving = of(&|f| f.as_ref().is_some_and(Found::leaves_the_plateau));
    let lost = of(&Option::is_none);
    let all = numbers.samples.len();
    let found = numbers.samples.iter().filter_map(|a| a[state][t].as_ref());
    let here = found.filter(|f| !f.leaves_the_plateau()).map(|f| (pose_of(f), f.flags.contains(&Flag::Subluxed)));
    let own = numbers.mode.as_ref().and_then(|m| m[state][t].as_ref()).map(pose_of);
    let differing = Kinds::of(own.as_ref(), here).flags(&flags, all);
    flags.extend(differing);
    flags.extend((leaving > 0).then_some(Flag::SamplesLeave { count: leaving, of: all }));
    flags.extend((lost > 0).then_some(Flag::SamplesLost { count: lost, of: all }));
    sentences(&flags)
}

/// The chances of a plan: of the forward drawer alone, and of every test.
fn chances(file: &PlanFile, asked: &[Asked], numbers: &Numbers) -> Vec<ChanceTold> {
    let (mm, deg) = (file.tests.restored_mm, file.tests.restored_deg);
    let limits = [(AP, mm), (IE, deg), (VV, deg)];
    let chance = |of: String, limits: &[(Coordinate, f64)], holds: &dyn Fn(&Asked) -> bool| {
        let tests: Vec<usize> = (0..asked.len()).filter(|t| holds(&asked[*t])).collect();
        // a knee is restored where each coordinate of each test is within its limit; the samples are moved as all numbers are. One whose intact knee is
        // off the plateau is left out; one that is off it only with its graft is not restored
        let mut restored = vec![Some(true); numbers.samples.len()];
        let mut best = true;
        for (t, (c, most)) in tests.iter().flat_map(|t| limits.iter().map(move |l| (*t, *l))) {
            let of = |a: &Answers| off(a, t, c);
            best &= of(&numbers.best).is_some_and(|x| x.abs() <= most);
            let by = of(&numbers.best).zip(numbers.mode.as_ref().and_then(of)).map_or(0.0, |(b, m)| b - m);
            for (sample, restored) in restored.iter_mut().enumerate() {
                let a = &numbers.samples[sample];
                let stays = a[2][t].as_ref().is_some_and(|f| !f.leaves_the_plateau());
                let near = stays && of(a).is_some_and(|x| (x + by).abs() <= most);
                *restored = restored.filter(|_| !numbers.is_left_out(sample, t)).map(|r| r && near);
            }
        }
        let count = |wanted: bool| restored.iter().filter(|r| **r == Some(wanted)).count();
        let n = count(true) + count(false);
        let share = (n > 0).then(|| count(true) as f64 / n as f64);
        ChanceTold { of, chance: share, most_probable: best }
    };
    vec![
        chance(format!("anterior drawer within {mm} mm of the intact knee at every flexion"), &limits[..1], &|a| {
            a.kind == "anterior drawer"
        }),
        chance(format!("pivot shift within {mm} mm and {deg} deg"), &limits, &|a| a.kind == "pivot shift"),
        chance(format!("every loaded test within {mm} mm and {deg} deg"), &limits, &|a| a.kind != "unloaded"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::Six;

    /// A knee that in every state of one test has this AP, reconstructed a little more; off the plateau where that is asked for.
    fn knee(ap: f64, off_plateau: [bool; 3]) -> Answers {
        [0, 1, 2].map(|state: usize| {
            let mut values = vec![0.0; 7];
            values[AP.free_index()] = ap + if state == 2 { 0.5 } else { 0.0 };
            let flags = if off_plateau[state] { vec![Flag::Dislocated] } else { vec![] };
            vec![Some(Found { gs: Six::zeros(), values, flags })]
        })
    }

    #[test]
    fn a_sample_off_the_plateau_has_no_place_in_a_plans_intervals_and_chances() {
        let mut samples: Vec<Answers> = (0..9).map(|k| knee(f64::from(k), [false; 3])).collect();
        let numbers = |samples: &[Answers]| Numbers {
            best: knee(4.0, [false; 3]),
            mode: None,
            samples: samples.to_vec(),
            counted: on_the_plateau(samples),
        };
        let ap = |n: &Numbers, state: usize| n.value(&|a| column(a, state, 0, AP.free_index()), 0.9).unwrap();
        let plain = ap(&numbers(&samples), 0);
        samples.push(knee(90.0, [true, false, false]));
        samples.push(knee(91.0, [false, false, true]));
        let with = numbers(&samples);
        assert!((ap(&with, 2).mean.unwrap() - ((36.0 + 90.0) / 10.0 + 0.5)).abs() < 1e-12);
        assert!((ap(&with, 0).mean.unwrap() - (36.0 + 91.0) / 10.0).abs() < 1e-12 && plain.mean == Some(4.0));
        assert!(with.is_left_out(9, 0) && !with.is_left_out(10, 0));
        assert_eq!(odd(&with, 0, 0), ["1 of 11 samples leaves the plateau"]);
        // of more than half off the plateau there is no interval, and the value stays
        let most: Vec<Answers> = (0..9).map(|k| knee(f64::from(k), [k < 5, false, false])).collect();
        let none = ap(&numbers(&most), 0);
        assert_eq!((none.value, none.mean, none.lower), (4.0, None, None));
    }
}

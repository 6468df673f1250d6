//! A day in the laboratory: trials done, effects hidden, noise added, the truth put in an envelope.

use crate::BenchError;
use crate::asked::{Asked, Hidden};
use crate::draw::effects;
use crate::frames::{Frames, Repeat};
use crate::knee::{Knee, KneeInput, Spread, normal};
use crate::pose::components;
use crate::read::Read;
use crate::rest::{Path, is_out_of_joint, rest, rest_followed};
use crate::tissue;
use crate::unknown;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

pub use crate::draw::{cuts, every_kind, kinds};

/// A trial to be done.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// Data set.
    pub source: String,
    /// Condition: trials of one share their repositioning.
    pub condition: String,
    /// Recorded flexion [deg].
    pub flexion_deg: f64,
    /// Recorded loads VV, IE [N m], ML, AP, SI [N].
    pub load: [f64; 5],
    /// Tracking noise VV, IE [deg], ML, AP, SI [mm].
    pub sd: [f64; 5],
}

/// The truth of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The case's name.
    pub case: String,
    /// "null", the effect's name, "compound" or "unknown".
    pub kind: String,
    /// Effect, scope and parameters.
    pub effects: Vec<(String, String, BTreeMap<String, f64>)>,
    /// Reference strain and stiffness of each bundle.
    pub ligaments: BTreeMap<String, [f64; 2]>,
    /// Factor on the contact's stiffness.
    pub contact_scale: f64,
    /// Tension of each bundle of the knee without effects in drawers of 133 N at 30, 60, 90 deg [N]; truths of earlier versions have none.
    #[serde(default)]
    pub forces_n: BTreeMap<String, BTreeMap<String, f64>>,
    /// What the knee without effects does beyond the plan: in the pivot shift and in passive flexion; truths of earlier versions have none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub beyond: BTreeMap<String, Beyond>,
    /// Frames in which each data set reads poses, from the knee's own; none where all read in those.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub frames: BTreeMap<String, Frames>,
    /// In what knee and laboratory differ from what the analysis supposes, beside laws of contact and fibres; none where nobody wrote it down.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub differs: Option<Vec<String>>,
    /// What the effects change of the readings without noise: a row a trial, VV, IE [deg], ML, AP, SI [mm].
    pub signature: Vec<[f64; 5]>,
    /// Root mean square of it in noises, and the evidence an analysis can expect (filled in by the scorer).
    pub strength: Strength,
    /// Trials, by their place in the plan from 0, in which a knee that is cut lies out of its joint: no laboratory reads them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub out_of_joint: Vec<usize>,
}

/// A knee's answer to loads that no trial of the plan has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beyond {
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// Loads VV, IE [N m], ML, AP, SI [N].
    pub load: [f64; 5],
    /// VV, IE [deg], ML, AP, SI [mm].
    pub pose: [f64; 5],
    /// Tension of each bundle [N].
    pub forces_n: BTreeMap<String, f64>,
}

/// How plain the effects are.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Strength {
    /// Root mean square signature over noise [-].
    pub raw_rms_sd: f64,
    /// Half the squared signature that ligaments cannot absorb, under the analysis' own scatter [-].
    #[serde(default)]
    pub expected_evidence: f64,
    /// The same with trials that jump to another branch set aside [-].
    #[serde(default)]
    pub settled_evidence: f64,
}

/// Measured poses of a case, in the order of the plan: VV, IE [deg], ML, AP, SI [mm].
#[derive(Clone, Debug)]
pub struct Case {
    /// The readings.
    pub readings: Vec<[f64; 5]>,
    /// The truth.
    pub truth: Truth,
}

/// How a laboratory, and the knees that it draws, differ from the usual ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ways {
    /// How well the frames of data sets repeat.
    pub repeat: Repeat,
    /// How widely the knee's laws are drawn.
    pub spread: Spread,
    /// Noise of the tracker beside what the plan states.
    pub noise: Noise,
    /// What the truth tells of it: in what knee and laboratory differ from what the analysis supposes.
    pub differs: Option<Vec<String>>,
    /// Another day with the same knee and the same frames: its noise is drawn anew. 0 is the usual day [-].
    pub day: u64,
}

/// How a tracker's noise differs from what its laboratory states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Factor on that of VV and IE [-].
    pub turns: f64,
    /// A drift through the trials of a data set, in their order: its standard deviation in noises [-].
    pub drift: f64,
}

impl Default for Noise {
    fn default() -> Noise {
        Noise { turns: 1.0, drift: 0.0 }
    }
}

impl Noise {
    /// That of the second laboratory: twice as noisy in rotations as it states, and it drifts.
    pub const SECOND: Noise = Noise { turns: 2.0, drift: 0.7 };
}

/// Trials after which a drift is forgotten by 63 % [-].
const FORGOTTEN: f64 = 8.0;

/// Tells the knee's draws from the laboratory's.
const DRAWN: u64 = 0x9e37_79b9;
/// Tells the drift's draws from all others.
const DRIFTS: u64 = 0x85eb_ca6b;

/// Makes a case of a kind; `size` is a factor on the sizes of its effects.
///
/// Errors: an unknown kind, a plan without trials, a knee without surfaces.
pub fn make(
    input: &KneeInput,
    plan: &[Planned],
    name: &str,
    (kind, size): (&str, f64),
    seed: u64,
) -> Result<Case, BenchError> {
    make_by(input, plan, name, (kind, size), (seed, &Ways::default()))
}

/// [`make`] in a laboratory of other ways.
///
/// # Errors
/// As [`make`].
pub fn make_by(
    input: &KneeInput,
    plan: &[Planned],
    name: &str,
    (kind, size): (&str, f64),
    (seed, ways): (u64, &Ways),
) -> Result<Case, BenchError> {
    if plan.is_empty() {
        return Err(BenchError::Plan("no trials".into()));
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ ways.day);
    let knee = Knee::drawn_within(input, &ways.spread, seed ^ DRAWN)?;
    let mut sources: Vec<String> = Vec::new();
    for p in plan {
        if !sources.contains(&p.source) {
            sources.push(p.source.clone());
        }
    }
    let effects = effects((kind, size), &sources, &mut random)?;
    let path = path(&knee, plan);
    let subject = subject(input, &effects, &ways.spread, seed)?;
    // a knee of other tissues rests elsewhere without load, too
    let is_other = effects.iter().any(|(h, _)| tissue::changes(h));
    let own = subject.as_ref().filter(|_| is_other).map(|knee| self::path(knee, plan));
    let frames = ways.repeat.drawn(&sources, seed);
    let read = |of| Read::new(of, &frames, &|knee| self::path(knee, plan));
    let subject = read((subject.as_ref().unwrap_or(&knee), own.as_ref().unwrap_or(&path)))?;
    let Simulated { readings: with, mut out_of_joint } = simulate(&subject, plan, &effects, &mut random, true);
    let mut quiet = ChaCha8Rng::seed_from_u64(seed);
    let clean = |of: &Read, effects: &[(Hidden, String)], r: &mut ChaCha8Rng| simulate(of, plan, effects, r, false);
    let signature: Vec<[f64; 5]> = if effects.is_empty() {
        vec![[0.0; 5]; plan.len()]
    } else {
        let sound = read((&knee, &path))?;
        let (a, b) = (clean(&subject, &effects, &mut quiet), clean(&sound, &[], &mut quiet));
        out_of_joint.extend(&a.out_of_joint);
        a.readings.iter().zip(&b.readings).map(|(x, y)| std::array::from_fn(|c| x[c] - y[c])).collect()
    };
    let is_read = |k: &usize| !out_of_joint.contains(k);
    let square = |k: usize| (0..5).map(|c| (signature[k][c] / plan[k].sd[c]).powi(2)).sum::<f64>();
    let squares: f64 = (0..plan.len()).filter(is_read).map(square).sum();
    let count = 5 * (0..plan.len()).filter(is_read).count().max(1);
    let truth = Truth {
        case: name.to_owned(),
        kind: kind.to_owned(),
        effects: effects.iter().map(|(h, s)| (h.effect.clone(), s.clone(), h.parameters.clone())).collect(),
        ligaments: knee.bundles.iter().map(|b| (b.name.clone(), [b.strain, b.stiffness])).collect(),
        contact_scale: knee.contact_scale,
        forces_n: drawers(&knee, &path),
        beyond: beyond(&knee, &path),
        frames,
        differs: ways.differs.clone(),
        signature,
        strength: Strength { raw_rms_sd: (squares / count as f64).sqrt(), ..Strength::default() },
        out_of_joint: out_of_joint.into_iter().collect(),
    };
    Ok(Case { readings: noisy(with, plan, &ways.noise, (&mut random, seed ^ ways.day)), truth })
}

/// The knee that is put to the tests where it is not the one in the CT: of another size by a share, or with other tissues.
fn subject(
    input: &KneeInput,
    effects: &[(Hidden, String)],
    spread: &Spread,
    seed: u64,
) -> Result<Option<Knee>, BenchError> {
    let share: f64 = effects.iter().filter(|(h, _)| h.effect == "x_ct_scale").map(|(h, _)| h.value("share")).sum();
    let is_other = effects.iter().any(|(h, _)| tissue::changes(h));
    if share == 0.0 && !is_other {
        return Ok(None);
    }
    let mut knee = if share == 0.0 {
        Knee::drawn_within(input, spread, seed ^ DRAWN)?
    } else {
        Knee::drawn_within(&unknown::true_size(input, share), spread, seed ^ DRAWN)?
    };
    effects.iter().try_for_each(|(h, _)| tissue::change(&mut knee, h))?;
    Ok(Some(knee))
}

/// Tensions in drawers of 133 N with 20 N of compression [andreassen2025, section 2.6.2].
fn drawers(knee: &Knee, path: &Path) -> BTreeMap<String, BTreeMap<String, f64>> {
    let mut out = BTreeMap::new();
    for (name, force) in [("anterior", 133.0), ("posterior", -133.0)] {
        for flexion in [30.0, 60.0, 90.0f64] {
            let asked = Asked { flexion: flexion.to_radians(), load: [0.0, 0.0, 0.0, force, 20.0] };
            let read = rest(knee, &[], &asked, path);
            out.insert(format!("{name}_{flexion}"), knee.tensions(asked.flexion, &components(&read)));
        }
    }
    out
}

/// The pivot shift, 8 N m of valgus and 4 N m inwards at 30 deg, and passive flexion under 20 N of compression [andreassen2025, section 2.6].
fn beyond(knee: &Knee, path: &Path) -> BTreeMap<String, Beyond> {
    let passive = [0.0, 15.0, 45.0, 75.0].map(|f| (format!("passive_{f}"), f, [0.0, 0.0, 0.0, 0.0, 20.0]));
    let pivot = ("pivot_shift_30".to_owned(), 30.0, [8.0, -4.0, 0.0, 0.0, 20.0]);
    let answer = |(name, flexion_deg, load): (String, f64, [f64; 5])| {
        let scale = [1000.0, 1000.0, 1.0, 1.0, 1.0];
        let asked = Asked { flexion: flexion_deg.to_radians(), load: std::array::from_fn(|j| load[j] * scale[j]) };
        let read = rest(knee, &[], &asked, path);
        let pose = [read[1].to_degrees(), read[2].to_degrees(), read[3], read[4], read[5]];
        (name, Beyond { flexion_deg, load, pose, forces_n: knee.tensions(asked.flexion, &components(&read)) })
    };
    passive.into_iter().chain([pivot]).map(answer).collect()
}

/// Unloaded rests up to the plan's deepest flexion, and up to the drawers'.
fn path(knee: &Knee, plan: &[Planned]) -> Path {
    let last = plan.iter().map(|p| p.flexion_deg).fold(90.0, f64::max).to_radians();
    let compression = plan.iter().map(|p| p.load[4]).sum::<f64>() / plan.len() as f64;
    Path::new(knee, last, compression)
}

/// What a knee does in the trials of a plan.
struct Simulated {
    /// VV, IE [deg], ML, AP, SI [mm], without tracking noise.
    readings: Vec<[f64; 5]>,
    /// Places of the trials in which a knee that is cut lies out of its joint.
    out_of_joint: BTreeSet<usize>,
}

/// The trials of a plan, done with a knee in which effects are hidden.
fn simulate(
    read: &Read,
    plan: &[Planned],
    effects: &[(Hidden, String)],
    random: &mut ChaCha8Rng,
    load_noise: bool,
) -> Simulated {
    let noise: Vec<[f64; 5]> = plan
        .iter()
        .map(|_| {
            let size = if load_noise { 1.0 } else { 0.0 };
            [100.0, 100.0, 2.0, 2.0, 2.0].map(|s| size * s * normal(random))
        })
        .collect();
    // a knee that is whole is asked by how far it opens, and drawn anew
    let is_cut = effects.iter().any(|(h, _)| h.cuts().is_some());
    let (mut out, is_out): (Vec<[f64; 5]>, Vec<bool>) = plan
        .par_iter()
        .zip(&noise)
        .map(|(p, noise)| {
            let here: Vec<Hidden> =
                effects.iter().filter(|(_, s)| s == "both" || *s == p.source).map(|(h, _)| h.clone()).collect();
            let (knee, path) = read.by(&p.source);
            let recorded = p.flexion_deg.to_radians();
            let load = [1000.0, 1000.0, 1.0, 1.0, 1.0];
            let mut asked = Asked { flexion: recorded, load: std::array::from_fn(|j| p.load[j] * load[j]) };
            for h in &here {
                asked = h.true_load(&asked);
            }
            (0..5).for_each(|j| asked.load[j] += noise[j]);
            let loaded = asked;
            let misread = |r: &[f64; 6]| here.iter().fold(*r, |r, h| h.misread(&loaded, &r));
            let mut lies = rest_followed(knee, &here, &asked, path);
            let mut seen = misread(&lies);
            // the flexion that is recorded is the one that is read
            if (seen[0] - recorded).abs() > 1e-6 {
                asked.flexion += recorded - seen[0];
                lies = rest_followed(knee, &here, &asked, path);
                seen = misread(&lies);
            }
            let is_out = is_cut && is_out_of_joint(knee, &lies);
            ([seen[1].to_degrees(), seen[2].to_degrees(), seen[3], seen[4], seen[5]], is_out)
        })
        .unzip();
    for (hidden, scope) in effects {
        let places: Vec<usize> = (0..plan.len()).filter(|&i| scope == "both" || *scope == plan[i].source).collect();
        if let Some((a, b)) = unknown::swapped(hidden, places.len()) {
            out.swap(places[a], places[b]);
        }
    }
    Simulated { readings: out, out_of_joint: (0..plan.len()).filter(|k| is_out[*k]).collect() }
}

/// Tracking noise, correlated within a condition, with an outlier in a hundred, and with a drift where the laboratory has one.
fn noisy(
    mut readings: Vec<[f64; 5]>,
    plan: &[Planned],
    noise: &Noise,
    (random, seed): (&mut ChaCha8Rng, u64),
) -> Vec<[f64; 5]> {
    let mut shared: BTreeMap<(String, String), [f64; 5]> = BTreeMap::new();
    for ((r, p), drift) in readings.iter_mut().zip(plan).zip(drifts(plan, noise, seed)) {
        let key = (p.source.clone(), p.condition.clone());
        let common = *shared.entry(key).or_insert_with(|| std::array::from_fn(|_| normal(random)));
        let outlier = if random.random::<f64>() < 0.01 { 4.0 } else { 1.0 };
        for c in 0..5 {
            let sd = if c < 2 { noise.turns * p.sd[c] } else { p.sd[c] };
            r[c] += sd * (0.4 * common[c] + outlier * normal(random) + drift[c]);
        }
    }
    readings
}

/// How far each trial's readings have drifted, in noises: each data set by itself, in the order of its trials.
fn drifts(plan: &[Planned], noise: &Noise, seed: u64) -> Vec<[f64; 5]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ DRIFTS);
    let kept = (-1.0 / FORGOTTEN).exp();
    let fresh = (1.0 - kept * kept).sqrt();
    let mut last: BTreeMap<&str, [f64; 5]> = BTreeMap::new();
    let mut out = Vec::with_capacity(plan.len());
    for p in plan {
        let step: [f64; 5] = std::array::from_fn(|_| normal(&mut random));
        let now: [f64; 5] = match last.get(p.source.as_str()) {
            Some(before) => std::array::from_fn(|c| kept * before[c] + fresh * step[c]),
            None => step,
        };
        last.insert(&p.source, now);
        out.push(now.map(|d| noise.drift * d));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings of a knee that stays at zero, each trial a condition of its own.
    fn still(noise: &Noise) -> Vec<[f64; 5]> {
        let trial = |k: usize| Planned {
            source: "kla".into(),
            condition: k.to_string(),
            flexion_deg: 30.0,
            load: [0.0; 5],
            sd: [0.5, 0.5, 0.4, 0.4, 0.4],
        };
        let plan: Vec<Planned> = (0..4000).map(trial).collect();
        noisy(vec![[0.0; 5]; plan.len()], &plan, noise, (&mut ChaCha8Rng::seed_from_u64(3), 3))
    }

    /// Standard deviation of a component in its noises, and correlation between neighbours.
    fn figures(readings: &[[f64; 5]], c: usize, sd: f64) -> [f64; 2] {
        let mean_of = |products: Vec<f64>| products.iter().sum::<f64>() / products.len() as f64;
        let square = mean_of(readings.iter().map(|r| r[c] * r[c]).collect());
        let beside = mean_of(readings.windows(2).map(|w| w[0][c] * w[1][c]).collect());
        [square.sqrt() / sd, beside / square]
    }

    #[test]
    fn the_second_laboratory_is_twice_as_noisy_in_rotations_and_drifts() {
        let [first, second] = [Noise::default(), Noise::SECOND].map(|noise| still(&noise));
        for (c, sd) in [(0, 0.5), (1, 0.5), (2, 0.4), (3, 0.4), (4, 0.4)] {
            let [a, b] = [&first, &second].map(|readings| figures(readings, c, sd));
            // 0.4 of each condition, an outlier of four in a hundred; then the drift
            let [plain, drifting] = [1.31f64, 1.31 + 0.49].map(f64::sqrt);
            let turns = if c < 2 { 2.0 } else { 1.0 };
            assert!(
                (a[0] / plain - 1.0).abs() < 0.08 && (b[0] / (turns * drifting) - 1.0).abs() < 0.08,
                "{c}: {a:?} {b:?}"
            );
            assert!(a[1].abs() < 0.08 && b[1] > 0.15, "{c}: neighbours {a:?} {b:?}");
        }
    }
}

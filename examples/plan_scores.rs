//! How good the chances of plans are, on knees whose truth is known: `cargo run --release --example plan_scores -- BELIEVED TRUE [BELIEVED TRUE ...]`
//!
//! Each pair is two folders that `build-model plan` wrote for the same graft.toml: one of a calibrated knee with samples, one of the true knee.
//! A chance is scored by its squared distance from what holds in the true knee, 1 or 0 [brier1950]. Beside it stands the same score of the most
//! probable knee alone, which says 1 or 0. Prints both, of each thing that a plan tells a chance of and of all. A table of reliability has how often
//! what was told with a chance held.
//!
//! `plan_scores --make MODEL LAXITY.csv OUT [COUNT]` makes such knees: OUT/knee_01 and on, each with true.json and laxity.csv. A true knee is the
//! model with other ligaments, sites and contact. laxity.csv has what it answers to the loads of LAXITY.csv, with noise. The commands: docs/plan.md.
#![expect(clippy::print_stderr, clippy::print_stdout, reason = "a table for the reader")]

use genu::error::BuildError;
use genu::model_file::{load, moved};
use genu::record::json;
use genu::store;
use meshes::Vector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use sim::coordinate::Free;
use sim::laxity::{LaxityTrial, trials_csv};
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

/// Groups of chances in the table of reliability [-]; ours: few plans fill no more.
const GROUPS: usize = 4;
/// Made knees, unless told [-].
const COUNT: u64 = 20;
/// Standard deviations by which a made knee differs from its model: the logarithm of a stiffness, a reference strain, the logarithm of the contact's
/// stiffness [-]. As the bench's laboratory draws its knees.
const DRAWN: [f64; 3] = [0.15, 0.022, 0.2];
/// By which each end of a bundle is displaced, along each axis [mm]; ours: a footprint is some 5 mm wide.
const SITE_MM: f64 = 1.0;
/// Noise of every reading [deg, mm]; as of the published laxity data.
const NOISE: f64 = 0.2;
/// Draws of knees by which a difference of scores has an interval [-]; ours.
const REDRAWN: usize = 2000;

/// A chance that was told, and what came of it.
struct Told {
    /// What it is a chance of.
    of: String,
    /// Which pair of plans it is from.
    pair: usize,
    chance: f64,
    /// By the most probable knee.
    best: bool,
    /// By the true knee.
    holds: bool,
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let done = match args.first().map(String::as_str) {
        Some("--make") if (4..=5).contains(&args.len()) => make(&args[1..]),
        Some(first) if first != "--make" && args.len().is_multiple_of(2) => score(&args),
        _ => {
            eprintln!(
                "usage: plan_scores BELIEVED TRUE [BELIEVED TRUE ...] (folders of plans), or --make MODEL LAXITY.csv OUT [COUNT]"
            );
            return ExitCode::from(2);
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

// ---- made knees

fn make(args: &[String]) -> Result<(), BuildError> {
    let [model, laxity, out] = [0, 1, 2].map(|k| Path::new(&args[k]));
    let wrong = BuildError::File;
    let count =
        args.get(3).map_or(Ok(COUNT), |n| n.parse().map_err(|_| wrong(format!("{n} is no number of knees"))))?;
    let loaded = load(model)?;
    let asked =
        sim::laxity::read(&store::read(laxity)?).map_err(|e| wrong(format!("{}: {e}", laxity.display())))?.trials;
    let from = store::absolute(&loaded.folder)?;
    for knee in 1..=count {
        let mut random = ChaCha8Rng::seed_from_u64(knee);
        let spec = drawn(&loaded.spec, &mut random);
        let told = |e: sim::SimError| wrong(format!("knee {knee}: {e}"));
        let truth = sim::compile(&spec, &loaded.meshes).map_err(told)?;
        let answers = solve_trials(&truth, &asked, &TrialOptions::default());
        let read = asked.iter().zip(answers).filter_map(|(t, a)| {
            let pose = a.ok()?.predicted();
            let measured = Free::from_fn(|c| Some(pose[c] + NOISE * normal(&mut random)));
            Some(LaxityTrial { measured, sd: Free::all(Some(NOISE)), reference: None, ..t.clone() })
        });
        let read: Vec<LaxityTrial> = read.collect();
        let folder = out.join(format!("knee_{knee:02}"));
        let to = store::make_folder(&folder)?;
        let files = [("true.json", json(&moved(&spec, &from, &to))), ("laxity.csv", trials_csv(&read).into_bytes())];
        store::write_all(&folder, &files.map(|(name, bytes)| (name.to_owned(), bytes)))?;
        println!("{}: {} of {} trials have an equilibrium", folder.display(), read.len(), asked.len());
    }
    Ok(())
}

/// Another knee of the same bones.
fn drawn(spec: &ModelSpec, random: &mut ChaCha8Rng) -> ModelSpec {
    let mut out = spec.clone();
    let ModelSpec { bundles, fibres, contact, .. } = &mut out;
    // the parts of the superficial collateral are one sheet, of one stiffness
    let mut stiffness = BTreeMap::new();
    for b in bundles {
        let sheet = if b.name.starts_with("sMCL") { "sMCL" } else { b.name.as_str() };
        let own = (DRAWN[0] * normal(random)).exp();
        b.stiffness_n_per_mm *= *stiffness.entry(sheet.to_owned()).or_insert(own);
        b.reference_strain += DRAWN[1] * normal(random);
        let [femur, tibia] = [0, 1].map(|_| Vector::from_fn(|_, _| SITE_MM * normal(random)));
        for f in fibres.iter_mut().filter(|f| f.bundle == b.name) {
            f.femur += femur;
            f.tibia += tibia;
        }
    }
    contact.scale_pressure((DRAWN[2] * normal(random)).exp());
    out
}

/// A standard normal number.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - u).max(1e-300).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

// ---- scores

fn score(args: &[String]) -> Result<(), BuildError> {
    let mut all = Vec::new();
    for (number, pair) in args.chunks(2).enumerate() {
        all.extend(told(Path::new(&pair[0]), Path::new(&pair[1]), number)?);
    }
    if all.is_empty() {
        return Err(BuildError::File(
            "no plan tells a chance: expected plans of calibrated knees, with samples".into(),
        ));
    }
    print(&all);
    Ok(())
}

/// The chances of a plan, each with what holds in the true knee. A chance that was not told, for want of samples, is left out.
fn told(believed: &Path, truth: &Path, pair: usize) -> Result<Vec<Told>, BuildError> {
    let [believed_plan, true_plan] = [plan(believed)?, plan(truth)?];
    if believed_plan["planned"] != true_plan["planned"] {
        let told = format!("{} and {} are of different plans", believed.display(), truth.display());
        return Err(BuildError::File(told));
    }
    let chances = |plan: &Value| plan["chances"].as_array().cloned().unwrap_or_default();
    let both = chances(&believed_plan).into_iter().zip(chances(&true_plan));
    let one = |(told, true_one): (Value, Value)| {
        Some(Told {
            of: told["of"].as_str()?.to_owned(),
            pair,
            chance: told["chance"].as_f64()?,
            best: told["most_probable"].as_bool()?,
            holds: true_one["most_probable"].as_bool()?,
        })
    };
    Ok(both.filter_map(one).collect())
}

fn plan(folder: &Path) -> Result<Value, BuildError> {
    let path = folder.join("plan.json");
    serde_json::from_slice(&store::read(&path)?).map_err(|e| BuildError::File(format!("{}: {e}", path.display())))
}

/// Mean squared distance of what was told from what holds [-]: by the samples, by the most probable knee alone.
fn brier(all: &[&Told]) -> [f64; 2] {
    let number = |b: bool| f64::from(u8::from(b));
    let mean = |told: &dyn Fn(&Told) -> f64| {
        all.iter().copied().map(|t| (told(t) - number(t.holds)).powi(2)).sum::<f64>() / all.len().max(1) as f64
    };
    [mean(&|t: &Told| t.chance), mean(&|t: &Told| number(t.best))]
}

/// By how much the score of the samples lies below that of the most probable knee, least and most in nine of ten draws of the pairs of plans.
fn ahead(all: &[&Told]) -> [f64; 2] {
    let pairs = all.iter().map(|t| t.pair).max().map_or(0, |n| n + 1);
    let of: Vec<Vec<&Told>> = (0..pairs).map(|k| all.iter().copied().filter(|t| t.pair == k).collect()).collect();
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut found: Vec<f64> = (0..REDRAWN)
        .map(|_| {
            let drawn = (0..pairs).flat_map(|_| of[(random.random::<f64>() * pairs as f64) as usize].clone());
            let [samples, best] = brier(&drawn.collect::<Vec<&Told>>());
            best - samples
        })
        .collect();
    found.sort_by(f64::total_cmp);
    [found[REDRAWN / 20], found[REDRAWN - 1 - REDRAWN / 20]]
}

fn print(all: &[Told]) {
    println!("| chance of | told | held | Brier score by the samples | by the most probable knee | ahead by, 90 % |");
    println!("|---|---|---|---|---|---|");
    let mut kinds: Vec<&str> = Vec::new();
    for t in all {
        if !kinds.contains(&t.of.as_str()) {
            kinds.push(&t.of);
        }
    }
    for kind in kinds.iter().copied().map(Some).chain([None]) {
        let own: Vec<&Told> = all.iter().filter(|t| kind.is_none_or(|k| t.of == k)).collect();
        let held = own.iter().filter(|t| t.holds).count();
        let ([samples, best], [low, high]) = (brier(&own), ahead(&own));
        let of = kind.unwrap_or("all");
        println!("| {of} | {} | {held} | {samples:.3} | {best:.3} | {low:.3} to {high:.3} |", own.len());
    }
    println!("\n| told, % | chances | mean told, % | held, % |\n|---|---|---|---|");
    let group = |t: &Told| ((t.chance * GROUPS as f64) as usize).min(GROUPS - 1);
    for k in 0..GROUPS {
        let own: Vec<&Told> = all.iter().filter(|t| group(t) == k).collect();
        if own.is_empty() {
            continue;
        }
        let percent = |sum: f64| 100.0 * sum / own.len() as f64;
        let [low, high] = [k, k + 1].map(|k| 100.0 * k as f64 / GROUPS as f64);
        let mean = percent(own.iter().map(|t| t.chance).sum());
        let share = percent(own.iter().filter(|t| t.holds).count() as f64);
        println!("| {low:.0} to {high:.0} | {} | {mean:.0} | {share:.0} |", own.len());
    }
}

//! How good the chances of plans are, on knees whose truth is known: `cargo run --release --example plan_scores -- BELIEVED TRUE [BELIEVED TRUE ...]`
//!
//! Each pair is two folders that `build-model plan` wrote for the same graft.toml: one of a calibrated knee with samples, one of the true knee.
//! A chance is scored by its squared distance from what holds in the true knee, 1 or 0 [brier1950]. Beside it stands the same score of the most
//! probable knee alone, which says 1 or 0. Prints both, and a table of how often what was told with a chance held.
#![expect(clippy::print_stderr, clippy::print_stdout, reason = "a table for the reader")]

use genu::error::BuildError;
use genu::store;
use serde_json::Value;
use std::path::Path;
use std::process::ExitCode;

/// Groups of chances in the table of reliability [-]; ours: few plans fill no more.
const GROUPS: usize = 4;

/// A chance that was told, and what came of it.
struct Told {
    chance: f64,
    /// By the most probable knee.
    best: bool,
    /// By the true knee.
    holds: bool,
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    if args.is_empty() || !args.len().is_multiple_of(2) {
        eprintln!("usage: plan_scores BELIEVED TRUE [BELIEVED TRUE ...] (folders of plans)");
        return ExitCode::from(2);
    }
    let mut all = Vec::new();
    for pair in args.chunks(2) {
        match told(Path::new(&pair[0]), Path::new(&pair[1])) {
            Ok(told) => all.extend(told),
            Err(e) => {
                eprintln!("{e}");
                return ExitCode::FAILURE;
            }
        }
    }
    if all.is_empty() {
        eprintln!("no plan tells a chance: expected plans of calibrated knees, with samples");
        return ExitCode::FAILURE;
    }
    print(&all);
    ExitCode::SUCCESS
}

/// The chances of a plan, each with what holds in the true knee. A chance that was not told, for want of samples, is left out.
fn told(believed: &Path, truth: &Path) -> Result<Vec<Told>, BuildError> {
    let [believed_plan, true_plan] = [plan(believed)?, plan(truth)?];
    if believed_plan["planned"] != true_plan["planned"] {
        let told = format!("{} and {} are of different plans", believed.display(), truth.display());
        return Err(BuildError::File(told));
    }
    let chances = |plan: &Value| plan["chances"].as_array().cloned().unwrap_or_default();
    let both = chances(&believed_plan).into_iter().zip(chances(&true_plan));
    let one = |(told, true_one): (Value, Value)| {
        Some(Told {
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

/// Mean squared distance of what was told from what holds [-].
fn brier(all: &[Told], told: impl Fn(&Told) -> f64) -> f64 {
    let off = |t: &Told| (told(t) - f64::from(u8::from(t.holds))).powi(2);
    all.iter().map(off).sum::<f64>() / all.len() as f64
}

fn print(all: &[Told]) {
    let held = all.iter().filter(|t| t.holds).count();
    println!("{} chances, {held} held", all.len());
    println!("Brier score: by the samples {:.3}", brier(all, |t| t.chance));
    println!("Brier score: by the most probable knee alone {:.3}", brier(all, |t| f64::from(u8::from(t.best))));
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

//! Times of the solvers on one thread: `cargo bench --bench solver [MODEL.json [TRIALS.csv]]`.
//!
//! A model whose contact is by thickness is also timed with its table, trial by trial in turn, as a ratio.
//! A model with a patella is also timed under tension of the quadriceps, in turn with the same trials without it.
//!
//! Without a model, the published knee of `../shared` with its full meshes, and its measured trials. Wall clock; run it on a quiet machine.
#![expect(clippy::disallowed_methods, reason = "a benchmark asks the system for its time")]
#![expect(clippy::print_stdout, reason = "a benchmark prints")]

#[path = "common/clock.rs"]
mod clock;

use clock::Clock;
use genu::model_file;
use sim::Model;
use sim::explicit::{ExplicitOptions, ExplicitState, Progress, TrialSteps, explicit_trial, run, unobserved};
use sim::laxity::LaxityTrial;
use sim::trials::{TrialOptions, solve_trial};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Increments of an explicit run that is timed.
const INCREMENTS: usize = 2000;

fn main() -> Result<(), String> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let given: Vec<PathBuf> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).map(PathBuf::from).collect();
    let Compiled { model, by_table, triangles } = match given.first() {
        Some(path) => compiled(path)?,
        None => {
            let deck = shared.join("published/S192803/deck/S192803_MAIN_LAXITY_Anterior_30deg_10.inp");
            if !deck.exists() {
                println!("bench solver: skipped, {} is not there; name a model.json", deck.display());
                return Ok(());
            }
            let out = std::env::temp_dir().join(format!("genu-bench-{}", std::process::id()));
            genu::import::import_abaqus(&genu::import::ImportArgs::of(&deck, &out)).map_err(|e| e.to_string())?;
            compiled(&out)?
        }
    };
    let trials = given.get(1).cloned().unwrap_or_else(|| shared.join("specimens/S192803/laxity/kla.csv"));
    let bytes = genu::store::read(&trials).map_err(|e| e.to_string())?;
    let trials = sim::laxity::read(&bytes).map_err(|e| e.to_string())?.trials;
    println!("{}: {triangles} contact triangles, {} trials, one thread", model.id, trials.len());
    quasi_static(&model, &trials)?;
    if let Some(table) = by_table {
        beside_table(&model, &table, &trials)?;
    }
    if model.has_patella() {
        under_tension(&model, &trials)?;
    }
    explicit(&model, &trials)
}

/// A model ready to be timed.
struct Compiled {
    model: Model,
    /// The same with the contact's table in place of its thickness.
    by_table: Option<Model>,
    /// Number of contact triangles.
    triangles: usize,
}

fn compiled(path: &Path) -> Result<Compiled, String> {
    let loaded = model_file::load(path).map_err(|e| e.to_string())?;
    let start = Instant::now();
    let model = sim::compile(&loaded.spec, &loaded.meshes).map_err(|e| e.to_string())?;
    println!("compile                       {:9.1} ms", 1e3 * start.elapsed().as_secs_f64());
    let pairs = &loaded.spec.contact.pairs;
    let names: std::collections::BTreeSet<&String> = pairs.iter().flat_map(|p| [&p.femur, &p.tibia]).collect();
    let count = |name: &&String| match &loaded.meshes[*name] {
        sim::mesh::MeshValue::Surface(mesh) => mesh.triangles.len(),
        _ => 0,
    };
    let triangles = names.iter().map(count).sum();
    let mut spec = loaded.spec.clone();
    let layered = spec.contact.layer.take().is_some();
    let by_table = layered.then(|| sim::compile(&spec, &loaded.meshes)).transpose().map_err(|e| e.to_string())?;
    Ok(Compiled { model, by_table, triangles })
}

/// Times of `work` over the trials [ms], sorted; the processor's clock ticks in 4 ms, so that short work is repeated.
fn times(
    trials: &[LaxityTrial],
    repeats: usize,
    mut work: impl FnMut(&LaxityTrial) -> Result<(), String>,
) -> Result<Vec<f64>, String> {
    let mut times = Vec::new();
    for trial in trials {
        let start = Clock::start();
        for _ in 0..repeats {
            work(trial)?;
        }
        times.push(start.milliseconds() / repeats as f64);
    }
    times.sort_by(f64::total_cmp);
    Ok(times)
}

fn quasi_static(model: &Model, trials: &[LaxityTrial]) -> Result<(), String> {
    let options = TrialOptions::default();
    let t = times(trials, 10, |t| solve_trial(model, t, &options).map(|_| ()).map_err(|e| e.to_string()))?;
    println!("quasi-static trial, median    {:9.1} ms   goal 10", t[t.len() / 2]);
    println!("quasi-static trial, slowest   {:9.1} ms", t[t.len() - 1]);
    Ok(())
}

/// A trial by thickness over the same by the table, in turns.
fn beside_table(model: &Model, table: &Model, trials: &[LaxityTrial]) -> Result<(), String> {
    let (sum, median) = ratio(trials, |t| [(model, t.clone()), (table, t.clone())])?;
    println!("by thickness over by table    {sum:9.2}      all trials; goal 1.2");
    println!("the same, median trial        {median:9.2}");
    Ok(())
}

/// Tension of the quadriceps under which a patella is timed [N].
const TENSION_N: f64 = 100.0;

/// A trial under tension of the quadriceps over the same without, in turns.
fn under_tension(model: &Model, trials: &[LaxityTrial]) -> Result<(), String> {
    let under = |t: &LaxityTrial, quadriceps_n: f64| LaxityTrial { quadriceps_n, ..t.clone() };
    let (sum, median) = ratio(trials, |t| [(model, under(t, TENSION_N)), (model, under(t, 0.0))])?;
    println!("under tension over without    {sum:9.2}      all trials, {TENSION_N} N; goal 2.0");
    println!("the same, median trial        {median:9.2}");
    Ok(())
}

/// Time of one way to solve a trial over that of the other, in turns: of all trials, and of the median trial [-].
fn ratio<'a>(
    trials: &[LaxityTrial],
    both: impl Fn(&LaxityTrial) -> [(&'a Model, LaxityTrial); 2],
) -> Result<(f64, f64), String> {
    let options = TrialOptions::default();
    let (mut sum, mut ratios) = ([0.0; 2], Vec::new());
    for trial in trials {
        let (ways, mut own) = (both(trial), [0.0; 2]);
        for _ in 0..10 {
            for (which, (model, t)) in ways.iter().enumerate() {
                let start = Clock::start();
                solve_trial(model, t, &options).map(|_| ()).map_err(|e| e.to_string())?;
                own[which] += start.milliseconds();
            }
        }
        ratios.push(own[0] / own[1]);
        sum = [sum[0] + own[0], sum[1] + own[1]];
    }
    ratios.sort_by(f64::total_cmp);
    Ok((sum[0] / sum[1], ratios[ratios.len() / 2]))
}

fn explicit(model: &Model, trials: &[LaxityTrial]) -> Result<(), String> {
    let (steps, options) = (TrialSteps::default(), ExplicitOptions::default());
    let some: Vec<LaxityTrial> = trials.iter().step_by(6).cloned().collect();
    let first = |trial: &LaxityTrial| -> Result<(), String> {
        let program =
            steps.program(&model.joint, trial.fe_deg, &trial.load.generalised()).map_err(|e| e.to_string())?;
        let program = sim::explicit::Program { steps: program.steps[1..].to_vec() };
        let mut stop = |p: &Progress| {
            if p.state.increments == INCREMENTS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        match run(model, &program, &options, &mut ExplicitState::at_rest(), &mut stop) {
            Err(sim::SimError::Cancelled { .. }) => Ok(()),
            other => Err(format!("ended before {INCREMENTS} increments: {other:?}")),
        }
    };
    let t = times(&some, 1, first)?;
    println!("explicit, {INCREMENTS} increments     {:9.1} ms   goal 200", t[t.len() / 2]);
    let whole = |t: &LaxityTrial| {
        explicit_trial(model, t, &steps, &options, &mut unobserved).map(|_| ()).map_err(|e| e.to_string())
    };
    let t = times(&some, 1, whole)?;
    println!("explicit trial, median        {:9.1} ms", t[t.len() / 2]);
    Ok(())
}

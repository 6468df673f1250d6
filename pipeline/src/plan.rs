//! `plan`: a ligament's reconstruction on a knee, before it is done: intact, deficient and reconstructed side by side.

mod astray;
mod chances;
mod file;
mod ground;
mod heat;
mod html;
mod knee;
mod map;
mod numbers;
mod outcome;
mod page;
mod planned;
mod sampled;
mod sites;
mod spelled;
mod sweep;
mod table;

use crate::bands;
use crate::beyond;
use crate::error::{BuildError, Place};
use crate::model_file::{self, LoadedModel};
use crate::record::json;
use crate::report::html::LivePart;
use crate::report::live::Begin;
use crate::report::live_model::live_part;
use crate::simulate::SAMPLES;
use crate::store;
use crate::told::{ModelTold, Told};
use crate::which_model::WhichModel;
use calibration::samples::Samples;
pub use chances::{ChanceTold, FailTold};
use clap::Args;
pub use file::{EXAMPLE, GraftFile, PlanFile, SiteFile, TestsFile, parsed, read};
pub use knee::Surfaces;
use notices::{Kind, Notice};
pub use numbers::Value;
pub use outcome::{GraftTold, Outcome, SCHEMA, TestTold, outcome};
use std::path::{Path, PathBuf};
pub use sweep::{BestTold, SCHEMA as SWEEP_SCHEMA, SweepTold};

/// `build-model plan`.
#[derive(Args, Clone, Debug)]
pub struct PlanArgs {
    /// model.json, or the folder of a build or specimen: then its joint calibrated model, else that of its one data set, else the assembled one
    #[arg(required_unless_present_any = ["example", "sweep_example"])]
    pub model: Option<PathBuf>,
    /// What is cut and what is put in; see --example
    #[arg(value_name = "graft.toml", required_unless_present_any = ["example", "sweep_example"])]
    pub plan: Option<PathBuf>,
    /// Which model of a build
    #[command(flatten)]
    pub which: WhichModel,
    /// Folder for plan.json, plan.csv and plan.html; of a sweep for sweep.csv, sweep.json and sweep.html
    #[arg(long, default_value = "plan")]
    pub out: PathBuf,
    /// Samples of the posterior, where the model has any: mean and 90 % interval stand beside every value; 0: the one model alone
    #[arg(long, value_name = "N", default_value_t = SAMPLES, value_parser = crate::numbers::count)]
    pub samples: usize,
    /// Draws which samples are asked, where fewer are asked than there are; without it the first
    #[arg(long)]
    pub seed: Option<u64>,
    /// Also map what other femoral sites and tensions of the first graft would do, of the most probable knee: map.csv, and coloured maps in plan.html
    #[arg(long)]
    pub map: bool,
    /// Ask many plans that differ in the choices of one graft, all combinations of the lists in this file; see --sweep-example
    #[arg(long, value_name = "sweep.toml", conflicts_with = "map")]
    pub sweep: Option<PathBuf>,
    /// Print an example of sweep.toml, with every key, and do nothing else
    #[arg(long)]
    pub sweep_example: bool,
    /// Print an example of graft.toml, with every key, and do nothing else
    #[arg(long)]
    pub example: bool,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// What is said where samples are asked of a calibration that left none.
const NO_SAMPLES: &str =
    "the calibration left no samples: no intervals and no chances; calibrate with inference.samples above 1";

/// Plans, and writes what comes of it.
pub fn plan(args: &PlanArgs) -> Result<Told, BuildError> {
    if args.example {
        return Ok(Told { words: EXAMPLE.to_owned(), ..Told::default() });
    }
    if args.sweep_example {
        return Ok(Told { words: sweep::EXAMPLE.to_owned(), ..Told::default() });
    }
    let (Some(model), Some(path)) = (&args.model, &args.plan) else {
        return Err(BuildError::Usage("a model and a graft.toml were expected; see --help".into()));
    };
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    // a fault of the plan is told before a model is read for it
    let file = read(path)?;
    let sweep =
        args.sweep.as_deref().map(|place| Ok::<_, BuildError>((sweep::read(place, &file)?, place))).transpose()?;
    let loaded = model_file::load_which(model, &args.which)?;
    let (samples, mut notices) = if args.samples > 0 { bands::of(&loaded)? } else { (None, vec![]) };
    let has_none = samples.as_ref().is_some_and(Samples::is_empty);
    notices.extend(has_none.then(|| Kind::NoIntervals.notice(NO_SAMPLES)));
    let samples = samples.filter(|s| !s.is_empty());
    notices.extend(model_file::left_out(&loaded.spec, "plan"));
    notices.extend(beyond::calibration(&loaded.spec, knee::tests(&file.tests).iter().map(|a| &a.trial)));
    let which = samples.as_ref().map(|s| (s, chosen(s, args)));
    if let Some((sweep, place)) = &sweep {
        let only = which.as_ref().map(|(s, w)| s.only(w));
        return sweep::swept(args, (sweep, place), (&file, &loaded), (only, notices));
    }
    let asked = which.as_ref().map(|(s, w)| (*s, w.as_slice()));
    let name = path.display().to_string();
    let fault = |what: String| BuildError::At { place: Place::of(path), told: format!("{name}: {what}") };
    let mut out = outcome::outcome_of(&loaded.spec, &loaded.meshes, &file, asked).map_err(fault)?;
    notices.append(&mut out.notices);
    (out.warnings, out.notices, out.model) = (notices::texts(&notices), notices, Some(ModelTold::of(&loaded)));
    let live = page::Live { part: live_of(&loaded, &file, samples.as_ref()), samples_asked: args.samples > 0 };
    let maps = if args.map { map::maps(&loaded.spec, &loaded.meshes, &file).map_err(fault)? } else { vec![] };
    let mut files = vec![
        ("plan.json".to_owned(), json(&out)),
        ("plan.csv".to_owned(), table::csv(&out).into_bytes()),
        ("plan.html".to_owned(), page::page(&out, &loaded.label(), (maps.as_slice(), &live)).into_bytes()),
    ];
    files.extend(args.map.then(|| ("map.csv".to_owned(), map::csv(&maps).into_bytes())));
    store::write_all(&args.out, &files)?;
    let beside = of_other_plans(&args.out, &files);
    Ok(told(&out, &loaded, args, beside))
}

/// Files that a plan or a sweep leaves.
const LEFT: [&str; 7] = ["plan.json", "plan.csv", "plan.html", "map.csv", "sweep.json", "sweep.csv", "sweep.html"];

/// What is said of a folder in which files of another plan lie beside those that were written.
fn of_other_plans(out: &Path, written: &[(String, Vec<u8>)]) -> Option<Notice> {
    let is_old = |name: &&&str| written.iter().all(|(own, _)| own != *name) && store::exists(&out.join(name));
    let old: Vec<&str> = LEFT.iter().filter(is_old).copied().collect();
    let text = format!(
        "{} in {} lies there from another plan; delete it, or give --out a new folder",
        old.join(", "),
        out.display()
    );
    (!old.is_empty()).then(|| Kind::OtherPlan.notice(text).count(old.len()))
}

/// The planned knee for the reader of the page; or why there is none.
fn live_of(loaded: &LoadedModel, file: &PlanFile, samples: Option<&Samples>) -> Result<LivePart, String> {
    let start = knee::begun(&loaded.spec, &loaded.meshes, file)?;
    live_part(&loaded.spec, &loaded.meshes, samples, Begin::Plan(&start))
        .ok_or_else(|| "a surface that the model names is not there as triangles".to_owned())
}

/// Numbers of the samples that are asked.
fn chosen(samples: &Samples, args: &PlanArgs) -> Vec<usize> {
    let mut all: Vec<usize> = (0..samples.len()).collect();
    if let Some(seed) = args.seed {
        // a shuffle by a digest of seed and number: the same on every machine
        all.sort_by_key(|n| *blake3::hash(&[seed.to_le_bytes(), (*n as u64).to_le_bytes()].concat()).as_bytes());
    }
    all.truncate(args.samples);
    all
}

/// What is told of a plan.
fn told(out: &Outcome, loaded: &LoadedModel, args: &PlanArgs, beside: Option<Notice>) -> Told {
    let mut words = loaded.line();
    words += &table::words(out);
    let map = if args.map { "map.csv, " } else { "" };
    words += &format!("{map}plan.json, plan.csv and plan.html in {}\n", args.out.display());
    let odd = out.notices.iter().cloned().chain(beside).collect();
    Told::words(words).odd(odd).with(out)
}

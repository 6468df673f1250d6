//! `calibrate`, and stage 10: ligament parameters from laxity data.

use crate::error::BuildError;
use crate::model_file::{self, LoadedModel};
use crate::options::{Override, parse_override, resolve};
use crate::progress::Searching;
use crate::record::json;
use crate::show::{Files, Reported};
use crate::store::{self, BuildFolder};
use calibration::calibrate::Checkpoint;
use calibration::cost::{CostFunction, CostOptions};
use calibration::knee::Knee;
use calibration::options::{CalibrateOptions, Method};
use calibration::reports;
use calibration::session::{Outcome, Session};
use calibration::unknowns::KnownFrames;
use clap::Args;
use serde::{Deserialize, Serialize};
use sim::laxity::{self, LaxityTrial};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use validation::figures::{figure5, figure6};
use validation::tables::cost_table;

/// The file in which an interrupted calibration is kept.
const CHECKPOINT: &str = "checkpoint.cbor";
/// A checkpoint is written no more often than this.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(1);

/// `build-model calibrate`.
#[derive(Args, Clone, Debug)]
pub struct CalibrateArgs {
    /// model.json, or the folder of a build
    pub model: PathBuf,
    /// Measured laxity (CSV). Given more than once, all data sets are met by one set of ligaments; NAME= names them in what is told
    #[arg(long, value_name = "[NAME=]LAXITY.csv", required = true, value_parser = named)]
    pub targets: Vec<(String, PathBuf)>,
    /// Folder for model.json, parameters.csv, history.csv and more
    #[arg(long)]
    pub out: PathBuf,
    /// gradient: the posterior of all that is not known, by the solver's derivatives; swarm-simplex: the paper's recipe; descent: its cost by derivatives [default: gradient]
    #[arg(long)]
    pub method: Option<MethodName>,
    /// Override an option; may be given more than once
    #[arg(long = "set", value_name = "calibrate.key=value", value_parser = parse_override)]
    pub overrides: Vec<Override>,
    /// Seed of whatever is random
    #[arg(long)]
    pub seed: Option<u64>,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
    /// Begin anew even if an interrupted calibration can be taken up
    #[arg(long)]
    pub force: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
}

/// A method's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum MethodName {
    /// The posterior of all that is not known, by the solver's derivatives
    Gradient,
    /// Particle swarm, then simplex
    SwarmSimplex,
    /// Descents on the recipe's cost, with the solver's derivatives
    Descent,
}

/// A data set: its name and its trials.
pub type Measured = (String, Vec<LaxityTrial>);

/// `NAME=FILE`, or a file called as it is.
fn named(text: &str) -> Result<(String, PathBuf), String> {
    let (name, file) = match text.split_once('=') {
        Some((name, file)) if !name.is_empty() && !name.contains(['/', '.']) => (name.to_owned(), PathBuf::from(file)),
        _ => {
            let file = PathBuf::from(text);
            (file.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned()), file)
        }
    };
    if name == JOINT {
        return Err(format!("{JOINT} is the name of all data sets together; give another"));
    }
    Ok((name, file))
}

/// Name of the calibration to all data sets together.
pub const JOINT: &str = "joint";

/// Runs `calibrate`; gives the words to print.
pub fn calibrate(args: &CalibrateArgs) -> Result<String, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    let mut options = resolve(&BTreeMap::new(), &args.overrides, args.seed)?.calibrate;
    match args.method {
        Some(MethodName::Gradient) => options.method = Method::Gradient,
        Some(MethodName::SwarmSimplex) => options.method = Method::SwarmSimplex,
        Some(MethodName::Descent) => options.method = Method::Descent,
        None => {}
    }
    let model = model_file::load(&args.model)?;
    let (mut sources, mut text) = (Vec::new(), String::new());
    for (name, file) in &args.targets {
        let (trials, more) = read_laxity(&file.display().to_string(), &store::read(file)?)?;
        text += &more;
        if sources.iter().any(|s: &Measured| s.0 == *name) {
            return Err(BuildError::File(format!("--targets {name}=...: given twice; name each data set otherwise")));
        }
        sources.push((name.clone(), without_components(&model, name, trials, &mut text)?));
    }
    let out = store::make_folder(&args.out)?;
    let kept = out.join(CHECKPOINT);
    if args.force {
        store::discard(&kept);
    }
    let saved = if store::exists(&kept) { Some(store::read(&kept)?) } else { None };
    let what = args.targets.iter().map(|t| t.1.display().to_string()).collect::<Vec<_>>().join(", ");
    let mut keep = |bytes: &[u8]| store::write(&kept, bytes);
    let bar = Searching::new(args.quiet, &what);
    let tell = |share: f64, words: &str| bar.show(share, words);
    let outcome = run((&model, None), &sources, &options, &what, Watch { saved, keep: &mut keep, tell: &tell })?;
    drop(bar);
    let spec = model_file::moved(&outcome.spec, &model.folder, &out);
    let mut files =
        vec![("model.json".to_owned(), json(&spec)), ("metrics.json".to_owned(), json(&reports::metrics(&outcome)))];
    files.extend(files_of(&outcome, &options.cost));
    store::write_all(&out, &files)?;
    store::discard(&kept);
    if args.quiet {
        return Ok(String::new());
    }
    if args.json {
        return Ok(String::from_utf8_lossy(&json(&reports::metrics(&outcome))).into_owned());
    }
    text.extend(outcome.warnings.iter().map(|w| format!("warning: {w}\n")));
    Ok(text + &reports::words(&outcome) + &format!("The model is {}\n", out.join("model.json").display()))
}

/// The targets with what the model's components do to them taken off; the data set is called as its file.
fn without_components(
    model: &LoadedModel,
    name: &str,
    trials: Vec<LaxityTrial>,
    text: &mut String,
) -> Result<Vec<LaxityTrial>, BuildError> {
    if model.spec.components.is_empty() {
        return Ok(trials);
    }
    let name = Some(name);
    *text += &model_file::taken_in(&model.spec, name)?;
    let fault = |e: &dyn std::fmt::Display| BuildError::File(format!("{}: {e}", model.folder.display()));
    let knee = sim::compile(&model.spec, &model.meshes).map_err(|e| fault(&e))?;
    diagnosis::predict::taken_off(&knee, &model.spec, name, &trials).map_err(|e| fault(&e))
}

/// Reads measured laxity; the warnings as lines.
pub fn read_laxity(name: &str, bytes: &[u8]) -> Result<(Vec<LaxityTrial>, String), BuildError> {
    let table = laxity::read(bytes).map_err(|e| BuildError::File(format!("{name}: {e}")))?;
    let text = table.warnings.iter().map(|w| format!("warning: {name}: {w}\n")).collect();
    Ok((table.trials, text))
}

/// Where a calibration is taken up from and kept, and who sees it.
pub struct Watch<'a> {
    /// An interrupted one.
    pub saved: Option<Vec<u8>>,
    /// Keeps it.
    pub keep: &'a mut dyn FnMut(&[u8]) -> Result<(), BuildError>,
    /// Told the share of the work done, 0 to 1, and what is going on.
    pub tell: &'a dyn Fn(f64, &str),
}

/// Calibrates a model to data sets, in frames that are known where they are; `what` names them.
pub fn run(
    (model, frames): (&LoadedModel, Option<&KnownFrames>),
    sources: &[Measured],
    options: &CalibrateOptions,
    what: &str,
    watch: Watch,
) -> Result<Outcome, BuildError> {
    let fault = |e: calibration::CalibrationError| BuildError::File(format!("{what}: {e}"));
    let mut session = Session::new(&model.spec, &model_file::digest(model), sources, options).map_err(fault)?;
    if let Some(frames) = frames {
        session = session.in_frames(frames.clone());
    }
    let checkpoint = session.begin(watch.saved.as_deref()).map_err(fault)?;
    let knee = Knee::new(model.spec.clone(), &model.meshes, &options.search)
        .map_err(|e| BuildError::File(format!("{}: {e}", model.folder.display())))?;
    let (mut last, mut failed) = (Instant::now(), None);
    let mut see = |c: &Checkpoint| {
        let p = c.progress();
        (watch.tell)(p.share, &format!("{}, best cost {:.1}", p.phase, p.lowest_cost));
        if last.elapsed() > CHECKPOINT_EVERY {
            last = Instant::now();
            if let Err(e) = (watch.keep)(&c.to_bytes()) {
                failed = Some(e);
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    };
    let outcome = session.run(&knee, checkpoint, &mut see);
    match (failed, outcome) {
        (Some(e), _) => Err(e),
        (None, outcome) => outcome.map_err(fault),
    }
}

/// The calibrated models of a build, by source.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// In the order of their names.
    pub sources: BTreeMap<String, Outcome>,
    /// All data sets with one set of ligaments, where there are several and the method can.
    pub joint: Option<Outcome>,
    /// The options of the cost.
    pub options: CalibrateOptions,
    /// What is odd but not fatal.
    pub warnings: Vec<String>,
    /// For metrics.json.
    pub metrics: serde_json::Value,
}

impl Reported for Calibration {
    fn metrics(&self) -> serde_json::Value {
        self.metrics.clone()
    }
    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

impl Calibration {
    /// Every calibration by its folder's name, the joint one last.
    pub fn all(&self) -> impl Iterator<Item = (&str, &Outcome)> {
        self.sources.iter().map(|(n, o)| (n.as_str(), o)).chain(self.joint.iter().map(|o| (JOINT, o)))
    }
}

/// Stage 10: a calibrated model for all data sets together, then for each in the frames found so; interrupted ones are kept in `folder`, `tell` hears
/// how far it is.
pub fn calibrate_all(
    model: &LoadedModel,
    laxity: &BTreeMap<String, Vec<LaxityTrial>>,
    options: &CalibrateOptions,
    folder: &BuildFolder,
    tell: &dyn Fn(&str),
) -> Result<Calibration, BuildError> {
    let every: Vec<Measured> = laxity.iter().map(|(n, t)| (n.clone(), t.clone())).collect();
    let one = |sources: &[Measured], name: &str, frames: Option<&KnownFrames>| -> Result<Outcome, BuildError> {
        let file = format!(".calibrate-{name}.cbor");
        // one of another calibration is no use here: stages are keyed
        let saved = folder.read_file(&file).filter(|bytes| {
            let session = Session::new(&model.spec, &model_file::digest(model), sources, options);
            session.is_ok_and(|s| s.begin(Some(bytes)).is_ok())
        });
        let mut keep = |bytes: &[u8]| folder.write_file(&file, bytes);
        let begun = Instant::now();
        let tell = |share: f64, words: &str| {
            let left = begun.elapsed().as_secs_f64() * (1.0 / share.max(1e-3) - 1.0);
            let left = if share > 0.02 { format!(", about {left:.0} s left") } else { String::new() };
            tell(&format!("calibrate {name}: {:.0} %, {words}{left}", 100.0 * share));
        };
        let watch = Watch { saved, keep: &mut keep, tell: &tell };
        let outcome = run((model, frames), sources, options, &format!("laxity.{name}"), watch)?;
        store::discard(&folder.path().join(&file));
        Ok(outcome)
    };
    let together = every.len() > 1 && options.method == Method::Gradient;
    let joint = if together { Some(one(&every, JOINT, None)?) } else { None };
    let mut sources = BTreeMap::new();
    for (s, measured) in every.iter().enumerate() {
        let frames = joint.as_ref().and_then(|j| j.frames.get(s));
        sources.insert(measured.0.clone(), one(std::slice::from_ref(measured), &measured.0, frames)?);
    }
    let mut out =
        Calibration { sources, joint, options: options.clone(), warnings: vec![], metrics: serde_json::Value::Null };
    let told = |(name, o): (&str, &Outcome)| o.warnings.iter().map(|w| format!("{name}: {w}")).collect::<Vec<_>>();
    out.warnings = out.all().flat_map(told).collect();
    let metrics: serde_json::Map<_, _> = out.all().map(|(name, o)| (name.to_owned(), reports::metrics(o))).collect();
    out.metrics = metrics.into();
    Ok(out)
}

/// Tables of a calibration, what its cost is made of, and figures 5 and 6 for its targets.
fn files_of(outcome: &Outcome, cost: &CostOptions) -> Vec<(String, Vec<u8>)> {
    let figure5 = figure5(&[("targets".to_owned(), outcome.trials.clone())]);
    let mut texts = vec![("figure5.svg", figure5)];
    if let Ok(c) = CostFunction::new(&outcome.trials, &outcome.spec.frames.gs_ct_pose, cost) {
        texts.push(("figure6.svg", figure6("calibrated", &c, &outcome.found.predicted)));
        texts.push(("cost.csv", cost_table(&c, &outcome.found.predicted).csv()));
    }
    let mut files = reports::files(outcome);
    files.extend(texts.into_iter().map(|(name, text)| (name.to_owned(), text.into_bytes())));
    files
}

/// 10-calibrate: a folder a source.
pub fn show(c: &Calibration) -> Files {
    let mut files = Vec::new();
    for (name, outcome) in c.all() {
        let spec = model_file::moved(&outcome.spec, Path::new("/09-assemble"), &Path::new("/10-calibrate").join(name));
        files.push((format!("{name}/model.json"), json(&spec)));
        files.extend(files_of(outcome, &c.options.cost).into_iter().map(|(f, bytes)| (format!("{name}/{f}"), bytes)));
    }
    Ok(files)
}

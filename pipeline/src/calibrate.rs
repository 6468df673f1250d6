//! `calibrate`: ligament parameters from laxity data.

use crate::cohort::shared;
use crate::error::{BuildError, Place};
use crate::interrupted;
use crate::model_file::{self, LoadedModel};
use crate::options::{Override, only, parse_override, resolve};
use crate::progress::Searching;
use crate::record::{hash, json};
use crate::store;
use crate::told::{CalibrateTold, ModelTold, Told, schemas};
use crate::which_model::{JOINT, WhichModel};
use calibration::calibrate::Checkpoint;
use calibration::cost::{CostFunction, CostOptions};
use calibration::knee::Knee;
use calibration::options::{CalibrateOptions, Method};
use calibration::reports;
use calibration::samples::{SCHEMA, Samples};
use calibration::session::{Joint, Outcome, Session};
use calibration::shared::called;
use clap::Args;
use notices::{Kind, Notice};
use sim::laxity::{self, LaxityTrial};
use sim::spec::{CalibratedSpec, ModelSpec, ReachSpec};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
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
    /// model.json, or the folder of a build or specimen: then its joint calibrated model, else that of its one data set, else the assembled one
    pub model: PathBuf,
    /// Which model of a build
    #[command(flatten)]
    pub which: WhichModel,
    /// Measured laxity (CSV). Given more than once, all data sets are met by one set of ligaments; NAME= names them in what is told
    #[arg(long, value_name = "[NAME=]LAXITY.csv", required = true, value_parser = named)]
    pub targets: Vec<(String, PathBuf)>,
    /// Folder for model.json, parameters.csv, history.csv and more
    #[arg(long)]
    pub out: PathBuf,
    /// posterior: of all that is not known, by the solver's derivatives; swarm-simplex: the paper's recipe [default: posterior]
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
    pub anew: bool,
    /// Print nothing but errors
    #[arg(short, long)]
    pub quiet: bool,
}

/// A method's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum MethodName {
    /// The posterior of all that is not known, by the solver's derivatives
    #[value(alias = "gradient")]
    Posterior,
    /// Particle swarm, then simplex
    SwarmSimplex,
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

/// Runs `calibrate`.
pub fn calibrate(args: &CalibrateArgs) -> Result<Told, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    only(&args.overrides, &["calibrate"])?;
    let mut options = resolve(&BTreeMap::new(), &args.overrides, args.seed)?.calibrate;
    match args.method {
        Some(MethodName::Posterior) => options.method = Method::Posterior,
        Some(MethodName::SwarmSimplex) => options.method = Method::SwarmSimplex,
        None => {}
    }
    let model = model_file::load_which(&args.model, &args.which)?;
    shared::read_in(&mut options, &called(&model.spec))?;
    let (mut sources, mut told) = (Vec::new(), Told { words: model.line(), ..Told::default() });
    if let Some(c) = &model.spec.calibrated {
        told.warnings.push(Kind::CalibratedAlready.notice(format!(
            "the model is calibrated to {} already, and its priors do not know that; to use the same data again, begin at the assembled model (--as-assembled)",
            c.to.join(", ")
        )));
    }
    for (name, file) in &args.targets {
        let (trials, more) = read_laxity(&file.display().to_string(), &store::read(file)?)?;
        told.warnings.extend(more);
        if sources.iter().any(|s: &Measured| s.0 == *name) {
            return Err(BuildError::File(format!("--targets {name}=...: given twice; name each data set otherwise")));
        }
        sources.push((name.clone(), without_components(&model, name, trials, &mut told.words)?));
    }
    let sets: Vec<laxity::Named> = sources.iter().map(|(name, trials)| (name.as_str(), trials.as_slice())).collect();
    if let Some(what) = crate::given::twice(&sets) {
        return Err(BuildError::File(format!("--targets: {what}")));
    }
    told.warnings.extend(laxity::between(&sets).into_iter().map(laxity::SignDoubt::notice));
    let out = store::make_folder(&args.out)?;
    let kept = out.join(CHECKPOINT);
    // one that is begun anew writes over the search that was kept, and not before it has something to keep
    let saved = if !args.anew && store::exists(&kept) { Some(store::read(&kept)?) } else { None };
    let what = args.targets.iter().map(|t| t.1.display().to_string()).collect::<Vec<_>>().join(", ");
    let mut keep = |bytes: &[u8]| store::write(&kept, bytes);
    let bar = Searching::new(args.quiet, &what);
    let place = kept.clone();
    let kept_word = interrupted::working(move || {
        store::exists(&place).then(|| format!("The search is kept in {}", place.display()))
    });
    let tell = |share: f64, words: &str| bar.show(share, words);
    let outcome = run((&model, None), &sources, &options, &what, Watch { saved, keep: &mut keep, tell: &tell })?;
    drop((bar, kept_word));
    let spec = model_file::moved(&outcome.spec, &model.folder, &out);
    let mut files =
        vec![("model.json".to_owned(), json(&spec)), ("metrics.json".to_owned(), json(&reports::metrics(&outcome)))];
    files.extend(files_of(&outcome, &options.cost));
    files.extend(samples_file(&outcome, &spec, &model_file::moved(&model.spec, &model.folder, &out)));
    store::write_all(&out, &files)?;
    store::discard(&kept);
    told.warnings.extend(outcome.warnings.iter().cloned());
    told.words += &reports::words(&outcome);
    told.words += &reports::outside_words(&outcome.found);
    if let Some(words) = shared::of_options(&options).as_ref().and_then(shared::sentence) {
        told.line(&words);
    }
    told.line(&format!("The model is {}", out.join("model.json").display()));
    let data = CalibrateTold {
        schema: schemas::CALIBRATE,
        model: ModelTold::of(&model),
        calibrated: out.join("model.json").display().to_string(),
        folder: out.display().to_string(),
        metrics: serde_json::to_value(reports::metrics(&outcome)).unwrap_or_default(),
        warnings: notices::texts(&told.warnings),
        notices: told.warnings.clone(),
    };
    Ok(told.with(&data))
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
    let fault = |e: &dyn std::fmt::Display| BuildError::in_file(&model.folder, e);
    let knee = sim::compile(&model.spec, &model.meshes).map_err(|e| fault(&e))?;
    diagnosis::report::predict::taken_off(&knee, &model.spec, name, &trials).map_err(|e| fault(&e))
}

/// Reads measured laxity, and what is odd of it.
pub fn read_laxity(name: &str, bytes: &[u8]) -> Result<(Vec<LaxityTrial>, Vec<Notice>), BuildError> {
    let table = laxity::read(bytes).map_err(|e| BuildError::at(Place::in_laxity(name, &e), format!("{name}: {e}")))?;
    let doubts: Vec<Notice> = laxity::sign_doubts(&table.trials).into_iter().map(laxity::SignDoubt::notice).collect();
    let (trials, told) = crate::thin::thinned(table.trials);
    let all = table.warnings.iter().chain(&doubts).chain(&told);
    let odd = all.map(|w| w.clone().in_file(name)).collect();
    Ok((trials, odd))
}

/// Where a calibration is taken up from and kept, and who sees it.
pub struct Watch<'a> {
    /// An interrupted one.
    pub saved: Option<Vec<u8>>,
    /// Keeps it.
    pub keep: &'a mut dyn FnMut(&[u8]) -> Result<(), BuildError>,
    /// Told the share of the work done, 0 to 1, and what is going on.
    pub tell: &'a (dyn Fn(f64, &str) + Sync),
}

/// Calibrates a model to data sets, after all data sets together where `joint` is of them; `what` names them.
pub fn run(
    (model, joint): (&LoadedModel, Option<Joint>),
    sources: &[Measured],
    options: &CalibrateOptions,
    what: &str,
    watch: Watch,
) -> Result<Outcome, BuildError> {
    let fault = |e: calibration::CalibrationError| BuildError::File(format!("{what}: {e}"));
    let mut session = Session::new(&model.spec, &model_file::digest(model), sources, options).map_err(fault)?;
    if let Some(joint) = joint {
        session = session.after(joint);
    }
    let checkpoint = session.begin(watch.saved.as_deref()).map_err(fault)?;
    let knee = Knee::new(model.spec.clone(), &model.meshes, &options.search)
        .map_err(|e| BuildError::in_file(&model.folder, e))?;
    let (mut last, mut failed, tell) = (Instant::now(), None, watch.tell);
    let mut see = |c: &Checkpoint| {
        let p = c.progress();
        let best = if p.lowest_cost.is_finite() { format!(", best cost {:.1}", p.lowest_cost) } else { String::new() };
        tell(p.share, &format!("{}{best}", p.phase));
        if last.elapsed() > CHECKPOINT_EVERY {
            last = Instant::now();
            if let Err(e) = (watch.keep)(&c.to_bytes()) {
                failed = Some(e);
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    };
    let on_fit = |done: usize, of: usize| tell(done as f64 / of as f64, &format!("{done} of {of} fits"));
    let outcome = session.run_told(&knee, checkpoint, &mut see, &on_fit);
    if let Some(e) = failed {
        return Err(e);
    }
    let mut outcome = outcome.map_err(fault)?;
    let to = sources.iter().map(|s| s.0.clone()).collect();
    let reach = ReachSpec::of(sources.iter().flat_map(|s| &s.1));
    let shared_prior = shared::of_options(options);
    outcome.spec.calibrated = Some(CalibratedSpec { to, from: hash(&json(&model.spec)), reach, shared_prior });
    Ok(outcome)
}

/// samples.json of a calibration whose model is `spec`, counted from the model `from`; both name meshes as they do in the file's folder.
pub(crate) fn samples_file(outcome: &Outcome, spec: &ModelSpec, from: &ModelSpec) -> Option<(String, Vec<u8>)> {
    let mut bytes = serde_json::to_vec(&Samples { model: hash(&json(spec)), ..samples(outcome, from)? }).ok()?;
    bytes.push(b'\n');
    Some(("samples.json".to_owned(), bytes))
}

/// The samples of a calibration from the model `from`; none where a recipe was followed.
pub(crate) fn samples(outcome: &Outcome, from: &ModelSpec) -> Option<Samples> {
    let of = outcome.found.unknowns.clone();
    let (schema, model, counted_from) = (SCHEMA.to_owned(), hash(&json(&outcome.spec)), from.clone());
    (!of.unknowns.is_empty()).then_some(Samples { schema, model, counted_from, of })
}

/// Tables of a calibration, what its cost is made of, and figures 5 and 6 for its targets.
pub(crate) fn files_of(outcome: &Outcome, cost: &CostOptions) -> Vec<(String, Vec<u8>)> {
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

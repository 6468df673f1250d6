//! `simulate`: what a model answers to laxity trials or to a protocol.

use crate::bands::{self, Asking};
use crate::beyond;
use crate::error::{BuildError, Place};
use crate::model_file::{self, LoadedModel};
use crate::numbers::{between, count};
use crate::store;
use crate::told::{Flagged, ModelTold, SimulateTold, Told, schemas};
use crate::which_model::WhichModel;
use calibration::posterior::error_of_ends;
use calibration::samples::Samples;
use clap::Args;
use notices::{Kind, Notice};
use rayon::prelude::*;
use sim::Model;
use sim::explicit::{ExplicitOptions, TrialSteps, explicit_protocol, explicit_trial, unobserved};
use sim::flags::{Flag, sentences};
use sim::jumps::flag_jumps;
use sim::laxity::{self, LaxityTrial, TrialResult};
use sim::names::did_you_mean;
use sim::protocols::{self, COMPRESSION_N, Protocol, ProtocolOptions};
use sim::trials::{FLEXION_DEG, TrialOptions, cannot_be_put, solve_trials};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// `build-model simulate`.
#[derive(Args, Clone, Debug)]
#[command(group(clap::ArgGroup::new("what").required(true).args(["trials", "protocol"])))]
pub struct SimulateArgs {
    /// model.json, or the folder of a build or specimen: then its joint calibrated model, else that of its one data set, else the assembled one
    pub model: PathBuf,
    /// Which model of a build
    #[command(flatten)]
    pub which: WhichModel,
    /// Laxity trials (CSV); each is simulated. Of trials that are only loads a flexion is enough beside them
    #[arg(long, value_name = "LAXITY.csv")]
    pub trials: Option<PathBuf>,
    /// A validation protocol
    #[arg(long)]
    pub protocol: Option<ProtocolName>,
    /// Cut a bundle or a ligament ("ACL" is both its bundles); may be given more than once
    #[arg(long, value_name = "LIGAMENT", value_delimiter = ',')]
    pub without: Vec<String>,
    /// Predict what the apparatus of this data set would read: in its frames, with what diagnose added to it; otherwise what belongs to the knee alone
    #[arg(long, value_name = "NAME")]
    pub read_as: Option<String>,
    /// Where the predicted poses and ligament forces go
    #[arg(long, value_name = "RESULTS.csv")]
    pub out: PathBuf,
    /// How equilibrium is found
    #[arg(long, default_value = "quasistatic")]
    pub solver: Solver,
    /// Passive flexion ends here [deg]
    #[arg(long, value_name = "DEG", default_value_t = 90.0, value_parser = between([0.0, FLEXION_DEG[1]]))]
    pub to_flexion: f64,
    /// Joint compression in a protocol [N]
    #[arg(long, value_name = "N", default_value_t = 20.0, value_parser = between(COMPRESSION_N))]
    pub compression: f64,
    /// Samples of the posterior, where the model has any: mean and 90 % interval stand beside every value; 0: the one model alone
    #[arg(long, value_name = "N", default_value_t = SAMPLES, value_parser = count)]
    pub samples: usize,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

/// Share of the samples between the ends of an interval [-]; of every calibration, unless its options say otherwise.
const INTERVAL: f64 = 0.9;
/// Samples asked unless told; all that a calibration leaves.
pub(crate) const SAMPLES: usize = 48;

/// A protocol's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ProtocolName {
    /// 133 N forwards and backwards at 30, 60, 90 deg
    ApLaxity,
    /// No load but a small compression, 0 to 90 deg
    PassiveFlexion,
    /// 8 N m valgus with 4 N m internal at 30 deg
    PivotShift,
}

/// A solver's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Solver {
    /// Equilibrium along the path of loading
    Quasistatic,
    /// Explicit dynamics through the paper's steps, to rest at each row
    Explicit,
}

impl Solver {
    /// The solver.
    pub(crate) fn solver(self) -> protocols::Solver {
        match self {
            Solver::Quasistatic => protocols::Solver::Quasistatic,
            Solver::Explicit => protocols::Solver::Explicit,
        }
    }
}

/// A model that is ready to answer: read and compiled once, for any number of calls.
pub struct Compiled {
    loaded: LoadedModel,
    model: Model,
    /// Samples beside it, and what to say of them; read by the first call that asks for intervals.
    samples: OnceLock<(Option<Samples>, Vec<Notice>)>,
}

impl Compiled {
    /// The model that `path` means, and its surfaces.
    pub fn read(path: &Path, which: &WhichModel) -> Result<Compiled, BuildError> {
        let loaded = model_file::load_which(path, which)?;
        let fault = |e: sim::SimError| BuildError::at(Place::of(path), format!("{}: {e}", path.display()));
        let model = sim::compile(&loaded.spec, &loaded.meshes).map_err(fault)?;
        Ok(Compiled { loaded, model, samples: OnceLock::new() })
    }

    /// The model in the frames in which a data set reads poses, and the data set's place; `None` where its calibration found none of its own.
    fn read_by(&self, name: &str) -> Result<Option<(Model, usize)>, BuildError> {
        let (Some(samples), _) = self.samples()? else { return Ok(None) };
        let Some(source) = samples.of.source(name) else { return Ok(None) };
        let loaded = &self.loaded;
        let fault = |e: sim::SimError| BuildError::in_file(&loaded.file, e);
        let mut spec = loaded.spec.clone();
        spec.frames = samples.of.frames_of(source, &samples.counted_from.frames, spec.side).map_err(fault)?;
        Ok(Some((sim::compile(&spec, &loaded.meshes).map_err(fault)?, source)))
    }

    /// The samples beside the model.
    fn samples(&self) -> Result<&(Option<Samples>, Vec<Notice>), BuildError> {
        if let Some(known) = self.samples.get() {
            return Ok(known);
        }
        let read = bands::of(&self.loaded)?;
        Ok(self.samples.get_or_init(|| read))
    }
}

/// The results of a simulation as a CSV file, and what is told of them.
pub struct Answered {
    /// The file.
    pub csv: Vec<u8>,
    /// Words, warnings, data.
    pub told: Told,
}

/// Runs the trials or the protocol and writes the results.
pub fn simulate(args: &SimulateArgs) -> Result<Told, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    // a fault of the trials is told before a model is compiled for them
    let trials = args.trials.as_deref().map(read_trials).transpose()?;
    let compiled = Compiled::read(&args.model, &args.which)?;
    let mut answered = answers_to(&compiled, trials, args)?;
    store::write(&args.out, &answered.csv)?;
    answered.told.line(&format!("{} in {}", rows(&answered.told), args.out.display()));
    Ok(answered.told)
}

/// "12 rows".
fn rows(told: &Told) -> String {
    let n = told.data.as_ref().and_then(|d| d["rows"].as_u64()).unwrap_or(0);
    format!("{n} row{}", if n == 1 { "" } else { "s" })
}

/// What a compiled model answers; nothing is written.
pub fn answered(compiled: &Compiled, args: &SimulateArgs) -> Result<Answered, BuildError> {
    let trials = args.trials.as_deref().map(read_trials).transpose()?;
    answers_to(compiled, trials, args)
}

fn answers_to(
    compiled: &Compiled,
    trials: Option<(Vec<LaxityTrial>, Vec<Notice>)>,
    args: &SimulateArgs,
) -> Result<Answered, BuildError> {
    let (trials, mut warnings) = trials.unwrap_or_default();
    let loaded = &compiled.loaded;
    known_data_set(loaded, args.read_as.as_deref())?;
    let mut words = loaded.line() + &model_file::taken_in(&loaded.spec, args.read_as.as_deref())?;
    let fault = |e: &dyn std::fmt::Display| {
        let file = &loaded.file;
        BuildError::at(Place::of(file), format!("{}: {e}", file.display()))
    };
    let read = match &args.read_as {
        Some(name) => compiled.read_by(name)?,
        None => None,
    };
    let (base, source) = read.as_ref().map_or((&compiled.model, None), |(model, source)| (model, Some(*source)));
    if source.is_some() {
        words += &format!("poses in the frames of {}\n", args.read_as.as_deref().unwrap_or_default());
    } else if let (Some(calibrated), true) = (&loaded.spec.calibrated, args.trials.is_some()) {
        words += &format!(
            "poses in the knee's own frames; --read-as {} gives them as that data set reads them\n",
            calibrated.to.join(" or ")
        );
    }
    let cut = if args.without.is_empty() {
        None
    } else {
        Some(base.without(&args.without).map_err(|e| BuildError::Usage(format!("--without: {e}")))?)
    };
    let model = cut.as_ref().unwrap_or(base);
    is_asked_of(base, &trials, args)?;
    let names = model.bundle_names();
    let ((mut results, lost), why) = match args.protocol {
        Some(protocol) => {
            let (rows, why) = run_protocol(model, protocol, args).map_err(|e| fault(&e))?;
            ((rows, vec![]), why)
        }
        None => (answers(model, &trials, args.solver).map_err(|e| fault(&e))?, None),
    };
    warnings.extend(beyond::calibration(&loaded.spec, results.iter().map(|r| &r.trial)));
    diagnosis::report::predict::apply(model, &loaded.spec, args.read_as.as_deref(), &mut results)
        .map_err(|e| fault(&e))?;
    let pivot = args.protocol == Some(ProtocolName::PivotShift);
    let asking = Asking {
        bundles: &names,
        without: &args.without,
        source,
        most: args.samples,
        dislocation_ap_mm: pivot.then_some(ProtocolOptions::default().pivot_dislocation_ap_mm),
    };
    let by = banded(compiled, &mut results, &asking, (&mut words, &mut warnings))?;
    warnings.extend(with_lost(&mut results, (lost.as_slice(), why.as_ref()), (trials.as_slice(), names.len())));
    // a table that says what was cut says all of it
    for without in results.iter_mut().map(|r| &mut r.trial.without).filter(|own| !own.is_empty()) {
        without.extend(args.without.iter().cloned());
        without.sort();
        without.dedup();
    }
    let csv = match args.protocol {
        Some(_) => laxity::protocol_csv(&names, &results),
        None => laxity::results_csv(&names, &results),
    };
    let csv = of_model(&csv, &loaded.label())?;
    let told = told(loaded, &results, (&csv, args), by, (words, warnings));
    Ok(Answered { csv, told })
}

/// Refuses the first trial that asks for what the model does not have.
fn is_asked_of(model: &Model, trials: &[LaxityTrial], args: &SimulateArgs) -> Result<(), BuildError> {
    let file = args.trials.as_deref().unwrap_or(Path::new(""));
    let fault = |what: String| Err(BuildError::of_file(file, format!("{}: {what}", file.display())));
    cannot_be_put(model, trials).map_or(Ok(()), fault)
}

/// Refuses to read as a data set that the model does not know: it knows those it is calibrated to, and those whose effects were added to it.
fn known_data_set(loaded: &LoadedModel, name: Option<&str>) -> Result<(), BuildError> {
    let Some(name) = name else { return Ok(()) };
    let spec = &loaded.spec;
    let scopes = spec.components.iter().filter_map(|c| c["scope"].as_str()).filter(|s| *s != BOTH);
    let diagnosed = spec.components.iter().filter_map(|c| c["provenance"]["data"].as_object());
    let mut known: BTreeSet<&str> = scopes.chain(diagnosed.flat_map(|data| data.keys().map(String::as_str))).collect();
    known.extend(spec.calibrated.iter().flat_map(|c| c.to.iter().map(String::as_str)));
    if known.contains(name) {
        return Ok(());
    }
    let file = loaded.file.display();
    Err(BuildError::Usage(match known.is_empty() {
        true => {
            format!("--read-as {name}: {file} knows no data set; it is not calibrated, and nothing was added to it")
        }
        false => {
            let near = did_you_mean(name, known.iter().copied());
            let known: Vec<&str> = known.into_iter().collect();
            format!("--read-as {name}: no such data set{near}; {file} knows {}", known.join(", "))
        }
    }))
}

/// The scope of an effect that acts in every data set.
const BOTH: &str = "both";

/// Gives results their intervals where the model has samples; gives by how many, and how much of them an interval holds.
fn banded(
    compiled: &Compiled,
    results: &mut [TrialResult],
    asking: &Asking,
    (words, warnings): (&mut String, &mut Vec<Notice>),
) -> Result<(usize, f64), BuildError> {
    bands::sum_up(results, asking.bundles);
    if asking.most == 0 {
        return Ok((0, INTERVAL));
    }
    let (samples, odd) = compiled.samples()?;
    warnings.extend(odd.iter().cloned());
    let Some(samples) = samples else { return Ok((0, INTERVAL)) };
    let banded = bands::by(samples, &compiled.loaded, results, asking);
    *words += &banded.words;
    warnings.extend(banded.warnings);
    Ok((banded.samples, samples.of.interval))
}

/// What is told of results.
fn told(
    loaded: &LoadedModel,
    results: &[TrialResult],
    (csv, args): (&[u8], &SimulateArgs),
    samples: (usize, f64),
    (words, mut warnings): (String, Vec<Notice>),
) -> Told {
    let header = String::from_utf8_lossy(csv.split(|b| *b == b'\n').next().unwrap_or_default()).into_owned();
    let odd = results.iter().filter(|r| !r.flags.is_empty());
    let flagged: Vec<Flagged> = odd.map(flagged_row).collect();
    for r in results {
        // that one knee is no middle of all is counted in the words; a few samples of another kind stand in the table
        let few = |f: &&Flag| matches!(f, Flag::SamplesDiffer { .. }) && !f.is_odd();
        // rows without equilibrium are told together
        let together = |f: &&Flag| **f == Flag::NoEquilibrium;
        let odd = sentences(r.flags.iter().filter(|f| !f.is_of_the_single_model() && !few(f) && !together(f)));
        warnings.extend((!odd.is_empty()).then(|| Kind::RowFlagged.notice(odd.join("; ")).whose(&r.trial.trial)));
    }
    let data = SimulateTold {
        schema: schemas::SIMULATE,
        model: ModelTold::of(loaded),
        file: args.out.display().to_string(),
        rows: results.len(),
        columns: header.split(',').map(str::to_owned).collect(),
        samples: samples.0,
        error_of_ends: error_of_ends(samples.0, samples.1),
        flagged,
        warnings: notices::texts(&warnings),
        notices: warnings.clone(),
    };
    Told::words(words).odd(warnings).with(&data)
}

fn flagged_row(r: &TrialResult) -> Flagged {
    Flagged { trial: r.trial.trial.clone(), flags: sentences(&r.flags), odd: r.flags.iter().any(Flag::is_odd) }
}

/// A results file with further columns: their names, and a cell a row.
pub(crate) fn with_columns(csv: &str, more: &[(String, Vec<String>)]) -> Result<String, BuildError> {
    let fault = |e: csv::Error| BuildError::File(format!("results: {e}"));
    let mut out = csv::WriterBuilder::new().terminator(csv::Terminator::Any(b'\n')).from_writer(Vec::new());
    let mut rows = csv::ReaderBuilder::new().has_headers(false).from_reader(csv.as_bytes());
    for (k, row) in rows.records().enumerate() {
        let mut row = row.map_err(fault)?;
        for (name, cells) in more {
            row.push_field(k.checked_sub(1).map_or(name, |k| cells.get(k).map_or("", String::as_str)));
        }
        out.write_record(&row).map_err(fault)?;
    }
    let bytes = out.into_inner().map_err(|e| BuildError::File(format!("results: {e}")))?;
    String::from_utf8(bytes).map_err(|e| BuildError::File(format!("results: {e}")))
}

/// A results file with a last column that names the model.
pub(crate) fn of_model(csv: &str, label: &str) -> Result<Vec<u8>, BuildError> {
    let rows = csv.lines().count().saturating_sub(1);
    Ok(with_columns(csv, &[("model".to_owned(), vec![label.to_owned(); rows])])?.into_bytes())
}

/// The answers to the trials that have an equilibrium, and the places of those that have none.
///
/// Errors: a trial at fault; no equilibrium in any.
fn answers(
    model: &Model,
    trials: &[LaxityTrial],
    solver: Solver,
) -> Result<(Vec<TrialResult>, Vec<usize>), sim::SimError> {
    let each: Vec<Result<TrialResult, sim::SimError>> = match solver {
        Solver::Quasistatic => {
            let answers = solve_trials(model, trials, &TrialOptions::default());
            answers.into_iter().zip(trials).map(|(answer, t)| answer.map(|a| a.result(t))).collect()
        }
        Solver::Explicit => {
            let (steps, options) = (TrialSteps::default(), ExplicitOptions::default());
            let each = trials.par_iter().map(|t| explicit_trial(model, t, &steps, &options, &mut unobserved));
            each.collect()
        }
    };
    let (mut found, mut lost, mut why) = (vec![], vec![], None);
    for (k, answer) in each.into_iter().enumerate() {
        match answer {
            Ok(result) => found.push(result),
            Err(e @ sim::SimError::Solver(_)) => {
                lost.push(k);
                why = why.or(Some(e));
            }
            // what was asked is at fault
            Err(e) => return Err(e),
        }
    }
    flag_jumps(&mut found);
    match why {
        Some(e) if found.is_empty() => Err(e),
        _ => Ok((found, lost)),
    }
}

/// Puts the rows of trials without equilibrium in their places, and tells of them; `why`: what ended the first path of explicit dynamics that was lost.
fn with_lost(
    results: &mut Vec<TrialResult>,
    (lost, why): (&[usize], Option<&sim::SimError>),
    (trials, bundles): (&[LaxityTrial], usize),
) -> Option<Notice> {
    for k in lost {
        results.insert(*k, TrialResult::without_equilibrium(&trials[*k], bundles));
    }
    let is_lost = |r: &TrialResult| r.flags.contains(&Flag::NoEquilibrium);
    let names: Vec<String> = results.iter().filter(|r| is_lost(r)).map(|r| r.trial.trial.clone()).collect();
    let counts_from = |r: &TrialResult| r.trial.reference.as_ref().is_some_and(|from| names.contains(&from.trial));
    for r in results.iter_mut().filter(|r| !is_lost(r) && counts_from(r)) {
        r.flags.push(Flag::Unloaded(Box::new(Flag::NoEquilibrium)));
    }
    let (n, have) = (names.len(), if names.len() == 1 { "has" } else { "have" });
    let what = if trials.is_empty() { "steps" } else { "trials" };
    let why = why.map_or(String::new(), |e| {
        format!(". Explicit dynamics lost the motion ({e}); later steps of such a path were not tried")
    });
    let text = format!(
        "{n} of {} {what} {have} no equilibrium, and no answer in the results: {}{why}",
        results.len(),
        names.join(", ")
    );
    (n > 0).then(|| Kind::RowFlagged.notice(text).count(n))
}

/// The rows of a protocol, and why the first without an answer has none, where explicit dynamics were asked.
fn run_protocol(
    model: &Model,
    protocol: ProtocolName,
    args: &SimulateArgs,
) -> Result<(Vec<TrialResult>, Option<sim::SimError>), sim::SimError> {
    let options = ProtocolOptions {
        to_flexion_deg: args.to_flexion,
        compression_n: args.compression,
        ..ProtocolOptions::default()
    };
    let protocol = match protocol {
        ProtocolName::ApLaxity => Protocol::ApLaxity,
        ProtocolName::PassiveFlexion => Protocol::PassiveFlexion,
        ProtocolName::PivotShift => Protocol::PivotShift,
    };
    match args.solver {
        Solver::Quasistatic => Ok((protocols::run(model, protocol, &options)?, None)),
        Solver::Explicit => {
            explicit_protocol(model, protocol, &options, &TrialSteps::default(), &ExplicitOptions::default())
        }
    }
}

/// The trials of a file, and its warnings.
fn read_trials(path: &Path) -> Result<(Vec<LaxityTrial>, Vec<Notice>), BuildError> {
    let (bytes, name) = (store::read(path)?, path.display().to_string());
    let table =
        laxity::read_asked(&bytes).map_err(|e| BuildError::at(Place::in_laxity(&name, &e), format!("{name}: {e}")))?;
    Ok((table.trials, table.warnings.into_iter().map(|w| w.in_file(&name)).collect()))
}

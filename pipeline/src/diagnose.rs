//! `diagnose`: which effect a model lacks, judged by measured laxity.

use crate::bands;
use crate::calibrate::Watch;
use crate::cohort::shared;
use crate::diagnosis_files::{DIAGNOSIS, PAGE, as_json, files_of, of_cut_knees, prepared};
use crate::error::{BuildError, Place};
use crate::given;
use crate::model_file::{self, LoadedModel};
use crate::options::{BuildOptions, Override, deaf, only, parse_override, resolve};
use crate::record::hash;
use crate::report::diagnosis_page;
use crate::report::live::Begin;
use crate::report::live_model::live_part;
use crate::store;
use crate::suggested::command;
use crate::told::{ModelTold, Told, schemas};
use crate::which_model::WhichModel;
use calibration::options::{CalibrateOptions, Method};
use clap::Args;
use diagnosis::diagnosis::{Calibration, Diagnosis, Outcome, diagnose_beside};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::error::DiagnosisError;
use diagnosis::problem::trial::Source;
use diagnosis::report::component::Provenance;
use diagnosis::search::DiagnosisOptions;
use diagnosis::search::regret::{Hidden, Regret};
use notices::Notice;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use sim::Model;
use sim::laxity::Named;
use sim::names::{did_you_mean, is_of};
use sim::spec::CalibratedSpec;
use sim::trials::cannot_be_put;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `build-model diagnose`.
#[derive(Args, Clone, Debug)]
pub struct DiagnoseArgs {
    /// model.json, or the folder of a build or specimen: then its joint calibrated model, else that of its one data set, else the assembled one
    pub model: PathBuf,
    /// Which model of a build
    #[command(flatten)]
    pub which: WhichModel,
    /// A data set and its laxity trials; may be given more than once
    #[arg(long, value_name = "NAME=LAXITY.csv", required = true, value_parser = named_file)]
    pub measured: Vec<(String, PathBuf)>,
    /// What the same knee read before: whole, or before it was treated. Nothing is sought in it; may be given more than once
    #[arg(long, value_name = "NAME=LAXITY.csv", value_parser = named_file)]
    pub before: Vec<(String, PathBuf)>,
    /// Where diagnosis.json, report.html, components/ and model.json go
    #[arg(long)]
    pub out: PathBuf,
    /// Tell only what could be named with these trials; the measured poses are not looked at
    #[arg(long)]
    pub atlas: bool,
    /// Leave an effect out of the catalogue; may be given more than once
    #[arg(long, value_name = "EFFECT", value_delimiter = ',')]
    pub without_effect: Vec<String>,
    /// Override an option of the diagnosis, or of the knee's calibration (calibrate.key=value): a diagnosis shares its priors, frames, noise and contact. Of
    /// the calibration, what is not set is as in the build that the model lies in
    #[arg(long = "set", value_name = "diagnose.key=value", value_parser = parse_override)]
    pub overrides: Vec<Override>,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

/// `diagnose --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct DiagnoseTold {
    /// diagnose/1
    pub schema: &'static str,
    /// The model that was held against the trials.
    pub model: ModelTold,
    /// Where the files lie.
    pub folder: String,
    /// The page to look at.
    pub page: String,
    /// diagnosis.json, of the schema diagnosis/1; with `--atlas` atlas.json.
    pub result: Value,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// `kla=laxity/kla.csv`.
pub fn named_file(text: &str) -> Result<(String, PathBuf), String> {
    match text.split_once('=') {
        Some((name, path)) if !name.is_empty() && name != "both" && !path.is_empty() => {
            Ok((name.to_owned(), PathBuf::from(path)))
        }
        _ => Err("NAME=FILE was expected, such as kla=laxity/kla.csv".into()),
    }
}

/// Diagnoses and writes; gives the words to print.
pub fn run(args: &DiagnoseArgs) -> Result<Told, BuildError> {
    run_with(args, &options(&args.overrides)?)
}

/// [`run`] with options already read.
pub fn run_with(args: &DiagnoseArgs, options: &DiagnosisOptions) -> Result<Told, BuildError> {
    Ok(run_beside(args, options, &[])?.0)
}

/// [`run_with`] beside the truth, for benches: also how far the search stayed behind it, where there is one.
pub fn run_beside(
    args: &DiagnoseArgs,
    options: &DiagnosisOptions,
    truth: &[Hidden],
) -> Result<(Told, Option<Regret>), BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    let (mut sources, mut odd) = sources(&args.measured)?;
    let (first, more) = before(&args.before)?;
    odd.extend(more);
    let start_from = if first.is_empty() { sources.clone() } else { first.clone() };
    grown_again(&first, &sources)?;
    for s in first {
        if sources.iter().any(|other| other.name == s.name) {
            return Err(BuildError::Usage(format!(
                "--before makes a data set {}, which there is already; rename it",
                s.name
            )));
        }
        sources.push(s);
    }
    each_its_own(&sources)?;
    let loaded = model_file::load_which(&args.model, &args.which)?;
    let told = Told { models: vec![loaded.told()], ..Told::words(loaded.line()).odd(odd) };
    let tell = |words: String, page: &str, json: &[u8]| {
        let data = DiagnoseTold {
            schema: schemas::DIAGNOSE,
            model: ModelTold::of(&loaded),
            folder: args.out.display().to_string(),
            page: args.out.join(page).display().to_string(),
            result: serde_json::from_slice(json).unwrap_or_default(),
            warnings: told.warning_texts(),
            notices: told.warnings.clone(),
        };
        Told { words: told.words.clone() + &words, ..told.clone() }.with(&data)
    };
    let fault = |e: DiagnosisError| match e {
        DiagnosisError::Data(_) => BuildError::File(e.to_string()),
        e => BuildError::in_file(&args.model, e),
    };
    let calibrate = calibrate_options(args, &loaded)?;
    let model = prepared(&loaded, &calibrate).map_err(fault)?;
    fits_the_model(args, &model, &sources)?;
    let catalogue = catalogue(&args.without_effect)?;
    let provenance = provenance(args, &loaded, &catalogue)?;
    if args.atlas {
        calibrated_first(args, &loaded)?;
        let atlas =
            diagnosis::diagnosis::atlas::atlas(&model, &loaded.spec, &sources, &catalogue, (options, &calibrate))
                .map_err(fault)?;
        let json = as_json(&atlas)?;
        let page = diagnosis_page::atlas(&loaded.spec.id, &atlas);
        let files = [("atlas.json".to_owned(), json.clone()), ("atlas.html".to_owned(), page.into_bytes())];
        store::write_all(&args.out, &files)?;
        return Ok((tell(diagnosis::diagnosis::atlas::table(&atlas), "atlas.html", &json), None));
    }
    let start = start(&loaded, &start_from, options.seed, &calibrate)?;
    let calibration = Calibration { options: &calibrate, mode: start.as_ref() };
    let (mut outcome, regret) =
        diagnose_beside(&model, &loaded.spec, &sources, &catalogue, options, calibration, truth)
            .and_then(|(outcome, regret)| Ok((outcome.with_provenance(&provenance)?, regret)))
            .map_err(fault)?;
    for words in of_cut_knees(&sources) {
        outcome.diagnosis.plain += &format!("\n{words}");
    }
    if let Some(words) = of_others(&calibrate, loaded.spec.calibrated.as_ref()) {
        outcome.diagnosis.plain += &format!("\n{words}");
    }
    let json = write(args, &loaded, &outcome)?;
    Ok((tell(in_words(&outcome.diagnosis, &args.out.join(PAGE)), PAGE, &json), regret))
}

/// The sentence on other knees whose data are in the priors that a diagnosis takes, or in those that its model was calibrated with; none where no
/// knee's are.
fn of_others(calibrate: &CalibrateOptions, model: Option<&CalibratedSpec>) -> Option<String> {
    let of_model = || model?.shared_prior.clone();
    shared::sentence(&shared::of_options(calibrate).or_else(of_model)?)
}

/// What is told at the end: plain words, the numbers, the page.
fn in_words(d: &Diagnosis, page: &Path) -> String {
    format!("{}\n\n{}\nLook at {}\n", d.plain, d.description, page.display())
}

/// The command that calibrates the model to what was measured.
fn calibrating(args: &DiagnoseArgs, loaded: &LoadedModel) -> String {
    let mut words = vec![loaded.file.clone().into_os_string()];
    for (name, file) in &args.measured {
        words.extend(["--targets".into(), format!("{name}={}", file.display()).into()]);
    }
    words.extend(["--out".into(), args.out.join("calibrated").into_os_string()]);
    command("calibrate", words)
}

/// Refuses an atlas of a built knee whose ligaments nobody calibrated: what is slack or taut there says nothing of the knee.
fn calibrated_first(args: &DiagnoseArgs, loaded: &LoadedModel) -> Result<(), BuildError> {
    if loaded.spec.calibrated.is_some() || !diagnosis::problem::nuisance::is_built(&loaded.spec) {
        return Ok(());
    }
    Err(BuildError::of_file(
        &loaded.file,
        format!(
            "{}: its ligaments are not calibrated, so an atlas of it would tell of another knee; calibrate it first, to laxity of this knee: {}",
            loaded.file.display(),
            calibrating(args, loaded)
        ),
    ))
}

/// Options of the knee's calibration: those of the build that the model lies in, where it lies in one of this version, then what was set.
fn calibrate_options(args: &DiagnoseArgs, loaded: &LoadedModel) -> Result<CalibrateOptions, BuildError> {
    let mut given = BTreeMap::new();
    let run = loaded.folder.ancestors().take(DEPTH).map(|f| f.join("run.toml")).find(|f| store::exists(f));
    if let Some(file) = run {
        let table = store::read_text(&file)?.parse::<toml::Table>().unwrap_or_default();
        let of_build = table.get("options").cloned().filter(|o| o.clone().try_into::<BuildOptions>().is_ok());
        if let Some(toml::Value::Table(calibrate)) = of_build.and_then(|o| o.get("calibrate").cloned()) {
            given.insert("calibrate".to_owned(), calibrate);
        }
    }
    let mut options = resolve(&given, &args.overrides, None)?.calibrate;
    shared::read_in(&mut options, &calibration::shared::called(&loaded.spec))?;
    Ok(options)
}

/// Folders from that of a build's model up to the build's own: joint, 10-calibrate, the build [-].
const DEPTH: usize = 3;

/// Where a calibration of a built knee to all of the data ends; the diagnosis starts there. A deck starts from its own values.
fn start(
    loaded: &LoadedModel,
    sources: &[Source],
    seed: u64,
    calibrate: &CalibrateOptions,
) -> Result<Option<BTreeMap<String, f64>>, BuildError> {
    if !diagnosis::problem::nuisance::is_built(&loaded.spec) {
        return Ok(None);
    }
    let measured: Vec<_> = sources.iter().map(|s| (s.name.clone(), s.trials.clone())).collect();
    let mut options = calibrate.clone();
    options.method = Method::Posterior;
    // the most probable point alone is asked for
    options.inference.samples = 0;
    options.seed = seed;
    let watch = Watch { saved: None, keep: &mut |_| Ok(()), tell: &|_, _| () };
    let outcome = crate::calibrate::run((loaded, None), &measured, &options, "laxity", watch)?;
    Ok(Some(outcome.found.mode))
}

/// What an answer is found with.
fn provenance(args: &DiagnoseArgs, loaded: &LoadedModel, catalogue: &Catalogue) -> Result<Provenance, BuildError> {
    let digest = |(name, path): &(String, PathBuf)| Ok((name.clone(), hash(&store::read(path)?)));
    let first: Vec<_> = args.before.iter().map(|(name, path)| (format!("{name}{BEFORE}"), path.clone())).collect();
    Ok(Provenance {
        program: env!("CARGO_PKG_VERSION").into(),
        catalogue: catalogue.version.clone(),
        model: model_file::digest(loaded),
        data: args.measured.iter().chain(&first).map(digest).collect::<Result<_, BuildError>>()?,
    })
}

/// Ending of the name of a data set that was measured before.
const BEFORE: &str = "_before";

/// Refuses one file that is given as two data sets.
fn each_its_own(sources: &[Source]) -> Result<(), BuildError> {
    let sets: Vec<Named> = sources.iter().map(|s| (s.name.as_str(), &s.trials[..])).collect();
    given::twice(&sets).map_or(Ok(()), |what| Err(BuildError::Usage(what)))
}

/// Refuses trials of what the model does not have, and, but for an atlas, a data set without any reading; each by its file.
fn fits_the_model(args: &DiagnoseArgs, model: &Model, sources: &[Source]) -> Result<(), BuildError> {
    let files = args.measured.iter().chain(&args.before).map(|(_, path)| path);
    for (source, path) in sources.iter().zip(files) {
        let is_read = source.trials.iter().any(|t| t.measured.iter().any(Option::is_some));
        let empty = (!is_read && !args.atlas).then(|| {
            format!(
                "no row of {} has a reading, so it says nothing; expected poses, such as ap_mm, or leave it out",
                source.name
            )
        });
        if let Some(what) = cannot_be_put(model, &source.trials).or(empty) {
            return Err(BuildError::in_file(path, what));
        }
    }
    Ok(())
}

/// Refuses a knee that was less whole before than it is now: what was cut does not grow again.
fn grown_again(before: &[Source], now: &[Source]) -> Result<(), BuildError> {
    let of = |s: &Source| s.trials.first().map_or(vec![], |t| t.without.clone());
    let pairs = before.iter().flat_map(|b| now.iter().map(move |n| (b, n)));
    for (b, n) in pairs {
        let now_cut = of(n);
        if let Some(whole) = of(b).iter().find(|name| !now_cut.iter().any(|cut| is_of(name, cut))) {
            return Err(BuildError::Usage(format!(
                "--before {}: its knee was without {whole} (column without), and that of --measured {} has it; are they exchanged?",
                b.name.trim_end_matches(BEFORE),
                n.name
            )));
        }
    }
    Ok(())
}

/// Reads the data sets that were measured before; each has a name of its own beside what was measured since.
fn before(measured: &[(String, PathBuf)]) -> Result<(Vec<Source>, Vec<Notice>), BuildError> {
    let (read, odd) = sources(measured)?;
    Ok((read.into_iter().map(|s| Source::before(s.name + BEFORE, s.trials)).collect(), odd))
}

/// Reads the data sets; names must differ.
pub fn sources(measured: &[(String, PathBuf)]) -> Result<(Vec<Source>, Vec<Notice>), BuildError> {
    let (mut sources, mut odd) = (Vec::<Source>::new(), Vec::new());
    for (name, path) in measured {
        if sources.iter().any(|s| s.name == *name) {
            return Err(BuildError::Usage(format!("{name} is given twice; names of data sets must differ")));
        }
        let table = sim::laxity::read(&store::read(path)?).map_err(|e| {
            let file = path.display().to_string();
            BuildError::at(Place::in_laxity(&file, &e), format!("{file}: {e}"))
        })?;
        odd.extend(given::told(&path.display().to_string(), &table));
        sources.push(Source::new(name, table.trials));
    }
    Ok((sources, odd))
}

fn catalogue(without: &[String]) -> Result<Catalogue, BuildError> {
    let catalogue = Catalogue::shipped();
    for name in without {
        if !catalogue.effect.iter().any(|e| e.id == *name) {
            let known: Vec<&str> = catalogue.effect.iter().map(|e| e.id.as_str()).collect();
            return Err(BuildError::Usage(format!(
                "--without-effect {name}: no such effect{}; the catalogue has {}",
                did_you_mean(name, known.iter().copied()),
                known.join(", ")
            )));
        }
    }
    let names: Vec<&str> = without.iter().map(String::as_str).collect();
    Ok(catalogue.without(&names))
}

/// Options of the diagnosis: the usual ones, then what was set.
pub fn options(overrides: &[Override]) -> Result<DiagnosisOptions, BuildError> {
    only(overrides, &["diagnose", "calibrate"])?;
    deaf(overrides, "diagnose", "run", "this command always runs; in a build it says whether stage 12 does")?;
    Ok(resolve(&BTreeMap::new(), overrides, None)?.diagnose)
}

/// Writes all files; gives diagnosis.json.
fn write(args: &DiagnoseArgs, loaded: &LoadedModel, outcome: &Outcome) -> Result<Vec<u8>, BuildError> {
    let out = store::make_folder(&args.out)?;
    let added = outcome.model.as_ref().filter(|_| !outcome.components.is_empty());
    let spec = added.unwrap_or(&loaded.spec);
    // the samples are of the knee before anything was added
    let samples = if added.is_none() { bands::of(loaded)?.0 } else { None };
    let begin = Begin::Diagnosed { added: added.is_some() };
    let live = live_part(spec, &loaded.meshes, samples.as_ref(), begin);
    let moved = model_file::moved(spec, &loaded.folder, &out);
    let files = files_of(&outcome.diagnosis, &outcome.components, &moved, live.as_ref())?;
    store::write_all(&out, &files)?;
    Ok(files.into_iter().find(|(name, _)| name == DIAGNOSIS).map(|(_, bytes)| bytes).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibration::shared::{SCHEMA, Shared, SharedNumber, SharedPrior};
    use sim::spec::SharedPriorSpec;

    #[test]
    fn other_knees_are_named_where_they_gave_the_priors_of_the_diagnosis_or_of_its_model() {
        let number =
            SharedNumber { name: "LCL.k".into(), mean: 0.5, sd: 0.8, before: [0.0, 1.0, 2.0], after: [0.7, 1.5, 2.3] };
        let (schema, from, numbers) = (SCHEMA.to_owned(), vec!["B left".to_owned()], vec![number]);
        let shared = Shared { schema, knee: None, from, file: Some("b.json".into()), numbers };
        let usual = CalibrateOptions::default();
        let with = CalibrateOptions { shared_prior: Some(SharedPrior::Read(Box::new(shared))), ..usual.clone() };
        let alone = CalibratedSpec { to: vec!["kla".into()], from: String::new(), reach: None, shared_prior: None };
        let prior = SharedPriorSpec {
            file: Some("c.json".into()),
            digest: String::new(),
            from: vec!["C left".into()],
            numbers: 2,
        };
        let of_c = CalibratedSpec { shared_prior: Some(prior), ..alone.clone() };
        for (options, model, named) in [
            (&usual, None, None),
            (&usual, Some(&alone), None),
            (&usual, Some(&of_c), Some("(c.json: C left)")),
            (&with, Some(&alone), Some("(b.json: B left)")),
            // what the diagnosis itself takes counts
            (&with, Some(&of_c), Some("(b.json: B left)")),
        ] {
            let words = of_others(options, model);
            assert_eq!(words.is_some(), named.is_some(), "{words:?}");
            assert!(named.is_none_or(|named| words.is_some_and(|w| w.contains(named))), "{named:?}");
        }
    }
}

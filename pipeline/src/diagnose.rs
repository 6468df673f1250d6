//! `diagnose`: which effect a model lacks, judged by measured laxity.

use crate::error::BuildError;
use crate::run_log::hash;
use crate::{model_file, store};
use clap::Args;
use diagnosis::catalogue::Catalogue;
use diagnosis::component::Provenance;
use diagnosis::diagnosis::{Outcome, diagnose};
use diagnosis::search::DiagnosisOptions;
use diagnosis::trial::Source;
use std::path::{Path, PathBuf};

/// `build-model diagnose`.
#[derive(Args, Clone, Debug)]
pub struct DiagnoseArgs {
    /// model.json, or the folder of a build
    pub model: PathBuf,
    /// A data set and its laxity trials; may be given more than once
    #[arg(long, value_name = "NAME=LAXITY.csv", required = true, value_parser = named_file)]
    pub measured: Vec<(String, PathBuf)>,
    /// Where diagnosis.json, report.html, components/ and model.json go
    #[arg(long)]
    pub out: PathBuf,
    /// Tell only what could be named with these trials; the measured poses are not looked at
    #[arg(long)]
    pub atlas: bool,
    /// Leave an effect out of the catalogue; may be given more than once
    #[arg(long, value_name = "EFFECT", value_delimiter = ',')]
    pub without_effect: Vec<String>,
    /// Options of the diagnosis (TOML)
    #[arg(long, value_name = "OPTIONS.toml")]
    pub options: Option<PathBuf>,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
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
pub fn run(args: &DiagnoseArgs) -> Result<String, BuildError> {
    run_with(args, &options(args.options.as_deref())?)
}

/// [`run`] with options already read.
pub fn run_with(args: &DiagnoseArgs, options: &DiagnosisOptions) -> Result<String, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    let (sources, mut text) = sources(&args.measured)?;
    let loaded = model_file::load(&args.model)?;
    let fault = |e: &dyn std::fmt::Display| BuildError::File(format!("{}: {e}", args.model.display()));
    let model = prepared(&loaded).map_err(|e| fault(&e))?;
    let catalogue = catalogue(&args.without_effect)?;
    let provenance = provenance(args, &loaded, &catalogue)?;
    if args.atlas {
        let atlas =
            diagnosis::atlas::atlas(&model, &loaded.spec, &sources, &catalogue, options).map_err(|e| fault(&e))?;
        let json = as_json(&atlas)?;
        let page = diagnosis::atlas::page(&loaded.spec.id, &atlas);
        store::write_all(&args.out, &[("atlas.json".into(), json), ("atlas.html".into(), page.clone().into_bytes())])?;
        return Ok(text + &diagnosis::atlas::table(&atlas));
    }
    let outcome = diagnose(&model, &loaded.spec, &sources, &catalogue, options)
        .and_then(|o| o.with_provenance(&provenance))
        .map_err(|e| fault(&e))?;
    write(args, &loaded, &outcome)?;
    text += &format!("{}\nLook at {}\n", outcome.diagnosis.description, args.out.join("report.html").display());
    Ok(text)
}

/// What an answer is found with.
fn provenance(
    args: &DiagnoseArgs,
    loaded: &model_file::LoadedModel,
    catalogue: &Catalogue,
) -> Result<Provenance, BuildError> {
    let digest = |(name, path): &(String, PathBuf)| Ok((name.clone(), hash(&store::read(path)?)));
    Ok(Provenance {
        program: env!("CARGO_PKG_VERSION").into(),
        catalogue: catalogue.version.clone(),
        model: model_file::digest(loaded),
        data: args.measured.iter().map(digest).collect::<Result<_, BuildError>>()?,
    })
}

/// The model of a file, compiled for a diagnosis.
pub fn prepared(loaded: &model_file::LoadedModel) -> Result<sim::Model, diagnosis::DiagnosisError> {
    let model = sim::compile(&loaded.spec, &loaded.meshes)?;
    diagnosis::rim::prepared(&model, &loaded.spec, &loaded.meshes)
}

/// Reads the data sets; names must differ.
pub fn sources(measured: &[(String, PathBuf)]) -> Result<(Vec<Source>, String), BuildError> {
    let (mut sources, mut text) = (Vec::<Source>::new(), String::new());
    for (name, path) in measured {
        if sources.iter().any(|s| s.name == *name) {
            return Err(BuildError::Usage(format!("--measured {name} is given twice; names must differ")));
        }
        let table =
            sim::laxity::read(&store::read(path)?).map_err(|e| BuildError::File(format!("{}: {e}", path.display())))?;
        text.extend(table.warnings.iter().map(|w| format!("warning: {}: {w}\n", path.display())));
        sources.push(Source { name: name.clone(), trials: table.trials });
    }
    Ok((sources, text))
}

fn catalogue(without: &[String]) -> Result<Catalogue, BuildError> {
    let catalogue = Catalogue::shipped();
    for name in without {
        if !catalogue.effect.iter().any(|e| e.id == *name) {
            let known: Vec<&str> = catalogue.effect.iter().map(|e| e.id.as_str()).collect();
            return Err(BuildError::Usage(format!(
                "--without-effect {name}: no such effect; the catalogue has {}",
                known.join(", ")
            )));
        }
    }
    let names: Vec<&str> = without.iter().map(String::as_str).collect();
    Ok(catalogue.without(&names))
}

/// Options of a file; the usual ones without.
pub fn options(path: Option<&Path>) -> Result<DiagnosisOptions, BuildError> {
    let Some(path) = path else { return Ok(DiagnosisOptions::default()) };
    toml::from_str(&store::read_text(path)?).map_err(|e| BuildError::Option(format!("{}: {e}", path.display())))
}

fn write(args: &DiagnoseArgs, loaded: &model_file::LoadedModel, outcome: &Outcome) -> Result<(), BuildError> {
    let mut diagnosis = outcome.diagnosis.clone();
    let mut files = Vec::new();
    let mut spec = loaded.spec.clone();
    if let Some(model) = &outcome.model {
        spec = model.clone();
        for (k, component) in outcome.components.iter().enumerate() {
            let name = format!("components/{}-{}.toml", component.effect, k + 1);
            let text = toml::to_string(component).map_err(|e| BuildError::File(format!("{name}: {e}")))?;
            files.push((name.clone(), text.into_bytes()));
            diagnosis.added.push(name);
        }
    }
    let out = store::make_folder(&args.out)?;
    let spec = model_file::moved(&spec, &loaded.folder, &out);
    files.push(("model.json".into(), as_json(&spec)?));
    files.push(("report.html".into(), diagnosis::page::page(&loaded.spec.id, &diagnosis).into_bytes()));
    files.push(("diagnosis.json".into(), as_json(&diagnosis)?));
    store::write_all(&out, &files)
}

fn as_json(value: &impl serde::Serialize) -> Result<Vec<u8>, BuildError> {
    serde_json::to_vec_pretty(value).map_err(|e| BuildError::File(format!("cannot write as JSON: {e}")))
}

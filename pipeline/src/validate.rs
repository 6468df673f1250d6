//! `validate`: the protocols on calibrated models of one knee, and their comparison.

use crate::bands::{self, Asking};
use crate::error::BuildError;
use crate::given::read_passive;
use crate::model_file::{self, LoadedModel};
use crate::options::{Override, parse_override, resolve};
use crate::simulate::of_model;
use crate::store;
use crate::told::{DifferenceTold, ModelTold, Told, ValidateTold, schemas};
use crate::which_model::{JOINT, WhichModel, of_this_run};
use calibration::samples::{Samples, group_sums};
use clap::Args;
use notices::Notice;
use serde::{Deserialize, Serialize};
use sim::laxity::protocol_csv;
use sim::mesh::MeshValue;
use sim::protocols::ProtocolOptions;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use validation::cross::{CrossPrediction, counts};
use validation::validate::{Difference, Passive, Source, compare};
use validation::{figures, tables};

/// `build-model validate`.
#[derive(Args, Clone, Debug)]
pub struct ValidateArgs {
    /// model.json of every model, or its folder, or a build (all its calibrated models, the joint one first); called by NAME=, else by its folder
    #[arg(required = true, value_name = "[NAME=]MODEL")]
    pub models: Vec<String>,
    /// Folder for the results
    #[arg(long)]
    pub out: PathBuf,
    /// Measured passive flexion (CSV); may be given more than once
    #[arg(long, value_name = "NAME=PASSIVE.csv", value_parser = named)]
    pub passive: Vec<(String, PathBuf)>,
    /// Override an option; may be given more than once
    #[arg(long = "set", value_name = "validate.key=value", value_parser = parse_override)]
    pub overrides: Vec<Override>,
    /// Of a build: which model, in place of all that are calibrated
    #[command(flatten)]
    pub which: WhichModel,
    /// Samples of the posterior, where a model has any: mean and 90 % interval stand beside every value; 0: the models alone
    #[arg(long, value_name = "N")]
    pub samples: Option<usize>,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

fn named(text: &str) -> Result<(String, PathBuf), String> {
    let (name, path) = text.split_once('=').ok_or("NAME=FILE was expected")?;
    Ok((name.trim().to_owned(), PathBuf::from(path)))
}

/// Runs `validate`.
pub fn validate(args: &ValidateArgs) -> Result<Told, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    let mut options = resolve(&BTreeMap::new(), &args.overrides, None)?.validate;
    options.samples = args.samples.unwrap_or(options.samples);
    let passive = args
        .passive
        .iter()
        .map(|(name, path)| read_passive(name, &path.display().to_string(), &store::read(path)?))
        .collect::<Result<Vec<_>, _>>()?;
    let (mut models, mut text) = (Vec::new(), String::new());
    let named = args.models.iter().map(|text| models_of(text, &args.which)).collect::<Result<Vec<_>, _>>()?;
    for (name, path) in named.into_iter().flatten() {
        let model = model_file::load_which(&path, &args.which)?;
        text += &model.line();
        if models.iter().any(|(n, m): &(String, model_file::LoadedModel)| *n == name && m.spec.id == model.spec.id) {
            return Err(BuildError::Usage(format!("two models are called {name}; give NAME=MODEL.json")));
        }
        models.push((name, model));
    }
    let mut warnings = Vec::new();
    let mut sources = Vec::new();
    for (name, model) in &models {
        let mut of = source(name, &model.spec, &model.meshes, &options, &mut warnings)?;
        of.model = model.label();
        let (samples, told) = bands::of(model)?;
        warnings.extend(told);
        if let Some(samples) = samples {
            let [columns, rows] = band(&mut of, &samples, model, &options, &mut warnings);
            if columns > 0 {
                text += &format!(
                    "{name}: {columns} poses and forces of the single most probable model lie outside their interval, in {rows} rows (flags)\n"
                );
            }
        }
        sources.push(of);
    }
    let validation = Validation::new(sources, passive, warnings);
    store::write_all(&store::make_folder(&args.out)?, &files_of(&validation)?)?;
    let data = ValidateTold {
        schema: schemas::VALIDATE,
        models: models.iter().map(|(_, model)| ModelTold::of(model)).collect(),
        folder: args.out.display().to_string(),
        differences: validation.differences.iter().map(difference).collect(),
        warnings: notices::texts(&validation.warnings),
        notices: validation.warnings.clone(),
    };
    let words = text + &words(&validation) + &format!("Results are in {}\n", args.out.display());
    Ok(Told::words(words).odd(validation.warnings).with(&data))
}

fn difference(d: &Difference) -> DifferenceTold {
    DifferenceTold {
        a: d.a.clone(),
        b: d.b.clone(),
        protocol: d.protocol.to_string(),
        quantity: d.quantity.to_string(),
        rmsd: d.rmsd,
        unit: d.unit.to_string(),
        published: d.published,
        note: d.note.to_string(),
    }
}

/// The models that an argument names: one, or every calibrated model of a build, the joint one first.
fn models_of(text: &str, which: &WhichModel) -> Result<Vec<(String, PathBuf)>, BuildError> {
    let (name, path) = name_of(text);
    if which.as_assembled || which.source.is_some() {
        return Ok(vec![(name, path)]);
    }
    let named = text.contains('=');
    let folders = [path.join("build/10-calibrate"), path.join("10-calibrate")];
    let Some(folder) = folders.into_iter().find(|f| store::is_folder(f)) else { return Ok(vec![(name, path)]) };
    let folder = match folder.parent() {
        Some(build) => of_this_run(build, "calibrate", folder.clone())?,
        None => folder,
    };
    let sources = store::list(&folder).into_iter().filter(|s| store::exists(&folder.join(s).join("model.json")));
    let called = |s: &String| if named { format!("{name}-{s}") } else { s.clone() };
    let mut found: Vec<(String, PathBuf)> = sources.map(|s| (called(&s), folder.join(&s).join("model.json"))).collect();
    found.sort_by_key(|(_, file)| !file.ends_with(Path::new(JOINT).join("model.json")));
    Ok(if found.is_empty() { vec![(name, path)] } else { found })
}

/// `NAME=PATH`, or a path whose last folder is the name.
fn name_of(text: &str) -> (String, PathBuf) {
    if let Some((name, path)) = text.split_once('=') {
        return (name.trim().to_owned(), PathBuf::from(path));
    }
    let path = Path::new(text);
    let is_file = path.extension().is_some_and(|e| e == "json");
    let folder =
        store::absolute(path).ok().and_then(|p| if is_file { p.parent().map(Path::to_path_buf) } else { Some(p) });
    let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = folder.and_then(|f| f.file_name().map(|n| n.to_string_lossy().into_owned()));
    (if is_file && stem != "model" { stem } else { folder.unwrap_or(stem) }, path.to_path_buf())
}

/// A model's answers to the protocols.
pub(crate) fn source(
    name: &str,
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    options: &ProtocolOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Source, BuildError> {
    let fault = |e: sim::SimError| BuildError::File(format!("{name}: {e}"));
    let model = sim::compile(spec, meshes).map_err(fault)?;
    let (mut source, told) = Source::simulated(name, spec, &model, options).map_err(fault)?;
    warnings.extend(told);
    // what was added to the knee; nothing of an apparatus
    let bundles = source.bundles.clone();
    let all =
        [&mut source.ap_laxity, &mut source.passive_flexion, &mut source.pivot_shift, &mut source.pivot_shift_no_acl];
    for r in all.into_iter().flatten() {
        r.outputs.extend(group_sums(&bundles, &r.forces_n));
    }
    for rows in [&mut source.ap_laxity, &mut source.passive_flexion, &mut source.pivot_shift] {
        diagnosis::predict::apply(&model, spec, None, rows).map_err(|e| BuildError::File(format!("{name}: {e}")))?;
    }
    let cut = model.without(&["ACL".to_owned()]).unwrap_or_else(|_| model.clone());
    diagnosis::predict::apply(&cut, spec, None, &mut source.pivot_shift_no_acl)
        .map_err(|e| BuildError::File(format!("{name}: {e}")))?;
    Ok(source)
}

/// Gives a source's answers their intervals; what is odd about them is a warning. Gives how many poses and forces of the single model lie outside, and in
/// how many rows.
pub(crate) fn band(
    of: &mut Source,
    samples: &Samples,
    model: &LoadedModel,
    options: &ProtocolOptions,
    warnings: &mut Vec<Notice>,
) -> [usize; 2] {
    let mut outside = [0; 2];
    if options.samples == 0 {
        return outside;
    }
    let (acl, bundles) = (["ACL".to_owned()], of.bundles.clone());
    of.samples = samples.len().min(options.samples);
    let pivot = Some(options.pivot_dislocation_ap_mm);
    for (rows, without, dislocation_ap_mm) in [
        (&mut of.ap_laxity, &acl[..0], None),
        (&mut of.passive_flexion, &acl[..0], None),
        (&mut of.pivot_shift, &acl[..0], pivot),
        (&mut of.pivot_shift_no_acl, &acl[..], pivot),
    ] {
        let asking = Asking { bundles: &bundles, without, source: None, most: options.samples, dislocation_ap_mm };
        let told = bands::by(samples, model, rows, &asking);
        warnings.extend(told.warnings.into_iter().map(|w| w.whose(&of.name)));
        outside = [outside[0] + told.outside[0], outside[1] + told.outside[1]];
    }
    outside
}

/// A validation: of a build, or of models given by hand.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Validation {
    /// Whose knee, or knees.
    pub specimen: String,
    /// A calibrated model each, in the order of their names.
    pub sources: Vec<Source>,
    /// Measured passive flexion.
    pub passive: Vec<Passive>,
    /// How far they differ.
    pub differences: Vec<Difference>,
    /// What models of single data sets predict of the others' laxity.
    pub cross: Vec<CrossPrediction>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// Differences by pair of models, then by protocol and quantity, for metrics.json.
    pub metrics: BTreeMap<String, BTreeMap<String, f64>>,
}

impl Validation {
    /// Of models with their answers, and what they are compared with.
    pub(crate) fn new(sources: Vec<Source>, passive: Vec<Passive>, warnings: Vec<Notice>) -> Validation {
        let differences = compare(&sources, &passive);
        let mut ids: Vec<&str> = sources.iter().map(|s| s.specimen.as_str()).collect();
        ids.dedup();
        let specimen = ids.join(" and ");
        let mut metrics: BTreeMap<String, BTreeMap<String, f64>> = BTreeMap::new();
        for d in &differences {
            let pair = metrics.entry(format!("{} {}", d.a, d.b)).or_default();
            pair.insert(format!("{}.{}", d.protocol, d.quantity), d.rmsd);
        }
        Validation { specimen, sources, passive, differences, cross: vec![], warnings, metrics }
    }

    /// The same with what its models predict of each other's data.
    pub(crate) fn with_cross(mut self, cross: Vec<CrossPrediction>) -> Validation {
        for ((model, data), [inside, of]) in counts(&cross) {
            let pair = self.metrics.entry(format!("{model} predicts {data}")).or_default();
            pair.extend([("ranges_inside".to_owned(), inside as f64), ("ranges".to_owned(), of as f64)]);
        }
        Validation { cross, ..self }
    }
}

/// A folder a source, the comparison, tables, and figures 7 and 8.
pub(crate) fn files_of(v: &Validation) -> Result<Vec<(String, Vec<u8>)>, BuildError> {
    let mut protocols: Vec<(String, Vec<u8>)> = Vec::new();
    for s in &v.sources {
        for (name, rows) in s.protocols() {
            let csv = of_model(&protocol_csv(&s.bundles, rows), &s.model)?;
            protocols.push((format!("{}/{name}.csv", s.label(&v.sources)), csv));
        }
    }
    let mut files: Vec<(String, String)> = Vec::new();
    let mut all = tables::tables(&v.sources);
    all.extend((!v.cross.is_empty()).then(|| tables::cross_predictions(&v.cross)));
    let differences = tables::differences(&v.differences);
    files.extend(all.iter().chain([&differences]).map(|t| (format!("{}.csv", t.name), t.csv())));
    files.push(("tables.md".into(), tables::page(&v.specimen, &all, &differences)));
    files.push(("figure7.svg".into(), figures::figure7(&v.sources)));
    files.push(("figure8.svg".into(), figures::figure8(&v.sources, &v.passive)));
    protocols.extend(files.into_iter().map(|(name, text)| (name, text.into_bytes())));
    Ok(protocols)
}

/// The differences, for the terminal.
fn words(v: &Validation) -> String {
    let mut text = String::new();
    for d in v.differences.iter().filter(|d| !d.quantity.ends_with("_si") && !d.quantity.ends_with("_ml")) {
        let published = d.published.map_or(String::new(), |p| format!(" (published {p:.2})"));
        let note = if d.note.is_empty() { String::new() } else { format!(" [{}]", d.note) };
        text +=
            &format!("{} - {}: {} {} {:.2} {}{published}{note}\n", d.a, d.b, d.protocol, d.quantity, d.rmsd, d.unit);
    }
    text
}

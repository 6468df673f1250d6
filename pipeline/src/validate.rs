//! `validate`: the protocols on calibrated models of one knee, and their comparison.

use crate::bands::{self, Asking};
use crate::error::BuildError;
use crate::given::read_passive;
use crate::model_file::{self, LoadedModel};
use crate::options::{Override, only, parse_override, resolve};
use crate::simulate::{Solver as SolverName, of_model, with_columns};
use crate::store;
use crate::told::{DifferenceTold, ModelTold, SolversTold, Told, ValidateTold, schemas};
use crate::which_model::{JOINT, WhichModel, of_this_run};
use calibration::samples::{Samples, group_sums};
use clap::Args;
use notices::Notice;
use serde::{Deserialize, Serialize};
use sim::Model;
use sim::coordinate::FREE;
use sim::flags::Flag;
use sim::laxity::{TrialResult, force_column, protocol_csv};
use sim::mesh::MeshValue;
use sim::protocols::{ProtocolOptions, Solver};
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use validation::apart::Apart;
use validation::cross::{CrossPrediction, counts};
use validation::validate::{Difference, Passive, Source, compare};
use validation::{figures, sensitivity, solvers, tables};

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
    #[arg(long, value_name = "N", value_parser = crate::numbers::count)]
    pub samples: Option<usize>,
    /// How the joint model, or every model where none is joint, is solved; those of single data sets beside it are quasi-static [default: explicit]
    #[arg(long)]
    pub solver: Option<SolverName>,
    /// Threads; the result does not depend on it [default: all]
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

fn named(text: &str) -> Result<(String, PathBuf), String> {
    let (name, path) = text.split_once('=').ok_or("NAME=FILE was expected")?;
    Ok((name.trim().to_owned(), PathBuf::from(path)))
}

/// Files that not every run writes.
const NOT_ALWAYS: [&str; 3] = ["solvers.csv", "sensitivity.csv", "cross_prediction.csv"];

/// Runs `validate`.
pub fn validate(args: &ValidateArgs) -> Result<Told, BuildError> {
    if let Some(jobs) = args.jobs {
        // A second call in one process keeps the first pool; results do not depend on it.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(jobs.into()).build_global();
    }
    only(&args.overrides, &["validate"])?;
    let mut options = resolve(&BTreeMap::new(), &args.overrides, None)?.validate;
    options.samples = args.samples.unwrap_or(options.samples);
    options.solver = args.solver.map_or(options.solver, SolverName::solver);
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
    store::written::are_free(&args.out, protocol_files(&models))?;
    let mut warnings = Vec::new();
    let mut sources = Vec::new();
    for (name, model) in &models {
        let is_knee = is_the_knee(is_joint(model), models.iter().any(|(_, m)| is_joint(m)));
        let mut of = source(name, (&model.spec, &model.meshes), (is_knee, &options), &mut warnings)?;
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
    let (folder, files) = (store::make_folder(&args.out)?, files_of(&validation)?);
    for name in NOT_ALWAYS.iter().filter(|name| files.iter().all(|(written, _)| written != *name)) {
        store::written::removed(&folder, name)?;
    }
    store::write_all(&folder, &files)?;
    let data = ValidateTold {
        schema: schemas::VALIDATE,
        models: models.iter().map(|(_, model)| ModelTold::of(model)).collect(),
        folder: args.out.display().to_string(),
        differences: validation.differences.iter().map(difference).collect(),
        solvers: solvers_told(&validation),
        warnings: notices::texts(&validation.warnings),
        notices: validation.warnings.clone(),
    };
    let words = text + &words(&validation) + &format!("Results are in {}\n", args.out.display());
    Ok(Told::words(words).odd(validation.warnings).with(&data))
}

/// The protocols, as files are called.
const PROTOCOLS: [&str; 4] = ["ap_laxity", "passive_flexion", "pivot_shift", "pivot_shift_no_acl"];

/// Files of answers that a validation of these models leaves: looked at before minutes of work.
fn protocol_files(models: &[(String, LoadedModel)]) -> Vec<String> {
    let is_one_knee = models.iter().all(|(_, m)| m.spec.id == models[0].1.spec.id);
    let label = |(name, model): &(String, LoadedModel)| match is_one_knee {
        true => name.clone(),
        false => format!("{}-{name}", model.spec.id),
    };
    models.iter().map(label).flat_map(|label| PROTOCOLS.map(|p| format!("{label}/{p}.csv"))).collect()
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
        measured: d.measured,
    }
}

/// Whether a model is calibrated to several data sets together.
fn is_joint(model: &LoadedModel) -> bool {
    model.spec.calibrated.as_ref().is_some_and(|c| c.to.len() > 1)
}

/// The largest differences of both solvers.
fn solvers_told(v: &Validation) -> Vec<SolversTold> {
    let of = |s: &Source, a: &Apart| SolversTold {
        model: s.label(&v.sources),
        protocol: a.protocol.clone(),
        cut: a.cut.clone(),
        step: a.step.clone(),
        flexion_deg: a.flexion_deg,
        column: a.column.clone(),
        unit: a.unit.clone(),
        explicit: a.explicit,
        quasistatic: a.quasistatic,
        limit: a.limit,
        cause: a.cause.map(|c| c.words().to_owned()),
    };
    let checked = v.sources.iter().filter_map(|s| Some((s, s.check.as_ref()?)));
    checked.flat_map(|(s, c)| c.largest.iter().map(move |a| of(s, a))).collect()
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
    (spec, meshes): (&ModelSpec, &BTreeMap<String, MeshValue>),
    (is_knee, options): (bool, &ProtocolOptions),
    warnings: &mut Vec<Notice>,
) -> Result<Source, BuildError> {
    let fault = |e: sim::SimError| BuildError::File(format!("{name}: {e}"));
    let model = sim::compile(spec, meshes).map_err(fault)?;
    let (quasi, told) = Source::simulated(name, spec, &model, options).map_err(fault)?;
    warnings.extend(told);
    if !is_knee {
        return with_effects(quasi, spec, &model);
    }
    let sensitivity = sensitivity::moved(&model, (spec, meshes), options).map_err(fault)?;
    if options.solver == Solver::Quasistatic {
        return Ok(Source { sensitivity, ..with_effects(quasi, spec, &model)? });
    }
    let (explicit, told) = solvers::explicit(&quasi, &model, options).map_err(fault)?;
    warnings.extend(told);
    let (mut source, quasi) = (with_effects(explicit, spec, &model)?, with_effects(quasi, spec, &model)?);
    warnings.extend(solvers::hold_against(&mut source, &quasi, &model, options).map_err(fault)?);
    source.sensitivity = sensitivity;
    Ok(source)
}

/// Whether a model is told by the solver that is asked for: the joint one is. Those of single data sets are where none is joint.
pub(crate) fn is_the_knee(is_joint: bool, any_joint: bool) -> bool {
    is_joint || !any_joint
}

/// The sums of ligament groups, and what was added to the knee; nothing of an apparatus.
fn with_effects(mut source: Source, spec: &ModelSpec, model: &Model) -> Result<Source, BuildError> {
    let name = source.name.clone();
    let bundles = source.bundles.clone();
    for r in source.protocols_mut().into_iter().flat_map(|(_, rows)| rows) {
        r.outputs.extend(group_sums(&bundles, &r.forces_n));
    }
    for rows in [&mut source.ap_laxity, &mut source.passive_flexion, &mut source.pivot_shift] {
        diagnosis::report::predict::apply(model, spec, None, rows)
            .map_err(|e| BuildError::File(format!("{name}: {e}")))?;
    }
    let cut = model.without(&["ACL".to_owned()]).unwrap_or_else(|_| model.clone());
    diagnosis::report::predict::apply(&cut, spec, None, &mut source.pivot_shift_no_acl)
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
        for s in &sources {
            let told = ["mm", "deg", "N"].into_iter().filter_map(|unit| s.check.as_ref()?.worst(unit));
            let of = told.map(|a| (format!("largest_{}", a.unit.to_lowercase()), a.difference().abs()));
            metrics.entry(format!("{} solvers", s.name)).or_default().extend(of);
        }
        metrics.retain(|_, figures| !figures.is_empty());
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
        for (k, (name, rows)) in s.protocols().into_iter().enumerate() {
            let beside = s.check.as_ref().map(|c| c.quasistatic[k].as_slice());
            let csv = with_solvers(&protocol_csv(&s.bundles, rows), &s.bundles, (rows, beside))?;
            let csv = of_model(&csv, &s.model)?;
            protocols.push((format!("{}/{name}.csv", s.label(&v.sources)), csv));
        }
    }
    let mut files: Vec<(String, String)> = Vec::new();
    let mut all = tables::tables(&v.sources);
    all.extend((!v.cross.is_empty()).then(|| tables::cross_predictions(&v.cross)));
    let of_knee = [tables::solvers(&v.sources), tables::sensitivity(&v.sources)];
    all.extend(of_knee.into_iter().filter(|t| !t.rows.is_empty()));
    let differences = tables::differences(&v.differences);
    files.extend(all.iter().chain([&differences]).map(|t| (format!("{}.csv", t.name), t.csv())));
    files.push(("tables.md".into(), tables::page(&v.specimen, &all, &differences)));
    files.push(("figure7.svg".into(), figures::figure7(&v.sources)));
    files.push(("figure8.svg".into(), figures::figure8(&v.sources, &v.passive)));
    protocols.extend(files.into_iter().map(|(name, text)| (name, text.into_bytes())));
    Ok(protocols)
}

/// A protocol's file with the solver of each row, and where it is explicit dynamics the quasi-static pose and forces beside: `ap_mm_quasistatic`.
fn with_solvers(
    csv: &str,
    bundles: &[String],
    (rows, beside): (&[TrialResult], Option<&[TrialResult]>),
) -> Result<String, BuildError> {
    let by = |r: &TrialResult| {
        let quasi = beside.is_none() || r.flags.contains(&Flag::Stopped);
        if quasi { "quasistatic" } else { "explicit" }.to_owned()
    };
    let mut more = vec![("solver".to_owned(), rows.iter().map(by).collect::<Vec<_>>())];
    let columns = FREE.map(|c| c.column()).into_iter().chain(bundles.iter().map(|b| force_column(b)));
    for (k, column) in columns.enumerate().filter(|_| beside.is_some_and(|b| !b.is_empty())) {
        let cell = |r: &TrialResult| {
            let value = r.columns(bundles)[k].1;
            if !value.is_finite() {
                return String::new();
            }
            format!("{:.6}", if value.abs() < LEAST_TOLD { 0.0 } else { value })
        };
        more.push((format!("{column}_quasistatic"), beside.into_iter().flatten().map(cell).collect()));
    }
    with_columns(csv, &more)
}

/// Smaller than this is told as 0 [mm, deg, N]: half of the last digit.
const LEAST_TOLD: f64 = 5e-7;

/// The largest differences of both solvers, for the terminal.
fn of_solvers(v: &Validation) -> String {
    let mut text = String::new();
    for s in &v.sources {
        for a in ["mm", "deg", "N"].into_iter().filter_map(|unit| s.check.as_ref()?.worst(unit)) {
            let cut = if a.cut.is_empty() { String::new() } else { format!(" without {}", a.cut) };
            let cause = a.cause.map_or(String::new(), |c| format!(" [{}]", c.words()));
            text += &format!(
                "{}: explicit - quasi-static: largest {:.3} {} (limit {}), {}{cut}, {}, {}{cause}\n",
                s.label(&v.sources),
                a.difference(),
                a.unit,
                a.limit,
                a.protocol,
                a.step,
                a.column
            );
        }
    }
    text
}

/// The differences, for the terminal.
fn words(v: &Validation) -> String {
    let mut text = of_solvers(v);
    for d in v.differences.iter().filter(|d| !d.quantity.ends_with("_si") && !d.quantity.ends_with("_ml")) {
        let published = d.published.map_or(String::new(), |p| format!(" (published {p:.2})"));
        let note = if d.note.is_empty() { String::new() } else { format!(" [{}]", d.note) };
        text +=
            &format!("{} - {}: {} {} {:.2} {}{published}{note}\n", d.a, d.b, d.protocol, d.quantity, d.rmsd, d.unit);
    }
    text
}

//! `blind`: data with hidden effects from an independent laboratory, answers to them, and their scores.

use crate::error::BuildError;
use crate::options::{Override, parse_override};
use crate::which_model::WhichModel;
use crate::{diagnose, diagnosis_files, model_file, store};
use blindbench::knee::{BundleInput, KneeInput, Unlike};
use blindbench::laboratory::{Case, Planned, Truth, Ways, cuts, every_kind, kinds, make_by};
use blindbench::score::{Said, Score, Share, score};
use calibration::options::CalibrateOptions;
use calibration::priors::PRIORS;
use calibration::targets::TargetOptions;
use clap::{Args, Subcommand};
use diagnosis::diagnosis::Diagnosis;
use diagnosis::problem::covariance::Floor;
use diagnosis::problem::trial::Source;
use diagnosis::search::DiagnosisOptions;
use sim::coordinate::{FREE, Free};
use sim::laxity::{LaxityTrial, TrialResult, results_csv};
use sim::mesh::MeshValue;
use sim::uncertainty::{LigamentUncertainty, ParameterPrior};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

mod hard;
mod regret;

use hard::Hard;
pub use hard::Laboratory;

/// `build-model blind`.
#[derive(Subcommand, Clone, Debug)]
pub enum BlindVerb {
    /// Make cases: a folder each, its truth sealed beside it
    Make(MakeArgs),
    /// Diagnose every case of a bench, without its truths
    Answer(AnswerArgs),
    /// Open the truths and score the answers
    Score(ScoreArgs),
}

/// `blind make`.
#[derive(Args, Clone, Debug)]
pub struct MakeArgs {
    /// model.json of the knee that is copied into the laboratory
    pub model: PathBuf,
    /// A protocol: loads, flexions and noise of its trials; measured poses are not looked at
    #[arg(long, value_name = "NAME=LAXITY.csv", required = true, value_parser = diagnose::named_file)]
    pub like: Vec<(String, PathBuf)>,
    /// A new folder for the cases
    #[arg(long)]
    pub out: PathBuf,
    /// How many
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub count: u32,
    /// Seed of the first
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Only this kind: null, compound, unknown, or an effect's name. cut_ACL takes away a ligament, or the share of it that --size says; attachment_ACL
    /// moves its sites (ACL, PCL, sMCL, LCL); structure_loss and attachment draw the ligament
    #[arg(long)]
    pub kind: Option<String>,
    /// Every kind of the catalogue takes its turn, also those that earlier benches left out, with a null before each five
    #[arg(long, conflicts_with = "kind")]
    pub every_kind: bool,
    /// So many cuts of each of ACL, PCL, sMCL and LCL, in turn, and as many whole knees; --size is the share that is lost
    #[arg(long, value_name = "COUNT", conflicts_with_all = ["kind", "every_kind", "count"], value_parser = clap::value_parser!(u32).range(1..=20_000))]
    pub cuts: Option<u32>,
    /// Each case also has what the same knee read before, with nothing hidden in it, on another day; answer takes that as --before
    #[arg(long)]
    pub before: bool,
    /// Factor on the sizes of effects: below 1 for weak ones
    #[arg(long, default_value_t = 1.0)]
    pub size: f64,
    /// Each data set reads poses in frames of its own, as far from the knee's as calibrate.frames believes: sensors are calibrated anew, points probed again
    #[arg(long)]
    pub own_frames: bool,
    /// Ligaments and contact differ from the model's one and a half times as widely as the analysis supposes: strains by 0.045, stiffness by 30 %,
    /// contact by 45 %, one standard deviation, with no strain too far off
    #[arg(long)]
    pub wide: bool,
    /// The knee has other surfaces than the model: plateaus tilted by 2 deg, cartilage of another form by 0.5 mm, one standard deviation
    #[arg(long)]
    pub surfaces: bool,
    /// Which laboratory measures
    #[arg(long, value_enum, default_value_t = Laboratory::First)]
    pub laboratory: Laboratory,
}

/// `blind answer`.
#[derive(Args, Clone, Debug)]
pub struct AnswerArgs {
    /// model.json that is diagnosed
    pub model: PathBuf,
    /// The bench's folder
    pub bench: PathBuf,
    /// Where the answers go, a folder a case; answers that are there already are kept
    #[arg(long)]
    pub out: PathBuf,
    /// Override an option of the diagnosis or of the knee's calibration
    #[arg(long = "set", value_name = "diagnose.key=value", value_parser = parse_override)]
    pub overrides: Vec<Override>,
    /// A part of the method taken away, to see what it is worth: into a folder of its own
    #[arg(long, value_enum)]
    pub ablation: Option<Ablation>,
    /// Strike from the catalogue what is hidden in each case, and answer cases of a single effect alone: the truth is opened for its name, no more
    #[arg(long)]
    pub struck: bool,
    /// Tell beside each new answer by how much its search stayed behind a fit that starts at the truth (regret.json). The search does not see the truth
    #[arg(long, conflicts_with = "struck")]
    pub regret: bool,
}

/// A part of the method taken away.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ablation {
    /// Ligaments and contact held at the model's own, instead of marginalised
    FrozenLigaments,
    /// Tracking noise alone, no declared floor
    NoFloor,
    /// An answer outside the catalogue is not allowed
    NoWildcard,
    /// Rivals ranked by the error that they leave, not by evidence
    ByError,
}

impl Ablation {
    fn options(self) -> DiagnosisOptions {
        let mut out = DiagnosisOptions::default();
        match self {
            Ablation::FrozenLigaments => out.frozen_ligaments = true,
            Ablation::NoFloor => out.floor = Floor::none(),
            Ablation::NoWildcard => out.wildcard = false,
            Ablation::ByError => out.by_error = true,
        }
        out
    }
}

/// `blind score`.
#[derive(Args, Clone, Debug)]
pub struct ScoreArgs {
    /// The model that was diagnosed
    pub model: PathBuf,
    /// The bench's folder
    pub bench: PathBuf,
    /// Folders of answers: one, or several to compare (ablations). Cases without an answer are left out
    #[arg(required = true)]
    pub answers: Vec<PathBuf>,
}

/// Runs a verb of the bench; gives the words to print.
pub fn run(verb: &BlindVerb) -> Result<String, BuildError> {
    match verb {
        BlindVerb::Make(args) => make_cases(args),
        BlindVerb::Answer(args) => answer(args),
        BlindVerb::Score(args) => score_answers(args),
    }
}

fn make_cases(args: &MakeArgs) -> Result<String, BuildError> {
    let loaded = model_file::load(&args.model)?;
    let input = knee(&loaded)?;
    let (sources, _) = diagnose::sources(&args.like)?;
    let sources: Vec<Source> = sources.into_iter().map(|s| args.laboratory.plans(s)).collect();
    let hard = Hard::of(args);
    let plan: Vec<Planned> = sources.iter().flat_map(|s| s.trials.iter().map(|t| planned(&s.name, t))).collect();
    let kinds = match (&args.kind, args.cuts) {
        (Some(kind), _) => vec![kind.clone(); args.count as usize],
        (None, Some(of_each)) => cuts(of_each as usize),
        (None, None) if args.every_kind => every_kind(args.count as usize),
        (None, None) => kinds(args.count as usize),
    };
    let mut seals = BTreeMap::new();
    for (k, kind) in kinds.iter().enumerate() {
        let name = format!("case_{:04}", k + 1);
        let seed = args.seed.wrapping_mul(1_000_003).wrapping_add(k as u64);
        let (case, first) = drawn((&loaded.spec, &input), &plan, &name, (kind, args.size), (seed, &hard))?;
        write_readings(&args.out.join(&name), &sources, &case, "")?;
        if let Some(first) = &first {
            write_readings(&args.out.join(&name), &sources, first, BEFORE)?;
        }
        let truth = serde_json::to_vec_pretty(&case.truth).map_err(|e| BuildError::File(e.to_string()))?;
        seals.insert(name.clone(), crate::record::hash(&truth));
        store::write(&args.out.join(format!("{name}.truth.json")), &truth)?;
        // after every case, so that a bench that is stopped can be answered and scored as far as it came
        let names: Vec<&String> = sources.iter().map(|s| &s.name).collect();
        let mut manifest = serde_json::json!({"schema": "bench/1", "sources": names, "seals": seals});
        if args.before {
            manifest["before"] = true.into();
        }
        let text = serde_json::to_vec_pretty(&manifest).map_err(|e| BuildError::File(e.to_string()))?;
        store::write(&args.out.join("bench.json"), &text)?;
    }
    Ok(format!("{} cases in {}\n", kinds.len(), args.out.display()))
}

/// Ending of the name of a file with what the same knee read before.
const BEFORE: &str = "_before";

/// Writes the readings of a case, a file a data set.
fn write_readings(folder: &Path, sources: &[Source], case: &Case, ending: &str) -> Result<(), BuildError> {
    let mut readings = case.readings.iter();
    for source in sources {
        let results: Vec<TrialResult> =
            source.trials.iter().zip(readings.by_ref()).map(|(t, r)| result(t, &Free(*r))).collect();
        store::write(&folder.join(format!("{}{ending}.csv", source.name)), results_csv(&[], &results).as_bytes())?;
    }
    Ok(())
}

/// Tells the noise of the day before from that of the day of a case.
const OTHER_DAY: u64 = 0x27d4_eb2f;
/// Tells the draws of the laboratory's knee from those of its day.
const UNLIKE: u64 = 0x5bd1_e995;
/// Tells one draw of a case's knee from the next.
const AGAIN: u64 = 0x9e37_79b9_7f4a_7c15;
/// Most draws of a case's knee, and of one of wide laws or other surfaces [-].
const DRAWS: [u64; 2] = [50, 300];
/// A knee that opens further than this in varus or valgus in a laxity test is torn or dislocated [deg]; intact knees open by 3 to 8.
const INTACT_DEG: f64 = 20.0;
/// A bundle that carries more than this in a drawer of 133 N is nobody's [N]: the cruciates carry about the drawer itself.
const INTACT_N: f64 = 300.0;

/// A case of the model's knee. A model that says what it does not know is not its knee: the laboratory's differs from it by that much. Such a knee, and one
/// of wide laws or other surfaces, is drawn until it is one that holds together. With it comes what the same knee read before, where that was asked for.
fn drawn(
    (spec, input): (&sim::spec::ModelSpec, &KneeInput),
    plan: &[Planned],
    name: &str,
    kind: (&str, f64),
    (seed, hard): (u64, &Hard),
) -> Result<(Case, Option<Case>), BuildError> {
    let by = unlike(spec);
    let ways = hard.ways(by.is_some());
    let made_by = |input: &KneeInput, plan: &[Planned], kind: (&str, f64), (seed, ways): (u64, &Ways)| {
        make_by(input, plan, name, kind, (seed, ways)).map_err(|e| BuildError::File(e.to_string()))
    };
    let made =
        |input: &KneeInput, plan: &[Planned], kind: (&str, f64), seed: u64| made_by(input, plan, kind, (seed, &ways));
    let first = |knee: &KneeInput, seed: u64| {
        let day = Ways { day: OTHER_DAY, ..ways.clone() };
        hard.has_before().then(|| made_by(knee, plan, ("null", 1.0), (seed, &day))).transpose()
    };
    if by.is_none() && !hard.draws_knees() {
        return Ok((made(input, plan, kind, seed)?, first(input, seed)?));
    }
    let draws = DRAWS[usize::from(hard.draws_knees())];
    for draw in 0..draws {
        let seed = seed.wrapping_add(draw.wrapping_mul(AGAIN));
        let knee = by.as_ref().map_or_else(|| input.clone(), |by| input.unlike(by, &ways.spread, seed ^ UNLIKE));
        let knee = hard.surfaces_of(knee, seed);
        // one trial tells soon whether a knee carries too much, as many of these do
        let one = plan.get(..1).unwrap_or(plan);
        if hard.draws_knees() && carries(&made(&knee, one, ("null", 1.0), seed)?) > INTACT_N {
            continue;
        }
        let case = made(&knee, plan, kind, seed)?;
        let opens = opens(&case, kind.0);
        if opens <= INTACT_DEG && carries(&case) <= INTACT_N {
            return Ok((case, first(&knee, seed)?));
        }
    }
    Err(BuildError::File(format!(
        "{name}: none of {draws} knees that were drawn holds together (varus and valgus within {INTACT_DEG} deg, bundles below {INTACT_N} N)"
    )))
}

/// How far a case's knee opens in varus or valgus [deg]. A knee that is cut is asked as it was whole, without what the cut changes: cut, it may open wide.
fn opens(case: &Case, kind: &str) -> f64 {
    let is_cut = kind.starts_with("cut_");
    let whole = |(r, s): (&[f64; 5], &[f64; 5])| if is_cut { r[0] - s[0] } else { r[0] };
    case.readings.iter().zip(&case.truth.signature).map(whole).map(f64::abs).fold(0.0, f64::max)
}

/// The most that a bundle of a case's knee carries in a drawer, without effects [N].
fn carries(case: &Case) -> f64 {
    case.truth.forces_n.values().flat_map(|t| t.values().copied()).fold(0.0, f64::max)
}

/// How far the laboratory's knee may be from a built one; `None` where the model states no such thing.
fn unlike(spec: &sim::spec::ModelSpec) -> Option<Unlike> {
    let u = spec.uncertainty.as_ref()?;
    let frames = [&u.frames.femur, &u.frames.tibia];
    if frames.iter().all(|f| f.turn_deg == [0.0; 3] && f.shift_mm == [0.0; 3]) {
        return None;
    }
    let strain = |l: &LigamentUncertainty| match l.reference_strain {
        Some(ParameterPrior::Normal { mean, sd, .. }) => Some([mean, sd]),
        _ => None,
    };
    let stated = |name: &String| u.ligaments.get(name).and_then(strain);
    let usual = |name: &String| PRIORS.reference_strain.get(name).map(|p| [p.mean, p.sd]);
    Some(Unlike {
        sites_mm: u.sites.iter().map(|(b, s)| (b.clone(), [s.femur_mm, s.tibia_mm])).collect(),
        turn_deg: frames.map(|f| f.turn_deg),
        shift_mm: frames.map(|f| f.shift_mm),
        cartilage_mm: u.cartilage_mm,
        strains: spec
            .bundles
            .iter()
            .filter_map(|b| Some((b.name.clone(), stated(&b.name).or_else(|| usual(&b.name))?)))
            .collect(),
    })
}

pub(crate) fn planned(source: &str, t: &LaxityTrial) -> Planned {
    let usual = TargetOptions::default().noise;
    Planned {
        source: source.to_owned(),
        condition: format!("{} {}", t.test.name(), t.nominal_flexion_deg),
        flexion_deg: t.fe_deg,
        load: t.load.0.0,
        sd: FREE.map(|c| t.sd[c].unwrap_or(usual[c])),
    }
}

/// A trial with another measurement.
fn result(t: &LaxityTrial, r: &Free<f64>) -> TrialResult {
    let pose = sim::spec::PoseSpec { fe_deg: t.fe_deg, ..Default::default() }.moved(r);
    TrialResult { trial: t.clone(), pose, forces_n: vec![], outputs: vec![], flags: vec![], bands: vec![] }
}

/// The model as the laboratory sees it: geometry and numbers, none of its code.
fn knee(loaded: &model_file::LoadedModel) -> Result<KneeInput, BuildError> {
    let spec = &loaded.spec;
    let surface = |name: &String| match loaded.meshes.get(name) {
        Some(MeshValue::Surface(mesh)) => Ok(mesh.clone()),
        _ => Err(BuildError::File(format!("the model's surface {name} is missing"))),
    };
    let bundles = spec
        .bundles
        .iter()
        .map(|b| BundleInput {
            name: b.name.clone(),
            reference_strain: b.reference_strain,
            stiffness: b.stiffness_n_per_mm,
            reference_length: b.reference_length_mm,
            fibres: spec.fibres.iter().filter(|f| f.bundle == b.name).map(|f| (f.femur, f.tibia)).collect(),
        })
        .collect();
    let (x, p) = (&spec.contact.overclosure_mm, &spec.contact.pressure_mpa);
    let slope = match (x.as_slice(), p.as_slice()) {
        ([.., x0, x1], [.., p0, p1]) if x1 > x0 => (p1 - p0) / (x1 - x0),
        _ => return Err(BuildError::File("the model's contact table has fewer than two points".into())),
    };
    let femur = spec.contact.pairs.first().map(|p| surface(&p.femur));
    Ok(KneeInput {
        frames: (spec.frames.femur, spec.frames.tibia),
        bundles,
        femur: femur.unwrap_or_else(|| Err(BuildError::File("the model has no contact pair".into())))?,
        tibia: spec.contact.pairs.iter().map(|p| surface(&p.tibia)).collect::<Result<_, _>>()?,
        contact_slope: slope,
    })
}

/// Cases and data sets of a bench.
fn bench(folder: &Path) -> Result<(Vec<String>, Vec<String>, serde_json::Value), BuildError> {
    let path = folder.join("bench.json");
    let value: serde_json::Value =
        serde_json::from_str(&store::read_text(&path)?).map_err(|e| BuildError::in_file(&path, e))?;
    let cases = value["seals"].as_object().map(|o| o.keys().cloned().collect()).unwrap_or_default();
    let list = value["sources"].as_array().cloned().unwrap_or_default();
    let sources = list.iter().filter_map(|s| s.as_str().map(str::to_owned)).collect();
    Ok((cases, sources, value))
}

fn answer(args: &AnswerArgs) -> Result<String, BuildError> {
    let (cases, sources, manifest) = bench(&args.bench)?;
    let has_before = manifest["before"].as_bool().unwrap_or(false);
    let options = match args.ablation {
        Some(_) if !args.overrides.is_empty() => {
            return Err(BuildError::Usage("--ablation and --set cannot be joined".into()));
        }
        Some(ablation) => ablation.options(),
        None => diagnose::options(&args.overrides)?,
    };
    let (mut kept, mut passed) = (0, 0);
    for case in &cases {
        let out = args.out.join(case);
        if store::exists(&out.join("diagnosis.json")) {
            kept += 1;
            continue;
        }
        let without_effect = if args.struck { hidden_alone(&args.bench, case)? } else { vec![] };
        if args.struck && without_effect.is_empty() {
            passed += 1;
            continue;
        }
        let folder = args.bench.join(case);
        let files = |ending: &str| -> Vec<(String, PathBuf)> {
            sources.iter().map(|s| (s.clone(), folder.join(format!("{s}{ending}.csv")))).collect()
        };
        let question = diagnose::DiagnoseArgs {
            which: WhichModel::default(),
            model: args.model.clone(),
            measured: files(""),
            before: if has_before { files(BEFORE) } else { vec![] },
            out,
            atlas: false,
            without_effect,
            overrides: args.overrides.clone(),
            jobs: None,
        };
        let truth = if args.regret { truth_of(&args.bench, case)? } else { vec![] };
        let (_, behind) = diagnose::run_beside(&question, &options, &truth)?;
        regret::write(&question.out, behind.as_ref())?;
    }
    let answers = cases.len() - passed;
    Ok(format!("{answers} answers in {}, {kept} of them there before\n", args.out.display()))
}

/// A case's truth, its seal not asked.
fn unsealed(bench: &Path, case: &str) -> Result<Truth, BuildError> {
    serde_json::from_slice(&store::read(&bench.join(format!("{case}.truth.json")))?)
        .map_err(|e| BuildError::File(format!("{case}: {e}")))
}

/// What is hidden in a case, as the search is held against it.
fn truth_of(bench: &Path, case: &str) -> Result<Vec<diagnosis::search::regret::Hidden>, BuildError> {
    Ok(regret::hidden(&unsealed(bench, case)?, &diagnosis::effect::catalogue::Catalogue::shipped()))
}

/// The name of a case's effect, where the catalogue has it and nothing else is hidden.
fn hidden_alone(bench: &Path, case: &str) -> Result<Vec<String>, BuildError> {
    let truth = unsealed(bench, case)?;
    let catalogue = diagnosis::effect::catalogue::Catalogue::shipped();
    Ok(match &truth.effects[..] {
        // sites of one ligament are struck with those of all
        [(effect, _, _)] => catalogue.find(effect).map(|(known, _)| known.id.clone()).into_iter().collect(),
        _ => vec![],
    })
}

fn score_answers(args: &ScoreArgs) -> Result<String, BuildError> {
    let truths = opened(args)?;
    let mut folders = Vec::new();
    // the first answer to each case that was free to name anything
    let mut whole: BTreeMap<String, Said> = BTreeMap::new();
    for answers in &args.answers {
        let mut pairs = Vec::new();
        for truth in &truths {
            let Some(said) = said(answers, &truth.case)? else { continue };
            if said.without.is_empty() {
                whole.entry(truth.case.clone()).or_insert_with(|| said.clone());
            }
            pairs.push((truth.clone(), said));
        }
        folders.push((answers, pairs));
    }
    let (cases, _, _) = bench(&args.bench)?;
    let mut text = String::new();
    for (answers, pairs) in folders {
        let result = score(&pairs, &whole);
        let json = serde_json::to_vec_pretty(&result).map_err(|e| BuildError::File(e.to_string()))?;
        store::write(&answers.join("score.json"), &json)?;
        text +=
            &format!("{}: {} of {} cases answered\n{}", answers.display(), pairs.len(), cases.len(), table(&result));
    }
    Ok(text)
}

/// Truths of the cases that have an answer, their seals checked, with what they promise to an analysis.
fn opened(args: &ScoreArgs) -> Result<Vec<Truth>, BuildError> {
    let (cases, sources, manifest) = bench(&args.bench)?;
    let loaded = model_file::load(&args.model)?;
    let (options, calibrate) = (DiagnosisOptions::default(), CalibrateOptions::default());
    let model = diagnosis_files::prepared(&loaded, &calibrate).map_err(|e| BuildError::File(e.to_string()))?;
    let mut truths = Vec::new();
    for case in cases.iter().filter(|c| args.answers.iter().any(|a| store::exists(&a.join(c).join("diagnosis.json")))) {
        let bytes = store::read(&args.bench.join(format!("{case}.truth.json")))?;
        if manifest["seals"][case].as_str() != Some(crate::record::hash(&bytes).as_str()) {
            return Err(BuildError::File(format!(
                "{case}.truth.json: its seal is broken (bench.json holds another digest)"
            )));
        }
        let mut truth: Truth = serde_json::from_slice(&bytes).map_err(|e| BuildError::File(format!("{case}: {e}")))?;
        truth.case.clone_from(case);
        if !truth.effects.is_empty() {
            let measured: Vec<(String, PathBuf)> =
                sources.iter().map(|s| (s.clone(), args.bench.join(case).join(format!("{s}.csv")))).collect();
            let (data, _) = diagnose::sources(&measured)?;
            let promise = {
                let signature: Vec<Free<f64>> = truth.signature.iter().copied().map(Free).collect();
                diagnosis::diagnosis::atlas::promise(&model, &loaded.spec, &data, &signature, (&options, &calibrate))
            }
            .map_err(|e| BuildError::File(format!("{case}: {e}")))?;
            truth.strength.expected_evidence = promise.all;
            truth.strength.settled_evidence = promise.settled;
        }
        truths.push(truth);
    }
    Ok(truths)
}

/// What a folder's answer to a case said, where there is one.
fn said(answers: &Path, case: &str) -> Result<Option<Said>, BuildError> {
    let path = answers.join(case).join("diagnosis.json");
    if !store::exists(&path) {
        return Ok(None);
    }
    let diagnosis: Diagnosis =
        serde_json::from_slice(&store::read(&path)?).map_err(|e| BuildError::in_file(&path, e))?;
    Ok(Some(Said { regret: regret::read(&answers.join(case))?, ..reduced(&diagnosis) }))
}

fn reduced(d: &Diagnosis) -> Said {
    let verdict = serde_json::to_value(d.verdict).ok().and_then(|v| v.as_str().map(str::to_owned));
    let mut sizes = BTreeMap::new();
    for e in d.answers.first().map(|a| a.effects.as_slice()).unwrap_or_default() {
        for (key, v) in &e.parameters {
            sizes.insert((e.effect.clone(), key.clone()), (v.value, v.sd));
        }
    }
    let first = d.answers.first().map(|a| a.effects.as_slice()).unwrap_or_default();
    let variants = first.iter().filter_map(|e| Some((e.effect.clone(), e.variant.clone()?))).collect();
    let names =
        |a: &diagnosis::diagnosis::Answer| a.effects.iter().map(|e| (e.effect.clone(), e.scope.clone())).collect();
    Said {
        verdict: verdict.unwrap_or_default(),
        answers: d.answers.iter().map(names).collect(),
        weights: d.answers.iter().map(|a| a.weight).collect(),
        variants,
        reported: reported(d),
        sizes,
        closed: d.gap.held_out.closed,
        without: d.without.clone(),
        evidence: d.answers.iter().map(|a| a.log_bayes_factor).collect(),
        best: d.best_log_bayes_factor,
        regret: None,
    }
}

/// What a diagnosis reports as possible: its answers, then what it does not exclude beside them; not that nothing is missing.
fn reported(d: &Diagnosis) -> Vec<Vec<(String, Option<String>)>> {
    let states = d.answers.iter().map(|a| &a.effects).chain(d.not_excluded.iter().map(|n| &n.effects));
    let mut out: Vec<Vec<(String, Option<String>)>> = Vec::new();
    for effects in states.filter(|effects| !effects.is_empty()) {
        let state = effects.iter().map(|e| (e.effect.clone(), e.variant.clone())).collect();
        if !out.contains(&state) {
            out.push(state);
        }
    }
    out
}

/// A share in words: its name, its count, its interval.
fn line(name: &str, share: &Share) -> String {
    let (low, high) = share.interval();
    format!(
        "{name:<44} {:>4} of {:<4} {:>5.1} % (95 %: {:.1} to {:.1})\n",
        share.hits,
        share.of,
        100.0 * share.hits as f64 / share.of.max(1) as f64,
        100.0 * low,
        100.0 * high
    )
}

/// Whether weights are to be believed, in words; nothing where no answer was given.
fn reliability(s: &Score) -> String {
    let Some(error) = s.calibration_error else { return String::new() };
    let mut out = format!(
        "weights: expected calibration error {error:.2}; of answers that were given a weight, those that say just what is hidden\n"
    );
    for bin in &s.reliability {
        out += &line(&format!("weight {:.1} to {:.1}, mean {:.2}: right", bin.from, bin.to, bin.weight), &bin.right);
    }
    out
}

/// The value below which a part of some values lies.
fn middle(v: &[f64], part: f64) -> f64 {
    let mut v = v.to_vec();
    v.sort_by(f64::total_cmp);
    v.get(((v.len() as f64 - 1.0) * part).max(0.0) as usize).copied().unwrap_or(f64::NAN)
}

fn table(s: &Score) -> String {
    let mut out = regret::words(&s.regrets);
    out.extend(s.shares.iter().map(|(name, share)| line(name, share)));
    if !s.beside.is_empty() {
        let [half, most] = [0.5, 0.9].map(|part| middle(&s.beside, part));
        out += &format!(
            "states reported beside the truth, of cuts and whole knees: median {half:.0}, nine of ten to {most:.0}\n"
        );
    }
    out += &reliability(s);
    out += &format!(
        "size error: median {:.2}; gap closed (strong): median {:.2}, lower quartile {:.2}\n",
        middle(&s.size_errors, 0.5),
        middle(&s.closed, 0.5),
        middle(&s.closed, 0.25)
    );
    out.extend(s.failures.iter().map(|f| format!("failed: {f}\n")));
    out
}

//! Cuts: does a diagnosis find the ligament that was cut, and how far does its search stay behind the truth?
//!
//! `cuts MODEL.json KLA.csv RKS.csv LIGAMENT[=LOSS]|none|read SEED...`: with `read` the trials are taken as they were read. Else the model answers the trials of both plans with the ligament cut (or a share of it
//! lost), noise is added, and the model as it was is diagnosed. A row a seed: verdict, the first answer, what else is in the set, the loss found. Then, in
//! nats: what these trials tell of the cut without noise (little: `none` is right), what a fit earns that starts at the truth, what the best earns, and the
//! regret. With the variable `CUTS_BEFORE` set the
//! diagnosis also has what the whole knee answered to the same plan, on another day. With `CUTS_TEXT` set the words of the diagnosis follow.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::session::Session;
use diagnosis::diagnosis::{Calibration, Diagnosis, diagnose_beside};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::nuisance::is_built;
use diagnosis::problem::trial::Source;
use diagnosis::report::{Named, NotExcluded};
use diagnosis::search::DiagnosisOptions;
use diagnosis::search::regret::{Hidden, Regret};
use inference::random::{normal, stream};
use sim::coordinate::Free;
use sim::flags::Flag;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::model::compile;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// What the seed of the noise of the day before differs by [-].
const OTHER_DAY: u64 = 1_000_000;
/// Repositioning of a condition, in noises [-]; as the blind bench has it.
const REPOSITIONING: f64 = 0.4;

fn read(path: &Path) -> (ModelSpec, BTreeMap<String, MeshValue>) {
    let spec: ModelSpec = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let mut meshes = BTreeMap::new();
    for name in spec.bodies.iter().map(|b| &b.bone).chain(spec.contact.meshes()) {
        let bytes = std::fs::read(path.parent().unwrap().join(name)).unwrap();
        let read = formats::read_surface(name, &bytes, &BTreeMap::new()).unwrap();
        meshes.insert(name.clone(), MeshValue::Surface(read.mesh));
    }
    (spec, meshes)
}

/// What the knee of `spec` with a share of a ligament lost answers to the trials, with noise. Trials in which it falls out of its joint are left out: no
/// laboratory reads them.
fn measured(
    (spec, meshes): (&ModelSpec, &BTreeMap<String, MeshValue>),
    (ligament, loss): (&str, f64),
    plan: &[Source],
    seed: u64,
) -> Vec<Source> {
    let mut spec = spec.clone();
    for b in spec.bundles.iter_mut().filter(|b| b.name == ligament || b.name.starts_with(&format!("{ligament}_"))) {
        b.stiffness_n_per_mm *= (1.0 - loss).max(1e-6);
    }
    let model = compile(&spec, meshes).unwrap();
    let mut random = stream(seed, 0);
    let usual = CalibrateOptions::default().targets.noise;
    plan.iter()
        .map(|source| {
            let answers = solve_trials(&model, &source.trials, &TrialOptions::default());
            let mut shared: BTreeMap<(String, i64), [f64; 5]> = BTreeMap::new();
            let with = |(t, a): (&LaxityTrial, _)| {
                let a: Result<sim::trials::Answer, sim::SimError> = a;
                let key = (t.test.name().to_owned(), t.nominal_flexion_deg.round() as i64);
                let common = *shared.entry(key).or_insert_with(|| std::array::from_fn(|_| normal(&mut random)));
                let own: [f64; 5] = std::array::from_fn(|_| normal(&mut random));
                let answer = a.ok().filter(|a| !a.flags.contains(&Flag::Dislocated))?.predicted();
                let mut out = t.clone();
                let mut k = 0;
                out.measured = Free::from_fn(|c| {
                    let sd = t.sd[c].unwrap_or(usual[c]);
                    k += 1;
                    t.measured[c].map(|_| answer[c] + sd * (REPOSITIONING * common[k - 1] + own[k - 1]))
                });
                Some(out)
            };
            let trials = source.trials.iter().zip(answers).filter_map(with).collect();
            Source::new(&source.name, trials)
        })
        .collect()
}

/// Where a calibration to the data ends.
fn mode(knee: &Knee, sources: &[Source], options: &CalibrateOptions, seed: u64) -> BTreeMap<String, f64> {
    let mut options = options.clone();
    options.inference.samples = 0;
    options.seed = seed;
    let data: Vec<_> = sources.iter().map(|s| (s.name.clone(), s.trials.clone())).collect();
    let session = Session::new(&knee.spec, "", &data, &options).unwrap();
    let begun = session.begin(None).unwrap();
    session.run_told(knee, begun, &mut |_| ControlFlow::Continue(()), &|_, _| ()).unwrap().found.mode
}

/// An answer in short: its effects with their sizes.
fn told(effects: &[Named]) -> String {
    let one = |e: &Named| {
        let about = e.variant.as_ref().map_or(String::new(), |v| format!(" {v}"));
        let place = if e.scope == "both" { String::new() } else { format!(" ({})", e.scope) };
        let sizes: Vec<String> = e.parameters.iter().map(|(k, v)| format!(" {k} {:.2}", v.value)).collect();
        format!("{}{about}{place}{}", e.effect, sizes.concat())
    };
    effects.iter().map(one).collect::<Vec<_>>().join(" + ")
}

/// The share that an answer says the ligament has lost.
fn loss_found(d: &Diagnosis, ligament: &str) -> Option<f64> {
    let is_it = |e: &&Named| e.effect == "structure_loss" && e.variant.as_deref() == Some(ligament);
    let found = d.answers.iter().find_map(|a| a.effects.iter().find(is_it))?;
    found.parameters.get("loss").map(|v| v.value)
}

/// A state that is not excluded, with its log odds.
fn state(of: &NotExcluded) -> String {
    let name = match &of.torn {
        Some(structure) => format!("{structure} torn"),
        None if of.effects.is_empty() => "nothing".to_owned(),
        None => told(&of.effects),
    };
    format!("{name} {:.1}", of.log_odds)
}

/// The row of a cut.
fn row(
    (ligament, loss, seed): (&str, f64, u64),
    trials: usize,
    d: &Diagnosis,
    regret: Option<Regret>,
    seconds: f64,
) -> String {
    let answers: Vec<String> = d.answers.iter().map(|a| format!("{} [{:.2}]", told(&a.effects), a.weight)).collect();
    let figure = |x: Option<f64>, places: usize| x.map_or("-".to_owned(), |x| format!("{x:.places$}"));
    let test = d.next_tests.first().map_or("-".to_owned(), |t| {
        format!("{} {:.0} deg {} gain {:.1}", t.test, t.flexion_deg, t.source, t.expected_gain)
    });
    let cells = [
        ligament.to_owned(),
        format!("{loss}"),
        seed.to_string(),
        trials.to_string(),
        format!("{:?}", d.verdict),
        answers.first().cloned().unwrap_or_else(|| format!("- (best {})", told(&d.best))),
        answers.get(1..).unwrap_or_default().join(", "),
        figure(loss_found(d, ligament), 2),
        figure(regret.map(|r| r.information), 1),
        figure(regret.map(|r| r.truth), 1),
        figure(d.best_log_bayes_factor, 1),
        figure(regret.map(|r| r.short()), 1),
        figure(regret.map(|r| r.leaves), 2),
        format!("{:.1} {:.1}", d.wildcard, d.wildcard_alone.unwrap_or_default()),
        format!("{:.2} {:.2}", d.misfit[0], d.misfit[1]),
        test,
        d.not_excluded.iter().map(state).collect::<Vec<_>>().join(", "),
        format!("{seconds:.0}"),
    ];
    format!("| {} |", cells.join(" | "))
}

/// What stands in a row.
const HEAD: &str = "| cut | share | seed | trials | verdict | first | others of the set | loss found | information | truth earns | best earns | regret | truth leaves | field beside, in place | left before, after | next test | not excluded, log odds | s |";

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (spec, meshes) = read(Path::new(&args[0]));
    let plan: Vec<Source> = [("kla", &args[1]), ("rks", &args[2])]
        .map(|(name, path)| Source::new(name, sim::laxity::read(&std::fs::read(path).unwrap()).unwrap().trials))
        .to_vec();
    let (ligament, loss) = args[3].split_once('=').map_or((args[3].as_str(), 1.0), |(l, s)| (l, s.parse().unwrap()));
    let loss = if ["none", "read"].contains(&ligament) { 0.0 } else { loss };
    let (options, calibrate) = (DiagnosisOptions::default(), CalibrateOptions::default());
    let model = diagnosis::problem::rim::prepared(&spec, &meshes, &calibrate.search).unwrap();
    let knee = Knee::new(spec.clone(), &meshes, &calibrate.search).unwrap();
    let has_before = std::env::var_os("CUTS_BEFORE").is_some();
    println!("{HEAD}");
    for seed in args[4..].iter().map(|s| s.parse::<u64>().unwrap()) {
        let begun = Instant::now();
        let made = |loss, seed| measured((&spec, &meshes), (ligament, loss), &plan, seed);
        let mut sources = if ligament == "read" { plan.clone() } else { made(loss, seed) };
        let whole = if has_before { made(0.0, seed + OTHER_DAY) } else { vec![] };
        let named = |s: Source| Source::before(format!("{}_before", s.name), s.trials);
        let first: Vec<Source> = whole.into_iter().map(named).collect();
        let known = if has_before { &first } else { &sources };
        let mode = is_built(&spec).then(|| mode(&knee, known, &calibrate, options.seed));
        sources.extend(first);
        let truth = if loss > 0.0 { vec![Hidden::of_all("structure_loss", ligament, ("loss", loss))] } else { vec![] };
        let calibration = Calibration { options: &calibrate, mode: mode.as_ref() };
        let (outcome, regret) =
            diagnose_beside(&model, &spec, &sources, &Catalogue::shipped(), &options, calibration, &truth).unwrap();
        let d = outcome.diagnosis;
        let trials = sources.iter().map(|s| s.trials.len()).sum();
        println!("{}", row((ligament, loss, seed), trials, &d, regret, begun.elapsed().as_secs_f64()));
        if std::env::var_os("CUTS_TEXT").is_some() {
            println!("{}\n{}\n{:?}\n{}", d.plain, d.description, d.may_be_torn, serde_json::to_string(&d).unwrap());
        }
    }
}

//! Cuts: does a diagnosis find the ligament that was cut, and how far does its search stay behind the truth?
//!
//! `cuts MODEL.json KLA.csv RKS.csv LIGAMENT[=LOSS]|none SEED...`: the model answers the trials of both plans with the ligament cut (or weakened), noise is
//! added, and the model as it was is diagnosed. A line a seed: verdict, answers, log Bayes factors, and the regret: by how much the evidence of a fit that
//! starts at the truth is ahead of the best that was found, in the scatter at the best.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::session::Session;
use diagnosis::catalogue::Catalogue;
use diagnosis::diagnosis::{Calibration, Diagnosis, diagnose_beside};
use diagnosis::nuisance::is_built;
use diagnosis::search::DiagnosisOptions;
use diagnosis::trial::Source;
use inference::random::{normal, stream};
use sim::coordinate::Free;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::model::compile;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

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

/// What the knee of `spec` with a share of a ligament lost answers to the trials, with noise.
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
                let answer = a.ok()?.predicted();
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
            Source { name: source.name.clone(), trials }
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

fn told(d: &Diagnosis) -> String {
    let of = |effects: &[diagnosis::report::Named]| {
        let one = |e: &diagnosis::report::Named| {
            let sizes: Vec<String> = e.parameters.iter().map(|(k, v)| format!("{k} {:.2}", v.value)).collect();
            format!(
                "{}{} ({}) {}",
                e.effect,
                e.variant.as_ref().map_or(String::new(), |v| format!(" {v}")),
                e.scope,
                sizes.join(" ")
            )
        };
        effects.iter().map(one).collect::<Vec<_>>().join(" + ")
    };
    let answers: Vec<String> = d
        .answers
        .iter()
        .map(|a| format!("{} w {:.2} lnB {:.1}", of(&a.effects), a.weight, a.log_bayes_factor))
        .collect();
    let best = d.best_log_bayes_factor.unwrap_or_default();
    format!(
        "{:?} | {} | best {} lnB {best:.1} | misfit {:.2} {:.2} | field {:.1} {:.1} | closed {:.2}",
        d.verdict,
        answers.join("; "),
        of(&d.best),
        d.misfit[0],
        d.misfit[1],
        d.wildcard,
        d.wildcard_alone.unwrap_or_default(),
        d.gap.held_out.closed
    )
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let (spec, meshes) = read(Path::new(&args[0]));
    let plan: Vec<Source> = [("kla", &args[1]), ("rks", &args[2])]
        .map(|(name, path)| Source {
            name: name.into(),
            trials: sim::laxity::read(&std::fs::read(path).unwrap()).unwrap().trials,
        })
        .to_vec();
    let (ligament, loss) = args[3].split_once('=').map_or((args[3].as_str(), 1.0), |(l, s)| (l, s.parse().unwrap()));
    let loss = if ligament == "none" { 0.0 } else { loss };
    let (options, calibrate) = (DiagnosisOptions::default(), CalibrateOptions::default());
    let model = diagnosis::rim::prepared(&spec, &meshes, &calibrate.search).unwrap();
    let knee = Knee::new(spec.clone(), &meshes, &calibrate.search).unwrap();
    for seed in args[4..].iter().map(|s| s.parse::<u64>().unwrap()) {
        let begun = Instant::now();
        let sources = measured((&spec, &meshes), (ligament, loss), &plan, seed);
        let mode = is_built(&spec).then(|| mode(&knee, &sources, &calibrate, options.seed));
        let calibrated = begun.elapsed().as_secs_f64();
        let truth = if loss > 0.0 { vec![("structure_loss", ligament, vec![loss])] } else { vec![] };
        let calibration = Calibration { options: &calibrate, mode: mode.as_ref() };
        let (d, regret) =
            diagnose_beside(&model, &spec, &sources, &Catalogue::shipped(), &options, calibration, &truth).unwrap();
        println!(
            "{} seed {seed}: {} | regret {} | {:.0} and {:.0} s",
            args[3],
            told(&d),
            regret.map_or("-".into(), |r| format!("{:.1} (truth {:.1})", r.short(), r.truth)),
            calibrated,
            begun.elapsed().as_secs_f64() - calibrated
        );
    }
}

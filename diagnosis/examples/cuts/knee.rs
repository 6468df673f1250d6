//! A knee with its plan: what it answers when a ligament is cut, and what a diagnosis makes of that.

use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::session::Session;
use diagnosis::diagnosis::{Calibration, Diagnosis, diagnose_beside};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::nuisance::is_built;
use diagnosis::problem::trial::Source;
use diagnosis::search::DiagnosisOptions;
use diagnosis::search::regret::{Hidden, Regret};
use inference::random::{normal, stream};
use sim::coordinate::Free;
use sim::flags::Flag;
use sim::laxity::LaxityTrial;
use sim::mesh::MeshValue;
use sim::model::{Model, compile};
use sim::names::is_of;
use sim::spec::ModelSpec;
use sim::trials::{TrialOptions, solve_trials};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

/// What the seed of the noise of the day before differs by [-].
const OTHER_DAY: u64 = 1_000_000;
/// Repositioning of a condition, in noises [-]; as the blind bench has it.
const REPOSITIONING: f64 = 0.4;

/// A share of a ligament that is cut; no share: the knee is whole.
pub(crate) type Cut<'a> = (&'a str, f64);

/// A knee and the trials that it is put to.
pub(crate) struct Specimen {
    spec: ModelSpec,
    meshes: BTreeMap<String, MeshValue>,
    plan: Vec<Source>,
    knee: Knee,
    model: Model,
}

/// What a diagnosis said of one set.
pub(crate) struct Said {
    pub(crate) diagnosis: Diagnosis,
    /// By how much its search stayed behind a fit that starts at the truth; none where nobody asked.
    pub(crate) regret: Option<Regret>,
    /// Trials that it had [-].
    pub(crate) trials: usize,
}

impl Specimen {
    /// A model with two protocols.
    pub(crate) fn read(model: &str, [kla, rks]: [&str; 2]) -> Specimen {
        let (spec, meshes) = read(Path::new(model));
        let plan: Vec<Source> = [("kla", kla), ("rks", rks)]
            .map(|(name, path)| Source::new(name, sim::laxity::read(&std::fs::read(path).unwrap()).unwrap().trials))
            .to_vec();
        let search = CalibrateOptions::default().search;
        let model = diagnosis::problem::rim::prepared(&spec, &meshes, &search).unwrap();
        let knee = Knee::new(spec.clone(), &meshes, &search).unwrap();
        Specimen { spec, meshes, plan, knee, model }
    }

    /// The trials as they were read.
    pub(crate) fn as_read(&self) -> Vec<Source> {
        self.plan.clone()
    }

    /// What the knee answers with a cut; each seed has its own noise.
    pub(crate) fn cut(&self, cut: Cut, seed: u64) -> Vec<Source> {
        measured((&self.spec, &self.meshes), cut, &self.plan, seed)
    }

    /// What the whole knee answered to the same plan on another day.
    pub(crate) fn before(&self, seed: u64) -> Vec<Source> {
        let named = |s: Source| Source::before(format!("{}_before", s.name), s.trials);
        self.cut(("none", 0.0), seed + OTHER_DAY).into_iter().map(named).collect()
    }

    /// The model as it was, diagnosed with what was read; `truth` where its regret is asked.
    pub(crate) fn diagnosed(&self, mut sources: Vec<Source>, before: Vec<Source>, truth: &[Hidden]) -> Said {
        let (options, calibrate) = (DiagnosisOptions::default(), CalibrateOptions::default());
        let known = if before.is_empty() { &sources } else { &before };
        let mode = is_built(&self.spec).then(|| mode(&self.knee, known, &calibrate, options.seed));
        sources.extend(before);
        let calibration = Calibration { options: &calibrate, mode: mode.as_ref() };
        let catalogue = Catalogue::shipped();
        let (outcome, regret) =
            diagnose_beside(&self.model, &self.spec, &sources, &catalogue, &options, calibration, truth).unwrap();
        Said { diagnosis: outcome.diagnosis, regret, trials: sources.iter().map(|s| s.trials.len()).sum() }
    }
}

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
    for b in spec.bundles.iter_mut().filter(|b| is_of(&b.name, ligament)) {
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

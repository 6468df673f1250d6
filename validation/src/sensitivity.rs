//! How far drawers and pivot shift move with what a calibration does not settle: reference strains, stiffnesses, the contact law, menisci.

use serde::{Deserialize, Serialize};
use sim::SimError;
use sim::coordinate::{AP, Free, IE, Load, VV};
use sim::laxity::{LaxityTrial, Test};
use sim::mesh::MeshValue;
use sim::model::Model;
use sim::protocols::ProtocolOptions;
use sim::sensitivity::{Parameter, sensitivities};
use sim::spec::ModelSpec;
use sim::trials::{Answer, solve_trials};
use std::collections::BTreeMap;

/// How far two calibrations of one knee to two data sets differ in a reference strain, of itself [-]; [andreassen2025, table 4].
const STRAIN: f64 = 0.046;
/// The same of a stiffness [-]; [andreassen2025, table 4].
const STIFFNESS: f64 = 0.143;
/// Factors on the contact's pressure [-]; ours: cartilage's modulus is known to a factor of two.
const PRESSURE: [f64; 2] = [0.5, 2.0];

/// What is changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Changed {
    /// Every reference strain, each by itself.
    ReferenceStrain,
    /// Every stiffness, each by itself.
    Stiffness,
    /// The pressure of the contact law, half and twice; the larger move.
    ContactLaw,
    /// The menisci taken out.
    Menisci,
}

impl Changed {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            Changed::ReferenceStrain => "reference_strain",
            Changed::Stiffness => "stiffness",
            Changed::ContactLaw => "contact_law",
            Changed::Menisci => "menisci",
        }
    }

    /// By how much, in words.
    pub fn by(self) -> &'static str {
        match self {
            Changed::ReferenceStrain => "4.6 % each: root of the sum of squares",
            Changed::Stiffness => "14.3 % each: root of the sum of squares",
            Changed::ContactLaw => "half or twice the pressure: the larger",
            Changed::Menisci => "taken out",
        }
    }
}

/// How far a test moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moved {
    /// What is changed.
    pub changed: Changed,
    /// The test.
    pub step: String,
    /// Its flexion [deg].
    pub flexion_deg: f64,
    /// Whether it is a drawer; else it is the pivot shift.
    pub drawer: bool,
    /// Size of the move of AP [mm], IE and VV [deg].
    pub ap_mm: f64,
    /// Of IE [deg].
    pub ie_deg: f64,
    /// Of VV [deg].
    pub vv_deg: f64,
    /// The largest change of a bundle's force [N].
    pub force_n: f64,
    /// That bundle.
    pub bundle: String,
}

/// Sizes of the moves of a test: of the pose, and of each bundle's force.
type Sizes = (Free<f64>, Vec<f64>);

/// All moves of the quasi-static drawers and pivot shift of a knee, `model` being that of `spec`; a change under which a test has no equilibrium has no row.
///
/// # Errors
/// A model without menisci that does not compile.
pub fn moved(
    model: &Model,
    (spec, meshes): (&ModelSpec, &BTreeMap<String, MeshValue>),
    options: &ProtocolOptions,
) -> Result<Vec<Moved>, SimError> {
    let trials = tests(options);
    let solved = |m: &Model| -> Vec<Option<Answer>> {
        solve_trials(m, &trials, &options.trials).into_iter().map(Result::ok).collect()
    };
    let own = solved(model);
    let mut out = Vec::new();
    for changed in [Changed::ReferenceStrain, Changed::Stiffness] {
        let sizes = own.iter().map(|a| by_each(model, a.as_ref()?, changed)).collect();
        out.extend(rows(changed, &trials, model, sizes));
    }
    let by = |other: &Model| -> Vec<Option<Sizes>> {
        own.iter().zip(solved(other)).map(|(a, b)| Some(between(a.as_ref()?, &b?))).collect()
    };
    let [half, twice] = PRESSURE.map(|factor| {
        let mut other = model.clone();
        other.contact.scale *= factor;
        by(&other)
    });
    let larger = half.into_iter().zip(twice).map(|(a, b)| {
        let ((a, f), (b, g)) = (a?, b?);
        Some((Free::from_fn(|c| a[c].max(b[c])), f.iter().zip(g).map(|(f, g)| f.max(g)).collect()))
    });
    out.extend(rows(Changed::ContactLaw, &trials, model, larger.collect()));
    if !spec.menisci.is_empty() {
        let without = ModelSpec { menisci: vec![], ..spec.clone() };
        out.extend(rows(Changed::Menisci, &trials, model, by(&sim::compile(&without, meshes)?)));
    }
    Ok(out)
}

/// Drawers at every flexion, and the pivot shift.
fn tests(o: &ProtocolOptions) -> Vec<LaxityTrial> {
    let mut out = Vec::new();
    for fe in &o.ap_flexions_deg {
        for (test, sign) in [(Test::Anterior, 1.0), (Test::Posterior, -1.0)] {
            let load = Load::new(0.0, 0.0, 0.0, sign * o.ap_load_n, o.compression_n);
            out.push(LaxityTrial::asked(format!("{} drawer at {fe} deg", test.name()), test, *fe, load));
        }
    }
    let load = Load::new(o.pivot_valgus_nm, -o.pivot_internal_nm, 0.0, 0.0, o.compression_n);
    let name = format!("pivot shift at {} deg", o.pivot_flexion_deg);
    out.push(LaxityTrial::asked(name, Test::Valgus, o.pivot_flexion_deg, load));
    out
}

/// The moves by every bundle's parameter, each by itself, as the root of the sum of their squares; by the exact derivatives.
fn by_each(model: &Model, answer: &Answer, changed: Changed) -> Option<Sizes> {
    let bundles = 0..model.bundles.len();
    let (parameters, steps): (Vec<Parameter>, Vec<f64>) = bundles
        .filter(|b| !model.is_removed(*b))
        .map(|b| match changed {
            Changed::Stiffness => (Parameter::Stiffness(b), STIFFNESS * model.bundles[b].stiffness),
            _ => (Parameter::ReferenceStrain(b), STRAIN * model.bundles[b].reference_strain),
        })
        .unzip();
    let by = sensitivities(model, answer, &parameters).ok()?;
    let size =
        |row: &dyn Fn(usize) -> f64| steps.iter().enumerate().map(|(k, s)| (row(k) * s).powi(2)).sum::<f64>().sqrt();
    let pose = Free::from_fn(|c| size(&|k| by.pose[(c.free_index(), k)]));
    Some((pose, (0..model.bundles.len()).map(|b| size(&|k| by.forces_n[(b, k)])).collect()))
}

/// The sizes of the differences of two answers.
fn between(a: &Answer, b: &Answer) -> Sizes {
    let (x, y) = (a.predicted(), b.predicted());
    let forces = a.forces_n.iter().zip(&b.forces_n).map(|(f, g)| (f - g).abs());
    (Free::from_fn(|c| (x[c] - y[c]).abs()), forces.collect())
}

fn rows(changed: Changed, trials: &[LaxityTrial], model: &Model, sizes: Vec<Option<Sizes>>) -> Vec<Moved> {
    let row = |(trial, sizes): (&LaxityTrial, Option<Sizes>)| {
        let (pose, forces) = sizes?;
        let (most, force_n) = forces.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(Moved {
            changed,
            step: trial.trial.clone(),
            flexion_deg: trial.fe_deg,
            drawer: trial.test.coordinate() == Some(AP),
            ap_mm: pose[AP],
            ie_deg: pose[IE],
            vv_deg: pose[VV],
            force_n,
            bundle: model.bundles[most].name.clone(),
        })
    };
    trials.iter().zip(sizes).filter_map(row).collect()
}

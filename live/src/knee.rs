//! A knee that is opened once and asked often.

use crate::pack::{Packed, unpack};
use crate::pressure::Surfaces;
use calibration::samples::{Question, Samples, group_sums};
use meshes::Isometry;
use serde::{Deserialize, Serialize};
use sim::Model;
use sim::coordinate::Load;
use sim::laxity::{Band, LaxityTrial, Test, TrialResult};
use sim::mesh::MeshValue;
use sim::spec::{ModelSpec, PoseSpec};
use sim::trials::{Answer, TrialOptions, solve_trial};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// A knee that answers.
pub struct Knee {
    spec: ModelSpec,
    model: Model,
    meshes: BTreeMap<String, MeshValue>,
    samples: Option<Samples>,
    /// The model that samples are asked of, compiled when they first are.
    of_samples: OnceCell<Model>,
    faces: Surfaces,
    axes: Isometry,
}

/// What is asked of a knee.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// Loads on the tibia: VV, IE [N m], ML, AP, SI [N].
    pub load: Load,
    /// Cut bundles or ligaments.
    #[serde(default)]
    pub cut: Vec<String>,
    /// Added to the reference strain of a bundle [-].
    #[serde(default)]
    pub strain: BTreeMap<String, f64>,
    /// Factor on the stiffness of a bundle [-].
    #[serde(default)]
    pub stiffness: BTreeMap<String, f64>,
}

/// What a page must know of the knee before it asks.
#[derive(Clone, Debug, Serialize)]
pub struct About {
    /// Its name.
    pub id: String,
    /// Bundles in the order of every list of forces.
    pub bundles: Vec<AboutBundle>,
    /// Flexion in CT [deg].
    pub ct_flexion_deg: f64,
    /// Flexion that may be asked, least and most [deg].
    pub flexion_deg: [f64; 2],
    /// Samples of its calibration.
    pub samples: usize,
    /// Probability that an interval holds [-].
    pub interval: f64,
}

/// A bundle as it was calibrated.
#[derive(Clone, Debug, Serialize)]
pub struct AboutBundle {
    /// Its name.
    pub name: String,
    /// Ratio of length to slack length in the CT pose [-].
    pub reference_strain: f64,
    /// Of the whole bundle [N/mm].
    pub stiffness_n_per_mm: f64,
}

/// What the knee answers.
#[derive(Clone, Debug, Serialize)]
pub struct Told {
    /// Grood-Suntay pose, clinical signs.
    pub pose: PoseSpec,
    /// Force of each bundle [N].
    pub forces_n: Vec<f64>,
    /// Mean strain of each bundle's fibres against their slack length [-]; none of a cut bundle.
    pub strains: Vec<Option<f64>>,
    /// Contact and sums of ligaments: names with their units, values.
    pub outputs: Vec<(String, f64)>,
    /// What is odd.
    pub flags: Vec<String>,
    /// Rows of the 3 x 4 matrix that moves the femur, in the page's axes.
    pub femur: [f64; 12],
    /// Force of each fibre [N].
    pub fibres_n: Vec<f64>,
    /// By surface of the page: pressed corners and their pressures [MPa].
    pub pressure: BTreeMap<String, Vec<(u16, f64)>>,
    /// Evaluations of the model it took.
    pub evaluations: usize,
}

/// Means and intervals by samples.
#[derive(Clone, Debug, Serialize)]
pub struct Bands {
    /// By the names of the columns of a results file.
    pub bands: BTreeMap<String, Band>,
    /// Samples asked.
    pub asked: usize,
    /// Samples without equilibrium.
    pub lost: usize,
    /// Samples whose femur leaves the plateau.
    pub leaving: usize,
}

impl Knee {
    /// Opens a pack.
    ///
    /// # Errors
    /// What is no pack; a model that does not compile.
    pub fn open(bytes: &[u8]) -> Result<Knee, String> {
        let Packed { spec, samples, meshes, faces, axes } = unpack(bytes)?;
        let model = sim::compile(&spec, &meshes).map_err(|e| e.to_string())?;
        let faces = Surfaces::new(faces);
        Ok(Knee { spec, model, meshes, samples, of_samples: OnceCell::new(), faces, axes })
    }

    /// What a page must know before it asks.
    pub fn about(&self) -> About {
        let bundle = |b: &sim::ligament::Bundle| AboutBundle {
            name: b.name.clone(),
            reference_strain: b.reference_strain,
            stiffness_n_per_mm: b.stiffness,
        };
        About {
            id: self.spec.id.clone(),
            bundles: self.model.bundles.iter().map(bundle).collect(),
            ct_flexion_deg: self.spec.frames.gs_ct_pose.fe_deg,
            flexion_deg: TrialOptions::default().flexion_deg,
            samples: self.samples.as_ref().map_or(0, Samples::len),
            interval: self.samples.as_ref().map_or(0.0, |s| s.of.interval),
        }
    }

    /// The knee's answer, by the mechanics of `simulate`.
    ///
    /// # Errors
    /// Loads, flexion or parameters out of range, a name of no bundle, no equilibrium.
    pub fn told(&self, asked: &Asked) -> Result<Told, String> {
        let model = self.model(asked)?;
        let (answer, result) = solved(&model, asked)?;
        let fibres = &answer.evaluation.fibres;
        let pose = &answer.evaluation.pose;
        Ok(Told {
            pose: result.pose,
            strains: strains(&model, &answer),
            forces_n: result.forces_n,
            outputs: result.outputs,
            flags: result.flags,
            femur: rows(&(self.axes * pose.femur * self.axes.inverse())),
            fibres_n: fibres.iter().map(|f| f.response.force).collect(),
            pressure: self.faces.pressed(&model.contact, pose).by_surface,
            evaluations: answer.evaluations,
        })
    }

    /// Mean and interval of every number of the answer, by at most `most` samples.
    ///
    /// # Errors
    /// As [`Knee::told`]; a knee without samples, or with ligaments that no sample has.
    pub fn bands(&self, asked: &Asked, most: usize) -> Result<Bands, String> {
        let samples = self.samples.as_ref().ok_or("this knee has no samples, so nothing has an interval")?;
        if !self.spec.components.is_empty() {
            return Err("what was added to the model is in its values and not in its samples: no intervals".into());
        }
        if asked.strain.values().any(|x| *x != 0.0) || asked.stiffness.values().any(|x| *x != 1.0) {
            return Err("intervals are those of the calibrated ligaments; with changed ones there are none".into());
        }
        let model = self.model(asked)?;
        let (_, result) = solved(&model, asked)?;
        let values = [result.columns(&model.bundle_names())];
        let trials = [result.trial];
        let question = Question {
            trials: &trials,
            without: &asked.cut,
            source: None,
            most,
            dislocation_ap_mm: None,
            values: Some(&values),
        };
        let found = samples.bands_of(self.searched(samples)?, &question).map_err(|e| e.to_string())?;
        Ok(Bands {
            bands: found.rows.into_iter().flatten().collect(),
            asked: found.asked,
            lost: found.lost,
            leaving: found.leaving.into_iter().sum(),
        })
    }

    /// The model that samples are asked of.
    fn searched(&self, samples: &Samples) -> Result<&Model, String> {
        if self.of_samples.get().is_none() {
            let model = samples.searched(&self.meshes).map_err(|e| e.to_string())?;
            let _ = self.of_samples.set(model);
        }
        self.of_samples.get().ok_or_else(|| "the samples have no model".to_owned())
    }

    /// The model with what is cut and changed.
    fn model(&self, asked: &Asked) -> Result<Model, String> {
        let mut parameters = self.model.parameters();
        let place = |name: &String| {
            let at = self.model.bundles.iter().position(|b| b.name == *name);
            at.ok_or_else(|| format!("no bundle is named {name:?}"))
        };
        for (name, added) in &asked.strain {
            parameters[place(name)?].reference_strain += added;
        }
        for (name, factor) in &asked.stiffness {
            parameters[place(name)?].stiffness_n_per_mm *= factor;
        }
        let changed = self.model.with_parameters(&parameters).map_err(|e| e.to_string())?;
        changed.without(&asked.cut).map_err(|e| e.to_string())
    }
}

/// The answer of a model and its row of results, with the sums of ligaments.
fn solved(model: &Model, asked: &Asked) -> Result<(Answer, TrialResult), String> {
    // a trial of no test: the loads alone say what it is
    let trial = LaxityTrial::asked("live".into(), Test::Neutral, asked.flexion_deg, asked.load);
    let answer = solve_trial(model, &trial, &TrialOptions::default()).map_err(|e| e.to_string())?;
    let mut result = answer.result(&trial);
    result.outputs.extend(group_sums(&model.bundle_names(), &result.forces_n));
    Ok((answer, result))
}

/// Mean strain of each bundle's fibres [-].
fn strains(model: &Model, answer: &Answer) -> Vec<Option<f64>> {
    let mut sums = vec![0.0; model.bundles.len()];
    for (fibre, state) in model.fibres.iter().zip(&answer.evaluation.fibres) {
        let bundle = &model.bundles[fibre.bundle];
        let stretch = state.line.length - fibre.initial_length + bundle.initial_stretch();
        sums[fibre.bundle] += stretch / bundle.slack_length() / bundle.fibres as f64;
    }
    sums.into_iter().enumerate().map(|(b, s)| (!model.is_removed(b)).then_some(s)).collect()
}

fn rows(motion: &Isometry) -> [f64; 12] {
    let m = motion.to_homogeneous();
    std::array::from_fn(|i| m[(i / 4, i % 4)])
}

//! A knee that is opened once and asked often.

use crate::pack::{Packed, unpack};
use crate::pressure::Surfaces;
use calibration::changed::{Changed, Fixed};
use calibration::samples::{Question, Samples, group_sums};
use meshes::Isometry;
use meshes::frame::Side;
use serde::{Deserialize, Serialize};
use sim::Model;
use sim::coordinate::Load;
use sim::flags::sentences;
use sim::graft::{self, Graft};
use sim::laxity::{Band, LaxityTrial, Test, TrialResult};
use sim::mesh::MeshValue;
use sim::spec::{ModelSpec, PoseSpec};
use sim::trials::{Answer, TrialOptions, solve_trial};
use std::cell::{OnceCell, RefCell};
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
    /// The model that was asked last, by what was done to it: fixing a graft takes as long as ten trials.
    last: RefCell<Option<(Done, Model)>>,
    /// The grafts of the last bands, by what was done and of so many samples.
    last_fixed: RefCell<Option<(Done, usize, Fixed)>>,
}

/// What is done to a knee before it is asked.
#[derive(Clone, Debug, PartialEq)]
struct Done {
    cut: Vec<String>,
    changed: Changed,
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
    /// Grafts in the order of fixing, which comes after the cuts; ends in CT. Their bundles follow the knee's own in every list.
    #[serde(default)]
    pub grafts: Vec<Graft>,
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
    /// Which knee.
    pub side: Side,
    /// Number of the bundle of each fibre.
    pub fibres: Vec<usize>,
    /// Rows of the 3 x 4 matrix that takes a point of the page to CT.
    pub ct: [f64; 12],
    /// What a graft is unless the reader says otherwise.
    pub graft: Offered,
}

/// A graft as it is offered; the numbers are those of `build-model plan`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Offered {
    /// [N/mm]
    pub stiffness_n_per_mm: f64,
    /// Least and most of it [N/mm].
    pub stiffnesses_n_per_mm: [f64; 2],
    /// [N]
    pub tension_n: f64,
    /// Least and most of it [N].
    pub tensions_n: [f64; 2],
}

/// A graft as it was fixed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GraftTold {
    /// Mean length of its fibres in the CT pose [mm].
    pub length_mm: f64,
    /// Slack length [mm].
    pub slack_length_mm: f64,
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
    /// The grafts as they were fixed.
    pub grafts: Vec<GraftTold>,
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
    /// How many of the others rest in another way than the most probable knee, in sentences.
    pub differing: Vec<String>,
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
        Ok(Knee {
            spec,
            model,
            meshes,
            samples,
            of_samples: OnceCell::new(),
            faces,
            axes,
            last: RefCell::default(),
            last_fixed: RefCell::default(),
        })
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
            side: self.spec.side,
            fibres: self.model.fibres.iter().map(|f| f.bundle).collect(),
            ct: rows(&self.axes.inverse()),
            graft: Offered {
                stiffness_n_per_mm: graft::STIFFNESS_N_PER_MM,
                stiffnesses_n_per_mm: graft::STIFFNESSES_N_PER_MM,
                tension_n: graft::TENSION_N,
                tensions_n: graft::TENSIONS_N,
            },
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
            flags: sentences(&result.flags),
            femur: rows(&(self.axes * pose.femur * self.axes.inverse())),
            fibres_n: fibres.iter().map(|f| f.response.force).collect(),
            pressure: self.faces.pressed(&model.contact, pose).by_surface,
            grafts: self.grafts(&model, &asked.grafts),
            evaluations: answer.evaluations,
        })
    }

    /// Mean and interval of every number of the answer, by at most `most` samples; what is done to the knee is done to each.
    ///
    /// # Errors
    /// As [`Knee::told`]; a knee without samples, or with effects that no sample has.
    pub fn bands(&self, asked: &Asked, most: usize) -> Result<Bands, String> {
        let samples = self.samples.as_ref().ok_or("this knee has no samples, so nothing has an interval")?;
        if !self.spec.components.is_empty() {
            return Err("what was added to the model is in its values and not in its samples: no intervals".into());
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
        let (searched, done) = (self.searched(samples)?, done(asked));
        let fixed = self.fixed(samples, &done, most)?;
        let found = samples.bands_changed(searched, &question, (&done.changed, &fixed)).map_err(|e| e.to_string())?;
        Ok(Bands {
            bands: found.rows.into_iter().flatten().collect(),
            asked: found.asked,
            lost: found.lost,
            leaving: found.leaving.into_iter().sum(),
            differing: found.kinds.iter().flat_map(|k| sentences(&k.flags(&result.flags, found.asked))).collect(),
        })
    }

    /// Grafts as the samples have them; those that were sought last are kept.
    fn fixed(&self, samples: &Samples, done: &Done, most: usize) -> Result<Fixed, String> {
        if let Some((of, count, fixed)) = &*self.last_fixed.borrow()
            && of == done
            && *count >= most
        {
            return Ok(fixed.clone());
        }
        let found = samples.fixed(self.searched(samples)?, (&done.changed, &done.cut), most);
        let found = found.map_err(|e| e.to_string())?;
        *self.last_fixed.borrow_mut() = Some((done.clone(), most, found.clone()));
        Ok(found)
    }

    /// The model that samples are asked of.
    fn searched(&self, samples: &Samples) -> Result<&Model, String> {
        if self.of_samples.get().is_none() {
            let model = samples.searched(&self.meshes).map_err(|e| e.to_string())?;
            let _ = self.of_samples.set(model);
        }
        self.of_samples.get().ok_or_else(|| "the samples have no model".to_owned())
    }

    /// The model with what is cut and changed; the last one is kept.
    fn model(&self, asked: &Asked) -> Result<Model, String> {
        let done = done(asked);
        if let Some((of, model)) = &*self.last.borrow()
            && *of == done
        {
            return Ok(model.clone());
        }
        let whole = done.changed.done_to(&self.model, &done.cut, None).map_err(|e| e.to_string())?;
        let model = whole.without(&done.cut).map_err(|e| e.to_string())?;
        *self.last.borrow_mut() = Some((done, model.clone()));
        Ok(model)
    }

    /// The grafts of a model as they were fixed.
    fn grafts(&self, model: &Model, grafts: &[Graft]) -> Vec<GraftTold> {
        let own = &model.bundles[self.model.bundles.len()..];
        let of = |(g, b): (&Graft, &sim::ligament::Bundle)| GraftTold {
            length_mm: sim::ligament::mean_length(&g.ends),
            slack_length_mm: b.slack_length(),
        };
        grafts.iter().zip(own).map(of).collect()
    }
}

/// What is done to the knee that is asked.
fn done(asked: &Asked) -> Done {
    let changed =
        Changed { strain: asked.strain.clone(), stiffness: asked.stiffness.clone(), grafts: asked.grafts.clone() };
    Done { cut: asked.cut.clone(), changed }
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

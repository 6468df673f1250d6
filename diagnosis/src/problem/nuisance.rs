//! Nuisance parameters: what is not known of the knee itself, beside any effect, with its priors.
//!
//! They are parameters of crate `inference`. A knee built from raw data has those of its calibration: ligaments, contact, sites, frames of all data sets
//! and of each. A published deck has its ligaments and its contact alone, near its own values.
//!
//! An unknown is the standard normal number of a parameter's prior, counted from where the model stands.

use crate::effect::belongs;
use crate::error::DiagnosisError;
use calibration::design::{Design, Kind, Variable};
use calibration::options::CalibrateOptions;
use inference::frames::{STEP, Terms, corrected};
use inference::knee::{Models, Quantity, models_at};
use inference::parameter::{Parameter, Prior};
use nalgebra::{Matrix6, Vector3};
use sim::Model;
use sim::coordinate::Six;
use sim::joint::Joint;
use sim::spec::{FramesSpec, ModelSpec};
use sim::uncertainty::FrameUncertainty;
use std::collections::BTreeMap;

/// Prior standard deviations about a published model's own parameters: reference strain [-], log of stiffness [-]; log of the contact's scale [-].
pub const PRIOR: [f64; 3] = [0.03, 0.2, 0.3];
/// Smallest standard deviation of a site that is an unknown of its own [mm]; less is in the scatter of each fibre's ends ([`crate::problem::covariance::Floor`]).
const LEAST_SITE_MM: f64 = 0.5;

/// The nuisance parameters of a model.
#[derive(Clone, Debug)]
pub struct Nuisances {
    /// What they are, with their priors.
    pub list: Vec<Parameter<Quantity>>,
    /// What each of them moves.
    pub(crate) felt: Vec<Felt>,
    /// Mean of each unknown's prior, from where the model stands [-]; the standard deviation is 1.
    pub mean: Vec<f64>,
    /// Where the model stands that was handed in, before the question was moved: its unknowns [-].
    pub given: Vec<f64>,
    /// The specification as assembled: sites and frames are counted from there.
    spec: ModelSpec,
    is_built: bool,
}

/// What a parameter of the knee moves in a trial: those kinds whose derivatives a diagnosis has ([`crate::problem::jacobian`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Felt {
    /// Numbers of the model.
    Model,
    /// A turn or shift of a frame: of one data set, or of all.
    Frame(Option<usize>, usize),
}

impl Felt {
    /// Of a quantity; none of those that a diagnosis has no derivative of. A parameter of those kinds is never an unknown here, so that none has a
    /// derivative of zero in silence.
    fn of(quantity: &Quantity) -> Option<Felt> {
        match quantity {
            Quantity::ReferenceStrain(_) | Quantity::Stiffness(_) | Quantity::ContactScale | Quantity::Site(..) => {
                Some(Felt::Model)
            }
            Quantity::Frame(source, term) => Some(Felt::Frame(*source, *term)),
            // in the scatter (crate::problem::covariance)
            Quantity::Cartilage | Quantity::Lean(..) => None,
            // of data sets of displacements, which a diagnosis leaves out
            Quantity::Compliance(..) | Quantity::Resting(..) => None,
        }
    }
}

impl Nuisances {
    /// Of a model and its specification, measured in some data sets; the priors of a built knee are those of its calibration.
    pub fn new(spec: &ModelSpec, design: &Design, sources: &[String], calibrate: &CalibrateOptions) -> Nuisances {
        let is_built = is_built(spec);
        let all = if is_built { of_a_built_knee(spec, design, sources, calibrate) } else { of_a_deck(spec, design) };
        let felt = |p: Parameter<Quantity>| Felt::of(&p.quantity).map(|felt| (p, felt));
        let (list, felt): (Vec<_>, Vec<_>) = all.into_iter().filter_map(felt).unzip();
        // from where the model as given stands, whose ligaments may lie anywhere in their priors
        let values = design.values(spec);
        let base = |(k, p): (usize, &Parameter<Quantity>)| values.get(k).map_or(0.0, |x| p.prior.z_of(*x));
        let mean = list.iter().enumerate().map(|p| -base(p)).collect();
        let given = vec![0.0; list.len()];
        Nuisances { list, felt, mean, given, spec: spec.clone(), is_built }
    }

    /// Number of parameters.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Whether sites or frames are unknown, as in a knee built from raw data.
    pub fn are_of_a_built_knee(&self) -> bool {
        self.is_built
    }

    /// Sum of squares of the distance from the prior's mean, in its standard deviations [-].
    pub fn squares(&self, unknowns: &[f64]) -> f64 {
        self.mean.iter().zip(unknowns).map(|(m, x)| (x - m) * (x - m)).sum()
    }

    /// The value of parameter `k`, and its derivative by the unknown.
    pub fn at(&self, k: usize, unknown: f64) -> (f64, f64) {
        self.list[k].prior.at(unknown - self.mean[k])
    }

    fn values(&self, unknowns: &[f64]) -> Vec<f64> {
        (0..self.len()).map(|k| self.at(k, unknowns[k]).0).collect()
    }

    /// Scale of the contact [-].
    pub fn contact_scale(&self, unknowns: &[f64]) -> f64 {
        let k = self.list.iter().position(|p| p.quantity == Quantity::ContactScale);
        k.map_or(1.0, |k| self.at(k, unknowns[k]).0)
    }

    /// Turns and shifts of a data set's frames at some values [deg, mm]; of those of all for none.
    fn terms(&self, unknowns: &[f64], of: Option<usize>) -> Terms {
        let mut terms = [0.0; 12];
        for (k, p) in self.list.iter().enumerate() {
            match p.quantity {
                Quantity::Frame(source, t) if source.is_none() || source == of => terms[t] += self.at(k, unknowns[k]).0,
                _ => {}
            }
        }
        terms
    }

    /// The frames of all data sets at some values.
    ///
    /// Errors: frames that make no joint.
    pub fn frames_at(&self, unknowns: &[f64]) -> Result<FramesSpec, DiagnosisError> {
        let terms = self.terms(unknowns, None);
        if terms.iter().all(|t| *t == 0.0) {
            return Ok(self.spec.frames.clone());
        }
        Ok(corrected(&self.spec.frames, self.spec.side, &terms)?)
    }

    /// The model as assembled at these values, in the frames of each data set.
    ///
    /// Errors: values out of the model's range.
    pub fn apply(&self, assembled: &Model, unknowns: &[f64]) -> Result<Models, DiagnosisError> {
        Ok(models_at(assembled, &self.spec, &self.list, &self.values(unknowns))?)
    }

    /// Which of them are of a structure's own bundles: their strain, stiffness and sites.
    pub(crate) fn of_structure(&self, structure: &str) -> Vec<usize> {
        let is_its = |b: &usize| self.spec.bundles.get(*b).is_some_and(|b| belongs(&b.name, structure));
        let of = |p: &Parameter<Quantity>| match &p.quantity {
            Quantity::ReferenceStrain(bundles) | Quantity::Stiffness(bundles) => bundles.iter().any(is_its),
            Quantity::Site(bundle, ..) => is_its(bundle),
            Quantity::ContactScale
            | Quantity::Frame(..)
            | Quantity::Cartilage
            | Quantity::Lean(..)
            | Quantity::Compliance(..)
            | Quantity::Resting(..) => false,
        };
        (0..self.len()).filter(|&k| of(&self.list[k])).collect()
    }

    /// The same parameters counted from some values.
    pub fn centred_at(&self, unknowns: &[f64]) -> Nuisances {
        let from = |of: &[f64]| of.iter().zip(unknowns).map(|(own, x)| own - x).collect();
        Nuisances { mean: from(&self.mean), given: from(&self.given), ..self.clone() }
    }

    /// Unknowns at which the parameters of these names have these values, and all others their prior's middle.
    pub fn at_values(&self, values: &BTreeMap<String, f64>) -> Vec<f64> {
        let of = |(p, m): (&Parameter<Quantity>, &f64)| values.get(&p.name).map_or(0.0, |x| p.prior.z_of(*x)) + m;
        self.list.iter().zip(&self.mean).map(of).collect()
    }

    /// Steps of the frames of each data set, then of all, about some values.
    pub(crate) fn joints(&self, unknowns: &[f64], sources: usize) -> Vec<FrameSteps> {
        let is_asked = |t: usize| self.list.iter().any(|p| matches!(p.quantity, Quantity::Frame(_, term) if term == t));
        let of = |source: Option<usize>| -> FrameSteps {
            let here = self.terms(unknowns, source);
            std::array::from_fn(|t| {
                let at = |by: f64| {
                    let mut terms = here;
                    terms[t] += by;
                    Joint::new(&corrected(&self.spec.frames, self.spec.side, &terms).ok()?, self.spec.side).ok()
                };
                if is_asked(t) { Some([at(STEP)?, at(-STEP)?]) } else { None }
            })
        };
        (0..sources).map(Some).chain([None]).map(of).collect()
    }
}

/// How far the frames of one data set stand from those of all at most [deg, mm], standard deviations; ours: the repeatability of a good laboratory. A
/// calibration may allow more, whatever the cause. Here more has a name: a frame turned or an origin shifted in one data set. Less is heard.
const OWN_FRAME: (f64, f64) = (0.5, 1.0);

/// Those of the calibration. Cartilage is in the scatter ([`crate::problem::covariance`]), and so are sites that are known well.
fn of_a_built_knee(
    spec: &ModelSpec,
    design: &Design,
    sources: &[String],
    calibrate: &CalibrateOptions,
) -> Vec<Parameter<Quantity>> {
    let mut options = calibrate.clone();
    let own = &mut options.frames;
    own.offset_turn_deg = own.offset_turn_deg.min(OWN_FRAME.0);
    own.offset_shift_mm = own.offset_shift_mm.min(OWN_FRAME.1);
    let mut list = calibration::unknowns::parameters(spec, design, sources, &options, None);
    list.retain(|p| match (&p.quantity, p.prior) {
        (Quantity::Site(..), Prior::Normal { sd, .. }) => sd > LEAST_SITE_MM,
        _ => true,
    });
    list
}

/// A deck's own values, and its contact.
fn of_a_deck(spec: &ModelSpec, design: &Design) -> Vec<Parameter<Quantity>> {
    let names: Vec<String> = spec.bundles.iter().map(|b| b.name.clone()).collect();
    let one = |(v, own): (&Variable, f64)| {
        let prior = match v.kind {
            Kind::ReferenceStrain => Prior::Normal { mean: own, sd: PRIOR[0] },
            Kind::StiffnessNPerMm => Prior::LogNormal { median: own.max(LEAST_STIFFNESS), log_sd: PRIOR[1] },
        };
        Parameter { name: v.name(), quantity: v.quantity(&names), prior }
    };
    let mut list: Vec<_> = design.variables.iter().zip(design.values(spec)).map(one).collect();
    let prior = Prior::LogNormal { median: 1.0, log_sd: PRIOR[2] };
    list.push(Parameter { name: "contact.scale".into(), quantity: Quantity::ContactScale, prior });
    list
}

/// A stiffness of nothing has no logarithm [N/mm].
const LEAST_STIFFNESS: f64 = 1e-3;

/// For each turn and shift that is unknown, the joint with the frame moved a little forward and back.
pub(crate) type FrameSteps = [Option<[Joint; 2]>; 12];

/// Whether a model is of a knee built from raw data: its frames are uncertain.
pub fn is_built(spec: &ModelSpec) -> bool {
    let of = |f: &FrameUncertainty| f.turn_deg.iter().chain(&f.shift_mm).any(|x| *x > 0.0);
    let stated = spec.uncertainty.as_ref().is_some_and(|u| of(&u.frames.femur) || of(&u.frames.tibia));
    stated && spec.frames.chain.is_none()
}

/// What a step of a frame changes at one pose of the femur, per degree or millimetre: the reading (Grood-Suntay coordinates [rad, mm]) and the generalised
/// force of a wrench.
pub(crate) fn frame_change(
    joints: &[Joint; 2],
    femur: &meshes::Isometry,
    wrench: &[Vector3<f64>; 2],
    read: &dyn Fn(&Six) -> Six,
) -> Option<(Six, Six)> {
    let at = |joint: &Joint| {
        let gs = joint.grood_suntay_of(femur);
        let pose = joint.pose(&joint.coordinates(&gs).ok()?);
        let force = Six::from_fn(|j, _| wrench[0].dot(&pose.screws[j].linear) + wrench[1].dot(&pose.screws[j].angular));
        Some((read(&gs), force))
    };
    let ([up, down], per) = ([at(&joints[0])?, at(&joints[1])?], 1.0 / (2.0 * STEP));
    Some(((up.0 - down.0) * per, (up.1 - down.1) * per))
}

/// Force and moment about the CT's origin whose generalised force is `force` at a pose.
pub(crate) fn wrench(pose: &sim::joint::Pose, force: &Six) -> Option<[Vector3<f64>; 2]> {
    let rows = Matrix6::from_fn(|j, c| if c < 3 { pose.screws[j].linear[c] } else { pose.screws[j].angular[c - 3] });
    let w = rows.try_inverse()? * force;
    Some([Vector3::new(w[0], w[1], w[2]), Vector3::new(w[3], w[4], w[5])])
}

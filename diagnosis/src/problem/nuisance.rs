//! Nuisance parameters: what is not known of the knee itself, beside any effect, with its priors.
//!
//! They are parameters of crate `inference`. A knee built from raw data has those of its calibration: ligaments, contact, sites, frames of all data sets
//! and of each. A published deck has its ligaments and its contact alone, near its own values.
//!
//! An unknown is the standard normal number of a parameter's prior, counted from where the model stands.

use crate::error::DiagnosisError;
use calibration::design::{Design, Kind, Variable};
use calibration::options::CalibrateOptions;
use inference::frames::{FrameSteps, Terms, corrected, frame_steps};
use inference::knee::{Models, Quantity, models_at};
use inference::parameter::{Parameter, Prior};
use sim::Model;
use sim::names::is_of;
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
    /// Mean of each unknown's prior, from where the model stands [-]; the standard deviation is 1.
    pub mean: Vec<f64>,
    /// Where the model stands that was handed in, before the question was moved: its unknowns [-].
    pub given: Vec<f64>,
    /// The specification as assembled: sites and frames are counted from there.
    spec: ModelSpec,
    is_built: bool,
}

/// Whether a quantity is an unknown of a diagnosis.
fn is_unknown(quantity: &Quantity) -> bool {
    match quantity {
        Quantity::ReferenceStrain(_)
        | Quantity::Stiffness(_)
        | Quantity::ContactScale
        | Quantity::Site(..)
        | Quantity::Frame(..) => true,
        // in the scatter (crate::problem::covariance)
        Quantity::Cartilage | Quantity::Lean(..) => false,
        // of data sets of displacements, which a diagnosis leaves out
        Quantity::Compliance(..) | Quantity::Resting(..) => false,
    }
}

impl Nuisances {
    /// Of a model and its specification, measured in some data sets; the priors of a built knee are those of its calibration.
    pub fn new(spec: &ModelSpec, design: &Design, sources: &[String], calibrate: &CalibrateOptions) -> Nuisances {
        let is_built = is_built(spec);
        let mut list =
            if is_built { of_a_built_knee(spec, design, sources, calibrate) } else { of_a_deck(spec, design) };
        list.retain(|p| is_unknown(&p.quantity));
        // from where the model as given stands, whose ligaments may lie anywhere in their priors
        let values = design.values(spec);
        let base = |(k, p): (usize, &Parameter<Quantity>)| values.get(k).map_or(0.0, |x| p.prior.z_of(*x));
        let mean = list.iter().enumerate().map(|p| -base(p)).collect();
        let given = vec![0.0; list.len()];
        Nuisances { list, mean, given, spec: spec.clone(), is_built }
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
        let is_its = |b: &usize| self.spec.bundles.get(*b).is_some_and(|b| is_of(&b.name, structure));
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
        let of = |source| frame_steps(&self.spec.frames, self.spec.side, &self.terms(unknowns, source), is_asked);
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

/// Whether a model is of a knee built from raw data: its frames are uncertain.
pub fn is_built(spec: &ModelSpec) -> bool {
    let of = |f: &FrameUncertainty| f.turn_deg.iter().chain(&f.shift_mm).any(|x| *x > 0.0);
    let stated = spec.uncertainty.as_ref().is_some_and(|u| of(&u.frames.femur) || of(&u.frames.tibia));
    stated && spec.frames.chain.is_none()
}

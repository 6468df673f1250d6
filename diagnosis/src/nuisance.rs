//! Nuisance parameters: what is not known of the knee itself, beside any effect, with its priors.
//!
//! Ligaments and the contact's scale are unknown in every model. A knee built from raw data also has attachment sites and frames that stand some
//! millimetres or degrees off; its `uncertainty` says how far. A published deck has neither.

use crate::error::DiagnosisError;
use calibration::design::{Design, Kind};
use inference::frames::{Terms, corrected};
use meshes::frame::Side;
use nalgebra::{Matrix3, Matrix6, Vector3};
use sim::Model;
use sim::joint::{Joint, Six};
use sim::model::BundleParameters;
use sim::spec::{FramesSpec, ModelSpec};
use sim::uncertainty::{ParameterPrior, Uncertainty};

/// Prior standard deviations about a published model's own parameters: reference strain [-], log of stiffness [-]; log of the contact's scale [-].
pub const PRIOR: [f64; 3] = [0.03, 0.2, 0.3];
/// Smallest standard deviation of a site that is an unknown of its own [mm]; less is in the scatter of each fibre's ends ([`crate::covariance::Floor`]).
const LEAST_SITE_MM: f64 = 0.5;

/// A nuisance parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nuisance {
    /// The design variable of this index: a reference strain or a log stiffness.
    Ligament(usize),
    /// The log of the contact's scale.
    Contact,
    /// A turn or shift of a frame, in the order of [`Terms`] [deg, mm].
    Frame(usize),
    /// A shift of a bundle's femoral (0) or tibial (1) end along an axis of the CT [mm].
    Site {
        /// Index of the bundle.
        bundle: usize,
        /// 0 femur, 1 tibia.
        end: usize,
        /// Axis of the CT frame.
        axis: usize,
    },
}

/// The nuisance parameters of a model with their priors. Values stand in units of `width`, 0 for the model they were made for.
#[derive(Clone, Debug)]
pub struct Nuisances {
    /// Which.
    pub list: Vec<Nuisance>,
    /// Prior standard deviation of each [-, -, deg, mm].
    pub width: Vec<f64>,
    /// Prior mean of each, in units of `width` [-].
    pub mean: Vec<f64>,
    /// The bundles of each design variable.
    bundles: Vec<Vec<usize>>,
    kinds: Vec<Kind>,
    /// Frames of the model.
    pub frames: FramesSpec,
    side: Side,
}

/// Mean and standard deviation of a prior.
fn moments(prior: ParameterPrior) -> (f64, f64) {
    match prior {
        ParameterPrior::Uniform { lower, upper } => (0.5 * (lower + upper), (upper - lower) / 12f64.sqrt()),
        ParameterPrior::Normal { mean, sd, .. } => (mean, sd),
    }
}

impl Nuisances {
    /// Of a compiled model and its specification.
    pub fn new(model: &Model, spec: &ModelSpec, design: &Design) -> Nuisances {
        let index = |name: &String| model.bundles.iter().position(|b| b.name == *name);
        let mut out = Nuisances {
            list: (0..design.variables.len()).map(Nuisance::Ligament).collect(),
            width: vec![],
            mean: vec![],
            bundles: design.variables.iter().map(|v| v.bundles.iter().filter_map(index).collect()).collect(),
            kinds: design.variables.iter().map(|v| v.kind).collect(),
            frames: spec.frames.clone(),
            side: spec.side,
        };
        let built = spec.uncertainty.as_ref().filter(|u| is_built(u) && spec.frames.chain.is_none());
        for k in 0..design.variables.len() {
            let (mean, width) = built.map_or((0.0, out.deck_width(k)), |u| out.ligament_prior(k, model, design, u));
            out.mean.push(mean);
            out.width.push(width);
        }
        out.add(Nuisance::Contact, built.map_or(PRIOR[2], |u| u.contact_log_scale.max(PRIOR[2])));
        let Some(u) = built else { return out };
        let frames = [&u.frames.femur, &u.frames.tibia];
        let sds = frames.iter().flat_map(|f| f.turn_deg.iter().chain(&f.shift_mm).copied());
        sds.enumerate().for_each(|(k, sd)| out.add(Nuisance::Frame(k), sd));
        for (bundle, b) in model.bundles.iter().enumerate() {
            let Some(site) = u.sites.get(&b.name) else { continue };
            for (end, sd) in
                [site.femur_mm, site.tibia_mm].into_iter().enumerate().filter(|(_, sd)| *sd > LEAST_SITE_MM)
            {
                (0..3).for_each(|axis| out.add(Nuisance::Site { bundle, end, axis }, sd));
            }
        }
        out
    }

    fn add(&mut self, nuisance: Nuisance, sd: f64) {
        if sd > 0.0 {
            self.list.push(nuisance);
            self.width.push(sd);
            self.mean.push(0.0);
        }
    }

    fn deck_width(&self, k: usize) -> f64 {
        if self.kinds[k] == Kind::StiffnessNPerMm { PRIOR[1] } else { PRIOR[0] }
    }

    /// Prior of a ligament parameter of a built knee: as the model states it, else Table 3's range taken as even; mean in units of the width, from the model.
    fn ligament_prior(&self, k: usize, model: &Model, design: &Design, u: &Uncertainty) -> (f64, f64) {
        let variable = &design.variables[k];
        let Some(&bundle) = self.bundles[k].first() else { return (0.0, self.deck_width(k)) };
        let stated = u.ligaments.get(&model.bundles[bundle].name);
        let range = ParameterPrior::Uniform { lower: variable.lower, upper: variable.upper };
        if variable.kind == Kind::StiffnessNPerMm {
            let (mean, sd) = moments(stated.and_then(|l| l.stiffness_n_per_mm).unwrap_or(range));
            let width = sd / mean;
            ((mean / model.bundles[bundle].stiffness).ln() / width, width)
        } else {
            let (mean, sd) = moments(stated.and_then(|l| l.reference_strain).unwrap_or(range));
            ((mean - model.bundles[bundle].reference_strain) / sd, sd)
        }
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
        self.list.iter().any(|n| matches!(n, Nuisance::Frame(_) | Nuisance::Site { .. }))
    }

    /// Sum of squares of the distance from the prior's mean, in its standard deviations [-].
    pub fn squares(&self, unknowns: &[f64]) -> f64 {
        self.mean.iter().zip(unknowns).map(|(m, x)| (x - m) * (x - m)).sum()
    }

    /// Place and width of the contact's scale.
    pub fn contact(&self) -> (usize, f64) {
        let k = self.list.iter().position(|n| *n == Nuisance::Contact).unwrap_or(self.bundles.len());
        (k, self.width[k])
    }

    /// Whether design variable `k` is a stiffness.
    pub fn is_stiffness(&self, k: usize) -> bool {
        self.kinds[k] == Kind::StiffnessNPerMm
    }

    /// The bundles of design variable `k`.
    pub fn bundles_of(&self, k: usize) -> &[usize] {
        &self.bundles[k]
    }

    /// Turns and shifts of the frames at some values [deg, mm].
    pub fn terms(&self, unknowns: &[f64]) -> Terms {
        let mut terms = [0.0; 12];
        for (k, n) in self.list.iter().enumerate() {
            if let Nuisance::Frame(t) = n {
                terms[*t] = self.width[k] * unknowns[k];
            }
        }
        terms
    }

    /// Frames at some values.
    ///
    /// Errors: frames that make no joint.
    pub fn frames_at(&self, unknowns: &[f64]) -> Result<FramesSpec, DiagnosisError> {
        let terms = self.terms(unknowns);
        if terms.iter().all(|t| *t == 0.0) {
            return Ok(self.frames.clone());
        }
        Ok(corrected(&self.frames, self.side, &terms)?)
    }

    /// A model with these values in place of its own.
    ///
    /// Errors: values out of the model's range.
    pub fn apply(&self, model: &Model, unknowns: &[f64]) -> Result<Model, DiagnosisError> {
        let mut parameters: Vec<BundleParameters> = model.parameters();
        let mut scale = 1.0;
        let mut moved: Vec<[Vector3<f64>; 2]> = vec![];
        for (k, n) in self.list.iter().enumerate() {
            let by = self.width[k] * unknowns[k];
            match *n {
                Nuisance::Ligament(v) => {
                    for &b in &self.bundles[v] {
                        match self.kinds[v] {
                            Kind::StiffnessNPerMm => parameters[b].stiffness_n_per_mm *= by.exp(),
                            _ => parameters[b].reference_strain += by,
                        }
                    }
                }
                Nuisance::Contact => scale = by.exp(),
                Nuisance::Frame(_) => {}
                Nuisance::Site { bundle, end, axis } => {
                    moved.resize(model.bundles.len(), [Vector3::zeros(); 2]);
                    moved[bundle][end][axis] += by;
                }
            }
        }
        let mut out = model.with_parameters(&parameters)?.with_contact_scale(scale)?;
        if !moved.is_empty() {
            for fibre in &mut out.fibres {
                let [femur, tibia] = moved[fibre.bundle];
                *fibre = crate::effect::moved_fibre(fibre, &femur, &tibia);
            }
        }
        let frames = self.frames_at(unknowns)?;
        if frames != self.frames {
            out.joint = Joint::new(&frames, self.side)?;
        }
        Ok(out)
    }

    /// The same parameters of the model at some values.
    ///
    /// Errors: frames that make no joint.
    pub fn centred_at(&self, unknowns: &[f64]) -> Result<Nuisances, DiagnosisError> {
        let mean = self.mean.iter().zip(unknowns).map(|(m, x)| m - x).collect();
        Ok(Nuisances { mean, frames: self.frames_at(unknowns)?, ..self.clone() })
    }

    /// Values of a calibrated version of the model: its ligaments and frames.
    pub fn values_of(&self, model: &Model, calibrated: &ModelSpec) -> Vec<f64> {
        let terms = turned(&self.frames, &calibrated.frames, self.side);
        let value = |(k, n): (usize, &Nuisance)| match *n {
            Nuisance::Ligament(v) => {
                let Some(&b) = self.bundles[v].first() else { return 0.0 };
                let own = &model.bundles[b];
                let Some(there) = calibrated.bundles.iter().find(|c| c.name == own.name) else { return 0.0 };
                match self.kinds[v] {
                    Kind::StiffnessNPerMm => (there.stiffness_n_per_mm.max(1e-3) / own.stiffness).ln() / self.width[k],
                    _ => (there.reference_strain - own.reference_strain) / self.width[k],
                }
            }
            Nuisance::Frame(t) => terms[t] / self.width[k],
            _ => 0.0,
        };
        self.list.iter().enumerate().map(value).map(|x| if x.is_finite() { x } else { 0.0 }).collect()
    }

    /// Pairs of joints with each frame turned or shifted a little either way from some values.
    pub(crate) fn joints(&self, unknowns: &[f64]) -> Vec<FrameStep> {
        let here = self.terms(unknowns);
        let joint = |t: usize, by: f64| {
            let mut terms = here;
            terms[t] += by;
            corrected(&self.frames, self.side, &terms).ok().and_then(|f| Joint::new(&f, self.side).ok())
        };
        let step = |(k, n): (usize, &Nuisance)| match *n {
            Nuisance::Frame(t) => {
                let joints = [joint(t, FRAME_STEP)?, joint(t, -FRAME_STEP)?];
                Some(FrameStep { joints, per: self.width[k] / (2.0 * FRAME_STEP) })
            }
            _ => None,
        };
        self.list.iter().enumerate().filter_map(step).collect()
    }
}

/// Turn [deg] or shift [mm] over which derivatives by frames are taken.
const FRAME_STEP: f64 = 0.02;

/// A frame turned or shifted a little either way.
pub(crate) struct FrameStep {
    /// The joint with the frame moved forward and back.
    pub joints: [Joint; 2],
    /// Turns the difference into a derivative by the scaled parameter.
    pub per: f64,
}

/// Whether a model's uncertainty is that of a knee built from raw data.
fn is_built(u: &Uncertainty) -> bool {
    let of = |f: &sim::uncertainty::FrameUncertainty| f.turn_deg.iter().chain(&f.shift_mm).any(|x| *x > 0.0);
    of(&u.frames.femur) || of(&u.frames.tibia)
}

/// Turns [deg] and shifts [mm] that lead from frames to others, each in its own axes.
fn turned(from: &FramesSpec, to: &FramesSpec, side: Side) -> Terms {
    let hand = if side == Side::Left { 1.0 } else { -1.0 };
    let mut out = [0.0; 12];
    for (b, (f, t)) in [(&from.femur, &to.femur), (&from.tibia, &to.tibia)].into_iter().enumerate() {
        let axes = |f: &meshes::frame::AnatomicalFrame| Matrix3::from_columns(&[f.medial, f.anterior, f.superior]);
        let (own, turn) = (axes(f), axes(t) * axes(f).transpose());
        let turn = nalgebra::Rotation3::from_matrix(&turn).scaled_axis();
        let (about, along) = (own.transpose() * turn * hand, own.transpose() * (t.origin - f.origin));
        for a in 0..3 {
            out[6 * b + a] = about[a].to_degrees();
            out[6 * b + 3 + a] = along[a];
        }
    }
    out
}

/// What a step of a frame changes at one pose of the femur: the reading (Grood-Suntay coordinates [rad, mm]) and the generalised force of a wrench.
pub(crate) fn frame_change(
    step: &FrameStep,
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
    let ([up, down], per) = ([at(&step.joints[0])?, at(&step.joints[1])?], step.per);
    Some(((up.0 - down.0) * per, (up.1 - down.1) * per))
}

/// Force and moment about the CT's origin whose generalised force is `force` at a pose.
pub(crate) fn wrench(pose: &sim::joint::Pose, force: &Six) -> Option<[Vector3<f64>; 2]> {
    let rows = Matrix6::from_fn(|j, c| if c < 3 { pose.screws[j].linear[c] } else { pose.screws[j].angular[c - 3] });
    let w = rows.try_inverse()? * force;
    Some([Vector3::new(w[0], w[1], w[2]), Vector3::new(w[3], w[4], w[5])])
}

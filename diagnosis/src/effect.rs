//! What each effect of the catalogue does: a generalised force beside the trial's load, or a change of what is read.

mod lines;
mod reading;
mod tissue;

pub(crate) use lines::pull;
pub(crate) use reading::turned;
pub(crate) use tissue::{fibre_pull, moved_fibre};

use crate::catalogue::Effect;
use crate::error::DiagnosisError;
use crate::trial::Trial;
use lines::{gastrocnemius, hamstring, iliotibial, patellar_tendon};
use meshes::frame::AnatomicalFrame;
use sim::Model;
use sim::joint::{AP, FE, IE, Pose, SI, Six, VV};

/// Anatomical frames of a model.
#[derive(Clone, Debug)]
pub struct Place {
    /// The femur's, in the CT pose.
    pub femur: AnatomicalFrame,
    /// The tibia's.
    pub tibia: AnatomicalFrame,
}

/// A pose of the knee in a trial, as an effect sees it.
pub struct Situation<'a> {
    /// The model.
    pub model: &'a Model,
    /// Frames.
    pub place: &'a Place,
    /// The trial.
    pub trial: &'a Trial,
    /// The load at this moment of it [N mm, N].
    pub load: &'a Six,
    /// Chain coordinates [rad, mm].
    pub q: Six,
    /// The pose they are.
    pub pose: Pose,
    /// Flexion [rad].
    pub flexion: f64,
}

impl Place {
    /// The situation at `q`.
    pub fn situation<'a>(&'a self, model: &'a Model, trial: &'a Trial, load: &'a Six, q: &Six) -> Situation<'a> {
        let flexion = q[FE] + model.joint.ct_pose()[FE];
        Situation { model, place: self, trial, load, q: *q, pose: model.joint.pose(q), flexion }
    }
}

/// An effect at work, with the values of its parameters in the units of the catalogue.
#[derive(Clone, Debug, PartialEq)]
pub struct Active {
    kind: Kind,
    /// Values of its parameters.
    pub values: Vec<f64>,
}

/// Which implementation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    FemurFrame,
    TibiaFrame,
    FlexionOffset,
    OriginShift,
    LoadBias,
    LoadGain,
    LoadSign(usize),
    LoadMisalign,
    JointCompression,
    Gravity,
    Compliance,
    CuffSoftening,
    Meniscus(usize),
    Capsule(usize),
    ExtraBundle(usize),
    MclWrap,
    PcapWrap,
    Loss(usize),
    Attachment(usize),
    Quadriceps,
    Hamstrings,
    Gastrocnemius,
    Iliotibial,
    Guarding,
    Friction,
    Viscoelastic,
    Preconditioning,
    Drift,
}

impl Active {
    /// An effect of the catalogue with values for its parameters.
    ///
    /// Errors: an effect without an implementation, another number of values than parameters.
    pub fn new(effect: &Effect, variant: usize, values: Vec<f64>) -> Result<Active, DiagnosisError> {
        use Kind::*;
        let kind = match effect.id.as_str() {
            "femur_frame" => FemurFrame,
            "tibia_frame" => TibiaFrame,
            "flexion_offset" => FlexionOffset,
            "origin_shift" => OriginShift,
            "load_bias" => LoadBias,
            "load_gain" => LoadGain,
            "load_sign" => LoadSign(variant),
            "load_misalign" => LoadMisalign,
            "joint_compression" => JointCompression,
            "gravity" => Gravity,
            "apparatus_compliance" | "bone_compliance" => Compliance,
            "cuff_softening" => CuffSoftening,
            "meniscus" => Meniscus(variant),
            "capsule_envelope" => Capsule(variant),
            "extra_bundle" => ExtraBundle(variant),
            "mcl_wrap" => MclWrap,
            "pcap_wrap" => PcapWrap,
            "structure_loss" => Loss(variant),
            "attachment" => Attachment(variant),
            "quad_passive" => Quadriceps,
            "ham_tone" => Hamstrings,
            "gastroc_tone" => Gastrocnemius,
            "itb" => Iliotibial,
            "guarding_reflex" => Guarding,
            "friction" => Friction,
            "viscoelastic" => Viscoelastic,
            "preconditioning" => Preconditioning,
            "drift" => Drift,
            other => return Err(DiagnosisError::Component(format!("no effect is implemented under {other:?}"))),
        };
        if values.len() != effect.parameter.len() {
            return Err(DiagnosisError::Component(format!(
                "{} has {} parameters, {} values given",
                effect.id,
                effect.parameter.len(),
                values.len()
            )));
        }
        Ok(Active { kind, values })
    }

    /// The effect with other values.
    pub fn with(&self, values: &[f64]) -> Active {
        Active { kind: self.kind, values: values.to_vec() }
    }

    /// Whether it adds a force.
    pub fn has_force(&self) -> bool {
        !self.has_reading()
    }

    /// Whether it changes what is read.
    pub fn has_reading(&self) -> bool {
        use Kind::*;
        matches!(self.kind, FemurFrame | TibiaFrame | FlexionOffset | OriginShift | Compliance | CuffSoftening)
    }

    /// Whether it departs from the unloaded pose of each flexion, wherever the knee's ligaments put that.
    pub fn is_about_unloaded(&self) -> bool {
        matches!(self.kind, Kind::Meniscus(0) | Kind::Capsule(0))
    }

    /// Whether its parameters must be stepped far to be felt (no slope at zero).
    pub fn has_no_slope_at_zero(&self) -> bool {
        matches!(self.kind, Kind::MclWrap | Kind::PcapWrap)
    }

    /// Generalised force [N mm, N].
    pub fn force(&self, here: &Situation) -> Six {
        let v = &self.values;
        let mut out = Six::zeros();
        match self.kind {
            Kind::LoadBias => (out[AP], out[IE]) = (v[0], v[1] * 1000.0),
            Kind::LoadGain => out = here.load * v[0],
            Kind::LoadSign(axis) => {
                let j = [VV, IE, AP][axis.min(2)];
                out[j] = -2.0 * v[0] * here.load[j];
            }
            Kind::LoadMisalign => out[IE] = here.load[AP] * v[0],
            Kind::JointCompression => out[SI] = v[0],
            Kind::Gravity => (out[AP], out[VV]) = (-v[0] * here.flexion.sin(), v[0] * v[1]),
            Kind::Drift => {
                let t = here.trial.time.unwrap_or(0.0);
                (out[AP], out[IE]) = (v[0] * t, v[1] * 1000.0 * t);
            }
            Kind::Friction => {
                let s = here.trial.branch.unwrap_or(0.0);
                let way = |load: f64| if load == 0.0 { 0.0 } else { load.signum() };
                out[AP] = -s * v[0] * way(here.load[AP]);
                out[IE] = -s * v[1] * 1000.0 * way(here.load[IE]);
            }
            Kind::Quadriceps => out = patellar_tendon(here, v[1], v[2]) * v[0],
            Kind::Hamstrings => out = hamstring(here, true) * v[0] + hamstring(here, false) * v[1],
            Kind::Gastrocnemius => out = gastrocnemius(here) * v[0],
            Kind::Iliotibial => out = iliotibial(here) * v[0],
            Kind::Guarding => {
                let over = (here.load[AP].abs() - 40.0).max(0.0) * v[0];
                out = (patellar_tendon(here, 0.0, 0.0) + hamstring(here, true) * 0.5 + hamstring(here, false) * 0.5)
                    * over;
            }
            Kind::Meniscus(about) => out = tissue::meniscus(here, about, v),
            Kind::Capsule(about) => out = tissue::capsule(here, about, v),
            Kind::ExtraBundle(line) => out = tissue::extra_bundle(here, line, v),
            Kind::MclWrap => out = tissue::mcl_wrap(here, v[0]),
            Kind::PcapWrap => out = tissue::pcap_wrap(here, v[0]),
            Kind::Loss(structure) => out = tissue::loss(here, structure, v[0]),
            Kind::Attachment(structure) => out = tissue::attachment(here, structure, v),
            Kind::Viscoelastic => out = tissue::all_fibres(here) * (v[0] * here.trial.branch.unwrap_or(0.0)),
            Kind::Preconditioning => {
                let spent = 1.0 - (-3.0 * here.trial.order.unwrap_or(0.0)).exp();
                out = tissue::strain_change(here, -0.01 * v[0] * spent);
            }
            _ => {}
        }
        out
    }

    /// What is read where the true pose is `gs` [rad, mm].
    pub fn read(&self, gs: &Six, trial: &Trial, _place: &Place) -> Six {
        let v = &self.values;
        let mut out = *gs;
        match self.kind {
            Kind::FemurFrame => out = reading::turned(gs, v[0].to_radians(), v[1].to_radians(), true),
            Kind::TibiaFrame => out = reading::turned(gs, v[0].to_radians(), v[1].to_radians(), false),
            Kind::FlexionOffset => out[FE] -= v[0].to_radians(),
            Kind::OriginShift => (0..3).for_each(|i| out[3 + i] += v[i]),
            Kind::Compliance => {
                out[AP] += v[0] * trial.load[AP] / 100.0;
                out[IE] += v[1].to_radians() * trial.load[IE] / 1000.0;
                out[VV] += v[2].to_radians() * trial.load[VV] / 1000.0;
            }
            Kind::CuffSoftening => {
                out[AP] += v[0] * (trial.load[AP] / 20.0).tanh();
                out[IE] += v[1].to_radians() * (trial.load[IE] / 500.0).tanh();
            }
            _ => {}
        }
        out
    }
}

//! What each effect of the catalogue does: a generalised force beside the trial's load, or a change of what is read.
//!
//! An effect is a small type in a file of its own. Its fields have the names of the parameters in its row of the catalogue.

mod attachment;
pub mod bench;
pub mod candidate;
mod capsule_envelope;
pub mod catalogue;
mod compliance;
mod cuff_softening;
mod drift;
mod extra_bundle;
mod fibres;
mod flexion_offset;
mod foot_turn;
mod friction;
mod gastroc_tone;
mod gravity;
mod guarding_reflex;
mod ham_tone;
mod itb;
mod joint_compression;
mod lines;
mod load_axis;
mod load_bias;
mod load_gain;
mod load_misalign;
mod load_sign;
mod mcl_wrap;
mod meniscus;
mod origin_shift;
mod pcap_wrap;
mod preconditioning;
mod quad_passive;
mod row;
mod strap_tissue;
mod structure_loss;
mod turned_frame;
mod viscoelastic;
pub(crate) mod ways;

pub(crate) use fibres::fibre_pull;
pub(crate) use lines::pull;
pub(crate) use turned_frame::turned;

use crate::effect::catalogue::Effect;
use crate::error::DiagnosisError;
use inference::trial::Trial;
use meshes::frame::AnatomicalFrame;
use row::Fields;
use serde::de::DeserializeOwned;
use serde::de::value::Error as RowError;
use sim::Model;
use sim::coordinate::{FE, Six};
use sim::joint::Pose;
use std::fmt::Debug;
use std::sync::Arc;

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
    pub load: Six,
    /// Chain coordinates [rad, mm].
    pub q: Six,
    /// The pose they are.
    pub pose: Pose,
    /// Flexion [rad].
    pub flexion: f64,
}

impl Place {
    /// The situation at `q`.
    pub fn situation<'a>(&'a self, model: &'a Model, trial: &'a Trial, load: &Six, q: &Six) -> Situation<'a> {
        let flexion = q[FE] + model.joint.ct_pose()[FE];
        Situation { model, place: self, trial, load: *load, q: *q, pose: model.joint.pose(q), flexion }
    }
}

/// An effect that pushes or pulls.
pub trait Force: Debug + Send + Sync {
    /// Generalised force [N mm, N].
    fn force(&self, here: &Situation) -> Six;
    /// Whether it departs from the unloaded pose of each flexion, wherever the knee's ligaments put that.
    fn is_about_unloaded(&self) -> bool {
        false
    }
    /// Whether it is the same in every trial of a data set: it knows the pose alone.
    fn is_of_the_knee(&self) -> bool {
        false
    }
    /// Tension of the quadriceps [N] by which the model itself does in a trial what this effect does; where it is not zero the effect is no force
    /// beside the model.
    fn tension(&self, _model: &Model, _trial: &Trial) -> f64 {
        0.0
    }
    /// Share of its force that a bundle of this name loses [-].
    fn lost(&self, _bundle: &str) -> f64 {
        0.0
    }
    /// Whether its parameters must be stepped far to be felt (no slope at zero).
    fn has_no_slope_at_zero(&self) -> bool {
        false
    }
}

/// An effect that changes what is read.
pub trait Reading: Debug + Send + Sync {
    /// What is read where the true pose is `gs` [rad, mm].
    fn read(&self, gs: &Six, trial: &Trial) -> Six;
}

/// An effect at work, with values for its parameters.
#[derive(Clone, Debug)]
pub enum Active {
    /// A force beside the trial's load.
    Force(Arc<dyn Force>),
    /// A change of what is read.
    Reading(Arc<dyn Reading>),
}

type Make = fn(Fields) -> Result<Active, RowError>;

/// The type of each effect by its name in the catalogue.
const TYPES: [(&str, Make); 32] = [
    ("apparatus_compliance", reading::<compliance::Compliance>),
    ("attachment", force::<attachment::Attachment>),
    ("bone_compliance", reading::<compliance::Compliance>),
    ("capsule_envelope", force::<capsule_envelope::CapsuleEnvelope>),
    ("cuff_softening", reading::<cuff_softening::CuffSoftening>),
    ("drift", force::<drift::Drift>),
    ("extra_bundle", force::<extra_bundle::ExtraBundle>),
    ("femur_frame", reading::<turned_frame::FemurFrame>),
    ("flexion_offset", reading::<flexion_offset::FlexionOffset>),
    ("foot_turn", reading::<foot_turn::FootTurn>),
    ("friction", force::<friction::Friction>),
    ("gastroc_tone", force::<gastroc_tone::GastrocTone>),
    ("gravity", force::<gravity::Gravity>),
    ("guarding_reflex", force::<guarding_reflex::GuardingReflex>),
    ("ham_tone", force::<ham_tone::HamTone>),
    ("itb", force::<itb::Itb>),
    ("joint_compression", force::<joint_compression::JointCompression>),
    ("load_axis", force::<load_axis::LoadAxis>),
    ("load_bias", force::<load_bias::LoadBias>),
    ("load_gain", force::<load_gain::LoadGain>),
    ("load_misalign", force::<load_misalign::LoadMisalign>),
    ("load_sign", force::<load_sign::LoadSign>),
    ("mcl_wrap", force::<mcl_wrap::MclWrap>),
    ("meniscus", force::<meniscus::Meniscus>),
    ("origin_shift", reading::<origin_shift::OriginShift>),
    ("pcap_wrap", force::<pcap_wrap::PcapWrap>),
    ("preconditioning", force::<preconditioning::Preconditioning>),
    ("quad_passive", force::<quad_passive::QuadPassive>),
    ("strap_tissue", reading::<strap_tissue::StrapTissue>),
    ("structure_loss", force::<structure_loss::StructureLoss>),
    ("tibia_frame", reading::<turned_frame::TibiaFrame>),
    ("viscoelastic", force::<viscoelastic::Viscoelastic>),
];

fn force<T: Force + DeserializeOwned + 'static>(fields: Fields) -> Result<Active, RowError> {
    Ok(Active::Force(Arc::new(T::deserialize(fields)?)))
}

fn reading<T: Reading + DeserializeOwned + 'static>(fields: Fields) -> Result<Active, RowError> {
    Ok(Active::Reading(Arc::new(T::deserialize(fields)?)))
}

impl Active {
    /// An effect of the catalogue with values for its parameters, in the catalogue's order and units.
    ///
    /// Errors: an effect without a type, a row whose parameters or variants are not those of its type, another number of values.
    pub fn new(effect: &Effect, variant: usize, values: &[f64]) -> Result<Active, DiagnosisError> {
        let wrong = |what: String| Err(DiagnosisError::Component(what));
        let Ok(at) = TYPES.binary_search_by_key(&effect.id.as_str(), |t| t.0) else {
            return wrong(format!("no effect is implemented under {:?}", effect.id));
        };
        let wanted = effect.parameter.len();
        if values.len() != wanted {
            return wrong(format!("{} has {wanted} parameters, {} values given", effect.id, values.len()));
        }
        TYPES[at].1(row::fields(effect, variant, values)).or_else(|e| wrong(format!("{}: {e}", effect.id)))
    }

    /// [`Force::tension`]; a reading has none.
    pub fn tension(&self, model: &Model, trial: &Trial) -> f64 {
        match self {
            Active::Force(f) => f.tension(model, trial),
            Active::Reading(_) => 0.0,
        }
    }

    /// Share of its force that a bundle of this name loses by it [-].
    pub fn lost(&self, bundle: &str) -> f64 {
        match self {
            Active::Force(f) => f.lost(bundle),
            Active::Reading(_) => 0.0,
        }
    }

    /// Whether it adds a force.
    pub fn has_force(&self) -> bool {
        matches!(self, Active::Force(_))
    }

    /// Whether it changes what is read.
    pub fn has_reading(&self) -> bool {
        matches!(self, Active::Reading(_))
    }

    /// [`Force::is_about_unloaded`]; a reading departs from no pose.
    pub fn is_about_unloaded(&self) -> bool {
        matches!(self, Active::Force(f) if f.is_about_unloaded())
    }

    /// [`Force::is_of_the_knee`]; a reading is of an apparatus.
    pub fn is_of_the_knee(&self) -> bool {
        matches!(self, Active::Force(f) if f.is_of_the_knee())
    }

    /// [`Force::has_no_slope_at_zero`]; a reading has one.
    pub fn has_no_slope_at_zero(&self) -> bool {
        matches!(self, Active::Force(f) if f.has_no_slope_at_zero())
    }

    /// Generalised force [N mm, N].
    pub fn force(&self, here: &Situation) -> Six {
        match self {
            Active::Force(f) => f.force(here),
            Active::Reading(_) => Six::zeros(),
        }
    }

    /// What is read where the true pose is `gs` [rad, mm].
    pub fn read(&self, gs: &Six, trial: &Trial) -> Six {
        match self {
            Active::Force(_) => *gs,
            Active::Reading(r) => r.read(gs, trial),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::catalogue::Catalogue;
    use sim::coordinate::{AP, IE, Load};
    use sim::laxity::{LaxityTrial, Test};

    /// A trial under loads of every axis, all of one sign.
    fn loaded(sign: f64) -> Trial {
        let load = Load::new(8.0 * sign, 5.0 * sign, 30.0 * sign, 100.0 * sign, 20.0);
        Trial::alone(LaxityTrial::asked("a".into(), Test::Anterior, 30.0, load))
    }

    /// A pose in clinical coordinates: it has no side [rad, mm].
    const POSE: Six = Six::new(0.52, 0.05, -0.2, 1.5, 9.0, -21.0);

    #[test]
    fn a_misreading_of_no_size_changes_nothing_and_a_small_one_goes_with_its_size() {
        let catalogue = Catalogue::shipped();
        let mut asked = 0;
        for effect in &catalogue.effect {
            let sizes = effect.parameter.len();
            let of = |values: &[f64]| Active::new(effect, 0, values).unwrap();
            if sizes == 0 || !of(&vec![0.0; sizes]).has_reading() {
                continue;
            }
            for trial in [-1.0, 1.0].map(loaded) {
                let none = of(&vec![0.0; sizes]).read(&POSE, &trial);
                assert!((none - POSE).amax() < 1e-12, "{}: {none}", effect.id);
                for (k, p) in effect.parameter.iter().enumerate() {
                    let by = |share: f64| {
                        let mut values = vec![0.0; sizes];
                        values[k] = share * p.sd;
                        of(&values).read(&POSE, &trial) - POSE
                    };
                    // the slope at nothing, which a screen takes, is that of small sizes to either side
                    let [less, more] = [-1e-3, 1e-3].map(by);
                    assert!((less + more).amax() < 1e-5, "{} {}: {less} {more}", effect.id, p.key);
                    asked += usize::from(more.amax() > 0.0);
                }
            }
        }
        assert!(asked > 20, "{asked} sizes were felt");
    }

    #[test]
    fn tissue_under_a_strap_gives_way_forwards_alone_and_a_foot_turns_each_way_by_its_own() {
        let catalogue = Catalogue::shipped();
        let read = |name: &str, values: &[f64], sign: f64| {
            let (effect, variant) = catalogue.find(name).unwrap();
            Active::new(effect, variant, values).unwrap().read(&POSE, &loaded(sign)) - POSE
        };
        assert!((read("strap_tissue", &[4.0, 1.0], 1.0)[AP] - 5.0).abs() < 1e-12);
        assert!((read("strap_tissue", &[4.0, 1.0], -1.0)[AP] - 1.0).abs() < 1e-12);
        let turns = |sign: f64| read("foot_turn", &[6.0, 9.0], sign)[IE].to_degrees();
        // at 5 N m most of it has turned
        assert!(turns(1.0) > 4.5 && turns(1.0) < 6.0 && turns(-1.0) < -6.75 && turns(-1.0) > -9.0, "{}", turns(-1.0));
    }

    #[test]
    fn every_row_has_a_type_and_every_type_a_row() {
        let catalogue = Catalogue::shipped();
        let acting = || catalogue.effect.iter().filter(|e| !e.parameter.is_empty());
        for effect in acting() {
            for variant in 0..effect.variants.len().max(1) {
                let values = vec![0.0; effect.parameter.len()];
                Active::new(effect, variant, &values).unwrap_or_else(|e| panic!("{e}"));
                let error = Active::new(effect, variant, &[values, vec![0.0]].concat()).unwrap_err();
                assert!(error.to_string().contains("values given"), "{error}");
            }
            let mut other = effect.clone();
            other.parameter[0].key = "poltergeist".into();
            let error = Active::new(&other, 0, &vec![0.0; other.parameter.len()]).unwrap_err().to_string();
            assert!(error.contains(&effect.id) && error.contains("poltergeist"), "{error}");
        }
        let mut rows: Vec<&str> = acting().map(|e| e.id.as_str()).collect();
        rows.sort_unstable();
        assert_eq!(rows, TYPES.map(|t| t.0));
    }
}

//! model.json (FORMAT 3): everything a simulation needs, as data.

pub mod meniscus;
mod patella;

use crate::coordinate::{Free, Six};
pub use meniscus::{HornSpec, MeniscusMaterial, MeniscusSpec, SectionSpec};
use meshes::frame::{AnatomicalFrame, Side};
pub use patella::{BandSpec, EndsSpec, HeadSpec, PatellaContactSpec, PatellaSource, PatellaSpec, QuadricepsSpec};
use serde::{Deserialize, Serialize};

/// model.json. Mesh paths are relative to the file's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelSpec {
    /// "model/1".
    pub schema: String,
    /// Specimen name.
    pub id: String,
    /// Which knee.
    pub side: Side,
    /// The units of the numbers below.
    pub units: Units,
    /// Anatomical frames and the pose in CT.
    pub frames: FramesSpec,
    /// Rigid bodies and their meshes.
    pub bodies: Vec<BodySpec>,
    /// Cartilage contact.
    pub contact: ContactSpec,
    /// Ligament bundles.
    pub bundles: Vec<BundleSpec>,
    /// Ligament fibres, CT frame.
    pub fibres: Vec<FibreSpec>,
    /// Which ligaments wrap over which bones; absent: every fibre is straight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wrap: Option<WrapSpec>,
    /// Menisci that act; without them the femur meets the tibia alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub menisci: Vec<MeniscusSpec>,
    /// Where the tabular law's last point lies, in multiples of the toe's end, by bundle where it differs.
    #[serde(default)]
    pub toe_end_multiple: std::collections::BTreeMap<String, f64>,
    /// Steps a deck brought along, kept as they were read.
    #[serde(default)]
    pub protocols: Vec<crate::deck::DeckProtocol>,
    /// Effects added by the discrepancy workflow.
    #[serde(default)]
    pub components: Vec<serde_json::Value>,
    /// What the build does not know, as standard deviations; absent: the defaults of [`crate::uncertainty::Uncertainty::of_deck`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<crate::uncertainty::Uncertainty>,
    /// The patellofemoral joint; absent: none acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patella: Option<PatellaSpec>,
    /// What its ligaments were calibrated to; absent: they were not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<CalibratedSpec>,
    /// What could not be placed.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// Ligaments that wrap over bone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WrapSpec {
    /// Bodies whose bone is in the way: "femur", "tibia".
    pub over: Vec<String>,
    /// Bundles whose fibres wrap.
    pub bundles: Vec<String>,
}

impl ModelSpec {
    /// The bones over which ligaments wrap: a simulation needs them.
    pub fn wrapped_bones(&self) -> impl Iterator<Item = &String> {
        let over = |b: &&BodySpec| self.wrap.iter().any(|w| w.over.contains(&b.name));
        self.bodies.iter().filter(over).map(|b| &b.bone)
    }
}

/// Where a calibrated model comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibratedSpec {
    /// The data sets that it was calibrated to, together.
    pub to: Vec<String>,
    /// blake3 digest of the model.json that it was calibrated from.
    pub from: String,
    /// How far the trials of those data sets reached; absent in models of before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach: Option<ReachSpec>,
    /// What other knees gave as its prior; absent: nothing did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shared_prior: Option<SharedPriorSpec>,
}

/// A prior that other knees gave a calibration. What such a model tells is not independent of those knees.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SharedPriorSpec {
    /// Name of its file; absent where its text was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// blake3 digest of that file as `cohort infer` wrote it.
    pub digest: String,
    /// The knees whose data are in it: id and side of each.
    pub from: Vec<String>,
    /// Numbers of which it tells anything.
    pub numbers: usize,
}

/// Least and most of the flexions and loads of a calibration's trials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReachSpec {
    /// Flexion [deg].
    pub flexion_deg: [f64; 2],
    /// Load along VV [N m].
    pub vv_nm: [f64; 2],
    /// Load along IE [N m].
    pub ie_nm: [f64; 2],
    /// Load along ML [N].
    pub ml_n: [f64; 2],
    /// Load along AP [N].
    pub ap_n: [f64; 2],
    /// Load along SI [N].
    pub si_n: [f64; 2],
}

/// Unit names, stated so that a reader need not guess.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Units {
    /// "mm"
    pub length: String,
    /// "N"
    pub force: String,
    /// "MPa"
    pub pressure: String,
    /// "deg"
    pub angle: String,
}

/// Frames as in 05-frames/frames.json.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FramesSpec {
    /// The femur's.
    pub femur: AnatomicalFrame,
    /// The tibia's.
    pub tibia: AnatomicalFrame,
    /// Grood-Suntay pose in CT, clinical signs.
    pub gs_ct_pose: PoseSpec,
    /// The joint chain's axes as a deck gives them (their nodes are rounded); from the frames where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chain: Option<ChainSpec>,
    /// Frames along whose axes distances from the surfaces are tabulated, where a calibration turned or shifted the frames above; absent: those above.
    /// The contact of a calibrated model is so that of the model it began from, to the last digit, in the frames of every data set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridSpec>,
}

/// Frames along whose axes distances are tabulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GridSpec {
    /// The femur's.
    pub femur: AnatomicalFrame,
    /// The tibia's.
    pub tibia: AnatomicalFrame,
}

impl FramesSpec {
    /// Frames along whose axes distances from the surfaces are tabulated.
    pub fn tabulated(&self) -> GridSpec {
        self.grid.unwrap_or(GridSpec { femur: self.femur, tibia: self.tibia })
    }
}

/// Grood-Suntay coordinates, clinical signs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseSpec {
    /// Flexion [deg].
    pub fe_deg: f64,
    /// Valgus [deg].
    pub vv_deg: f64,
    /// External [deg].
    pub ie_deg: f64,
    /// Lateral [mm].
    pub ml_mm: f64,
    /// Anterior [mm].
    pub ap_mm: f64,
    /// Superior [mm].
    pub si_mm: f64,
}

impl PoseSpec {
    /// The five coordinates that are free when flexion is prescribed: VV, IE [deg], ML, AP, SI [mm].
    pub fn free(&self) -> Free<f64> {
        Free([self.vv_deg, self.ie_deg, self.ml_mm, self.ap_mm, self.si_mm])
    }

    /// The same moved by `by` [deg, mm].
    pub fn moved(mut self, by: &Free<f64>) -> PoseSpec {
        let all = [&mut self.vv_deg, &mut self.ie_deg, &mut self.ml_mm, &mut self.ap_mm, &mut self.si_mm];
        all.into_iter().zip(by).for_each(|(x, by)| *x += by);
        self
    }

    /// As the solver has it [rad, mm].
    pub fn six(&self) -> Six {
        let turns = [self.fe_deg, self.vv_deg, self.ie_deg].map(f64::to_radians);
        Six::new(turns[0], turns[1], turns[2], self.ml_mm, self.ap_mm, self.si_mm)
    }
}

/// The three cylindrical joints' axes in the CT pose: a point [mm] and a unit direction each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChainSpec {
    /// Superior-inferior axis, fixed in the tibia.
    pub si: AxisSpec,
    /// Floating axis.
    pub ap: AxisSpec,
    /// Medial-lateral axis, fixed in the femur.
    pub ml: AxisSpec,
}

/// An axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisSpec {
    /// A point of it [mm].
    #[schemars(with = "[f64; 3]")]
    pub point: meshes::Point,
    /// Its unit direction.
    #[schemars(with = "[f64; 3]")]
    pub direction: meshes::Vector,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodySpec {
    /// "femur" (moves), "tibia" (fixed, with the fibula), or what is carried along and no solver knows: "patella",
    /// "patellar_cartilage", "meniscus_medial", "meniscus_lateral".
    pub name: String,
    /// Bone surface (PLY).
    pub bone: String,
    /// Cartilage meshes (VTU) fixed to it.
    pub cartilage: Vec<String>,
    /// Mass for explicit dynamics [tonne].
    pub mass_tonne: f64,
    /// Rotary inertia for explicit dynamics [tonne mm2].
    pub inertia_tonne_mm2: f64,
}

impl BodySpec {
    /// Whether simulations know it.
    pub fn acts(&self) -> bool {
        !["patella", "patellar_cartilage", "meniscus_medial", "meniscus_lateral"].contains(&self.name.as_str())
    }
}

/// Rigid cartilage with tabular pressure-overclosure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactSpec {
    /// Table: overclosure [mm], ascending.
    pub overclosure_mm: Vec<f64>,
    /// Table: pressure [MPa]; the last slope is continued.
    pub pressure_mpa: Vec<f64>,
    /// Coulomb friction coefficient [-].
    pub friction: f64,
    /// Contact damping, fraction of critical [-].
    pub damping: f64,
    /// Which articular surfaces meet.
    pub pairs: Vec<PairSpec>,
    /// Contact by the cartilages' own thickness; absent: the table rules.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layer: Option<LayerSpec>,
}

impl ContactSpec {
    /// Multiplies what the law presses at every overclosure by `factor` [-].
    pub fn scale_pressure(&mut self, factor: f64) {
        self.pressure_mpa.iter_mut().for_each(|p| *p *= factor);
        if let Some(layer) = &mut self.layer {
            layer.youngs_modulus_mpa *= factor;
        }
    }

    /// The meshes that it names: articular faces, then bony faces.
    pub fn meshes(&self) -> impl Iterator<Item = &String> {
        let faces = self.pairs.iter().flat_map(|p| [&p.femur, &p.tibia]);
        faces.chain(self.layer.iter().flat_map(|l| l.bony_faces.values()))
    }
}

/// Elastic foundation by local thickness: cartilage as thin elastic layers bonded to bone. It stands in place of the table, whose first
/// overclosure still says where contact begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LayerSpec {
    /// How pressure follows from the layers' strain.
    pub law: LayerLaw,
    /// Young's modulus of both cartilages [MPa].
    pub youngs_modulus_mpa: f64,
    /// Their Poisson's ratio [-], below 0.5.
    pub poissons_ratio: f64,
    /// How far in from a contact patch's edge cartilage gives way sideways, in thicknesses [-]; 0: thin layer theory, in which it does not.
    pub edge_spread: f64,
    /// A layer is nowhere taken thinner than this [mm].
    pub least_thickness_mm: f64,
    /// The face on bone (PLY, outward normals or reverse) of each articular mesh. A mesh without one is bare bone, which does not give way.
    pub bony_faces: std::collections::BTreeMap<String, String>,
}

/// Pressure over the strain of a bonded layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LayerLaw {
    /// In proportion to strain [blankevoort1991b].
    Linear,
    /// By the logarithm of what is left of the thickness, for large strain [bei2004].
    Logarithmic,
}

/// A contact pair: articular surfaces (PLY, triangles, outward normals, open patches).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairSpec {
    /// The femoral mesh.
    pub femur: String,
    /// The tibial mesh.
    pub tibia: String,
}

/// A ligament's force law.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// Quadratic toe, then linear [blankevoort1991].
    Smooth,
    /// Linear interpolation between the deck's points.
    Tabular,
}

impl Law {
    /// Every law; what must hold of one is tested of all.
    pub const ALL: [Law; 2] = [Law::Smooth, Law::Tabular];
}

/// A ligament bundle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BundleSpec {
    /// Bundle name.
    pub name: String,
    /// Ratio of length to slack length in the CT pose [-].
    pub reference_strain: f64,
    /// Of the whole bundle [N/mm].
    pub stiffness_n_per_mm: f64,
    /// L_bundle: the length the slack length derives from [mm].
    pub reference_length_mm: f64,
    /// Toe strain [-].
    pub toe_strain: f64,
    /// Force law.
    pub law: Law,
    /// Dashpot of each fibre, also when slack [N s/mm]; 0.05 in the published decks.
    #[serde(default = "fibre_damping")]
    pub damping_n_s_per_mm: f64,
}

/// The published decks' dashpot of a fibre [N s/mm].
pub fn fibre_damping() -> f64 {
    0.05
}

/// A fibre by its ends, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FibreSpec {
    /// Bundle name.
    pub bundle: String,
    /// Femoral end [mm].
    #[schemars(with = "[f64; 3]")]
    pub femur: meshes::Point,
    /// Tibial end [mm].
    #[schemars(with = "[f64; 3]")]
    pub tibia: meshes::Point,
}

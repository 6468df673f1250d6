//! Stage 8b, contact-law (optional): the rigid contact law fitted to a deformable model of the knee's own cartilage.

mod fit;
mod layers;
mod loading;
mod pose;

use crate::assemble::OwnLaw;
use crate::frames::Frames;
use crate::overclosure::Separated;
use crate::specimen::Specimen;
use crate::{PerCartilage, StageError};
use deformable::{Law, Material};
pub use fit::{Fitted, RigidCurve};
pub use layers::FittedLayer;
use layers::LayerMetrics;
pub use loading::Curve;
use meshes::hex::HexMesh;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use sim::spec::LayerLaw;

/// The published law of S192803 [mm, MPa] [andreassen2025].
pub const PUBLISHED: ([f64; 4], [f64; 4]) = ([0.0, 0.05, 0.1, 0.2], [0.0, 0.323_340_3, 0.646_680_6, 1.339_037_9]);

/// Which law the model gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ContactRule {
    /// The one whose force is nearer to the deformable model's, by root mean square.
    #[default]
    Best,
    /// Pressure over overclosure, one table for all cartilage, as the paper has it [andreassen2025].
    Table,
    /// Elastic layers of the cartilages' own thickness.
    Thickness,
}

/// How the law is fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactLawOptions {
    /// Whether the stage runs; otherwise the law of `assemble` stands.
    pub fit: bool,
    /// How cartilage's stress follows from strain.
    pub law: Law,
    /// Young's modulus of cartilage [MPa] [andreassen2025].
    pub youngs_modulus_mpa: f64,
    /// Its Poisson's ratio [-] [andreassen2025].
    pub poissons_ratio: f64,
    /// Flexions at which the knee is pressed [deg].
    pub flexions_deg: Vec<f64>,
    /// Force up to which it is pressed [N].
    pub force_n: f64,
    /// Levels on the way there, about [-].
    pub levels: usize,
    /// Forces below this do not count in the fit [N].
    pub least_force_n: f64,
    /// Overclosures of the law, ascending from 0 [mm]; the published ones.
    pub overclosure_mm: Vec<f64>,
    /// Which law the model gets; `table` leaves the other out.
    pub rules: ContactRule,
    /// Laws of pressure over strain that are tried for contact by thickness; the best is taken.
    pub layer_laws: Vec<LayerLaw>,
    /// A layer is nowhere taken thinner than this [mm]; see `assemble.layer`.
    pub least_thickness_mm: f64,
    /// Weight of the contact area at equal force beside the force at equal approach [-].
    pub area_weight: f64,
    /// Coulomb friction [-] [andreassen2025].
    pub friction: f64,
    /// Penalty: pressure over penetration [MPa/mm].
    pub penalty_mpa_per_mm: f64,
    /// Hourglass stiffness, often called kappa [-] [flanagan1981].
    pub hourglass_stiffness: f64,
    /// Whether stress and pressure of every level are kept for files, or only those of the last level of each flexion.
    pub all_fields: bool,
}

impl Default for ContactLawOptions {
    fn default() -> Self {
        ContactLawOptions {
            fit: false,
            law: Law::Linear,
            youngs_modulus_mpa: 12.0,
            poissons_ratio: 0.45,
            flexions_deg: vec![0.0, 45.0, 90.0],
            force_n: 1000.0,
            levels: 12,
            least_force_n: 50.0,
            overclosure_mm: PUBLISHED.0.to_vec(),
            rules: ContactRule::Best,
            layer_laws: vec![LayerLaw::Linear, LayerLaw::Logarithmic],
            least_thickness_mm: 0.5,
            area_weight: 0.1,
            friction: 0.03,
            penalty_mpa_per_mm: 300.0,
            hourglass_stiffness: 0.05,
            all_fields: false,
        }
    }
}

/// Stress and pressure of the cartilages at a level, as they lie then (CT frame, the tibia's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Flexion [deg].
    pub flexion_deg: f64,
    /// The level's number within its flexion.
    pub level: usize,
    /// Force [N].
    pub force_n: f64,
    /// By cartilage.
    pub fields: PerCartilage<SolidFields>,
}

/// Fields of one cartilage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SolidFields {
    /// Node places [mm].
    pub places: Vec<[f32; 3]>,
    /// Cauchy stress of each element, xx, xy, xz, yy, yz, zz [MPa].
    pub stress_mpa: Vec<[f32; 6]>,
    /// Contact pressure at each node [MPa].
    pub contact_pressure_mpa: Vec<f32>,
}

/// The fitted law and what it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactLaw {
    /// Overclosures [mm], ascending from 0.
    pub overclosure_mm: Vec<f64>,
    /// Pressures at them [MPa].
    pub pressure_mpa: Vec<f64>,
    /// Largest difference of the rigid law's force from the deformable model's, from `least_force_n` up [%].
    pub fit_error_percent: f64,
    /// Its root mean square [%].
    pub fit_rms_percent: f64,
    /// Root mean square difference of contact area at equal force [%].
    pub area_error_percent: f64,
    /// Contact by thickness, where it was fitted.
    pub layer: Option<FittedLayer>,
    /// Which of the two the model gets: table or thickness.
    pub rules: ContactRule,
    /// The deformable model, a curve a flexion.
    pub curves: Vec<Curve>,
    /// The rigid law at the same approaches: fitted, and published.
    pub rigid: Vec<RigidCurve>,
    /// Fields for files.
    pub snapshots: Vec<Snapshot>,
    /// The meshes that the fields belong to.
    pub meshes: PerCartilage<HexMesh>,
    /// What is odd but not fatal.
    pub warnings: Vec<Notice>,
    /// For metrics.json.
    pub metrics: ContactLawMetrics,
}

impl From<&ContactLaw> for OwnLaw {
    fn from(law: &ContactLaw) -> Self {
        OwnLaw {
            overclosure_mm: law.overclosure_mm.clone(),
            pressure_mpa: law.pressure_mpa.clone(),
            by_thickness: law.rules == ContactRule::Thickness,
            layer: law.layer.as_ref().map(|l| l.material.clone()),
        }
    }
}

/// Figures of the fitted law, for metrics.json.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactLawMetrics {
    /// Pressures at the law's overclosures [MPa].
    pub pressure_mpa: Vec<f64>,
    /// Largest difference of force [%].
    pub fit_error_percent: f64,
    /// Root mean square difference of force [%].
    pub fit_rms_percent: f64,
    /// Difference of area at equal force [%].
    pub area_error_percent: f64,
    /// The deformable model at each flexion.
    pub flexions: Vec<FlexionMetrics>,
    /// The law by thickness, where it was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layer: Option<LayerMetrics>,
    /// Which law the model gets, where both were fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rules: Option<ContactRule>,
}

/// The deformable model at a flexion; shares over the levels where enough touches.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlexionMetrics {
    /// The flexion [deg].
    pub flexion_deg: f64,
    /// Levels of approach.
    pub levels: usize,
    /// Largest force [N].
    pub force_max_n: f64,
    /// Largest pressure [MPa].
    pub peak_pressure_mpa: f64,
    /// Largest kinetic share of the energy on the way [-].
    pub kinetic_share_max: f64,
    /// The same at rest [-].
    pub kinetic_share_at_rest_max: f64,
    /// Largest share of hourglass energy [-].
    pub hourglass_share_max: f64,
    /// Error of the energy balance [-].
    pub energy_balance_error: f64,
    /// Increments.
    pub increments: usize,
    /// Largest factor on an element's mass [-].
    pub mass_factor_max: f64,
    /// Mass in use over the true one [-].
    pub mass_used_over_true: f64,
}

impl ContactLawOptions {
    fn material(&self) -> Material {
        Material {
            law: self.law,
            youngs_modulus_mpa: self.youngs_modulus_mpa,
            poissons_ratio: self.poissons_ratio,
            ..Material::cartilage()
        }
    }
}

/// Presses the femoral onto the tibial cartilage along the tibia's axis at each flexion, and fits the pressures of the rigid law to force
/// against approach and to contact area.
///
/// # Errors
/// Options out of range; cartilages that do not meet; what the deformable solver refuses.
pub fn contact_law(
    specimen: &Specimen,
    frames: &Frames,
    separated: &Separated,
    options: &ContactLawOptions,
) -> Result<ContactLaw, StageError> {
    check(options)?;
    let rigid = pose::Rigid::new(specimen.identity.side, frames, separated, options)?;
    let (mut curves, mut poses, mut snapshots, mut warnings) = (vec![], vec![], vec![], vec![]);
    for &flexion in &options.flexions_deg {
        let pose = rigid.pose(flexion, options)?;
        let pressed = loading::press(&rigid, &pose, separated, options)?;
        warnings.extend(pressed.warnings);
        snapshots.extend(pressed.snapshots);
        curves.push(pressed.curve);
        poses.push(pose);
    }
    let fitted = fit::fit(&rigid, &poses, &curves, options)?;
    let layer = match options.rules {
        ContactRule::Table => None,
        ContactRule::Best | ContactRule::Thickness => Some(layers::fit(&rigid, &poses, &curves, options)?),
    };
    let (rules, worst) = match &layer {
        Some(l) if options.rules == ContactRule::Thickness || l.fit_rms_percent < fitted.rms_percent => {
            (ContactRule::Thickness, l.fit_error_percent)
        }
        _ => (ContactRule::Table, fitted.worst_percent),
    };
    if worst > 10.0 {
        warnings.push(Kind::LawMisses.notice(format!(
            "the fitted law misses the deformable model's force by up to {worst:.1} %: one law does not serve all flexions"
        )));
    }
    let metrics = metrics(&curves, &fitted, (layer.as_ref(), rules), options);
    Ok(ContactLaw {
        overclosure_mm: options.overclosure_mm.clone(),
        pressure_mpa: fitted.pressure_mpa,
        fit_error_percent: fitted.worst_percent,
        fit_rms_percent: fitted.rms_percent,
        area_error_percent: fitted.area_percent,
        layer,
        rules,
        curves,
        rigid: fitted.curves,
        snapshots,
        meshes: separated.meshes.clone(),
        warnings,
        metrics,
    })
}

fn metrics(
    curves: &[Curve],
    fitted: &Fitted,
    (layer, rules): (Option<&FittedLayer>, ContactRule),
    o: &ContactLawOptions,
) -> ContactLawMetrics {
    let flexions = curves
        .iter()
        .map(|c| {
            // shares of energies say nothing while hardly anything touches
            let told = || c.levels.iter().filter(|l| l.force_n >= o.least_force_n);
            let most = |f: fn(&deformable::press::Level) -> f64| told().map(f).fold(0.0, f64::max);
            FlexionMetrics {
                flexion_deg: c.flexion_deg,
                levels: c.levels.len(),
                force_max_n: most(|l| l.force_n),
                peak_pressure_mpa: most(|l| l.peak_pressure_mpa),
                kinetic_share_max: most(|l| l.kinetic_share_under_way),
                kinetic_share_at_rest_max: most(|l| l.kinetic_share),
                hourglass_share_max: most(|l| l.hourglass_share),
                energy_balance_error: c.energy_balance_error,
                increments: c.levels.iter().map(|l| l.increments).sum::<usize>(),
                mass_factor_max: c.masses.largest_factor,
                mass_used_over_true: c.masses.used_tonne / c.masses.true_tonne,
            }
        })
        .collect();
    ContactLawMetrics {
        pressure_mpa: fitted.pressure_mpa.clone(),
        fit_error_percent: fitted.worst_percent,
        fit_rms_percent: fitted.rms_percent,
        area_error_percent: fitted.area_percent,
        flexions,
        layer: layer.map(FittedLayer::told),
        rules: layer.map(|_| rules),
    }
}

/// Refuses options that mean nothing, before any work.
///
/// # Errors
/// The option, its value and what is expected.
pub fn check(o: &ContactLawOptions) -> Result<(), StageError> {
    let x = &o.overclosure_mm;
    if x.len() < 2 || x[0] != 0.0 || x.windows(2).any(|w| w[0].is_nan() || w[1].is_nan() || w[0] >= w[1]) || x.len() > 6
    {
        return Err(StageError::Knee(
            "contact-law.overclosure_mm: two to six ascending overclosures from 0 were expected".into(),
        ));
    }
    if o.flexions_deg.is_empty() || o.flexions_deg.iter().any(|f| !(-15.0..=130.0).contains(f)) {
        return Err(StageError::Knee(
            "contact-law.flexions_deg: at least one flexion, each from -15 to 130 deg, was expected".into(),
        ));
    }
    if !(10.0..=5000.0).contains(&o.force_n) || !(3..=100).contains(&o.levels) {
        return Err(StageError::Knee("contact-law.force_n 10 to 5000 and levels 3 to 100 were expected".into()));
    }
    if !(0.0..o.force_n).contains(&o.least_force_n) || !(0.0..=10.0).contains(&o.area_weight) {
        return Err(StageError::Knee(
            "contact-law.least_force_n 0 to force_n and area_weight 0 to 10 were expected".into(),
        ));
    }
    if o.layer_laws.is_empty() {
        return Err(StageError::Knee("contact-law.layer_laws: linear, logarithmic or both were expected".into()));
    }
    Ok(())
}

fn fault(e: impl std::error::Error) -> StageError {
    StageError::Knee(e.to_string())
}

//! Grafts: bundles that are put into a knee and drawn to a tension where they are fixed.

use crate::coordinate::Load;
use crate::equilibrium::{Ask, Rig, Start};
use crate::error::SimError;
use crate::ligament::mean_length;
use crate::model::Model;
use crate::spec::{BundleSpec, Law, fibre_damping};
use crate::trials::{TrialOptions, solve};
use meshes::Point;
use serde::{Deserialize, Serialize};

/// How a graft's bundle is called in a model, before its number: no name of a ligament begins so.
pub const NAME: &str = "graft";
/// Toe strain of a graft unless it is told [-]; as of the ligaments [andreassen2025].
pub const TOE_STRAIN: f64 = 0.03;
/// Flexion at which a graft is fixed unless it is told [deg]; ours: most are fixed between 0 and 30.
pub const FIXED_AT_DEG: f64 = 20.0;
/// Stiffness that is offered for a graft [N/mm]; ours: a hamstring graft with what holds it.
pub const STIFFNESS_N_PER_MM: f64 = 200.0;
/// Tension that is offered for one [N]; ours: what a hand pulls.
pub const TENSION_N: f64 = 80.0;
/// What the knee bears while a graft is fixed and in a plan's tests, unless it is told [N]; as in the published decks.
pub const COMPRESSION_N: f64 = 20.0;
/// Least and most that a stiffness may be [N/mm]; ours.
pub const STIFFNESSES_N_PER_MM: [f64; 2] = [0.1, 5000.0];
/// Least and most that a tension may be [N], beyond what a hand pulls; ours.
pub const TENSIONS_N: [f64; 2] = [1.0, 500.0];

/// A tension is met within this [N].
const MET_N: f64 = 0.2;
/// Most steps to a tension [-].
const MOST_STEPS: usize = 40;
/// Ratio of length in CT to slack length at which a graft is slack [-], and from which it is drawn shorter; ours.
const SLACK: [f64; 2] = [0.5, 0.8];
/// A graft is made shorter by this factor at a time [-]; ours. Near a known answer the first is the second of these, and each is the square of the
/// one before, up to the first of these.
const SHORTER: [f64; 2] = [1.04, 1.01];
/// A graft is made shorter up to this ratio of its length in CT to its slack length [-]; ours: a loose knee follows it far.
const MOST_STRAIN: f64 = 3.0;

/// A graft.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Graft {
    /// Its name, for messages.
    pub name: String,
    /// Femoral and tibial end of each of its fibres, in the CT pose [mm].
    pub ends: Vec<[Point; 2]>,
    /// Of the whole graft [N/mm].
    pub stiffness_n_per_mm: f64,
    /// Toe strain [-].
    #[serde(default = "toe_strain")]
    pub toe_strain: f64,
    /// The bundle whose law, dashpot and reference length it takes over, where it lies in that bundle's place.
    #[serde(default)]
    pub like: Option<String>,
    /// What it is drawn to.
    pub drawn: Drawn,
}

/// What a graft is drawn to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Drawn {
    /// A tension, at the flexion where it is fixed.
    Tension {
        /// [N]
        tension_n: f64,
        /// [deg]
        at_flexion_deg: f64,
        /// What the knee bears meanwhile [N].
        #[serde(default = "compression_n")]
        compression_n: f64,
    },
    /// A slack length.
    Slack {
        /// [mm]
        slack_length_mm: f64,
    },
}

fn toe_strain() -> f64 {
    TOE_STRAIN
}

fn compression_n() -> f64 {
    COMPRESSION_N
}

/// The name of the bundle of graft number `k`.
pub fn bundle_name(k: usize) -> String {
    format!("{NAME}{k}")
}

/// The model with grafts among its bundles, last, and fixed in their order while `cut` is cut. Nothing is cut in what comes back. With `near`, the reference strains of the same grafts in a knee much like this one, the tensions are sought from there.
///
/// # Errors
/// A number out of range, a tension that is out of reach, a knee without equilibrium; each names the graft.
pub fn with_grafts(model: &Model, grafts: &[Graft], cut: &[String], near: Option<&[f64]>) -> Result<Model, SimError> {
    let first = model.bundles.len();
    let mut out = model.clone();
    for (k, graft) in grafts.iter().enumerate() {
        out = put_in(&out, graft, bundle_name(k))?;
    }
    for (k, graft) in grafts.iter().enumerate() {
        let Drawn::Tension { tension_n, at_flexion_deg, compression_n } = graft.drawn else { continue };
        // those that follow are not in yet
        let away: Vec<String> = (k + 1..grafts.len()).map(bundle_name).collect();
        let knee = out.without(&[cut, &away].concat())?;
        let compression = Load::compression(compression_n);
        let drawing = Drawing { knee: &knee, bundle: first + k, at_flexion_deg, compression };
        let strain = drawing.strain(tension_n, near.and_then(|n| n.get(k)).copied());
        let strain = strain.map_err(|e| e.of(&format!("graft {:?}: fixed at {at_flexion_deg} deg", graft.name)))?;
        out = with_strain(&out, first + k, strain)?;
    }
    Ok(out)
}

/// Reference strains of the grafts of a model that has so many, its last bundles [-].
pub fn strains(model: &Model, grafts: usize) -> Vec<f64> {
    model.bundles[model.bundles.len() - grafts..].iter().map(|b| b.reference_strain).collect()
}

/// The model with grafts that were fixed before, at these reference strains; one without a strain is as it is told.
///
/// # Errors
/// A number out of range.
pub fn as_fixed(model: &Model, grafts: &[Graft], strains: &[f64]) -> Result<Model, SimError> {
    let mut out = model.clone();
    for (k, graft) in grafts.iter().enumerate() {
        out = put_in(&out, graft, bundle_name(k))?;
        if let Some(strain) = strains.get(k) {
            out = with_strain(&out, model.bundles.len() + k, *strain)?;
        }
    }
    Ok(out)
}

/// The model with a graft as its last bundle, as long as it is told or not drawn yet.
fn put_in(model: &Model, graft: &Graft, name: String) -> Result<Model, SimError> {
    let fault = |e: SimError| e.of(&format!("graft {:?}", graft.name));
    let of = |like: &String| {
        let found = model.bundles.iter().find(|b| b.name == *like);
        found.ok_or_else(|| fault(SimError::Input(format!("it is to be like {like:?}, which is no bundle"))))
    };
    let like = graft.like.as_ref().map(of).transpose()?;
    let length = mean_length(&graft.ends);
    let reference = like.map_or(length, |b| b.reference_length);
    let spec = BundleSpec {
        name,
        reference_strain: match graft.drawn {
            Drawn::Slack { slack_length_mm } => reference / slack_length_mm,
            Drawn::Tension { .. } => 1.0,
        },
        stiffness_n_per_mm: graft.stiffness_n_per_mm,
        reference_length_mm: reference,
        toe_strain: graft.toe_strain,
        law: like.map_or(Law::Smooth, |b| b.law),
        damping_n_s_per_mm: like.map_or(fibre_damping(), |b| b.damping),
    };
    model.with_bundle(&spec, like.map(|b| b.table_end), &graft.ends).map_err(fault)
}

fn with_strain(model: &Model, bundle: usize, strain: f64) -> Result<Model, SimError> {
    let mut parameters = model.parameters();
    parameters[bundle].reference_strain = strain;
    model.with_parameters(&parameters)
}

/// A knee with a graft that is being drawn: the bundle of this number, at a flexion [deg] and under a compression.
struct Drawing<'a> {
    knee: &'a Model,
    bundle: usize,
    at_flexion_deg: f64,
    compression: Load,
}

impl Drawing<'_> {
    /// The reference strain [-] at which it bears a tension [N] along the path of loading.
    ///
    /// Without friction an equilibrium does not remember its way. So from a strain that is near, the search goes from one equilibrium to the next. That is
    /// quicker. What it finds holds where the path of loading gives the same tension.
    fn strain(&self, tension_n: f64, near: Option<f64>) -> Result<f64, SimError> {
        if near.is_some() && self.knee.contact.friction == 0.0 {
            let mut at = None;
            let found = sought(|strain| self.force_beside(strain, &mut at), tension_n, near);
            let is_met = |strain: &f64| self.force(*strain).is_ok_and(|n| (n - tension_n).abs() < MET_N);
            if let Some(strain) = found.ok().filter(is_met) {
                return Ok(strain);
            }
        }
        sought(|strain| self.force(strain), tension_n, near)
    }

    /// What it bears at a reference strain, along the path of loading [N].
    fn force(&self, strain: f64) -> Result<f64, SimError> {
        let knee = with_strain(self.knee, self.bundle, strain)?;
        let answer = solve(&knee, self.at_flexion_deg, &self.compression, &TrialOptions::default())?;
        Ok(answer.forces_n[self.bundle])
    }

    /// The same in the equilibrium next to the last one, where there is one; `last` becomes the one that is found.
    fn force_beside(&self, strain: f64, last: &mut Option<Start>) -> Result<f64, SimError> {
        let knee = with_strain(self.knee, self.bundle, strain)?;
        let rig = Rig { model: &knee, field: None, reading: None };
        let ask = Ask { load: self.compression.generalised(), flexion: self.at_flexion_deg.to_radians() };
        let found = rig.settle(&ask, &last.take().unwrap_or_else(|| rig.flexed(&ask)));
        if !found.balanced {
            return Err(SimError::Solver("no equilibrium beside the last one".into()));
        }
        *last = Some(found.start());
        Ok(knee.bundle_forces(&knee.evaluate(&found.q).fibres)[self.bundle])
    }
}

/// The reference strain [-] at which a graft bears its tension [N]; `force` gives what it bears at one.
fn sought(
    mut force: impl FnMut(f64) -> Result<f64, SimError>,
    tension_n: f64,
    near: Option<f64>,
) -> Result<f64, SimError> {
    let mut at = |strain: f64| Ok::<f64, SimError>(force(strain)? - tension_n);
    let mut step = SHORTER[usize::from(near.is_some())];
    let longer = |step: f64| (step * step).min(SHORTER[0]);
    let [mut low, mut high] = near.map_or(SLACK, |e| [e / step, e]);
    // slack at first; then shorter and shorter until it bears more than is asked
    let (mut under, mut over) = (-tension_n, at(high)?);
    if near.is_some() {
        under = at(low)?;
        while under >= 0.0 && low > SLACK[0] {
            (high, over) = (low, under);
            step = longer(step);
            low /= step;
            under = at(low)?;
        }
    }
    while over < 0.0 {
        (low, under) = (high, over);
        step = longer(step);
        high *= step;
        if high > MOST_STRAIN {
            let told = format!("tension_n {tension_n} is out of reach; expected less, or a stiffer graft");
            return Err(SimError::Input(told));
        }
        over = at(high)?;
    }
    // regula falsi; the end that stays is believed by half each time
    for _ in 0..MOST_STEPS {
        let middle =
            if over - under > 1e-12 { low + (high - low) * -under / (over - under) } else { 0.5 * (low + high) };
        let miss = at(middle)?;
        if miss.abs() < MET_N || high - low < 1e-9 {
            return Ok(middle);
        }
        if miss < 0.0 {
            (low, under, over) = (middle, miss, 0.5 * over);
        } else {
            (high, over, under) = (middle, miss, 0.5 * under);
        }
    }
    Err(SimError::Solver(format!("tension_n {tension_n} was not met")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tension_is_found_from_afar_and_from_close_by() {
        // a spring that bears from a strain of 1.1 on
        let force = |strain: f64| Ok((4000.0 * (strain - 1.1)).max(0.0));
        for near in [None, Some(1.119), Some(1.05), Some(1.3)] {
            let strain = sought(force, 80.0, near).unwrap_or(0.0);
            assert!((strain - 1.12).abs() < MET_N / 4000.0, "{near:?}: {strain}");
        }
        let weak = sought(|strain| Ok(10.0 * strain), 80.0, None);
        assert!(weak.is_err_and(|e| e.to_string().contains("out of reach")));
    }
}

//! The knee's motions for the slider: the femur's place, the fibres' forces and the contact pressure at every step of every protocol; and the
//! measured loads, with the femur where it was measured.

use super::geometry::{Pool, rounded};
use super::number::fixed;
use crate::model_file::assembled_model;
use crate::stage::Values;
use crate::stage::contact_surface;
use crate::stage::list::Calibration;
use crate::validate::Validation;
use crate::which_model::JOINT;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use calibration::session::Outcome;
use live::pressure::{Pressed, Surfaces};
use meshes::Point;
use meshes::surface::TriMesh;
use serde::Serialize;
use sim::flags::Flag;
use sim::joint::{Joint, Pose};
use sim::laxity::{LaxityTrial, TrialResult};
use sim::model::Model;
use sim::spec::{FramesSpec, ModelSpec, PoseSpec};
use stages::PerCartilage;
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::collections::BTreeMap;
use validation::validate::{Passive, Source};

/// A way of moving the knee.
#[derive(Serialize)]
pub(super) struct Motion {
    name: String,
    /// Largest contact pressure of all motions [MPa]; 0 where none is told.
    most_mpa: f64,
    steps: Vec<Step>,
}

#[derive(Serialize)]
struct Step {
    label: String,
    /// Rows of the 3 x 4 matrix that moves the femur.
    femur: Vec<f64>,
    /// The same to where it was measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<Vec<f64>>,
    /// Force of each fibre [N].
    force: Vec<f64>,
    /// By surface: corners and their pressures.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pressure: BTreeMap<String, [String; 2]>,
    #[serde(skip)]
    pressed: Pressed,
}

const PROTOCOLS: [(&str, &str); 4] = [
    ("passive_flexion", "passive flexion"),
    ("ap_laxity", "drawers"),
    ("pivot_shift", "pivot shift"),
    ("pivot_shift_no_acl", "pivot shift without ACL"),
];

/// The protocols of every calibrated model, the knee's first and with its contact; then the loads it was measured under.
pub(super) fn motions(v: &Values, pool: &Pool) -> Vec<Motion> {
    let (Some(validation), Some(calibration)) = (v.of::<Validation>(), v.of::<Calibration>()) else { return vec![] };
    let main = calibration.main().map_or("", |(name, _)| name);
    let mut out = Vec::new();
    for (name, outcome) in calibration.main_first() {
        let Ok(joint) = Joint::new(&outcome.spec.frames, outcome.spec.side) else { continue };
        let model = if name == main { model(v, &outcome.spec) } else { None };
        let surfaces = v.of::<Assembled>().map(|a| Surfaces::new(corners(&a.contact)));
        let knee = Knee { name, joint, spec: &outcome.spec, contact: model.as_ref().zip(surfaces), pool };
        let source = validation.sources.iter().find(|s| s.name == name);
        out.extend(source.into_iter().flat_map(|s| knee.protocols(s, &validation.passive)));
        if let Some(assembled) = v.of::<Assembled>().filter(|_| name == main) {
            out.extend(knee.measured(outcome, &assembled.spec.frames));
        }
    }
    told(&mut out);
    out
}

/// Packs the pressures of all motions by one scale.
fn told(motions: &mut [Motion]) {
    let steps = |m: &Motion| m.steps.iter().map(|s| s.pressed.most()).fold(0.0, f64::max);
    let most = motions.iter().map(steps).fold(0.0, f64::max);
    for m in motions {
        m.most_mpa = rounded(most, 100.0);
        m.steps.iter_mut().for_each(|s| s.pressure = packed(&s.pressed, m.most_mpa));
    }
}

/// The corners of the cartilages in contact as the page has them, by their keys there: femur, medial tibia, lateral tibia.
pub(super) fn corners(contact: &PerCartilage<TriMesh>) -> Vec<(String, Vec<Point>)> {
    let one = |(name, mesh): (&'static str, &TriMesh)| {
        let (key, thin) = contact_surface(name, mesh);
        (key, thin.vertices)
    };
    contact.named().into_iter().map(one).collect()
}

/// By surface the corners as 16-bit numbers and their pressures in 8-bit steps up to `high` [MPa], base64.
fn packed(pressed: &Pressed, high: f64) -> BTreeMap<String, [String; 2]> {
    let one = |all: &Vec<(u16, f64)>| {
        let corners: Vec<u8> = all.iter().flat_map(|(n, _)| n.to_le_bytes()).collect();
        let values: Vec<u8> = all.iter().map(|(_, p)| (255.0 * p / high).round().clamp(0.0, 255.0) as u8).collect();
        [STANDARD.encode(corners), STANDARD.encode(values)]
    };
    pressed.by_surface.iter().map(|(key, all)| (key.clone(), one(all))).collect()
}

/// The calibrated model, to ask it for its contact.
fn model(v: &Values, spec: &ModelSpec) -> Option<Model> {
    let loaded = assembled_model(v.of::<Assembled>()?, v.of::<Bones>()?, v.of::<Cartilage>()?);
    sim::compile(spec, &loaded.meshes).ok()
}

/// A calibrated model that moves.
#[derive(Clone)]
struct Knee<'a> {
    name: &'a str,
    joint: Joint,
    spec: &'a ModelSpec,
    contact: Option<(&'a Model, Surfaces)>,
    pool: &'a Pool,
}

impl Knee<'_> {
    fn protocols(&self, source: &Source, passive: &[Passive]) -> Vec<Motion> {
        let mut out = Vec::new();
        for (file, words) in PROTOCOLS {
            let rows = source.protocols().into_iter().find(|(name, _)| *name == file).map_or(&[][..], |(_, rows)| rows);
            let seen = if file == "passive_flexion" { passive } else { &[] };
            let steps: Vec<Step> =
                rows.iter().filter_map(|r| self.step(r, &source.bundles, beside(seen, r.pose.fe_deg))).collect();
            if !steps.is_empty() {
                out.push(Motion { name: format!("{}: {words}", self.name), most_mpa: 0.0, steps });
            }
        }
        out
    }

    /// The loads of each data set: simulated, and measured where the whole pose was.
    fn measured(&self, outcome: &Outcome, frames: &FramesSpec) -> Vec<Motion> {
        let (sources, of) = &outcome.sources;
        let one = |(s, source): (usize, &String)| {
            let knee = Knee {
                joint: Joint::new(&outcome.frames_of(s, frames).ok()?, outcome.spec.side).ok()?,
                ..self.clone()
            };
            let step = |i: usize| {
                let (t, p) = (&outcome.trials[i], outcome.found.predicted[i].as_ref());
                let simulated = pose(t, |c| p.map(|p| p[c]))?;
                knee.trial(t, &simulated, outcome.found.elsewhere.contains(&i))
            };
            let mine = (0..outcome.trials.len()).filter(|&i| of[i] == s);
            let steps: Vec<Step> = mine.filter_map(step).collect();
            let name = match self.name {
                JOINT => format!("{}: measured loads, {source}", self.name),
                name => format!("{name}: measured loads"),
            };
            (!steps.is_empty()).then_some(Motion { name, most_mpa: 0.0, steps })
        };
        sources.iter().enumerate().filter_map(one).collect()
    }

    fn trial(&self, t: &LaxityTrial, simulated: &PoseSpec, elsewhere: bool) -> Option<Step> {
        let measured = pose(t, |c| t.measured[c])?;
        let flags: Vec<Flag> = elsewhere.then_some(Flag::Several).into_iter().collect();
        let label = format!(
            "{} {}, flexion {} deg: simulated AP {} mm, measured {}; IE {} deg, measured {}; VV {} deg, measured {}{}",
            t.trial,
            t.test.name(),
            fixed(t.fe_deg, 0),
            fixed(simulated.ap_mm, 1),
            fixed(measured.ap_mm, 1),
            fixed(simulated.ie_deg, 1),
            fixed(measured.ie_deg, 1),
            fixed(simulated.vv_deg, 1),
            fixed(measured.vv_deg, 1),
            in_brackets(&flags)
        );
        let pose = self.pose(simulated)?;
        let force = self
            .contact
            .as_ref()
            .and_then(|(m, _)| m.in_trial(t).ok())
            .map(|m| m.fibre_states(&pose).iter().map(|f| rounded(f.response.force, 10.0)).collect::<Vec<f64>>());
        Some(Step {
            label,
            femur: self.pool.motion(&pose.femur),
            measured: Some(self.pool.motion(&self.pose(&measured)?.femur)),
            force: force.unwrap_or_default(),
            pressed: if elsewhere { Pressed::default() } else { self.pressed(&pose, &flags) },
            pressure: BTreeMap::new(),
        })
    }

    fn step(&self, r: &TrialResult, bundles: &[String], measured: Option<PoseSpec>) -> Option<Step> {
        let pose = self.pose(&r.pose)?;
        let count = |bundle: &str| self.spec.fibres.iter().filter(|g| g.bundle == bundle).count() as f64;
        let of_fibre = |bundle: &String| {
            let force = bundles.iter().position(|b| b == bundle).and_then(|i| r.forces_n.get(i));
            rounded(force.map_or(0.0, |n| n / count(bundle)), 10.0)
        };
        let p = &r.pose;
        let label = format!(
            "{}: flexion {}, valgus {}, external {} deg; lateral {}, anterior {}, superior {} mm{}",
            r.trial.trial,
            fixed(p.fe_deg, 0),
            fixed(p.vv_deg, 1),
            fixed(p.ie_deg, 1),
            fixed(p.ml_mm, 1),
            fixed(p.ap_mm, 1),
            fixed(p.si_mm, 1),
            in_brackets(&r.flags)
        );
        Some(Step {
            label,
            femur: self.pool.motion(&pose.femur),
            measured: measured.and_then(|m| Some(self.pool.motion(&self.pose(&m)?.femur))),
            force: self.spec.fibres.iter().map(|f| of_fibre(&f.bundle)).collect(),
            pressed: self.pressed(&pose, &r.flags),
            pressure: BTreeMap::new(),
        })
    }

    fn pose(&self, pose: &PoseSpec) -> Option<Pose> {
        let q = self.joint.coordinates(&pose.six()).ok()?;
        Some(self.joint.pose(&q))
    }

    /// None of a femur off the plateau: it lies in what the page would show as pressure, and would set the scale of all others.
    fn pressed(&self, pose: &Pose, flags: &[Flag]) -> Pressed {
        if flags.contains(&Flag::Dislocated) {
            return Pressed::default();
        }
        self.contact.as_ref().map(|(m, surfaces)| surfaces.pressed(&m.contact, pose)).unwrap_or_default()
    }
}

/// What is odd, behind a label.
fn in_brackets(flags: &[Flag]) -> String {
    if flags.is_empty() { String::new() } else { format!(" ({})", sim::flags::sentences(flags).join(", ")) }
}

/// A pose at the trial's flexion, where all of it is there; `None` for readings that count from another trial.
fn pose(t: &LaxityTrial, of: impl Fn(sim::coordinate::Coordinate) -> Option<f64>) -> Option<PoseSpec> {
    if t.reference.is_some() {
        return None;
    }
    use sim::coordinate::{AP, IE, ML, SI, VV};
    Some(PoseSpec {
        fe_deg: t.fe_deg,
        vv_deg: of(VV)?,
        ie_deg: of(IE)?,
        ml_mm: of(ML)?,
        ap_mm: of(AP)?,
        si_mm: of(SI)?,
    })
}

/// The first measured passive flexion at a flexion, between its two nearest poses; `None` beyond them.
fn beside(passive: &[Passive], fe_deg: f64) -> Option<PoseSpec> {
    let mut sorted: Vec<&PoseSpec> =
        passive.first()?.poses.iter().filter(|p| p.six().iter().all(|x| x.is_finite())).collect();
    sorted.sort_by(|a, b| a.fe_deg.total_cmp(&b.fe_deg));
    let k = sorted.partition_point(|p| p.fe_deg < fe_deg);
    let (a, b) = (sorted.get(k.checked_sub(1)?)?, sorted.get(k)?);
    let t = (fe_deg - a.fe_deg) / (b.fe_deg - a.fe_deg).max(1e-9);
    let between = |of: fn(&PoseSpec) -> f64| of(a) + t * (of(b) - of(a));
    Some(PoseSpec {
        fe_deg,
        vv_deg: between(|p| p.vv_deg),
        ie_deg: between(|p| p.ie_deg),
        ml_mm: between(|p| p.ml_mm),
        ap_mm: between(|p| p.ap_mm),
        si_mm: between(|p| p.si_mm),
    })
}

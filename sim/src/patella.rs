//! The patellofemoral joint: a patella between quadriceps, patellar tendon and trochlea, condensed out of the knee's equilibrium.
//!
//! The patella is a rigid body without mass. Its six coordinates are the femur's against it, in the chain of [`crate::joint`] with the patella
//! in the tibia's place: patellar flexion, spin (valgus +: apex lateral), tilt (external +: lateral edge backwards), and the patella's lateral,
//! anterior and superior shift [bull2002]. Its energy is that of contact with the trochlea, of the patellar tendon and the retinacula, and the
//! potential of the quadriceps, `tension x length` of lines that wrap over the front of the femur. Of these only the tendon depends on the
//! tibia, so the knee's coordinates enter through the tendon alone. At each pose of the knee the patella lies where its energy is least
//! ([`crate::condensed`]). Without tension of the quadriceps it acts on nothing.

mod line;
mod place;
mod way;

use crate::condensed::{Inner, Parts, Rest};
use crate::contact::{self, Contact, ContactOptions, ContactResponse, Nearby};
use crate::coordinate::Six;
use crate::error::SimError;
use crate::joint::{Joint, Pose, comes_first};
use crate::ligament::Bundle;
use crate::spec::{
    BandSpec, BundleSpec, ContactSpec, FramesSpec, GridSpec, HeadSpec, ModelSpec, PairSpec, PatellaContactSpec,
    QuadricepsSpec,
};
use line::{Cylinder, Length, straight};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use nalgebra::Matrix3;
pub(crate) use place::Doubts;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

/// Length that makes the patella's angles comparable with displacements [mm]: about half its height.
const ARM: f64 = 20.0;
/// Furthest a coordinate goes in a Newton step [mm, angles times [`ARM`]].
const LONGEST_STEP: f64 = 0.5;
/// Newton steps below this end the search for the patella's place on the way of a path [mm, angles times [`ARM`]].
const STEP_ON_THE_WAY: f64 = 3e-3;
/// Nodes of the patella lie this much further apart than the knee's [-]: its contact is larger and flatter.
const COARSER: f64 = 2.0;
/// Its name among the model's bodies.
pub const NAME: &str = "patella";
/// Forces on the patella balance within this share of the quadriceps' tension, moments at [`ARM`] [-].
const BALANCED: f64 = 1e-3;

/// A tendon that bears more than this share of the quadriceps' tension is pulled by something else [-]. The most that was read is 1.16 [buff1988];
/// ours: some scatter of persons.
const MOST_TENDON: f64 = 1.3;

/// The next patella's number.
static NEXT: AtomicU64 = AtomicU64::new(1);

thread_local! {
    /// Lists of nodes near contact of the patella that this thread saw last, and its number.
    static LISTS: RefCell<(u64, Nearby)> = RefCell::new((0, Nearby::default()));
}

/// A compiled patellofemoral joint.
#[derive(Clone, Debug)]
pub struct Patella {
    /// The chain of femur against patella.
    pub joint: Joint,
    /// The knee's.
    knee: Joint,
    /// Tension of the quadriceps [N].
    pub tension: f64,
    /// Tells its contact from any other's.
    id: u64,
    contact: Contact,
    heads: Vec<Head>,
    wrap: Cylinder,
    /// The tendon, then the retinacula.
    bands: Vec<Group>,
}

#[derive(Clone, Debug)]
struct Head {
    share: f64,
    patella: Vector,
    femur: Vector,
}

/// Fibres of one law.
#[derive(Clone, Debug)]
struct Group {
    law: Bundle,
    /// Whether the far ends lie on the tibia.
    tibial: bool,
    fibres: Vec<Fibre>,
}

#[derive(Clone, Debug)]
struct Fibre {
    patella: Vector,
    far: Vector,
    initial: f64,
}

/// The patella in equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct PatellaState {
    /// Its coordinates: flexion, spin, tilt [rad], lateral, anterior, superior [mm] of the femur, clinical signs.
    pub pose: Six,
    /// Tension of the quadriceps [N].
    pub quadriceps_n: f64,
    /// Tension of the patellar tendon, the sum over its fibres [N].
    pub tendon_n: f64,
    /// Tension of each retinaculum by name [N].
    pub retinacula: Vec<(String, f64)>,
    /// Force of the trochlea on the patella [N].
    pub contact_n: f64,
    /// Contact area [mm2].
    pub area_mm2: f64,
    /// What is out of balance, moments at an arm of 20 mm [N].
    pub unbalanced_n: f64,
}

impl PatellaState {
    /// Names with their units, and values: what results tell of it.
    pub fn outputs(&self) -> Vec<(String, f64)> {
        let p = &self.pose;
        let mut out: Vec<(String, f64)> = vec![
            ("patella_flexion_deg".into(), p[0].to_degrees()),
            ("patella_spin_deg".into(), p[1].to_degrees()),
            ("patella_tilt_deg".into(), p[2].to_degrees()),
            ("patella_ml_mm".into(), p[3]),
            ("patella_ap_mm".into(), p[4]),
            ("patella_si_mm".into(), p[5]),
            ("patellar_tendon_n".into(), self.tendon_n),
            ("patella_contact_n".into(), self.contact_n),
            ("patella_unbalanced_n".into(), self.unbalanced_n),
        ];
        out.extend(self.retinacula.iter().map(|(name, n)| (format!("patella_{name}_n"), *n)));
        out
    }

    /// Whether its forces balance.
    pub fn is_balanced(&self) -> bool {
        self.unbalanced_n <= BALANCED * self.quadriceps_n.max(1.0)
    }

    /// Whether its tendon bears more than the quadriceps give it: the retinacula hold the patella.
    pub fn is_held(&self) -> bool {
        self.tendon_n > MOST_TENDON * self.quadriceps_n
    }
}

impl Inner for Patella {
    fn name(&self) -> &str {
        NAME
    }

    fn size(&self) -> (usize, usize) {
        (6, 5)
    }

    fn at(&self, pose: &Pose, inner: &[f64]) -> Parts {
        let own = self.joint.pose(&unscaled(inner));
        let mut sums = Sums::new(&own, pose);
        sums.take(&self.contact_near(&own));
        self.pull(&mut sums);
        sums.scaled()
    }

    fn step_on_the_way(&self) -> f64 {
        STEP_ON_THE_WAY
    }

    fn longest_step(&self) -> f64 {
        LONGEST_STEP
    }

    /// From where it rested last; else from the CT pose, where the tension is put on little by little.
    fn approach(&self, q: &Six, rest: &mut Rest) {
        if rest.at().is_none() {
            *rest = self.laid();
        }
        self.lead(q, rest);
    }

    fn outputs(&self, pose: &Pose, inner: &[f64]) -> Vec<(String, f64)> {
        self.state(pose, inner).outputs()
    }
}

/// Angles from their scaled coordinates.
fn unscaled(inner: &[f64]) -> Six {
    Six::from_fn(|i, _| inner[i] * unit(i))
}

/// What a millimetre is of a coordinate.
fn unit(i: usize) -> f64 {
    if i < 3 { 1.0 / ARM } else { 1.0 }
}

/// A point that a body carries, seen from the femur: the change of its place by the body's coordinates.
struct Place {
    by: [Vector; 6],
    /// Velocities in the body's frame.
    own: [Vector; 6],
}

impl Place {
    /// `p` in the CT frame of the body against which `pose` moves the femur.
    fn new(pose: &Pose, p: &Vector) -> Place {
        let own = pose.screws.map(|s| s.at(p));
        let back = pose.femur.rotation.inverse();
        Place { by: own.map(|v| -(back * v)), own }
    }

    /// Work of a force in the second derivative by two coordinates; the force in the body's frame.
    fn second(&self, pose: &Pose, force: &Vector, j: usize, k: usize) -> f64 {
        let (first, last) = if comes_first(j, k) { (j, k) } else { (k, j) };
        force.dot(&pose.screws[last].angular.cross(&self.own[first]))
    }
}

/// Energy and derivatives under way; angles in radians.
struct Sums<'a> {
    /// The femur against the patella, and against the tibia.
    own: &'a Pose,
    knee: &'a Pose,
    parts: Parts,
    by_u: Six,
    uu: nalgebra::Matrix6<f64>,
    uq: nalgebra::Matrix6<f64>,
}

impl<'a> Sums<'a> {
    fn new(own: &'a Pose, knee: &'a Pose) -> Sums<'a> {
        let zero = nalgebra::Matrix6::zeros();
        Sums { own, knee, parts: Parts::zeros((6, 5)), by_u: Six::zeros(), uu: zero, uq: zero }
    }

    /// Adds what depends on the patella's place alone.
    fn take(&mut self, response: &ContactResponse) {
        self.parts.energy += response.energy;
        self.by_u += response.gradient;
        self.uu += response.hessian;
    }

    /// Adds an energy of the place of `near`, a point of the patella, against `far`, one of the tibia: force and stiffness by that place, femur
    /// frame.
    fn add(&mut self, energy: f64, (force, stiffness): (&Vector, &Matrix3<f64>), near: &Place, far: &Place) {
        self.parts.energy += energy;
        let (seen, from) = (self.own.femur.rotation * force, self.knee.femur.rotation * force);
        for j in 0..6 {
            self.by_u[j] += force.dot(&near.by[j]);
            let along = stiffness * near.by[j];
            for k in j..6 {
                let value = along.dot(&near.by[k]) + near.second(self.own, &seen, j, k);
                self.uu[(j, k)] += value;
                if j != k {
                    self.uu[(k, j)] += value;
                }
            }
            self.parts.outer[j] -= force.dot(&far.by[j]);
            let across = stiffness * far.by[j];
            for k in 0..6 {
                self.uq[(j, k)] -= along.dot(&far.by[k]);
                self.parts.hessian[(j, k)] += across.dot(&far.by[k]) - far.second(self.knee, &from, j, k);
            }
        }
    }

    /// By scaled inner coordinates.
    fn scaled(mut self) -> Parts {
        for j in 0..6 {
            self.parts.inner[j] = self.by_u[j] * unit(j);
            self.parts.mixed[j] = self.uq.row(j).transpose() * unit(j);
            for k in 0..=j {
                self.parts.stiffness.add(j, k, self.uu[(j, k)] * unit(j) * unit(k));
            }
        }
        self.parts
    }
}

impl Patella {
    /// Compiles the patella of a specification, where it has one; `surfaces` by the names its contact uses.
    ///
    /// Errors: numbers out of range, a fibre without length, a missing surface, bad frames.
    pub fn new(
        spec: &ModelSpec,
        surfaces: &BTreeMap<String, TriMesh>,
        options: &ContactOptions,
    ) -> Result<Option<Patella>, SimError> {
        let Some(own) = &spec.patella else { return Ok(None) };
        let grid = spec.frames.grid.map(|g| GridSpec { tibia: own.frame, ..g });
        let frames = FramesSpec { tibia: own.frame, chain: None, grid, ..spec.frames.clone() };
        let joint = Joint::new(&frames, spec.side).map_err(|e| SimError::Spec(format!("patella: {e}")))?;
        let knee = Joint::new(&spec.frames, spec.side)?;
        let coarse = ContactOptions { spacing_mm: COARSER * options.spacing_mm };
        let mut contact = Contact::between(&frames, &contact_spec(&own.contact), surfaces, &coarse)?;
        // the patella's nodes alone: the trochlea is much the larger
        contact.tibial_only = true;
        let mut bands = vec![band(&own.tendon, true)?];
        for retinaculum in &own.retinacula {
            bands.push(band(retinaculum, false)?);
        }
        let (heads, wrap) = quadriceps(&own.quadriceps, &spec.frames)?;
        let id = NEXT.fetch_add(1, Ordering::Relaxed);
        Ok(Some(Patella { joint, knee, tension: 0.0, id, contact, heads, wrap, bands }))
    }

    /// The contact at a pose, by the lists that this thread made for it close by; results do not depend on them.
    fn contact_near(&self, own: &Pose) -> ContactResponse {
        LISTS.with_borrow_mut(|(id, near)| {
            if *id != self.id {
                (*id, *near) = (self.id, Nearby::default());
            }
            self.contact.evaluate_near(own, near)
        })
    }

    /// Under another tension of the quadriceps [N].
    pub fn with_tension(&self, tension: f64) -> Patella {
        Patella { tension, ..self.clone() }
    }

    /// What a patella in equilibrium does, from [`Condensed::inner`].
    pub fn state(&self, knee: &Pose, inner: &[f64]) -> PatellaState {
        let u = unscaled(inner);
        let own = self.joint.pose(&u);
        let contact = self.contact.evaluate(&own);
        let mut sums = Sums::new(&own, knee);
        self.pull(&mut sums);
        let left = sums.by_u + contact.gradient;
        let mut forces = self.bands.iter().map(|b| (b.law.name.clone(), b.tension(&own, knee)));
        let tendon_n = forces.next().map_or(0.0, |f| f.1);
        PatellaState {
            pose: self.joint.grood_suntay(&u),
            quadriceps_n: self.tension,
            tendon_n,
            retinacula: forces.collect(),
            contact_n: contact.wrench.iter().map(|w| w.0).sum::<Vector>().norm(),
            area_mm2: contact.area.iter().sum(),
            unbalanced_n: (0..6).map(|i| (left[i] * unit(i)).powi(2)).sum::<f64>().sqrt(),
        }
    }

    /// Adds all but the contact.
    fn pull(&self, sums: &mut Sums) {
        let (own, knee) = (sums.own, sums.knee);
        // what hangs on the femur moves as a node of the patella does
        let (mut fixed, mut stiffness) = (contact::Sums::default(), [0.0; 21]);
        for head in &self.heads {
            let near = seen_from_femur(own, &head.patella);
            let Length { value, gradient, hessian } = self.wrap.over(&near, &head.femur);
            let f = self.tension * head.share;
            fixed.pull(&mut stiffness, &near, f * value, (&(gradient * f), &(hessian * f)));
        }
        for band in &self.bands {
            for fibre in &band.fibres {
                let near = seen_from_femur(own, &fibre.patella);
                let far = if band.tibial { seen_from_femur(knee, &fibre.far) } else { fibre.far };
                let length = straight(&near, &far);
                let r = band.law.response(length.value - fibre.initial + band.law.initial_stretch());
                if r.energy <= 0.0 {
                    continue;
                }
                let by = length.gradient * r.force;
                let curve = length.hessian * r.force + length.gradient * length.gradient.transpose() * r.stiffness;
                if band.tibial {
                    sums.add(r.energy, (&by, &curve), &Place::new(own, &fibre.patella), &Place::new(knee, &fibre.far));
                } else {
                    fixed.pull(&mut stiffness, &near, r.energy, (&by, &curve));
                }
            }
        }
        fixed.stiffness = contact::symmetric(&stiffness);
        let mut response = ContactResponse::default();
        contact::accumulate(&mut response, &fixed, &contact::local_screws(own, &own.femur), (true, 1.0));
        sums.take(&response);
    }
}

/// A point of the body against which `pose` moves the femur, as the femur sees it.
fn seen_from_femur(pose: &Pose, p: &Vector) -> Vector {
    pose.femur.inverse_transform_point(&Point::from(*p)).coords
}

impl Group {
    /// Tension of all its fibres [N].
    fn tension(&self, own: &Pose, knee: &Pose) -> f64 {
        let length = |f: &Fibre| {
            let far = if self.tibial { seen_from_femur(knee, &f.far) } else { f.far };
            (seen_from_femur(own, &f.patella) - far).norm()
        };
        self.fibres.iter().map(|f| self.law.response(length(f) - f.initial + self.law.initial_stretch()).force).sum()
    }
}

/// The contact as that of a tibia.
fn contact_spec(own: &PatellaContactSpec) -> ContactSpec {
    ContactSpec {
        overclosure_mm: own.overclosure_mm.clone(),
        pressure_mpa: own.pressure_mpa.clone(),
        friction: 0.0,
        damping: 0.0,
        pairs: std::iter::once(&own.femur)
            .chain(&own.bone)
            .map(|femur| PairSpec { femur: femur.clone(), tibia: own.patella.clone() })
            .collect(),
        layer: None,
    }
}

/// Fibres and their law; the reference length is their mean.
fn band(spec: &BandSpec, tibial: bool) -> Result<Group, SimError> {
    let fault = |what: String| Err(SimError::Spec(format!("patella, {}: {what}", spec.name)));
    if spec.fibres.is_empty() {
        return fault("no fibres".into());
    }
    let mut fibres = Vec::new();
    for (i, f) in spec.fibres.iter().enumerate() {
        let initial = (f.patella - f.far).norm();
        if !(initial > 1e-3 && initial < 1e4) {
            return fault(format!("fibres[{i}] has a length of {initial} mm"));
        }
        fibres.push(Fibre { patella: f.patella.coords, far: f.far.coords, initial });
    }
    let bundle = BundleSpec {
        name: spec.name.clone(),
        reference_strain: spec.reference_strain,
        stiffness_n_per_mm: spec.stiffness_n_per_mm,
        reference_length_mm: fibres.iter().map(|f| f.initial).sum::<f64>() / fibres.len() as f64,
        toe_strain: spec.toe_strain,
        law: crate::spec::Law::Smooth,
        damping_n_s_per_mm: 0.0,
    };
    let mut law = crate::ligament::bundle(&bundle, None)?;
    law.fibres = fibres.len();
    Ok(Group { law, tibial, fibres })
}

/// Heads and the cylinder they wrap over.
fn quadriceps(spec: &QuadricepsSpec, frames: &FramesSpec) -> Result<(Vec<Head>, Cylinder), SimError> {
    let fault = |what: String| Err(SimError::Spec(format!("patella.quadriceps: {what}")));
    let sum: f64 = spec.heads.iter().map(|h| h.share).sum();
    let shares = spec.heads.iter().all(|h| (0.0..=1.0).contains(&h.share));
    if !(shares && (sum - 1.0).abs() < 1e-6) {
        return fault(format!("the shares of its heads sum to {sum}, expected 1 of shares from 0 to 1"));
    }
    let (radius, axis) = (spec.wrap_radius_mm, spec.wrap.direction);
    if !((axis.norm() - 1.0).abs() < 1e-3 && radius > 0.0 && radius < 1e3) {
        return fault(format!(
            "wrap_radius_mm is {radius}, wrap.direction of length {}; expected above 0, and 1",
            axis.norm()
        ));
    }
    let axis = axis.normalize();
    let front = frames.femur.anterior - axis * axis.dot(&frames.femur.anterior);
    if front.norm() < 0.1 {
        return fault("the cylinder's axis points forwards, expected across the knee".into());
    }
    let front = front.normalize();
    let up = axis.cross(&front);
    let up = if up.dot(&frames.femur.superior) < 0.0 { -up } else { up };
    let head = |h: &HeadSpec| Head { share: h.share, patella: h.patella.coords, femur: h.femur.coords };
    let heads: Vec<Head> = spec.heads.iter().map(head).collect();
    if heads.iter().any(|h| !((h.patella - h.femur).norm() > 1.0 && (h.patella - h.femur).norm() < 1e4)) {
        return fault("a head has no length".into());
    }
    Ok((heads, Cylinder { point: spec.wrap.point.coords, axes: [axis, front, up], radius }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tendon_beyond_the_pull_is_told_at_any_tension() {
        let is_held = |quadriceps_n: f64, share: f64| {
            let tendon_n = share * quadriceps_n;
            let (pose, retinacula) = (Six::zeros(), vec![]);
            PatellaState { pose, quadriceps_n, tendon_n, retinacula, contact_n: 0.0, area_mm2: 0.0, unbalanced_n: 0.0 }
                .is_held()
        };
        for tension in [1.0, 10.0, 1000.0] {
            assert!(is_held(tension, 4.4) && is_held(tension, 1.31), "{tension}");
            assert!(!is_held(tension, 1.29) && !is_held(tension, 0.6), "{tension}");
        }
    }
}

//! A specification compiled once into an immutable model: the joint chain, the fibres, the contact, and their total energy,
//! generalised gradient and tangent over the chain's coordinates.
//!
//! A model with other ligament parameters, without some bundles or with a scaled contact law shares the contact fields of the first.

mod check;

use crate::condensed::{Condensed, Inner, Rest, condense};
use crate::contact::compartment::COMPARTMENTS;
use crate::contact::{Contact, ContactOptions, ContactResponse, Nearby};
use crate::coordinate::Six;
use crate::error::SimError;
use crate::joint::{Joint, Pose};
use crate::laxity::LaxityTrial;
use crate::ligament::{self, Bundle, Fibre, Line, Response};
use crate::mesh::MeshValue;
use crate::names::is_of;
use crate::patella::{self, Patella, PatellaState};
use crate::spec::{BundleSpec, ModelSpec};
use crate::wrap;
use meshes::Vector;
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A compiled knee. Cloning it is cheap: contact surfaces are shared.
#[derive(Clone, Debug)]
pub struct Model {
    /// Specimen name.
    pub id: String,
    /// The joint chain.
    pub joint: Joint,
    /// Ligament bundles in the order of the specification.
    pub bundles: Vec<Bundle>,
    /// Their fibres.
    pub fibres: Vec<Fibre>,
    /// Cartilage contact.
    pub contact: Contact,
    /// Bodies between femur and tibia with coordinates of their own.
    pub(crate) bodies: Vec<Arc<dyn Inner>>,
    /// The femur's mass [tonne] and rotary inertia [tonne mm2] for explicit dynamics.
    pub femur_mass: (f64, f64),
    /// The patella; it is among the bodies while the quadriceps pull.
    pub(crate) patella: Option<Arc<Patella>>,
    /// Which bundles are cut.
    removed: Vec<bool>,
    /// Another contact of the same cartilage, and its share [-].
    second: Option<(Contact, f64)>,
}

/// What a calibration may change of a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundleParameters {
    /// Ratio of length to slack length in the CT pose [-].
    pub reference_strain: f64,
    /// Of the whole bundle [N/mm].
    pub stiffness_n_per_mm: f64,
    /// Toe strain [-].
    pub toe_strain: f64,
}

/// A fibre at a pose.
#[derive(Clone, Copy, Debug)]
pub struct FibreState {
    /// Its line.
    pub line: Line,
    /// Its tension, energy and stiffness.
    pub response: Response,
}

/// Energy of ligaments, contact and bodies in between at a pose, with derivatives by the coordinates (order of [`crate::joint`]).
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// The pose.
    pub pose: Pose,
    /// Energy [N mm].
    pub energy: f64,
    /// Its gradient [N mm, N].
    pub gradient: Six,
    /// Its second derivative.
    pub hessian: Matrix6<f64>,
    /// Every fibre, slack where its bundle is cut.
    pub fibres: Vec<FibreState>,
    /// The contact's share.
    pub contact: ContactResponse,
    /// Each body in between, at rest.
    pub bodies: Vec<Condensed>,
}

/// Compiles a specification; `meshes` by the paths it names (bones may be absent, contact surfaces may not).
///
/// Errors: what is not finite, zero masses, a missing, empty, open (bones) or inside-out surface, a fibre without bundle, bad frames.
pub fn compile(spec: &ModelSpec, meshes: &BTreeMap<String, MeshValue>) -> Result<Model, SimError> {
    compile_with(spec, meshes, &ContactOptions::default())
}

/// [`compile`] with contact options.
pub fn compile_with(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    options: &ContactOptions,
) -> Result<Model, SimError> {
    let femur_mass = check::bodies(spec, meshes)?;
    let surfaces = check::contact_surfaces(spec, meshes)?;
    let joint = Joint::new(&spec.frames, spec.side)?;
    let (bundles, mut fibres) = ligament::compile(spec)?;
    crate::ligament::lay(spec, meshes, &mut fibres)?;
    let contact = Contact::new(spec, &surfaces, options)?;
    let removed = vec![false; bundles.len()];
    let menisci = crate::menisci::compile(spec, &contact)?;
    let bodies = menisci.into_iter().map(|m| Arc::new(m) as Arc<dyn Inner>).collect();
    let patella = Patella::new(spec, &surfaces, options)?.map(Arc::new);
    Ok(Model {
        id: spec.id.clone(),
        joint,
        bundles,
        fibres,
        contact,
        bodies,
        femur_mass,
        patella,
        removed,
        second: None,
    })
}

impl Model {
    /// Bundle names, in the order of every list of forces.
    pub fn bundle_names(&self) -> Vec<String> {
        self.bundles.iter().map(|b| b.name.clone()).collect()
    }

    /// The model with bundles cut: each name is a bundle's, or a ligament's ("ACL" cuts ACL_AM and ACL_PL). A name may also be that of a body in
    /// between ("meniscus_medial"), which is taken out.
    ///
    /// Errors: a name that fits no bundle and no body.
    pub fn without(&self, names: &[String]) -> Result<Model, SimError> {
        let mut model = self.clone();
        for name in names {
            let bodies = model.bodies.len();
            model.bodies.retain(|b| b.name() != name);
            let mut found = model.bodies.len() < bodies;
            for (bundle, removed) in self.bundles.iter().zip(&mut model.removed) {
                if is_of(&bundle.name, name) {
                    (*removed, found) = (true, true);
                }
            }
            if !found {
                let known = self.bundle_names().join(", ");
                let mut names: Vec<String> = self.bundle_names().to_vec();
                names.extend(self.bundle_names().iter().filter_map(|b| Some(b.split_once('_')?.0.to_owned())));
                let near = crate::names::did_you_mean(name, &names);
                return Err(SimError::Input(format!("no bundle is named {name:?}{near}; the model has {known}")));
            }
        }
        Ok(model)
    }

    /// Whether a bundle is cut.
    pub fn is_removed(&self, bundle: usize) -> bool {
        self.removed[bundle]
    }

    /// The parameters of every bundle.
    pub fn parameters(&self) -> Vec<BundleParameters> {
        let of = |b: &Bundle| BundleParameters {
            reference_strain: b.reference_strain,
            stiffness_n_per_mm: b.stiffness,
            toe_strain: b.toe_strain,
        };
        self.bundles.iter().map(of).collect()
    }

    /// The model with other ligament parameters, one set a bundle; contact is shared.
    ///
    /// Errors: a number out of range, another number of sets than bundles.
    pub fn with_parameters(&self, parameters: &[BundleParameters]) -> Result<Model, SimError> {
        if parameters.len() != self.bundles.len() {
            return Err(SimError::Input(format!(
                "{} sets of parameters for {} bundles",
                parameters.len(),
                self.bundles.len()
            )));
        }
        let mut model = self.clone();
        for (bundle, p) in model.bundles.iter_mut().zip(parameters) {
            let ok = p.reference_strain >= 0.05 && p.stiffness_n_per_mm >= 0.0 && p.toe_strain >= 1e-6;
            if !(ok && [p.reference_strain, p.stiffness_n_per_mm, p.toe_strain].iter().all(|x| x.is_finite())) {
                return Err(SimError::Input(format!("bundle {}: parameters {p:?} are out of range", bundle.name)));
            }
            bundle.reference_strain = p.reference_strain;
            bundle.stiffness = p.stiffness_n_per_mm.max(1e-12);
            bundle.toe_strain = p.toe_strain;
        }
        Ok(model)
    }

    /// The model with contact pressures multiplied by `scale` [-].
    pub fn with_contact_scale(&self, scale: f64) -> Result<Model, SimError> {
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(SimError::Input(format!("contact scale {scale}, expected above 0")));
        }
        let mut model = self.clone();
        model.contact.scale *= scale;
        if let Some((second, _)) = &mut model.second {
            second.scale *= scale;
        }
        Ok(model)
    }

    /// The model with a second contact of the same cartilage beside its own, of no share yet: one pass over the tibia's nodes of `other`. Where
    /// contact laws differ, as past a rim, the truth may lie between. Explicit dynamics and friction know the first alone.
    pub fn with_second_contact(&self, other: &Model) -> Model {
        let mut model = self.clone();
        model.second = Some((Contact { tibial_only: true, ..other.contact.clone() }, 0.0));
        model
    }

    /// Whether there is a second contact.
    pub fn has_second_contact(&self) -> bool {
        self.second.is_some()
    }

    /// The model with a share of its second contact [-]; without one, the model itself.
    ///
    /// Errors: a share outside 0 to 1.
    pub fn with_second_share(&self, share: f64) -> Result<Model, SimError> {
        if !(0.0..=1.0).contains(&share) {
            return Err(SimError::Input(format!("share {share} of the second contact, expected 0 to 1")));
        }
        let mut model = self.clone();
        if let Some((_, own)) = &mut model.second {
            *own = share;
        }
        Ok(model)
    }

    /// The contact at a pose, the second's share included.
    pub fn contact_near(&self, pose: &Pose, near: &mut Nearby) -> ContactResponse {
        let passes = 2 * self.contact.pairs.len();
        match &self.second {
            Some((second, share)) if *share >= 1.0 => second.evaluate_from(pose, near, passes),
            Some((second, share)) if *share > 0.0 => {
                let first = self.contact.evaluate_near(pose, near);
                first.blended(&second.evaluate_from(pose, near, passes), *share)
            }
            _ => self.contact.evaluate_near(pose, near),
        }
    }

    /// Whether there is a patella.
    pub fn has_patella(&self) -> bool {
        self.patella.is_some()
    }

    /// The model under tension of the quadriceps [N]; without tension the patella acts on nothing.
    ///
    /// Errors: a tension that is negative or not finite; tension in a model without a patella.
    pub fn with_quadriceps(&self, tension: f64) -> Result<Model, SimError> {
        if !(0.0..1e5).contains(&tension) {
            return Err(SimError::Input(format!("tension of the quadriceps {tension} N, expected 0 to 100000")));
        }
        let mut model = self.clone();
        model.bodies.retain(|b| b.name() != patella::NAME);
        match &self.patella {
            _ if tension == 0.0 => {}
            Some(patella) => {
                let pulled = Arc::new(patella.with_tension(tension));
                model.patella = Some(pulled.clone());
                model.bodies.push(pulled);
            }
            None => {
                return Err(SimError::Input(format!(
                    "load_quadriceps_n is {tension}, but the model has no patella to pull on; build it with assemble.patella, or leave the load out"
                )));
            }
        }
        Ok(model)
    }

    /// The patella in equilibrium, where the quadriceps pull.
    pub fn patella_state(&self, evaluation: &Evaluation) -> Option<PatellaState> {
        let place = self.bodies.iter().position(|b| b.name() == patella::NAME)?;
        Some(self.patella.as_ref()?.state(&evaluation.pose, &evaluation.bodies.get(place)?.inner))
    }

    /// What is odd about the patella's place at Grood-Suntay coordinates [rad, mm], where the quadriceps pull.
    pub(crate) fn patella_doubts(&self, gs: &Six, evaluation: &Evaluation) -> Option<patella::Doubts> {
        let place = self.bodies.iter().position(|b| b.name() == patella::NAME)?;
        let q = self.joint.coordinates(gs).ok()?;
        Some(self.patella.as_ref()?.doubts(&q, &evaluation.bodies.get(place)?.inner))
    }

    /// Generalised force [N mm, N] of the patella under a tension of the quadriceps [N]; zero without patella or tension.
    pub fn pull_of_quadriceps(&self, q: &Six, tension: f64) -> Six {
        match &self.patella {
            Some(patella) if tension > 0.0 => {
                let body = patella.with_tension(tension);
                -condense(&body, (q, &self.joint.pose(q)), &mut Rest::default()).gradient
            }
            _ => Six::zeros(),
        }
    }

    /// [`Model::with_quadriceps`], or the model itself where they do not pull.
    ///
    /// # Errors
    /// As [`Model::with_quadriceps`].
    pub fn pulled(&self, tension: f64) -> Result<Cow<'_, Model>, SimError> {
        if tension == 0.0 { Ok(Cow::Borrowed(self)) } else { self.with_quadriceps(tension).map(Cow::Owned) }
    }

    /// The model as a trial has it: with what was cut, under the tension of its quadriceps. What a column of a trial does to the knee itself belongs here.
    ///
    /// # Errors
    /// As [`Model::without`] and [`Model::with_quadriceps`].
    pub fn in_trial(&self, trial: &LaxityTrial) -> Result<Cow<'_, Model>, SimError> {
        if trial.without.is_empty() {
            return self.pulled(trial.quadriceps_n);
        }
        let cut = self.without(&trial.without).map_err(|e| match e {
            SimError::Input(what) => SimError::Input(format!("column \"without\": {what}; names are joined by +")),
            other => other,
        })?;
        Ok(Cow::Owned(cut.pulled(trial.quadriceps_n)?.into_owned()))
    }

    /// The model with another friction coefficient [-].
    pub fn with_friction(&self, friction: f64) -> Result<Model, SimError> {
        if !(0.0..10.0).contains(&friction) {
            return Err(SimError::Input(format!("friction {friction}, expected 0 to 10")));
        }
        let mut model = self.clone();
        model.contact.friction = friction;
        Ok(model)
    }

    /// The model of another specification of the same knee: with its frames, bundles, ends of fibres and contact law. Surfaces, friction and bodies in
    /// between stay as they are. As [`compile`] makes it, to the last digit, where distances are tabulated in the same frames.
    ///
    /// # Errors
    /// Bundles or fibres that are not as many; numbers out of range.
    pub fn respecified(&self, spec: &ModelSpec) -> Result<Model, SimError> {
        if spec.fibres.len() != self.fibres.len() {
            let counts = (spec.fibres.len(), self.fibres.len());
            return Err(SimError::Spec(format!("{} fibres, expected the model's {}", counts.0, counts.1)));
        }
        let of = |b: &BundleSpec| BundleParameters {
            reference_strain: b.reference_strain,
            stiffness_n_per_mm: b.stiffness_n_per_mm,
            toe_strain: b.toe_strain,
        };
        let mut model = self.with_parameters(&spec.bundles.iter().map(of).collect::<Vec<_>>())?;
        model.joint = Joint::new(&spec.frames, spec.side)?;
        for (fibre, f) in model.fibres.iter_mut().zip(&spec.fibres) {
            *fibre = fibre.with_ends(f.femur.coords, f.tibia.coords);
        }
        let contact = model.contact.with_law(&spec.contact.overclosure_mm, &spec.contact.pressure_mpa)?;
        model.contact = match &spec.contact.layer {
            Some(layer) => contact.with_layer(layer)?,
            None => contact,
        };
        Ok(model)
    }

    /// The model with a fibre's ends moved in the CT pose; the bundle's reference length stays.
    pub fn with_fibre_ends(&self, fibre: usize, femur: meshes::Point, tibia: meshes::Point) -> Result<Model, SimError> {
        let length = (femur - tibia).norm();
        if fibre >= self.fibres.len() || !(length > 1e-3 && length < 1e4) {
            return Err(SimError::Input(format!("fibre {fibre} of {}, length {length} mm", self.fibres.len())));
        }
        let mut model = self.clone();
        let f = &mut model.fibres[fibre];
        *f = f.with_ends(femur.coords, tibia.coords);
        Ok(model)
    }

    /// The model with one bundle more, its last, of fibres between femoral and tibial ends in the CT pose; contact is shared. `table_end` as in [`Bundle`].
    ///
    /// Errors: a name that another bundle has, a number out of range, no fibre or one without length.
    pub fn with_bundle(
        &self,
        bundle: &BundleSpec,
        table_end: Option<f64>,
        ends: &[[meshes::Point; 2]],
    ) -> Result<Model, SimError> {
        let fault = |what: String| SimError::Input(format!("bundle {}: {what}", bundle.name));
        if ends.is_empty() {
            return Err(fault("it has no fibres".into()));
        }
        if self.bundles.iter().any(|b| b.name == bundle.name) {
            return Err(fault("another bundle has this name".into()));
        }
        let number = self.bundles.len();
        let fibre = |e| ligament::fibre(number, e).map_err(|length| fault(format!("a fibre has length {length} mm")));
        let fibres = ends.iter().map(fibre).collect::<Result<Vec<_>, _>>()?;
        let mut model = self.clone();
        model.bundles.push(ligament::of_fibres(bundle, fibres.len(), table_end)?);
        model.fibres.extend(fibres);
        model.removed.push(false);
        Ok(model)
    }

    /// Stretch of a fibre of length `length` [mm].
    pub(crate) fn stretch(&self, fibre: &Fibre, length: f64) -> f64 {
        length - fibre.initial_length + self.bundles[fibre.bundle].initial_stretch()
    }

    /// Every fibre at a pose.
    pub fn fibre_states(&self, pose: &Pose) -> Vec<FibreState> {
        let mut cold = Nearby::once();
        (0..self.fibres.len()).map(|f| self.drawn(f, pose, &mut cold, false).0).collect()
    }

    /// One fibre at a pose.
    pub fn fibre_state(&self, fibre: usize, pose: &Pose) -> FibreState {
        self.drawn(fibre, pose, &mut Nearby::once(), false).0
    }

    /// [`Model::fibre_states`], quicker where `near` knows how they lay close by. A fibre that is slack all the same may be told longer than it is.
    pub(crate) fn fibre_states_near(&self, pose: &Pose, near: &mut Nearby) -> Vec<FibreState> {
        (0..self.fibres.len()).map(|f| self.drawn(f, pose, near, true).0).collect()
    }

    /// A fibre at a pose, and its path where it touches bone; `only_tight`: the length of a slack one need not be known.
    fn drawn(&self, f: usize, pose: &Pose, near: &mut Nearby, only_tight: bool) -> (FibreState, Option<wrap::Path>) {
        let fibre = &self.fibres[f];
        if self.removed[fibre.bundle] || fibre.wrap.is_none() {
            let line = fibre.straight_line(pose);
            return (self.state_of(fibre, line), None);
        }
        let slack = fibre.initial_length - self.bundles[fibre.bundle].initial_stretch();
        let path = fibre.path(pose, near.laid(f), if only_tight { slack } else { 0.0 });
        let line = match &path {
            Some(path) => path.line(pose, (pose.femur * meshes::Point::from(fibre.femur)).coords),
            None => fibre.straight_line(pose),
        };
        (self.state_of(fibre, line), path)
    }

    fn state_of(&self, fibre: &Fibre, line: Line) -> FibreState {
        let response = if self.removed[fibre.bundle] {
            Response::default()
        } else {
            self.bundles[fibre.bundle].response(self.stretch(fibre, line.length))
        };
        FibreState { line, response }
    }

    /// Tension of each bundle [N], the sum over its fibres.
    pub fn bundle_forces(&self, fibres: &[FibreState]) -> Vec<f64> {
        let mut forces = vec![0.0; self.bundles.len()];
        for (fibre, state) in self.fibres.iter().zip(fibres) {
            forces[fibre.bundle] += state.response.force;
        }
        forces
    }

    /// Energy, gradient and tangent of ligaments and contact at coordinates `q`.
    pub fn evaluate(&self, q: &Six) -> Evaluation {
        self.evaluate_parts(q, true)
    }

    /// [`Model::evaluate`], with or without contact.
    pub fn evaluate_parts(&self, q: &Six, with_contact: bool) -> Evaluation {
        let pose = self.joint.pose(q);
        let mut once = Nearby::once();
        if !with_contact {
            return self.evaluation(pose, ContactResponse::default(), Vec::new(), &mut once);
        }
        let contact = self.contact_near(&pose, &mut once);
        let bodies = self.bodies_near((q, &pose), &mut once);
        self.evaluation(pose, contact, bodies, &mut once)
    }

    /// [`Model::evaluate`], quicker where `near` holds the lists of a pose close by.
    pub fn evaluate_near(&self, q: &Six, near: &mut Nearby) -> Evaluation {
        let pose = self.joint.pose(q);
        let contact = self.contact_near(&pose, near);
        let bodies = self.bodies_near((q, &pose), near);
        self.evaluation(pose, contact, bodies, near)
    }

    /// The bodies in between, at rest at a pose.
    pub(crate) fn bodies_near(&self, (q, pose): (&Six, &Pose), near: &mut Nearby) -> Vec<Condensed> {
        let rest = |(n, body): (usize, &Arc<dyn Inner>)| condense(&**body, (q, pose), near.rest(n));
        self.bodies.iter().enumerate().map(rest).collect()
    }

    /// What cartilage and the bodies in between tell of themselves at an equilibrium: names with their units, values.
    ///
    /// `contact_ml_n`, `contact_ap_n`, `contact_si_n` are the cartilage's force on the tibia in the tibial frame; then come the compartments.
    pub fn outputs(&self, evaluation: &Evaluation) -> Vec<(String, f64)> {
        let compartments = self.contact.compartments(&evaluation.pose, self.joint.tibia());
        let whole: Vector = compartments.iter().map(|c| c.force).sum();
        let names = ["contact_ml_n", "contact_ap_n", "contact_si_n"].map(str::to_owned);
        let each = COMPARTMENTS.iter().zip(&compartments).flat_map(|(name, c)| c.outputs(name));
        let bodies = self.bodies.iter().zip(&evaluation.bodies);
        let bodies = bodies.flat_map(|(body, rest)| body.outputs(&evaluation.pose, &rest.inner));
        names.into_iter().zip(whole.iter().copied()).chain(each).chain(bodies).collect()
    }

    fn evaluation(
        &self,
        pose: Pose,
        contact: ContactResponse,
        bodies: Vec<Condensed>,
        near: &mut Nearby,
    ) -> Evaluation {
        let (mut energy, mut gradient, mut hessian) = (contact.energy, contact.gradient, contact.hessian);
        for body in &bodies {
            energy += body.energy;
            gradient += body.gradient;
            hessian += body.hessian;
        }
        let mut fibres = Vec::with_capacity(self.fibres.len());
        for f in 0..self.fibres.len() {
            let (state, path) = self.drawn(f, &pose, near, true);
            let FibreState { line, response } = &state;
            if response.energy > 0.0 {
                energy += response.energy;
                gradient += line.gradient * response.force;
                match path {
                    Some(path) => {
                        let along = line.gradient * line.gradient.transpose() * response.stiffness;
                        hessian += path.curve(&pose) * response.force + along;
                    }
                    None => {
                        ligament::add_hessian(&mut hessian, line, &pose, response.force, response.stiffness);
                    }
                }
            }
            fibres.push(state);
        }
        Evaluation { pose, energy, gradient, hessian, fibres, contact, bodies }
    }
}

//! Derivatives of an answer by every parameter.

use super::{Answer, Knee, Quantity, Trials, pressed, shares};
use crate::frames::{STEP, Terms};
use crate::trial::Trial;
use meshes::Isometry;
use nalgebra::{DMatrix, Matrix6};
use sim::Model;
use sim::SimError;
use sim::contact::Nearby;
use sim::coordinate::{FE, FREE, Free, Load, Six, free_block, free_part};
use sim::joint::{Joint, Pose};
use sim::sensitivity::{Parameter as Of, Sensitivities, sensitivities};
use sim::trials::{chain_flexion, pose_spec};
use std::ops::Range;

/// Step of the derivative by cartilage thickness [mm].
const CARTILAGE_STEP: f64 = 0.02;

/// Derivatives of an answer, a column a parameter, per unit of its value.
pub(super) struct Jacobian {
    /// Of VV, IE [deg], ML, AP, SI [mm]: 5 rows.
    pub(super) predicted: DMatrix<f64>,
    /// Of the bundle forces [N]: a row a bundle.
    pub(super) forces_n: DMatrix<f64>,
    coordinates: DMatrix<f64>,
}

/// What an answer changes by, one parameter's column.
type Column = (Free<f64>, Vec<f64>, Six);

impl Trials<'_> {
    /// An answer with its derivatives.
    pub(super) fn with_jacobian(
        &self,
        knee: &Knee,
        model: &Model,
        trial: &Trial,
        found: sim::trials::Answer,
        near: &mut Nearby,
    ) -> Result<(Answer, Jacobian), SimError> {
        let (asked, place) = self.columns(&knee.values);
        let s = sensitivities(model, &found, &asked)?;
        let force = pressed(&found.evaluation.contact.wrench);
        let (bundles, n) = (model.bundles.len(), self.parameters.len());
        let mut jacobian = Jacobian {
            predicted: DMatrix::zeros(5, n),
            forces_n: DMatrix::zeros(bundles, n),
            coordinates: DMatrix::zeros(6, n),
        };
        let frames = FrameJacobian::new(self, model, knee.of(trial).1, trial, &found)?;
        let mut known: [Option<Column>; 12] = Default::default();
        for (k, p) in self.parameters.iter().enumerate() {
            let column = match &p.quantity {
                Quantity::Frame(source, term) => {
                    if source.is_some() && *source != trial.source {
                        continue;
                    }
                    match &known[*term] {
                        Some(column) => column.clone(),
                        None => known[*term].insert(frames.by(*term)?).clone(),
                    }
                }
                Quantity::Cartilage => self.by_cartilage(model, (&found, near), &s)?,
                Quantity::Lean(coordinate, knot) => {
                    let mut load = Load::default();
                    load[*coordinate] = force * shares(trial.record.fe_deg)[*knot];
                    by_loads(&s, &load)
                }
                Quantity::Resting(source, coordinate) => {
                    let mut load = Load::default();
                    load[*coordinate] = f64::from(trial.source == Some(*source));
                    by_loads(&s, &load)
                }
                Quantity::ReferenceStrain(_) | Quantity::Stiffness(_) | Quantity::Site(..) | Quantity::ContactScale => {
                    sum(&s, &place[k])
                }
                // of the apparatus: it moves what is read, not the knee
                Quantity::Compliance(..) => continue,
            };
            FREE.into_iter().for_each(|c| jacobian.predicted[(c.free_index(), k)] = column.0[c]);
            (0..bundles).for_each(|b| jacobian.forces_n[(b, k)] = column.1[b]);
            jacobian.coordinates.set_column(k, &column.2);
        }
        let by_load = Free::from_fn(|c| Free::from_fn(|l| s.pose[(c.free_index(), l.free_index())]));
        let answer = Answer {
            q: found.state.q,
            pressed: force,
            predicted: found.predicted(),
            forces_n: found.forces_n,
            coordinates: std::mem::replace(&mut jacobian.coordinates, DMatrix::zeros(0, 0)),
            by_load,
            near: near.lists(),
        };
        Ok((answer, jacobian))
    }

    /// What the solver is asked derivatives by, the five loads first, and which of those make each parameter's, each times a factor.
    fn columns(&self, values: &[f64]) -> (Vec<Of>, Vec<(Range<usize>, f64)>) {
        let mut asked: Vec<Of> = FREE.map(Of::Load).to_vec();
        let place = self.parameters.iter().zip(values).map(|(p, x)| {
            let from = asked.len();
            let factor = p.quantity.numbers(*x).map_or(0.0, |(numbers, factor)| {
                asked.extend(numbers);
                factor
            });
            (from..asked.len(), factor)
        });
        let place = place.collect();
        (asked, place)
    }

    /// By cartilage thicker than the model's: what the contact then pushes more.
    fn by_cartilage(
        &self,
        model: &Model,
        (found, near): (&sim::trials::Answer, &mut Nearby),
        s: &Sensitivities,
    ) -> Result<Column, SimError> {
        let now: f64 = self.thickness(model);
        let law = &self.spec.contact;
        let shifted: Vec<f64> = law.overclosure_mm.iter().map(|x| x - now - CARTILAGE_STEP).collect();
        let thicker = model.contact.with_law(&shifted, &law.pressure_mpa)?;
        let other = thicker.evaluate_near(&found.evaluation.pose, near).gradient;
        let push = (found.evaluation.contact.gradient - other) / CARTILAGE_STEP;
        let load = Load::from_fn(|c| push[c] / c.to_force(1.0));
        Ok(by_loads(s, &load))
    }

    /// By how much the model's cartilage is thicker than its specification's [mm].
    fn thickness(&self, model: &Model) -> f64 {
        self.spec.contact.overclosure_mm.first().map_or(0.0, |x| x - model.contact.starts_at())
    }
}

/// Derivatives by one quantity: of VV, IE [deg], ML, AP, SI [mm], and of the bundle forces [N].
pub type ByOne = (Free<f64>, Vec<f64>);

/// Derivatives of an answer by quantities that are the model's own numbers, at their values, an entry a quantity.
///
/// # Errors
/// A quantity that stands beside the model; one that it does not have; a singular tangent.
pub fn by_the_model(
    model: &Model,
    found: &sim::trials::Answer,
    at: impl Iterator<Item = (Quantity, f64)>,
) -> Result<Vec<ByOne>, SimError> {
    let (mut asked, mut place) = (Vec::new(), Vec::new());
    for (quantity, x) in at {
        let beside = || SimError::Input(format!("{quantity:?} is no number of the model"));
        let (numbers, factor) = quantity.numbers(x).ok_or_else(beside)?;
        place.push((asked.len()..asked.len() + numbers.len(), factor));
        asked.extend(numbers);
    }
    let s = sensitivities(model, found, &asked)?;
    let by = |of: &(Range<usize>, f64)| {
        let (pose, forces_n, _) = sum(&s, of);
        (pose, forces_n)
    };
    Ok(place.iter().map(by).collect())
}

/// The sum of some columns times a factor.
fn sum(s: &Sensitivities, (columns, factor): &(Range<usize>, f64)) -> Column {
    let mut out = (Free::all(0.0), vec![0.0; s.forces_n.nrows()], Six::zeros());
    for k in columns.clone() {
        FREE.into_iter().for_each(|c| out.0[c] += factor * s.pose[(c.free_index(), k)]);
        out.1.iter_mut().zip(s.forces_n.column(k).iter()).for_each(|(x, d)| *x += factor * d);
        out.2 += s.coordinates.column(k) * *factor;
    }
    out
}

/// By a load [N m, N], from the first five columns.
fn by_loads(s: &Sensitivities, load: &Load) -> Column {
    let mut out = (Free::all(0.0), vec![0.0; s.forces_n.nrows()], Six::zeros());
    for (k, l) in load.iter().enumerate().filter(|(_, l)| **l != 0.0) {
        FREE.into_iter().for_each(|c| out.0[c] += l * s.pose[(c.free_index(), k)]);
        out.1.iter_mut().zip(s.forces_n.column(k).iter()).for_each(|(x, d)| *x += l * d);
        out.2 += s.coordinates.column(k) * *l;
    }
    out
}

/// Corrections by which coordinates are found in frames turned by [`STEP`]: each takes the error times the step; three leave less than
/// differences do.
const CHORDS: usize = 3;

/// Derivatives by frames of one answer.
struct FrameJacobian<'a> {
    trials: &'a Trials<'a>,
    model: &'a Model,
    terms: &'a Terms,
    found: &'a sim::trials::Answer,
    flexion: f64,
    gs: Six,
    /// Of the coordinates by the Grood-Suntay coordinates.
    by_gs: Matrix6<f64>,
    /// Of the bundle forces by the coordinates: a row a bundle.
    forces: DMatrix<f64>,
    tangent: nalgebra::LU<f64, nalgebra::Const<5>, nalgebra::Const<5>>,
}

impl<'a> FrameJacobian<'a> {
    fn new(
        trials: &'a Trials<'a>,
        model: &'a Model,
        terms: &'a Terms,
        trial: &Trial,
        found: &'a sim::trials::Answer,
    ) -> Result<FrameJacobian<'a>, SimError> {
        let free = free_block(&found.evaluation.hessian);
        let tangent = (free + free.transpose()) * 0.5;
        let flexion = chain_flexion(model, trial.record.fe_deg, trials.options)? + model.joint.ct_pose()[FE];
        let gs = model.joint.grood_suntay_of(&model.joint.pose(&found.state.q).femur);
        let by_gs = model.joint.grood_suntay_derivative(&found.state.q).try_inverse().ok_or_else(singular)?;
        let mut forces = DMatrix::zeros(model.bundles.len(), 6);
        for (fibre, state) in model.fibres.iter().zip(&found.evaluation.fibres) {
            let mut row = forces.row_mut(fibre.bundle);
            row += state.line.gradient.transpose() * state.response.stiffness;
        }
        Ok(FrameJacobian { trials, model, terms, found, flexion, gs, by_gs, forces, tangent: tangent.lu() })
    }

    /// By a turn or shift [per deg, per mm]: the same bones in the other frames, flexed to the trial's flexion and brought back to equilibrium by one
    /// Newton step; pull and forces there by their derivatives at the answer.
    fn by(&self, term: usize) -> Result<Column, SimError> {
        let (model, found) = (self.model, self.found);
        let mut moved = *self.terms;
        moved[term] += STEP;
        let other = self.trials.joint(&moved)?;
        let mut q = self.coordinates(&other, &model.joint.pose(&found.state.q).femur);
        q[FE] = self.flexion - other.ct_pose()[FE];
        // the pull there in the coordinates of the frames as they are, then as a wrench, then in the other frames' coordinates
        let there = other.pose(&q);
        let away = self.away(&there.femur);
        let pull = found.evaluation.gradient + found.evaluation.hessian * away;
        let same = screws(&model.joint.pose(&(found.state.q + away))).transpose();
        let wrench = same.lu().solve(&pull).ok_or_else(singular)?;
        let residual = screws(&there).transpose() * wrench - found.evaluation.gradient;
        let back = self.tangent.solve(&-free_part(&residual)).ok_or_else(singular)?;
        FREE.into_iter().for_each(|c| q[c] += back[c.free_index()]);
        let (now, before) = (pose_spec(&other.grood_suntay(&q)).free(), pose_spec(&self.gs).free());
        let forces = &self.forces * (self.away(&other.pose(&q).femur) / STEP);
        Ok((
            Free::from_fn(|c| (now[c] - before[c]) / STEP),
            forces.iter().copied().collect(),
            // starts in other frames are found from the place of the bones
            Six::zeros(),
        ))
    }

    /// Coordinates in another joint's frames, nearly the answer's, of a femur that stands nearly as in the answer.
    fn coordinates(&self, other: &Joint, femur: &Isometry) -> Six {
        let gs = other.grood_suntay_of(femur);
        (0..CHORDS).fold(self.found.state.q, |q, _| q + self.by_gs * (gs - other.grood_suntay(&q)))
    }

    /// How far a femur nearly as in the answer stands from it, in the coordinates of the answer's frames.
    fn away(&self, femur: &Isometry) -> Six {
        self.by_gs * (self.model.joint.grood_suntay_of(femur) - self.gs)
    }
}

fn singular() -> SimError {
    SimError::Solver("the tangent is singular: nothing holds the knee in one direction".into())
}

/// Velocities of the femur by the coordinates, a column each: angular, then linear.
fn screws(pose: &Pose) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| if i < 3 { pose.screws[j].angular[i] } else { pose.screws[j].linear[i - 3] })
}

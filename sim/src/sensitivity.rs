//! Sensitivities of an equilibrium by the implicit function theorem: how pose and bundle forces move with each parameter.
//!
//! At rest `r(q, p) = dE/dq - f + friction = 0` over the five free coordinates, so `dq/dp = -H^-1 dr/dp` with the exact tangent H of ligaments
//! and contact. Friction's forces are held as they are (they depend on the path, not on the parameter at its end); flexion is prescribed.

use crate::coordinate::{Coordinate, FE, FREE, LEVER_MM, Six, free_block, free_part};
use crate::error::SimError;
use crate::model::{Evaluation, Model};
use crate::trials::Answer;
pub use crate::wrap::End;
use crate::wrap::Laid;
use nalgebra::{DMatrix, Matrix3, Matrix5, SymmetricEigen, Vector3, Vector5};
use serde::{Deserialize, Serialize};

/// A number of the model or of the trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Parameter {
    /// Reference strain of a bundle, by index [-].
    ReferenceStrain(usize),
    /// Stiffness of a bundle, by index [N/mm].
    Stiffness(usize),
    /// A CT coordinate (0, 1, 2) of a fibre's end in the CT pose [mm]; the bundle's reference length stays.
    Attachment(usize, End, usize),
    /// The same of all fibres of a bundle together: its site moves.
    Site(usize, End, usize),
    /// A load on a free coordinate [N m, N].
    Load(Coordinate),
    /// Flexion [deg].
    Flexion,
    /// Factor on every contact pressure, 1 as the model is [-].
    ContactScale,
}

/// Derivatives of an answer, a column a parameter, per unit of the parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensitivities {
    /// Of VV, IE [deg], ML, AP, SI [mm]: 5 rows.
    pub pose: DMatrix<f64>,
    /// Of the bundle forces [N]: a row a bundle.
    pub forces_n: DMatrix<f64>,
    /// Of the joint's coordinates [rad, mm]: 6 rows.
    pub coordinates: DMatrix<f64>,
    /// Least eigenvalue of the tangent over the free coordinates, angles times 30 mm [N/mm]; not above 0 where the pose is not stable.
    pub least_stiffness: f64,
}

/// Every parameter of a model: strains and stiffnesses of the bundles, attachments, loads, flexion, contact scale.
pub fn all_parameters(model: &Model) -> Vec<Parameter> {
    let mut out: Vec<Parameter> =
        (0..model.bundles.len()).flat_map(|b| [Parameter::ReferenceStrain(b), Parameter::Stiffness(b)]).collect();
    for fibre in 0..model.fibres.len() {
        for end in [End::Femur, End::Tibia] {
            out.extend((0..3).map(|axis| Parameter::Attachment(fibre, end, axis)));
        }
    }
    out.extend(FREE.map(Parameter::Load));
    out.extend([Parameter::Flexion, Parameter::ContactScale]);
    out
}

/// Tangent stiffness of the free coordinates VV, IE [N mm/rad], ML, AP, SI [N/mm] at an answer, flexion prescribed.
pub fn tangent(answer: &Answer) -> Matrix5<f64> {
    let h = free_block(&answer.evaluation.hessian);
    (h + h.transpose()) * 0.5
}

/// Derivatives of pose and bundle forces by `parameters`.
///
/// Errors: a singular tangent (a pose that no load or ligament holds), a parameter the model does not have.
pub fn sensitivities(model: &Model, answer: &Answer, parameters: &[Parameter]) -> Result<Sensitivities, SimError> {
    let stiffness = tangent(answer);
    let arm = FREE.map(|c| if c.turns() { 1.0 / LEVER_MM } else { 1.0 });
    let scaled = Matrix5::from_fn(|i, j| stiffness[(i, j)] * arm[i] * arm[j]);
    let eigen = SymmetricEigen::new(scaled);
    let least = eigen.eigenvalues.min();
    if eigen.eigenvalues.iter().any(|e| e.is_nan() || e.abs() < 1e-6) {
        return Err(SimError::Solver("the tangent is singular: nothing holds the knee in one direction".into()));
    }
    let inverse = eigen.eigenvectors
        * Matrix5::from_diagonal(&eigen.eigenvalues.map(|e| 1.0 / e))
        * eigen.eigenvectors.transpose();
    let by_gs = model.joint.grood_suntay_derivative(&answer.state.q);
    let states = &answer.evaluation.fibres;
    let mut pose = DMatrix::zeros(5, parameters.len());
    let mut forces = DMatrix::zeros(model.bundles.len(), parameters.len());
    let mut coordinates = DMatrix::zeros(6, parameters.len());
    for (column, parameter) in parameters.iter().enumerate() {
        let direct = direct(model, &answer.evaluation, *parameter)?;
        let residual = free_part(&direct.residual).component_mul(&Vector5::from(arm));
        let moved = inverse * -residual;
        let mut dq = Six::zeros();
        dq[FE] = direct.flexion;
        FREE.iter().zip(&moved).zip(arm).for_each(|((&c, moved), arm)| dq[c] = moved * arm);
        coordinates.set_column(column, &dq);
        let gs = by_gs * dq;
        FREE.into_iter().for_each(|c| pose[(c.free_index(), column)] = c.to_file(gs[c]));
        for (fibre, state) in model.fibres.iter().zip(states) {
            forces[(fibre.bundle, column)] += state.response.stiffness * state.line.gradient.dot(&dq);
        }
        if let Some((bundle, force)) = direct.force {
            forces[(bundle, column)] += force;
        }
    }
    Ok(Sensitivities { pose, forces_n: forces, coordinates, least_stiffness: least })
}

/// What gets out of balance [N mm, N], per unit of a parameter, where the pose stays.
///
/// # Errors
/// A parameter the model does not have.
pub fn out_of_balance(model: &Model, at: &Evaluation, parameter: Parameter) -> Result<Six, SimError> {
    Ok(direct(model, at, parameter)?.residual)
}

/// What a parameter changes while the free coordinates stay.
#[derive(Default)]
struct Direct {
    residual: Six,
    /// Change of the prescribed flexion [rad].
    flexion: f64,
    /// Bundle and change of its force [N].
    force: Option<(usize, f64)>,
}

fn direct(model: &Model, answer: &Evaluation, parameter: Parameter) -> Result<Direct, SimError> {
    let unknown = || SimError::Input(format!("the model has no parameter {parameter:?}"));
    match parameter {
        Parameter::ReferenceStrain(b) if b < model.bundles.len() => Ok(law(model, answer, b, 0)),
        Parameter::Stiffness(b) if b < model.bundles.len() => Ok(law(model, answer, b, 1)),
        Parameter::Attachment(fibre, end, axis) if fibre < model.fibres.len() && axis < 3 => {
            Ok(attachment(model, answer, fibre, end, axis))
        }
        Parameter::Site(bundle, end, axis) if bundle < model.bundles.len() && axis < 3 => {
            let (mut residual, mut force) = (Six::zeros(), 0.0);
            for fibre in (0..model.fibres.len()).filter(|&f| model.fibres[f].bundle == bundle) {
                let one = attachment(model, answer, fibre, end, axis);
                residual += one.residual;
                force += one.force.map_or(0.0, |f| f.1);
            }
            Ok(Direct { residual, flexion: 0.0, force: Some((bundle, force)) })
        }
        Parameter::Load(c) if c != FE => {
            let mut residual = Six::zeros();
            residual[c] = -c.to_force(1.0);
            Ok(Direct { residual, ..Direct::default() })
        }
        Parameter::Flexion => {
            let flexion = 1f64.to_radians();
            let residual: Six = answer.hessian.column(FE.index()) * flexion;
            Ok(Direct { residual, flexion, force: None })
        }
        Parameter::ContactScale => Ok(Direct { residual: answer.contact.gradient, ..Direct::default() }),
        _ => Err(unknown()),
    }
}

/// A bundle's reference strain (0) or stiffness (1).
fn law(model: &Model, answer: &Evaluation, bundle: usize, which: usize) -> Direct {
    let (mut residual, mut force) = (Six::zeros(), 0.0);
    if !model.is_removed(bundle) {
        let fibres = model.fibres.iter().zip(&answer.fibres).filter(|(f, _)| f.bundle == bundle);
        for (fibre, state) in fibres {
            let longer = state.line.length - fibre.initial_length;
            let change = model.bundles[bundle].parameter_derivatives(longer)[which];
            residual += state.line.gradient * change;
            force += change;
        }
    }
    Direct { residual, flexion: 0.0, force: Some((bundle, force)) }
}

/// A coordinate of a fibre's end in the CT pose.
fn attachment(model: &Model, answer: &Evaluation, fibre: usize, end: End, axis: usize) -> Direct {
    let (f, state) = (&model.fibres[fibre], &answer.fibres[fibre]);
    let (line, response) = (&state.line, &state.response);
    let pose = &answer.pose;
    let unit = Vector3::ith(axis, 1.0);
    // displacement of the end, and change of the length in the CT pose
    let (moved, side) = match end {
        End::Femur => (pose.femur.rotation * unit, 1.0),
        End::Tibia => (unit, -1.0),
    };
    if let Some(wrap) = &f.wrap
        && !model.is_removed(f.bundle)
    {
        let before = wrap.initial(end).dot(&unit);
        if let Some(path) = f.path(pose, &mut Laid::default(), 0.0) {
            let stretch = path.by_end(end, &moved) - before;
            let turned = path.curve_by_end(pose, end, &moved) * response.force;
            let residual = line.gradient * (response.stiffness * stretch) + turned;
            return Direct { residual, flexion: 0.0, force: Some((f.bundle, response.stiffness * stretch)) };
        }
    }
    let initial = match &f.wrap {
        Some(wrap) => wrap.initial(end) * side,
        None => (f.femur - f.tibia) / f.initial_length,
    };
    let stretch = side * (line.direction.dot(&moved) - initial.dot(&unit));
    let across = (Matrix3::identity() - line.direction * line.direction.transpose()) * moved * (side / line.length);
    let mut residual = line.gradient * (response.stiffness * stretch);
    for j in 0..6 {
        let screw = &pose.screws[j];
        let mut turned = across.dot(&screw.at(&line.femur));
        if end == End::Femur {
            turned += line.direction.dot(&screw.angular.cross(&moved));
        }
        residual[j] += response.force * turned;
    }
    Direct { residual, flexion: 0.0, force: Some((f.bundle, response.stiffness * stretch)) }
}

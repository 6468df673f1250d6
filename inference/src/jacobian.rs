//! The Jacobian of a trial: what it reads by whatever may be unknown of the knee, a column a parameter.
//!
//! What a parameter puts out of balance where the bones stay is one thing for all that ask: [`columns`] says it, in one `match` on what a parameter is.
//! How a knee gives way to that is another. A calibration's knee is a model alone ([`crate::knee`]). A diagnosis' knee bears effects, is read with their
//! errors, and may depart from an unloaded pose. So each is a [`Rest`], and tells how it gives way.

use crate::frames::FrameSteps;
use crate::quantity::{Quantity, shares};
use crate::trial::Trial;
use sim::SimError;
use sim::coordinate::{Load, Six};
use sim::joint::Joint;
use sim::model::Evaluation;
use sim::sensitivity::Parameter as Number;

/// A knee at rest in a trial, as it gives way.
pub trait Rest {
    /// What an answer changes by.
    type Column: Clone;

    /// The column of what does not move it.
    fn still(&self) -> Self::Column;

    /// By numbers of the model: each entry's together by one unit, times its factor.
    ///
    /// # Errors
    /// A number that the model does not have; a singular tangent.
    fn by_numbers(&self, of: &[(Vec<Number>, f64)]) -> Result<Vec<Self::Column>, SimError>;

    /// By a generalised force that the knee bears beside its load [N mm, N].
    fn by_force(&self, force: &Six) -> Self::Column;

    /// By a turn or shift of a frame [per deg, per mm], of which the joint a step forward and back is given.
    ///
    /// # Errors
    /// A knee that is not asked this.
    fn by_frame(&self, steps: &[Joint; 2]) -> Result<Self::Column, SimError>;

    /// The model there.
    fn evaluation(&self) -> &Evaluation;

    /// The generalised force by which thicker cartilage pushes more [N mm, N per mm].
    ///
    /// # Errors
    /// A knee that is not asked this; a law that does not allow it.
    fn by_thickness(&self) -> Result<Six, SimError>;
}

/// Size of the contact force [N], over all pairs.
pub(crate) fn pressed(at: &Evaluation) -> f64 {
    at.contact.wrench.iter().map(|w| w.0).sum::<meshes::Vector>().norm()
}

/// Derivatives of a trial at its rest by quantities at their values, a column each; `steps` are those of the frames of the trial's data set.
///
/// # Errors
/// A quantity that the knee does not have, or whose derivative it does not know.
pub fn columns<R: Rest>(
    rest: &R,
    (trial, steps): (&Trial, &FrameSteps),
    of: &[(&Quantity, f64)],
) -> Result<Vec<R::Column>, SimError> {
    let numbers: Vec<(Vec<Number>, f64)> = of.iter().filter_map(|(quantity, x)| quantity.numbers(*x)).collect();
    let mut by_numbers = rest.by_numbers(&numbers)?.into_iter();
    // a frame of all and the same one of this data set are one movement
    let mut by_term: [Option<R::Column>; 12] = std::array::from_fn(|_| None);
    let mut frame = |term: usize| -> Result<R::Column, SimError> {
        if let Some(known) = &by_term[term] {
            return Ok(known.clone());
        }
        let missing = || SimError::Input(format!("frames turned or shifted in term {term} make no joint"));
        let found = rest.by_frame(steps[term].as_ref().ok_or_else(missing)?)?;
        Ok(by_term[term].insert(found).clone())
    };
    let bearing = |load: Load| rest.by_force(&load.generalised());
    let column = |(quantity, _): &(&Quantity, f64)| -> Result<R::Column, SimError> {
        match quantity {
            Quantity::ReferenceStrain(_) | Quantity::Stiffness(_) | Quantity::Site(..) | Quantity::ContactScale => {
                by_numbers.next().ok_or_else(|| SimError::Input(format!("{quantity:?} is no number of the model")))
            }
            // the frames in which another data set was read
            Quantity::Frame(Some(source), _) if trial.source != Some(*source) => Ok(rest.still()),
            Quantity::Frame(_, term) => frame(*term),
            Quantity::Cartilage => Ok(rest.by_force(&rest.by_thickness()?)),
            Quantity::Lean(coordinate, knot) => {
                let mut load = Load::default();
                load[*coordinate] = pressed(rest.evaluation()) * shares(trial.record.fe_deg)[*knot];
                Ok(bearing(load))
            }
            Quantity::Resting(source, coordinate) => {
                let mut load = Load::default();
                load[*coordinate] = f64::from(trial.source == Some(*source));
                Ok(bearing(load))
            }
            // of the apparatus: it moves what is read, not the knee
            Quantity::Compliance(..) => Ok(rest.still()),
        }
    };
    of.iter().map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::{AP, IE, SI};
    use sim::laxity::{LaxityTrial, Test};
    use sim::sensitivity::End;

    /// A knee whose columns are numbers that tell who was asked.
    struct Telling;

    impl Rest for Telling {
        type Column = f64;
        fn still(&self) -> f64 {
            0.0
        }
        fn by_numbers(&self, of: &[(Vec<Number>, f64)]) -> Result<Vec<f64>, SimError> {
            Ok(of.iter().map(|(numbers, factor)| factor * numbers.len() as f64).collect())
        }
        fn by_force(&self, force: &Six) -> f64 {
            force.iter().sum()
        }
        fn by_frame(&self, _: &[Joint; 2]) -> Result<f64, SimError> {
            Ok(50.0)
        }
        fn evaluation(&self) -> &Evaluation {
            panic!("no surface leans here")
        }
        fn by_thickness(&self) -> Result<Six, SimError> {
            Err(SimError::Input("thickness is known".into()))
        }
    }

    fn asked(of: &[Quantity]) -> Result<Vec<f64>, SimError> {
        let record = LaxityTrial::asked(String::new(), Test::Neutral, 30.0, Load::compression(20.0));
        let trial = Trial { source: Some(1), ..Trial::alone(record) };
        let no_steps: FrameSteps = std::array::from_fn(|_| None);
        columns(&Telling, (&trial, &no_steps), &of.iter().map(|q| (q, 4.0)).collect::<Vec<_>>())
    }

    #[test]
    fn each_parameter_has_its_own_column_whatever_stands_between_them() {
        let of = [
            Quantity::ReferenceStrain(vec![0, 1, 2]),
            Quantity::Resting(1, AP),
            Quantity::Frame(Some(0), 3),
            Quantity::ContactScale,
            Quantity::Compliance(1, AP),
            Quantity::Resting(0, SI),
            Quantity::Site(2, End::Femur, 1),
            Quantity::Resting(1, IE),
            Quantity::Stiffness(vec![4, 5]),
        ];
        // the contact's scale of 4 counts from the model's own; a moment of 1 N m is 1000 N mm
        assert_eq!(asked(&of).unwrap(), [3.0, 1.0, 0.0, 0.25, 0.0, 0.0, 1.0, 1000.0, 2.0]);
    }

    #[test]
    fn a_derivative_that_nobody_knows_is_an_error_and_no_zero() {
        for unknown in [Quantity::Frame(None, 3), Quantity::Frame(Some(1), 3), Quantity::Cartilage] {
            assert!(asked(std::slice::from_ref(&unknown)).is_err(), "{unknown:?}");
        }
    }
}

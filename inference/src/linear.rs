//! The linear model of all that is known about a point, and what a sample changes of it.

use nalgebra::{DMatrix, DVector};

/// The linear model of all that is known about a point: residuals as if the prior's centre were the point, derivatives by the standard normal numbers.
#[derive(Clone, Debug)]
pub struct Linear {
    /// Predictions.
    pub reading: DVector<f64>,
    /// Their derivatives.
    pub jacobian: DMatrix<f64>,
    /// Residuals of beliefs, of unit variance, on whatever side.
    pub belief: DVector<f64>,
    /// Their derivatives.
    pub belief_jacobian: DMatrix<f64>,
    /// Whether a belief counts where its residual is above zero alone.
    pub one_side: Vec<bool>,
    /// Where.
    pub z: DVector<f64>,
}

/// What a sample changes.
#[derive(Clone, Debug)]
pub struct Shift {
    /// Centre of the prior.
    pub centre: DVector<f64>,
    /// White noise on the measurements; empty: none.
    pub noise: DVector<f64>,
    /// The same on beliefs; empty: none.
    pub belief: DVector<f64>,
    /// Whether a belief counts on both sides whatever it says of itself; empty: none does.
    pub both_sides: Vec<bool>,
}

impl Shift {
    /// Nothing is changed.
    pub fn none(n: usize) -> Shift {
        Shift { centre: DVector::zeros(n), noise: DVector::zeros(0), belief: DVector::zeros(0), both_sides: Vec::new() }
    }

    /// Residuals of beliefs as they count, and their derivatives.
    pub fn heard(&self, at: &Linear) -> (DVector<f64>, DMatrix<f64>) {
        let (mut residual, mut jacobian) = (at.belief.clone(), at.belief_jacobian.clone());
        if !self.belief.is_empty() {
            residual -= &self.belief;
        }
        for (j, one_side) in at.one_side.iter().enumerate() {
            if *one_side && !self.both_sides.get(j).unwrap_or(&false) && residual[j] <= 0.0 {
                residual[j] = 0.0;
                jacobian.row_mut(j).fill(0.0);
            }
        }
        (residual, jacobian)
    }
}

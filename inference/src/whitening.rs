//! A covariance in Cholesky's form: what makes numbers that scatter together white, and white ones scatter.

use crate::error::InferenceError;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// A covariance in Cholesky's form.
#[derive(Clone, Debug)]
pub struct Whitening(Cholesky<f64, Dyn>);

impl Whitening {
    /// Factorises.
    ///
    /// # Errors
    /// A matrix that is not positive definite.
    pub fn new(covariance: DMatrix<f64>) -> Result<Whitening, InferenceError> {
        Cholesky::new(covariance).map(Whitening).ok_or(InferenceError::Covariance)
    }

    /// Whitens the columns.
    pub fn white(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        self.0.l_dirty().solve_lower_triangular(m).unwrap_or_else(|| m.clone())
    }

    /// Whitens a vector.
    pub fn white_vector(&self, v: &DVector<f64>) -> DVector<f64> {
        self.0.l_dirty().solve_lower_triangular(v).unwrap_or_else(|| v.clone())
    }

    /// The inverse times a vector.
    pub fn solve(&self, v: &DVector<f64>) -> DVector<f64> {
        self.0.solve(v)
    }

    /// The inverse of the covariance.
    pub fn inverse(&self) -> DMatrix<f64> {
        self.0.inverse()
    }

    /// Log of the determinant.
    pub fn log_determinant(&self) -> f64 {
        2.0 * self.0.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
    }

    /// The lower factor: times white numbers it is numbers of this covariance.
    pub fn lower(&self) -> DMatrix<f64> {
        self.0.l()
    }
}

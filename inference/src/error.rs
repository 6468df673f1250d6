//! What can go wrong in an inference.

/// Why there is no posterior.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InferenceError {
    /// A prior is no distribution.
    #[error("parameter {name}: {what}")]
    Prior {
        /// The parameter.
        name: String,
        /// What is wrong, with the values.
        what: String,
    },
    /// No start has an answer.
    #[error("the model has no answer at any of {starts} starts")]
    NoStart {
        /// How many were tried.
        starts: usize,
    },
    /// The covariance of the readings is not positive definite.
    #[error("the covariance of the readings is not positive definite; check the noise")]
    Covariance,
    /// The solver.
    #[error(transparent)]
    Sim(#[from] sim::SimError),
}

//! What can go wrong with deformable solids.

/// Why solids cannot be compiled or cannot go on: what is wrong, what was expected, what to do.
#[derive(Debug, thiserror::Error, Clone, PartialEq)]
pub enum DeformableError {
    /// Solids, bodies or faces are at fault.
    #[error("model: {0}")]
    Spec(String),
    /// An option is at fault.
    #[error("input: {0}")]
    Input(String),
    /// The solver could not go on.
    #[error("solver: {0}")]
    Solver(String),
}

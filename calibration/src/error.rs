//! What can go wrong in a calibration or a validation.

/// Why a calibration or a validation cannot be done: what is wrong, where, what was expected, what to do.
#[derive(Debug, thiserror::Error, Clone, PartialEq)]
pub enum CalibrationError {
    /// The measured trials cannot serve as targets; a line a row.
    #[error("targets: {0}")]
    Targets(String),
    /// An option is out of range.
    #[error("option {0}")]
    Option(String),
    /// The model lacks what the experiment needs.
    #[error("model: {0}")]
    Model(String),
    /// A checkpoint does not belong to this calibration.
    #[error("checkpoint: {0}")]
    Checkpoint(String),
    /// Whoever watched asked to stop.
    #[error("stopped; run it again to go on from here")]
    Stopped,
    /// The solver could not answer.
    #[error(transparent)]
    Sim(#[from] sim::SimError),
    /// There is no posterior.
    #[error(transparent)]
    Inference(#[from] inference::InferenceError),
}

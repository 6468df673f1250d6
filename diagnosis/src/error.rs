//! What can go wrong in a diagnosis.

/// Why a diagnosis cannot be made: what is wrong, what was expected, what to do.
#[derive(Debug, thiserror::Error, Clone, PartialEq)]
pub enum DiagnosisError {
    /// The measured data are at fault.
    #[error("measured data: {0}")]
    Data(String),
    /// The model is at fault.
    #[error("model: {0}")]
    Model(String),
    /// A component of a model cannot be understood.
    #[error("component: {0}")]
    Component(String),
    /// An option is out of range.
    #[error("option {0}")]
    Option(String),
    /// The solver could not answer.
    #[error(transparent)]
    Sim(#[from] sim::SimError),
    /// The inference has no answer.
    #[error(transparent)]
    Inference(#[from] inference::InferenceError),
    /// The experiment could not be set up.
    #[error(transparent)]
    Validation(#[from] calibration::CalibrationError),
}

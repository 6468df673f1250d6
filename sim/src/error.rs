//! What can go wrong in a simulation.

/// Why a model cannot be compiled or a simulation cannot go on: what is wrong, what was expected, what to do.
#[derive(Debug, thiserror::Error, Clone, PartialEq)]
pub enum SimError {
    /// The model specification is at fault.
    #[error("model: {0}")]
    Spec(String),
    /// A load, trial or option is at fault.
    #[error("input: {0}")]
    Input(String),
    /// The solver could not go on.
    #[error("solver: {0}")]
    Solver(String),
    /// An observer asked to stop.
    #[error("cancelled at {time} s")]
    Cancelled {
        /// Simulated time reached [s].
        time: f64,
    },
}

impl SimError {
    /// The same, with the trial it is about.
    pub(crate) fn of_trial(self, trial: &str) -> SimError {
        self.of(&format!("trial {trial}"))
    }

    /// The same, with what it is about.
    pub(crate) fn of(self, what: &str) -> SimError {
        match self {
            SimError::Spec(m) => SimError::Spec(format!("{what}: {m}")),
            SimError::Input(m) => SimError::Input(format!("{what}: {m}")),
            SimError::Solver(m) => SimError::Solver(format!("{what}: {m}")),
            other @ SimError::Cancelled { .. } => other,
        }
    }
}

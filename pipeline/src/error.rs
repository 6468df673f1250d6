//! What stops a command, in one sentence for the person at the keyboard.

/// What is at fault; [`BuildError::exit_status`] says which kind.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// A stage cannot go on.
    #[error("{stage}: {message}")]
    Stage {
        /// Its name.
        stage: &'static str,
        /// Why, and what to do.
        message: String,
    },
    /// A file cannot be read or written.
    #[error("{0}")]
    File(String),
    /// The machine does not give what is needed: the disk is full, a folder may not be written, another program holds a lock (exit status 3).
    #[error("{0}")]
    Machine(String),
    /// A value of an options table is wrong.
    #[error("{0}")]
    Option(String),
    /// The command line is wrong (exit status 2).
    #[error("{0}")]
    Usage(String),
    /// A check found what would stop a build; the table goes to standard output.
    #[error("{count} of the inputs would stop a build; the first is {first}")]
    Faults {
        /// Every input, for a reader.
        table: String,
        /// How many are at fault.
        count: usize,
        /// The first of them.
        first: String,
    },
    /// Not an error: a plan cannot see beyond this stage, which has not been run.
    #[error("{0} has not been run")]
    Unplanned(&'static str),
    /// Not an error: the stage named by `--to` is done.
    #[error("reached the last stage asked for")]
    Reached,
}

/// The exit status of a fault of this program: it panicked.
pub const OUR_FAULT: u8 = 4;

impl BuildError {
    /// The exit status of the command: 1 the data are at fault, 2 wrong use of the command line, 3 the machine.
    pub fn exit_status(&self) -> u8 {
        match self {
            BuildError::Usage(_) => 2,
            BuildError::Machine(_) => 3,
            _ => 1,
        }
    }

    /// An error of `stage`.
    pub fn stage(stage: &'static str, message: impl ToString) -> BuildError {
        BuildError::Stage { stage, message: message.to_string() }
    }
}

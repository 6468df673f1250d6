//! What stops a command, in one sentence for the person at the keyboard.

use sim::laxity::LaxityError;
use stages::StageError;
use stages::error::Mark;
use std::fmt::Display;
use std::path::Path;

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
        /// The file at fault, where one is.
        place: Option<Place>,
        /// The places of the knee that are at fault.
        marks: Box<[Mark]>,
    },
    /// A file cannot be read or written.
    #[error("{0}")]
    File(String),
    /// A file is at fault, at a place that is known.
    #[error("{told}")]
    At {
        /// Where.
        place: Place,
        /// The sentence, which names the place too.
        told: String,
    },
    /// A file stands where a result goes, and it would be lost: it was edited, or is another's. `--force` writes over it.
    #[error("{told}")]
    Edited {
        /// The file.
        place: Place,
        /// The sentence, with what to do.
        told: String,
    },
    /// The machine does not give what is needed: the disk is full, a folder may not be written, another program holds a lock (exit status 3).
    #[error("{told}")]
    Machine {
        /// The sentence.
        told: String,
        /// The file or folder, where one is.
        place: Option<Place>,
    },
    /// A value of an options table is wrong.
    #[error("{0}")]
    Option(String),
    /// An option is wrong, and it is known which.
    #[error("{told}")]
    Setting {
        /// Its name with the stage's: `bones.edge_mm`.
        key: String,
        /// The value that was given.
        value: String,
        /// Whether it was given on the command line (exit status 2), or in specimen.toml (1).
        on_line: bool,
        /// The sentence.
        told: String,
    },
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

/// A place in a file, as far as it is known.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// The file, as it was named.
    pub file: String,
    /// Its row or line, the first being 1.
    pub row: Option<usize>,
    /// Its column: a name of a table's header, or a number.
    pub column: Option<String>,
}

impl Place {
    /// A file as a whole.
    pub fn of(file: &Path) -> Place {
        Place { file: file.display().to_string(), ..Place::default() }
    }

    /// Where a laxity file is at fault.
    pub fn in_laxity(file: &str, e: &LaxityError) -> Place {
        let whole = Place { file: file.to_owned(), ..Place::default() };
        match e {
            LaxityError::Row { row, column, .. } => {
                let column = column.as_ref().map(|c| c.trim_matches('"').to_owned());
                Place { row: Some(*row).filter(|r| *r > 0), column, ..whole }
            }
            LaxityError::File(_) => whole,
        }
    }

    /// Where JSON is at fault.
    pub fn in_json(file: &Path, e: &serde_json::Error) -> Place {
        Place { row: Some(e.line()), column: Some(e.column().to_string()), ..Place::of(file) }
    }
}

/// Why a stage cannot go on.
pub trait Fault: ToString {
    /// The file at fault, where one is.
    fn place(&self) -> Option<Place> {
        None
    }

    /// The places of the knee that are at fault.
    fn marks(&self) -> Vec<Mark> {
        vec![]
    }
}

impl Fault for String {}

impl Fault for BuildError {
    fn place(&self) -> Option<Place> {
        BuildError::place(self).cloned()
    }

    fn marks(&self) -> Vec<Mark> {
        match self {
            BuildError::Stage { marks, .. } => marks.to_vec(),
            _ => vec![],
        }
    }
}

impl Fault for StageError {
    fn place(&self) -> Option<Place> {
        let StageError::File { path, place, .. } = self else { return None };
        Some(Place { file: path.clone(), row: place.row, column: None })
    }

    fn marks(&self) -> Vec<Mark> {
        StageError::marks(self).to_vec()
    }
}

/// The exit status of a fault of this program: it panicked.
pub const OUR_FAULT: u8 = 4;

impl BuildError {
    /// The exit status of the command: 1 the data are at fault, 2 wrong use of the command line, 3 the machine.
    pub fn exit_status(&self) -> u8 {
        match self {
            BuildError::Usage(_) | BuildError::Setting { on_line: true, .. } => 2,
            BuildError::Machine { .. } => 3,
            _ => 1,
        }
    }

    /// A file at fault, as a whole.
    pub fn in_file(file: &Path, what: impl Display) -> BuildError {
        BuildError::of_file(file, format!("{}: {what}", file.display()))
    }

    /// The same with a sentence that names the file otherwise.
    pub fn of_file(file: &Path, told: String) -> BuildError {
        BuildError::At { place: Place::of(file), told }
    }

    /// A file that is not written over without `--force`.
    pub fn edited(file: &Path, told: String) -> BuildError {
        BuildError::Edited { place: Place::of(file), told }
    }

    /// An error at a place.
    pub fn at(place: Place, told: String) -> BuildError {
        BuildError::At { place, told }
    }

    /// The place at fault, where it is known.
    pub fn place(&self) -> Option<&Place> {
        match self {
            BuildError::At { place, .. } | BuildError::Edited { place, .. } => Some(place),
            BuildError::Stage { place, .. } | BuildError::Machine { place, .. } => place.as_ref(),
            _ => None,
        }
    }

    /// The option at fault and the value it was given, where they are known.
    pub fn setting(&self) -> Option<(&str, &str)> {
        match self {
            BuildError::Setting { key, value, .. } => Some((key, value)),
            _ => None,
        }
    }

    /// The kind of fault in one word, for programs.
    pub fn code(&self) -> &'static str {
        match self {
            BuildError::Stage { .. } | BuildError::Unplanned(_) | BuildError::Reached => "stage",
            BuildError::File(_) | BuildError::At { .. } | BuildError::Edited { .. } | BuildError::Faults { .. } => {
                "file"
            }
            BuildError::Machine { .. } => "machine",
            BuildError::Option(_) | BuildError::Setting { on_line: false, .. } => "option",
            BuildError::Usage(_) | BuildError::Setting { on_line: true, .. } => "usage",
        }
    }

    /// The stage of a build that stopped.
    pub fn stopped_at(&self) -> Option<&'static str> {
        match self {
            BuildError::Stage { stage, .. } | BuildError::Unplanned(stage) => Some(stage),
            _ => None,
        }
    }

    /// An error of `stage`.
    pub fn stage(stage: &'static str, message: impl ToString) -> BuildError {
        BuildError::Stage { stage, message: message.to_string(), place: None, marks: Box::default() }
    }

    /// What stopped `stage`, with the file at fault.
    pub fn of_stage(stage: &'static str, fault: &impl Fault) -> BuildError {
        BuildError::Stage { stage, message: fault.to_string(), place: fault.place(), marks: fault.marks().into() }
    }
}

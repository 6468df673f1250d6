//! Why a stage cannot go on: what is wrong, what was expected, what to do, in words for the laboratory.

use std::fmt::Display;

/// Where in a specimen's file: the key that names the file, and the place in it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// The file's key in specimen.toml: `ct.femur`.
    pub key: Option<String>,
    /// The line, the header being line 1, or a program's own name for the place: `line 12`, `control point 3`.
    pub at: Option<String>,
    /// The number of the line.
    pub row: Option<usize>,
}

impl Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        self.key.iter().try_for_each(|key| write!(f, " ({key})"))?;
        self.at.iter().try_for_each(|at| write!(f, ", {at}"))
    }
}

/// A place that an error names.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Mark {
    /// What lies there, such as `element 12`; empty where it has no name.
    pub name: String,
    /// Where in CT [mm].
    pub place: [f64; 3],
}

/// Why a stage cannot go on.
#[derive(Debug, thiserror::Error, Clone, PartialEq)]
pub enum StageError {
    /// A file of the specimen cannot be used as it is.
    #[error("{path}{place}: {what}")]
    File {
        /// The file, as specimen.toml names it.
        path: String,
        /// Where in it.
        place: Place,
        /// What is wrong, what was expected, what to do.
        what: String,
    },
    /// An option is out of its range.
    #[error("{key} is {value}, expected {expected}")]
    Option {
        /// Its key.
        key: String,
        /// Its value.
        value: String,
        /// What it may be.
        expected: String,
    },
    /// A part of the knee is not as it must be.
    #[error("{part}: {what}")]
    Part {
        /// Which part: `cartilage femur`, `bones`.
        part: String,
        /// What is wrong, what was expected, what to do.
        what: String,
        /// Where.
        marks: Vec<Mark>,
    },
    /// The knee as a whole, or the data together, are not as they must be.
    #[error("{0}")]
    Knee(String),
    /// The same, at places that are known.
    #[error("{what}")]
    At {
        /// What is wrong, what was expected, what to do.
        what: String,
        /// Where.
        marks: Vec<Mark>,
    },
}

impl StageError {
    /// A file that cannot be used.
    pub fn file(path: &str, what: impl Display) -> StageError {
        StageError::File { path: path.into(), place: Place::default(), what: what.to_string() }
    }

    /// A file that `key` of specimen.toml names.
    pub fn named(path: &str, key: &str, what: impl Display) -> StageError {
        let place = Place { key: Some(key.into()), ..Place::default() };
        StageError::File { path: path.into(), place, what: what.to_string() }
    }

    /// A place in a file.
    pub fn at(path: &str, at: impl Display, what: impl Display) -> StageError {
        let place = Place { at: Some(at.to_string()), ..Place::default() };
        StageError::File { path: path.into(), place, what: what.to_string() }
    }

    /// A line of a file.
    pub fn line(path: &str, line: usize, what: impl Display) -> StageError {
        let place = Place { at: Some(format!("line {line}")), row: Some(line), key: None };
        StageError::File { path: path.into(), place, what: what.to_string() }
    }

    /// specimen.toml asks for what cannot be.
    pub fn specimen(what: impl Display) -> StageError {
        StageError::file("specimen.toml", what)
    }

    /// An option out of its range.
    pub fn option(key: impl Display, value: impl Display, expected: impl Display) -> StageError {
        StageError::Option { key: key.to_string(), value: value.to_string(), expected: expected.to_string() }
    }

    /// A part that is not as it must be.
    pub fn part(part: impl Display, what: impl Display) -> StageError {
        StageError::Part { part: part.to_string(), what: what.to_string(), marks: vec![] }
    }

    /// The same fault of a part, at the same places.
    pub fn of_part(self, part: impl Display) -> StageError {
        let what = self.to_string();
        StageError::Part { part: part.to_string(), what, marks: self.into_marks() }
    }

    /// The places that it names.
    pub fn marks(&self) -> &[Mark] {
        match self {
            StageError::Part { marks, .. } | StageError::At { marks, .. } => marks,
            _ => &[],
        }
    }

    fn into_marks(self) -> Vec<Mark> {
        match self {
            StageError::Part { marks, .. } | StageError::At { marks, .. } => marks,
            _ => vec![],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_says_where_and_what() {
        let said = [
            StageError::file("marks.csv", "empty"),
            StageError::named("a.stl", "ct.femur", "open"),
            StageError::line("marks.csv", 3, "frame is `x`"),
            StageError::specimen("[ct]: nothing"),
            StageError::option("bones.edge_mm", 0.1, "0.2 mm or more"),
            StageError::part("cartilage femur", "empty"),
            StageError::Knee("the bones lie apart".into()),
        ]
        .map(|e| e.to_string());
        let wanted = [
            "marks.csv: empty",
            "a.stl (ct.femur): open",
            "marks.csv, line 3: frame is `x`",
            "specimen.toml: [ct]: nothing",
            "bones.edge_mm is 0.1, expected 0.2 mm or more",
            "cartilage femur: empty",
            "the bones lie apart",
        ];
        assert_eq!(said, wanted);
    }
}

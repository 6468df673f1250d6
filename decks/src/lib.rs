//! Abaqus knee decks: a tolerant keyword reader, and the model a published deck holds.
//!
//! Only the caller opens files: an INCLUDE is asked for through a callback. Keywords, set names and parameters are
//! matched without regard to case, as Abaqus does.
//!
//! Start with `import`: a deck's main file and a callback that reads included files give a model. Numbers may be expressions:
//!
//! ```
//! use std::collections::BTreeMap;
//! let names = BTreeMap::from([("K".to_string(), 50.0)]);
//! assert_eq!(decks::expression::evaluate("2*k + 1", &names), Ok(101.0));
//! ```

mod axes;
mod bodies;
mod contact;
mod elements;
mod export;
pub mod expression;
mod faces;
pub mod febio;
mod held;
mod import;
mod imposed;
pub mod keyword;
pub mod known;
mod laws;
mod ligaments;
mod lines;
pub mod model;
mod names;
pub mod opensim;
mod place;
mod programs;
mod sets;
mod steps;
mod tree;
mod usual;
mod variant;

pub use export::{ExportedDeck, export, export_with, of_a_cut_knee, without_quadriceps};
pub use import::{ImportedDeck, import};
pub use imposed::{Imposed, ImposedPoint, ImposedStep, imposed};
pub use names::written_names;
pub use variant::{lower_cartilage, replace_fibres};

/// What is wrong with a deck: file, line, what was expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {message}", after_colon(*line))]
pub struct DeckError {
    /// The file; the main one when the deck as a whole is at fault.
    pub file: String,
    /// Line in it, from 1; 0 when the deck as a whole is at fault.
    pub line: usize,
    /// What is wrong, what was expected, what to do.
    pub message: String,
}

/// A line's number after the file's name; nothing where no line is at fault.
fn after_colon(line: usize) -> String {
    if line == 0 { String::new() } else { format!(":{line}") }
}

/// Stands for a deck's name where it is not known.
const SOME_DECK: &str = "deck";

impl DeckError {
    /// A fault of the deck as a whole.
    fn whole(message: impl Into<String>) -> DeckError {
        DeckError { file: SOME_DECK.into(), line: 0, message: message.into() }
    }

    /// With the deck's own name, where none was known.
    fn of_deck(self, name: &str) -> DeckError {
        if self.file == SOME_DECK { DeckError { file: name.to_owned(), ..self } } else { self }
    }
}

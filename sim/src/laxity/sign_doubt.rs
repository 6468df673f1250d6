//! A doubt about a file's conventions, with its sentence.

use notices::{Kind, Notice};

/// A convention that looks turned round.
#[derive(Clone, Debug, PartialEq)]
pub struct SignDoubt {
    /// The standard column that is most likely turned.
    pub column: String,
    /// What was seen, and what to declare, in a sentence.
    pub words: String,
}

impl SignDoubt {
    /// The doubt as a notice.
    pub fn notice(self) -> Notice {
        Kind::SignDoubt.notice(self.words).column(&self.column)
    }
}

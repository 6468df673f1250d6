//! A figure of a knee.

/// A number that knees are compared by.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Quantity {
    /// Stage it is of.
    pub(super) stage: &'static str,
    /// Its name, which ends with its unit.
    pub(super) name: String,
    /// Of which part: a bone, a cartilage, a bundle; empty for the whole knee.
    pub(super) part: String,
    pub(super) value: f64,
}

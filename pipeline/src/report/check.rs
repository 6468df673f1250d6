//! What one asks of a build first.

/// A question with its answer.
pub(crate) struct Check {
    /// The question.
    pub(crate) question: &'static str,
    /// The answer.
    pub(crate) answer: String,
    /// True where it is as it should be; `None` where there is no bound to hold it to.
    pub(crate) good: Option<bool>,
    /// The stage that tells more.
    pub(crate) stage: &'static str,
}

/// One of the figures that matter most.
pub(crate) struct KeyFigure {
    /// What it is.
    pub(crate) name: &'static str,
    /// Its value with its unit.
    pub(crate) value: String,
    /// The limit in words.
    pub(crate) limit: String,
    /// True within its limit; `None` where there is none, or nothing to hold it to.
    pub(crate) good: Option<bool>,
}

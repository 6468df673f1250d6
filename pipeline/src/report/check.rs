//! What one asks of a build first.

/// A question with its answer.
pub(crate) struct Check {
    /// The question.
    pub(crate) question: &'static str,
    /// The answer.
    pub(crate) answer: String,
    /// True where it is as it should be; `None` where there is no bound to hold it to.
    pub(crate) good: Option<bool>,
    /// Where the value is within its limit and its interval is not: the end that is beyond, in words.
    pub(crate) reaches: Option<String>,
    /// The calibrated model that it is asked of, where there are several.
    pub(crate) model: Option<String>,
    /// The stage that tells more.
    pub(crate) stage: &'static str,
}

impl Check {
    /// The answer with the model's name.
    pub(crate) fn told(&self) -> String {
        self.model.as_ref().map_or_else(|| self.answer.clone(), |model| format!("{model}: {}", self.answer))
    }
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

/// `value` with as many decimals as it is told with, so that what reads "20 (limit 20)" counts as within.
fn told(value: f64, decimals: usize) -> f64 {
    format!("{value:.decimals$}").parse().unwrap_or(value)
}

/// True where `value` is at most `limit`, both as they are told.
pub(crate) fn at_most(value: f64, limit: f64, decimals: usize) -> bool {
    told(value, decimals) <= told(limit, decimals)
}

/// True where `value` is at least `limit`, both as they are told.
pub(crate) fn at_least(value: f64, limit: f64, decimals: usize) -> bool {
    told(value, decimals) >= told(limit, decimals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_reads_as_its_limit_is_within_it() {
        assert!(at_most(20.4, 20.0, 0) && !at_most(20.6, 20.0, 0));
        assert!(at_most(2.04, 2.0, 1) && !at_most(2.06, 2.0, 1));
        assert!(at_least(-0.0004, 0.0, 3) && !at_least(-0.0006, 0.0, 3));
        assert!(!at_most(f64::NAN, 1.0, 1));
    }
}

//! The question, the context of use and the model risk, as a person states them.

use super::grade::Level;
use crate::error::{BuildError, Place};
use crate::store;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What the model is for. What is left out reads "not stated".
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Context {
    /// The question that a decision needs answered.
    pub question: Option<String>,
    /// What the model is used for to answer it, beside which other evidence.
    pub context_of_use: Option<String>,
    /// How much the model weighs in the decision: low, medium or high.
    pub influence: Option<Level>,
    /// How bad a wrong decision is: low, medium or high.
    pub consequence: Option<Level>,
    /// Least and largest flexion that are asked about [deg].
    pub flexion_deg: Option<[f64; 2]>,
}

impl Context {
    /// The context that a file states.
    ///
    /// Errors: a file that cannot be read, an unknown key or level, flexions in the wrong order.
    pub fn read(file: &Path) -> Result<Context, BuildError> {
        let text = store::read_text(file)?;
        let context: Context = toml::from_str(&text).map_err(|e| {
            let row = e.span().map(|s| text[..s.start].matches('\n').count() + 1);
            let expected = "question, context_of_use, influence, consequence (low, medium, high), flexion_deg";
            let line = row.map_or(String::new(), |row| format!(" line {row}"));
            let told = format!("{}{line}: {}; expected {expected}", file.display(), e.message());
            BuildError::at(Place { row, ..Place::of(file) }, told)
        })?;
        match context.flexion_deg {
            Some([from, to]) if !(from.is_finite() && to.is_finite() && from <= to) => {
                let told = format!("flexion_deg = [{from}, {to}]; expected two numbers, the smaller first");
                Err(BuildError::in_file(file, told))
            }
            _ => Ok(context),
        }
    }

    /// Model risk: influence and consequence together, the larger where they differ by one, the middle where by two.
    pub fn risk(&self) -> Option<Level> {
        let (a, b) = (self.influence?, self.consequence?);
        Some(match (a.min(b), a.max(b)) {
            (Level::Low, Level::High) => Level::Medium,
            (_, larger) => larger,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn risk_grows_with_influence_and_with_consequence() {
        let all = [Level::Low, Level::Medium, Level::High];
        let risk = |influence, consequence| {
            Context { influence: Some(influence), consequence: Some(consequence), ..Context::default() }.risk().unwrap()
        };
        for a in all {
            assert_eq!(risk(a, a), a);
            for pair in all.windows(2) {
                assert!(risk(a, pair[0]) <= risk(a, pair[1]) && risk(pair[0], a) <= risk(pair[1], a));
            }
        }
        assert_eq!(Context { influence: Some(Level::High), ..Context::default() }.risk(), None);
    }
}

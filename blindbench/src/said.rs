//! What an answer said, and what a score counts.

use crate::laboratory::Truth;
use crate::reliability::Bin;
use crate::share::Share;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// What an answer said, reduced to what is scored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Said {
    /// The verdict's name.
    pub verdict: String,
    /// Each rival answer's effects with their scopes, best first.
    pub answers: Vec<Vec<(String, String)>>,
    /// Share of belief of each rival answer [-].
    pub weights: Vec<f64>,
    /// The structure or axis that each effect of the first answer is about, where it may be about several.
    pub variants: BTreeMap<String, String>,
    /// What it reports as possible, the likeliest first: its answers, then what it does not exclude beside them. Of each the effects with the structures that
    /// they are about. That nothing is missing is none of it.
    pub reported: Vec<Vec<(String, Option<String>)>>,
    /// Value and standard deviation of the first answer's parameters, by effect and key.
    pub sizes: BTreeMap<(String, String), (f64, f64)>,
    /// Share of the gap closed.
    pub closed: f64,
    /// Effects that it was not allowed to name.
    pub without: Vec<String>,
    /// Log Bayes factor of each rival answer [nats].
    pub evidence: Vec<f64>,
    /// Log Bayes factor of the best that was found, whether it is an answer or not [nats].
    pub best: Option<f64>,
    /// By how much its search stayed behind a fit that starts at the truth [nats]; none where nobody asked.
    pub regret: Option<f64>,
}

impl Said {
    /// Whether an answer says just what is hidden: each effect in its scope, and nothing beside.
    pub(crate) fn is_right(answer: &[(String, String)], truth: &Truth) -> bool {
        let hidden: BTreeSet<(&str, &str)> = truth.effects.iter().map(|(e, s, _)| (e.as_str(), s.as_str())).collect();
        let told: BTreeSet<(&str, &str)> = answer.iter().map(|(e, s)| (e.as_str(), s.as_str())).collect();
        hidden == told && answer.len() == truth.effects.len()
    }

    /// Whether it was not allowed to name an effect; where sites are struck, those of each ligament are.
    pub(crate) fn is_struck(&self, effect: &str) -> bool {
        let rest = |without: &String| effect.strip_prefix(without.as_str());
        self.without.iter().filter_map(rest).any(|r| r.is_empty() || r.starts_with('_'))
    }

    /// Weight of each answer, and whether it is right; none where the name was struck, since the truth could not be told.
    pub(crate) fn believed(&self, truth: &Truth) -> Vec<(f64, bool)> {
        if truth.effects.iter().any(|e| self.is_struck(&e.0)) {
            return vec![];
        }
        self.answers.iter().zip(&self.weights).map(|(a, w)| (*w, Said::is_right(a, truth))).collect()
    }

    /// By how much a hidden effect's own name explains more [nats], where it may be named (`whole`), than the best that was found without it does; none
    /// where it is in no answer even then.
    pub(crate) fn loses(&self, whole: &Said, effect: &str) -> Option<f64> {
        let named = whole.answers.iter().zip(&whole.evidence).filter(|(a, _)| a.iter().any(|e| e.0 == effect));
        let own = named.map(|(_, e)| *e).max_by(f64::total_cmp)?;
        Some(own - self.best?.max(0.0))
    }
}

/// A table of scores.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Shares by what they are of.
    pub shares: BTreeMap<String, Share>,
    /// Relative errors of sizes.
    pub size_errors: Vec<f64>,
    /// Shares of the gap closed, strong effects.
    pub closed: Vec<f64>,
    /// Cases that went wrong.
    pub failures: Vec<String>,
    /// Weights of all answers, by how large they are, against how many of those answers are right.
    #[serde(default)]
    pub reliability: Vec<Bin>,
    /// Expected calibration error of the weights [-]; none where no answer was given.
    #[serde(default)]
    pub calibration_error: Option<f64>,
    /// Of each cut and of each whole knee: how many states beside the truth the answer reports as possible [-].
    #[serde(default)]
    pub beside: Vec<f64>,
    /// By how much each search stayed behind the truth, where that was asked [nats].
    #[serde(default)]
    pub regrets: Vec<f64>,
}

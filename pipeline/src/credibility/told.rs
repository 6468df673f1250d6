//! What the command tells: credibility.json.

use super::answers::Answer;
use super::context::Context;
use super::evidence::FactorTold;
use super::grade::Level;
use schemars::JsonSchema;
use serde::Serialize;
use sim::spec::SharedPriorSpec;

/// credibility.json.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Told {
    /// credibility/1
    pub schema: &'static str,
    /// The specimen.
    pub knee: String,
    /// The calibrated model that is judged; none where none is calibrated.
    pub model: Option<String>,
    /// Other knees whose data are in the prior of its calibration; none where no knee's are. It is not independent of those knees, and what is
    /// found of them is no evidence for it.
    pub shared_prior: Option<SharedPriorSpec>,
    /// Version and source digest of the program that built it.
    pub program: String,
    /// Question, context of use, risk, as stated.
    pub context: Context,
    /// Model risk; none where it is not stated.
    pub model_risk: Option<Level>,
    /// The factors, in order.
    pub factors: Vec<FactorTold>,
    /// What the published knees left open, answered for this one.
    pub answers: Vec<Answer>,
    /// Files that are not as their stage left them; what they hold is no evidence.
    pub changed: Vec<String>,
}

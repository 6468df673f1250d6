//! Stage 6, attachments: marked, literature and given sites; fibres.

use attachments::site::{Fibre, Site};
use serde::{Deserialize, Serialize};

/// Sites and fibres, CT frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Attachments {
    /// One a ligament and bone.
    pub sites: Vec<Site>,
    /// Table 3's fibres, in its order.
    pub fibres: Vec<Fibre>,
    /// What is odd but not fatal; bundles that could not be placed are named here.
    pub warnings: Vec<String>,
    /// For metrics.json.
    pub metrics: serde_json::Value,
}

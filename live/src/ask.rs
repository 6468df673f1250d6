//! Requests and replies as JSON, the same in a browser and in a test.

use crate::knee::{Asked, Knee};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// A request.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Request {
    /// What the knee is.
    About {},
    /// An answer to loads.
    Trial(Asked),
    /// Means and intervals of that answer.
    Bands {
        /// The loads.
        trial: Asked,
        /// Samples at most.
        most: usize,
    },
}

/// The reply to a request: an object, with the key `fault` where there is no answer.
pub fn answer(knee: &Knee, request: &[u8]) -> Vec<u8> {
    let reply = serde_json::from_slice(request).map_err(|e| format!("the request: {e}")).and_then(|r| match r {
        Request::About {} => written(&knee.about()),
        Request::Trial(asked) => written(&knee.told(&asked)?),
        Request::Bands { trial, most } => written(&knee.bands(&trial, most)?),
    });
    reply.unwrap_or_else(|what| fault(&what))
}

/// A reply that says why there is no answer.
pub fn fault(what: &str) -> Vec<u8> {
    json!({"fault": what}).to_string().into_bytes()
}

fn written(value: &impl Serialize) -> Result<Vec<u8>, String> {
    serde_json::to_vec(value).map_err(|e| e.to_string())
}

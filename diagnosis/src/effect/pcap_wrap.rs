//! `pcap_wrap`: the posterior capsule lies over the condyles, out of touch from 30 deg on.

use super::fibres::wrapped;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PcapWrap {
    offset_mm: f64,
}

impl Force for PcapWrap {
    fn force(&self, here: &Situation) -> Six {
        wrapped(here, "PCAP", &|fibre, at| {
            let h = (self.offset_mm * (1.0 - at.flexion.to_degrees() / 30.0).clamp(0.0, 1.3)).max(0.0);
            2.0 * h * h / fibre.line(&at.pose).length
        })
    }
    fn has_no_slope_at_zero(&self) -> bool {
        true
    }
}

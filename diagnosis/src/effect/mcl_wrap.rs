//! `mcl_wrap`: the superficial MCL runs over the tibial rim and is longer than its straight line.

use super::fibres::wrapped;
use super::lines::point;
use super::{Force, Situation};
use nalgebra::Vector3;
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MclWrap {
    offset_mm: f64,
}

impl Force for MclWrap {
    fn force(&self, here: &Situation) -> Six {
        // longer by h^2/2 (1/a + 1/b), where the rim stands h proud of the line
        let tibia = &here.place.tibia;
        let rim = point(tibia, [0.0, 0.0, -5.0]);
        wrapped(here, "sMCL", &|fibre, at| {
            let line = fibre.line(&at.pose);
            let crossing = |femur: &Vector3<f64>| {
                let (up, way) = (tibia.superior, femur - fibre.tibia);
                let part = ((rim - fibre.tibia).dot(&up) / way.dot(&up)).clamp(0.2, 0.95);
                (tibia.medial.dot(&(way * part + fibre.tibia)), part)
            };
            let ((now, part), (then, _)) = (crossing(&line.femur), crossing(&fibre.femur));
            let h = (self.offset_mm - (now - then)).clamp(0.0, 20.0);
            0.5 * h * h * (1.0 / (part * line.length) + 1.0 / ((1.0 - part) * line.length))
        })
    }
    fn has_no_slope_at_zero(&self) -> bool {
        true
    }
}

//! `attachment`: a ligament is attached elsewhere than in the model.

use super::fibres::{fibre_pull, moved_fibre};
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;
use sim::names::is_of;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Attachment {
    variant: String,
    femur_ap_mm: f64,
    femur_si_mm: f64,
    tibia_ap_mm: f64,
}

impl Force for Attachment {
    fn force(&self, here: &Situation) -> Six {
        let (femur, tibia) = (&here.place.femur, &here.place.tibia);
        let femoral = femur.anterior * self.femur_ap_mm + femur.superior * self.femur_si_mm;
        let tibial = tibia.anterior * self.tibia_ap_mm;
        let of_structure =
            here.model.fibres.iter().filter(|f| is_of(&here.model.bundles[f.bundle].name, &self.variant));
        let mut out = Six::zeros();
        for fibre in of_structure {
            out += fibre_pull(here, &moved_fibre(fibre, &femoral, &tibial)) - fibre_pull(here, fibre);
        }
        out
    }
}

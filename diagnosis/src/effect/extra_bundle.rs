//! `extra_bundle`: a tension-only structure that the model lacks.

use super::lines::line;
use super::{Force, Situation};
use serde::Deserialize;
use sim::coordinate::Six;

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Anterolateral,
    Meniscofemoral,
    Fabellofibular,
    MedialRetinaculum,
    Popliteus,
}

impl Line {
    /// Femoral and tibial end [medial, anterior, superior, mm].
    fn ends(&self) -> ([f64; 3], [f64; 3]) {
        match self {
            Line::Anterolateral => ([-42.0, -5.0, 5.0], [-33.0, 5.0, -10.0]),
            Line::Meniscofemoral => ([8.0, -5.0, -5.0], [-15.0, -20.0, 0.0]),
            Line::Fabellofibular => ([-22.0, -28.0, 12.0], [-40.0, -22.0, -15.0]),
            Line::MedialRetinaculum => ([42.0, 0.0, 0.0], [20.0, 25.0, -12.0]),
            Line::Popliteus => ([-40.0, 3.0, -8.0], [-5.0, -22.0, -28.0]),
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExtraBundle {
    variant: Line,
    /// Stiffness [N/mm].
    k: f64,
    strain_percent: f64,
    femur_ap_mm: f64,
    femur_si_mm: f64,
    tibia_ml_mm: f64,
    tibia_ap_mm: f64,
}

impl Force for ExtraBundle {
    fn force(&self, here: &Situation) -> Six {
        let (femur, tibia) = self.variant.ends();
        let femur = [femur[0], femur[1] + self.femur_ap_mm, femur[2] + self.femur_si_mm];
        let tibia = [tibia[0] + self.tibia_ml_mm, tibia[1] + self.tibia_ap_mm, tibia[2]];
        let (line, initial) = line(here, femur, tibia);
        let slack = initial / (1.0 + 0.01 * self.strain_percent).max(0.5);
        -line.gradient * (self.k * (line.length - slack).max(0.0))
    }
}

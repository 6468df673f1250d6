//! `quad_passive`: a pull of the patellar tendon. Where the model has a patella it is the pull of the patella under tension of the quadriceps.

use super::lines::point;
use super::{Force, Situation};
use inference::trial::Trial;
use serde::Deserialize;
use sim::Model;
use sim::coordinate::{FE, Six};
use sim::ligament::Fibre;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QuadPassive {
    force_n: f64,
    further_forward_deg: f64,
    further_lateral_mm: f64,
}

impl Force for QuadPassive {
    fn force(&self, here: &Situation) -> Six {
        if here.model.has_patella() {
            return patella(here, self.force_n);
        }
        patellar_tendon(here, self.further_forward_deg, self.further_lateral_mm) * self.force_n
    }

    fn tension(&self, model: &Model, trial: &Trial) -> f64 {
        let seated = model.has_patella() && trial.record.quadriceps_n + self.force_n >= SEATED_N;
        if seated { self.force_n } else { 0.0 }
    }
}

/// Tension that lays the patella on the trochlea [N]. Below it the patella hangs in its retinacula; there its pull is taken in proportion.
const SEATED_N: f64 = 10.0;

/// What the patella does to the knee under a tension of the quadriceps [N], beside what it does under the trial's own. The patella's own geometry
/// says where the tendon runs: the shape parameters have no part.
fn patella(here: &Situation, tension: f64) -> Six {
    let own = here.trial.record.quadriceps_n;
    pull(here, own + tension) - pull(here, own)
}

/// The patella's pull under a tension [N], with a slope at zero and the other way below it, as slopes are asked there.
fn pull(here: &Situation, tension: f64) -> Six {
    let size = tension.abs();
    let seated = here.model.pull_of_quadriceps(&here.q, size.max(SEATED_N));
    seated * ((size / SEATED_N).min(1.0) * tension.signum())
}

/// The tibial tuberosity [mm].
const TUBEROSITY: [f64; 3] = [-2.5, 32.0, -30.0];
/// Length of the tendon from it to the apex of the patella [mm].
const TENDON_MM: f64 = 45.0;

/// The patellar tendon: from the patella, which follows the femur's groove, to the tuberosity. In the unloaded pose it points 20 deg forward of the
/// tibia's shaft in extension and 8 deg backward of it at 90 deg of flexion [riener1999; defrate2007], and `further` deg more forward in this knee. The
/// tuberosity lies lateral of the groove by 11 mm in extension and 0.29 mm less for every degree of flexion [suomalainen2018], 2.5 mm in the mean of 0 to
/// 90 deg, and `lateral` mm more in this knee: some 5 mm from knee to knee [schoettle2006].
pub(super) fn patellar_tendon(here: &Situation, further: f64, lateral: f64) -> Six {
    let tibia = &here.place.tibia;
    let angle = (20.0 - 28.0 * here.flexion.to_degrees() / 90.0 + further).to_radians();
    let way = tibia.superior * angle.cos() + tibia.anterior * angle.sin();
    let [medial, anterior, superior] = TUBEROSITY;
    let tuberosity = point(tibia, [medial - lateral, anterior, superior]);
    let mut unloaded = here.trial.unloaded.q;
    unloaded[FE] = here.q[FE];
    let unloaded = here.model.joint.pose(&unloaded).femur;
    let apex = unloaded.inverse_transform_point(&(tuberosity + way * TENDON_MM).into()).coords;
    let femur = &here.place.femur;
    let apex = apex - femur.medial * femur.medial.dot(&(apex - femur.origin.coords));
    -Fibre::straight(0, apex, tuberosity, TENDON_MM).line(&here.pose).gradient
}

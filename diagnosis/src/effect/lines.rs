//! Pulls along anatomical lines: generalised force of a unit tension.
//!
//! Points are given in anatomical frames as medial, anterior, superior [mm], so left and right differ in nothing.

use super::Situation;
use meshes::Vector;
use meshes::frame::AnatomicalFrame;
use sim::joint::{FE, Six};
use sim::ligament::{Fibre, Line};

/// A point of a frame, CT pose.
pub(super) fn point(frame: &AnatomicalFrame, [medial, anterior, superior]: [f64; 3]) -> Vector {
    frame.origin.coords + frame.medial * medial + frame.anterior * anterior + frame.superior * superior
}

/// The line from a femoral to a tibial point.
pub(super) fn line(here: &Situation, femur: [f64; 3], tibia: [f64; 3]) -> (Line, f64) {
    let (femur, tibia) = (point(&here.place.femur, femur), point(&here.place.tibia, tibia));
    let initial_length = (femur - tibia).norm();
    (Fibre { bundle: 0, femur, tibia, initial_length }.line(&here.pose), initial_length)
}

/// A pull between two points.
pub(crate) fn pull(here: &Situation, femur: [f64; 3], tibia: [f64; 3]) -> Six {
    -line(here, femur, tibia).0.gradient
}

/// Ischium, as the femur carries it.
const ISCHIUM: [f64; 3] = [30.0, -50.0, 360.0];

/// Semimembranosus and pes (medial), biceps (lateral).
pub(super) fn hamstring(here: &Situation, medial: bool) -> Six {
    pull(here, ISCHIUM, if medial { [22.0, -10.0, -30.0] } else { [-38.0, -20.0, -18.0] })
}

/// Both heads.
pub(super) fn gastrocnemius(here: &Situation) -> Six {
    let heel = [0.0, -40.0, -380.0];
    (pull(here, [20.0, -22.0, 10.0], heel) + pull(here, [-20.0, -22.0, 10.0], heel)) * 0.5
}

/// Gerdy's tubercle to the tensor.
pub(super) fn iliotibial(here: &Situation) -> Six {
    pull(here, [-55.0, 10.0, 350.0], [-30.0, 18.0, -18.0])
}

/// The tibial tuberosity, and the length of the tendon from it to the patella's apex [mm].
const TUBEROSITY: [f64; 3] = [-2.5, 32.0, -30.0];
const TENDON: f64 = 45.0;

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
    let mut unloaded = here.trial.neutral;
    unloaded[FE] = here.q[FE];
    let unloaded = here.model.joint.pose(&unloaded).femur;
    let apex = unloaded.inverse_transform_point(&(tuberosity + way * TENDON).into()).coords;
    let femur = &here.place.femur;
    let apex = apex - femur.medial * femur.medial.dot(&(apex - femur.origin.coords));
    -Fibre { bundle: 0, femur: apex, tibia: tuberosity, initial_length: TENDON }.line(&here.pose).gradient
}

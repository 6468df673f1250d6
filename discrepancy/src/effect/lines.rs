//! Pulls along anatomical lines: generalised force of a unit tension.
//!
//! Points are given in anatomical frames as medial, anterior, superior [mm], so left and right differ in nothing.

use super::Situation;
use meshes::Vector;
use meshes::frame::AnatomicalFrame;
use sim::joint::Six;
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
fn pull(here: &Situation, femur: [f64; 3], tibia: [f64; 3]) -> Six {
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

/// The patellar tendon at the tuberosity: 20 deg forward of the shaft in extension, 8 deg backward at 90 deg of flexion [riener1999].
pub(super) fn patellar_tendon(here: &Situation) -> Six {
    let tibia = &here.place.tibia;
    let angle = (20.0 - 28.0 * here.flexion.to_degrees() / 90.0).to_radians();
    let on_tibia = tibia.superior * angle.cos() + tibia.anterior * angle.sin();
    let at = point(tibia, [0.0, 32.0, -30.0]);
    // the femur feels the reaction along the same line
    Six::from_fn(|j, _| -on_tibia.dot(&here.pose.screws[j].at(&at)))
}

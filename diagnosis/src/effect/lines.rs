//! Pulls along anatomical lines: generalised force of a unit tension.
//!
//! Points are given in anatomical frames as medial, anterior, superior [mm], so left and right differ in nothing.

use super::Situation;
use meshes::Vector;
use meshes::frame::AnatomicalFrame;
use sim::coordinate::Six;
use sim::ligament::{Fibre, Line};

/// A point of a frame, CT pose.
pub(super) fn point(frame: &AnatomicalFrame, [medial, anterior, superior]: [f64; 3]) -> Vector {
    frame.origin.coords + frame.medial * medial + frame.anterior * anterior + frame.superior * superior
}

/// The line from a femoral to a tibial point.
pub(super) fn line(here: &Situation, femur: [f64; 3], tibia: [f64; 3]) -> (Line, f64) {
    let (femur, tibia) = (point(&here.place.femur, femur), point(&here.place.tibia, tibia));
    let initial_length = (femur - tibia).norm();
    (Fibre::straight(0, femur, tibia, initial_length).line(&here.pose), initial_length)
}

/// A pull between two points.
pub(crate) fn pull(here: &Situation, femur: [f64; 3], tibia: [f64; 3]) -> Six {
    -line(here, femur, tibia).0.gradient
}

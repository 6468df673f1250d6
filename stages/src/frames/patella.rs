//! A patella of [ct] where no patella is: behind the knee, or beside it.

use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};

/// A patella's middle lies in front of the transepicondylar axis by this at least [mm]; ours: in front of it in extension, below the condyles in flexion.
const IN_FRONT_MM: f64 = 0.0;
/// It lies no further to the side than this share of the epicondylar width [-]; ours: an epicondyle lies at a half.
const BESIDE: f64 = 0.5;

/// What is told of a patella that lies behind the femur or beside it, in the femur's own frame; `width_mm` over the epicondyles.
pub(super) fn misplaced(patella: &TriMesh, femur: &AnatomicalFrame, width_mm: f64) -> Option<Notice> {
    let sum = patella.vertices.iter().map(|p| p - femur.origin).sum::<meshes::Vector>();
    let middle = sum / patella.vertices.len().max(1) as f64;
    let (front, side) = (middle.dot(&femur.anterior), middle.dot(&femur.medial).abs());
    let place = if front < IN_FRONT_MM {
        format!("{:.0} mm behind the axis of the epicondyles", -front)
    } else if side > BESIDE * width_mm {
        format!("{side:.0} mm beside the middle of the epicondyles")
    } else {
        return None;
    };
    Some(
        Kind::PatellaFar
            .notice(format!(
                "the middle of ct.patella lies {place}, where no patella is: check its frame and its axes, and that it is not the fibula or a fabella"
            ))
            .of("patella"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::{Point, Vector};

    #[test]
    fn a_patella_behind_the_knee_or_beside_it_is_told_and_one_before_it_is_not() {
        let femur = AnatomicalFrame {
            origin: Point::new(10.0, 20.0, 30.0),
            medial: -Vector::x(),
            anterior: -Vector::y(),
            superior: Vector::z(),
        };
        let told = |medial: f64, anterior: f64, superior: f64| {
            let at = femur.origin + medial * femur.medial + anterior * femur.anterior + superior * femur.superior;
            let corners = [[-8.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 4.0, 12.0], [0.0, -4.0, -12.0]];
            let vertices = corners.map(|c| at + Vector::from(c)).to_vec();
            let patella = TriMesh { vertices, triangles: vec![[0, 1, 2], [0, 1, 3]] };
            misplaced(&patella, &femur, 80.0).map(|n| n.text)
        };
        // straight, bent by 120 deg, and off to the side as far as it goes
        for place in [[0.0, 45.0, 30.0], [0.0, 12.0, -35.0], [-20.0, 40.0, 20.0]] {
            assert_eq!(told(place[0], place[1], place[2]), None, "{place:?}");
        }
        assert!(told(0.0, -45.0, 10.0).unwrap().contains("45 mm behind"));
        assert!(told(-70.0, 5.0, 0.0).unwrap().contains("70 mm beside"));
    }
}

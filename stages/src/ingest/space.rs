//! Whether parts of a specimen are half-turn or mirror images of each other: LPS beside RAS, or a flipped export.

use crate::specimen::{IngestOptions, NamedPoint, PointFrame};
use crate::{PerBone, StageError};
use formats::says_space;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Point, Vector};

/// Ways in which frames of pictures differ: signs of x, y, z, and what is said of it.
pub(super) const TURNS: [([f64; 3], &str); 4] = [
    (
        [-1.0, -1.0, 1.0],
        "a half turn about z: one part is in RAS and the other in LPS; export both in one, or set options.ingest.ras to what is in RAS (ct, cartilage, points)",
    ),
    ([-1.0, 1.0, 1.0], "a mirror image left to right: one export flipped x, or exchanged two columns (axes)"),
    ([1.0, -1.0, 1.0], "a mirror image front to back: one export flipped y, or exchanged two columns (axes)"),
    ([1.0, 1.0, -1.0], "a mirror image top to bottom: one export flipped z, or exchanged two columns (axes)"),
];
/// Points this near a bone in the median lie on it [mm].
const ON_MM: f64 = 15.0;
/// Points this much nearer after a turn were turned [-].
const NEARER: f64 = 0.25;
/// Bones of one knee lie nearer than this [mm]; dislocated ones too.
const APART_MM: f64 = 40.0;

/// A point of RAS in LPS, and the reverse.
pub(super) fn turned(p: &Point) -> Point {
    Point::new(-p.x, -p.y, p.z)
}

/// Turns a surface to LPS where it is told to be in RAS: by the table of specimen.toml that names it, unless the file says its frame itself.
/// Surfaces that stage 0 found in a volume are in LPS already.
pub(super) fn to_lps(mesh: &mut TriMesh, key: &str, path: &str, bytes: &[u8], options: &IngestOptions) {
    let table = key.split('.').next().unwrap_or_default();
    if options.is_ras(table) && !path.starts_with("00-segment/") && !says_space(bytes) {
        mesh.vertices.iter_mut().for_each(|p| *p = turned(p));
    }
}

/// What would bring `points`, whose median distance from the surface is `off`, onto it; in words.
pub(super) fn mend(points: &[Point], surface: &SurfaceQuery, off: f64) -> &'static str {
    let found = TURNS.iter().find(|(signs, _)| {
        let median = median(points, surface, *signs);
        median < ON_MM && median < NEARER * off
    });
    found.map_or("check that both lie in one frame, in mm", |(_, what)| what)
}

fn median(points: &[Point], surface: &SurfaceQuery, signs: [f64; 3]) -> f64 {
    let turn = Vector::from(signs);
    let step = points.len() / 2000 + 1;
    let mut off: Vec<f64> = points
        .iter()
        .step_by(step)
        .map(|p| surface.nearest(&Point::from(p.coords.component_mul(&turn))).distance)
        .collect();
    meshes::measure::percentile(&mut off, 0.5)
}

/// Refuses bones, landmarks and marks of which one part is an image of the other.
///
/// # Errors
/// Which parts, how far off, and what would mend it.
pub(super) fn check(ct: &PerBone<TriMesh>, points: [&[NamedPoint]; 2]) -> Result<(), StageError> {
    let whole = TriMesh::joined([&ct.femur, &ct.tibfib]);
    let (Some(femur), Some(whole)) = (SurfaceQuery::new(&ct.femur), SurfaceQuery::new(&whole)) else { return Ok(()) };
    let gap = ct.tibfib.vertices.iter().map(|p| femur.nearest(p).distance).fold(f64::INFINITY, f64::min);
    if gap > APART_MM {
        for (signs, what) in TURNS {
            let turn = Vector::from(signs);
            let turned =
                ct.tibfib.vertices.iter().map(|p| femur.nearest(&Point::from(p.coords.component_mul(&turn))).distance);
            if turned.fold(f64::INFINITY, f64::min) < NEARER * gap {
                return Err(StageError::Knee(format!("the bones lie {gap:.0} mm apart; one is the other's {what}")));
            }
        }
    }
    for (file, named) in [("landmarks", points[0]), ("marks", points[1])] {
        let near: Vec<Point> =
            named.iter().filter(|p| p.frame == PointFrame::Ct && of_knee(&p.name)).map(|p| p.point).collect();
        if near.is_empty() {
            continue;
        }
        let off = median(&near, &whole, [1.0; 3]);
        if off <= 2.0 * ON_MM {
            continue;
        }
        let mended = TURNS.iter().find(|(signs, _)| {
            let turned = median(&near, &whole, *signs);
            turned < ON_MM && turned < NEARER * off
        });
        if let Some((_, what)) = mended {
            return Err(StageError::Knee(format!(
                "the {file} of frame ct lie {off:.0} mm off the bones in the median; they are {what}"
            )));
        }
    }
    Ok(())
}

/// Whether a landmark lies on the bones about the knee; the hip's and the ankle's do not.
pub fn of_knee(name: &str) -> bool {
    !["femoral_head_center", "ankle_center", "tibial_shaft_distal"].contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::shapes::icosphere;

    fn bones() -> PerBone<TriMesh> {
        let ball = |z: f64| {
            let mut m = icosphere(30.0, 3);
            m.vertices.iter_mut().for_each(|p| p.coords += Vector::new(100.0, 60.0, z));
            m
        };
        PerBone { femur: ball(0.0), tibfib: ball(-62.0) }
    }

    fn landmarks(signs: [f64; 3]) -> Vec<NamedPoint> {
        let places = [[130.0, 60.0, 0.0], [70.0, 60.0, 0.0], [100.0, 60.0, 420.0]];
        let names = ["epicondyle_medial", "epicondyle_lateral", "femoral_head_center"];
        let point = |p: [f64; 3]| Point::from(Vector::from(p).component_mul(&Vector::from(signs)));
        names
            .iter()
            .zip(places)
            .map(|(n, p)| NamedPoint { name: (*n).into(), frame: PointFrame::Ct, point: point(p) })
            .collect()
    }

    #[test]
    fn half_turns_and_mirrors_are_told_and_what_fits_passes() {
        let knee = bones();
        assert!(check(&knee, [&landmarks([1.0; 3]), &[]]).is_ok());
        for (signs, word) in [([-1.0, -1.0, 1.0], "RAS"), ([-1.0, 1.0, 1.0], "left to right")] {
            let told = check(&knee, [&landmarks(signs), &[]]).unwrap_err().to_string();
            assert!(told.contains(word) && told.contains("landmarks"), "{told}");
        }
        let mut turned = knee.clone();
        turned.tibfib.vertices.iter_mut().for_each(|p| *p = Point::new(-p.x, -p.y, p.z));
        let told = check(&turned, [&[], &[]]).unwrap_err().to_string();
        assert!(told.contains("RAS"), "{told}");
    }
}

//! Laws of the regions, on cartilages of known shape and thickness.

use super::*;
use meshes::sweep::Columns;

/// A left knee's frame; that of a right one where `mirrored`.
fn frame(mirrored: bool) -> AnatomicalFrame {
    let medial = if mirrored { Vector::x() } else { -Vector::x() };
    AnatomicalFrame { origin: Point::origin(), medial, anterior: -Vector::y(), superior: Vector::z() }
}

/// A layer over the points of a grid, quadrilaterals with a corner left out being left out: its place and the way up from it, and its thickness.
fn layer(size: [u32; 2], place: impl Fn(u32, u32) -> Option<(Point, Vector, f64)>) -> HexMesh {
    let mut of = Columns::default();
    let mut number = BTreeMap::new();
    for i in 0..=size[0] {
        for k in 0..=size[1] {
            let Some((foot, up, thickness)) = place(i, k) else { continue };
            number.insert((i, k), of.bony.len() as u32);
            of.bony.push(foot);
            of.articular.push(foot + up * thickness);
        }
    }
    for i in 0..size[0] {
        for k in 0..size[1] {
            let corners = [(i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)].map(|at| number.get(&at).copied());
            if let [Some(a), Some(b), Some(c), Some(d)] = corners {
                of.quads.push([a, b, c, d]);
            }
        }
    }
    of.hexahedra(3)
}

/// A femur's cartilage: on a roller of 24 mm about the transepicondylar axis, parted by a notch. `thickness` is that at an angle [deg] and a place
/// to the medial side [mm].
fn femur(mirrored: bool, thickness: impl Fn(f64, f64) -> f64) -> HexMesh {
    let medial = frame(mirrored).medial;
    layer([220, 60], |i, k| {
        let (degrees, side) = (f64::from(i) - 119.5, f64::from(k) - 30.5);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let up = Vector::new(0.0, -sin, -cos);
        let in_notch = degrees < NOTCH_DEG && side.abs() < 8.0;
        (!in_notch).then(|| (Point::origin() + medial * side + up * 24.0, up, thickness(degrees, side)))
    })
}

/// A plateau's cartilage: flat, oval, longer than broad, `x` to the medial side.
fn plateau(mirrored: bool, x: f64, thickness: impl Fn(f64, f64) -> f64) -> HexMesh {
    let medial = frame(mirrored).medial;
    layer([40, 60], |i, k| {
        let (side, front) = (f64::from(i) - 20.2, f64::from(k) - 30.3);
        let inside = (side / 15.0).hypot(front / 22.0) < 1.0;
        let foot = Point::new(0.0, -front, -30.0) + medial * (x + side);
        inside.then(|| (foot, Vector::z(), thickness(side, front)))
    })
}

/// A knee whose thickness differs from place to place.
fn knee(mirrored: bool) -> PerCartilage<HexMesh> {
    PerCartilage {
        femur: femur(mirrored, |degrees, side| 2.0 + 0.004 * degrees + 0.01 * side),
        tibia_medial: plateau(mirrored, 22.0, |side, front| 2.0 + 0.03 * side - 0.02 * front),
        tibia_lateral: plateau(mirrored, -22.0, |side, front| 2.5 - 0.002 * (side * side + front * front)),
    }
}

fn of(meshes: &PerCartilage<HexMesh>, mirrored: bool) -> Vec<Region> {
    regions(meshes, &frame(mirrored), &frame(mirrored))
}

#[test]
fn regions_add_up_to_the_whole() {
    let meshes = knee(false);
    let found = of(&meshes, false);
    assert_eq!(found.len(), 15, "{found:?}");
    for (name, mesh) in meshes.named() {
        let area = |q: &[u32; 4]| {
            let [a, b, c, d] = q.map(|n| mesh.nodes[n as usize]);
            0.5 * (c - a).cross(&(d - b)).norm()
        };
        let whole: f64 = mesh.bony_quads.iter().map(area).sum();
        let own: Vec<&Region> = found.iter().filter(|r| r.name.starts_with(&format!("{name}_"))).collect();
        let parts: f64 = own.iter().map(|r| r.area_mm2).sum();
        assert_eq!(own.len(), 5);
        assert!((parts - whole).abs() < 1e-9 * whole, "{name}: {parts} of {whole}");
        let central = own.iter().find(|r| r.name == format!("{name}_central")).map(|r| r.area_mm2 / whole);
        assert!(central.is_none_or(|share| (share - CENTRAL_SHARE).abs() < 0.01), "{name}: {central:?}");
    }
}

/// Each part of the femur and of a plateau has a thickness of its own.
#[test]
fn regions_lie_where_their_names_say() {
    let of_femur = femur(false, |degrees, side| match (degrees > NOTCH_DEG, degrees > BACK_DEG, side > 0.0) {
        (true, ..) => 1.0,
        (_, true, true) => 2.0,
        (_, _, true) => 3.0,
        (_, true, _) => 4.0,
        _ => 5.0,
    });
    let of_plateau =
        |side: f64, front: f64| match ((side / 15.0).hypot(front / 22.0), front.abs() / 22.0 > side.abs() / 15.0) {
            (r, _) if r < CENTRAL_SHARE.sqrt() => 1.0,
            (_, true) => {
                if front > 0.0 {
                    2.0
                } else {
                    3.0
                }
            }
            (_, false) => {
                if side > 0.0 {
                    5.0
                } else {
                    4.0
                }
            }
        };
    // the middle of the knee lies on the other side of the lateral plateau
    let meshes = PerCartilage {
        femur: of_femur,
        tibia_medial: plateau(false, 22.0, of_plateau),
        tibia_lateral: plateau(false, -22.0, |side, front| of_plateau(-side, front)),
    };
    for (n, r) in of(&meshes, false).iter().enumerate() {
        let wanted = (n % 5 + 1) as f64;
        // columns across a limit have parts of both
        assert!((r.mean_mm - wanted).abs() < 0.3, "{r:?}, expected {wanted} mm");
    }
}

#[test]
fn a_mirrored_knee_has_the_same_regions() {
    let (left, right) = (of(&knee(false), false), of(&knee(true), true));
    assert_eq!(left.len(), right.len());
    for (a, b) in left.iter().zip(&right) {
        let off = [a.area_mm2 - b.area_mm2, a.mean_mm - b.mean_mm, a.sd_mm - b.sd_mm];
        assert!(a.name == b.name && off.iter().all(|d| d.abs() < 1e-9), "{a:?} {b:?}");
    }
    let parts = |name: &str| left.iter().find(|r| r.name == name).map(|r| r.mean_mm);
    assert_ne!(parts("femur_medial_central"), parts("femur_lateral_central"), "they would be the same of any side");
}

#[test]
fn a_cartilage_half_a_millimetre_thicker_has_regions_half_a_millimetre_thicker() {
    let thicker = |mesh: &HexMesh| {
        let mut out = mesh.clone();
        let count = mesh.bony_nodes.len();
        let layers = mesh.nodes.len() / count - 1;
        for (n, place) in out.nodes.iter_mut().enumerate() {
            let (foot, head) = (mesh.nodes[n % count], mesh.nodes[layers * count + n % count]);
            *place += (head - foot).normalize() * (0.5 * (n / count) as f64 / layers as f64);
        }
        out
    };
    let meshes = knee(false);
    let (before, after) = (of(&meshes, false), of(&meshes.map(thicker), false));
    for (a, b) in before.iter().zip(&after) {
        assert!((b.mean_mm - a.mean_mm - 0.5).abs() < 1e-9 && (b.sd_mm - a.sd_mm).abs() < 1e-9, "{a:?} {b:?}");
        assert!(a.sd_mm > 0.01, "{a:?}");
    }
}

#[test]
fn a_mesh_without_elements_has_no_regions() {
    assert!(of(&PerCartilage::default(), false).is_empty());
}

//! A small knee for tests: a flat femur above a flat tibia, and two bundles.

use crate::knee::{BundleInput, KneeInput};
use meshes::Point;
use meshes::frame::AnatomicalFrame;
use meshes::surface::TriMesh;
use nalgebra::Vector3;

/// Nine by nine points, 5 mm apart.
fn plane(z: f64, up: bool) -> TriMesh {
    let at = |k: usize| Point::new((k % 9) as f64 * 5.0 - 20.0, (k / 9) as f64 * 5.0 - 20.0, z);
    let square = |k: usize| {
        let [a, b, c, d] = [k, k + 1, k + 9, k + 10].map(|k| k as u32);
        if up { [[a, b, d], [a, d, c]] } else { [[a, d, b], [a, c, d]] }
    };
    let squares = (0..72).filter(|k| k % 9 < 8);
    TriMesh { vertices: (0..81).map(at).collect(), triangles: squares.flat_map(square).collect() }
}

/// What it is made from.
pub(crate) fn input() -> KneeInput {
    let frame = |z: f64| AnatomicalFrame {
        origin: Point::new(0.0, 0.0, z),
        medial: -Vector3::x(),
        anterior: -Vector3::y(),
        superior: Vector3::z(),
    };
    let bundle = |name: &str, x: f64| BundleInput {
        name: name.into(),
        reference_strain: 1.05,
        stiffness: 60.0,
        reference_length: 30.0,
        fibres: vec![(Point::new(x, 4.0, 12.0), Point::new(x, -6.0, -15.0))],
    };
    KneeInput {
        frames: (frame(8.0), frame(-2.0)),
        bundles: vec![bundle("ACL_AM", 9.0), bundle("LCL", -21.0)],
        femur: plane(0.0, false),
        tibia: vec![plane(-0.3, true)],
        contact_slope: 8.0,
    }
}

/// Its mirror image: the knee of the other side.
pub(crate) fn mirrored(input: &KneeInput) -> KneeInput {
    let mut out = input.clone();
    let turned = |p: &mut Point| p.x = -p.x;
    for mesh in out.tibia.iter_mut().chain([&mut out.femur]) {
        mesh.vertices.iter_mut().for_each(turned);
        *mesh = std::mem::take(mesh).flipped();
    }
    out.bundles.iter_mut().flat_map(|b| &mut b.fibres).for_each(|(a, b)| [a, b].into_iter().for_each(turned));
    for frame in [&mut out.frames.0, &mut out.frames.1] {
        turned(&mut frame.origin);
        [&mut frame.medial, &mut frame.anterior, &mut frame.superior].into_iter().for_each(|v| v.x = -v.x);
    }
    out
}

//! Stage 3 on the shared specimens, on a phantom and on a real whole femur.

use crate::common::{bytes, shared, specimen};
use meshes::frame::Side;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Isometry, Vector};
use needs_shared::needs_shared;
use stages::PerBone;
use stages::bones::{BonesMetrics, BonesOptions, bones};

fn assert_good(metrics: &BonesMetrics, case: &str) {
    for (bone, m) in [("femur", &metrics.femur), ("tibfib", &metrics.tibfib)] {
        let e = &m.edges;
        assert!(m.volume_change_percent.abs() < 0.5, "{case} {bone}: {m:?}");
        assert!(m.surface_distance_p95_mm < 0.2, "{case} {bone}: {m:?}");
        assert!((1.3..1.7).contains(&e.edge_p50_mm), "{case} {bone}: {m:?}");
        assert!(e.edge_p01_mm > 0.8 && e.edge_p99_mm < 2.2, "{case} {bone}: {m:?}");
        assert!(e.min_angle_deg > 15.0, "{case} {bone}: {m:?}");
    }
}

#[needs_shared]
fn specimens_become_closed_even_surfaces_near_their_ct() {
    for id in ["S192803", "S193761"] {
        let Some(dir) = shared("bones of specimens", &format!("specimens/{id}")) else { return };
        let made = bones(&specimen(&dir, Side::Left), &BonesOptions::default()).unwrap();
        assert_good(&made.metrics, id);
        for (_, surface) in made.surfaces.named() {
            assert!(Topology::of(surface).is_closed());
        }
    }
}

/// Fails where triangles are laid along the axes of the file, a sliver stays, or the surface shrinks as it is smoothed.
#[test]
fn a_phantom_becomes_closed_even_surfaces_near_its_ct_wherever_it_lies() {
    // a corner of the first one's cut shank was laid onto a straight feature: a triangle without area
    for id in ["S192803-phantom", "right-phantom"] {
        let specimen = crate::frames::phantom(id);
        let here = bones(&specimen, &BonesOptions::default()).unwrap();
        assert_good(&here.metrics, id);
        for (_, surface) in here.surfaces.named() {
            assert!(Topology::of(surface).is_closed());
        }
        let pose = Isometry::new(Vector::new(30.0, -70.0, 500.0), Vector::new(0.8, -1.1, 0.4));
        let moved = PerBone { femur: specimen.ct.femur.moved(&pose), tibfib: specimen.ct.tibfib.moved(&pose) };
        let there = crate::common::of(moved, PerBone::default(), specimen.identity.side);
        let there = bones(&there, &BonesOptions::default()).unwrap();
        let (h, t) = (&here.metrics, &there.metrics);
        for (one, other) in [(&h.femur, &t.femur), (&h.tibfib, &t.tibfib)] {
            assert!((one.volume_mm3 / other.volume_mm3 - 1.0).abs() < 1e-4, "{id}: {one:?} {other:?}");
        }
    }
}

#[needs_shared]
fn a_whole_leg_is_cropped_alike_however_it_lies() {
    let Some(dir) = shared("bones of z013", "femora/z013") else { return };
    let read = |b: &str| formats::ply::read(&bytes(&dir.join(format!("z013_{b}_L.ply")))).unwrap().mesh;
    let ct = PerBone { femur: read("Femur"), tibfib: TriMesh::joined([&read("Tibia"), &read("Fibula")]) };
    let pose = Isometry::new(Vector::new(30.0, -70.0, 500.0), Vector::new(0.8, -1.1, 0.4));
    let moved = PerBone { femur: ct.femur.moved(&pose), tibfib: ct.tibfib.moved(&pose) };
    let here = bones(&crate::common::of(ct, PerBone::default(), Side::Left), &BonesOptions::default()).unwrap();
    let there = bones(&crate::common::of(moved, PerBone::default(), Side::Left), &BonesOptions::default()).unwrap();
    assert_good(&here.metrics, "z013");
    let (h, t) = (&here.metrics, &there.metrics);
    for (one, other) in [(&h.femur, &t.femur), (&h.tibfib, &t.tibfib)] {
        assert!((one.volume_mm3 / other.volume_mm3 - 1.0).abs() < 1e-4);
    }
    assert_eq!(h.tibfib.bodies, 2);
    let length = |m: &TriMesh| {
        let (lo, hi) = m.bounds().unwrap();
        hi.z - lo.z
    };
    assert!((147.0..156.0).contains(&length(&here.surfaces.femur)), "{}", length(&here.surfaces.femur));
}

#[test]
fn an_empty_bone_is_an_error_in_words() {
    let none = crate::common::of(PerBone::default(), PerBone::default(), Side::Left);
    assert!(bones(&none, &BonesOptions::default()).unwrap_err().to_string().contains("no triangles"));
}

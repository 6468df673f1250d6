//! Specifications of which no model can be made: one clear error each.
use crate::verification::rig::{Rig, plate};
use meshes::shapes::icosphere;
use sim::mesh::MeshValue;

/// The error of a rig that was spoilt.
fn error(spoil: impl FnOnce(&mut Rig)) -> String {
    let mut rig = Rig::knee();
    spoil(&mut rig);
    sim::compile(&rig.spec, &rig.meshes).unwrap_err().to_string()
}

#[test]
fn masses_that_are_zero_or_no_numbers_are_refused() {
    for mass in [0.0, -1e-5, f64::NAN, f64::INFINITY] {
        assert!(error(|r| r.spec.bodies[0].mass_tonne = mass).contains("body femur: mass_tonne"));
        assert!(error(|r| r.spec.bodies[0].inertia_tonne_mm2 = mass).contains("body femur: inertia_tonne_mm2"));
    }
    assert!(error(|r| r.spec.bodies.clear()).contains("femur"));
}

#[test]
fn open_and_inside_out_bones_are_refused() {
    let bone = |mesh| error(|r| drop(r.meshes.insert("tibia.ply".into(), MeshValue::Surface(mesh))));
    assert!(bone(plate(18.0, 8, true)).contains("bone tibia.ply is open"));
    assert!(bone(icosphere(20.0, 2).flipped()).contains("bone tibia.ply is inside out"));
}

#[test]
fn contact_surfaces_that_cannot_bear_are_refused() {
    let tibia = |mesh| error(|r| drop(r.meshes.insert("tibia0".into(), MeshValue::Surface(mesh))));
    assert!(tibia(plate(18.0, 36, false)).contains("faces away from the joint"));
    assert!(tibia(Default::default()).contains("no triangles"));
    let mut bad = plate(18.0, 36, true);
    bad.vertices[7].y = f64::NAN;
    assert!(tibia(bad).contains("vertex 7 is not finite"));
    let femur = error(|r| drop(r.meshes.insert("femur0".into(), MeshValue::Surface(icosphere(20.0, 3).flipped()))));
    assert!(femur.contains("inside out"), "{femur}");
    assert!(error(|r| drop(r.meshes.remove("femur1"))).contains("femur1"));
}

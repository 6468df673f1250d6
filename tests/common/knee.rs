//! The small knee of tests/corpus/knee: a phantom's model of few triangles, whose ligaments hold it. It is nobody's knee.
//! Other crates' tests take this file too.
//!
//! Made in November 2026 from S192803-phantom of seed 1, stages 1 to 9: contact faces thinned to 6400 triangles in all, without the trochlea; bones to 1000
//! each; strains and stiffnesses as `phantom` has them for its own laxity, but 0.92 for the ALS, which would else tear at 90 deg; no uncertainty.
#![allow(dead_code, clippy::unwrap_used, reason = "tests; each takes its part")]

use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// Its specification, and its surfaces by their names there.
pub(crate) fn small() -> (ModelSpec, BTreeMap<String, MeshValue>) {
    let spec: ModelSpec = serde_json::from_slice(include_bytes!("../corpus/knee/model.json")).unwrap();
    let files = [
        ("femur.ply", &include_bytes!("../corpus/knee/femur.ply")[..]),
        ("tibfib.ply", &include_bytes!("../corpus/knee/tibfib.ply")[..]),
        ("contact_femur.ply", &include_bytes!("../corpus/knee/contact_femur.ply")[..]),
        ("contact_tibia_medial.ply", &include_bytes!("../corpus/knee/contact_tibia_medial.ply")[..]),
        ("contact_tibia_lateral.ply", &include_bytes!("../corpus/knee/contact_tibia_lateral.ply")[..]),
    ];
    let surface = |(name, bytes): (&str, &[u8])| {
        let read = formats::read_surface(name, bytes, &BTreeMap::new()).unwrap();
        (name.to_owned(), MeshValue::Surface(read.mesh))
    };
    (spec, files.into_iter().map(surface).collect())
}

//! The contact of a diagnosis: one pass over the tibia's nodes, the plateaus continued a little past their rims.
//!
//! Where a condyle overhangs a rim, as the medial one near 90 deg of flexion, contact laws part: two passes over a patch that ends push less than
//! cartilage that goes on. The one pass is also smoother than the mean of two where the femur's nodes are few. What the model's own contact does
//! otherwise enters the declared scatter, as one number in common to all trials.

use crate::error::DiagnosisError;
use crate::problem::nuisance::is_built;
use calibration::knee::SearchOptions;
use meshes::skirt::skirted;
use sim::Model;
use sim::contact::ContactOptions;
use sim::mesh::MeshValue;
use sim::model::compile_with;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// How far the plateaus go on [mm].
const SKIRT: f64 = 3.0;

/// A model compiled for a diagnosis, with that contact beside its own. A knee built from raw data has the contact nodes of its calibration, which are fewer
/// ([`SearchOptions::contact_spacing_mm`]): there other things are known far worse.
///
/// Errors: a model that does not compile.
pub fn prepared(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    search: &SearchOptions,
) -> Result<Model, DiagnosisError> {
    let mut contact = ContactOptions::default();
    if is_built(spec) {
        contact.spacing_mm = search.contact_spacing_mm;
    }
    let mut wider = meshes.clone();
    for pair in &spec.contact.pairs {
        if let Some(MeshValue::Surface(mesh)) = meshes.get(&pair.tibia) {
            wider.insert(pair.tibia.clone(), MeshValue::Surface(skirted(mesh, SKIRT)));
        }
    }
    let other = compile_with(spec, &wider, &contact)?;
    Ok(compile_with(spec, meshes, &contact)?.with_second_contact(&other))
}

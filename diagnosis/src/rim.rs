//! The contact of a diagnosis: one pass over the tibia's nodes, the plateaus continued a little past their rims.
//!
//! Where a condyle overhangs a rim, as the medial one near 90 deg of flexion, contact laws part: two passes over a patch that ends push less than
//! cartilage that goes on. The one pass is also smoother than the mean of two where the femur's nodes are few. What the model's own contact does
//! otherwise enters the declared scatter, as one number in common to all trials.

use crate::error::DiagnosisError;
use meshes::skirt::skirted;
use sim::Model;
use sim::contact::ContactOptions;
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// How far the plateaus go on [mm].
const SKIRT: f64 = 3.0;

/// The model with that contact beside its own.
///
/// Errors: a model that does not compile.
pub fn prepared(
    model: &Model,
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
) -> Result<Model, DiagnosisError> {
    let mut wider = meshes.clone();
    for pair in &spec.contact.pairs {
        if let Some(MeshValue::Surface(mesh)) = meshes.get(&pair.tibia) {
            wider.insert(pair.tibia.clone(), MeshValue::Surface(skirted(mesh, SKIRT)));
        }
    }
    let other = sim::model::compile_with(spec, &wider, &ContactOptions::default())?;
    Ok(model.with_second_contact(&other))
}

//! What must hold of a specification and its meshes before a model can be made of them.

use crate::error::SimError;
use crate::mesh::MeshValue;
use crate::spec::ModelSpec;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use std::collections::BTreeMap;

/// Checks bodies and their bones where these are given; mass and inertia of the femur.
pub(super) fn bodies(spec: &ModelSpec, meshes: &BTreeMap<String, MeshValue>) -> Result<(f64, f64), SimError> {
    if spec.schema != "model/1" {
        return Err(SimError::Spec(format!("schema {:?}, expected \"model/1\"", spec.schema)));
    }
    if let Some(u) = &spec.uncertainty {
        u.check().map_err(SimError::Spec)?;
    }
    for body in &spec.bodies {
        for (key, value) in [("mass_tonne", body.mass_tonne), ("inertia_tonne_mm2", body.inertia_tonne_mm2)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(SimError::Spec(format!("body {}: {key} is {value}, expected above 0", body.name)));
            }
        }
        if let Some(mesh) = meshes.get(&body.bone) {
            bone(&body.bone, surface(&body.bone, mesh)?)?;
        }
    }
    let femur = spec.bodies.iter().find(|b| b.name == "femur");
    let femur = femur.ok_or_else(|| SimError::Spec("bodies: none is named \"femur\", the one that moves".into()))?;
    Ok((femur.mass_tonne, femur.inertia_tonne_mm2))
}

/// The surfaces of the contact pairs.
pub(super) fn contact_surfaces(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
) -> Result<BTreeMap<String, TriMesh>, SimError> {
    let mut surfaces = BTreeMap::new();
    for pair in &spec.contact.pairs {
        for (name, moves) in [(&pair.femur, true), (&pair.tibia, false)] {
            let mesh = meshes.get(name).ok_or_else(|| {
                SimError::Spec(format!("contact.pairs names {name}, which is not among the model's meshes"))
            })?;
            let mesh = surface(name, mesh)?;
            facing(spec, name, mesh, moves)?;
            surfaces.insert(name.clone(), mesh.clone());
        }
    }
    for (key, name) in spec.patella.iter().flat_map(|p| p.contact.meshes()) {
        let mesh = meshes.get(name).ok_or_else(|| {
            SimError::Spec(format!("patella.contact.{key} names {name}, which is not among the model's meshes"))
        })?;
        surfaces.insert(name.clone(), surface(name, mesh)?.clone());
    }
    for name in spec.contact.layer.iter().flat_map(|l| l.bony_faces.values()) {
        let mesh = meshes.get(name).ok_or_else(|| {
            SimError::Spec(format!("contact.layer.bony_faces names {name}, which is not among the model's meshes"))
        })?;
        surfaces.insert(name.clone(), surface(name, mesh)?.clone());
    }
    Ok(surfaces)
}

fn surface<'a>(name: &str, mesh: &'a MeshValue) -> Result<&'a TriMesh, SimError> {
    let MeshValue::Surface(mesh) = mesh else {
        return Err(SimError::Spec(format!("{name} is a volume mesh, expected a surface of triangles")));
    };
    let fault = |m: String| Err(SimError::Spec(format!("surface {name}: {m}")));
    if mesh.triangles.is_empty() {
        return fault("it has no triangles".into());
    }
    if let Some(i) = mesh.vertices.iter().position(|p| !p.coords.iter().all(|x| x.abs() < 1e6)) {
        return fault(format!("vertex {i} is not finite"));
    }
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= mesh.vertices.len())) {
        return fault(format!("triangle {t} names a vertex that is not there"));
    }
    Ok(mesh)
}

/// A bone is closed and turned outwards.
fn bone(name: &str, mesh: &TriMesh) -> Result<(), SimError> {
    let topology = Topology::of(mesh);
    if topology.boundary_edges > 0 {
        return Err(SimError::Spec(format!(
            "bone {name} is open: {} edges have one triangle only; close it",
            topology.boundary_edges
        )));
    }
    if mesh.volume() < 0.0 {
        return Err(SimError::Spec(format!("bone {name} is inside out; turn its triangles over")));
    }
    Ok(())
}

/// An open articular patch faces the joint: the tibia's upwards, the femur's downwards.
fn facing(spec: &ModelSpec, name: &str, mesh: &TriMesh, moves: bool) -> Result<(), SimError> {
    let total: meshes::Vector = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t)).sum();
    let way = if moves { -spec.frames.femur.superior } else { spec.frames.tibia.superior };
    if total.dot(&way) < -0.2 * mesh.area() {
        return Err(SimError::Spec(format!("surface {name} faces away from the joint; turn its triangles over")));
    }
    Ok(())
}

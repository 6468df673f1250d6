//! JAM's contact: a Smith2018ContactMesh a face, a Smith2018ArticularContactForce a pair.
//!
//! JAM takes pressure from modulus, Poisson's ratio and thickness. A contact table has none of them: thickness and ratio are set, and the modulus so that
//! the pressure is that of the table's end. A law by thickness is JAM's own, and goes with its faces on bone.

use super::super::Named;
use super::{contact_name, contact_stiffness};
use crate::model_file::LoadedModel;
use meshes::surface::TriMesh;
use sim::contact::layer::confined_modulus;
use sim::mesh::MeshValue;
use sim::spec::{LayerLaw, LayerSpec};

/// Thickness of each layer [mm] and Poisson's ratio [-] where the model has a table: usual ones of cartilage [blankevoort1991b].
const THICKNESS_MM: f64 = 2.0;
const POISSONS_RATIO: f64 = 0.45;
/// Overclosure up to which JAM looks for contact [m]; its own value.
const DEEPEST_M: f64 = 0.01;
/// Layers are nowhere taken thicker than this [m]; more than any cartilage.
const THICKEST_M: f64 = 0.02;

/// The name of the file of a face on bone.
fn back_file(model: &LoadedModel, path: &str) -> String {
    let femur = model.spec.contact.pairs.iter().any(|p| p.femur == path);
    format!("{}.obj", contact_name(model, path, femur).replace("contact", "back"))
}

/// The faces on bone, by file.
pub(super) fn backs(model: &LoadedModel) -> impl Iterator<Item = (String, &TriMesh)> {
    let faces = model.spec.contact.layer.iter().flat_map(|l| &l.bony_faces);
    faces.filter_map(|(path, bony)| match model.meshes.get(bony) {
        Some(MeshValue::Surface(mesh)) => Some((back_file(model, path), mesh)),
        _ => None,
    })
}

/// A contact mesh.
pub(super) fn mesh(model: &LoadedModel, named: &Named<'_>, frame: &str) -> String {
    let name = &named.name;
    let pairs = model.spec.contact.pairs.iter();
    let path = pairs
        .flat_map(|p| [(&p.femur, true), (&p.tibia, false)])
        .find(|(path, femur)| *femur == named.femur && contact_name(model, path, *femur) == *name)
        .map(|(path, _)| path);
    let layer = model.spec.contact.layer.as_ref();
    let Some(layer) = layer else { return by_table(name, frame, contact_stiffness(model)) };
    let back = |l: &LayerSpec| {
        path.filter(|p| l.bony_faces.contains_key(*p)).map(|p| (back_file(model, p), l.least_thickness_mm))
    };
    let varying = back(layer).map_or(String::new(), |(file, least)| {
        format!(
            "<use_variable_thickness>true</use_variable_thickness><mesh_back_file>{file}</mesh_back_file><min_thickness>{:?}</min_thickness><max_thickness>{THICKEST_M:?}</max_thickness>",
            least * 1e-3
        )
    });
    written(name, frame, [layer.youngs_modulus_mpa, layer.poissons_ratio], &varying)
}

/// A contact mesh that presses by the end of a table [MPa/mm], as one of two alike.
pub(super) fn by_table(name: &str, frame: &str, stiffness: f64) -> String {
    let confined = stiffness * 2.0 * THICKNESS_MM;
    written(name, frame, [confined / confined_modulus(1.0, POISSONS_RATIO), POISSONS_RATIO], "")
}

/// With modulus [MPa] and Poisson's ratio [-].
fn written(name: &str, frame: &str, [modulus, poisson]: [f64; 2], varying: &str) -> String {
    format!(
        "<Smith2018ContactMesh name=\"{name}\"><socket_frame>{frame}</socket_frame><location>0 0 0</location><orientation>0 0 0</orientation>\
         <socket_scale_frame>{frame}</socket_scale_frame><mesh_file>{name}.obj</mesh_file><elastic_modulus>{:?}</elastic_modulus><poissons_ratio>{poisson:?}</poissons_ratio>\
         <thickness>{:?}</thickness>{varying}<scale_factors>1 1 1</scale_factors></Smith2018ContactMesh>\n",
        modulus * 1e6,
        THICKNESS_MM * 1e-3
    )
}

/// The contact forces.
pub(super) fn forces(model: &LoadedModel) -> String {
    let law = match model.spec.contact.layer.as_ref().map(|l| l.law) {
        Some(LayerLaw::Logarithmic) => "nonlinear",
        Some(LayerLaw::Linear) | None => "linear",
    };
    let mut out = String::new();
    for (k, pair) in model.spec.contact.pairs.iter().enumerate() {
        let (femur, tibia) = (contact_name(model, &pair.femur, true), contact_name(model, &pair.tibia, false));
        out += &force(&format!("contact_{}", k + 1), [&femur, &tibia], (law, ""));
    }
    out
}

/// A contact force by one mesh on another; `more` stands before its numbers.
pub(super) fn force(name: &str, [casting, target]: [&str; 2], (law, more): (&str, &str)) -> String {
    format!(
        "<Smith2018ArticularContactForce name=\"{name}\">{more}<socket_target_mesh>/contactgeometryset/{target}</socket_target_mesh><socket_casting_mesh>/contactgeometryset/{casting}</socket_casting_mesh>\
         <min_proximity>0</min_proximity><max_proximity>{DEEPEST_M:?}</max_proximity><elastic_foundation_formulation>{law}</elastic_foundation_formulation><use_lumped_contact_model>true</use_lumped_contact_model></Smith2018ArticularContactForce>\n"
    )
}

//! The bones as layers of a scene.

use super::geometry::{Pool, thinned};
use super::scene::Layer;
use super::values::Values;

pub(super) const BONE: &str = "#e1d5be";
/// Edge of the cubes in which corners are drawn together: of bones that are there to see the rest by, and of scans [mm].
pub(super) const CONTEXT_MM: f64 = 2.2;

/// Bones as layers, the femur movable.
pub(super) fn bone_layers(v: &Values, pool: &mut Pool, opacity: f64) -> Vec<Layer> {
    let Some(bones) = &v.bones else { return vec![] };
    let patella = bones.patella.as_ref().map(|mesh| ("patella", mesh));
    bones
        .surfaces
        .named()
        .into_iter()
        .chain(patella)
        .map(|(name, mesh)| {
            let key = format!("bone {name}");
            pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
            let moves = (name == "femur").then_some("femur");
            Layer { name: name.into(), mesh: Some(key), colour: BONE, opacity, on: true, moves, ..Layer::default() }
        })
        .collect()
}

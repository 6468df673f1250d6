//! Layers that the scenes of several stages have in common.

use super::Values;
use crate::report::geometry::{Pool, thinned};
use crate::report::scene::Layer;
use stages::bones::Bones;
use stages::specimen::Specimen;

const BONE: &str = "#e1d5be";
/// Edge of the cubes in which corners are drawn together, of bones that are there to see the rest by [mm].
pub(crate) const CONTEXT_MM: f64 = 2.2;

/// Bones as layers, the femur movable.
pub(crate) fn bone_layers(v: &Values, pool: &mut Pool, opacity: f64) -> Vec<Layer> {
    let Some(bones) = v.of::<Bones>() else { return vec![] };
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

/// The CT bones, a layer each.
pub(crate) fn ct_layers(specimen: &Specimen, pool: &mut Pool, opacity: f64, on: bool) -> Vec<Layer> {
    specimen
        .ct
        .named()
        .into_iter()
        .map(|(name, mesh)| {
            let key = format!("ct {name}");
            pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
            Layer { name: format!("{name}: CT bone"), mesh: Some(key), colour: BONE, opacity, on, ..Layer::default() }
        })
        .collect()
}

//! The scene of a build that stopped.

use super::geometry::{Pool, thinned};
use super::scene::{Layer, Scene, named_places, plain};
use crate::record::Failure;
use crate::stage::{Values, bone_layers, ct_layers};
use meshes::Point;
use stages::cartilage::Cartilage;
use stages::specimen::Specimen;

/// What the failed stage was given, with the places that the message names.
pub(super) fn scene(failure: &Failure, v: &Values, pool: &mut Pool) -> Option<Scene> {
    let mut layers = bone_layers(v, pool, 0.6);
    if layers.is_empty() {
        layers.extend(ct_layers(v.of::<Specimen>()?, pool, 0.6, true));
    }
    for (name, s) in v.of::<Cartilage>().into_iter().flat_map(|c| c.solids.named()) {
        let key = format!("cartilage {name}");
        pool.keep(&key, &thinned(&s.solid, &[], 0.7).0);
        layers.push(Layer {
            name: format!("{} cartilage", plain(name)),
            mesh: Some(key),
            colour: "#7fb0d8",
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
    }
    let marks = &failure.marks;
    let count = marks.len();
    if count > 0 {
        let points: Vec<Point> = marks.iter().map(|m| Point::from(m.place)).collect();
        let mut layer = named_places("places that the message names", &points, pool);
        for (label, mark) in layer.labels.iter_mut().zip(marks).filter(|(_, mark)| !mark.name.is_empty()) {
            *label = format!("{} {label}", mark.name);
        }
        layers.push(layer);
    }
    Some(Scene {
        id: "failed".into(),
        title: format!("What {} was given", failure.stage),
        text: format!(
            "The surfaces that the stage worked on{}.",
            if count > 0 { ", with the places that the message names in red" } else { "; its message names no place" }
        ),
        from: "front",
        layers,
        moves: false,
    })
}

//! The live knee of a model that was read from a file, on a page that is no report: a plan's, a diagnosis'.

use super::geometry::{Pool, thinned};
use super::html::{LivePart, escaped, foot};
use super::live::{Begin, LiveKnee};
use super::scene::{Layer, Scene, plain};
use crate::stage::{CONTEXT_MM, contact_surface, fibre_layers};
use calibration::samples::Samples;
use live::Packed;
use meshes::surface::TriMesh;
use serde_json::json;
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// The colours of a bone and of cartilage on a page.
const BONE_COLOUR: &str = "#e1d5be";
const CARTILAGE_COLOUR: &str = "#7fb0d8";

/// A model whose reader begins so; `None` where its surfaces are not at hand.
pub(crate) fn live_part(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    samples: Option<&Samples>,
    begin: Begin,
) -> Option<LivePart> {
    let mut pool = Pool::of(&spec.frames.tibia);
    let mut layers = bones(spec, meshes, &mut pool);
    let mut faces = Vec::new();
    for (name, mesh) in contacts(spec, meshes)? {
        let (key, thin) = contact_surface(&name, mesh);
        pool.keep(&key, &thin);
        let is_femur = name.ends_with("femur");
        let alone = is_femur || layers.iter().any(|l| l.presses == Some("with scale"));
        layers.push(Layer {
            presses: Some(if alone { "alone" } else { "with scale" }),
            name: format!("{} cartilage", plain(&name)),
            mesh: Some(key.clone()),
            moves: is_femur.then_some("femur"),
            ..solid(CARTILAGE_COLOUR)
        });
        faces.push((key, thin.vertices));
    }
    layers.extend(fibre_layers(spec, &pool));
    let knee = LiveKnee::packed(
        &Packed { spec: spec.clone(), samples: samples.cloned(), meshes: meshes.clone(), faces, axes: pool.axes() },
        &spec.id,
    )?;
    let scene = Scene {
        id: "live".into(),
        title: "The knee under your loads".into(),
        text: knee.caption(),
        from: "front",
        layers,
        moves: true,
    };
    let figure = format!(
        "<figure data-scene=\"a/live\" id=\"scene-a-live\"><h3>{}</h3><div class=\"still\"></div><figcaption id=\"text-a-live\">{}</figcaption></figure>",
        escaped(&scene.title),
        escaped(&scene.text)
    );
    let section = knee.section(&figure, begin);
    let data = json!({"a": {"meshes": pool.json(), "scenes": [scene], "charts": {}, "motions": []}});
    Some(LivePart { section, foot: foot(data, &knee.scripts()) })
}

fn solid(colour: &'static str) -> Layer {
    Layer { colour, opacity: 1.0, on: true, ..Layer::default() }
}

/// The bones, a layer each.
fn bones(spec: &ModelSpec, meshes: &BTreeMap<String, MeshValue>, pool: &mut Pool) -> Vec<Layer> {
    let one = |body: &sim::spec::BodySpec| {
        let Some(MeshValue::Surface(mesh)) = meshes.get(&body.bone) else { return None };
        let key = format!("bone {}", body.name);
        pool.keep(&key, &thinned(mesh, &[], CONTEXT_MM).0);
        let moves = (body.name == "femur").then_some("femur");
        Some(Layer { name: body.name.clone(), mesh: Some(key), moves, ..solid(BONE_COLOUR) })
    };
    spec.bodies.iter().filter_map(one).collect()
}

/// The surfaces in contact, each once, by what they are called on the page: a femur's name ends so, a tibia's is its file's.
fn contacts<'a>(spec: &'a ModelSpec, meshes: &'a BTreeMap<String, MeshValue>) -> Option<Vec<(String, &'a TriMesh)>> {
    let mut out: Vec<(&String, String)> = Vec::new();
    for (k, pair) in spec.contact.pairs.iter().enumerate() {
        let stem = |path: &str| path.rsplit('/').next().and_then(|f| f.split('.').next()).unwrap_or("tibia").to_owned();
        let femur = if k == 0 { "femur".to_owned() } else { format!("{} femur", k + 1) };
        for (path, name) in [(&pair.femur, femur), (&pair.tibia, stem(&pair.tibia))] {
            if out.iter().all(|(p, _)| *p != path) {
                out.push((path, name));
            }
        }
    }
    let surface = |(path, name): (&String, String)| match meshes.get(path) {
        Some(MeshValue::Surface(mesh)) => Some((name, mesh)),
        _ => None,
    };
    out.into_iter().map(surface).collect()
}

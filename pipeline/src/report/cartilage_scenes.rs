//! The scenes of the cartilage: thickness, hexahedra, overclosure.

use super::bone_layers::bone_layers;
use super::geometry::{Pool, packed_values, thinned};
use super::scene::{Layer, Scalar, Scene, plain};
use super::values::Values;
use meshes::gap::ContactFace;
use meshes::hex::{FACES, HexMesh};
use meshes::surface::TriMesh;
use stages::PerCartilage;
use std::collections::BTreeMap;

/// Colour of menisci and what else is carried along.
const SOFT: &str = "#966ea0";

pub(super) fn cartilage(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let cartilage = v.cartilage.as_ref()?;
    let (mut layers, mut words) = (bone_layers(v, pool, 1.0), String::new());
    layers.iter_mut().for_each(|l| l.on = false);
    for (name, s) in cartilage.solids.named() {
        let key = format!("cartilage {name}");
        let (mesh, means) = thinned(&s.solid, &[&s.thickness_mm], 0.7);
        pool.keep(&key, &mesh);
        let most = s.thickness_mm.iter().copied().fold(0.0, f64::max);
        words += &format!(" {}: {:.0} mm3, at most {most:.1} mm thick.", plain(name), s.solid.volume());
        layers.push(Layer {
            name: format!("{} cartilage", plain(name)),
            mesh: Some(key),
            opacity: 1.0,
            scalar: Some(Scalar {
                values: packed_values(&means[0], 0.0, 4.0),
                low: 0.0,
                high: 4.0,
                title: "thickness mm",
                scale: "thickness",
                cells: false,
            }),
            on: true,
            ..Layer::default()
        });
    }
    for (name, mesh) in &cartilage.bodies {
        let key = format!("body {name}");
        pool.keep(&key, &thinned(mesh, &[], 0.7).0);
        words += &format!(" {}, carried along: {:.0} mm3.", plain(name), mesh.volume());
        layers.push(Layer {
            name: plain(name).into(),
            mesh: Some(key),
            colour: SOFT,
            opacity: 1.0,
            on: true,
            ..Layer::default()
        });
    }
    Some(Scene {
        id: "cartilage".into(),
        title: "Cartilage thickness".into(),
        text: format!(
            "Closed cartilage solids coloured by thickness, 0 to 4 mm.{words} It must be thickest in the middle of the contact areas and thin out to the rim, without holes."
        ),
        from: "front",
        layers,
        moves: false,
    })
}

pub(super) fn hexahedra(id: &str, meshes: &PerCartilage<HexMesh>, pool: &mut Pool) -> Scene {
    let (mut layers, mut words) = (Vec::new(), String::new());
    for (name, mesh) in meshes.named() {
        let (shell, elements) = shell(mesh);
        let quality: Vec<f64> = (0..mesh.elements.len()).map(|e| mesh.scaled_jacobian(e)).collect();
        let key = format!("{id} {name}");
        pool.keep(&key, &shell);
        let values: Vec<f64> = elements.iter().map(|e| quality[*e as usize]).collect();
        let least = quality.iter().copied().fold(1.0, f64::min);
        words += &format!(" {}: {} elements, the worst {least:.2}.", plain(name), quality.len());
        layers.push(Layer {
            name: format!("{} hexahedra", plain(name)),
            mesh: Some(key),
            opacity: 1.0,
            scalar: Some(Scalar {
                values: packed_values(&values, 0.0, 1.0),
                low: 0.0,
                high: 1.0,
                title: "scaled Jacobian",
                scale: "quality",
                cells: true,
            }),
            on: true,
            ..Layer::default()
        });
    }
    Scene {
        id: id.into(),
        title: "Hexahedra by scaled Jacobian".into(),
        text: format!(
            "The outside of the hexahedral cartilage, every element coloured by its scaled Jacobian: 1 is a cube, 0 or less is inverted.{words} Pale elements are sound. Only single elements at the rim may be orange or red."
        ),
        from: "front",
        layers,
        moves: false,
    }
}

/// Outer faces as triangles on the mesh's own nodes, and the element of each.
fn shell(mesh: &HexMesh) -> (TriMesh, Vec<u32>) {
    let mut count: BTreeMap<[u32; 4], u32> = BTreeMap::new();
    let key = |mut face: [u32; 4]| {
        face.sort_unstable();
        face
    };
    let faces_of = |e: &[u32; 8]| FACES.map(|f| f.map(|k| e[k]));
    mesh.elements.iter().flat_map(faces_of).for_each(|f| *count.entry(key(f)).or_default() += 1);
    let (mut triangles, mut elements) = (Vec::new(), Vec::new());
    for (e, element) in mesh.elements.iter().enumerate() {
        for [a, b, c, d] in faces_of(element).into_iter().filter(|f| count[&key(*f)] == 1) {
            triangles.extend([[a, b, c], [a, c, d]]);
            elements.extend([e as u32; 2]);
        }
    }
    let (shell, _) = TriMesh { vertices: mesh.nodes.clone(), triangles }.submesh(|_| true);
    (shell, elements)
}

pub(super) fn overclosure(v: &Values, pool: &mut Pool) -> Option<Scene> {
    let (before, after) = (v.hexes.as_ref()?, v.separated.as_ref()?);
    let (mut layers, mut words) = (Vec::new(), String::new());
    for (when, meshes) in [("before", &before.meshes), ("after", &after.meshes)] {
        let femur = ContactFace::new(&meshes.femur.nodes, &meshes.femur.articular_quads)?;
        for (name, mesh) in [("tibia_medial", &meshes.tibia_medial), ("tibia_lateral", &meshes.tibia_lateral)] {
            let triangles = mesh.articular_quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
            let (face, _) = TriMesh { vertices: mesh.nodes.clone(), triangles }.submesh(|_| true);
            let gaps: Vec<f64> = face.vertices.iter().map(|p| femur.gap(p).map_or(2.0, |g| g.gap)).collect();
            let least = gaps.iter().copied().fold(2.0, f64::min);
            words += &format!(" {} {when}: {least:.2} mm.", plain(name));
            let key = format!("gap {when} {name}");
            pool.keep(&key, &face);
            layers.push(Layer {
                name: format!("{}: gap {when}", plain(name)),
                mesh: Some(key),
                opacity: 1.0,
                scalar: Some(Scalar {
                    values: packed_values(&gaps, -2.0, 2.0),
                    low: -2.0,
                    high: 2.0,
                    title: "gap mm",
                    scale: "gap",
                    cells: false,
                }),
                on: when == "after",
                one_of: Some(if name == "tibia_medial" { "medial" } else { "lateral" }),
                ..Layer::default()
            });
        }
    }
    layers.extend(hexahedra("overclosure", &after.meshes, pool).layers.into_iter().map(|l| Layer {
        on: false,
        name: format!("{} after", l.name),
        ..l
    }));
    Some(Scene {
        id: "overclosure".into(),
        title: "Overclosure before and after".into(),
        text: format!(
            "Tibial articular faces coloured by the gap to the femoral face: red where they overlap (below 0), blue where they are apart; 2 mm stands for farther. Smallest gaps:{words} Nothing may be red after."
        ),
        from: "above",
        layers,
        moves: false,
    })
}

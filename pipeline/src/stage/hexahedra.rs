//! How hexahedra are shown: the scene and the stills that hexmesh and overclosure have in common.

use super::Values;
use crate::report::geometry::{Pool, packed_values};
use crate::report::picture::{Picture, picture};
use crate::report::scene::{Layer, Scalar, Scene, plain};
use meshes::Point;
use meshes::hex::{FACES, HexMesh};
use meshes::render::Painted;
use meshes::surface::TriMesh;
use stages::PerCartilage;
use stages::frames::Frames;
use std::collections::BTreeMap;

/// The outside of the hexahedra, coloured by quality.
pub(super) fn scene(id: &str, meshes: &PerCartilage<HexMesh>, pool: &mut Pool) -> Scene {
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
            mesh: Some(key.clone()),
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
        layers.push(Layer {
            name: format!("{} edges", plain(name)),
            mesh: Some(key),
            edges: true,
            colour: "#7d8894",
            opacity: 1.0,
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

/// The same as still pictures.
pub(super) fn stills(v: &Values, meshes: [(&'static str, &HexMesh); 3]) -> Option<Vec<Picture>> {
    let frames = v.of::<Frames>()?;
    let shells = meshes.map(|(_, mesh)| quality_shell(mesh));
    let painted: Vec<Painted> = shells.iter().map(|(mesh, paint)| Painted { mesh, colours: paint }).collect();
    let (f, t) = (&frames.femur, &frames.tibia);
    let scale =
        "elements with a scaled Jacobian above 0.5 are pale, below 0.5 orange, below 0.2 red, inverted ones black";
    Some(vec![
        picture(&painted[..1], f.anterior, f.superior, format!("Femoral hexahedra from the front: {scale}")),
        picture(&painted[..1], -f.superior, f.anterior, format!("Femoral hexahedra from below: {scale}")),
        picture(&painted[1..], t.superior, t.anterior, format!("Tibial hexahedra from above: {scale}")),
    ])
}

/// Pale where an element is sound, so that the few bad ones are seen.
fn quality_colour(scaled_jacobian: f64) -> [u8; 3] {
    match scaled_jacobian {
        j if j <= 0.0 => [20, 0, 20],
        j if j < 0.2 => [190, 20, 40],
        j if j < 0.5 => [250, 160, 80],
        _ => [200, 212, 222],
    }
}

/// The outer faces as triangles of their own, coloured by their element's scaled Jacobian.
pub(super) fn quality_shell(mesh: &HexMesh) -> (TriMesh, Vec<[u8; 3]>) {
    let mut count: BTreeMap<[u32; 4], u32> = BTreeMap::new();
    let key = |mut face: [u32; 4]| {
        face.sort_unstable();
        face
    };
    let faces_of = |e: &[u32; 8]| FACES.map(|f| f.map(|k| e[k]));
    mesh.elements.iter().flat_map(faces_of).for_each(|f| *count.entry(key(f)).or_default() += 1);
    let mut shell = TriMesh::default();
    let mut paint = Vec::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        let c = quality_colour(mesh.scaled_jacobian(e));
        for face in faces_of(element).into_iter().filter(|f| count[&key(*f)] == 1) {
            let base = shell.vertices.len() as u32;
            let corners: [Point; 4] = face.map(|n| mesh.nodes[n as usize]);
            shell.vertices.extend(corners);
            paint.extend([c; 4]);
            shell.triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
    }
    (shell, paint)
}

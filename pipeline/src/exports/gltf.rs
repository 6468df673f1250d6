//! Binary glTF 2.0 <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>: surfaces and fibres, metres.

use super::named;
use crate::model_file::LoadedModel;
use meshes::Point;
use serde_json::{Value, json};

/// glTF numbers: float and unsigned int components; array and index buffers; lines and triangles.
const FLOAT: u32 = 5126;
const UINT: u32 = 5125;
const CORNERS: u32 = 34962;
const INDICES: u32 = 34963;
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;

/// Buffers as they grow.
#[derive(Default)]
struct Scene {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

/// The model in the CT pose as one file; a node a surface and one of all fibres, by name.
pub(super) fn glb(model: &LoadedModel) -> Vec<u8> {
    let mut scene = Scene::default();
    for n in named(model) {
        let indices: Vec<u32> = n.mesh.triangles.iter().flatten().copied().collect();
        scene.add(&n.name, &n.mesh.vertices, &indices, TRIANGLES, usize::from(!n.bone));
    }
    let ends: Vec<Point> = model.spec.fibres.iter().flat_map(|f| [f.femur, f.tibia]).collect();
    let indices: Vec<u32> = (0..ends.len() as u32).collect();
    scene.add("fibres", &ends, &indices, LINES, 2);
    scene.packed(&model.spec.id)
}

impl Scene {
    fn add(&mut self, name: &str, corners: &[Point], indices: &[u32], mode: u32, material: usize) {
        if corners.is_empty() || indices.is_empty() {
            return;
        }
        let metres: Vec<[f32; 3]> = corners.iter().map(|p| [p.x, p.y, p.z].map(|x| (x * 1e-3) as f32)).collect();
        let end =
            |pick: fn(f32, f32) -> f32| [0, 1, 2].map(|k| metres.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0));
        let (low, high) = (end(f32::min), end(f32::max));
        let position = self.view(metres.iter().flatten().flat_map(|x| x.to_le_bytes()).collect(), CORNERS);
        self.accessors.push(json!({"bufferView": position, "componentType": FLOAT, "count": metres.len(), "type": "VEC3", "min": low, "max": high}));
        let place = self.view(indices.iter().flat_map(|i| i.to_le_bytes()).collect(), INDICES);
        self.accessors
            .push(json!({"bufferView": place, "componentType": UINT, "count": indices.len(), "type": "SCALAR"}));
        let last = self.accessors.len();
        let primitive =
            json!({"attributes": {"POSITION": last - 2}, "indices": last - 1, "mode": mode, "material": material});
        self.nodes.push(json!({"name": name, "mesh": self.meshes.len()}));
        self.meshes.push(json!({"name": name, "primitives": [primitive]}));
    }

    fn view(&mut self, bytes: Vec<u8>, target: u32) -> usize {
        self.views
            .push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(), "target": target}));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    /// Header, JSON chunk, binary chunk.
    fn packed(self, id: &str) -> Vec<u8> {
        let colour = |name: &str, c: [f64; 3]| json!({"name": name, "doubleSided": true, "pbrMetallicRoughness": {"baseColorFactor": [c[0], c[1], c[2], 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}});
        let document = json!({
            "asset": {"version": "2.0", "generator": "genu"},
            "scene": 0,
            "scenes": [{"name": id, "nodes": (0..self.nodes.len()).collect::<Vec<_>>()}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": [colour("bone", [0.88, 0.83, 0.74]), colour("cartilage", [0.5, 0.69, 0.85]), colour("fibre", [0.78, 0.06, 0.18])],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len()}],
        });
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bytes = self.bytes;
        bytes.resize(bytes.len().next_multiple_of(4), 0);
        let mut out = b"glTF".to_vec();
        let total = 12 + 8 + text.len() + 8 + bytes.len();
        for number in [2, total as u32, text.len() as u32] {
            out.extend(number.to_le_bytes());
        }
        out.extend(b"JSON");
        out.extend(text);
        out.extend((bytes.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(bytes);
        out
    }
}

//! What a page carries of a knee, as one block of bytes.
//!
//! A length, a head in JSON, and the numbers of its surfaces: little-endian, coordinates as 64-bit floats so that answers are those of the
//! build, indices as 32-bit integers. The page compresses the block.

use calibration::samples::Samples;
use meshes::surface::TriMesh;
use meshes::{Isometry, Point};
use serde::{Deserialize, Serialize};
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// What a page carries.
#[derive(Clone, Debug)]
pub struct Packed {
    /// The calibrated model.
    pub spec: ModelSpec,
    /// The samples of its calibration, where there are any.
    pub samples: Option<Samples>,
    /// The surfaces that contact needs, by the paths the model names.
    pub meshes: BTreeMap<String, MeshValue>,
    /// Corners of the surfaces that the page colours by pressure, by the page's names; CT frame [mm].
    pub faces: Vec<(String, Vec<Point>)>,
    /// The page's axes from CT.
    pub axes: Isometry,
}

#[derive(Serialize, Deserialize)]
struct Head {
    spec: ModelSpec,
    samples: Option<Samples>,
    axes: Isometry,
    /// Name, corners, triangles.
    surfaces: Vec<(String, usize, usize)>,
    /// Name, corners.
    faces: Vec<(String, usize)>,
}

/// Packs a knee. Surfaces that neither contact nor a ligament's way needs are left out.
///
/// # Errors
/// A surface that the model names is not there.
pub fn pack(knee: &Packed) -> Result<Vec<u8>, String> {
    let mut surfaces: BTreeMap<&String, &TriMesh> = BTreeMap::new();
    let patella = knee.spec.patella.iter().flat_map(|p| p.contact.meshes()).map(|(_, name)| name);
    for name in knee.spec.contact.meshes().chain(patella).chain(knee.spec.wrapped_bones()) {
        match knee.meshes.get(name) {
            Some(MeshValue::Surface(mesh)) => surfaces.insert(name, mesh),
            _ => return Err(format!("the model names {name}, which is no surface of its own")),
        };
    }
    let counted = |(name, mesh): (&&String, &&TriMesh)| ((*name).clone(), mesh.vertices.len(), mesh.triangles.len());
    let head = Head {
        spec: knee.spec.clone(),
        samples: knee.samples.clone(),
        axes: knee.axes,
        surfaces: surfaces.iter().map(counted).collect(),
        faces: knee.faces.iter().map(|(name, corners)| (name.clone(), corners.len())).collect(),
    };
    let head = serde_json::to_vec(&head).map_err(|e| e.to_string())?;
    let mut out = u32::try_from(head.len()).map_err(|e| e.to_string())?.to_le_bytes().to_vec();
    out.extend(head);
    let numbers = |out: &mut Vec<u8>, corners: &[Point]| {
        out.extend(corners.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f64::to_le_bytes));
    };
    for mesh in surfaces.values() {
        numbers(&mut out, &mesh.vertices);
        out.extend(mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
    }
    knee.faces.iter().for_each(|(_, corners)| numbers(&mut out, corners));
    Ok(out)
}

/// Reads a pack.
///
/// # Errors
/// What is not a pack, or is cut short.
pub fn unpack(bytes: &[u8]) -> Result<Packed, String> {
    let mut rest = bytes;
    let length = u32::from_le_bytes(*take(&mut rest)?) as usize;
    let head = rest.get(..length).ok_or_else(short)?;
    rest = &rest[length..];
    let head: Head = serde_json::from_slice(head).map_err(|e| format!("the packed knee: {e}"))?;
    let mut meshes = BTreeMap::new();
    for (name, corners, triangles) in head.surfaces {
        let vertices = points(&mut rest, corners)?;
        let index = |rest: &mut &[u8]| Ok::<u32, String>(u32::from_le_bytes(*take(rest)?));
        let triangle = |_| Ok::<_, String>([index(&mut rest)?, index(&mut rest)?, index(&mut rest)?]);
        let triangles = (0..triangles).map(triangle).collect::<Result<_, _>>()?;
        meshes.insert(name, MeshValue::Surface(TriMesh { vertices, triangles }));
    }
    let face = |(name, corners): (String, usize)| Ok::<_, String>((name, points(&mut rest, corners)?));
    let faces = head.faces.into_iter().map(face).collect::<Result<_, _>>()?;
    if !rest.is_empty() {
        return Err(format!("the packed knee has {} bytes too many", rest.len()));
    }
    Ok(Packed { spec: head.spec, samples: head.samples, meshes, faces, axes: head.axes })
}

fn points(rest: &mut &[u8], count: usize) -> Result<Vec<Point>, String> {
    let mut number = || Ok::<f64, String>(f64::from_le_bytes(*take(rest)?));
    (0..count).map(|_| Ok(Point::new(number()?, number()?, number()?))).collect()
}

/// The next bytes.
fn take<'a, const N: usize>(rest: &mut &'a [u8]) -> Result<&'a [u8; N], String> {
    let (first, more) = rest.split_first_chunk().ok_or_else(short)?;
    *rest = more;
    Ok(first)
}

fn short() -> String {
    "the packed knee is cut short".to_owned()
}

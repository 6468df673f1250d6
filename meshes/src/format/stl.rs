//! STL, binary and ASCII.

use super::FormatError;
use crate::Point;
use crate::surface::TriMesh;
use std::collections::BTreeMap;
use std::io::Cursor;

/// Reads an STL; equal corners (to the last bit) become one vertex, in order of first appearance.
pub fn read(bytes: &[u8]) -> Result<TriMesh, FormatError> {
    let stl = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|e| FormatError(e.to_string()))?;
    let mut mesh = TriMesh::default();
    let mut index: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for face in &stl.faces {
        mesh.triangles.push(face.vertices.map(|v| {
            let p = stl.vertices[v];
            let key = [p[0].to_bits(), p[1].to_bits(), p[2].to_bits()];
            *index.entry(key).or_insert_with(|| {
                mesh.vertices.push(Point::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])));
                (mesh.vertices.len() - 1) as u32
            })
        }));
    }
    Ok(mesh)
}

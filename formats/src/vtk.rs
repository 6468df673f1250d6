//! Surfaces of VTK: legacy files (.vtk, versions to 5.1) and XML files (.vtp, .vtu) of polygons [vtk2006].
//!
//! ASCII, binary and appended data, zlib or none. Cells that are no faces (lines, points) are left out; solids are refused.

mod legacy;
mod xml;

use super::raw::refuse;
use super::{FormatError, cut_polygon, refuse_not_finite};
use meshes::Point;
use meshes::surface::TriMesh;

/// Reads a surface.
///
/// # Errors
/// A file that is cut short, lies about its counts, or holds no faces.
pub fn read(bytes: &[u8]) -> Result<TriMesh, FormatError> {
    if looks_legacy(bytes) { legacy::read(bytes) } else { xml::read(bytes) }
}

/// Solid elements of a mesh, in the order of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solids {
    /// Positions [mm].
    pub nodes: Vec<Point>,
    /// Elements of eight nodes (VTK's kind 12).
    pub hexahedra: Vec<[u32; 8]>,
    /// Elements of four nodes (VTK's kind 10).
    pub tetrahedra: Vec<[u32; 4]>,
}

/// Reads the hexahedra and tetrahedra of an XML file (.vtu).
///
/// # Errors
/// A file that is cut short, lies about its counts, or holds cells of another kind.
pub fn read_solids(bytes: &[u8]) -> Result<Solids, FormatError> {
    let (coordinates, [_, _, cells]) = xml::parsed(bytes)?;
    let nodes: Vec<Point> = coordinates.chunks_exact(3).map(|c| Point::new(c[0], c[1], c[2])).collect();
    refuse_not_finite(&nodes)?;
    let mut out = Solids { nodes, ..Solids::default() };
    let mut start = 0;
    for (k, &end) in cells.ends.iter().enumerate() {
        let Some(list) = cells.points.get(start..end) else {
            return refuse(format!("cell {} ends at {end}, of {} numbers", k + 1, cells.points.len()));
        };
        start = end;
        if let Some(p) = list.iter().find(|p| **p as usize >= out.nodes.len()) {
            return refuse(format!("cell {} names point {p}, of {}", k + 1, out.nodes.len()));
        }
        match (cells.kinds.get(k), list.len()) {
            (Some(12), 8) => out.hexahedra.push(std::array::from_fn(|i| list[i])),
            (Some(10), 4) => out.tetrahedra.push(std::array::from_fn(|i| list[i])),
            (kind, n) => {
                let kind = kind.map_or("unknown".to_owned(), u8::to_string);
                return refuse(format!(
                    "cell {} is of VTK kind {kind} with {n} points; expected hexahedra (12) or tetrahedra (10)",
                    k + 1
                ));
            }
        }
    }
    match out.hexahedra.is_empty() && out.tetrahedra.is_empty() {
        true => refuse("the file holds no cells; expected hexahedra or tetrahedra (.vtu)"),
        false => Ok(out),
    }
}

pub(super) fn looks_legacy(bytes: &[u8]) -> bool {
    bytes.get(..18).is_some_and(|b| b.eq_ignore_ascii_case(b"# vtk DataFile Ver"))
}

pub(super) fn looks_xml(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(1000)];
    head.windows(8).any(|w| w == b"<VTKFile")
}

/// VTK's numbers of kinds of cells that are faces.
const STRIP: u8 = 6;
const FACES: [u8; 4] = [5, 7, 8, 9];
const SOLIDS: [u8; 6] = [10, 11, 12, 13, 14, 42];

/// Faces as VTK keeps them: where each cell's list of points ends, and the lists.
#[derive(Default)]
struct Cells {
    ends: Vec<usize>,
    points: Vec<u32>,
    /// The kind of each cell; empty where all are polygons.
    kinds: Vec<u8>,
    strips: bool,
}

/// A number of the file as the index of something.
fn index(x: f64) -> Result<u32, FormatError> {
    if x >= 0.0 && x < f64::from(u32::MAX) && x.fract() == 0.0 {
        Ok(x as u32)
    } else {
        refuse(format!("a cell names point {x}; expected a whole number from 0"))
    }
}

/// The surface of points, three numbers each, and cells.
fn surface(coordinates: &[f64], cells: &[Cells]) -> Result<TriMesh, FormatError> {
    let vertices: Vec<Point> = coordinates.chunks_exact(3).map(|c| Point::new(c[0], c[1], c[2])).collect();
    refuse_not_finite(&vertices)?;
    let mut mesh = TriMesh { vertices, triangles: Vec::new() };
    for cells in cells {
        let mut start = 0;
        for (k, &end) in cells.ends.iter().enumerate() {
            let Some(list) = cells.points.get(start..end) else {
                return refuse(format!("cell {} ends at {end}, of {} numbers", k + 1, cells.points.len()));
            };
            start = end;
            if let Some(p) = list.iter().find(|p| **p as usize >= mesh.vertices.len()) {
                return refuse(format!("cell {} names point {p}, of {}", k + 1, mesh.vertices.len()));
            }
            let kind = cells.kinds.get(k).copied().unwrap_or(if cells.strips { STRIP } else { 7 });
            face(kind, list, k, &mut mesh)?;
        }
    }
    if mesh.triangles.is_empty() {
        return refuse("the file has points and no faces; expected a surface: export triangles");
    }
    Ok(mesh)
}

fn face(kind: u8, list: &[u32], k: usize, mesh: &mut TriMesh) -> Result<(), FormatError> {
    if kind == STRIP {
        for (i, w) in list.windows(3).enumerate() {
            mesh.triangles.push(if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] });
        }
    } else if SOLIDS.contains(&kind) {
        return refuse(format!("cell {} is a solid (VTK kind {kind}); expected a surface: extract it first", k + 1));
    } else if FACES.contains(&kind) && list.len() >= 3 {
        // A pixel's last two corners are exchanged.
        let ring = if let (8, [a, b, c, d]) = (kind, list) { vec![*a, *b, *d, *c] } else { list.to_vec() };
        let TriMesh { vertices, triangles } = mesh;
        cut_polygon(vertices, &ring, triangles).map_err(|e| FormatError(format!("cell {}: {}", k + 1, e.0)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;

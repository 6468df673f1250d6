//! PLY: read with vertex colours, written little-endian with double coordinates and optional per-vertex scalars.

use super::FormatError;
use crate::Point;
use crate::surface::{ColouredMesh, TriMesh};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use std::io::{self, Cursor, Write};

/// Reads a PLY surface with its colours.
pub fn read(bytes: &[u8]) -> Result<ColouredMesh, FormatError> {
    let ply =
        Parser::<DefaultElement>::new().read_ply(&mut Cursor::new(bytes)).map_err(|e| FormatError(e.to_string()))?;
    let mut scan = ColouredMesh::default();
    let number = |e: &DefaultElement, key: &str| match e.get(key) {
        Some(Property::Float(v)) => Some(f64::from(*v)),
        Some(Property::Double(v)) => Some(*v),
        Some(Property::UChar(v)) => Some(f64::from(*v)),
        _ => None,
    };
    for e in ply.payload.get("vertex").into_iter().flatten() {
        let (Some(x), Some(y), Some(z)) = (number(e, "x"), number(e, "y"), number(e, "z")) else {
            return Err(FormatError("vertex without x, y, z".into()));
        };
        scan.mesh.vertices.push(Point::new(x, y, z));
        if let (Some(r), Some(g), Some(b)) = (number(e, "red"), number(e, "green"), number(e, "blue")) {
            scan.colours.push([r as u8, g as u8, b as u8]);
        }
    }
    for e in ply.payload.get("face").into_iter().flatten() {
        let list: Vec<u32> = match e.get("vertex_indices").or_else(|| e.get("vertex_index")) {
            Some(Property::ListInt(v)) => v.iter().map(|&i| i as u32).collect(),
            Some(Property::ListUInt(v)) => v.clone(),
            _ => return Err(FormatError("face without vertex_indices".into())),
        };
        for k in 1..list.len().saturating_sub(1) {
            scan.mesh.triangles.push([list[0], list[k], list[k + 1]]);
        }
    }
    Ok(scan)
}

/// Writes a surface with named per-vertex scalars (each as long as the vertices).
pub fn write(out: &mut dyn Write, mesh: &TriMesh, scalars: &[(&str, &[f64])]) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.vertices.len())?;
    writeln!(out, "property double x\nproperty double y\nproperty double z")?;
    for (name, _) in scalars {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", mesh.triangles.len())?;
    for (i, p) in mesh.vertices.iter().enumerate() {
        for x in p.coords.iter() {
            out.write_all(&x.to_le_bytes())?;
        }
        for (_, values) in scalars {
            out.write_all(&(values[i] as f32).to_le_bytes())?;
        }
    }
    for t in &mesh.triangles {
        out.write_all(&[3])?;
        for v in t {
            out.write_all(&v.to_le_bytes())?;
        }
    }
    Ok(())
}

/// Writes a coloured surface; float coordinates, as scanners do.
pub fn write_coloured(out: &mut dyn Write, scan: &ColouredMesh) -> io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", scan.mesh.vertices.len())?;
    writeln!(out, "property float x\nproperty float y\nproperty float z")?;
    writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", scan.mesh.triangles.len())?;
    for (p, c) in scan.mesh.vertices.iter().zip(&scan.colours) {
        for x in p.coords.iter() {
            out.write_all(&(*x as f32).to_le_bytes())?;
        }
        out.write_all(c)?;
    }
    for t in &scan.mesh.triangles {
        out.write_all(&[3])?;
        for v in t {
            out.write_all(&v.to_le_bytes())?;
        }
    }
    Ok(())
}

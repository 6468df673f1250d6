//! VTU (VTK XML unstructured grid): hexahedra with per-cell and per-node scalars, ASCII.

use crate::hex::HexMesh;
use std::io::{self, Write};

/// Writes a hexahedral mesh (VTK cell type 12).
pub fn write_hex(out: &mut dyn Write, mesh: &HexMesh) -> io::Result<()> {
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">"
    )?;
    writeln!(
        out,
        "<UnstructuredGrid><Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">",
        mesh.nodes.len(),
        mesh.elements.len()
    )?;
    writeln!(out, "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">")?;
    for p in &mesh.nodes {
        writeln!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    writeln!(out, "</DataArray></Points><Cells><DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">")?;
    for e in &mesh.elements {
        writeln!(out, "{}", e.map(|n| n.to_string()).join(" "))?;
    }
    writeln!(out, "</DataArray><DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">")?;
    for i in 1..=mesh.elements.len() {
        writeln!(out, "{}", 8 * i)?;
    }
    writeln!(out, "</DataArray><DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">")?;
    for _ in &mesh.elements {
        writeln!(out, "12")?;
    }
    writeln!(
        out,
        "</DataArray></Cells><CellData><DataArray type=\"Float64\" Name=\"scaled_jacobian\" format=\"ascii\">"
    )?;
    for e in 0..mesh.elements.len() {
        writeln!(out, "{:?}", mesh.scaled_jacobian(e))?;
    }
    writeln!(out, "</DataArray></CellData></Piece></UnstructuredGrid></VTKFile>")
}

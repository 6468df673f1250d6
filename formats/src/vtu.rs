//! VTU (VTK XML unstructured grid): hexahedra with per-cell and per-node scalars, ASCII.

use meshes::hex::HexMesh;
use std::io::{self, Write};

/// A field over nodes or elements: its name, numbers a value, values one after another.
pub type Field<'a> = (&'a str, usize, &'a [f64]);

/// Writes a hexahedral mesh (VTK cell type 12) with the elements' scaled Jacobian.
pub fn write_hex(out: &mut dyn Write, mesh: &HexMesh) -> io::Result<()> {
    let shape: Vec<f64> = (0..mesh.elements.len()).map(|e| mesh.scaled_jacobian(e)).collect();
    write_hex_fields(out, mesh, &[], &[("scaled_jacobian", 1, &shape)])
}

fn write_fields(out: &mut dyn Write, kind: &str, fields: &[Field]) -> io::Result<()> {
    if fields.is_empty() {
        return Ok(());
    }
    write!(out, "<{kind}>")?;
    for (name, numbers, values) in fields {
        let components = if *numbers > 1 { format!("NumberOfComponents=\"{numbers}\" ") } else { String::new() };
        writeln!(out, "<DataArray type=\"Float64\" Name=\"{name}\" {components}format=\"ascii\">")?;
        for value in values.chunks((*numbers).max(1)) {
            let words: Vec<String> = value.iter().map(|x| format!("{x:?}")).collect();
            writeln!(out, "{}", words.join(" "))?;
        }
        write!(out, "</DataArray>")?;
    }
    write!(out, "</{kind}>")
}

/// Writes a hexahedral mesh with fields over its nodes and elements.
pub fn write_hex_fields(out: &mut dyn Write, mesh: &HexMesh, nodes: &[Field], elements: &[Field]) -> io::Result<()> {
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
    write!(out, "</DataArray></Cells>")?;
    write_fields(out, "PointData", nodes)?;
    write_fields(out, "CellData", elements)?;
    writeln!(out, "</Piece></UnstructuredGrid></VTKFile>")
}

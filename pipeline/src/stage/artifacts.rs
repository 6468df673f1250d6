//! How surfaces and meshes are written to a stage's folder.

use formats::{ply, vtu};
use meshes::hex::HexMesh;
use meshes::surface::{ColouredMesh, TriMesh};
use std::io;

/// Files by name, to be written to the stage's folder.
pub(crate) type Files = io::Result<Vec<(String, Vec<u8>)>>;

pub(super) fn hexes(meshes: [(&'static str, &HexMesh); 3]) -> Files {
    meshes
        .into_iter()
        .map(|(name, mesh)| {
            let mut bytes = Vec::new();
            vtu::write_hex(&mut bytes, mesh)?;
            Ok((format!("{name}.vtu"), bytes))
        })
        .collect()
}

pub(super) fn surface(mesh: &TriMesh, scalars: &[(&str, &[f64])]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    ply::write(&mut bytes, mesh, scalars)?;
    Ok(bytes)
}

pub(super) fn scan_bytes(scan: &ColouredMesh) -> io::Result<Vec<u8>> {
    if scan.colours.is_empty() {
        return surface(&scan.mesh, &[]);
    }
    let mut bytes = Vec::new();
    ply::write_coloured(&mut bytes, scan)?;
    Ok(bytes)
}

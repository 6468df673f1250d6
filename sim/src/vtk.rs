//! A model as VTK files for ParaView: surfaces and fibres at a pose, with what they carry.

use crate::mesh::MeshValue;
use crate::spec::ModelSpec;
use meshes::surface::TriMesh;
use meshes::{Isometry, Point};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Writes the model's surfaces (`*.vtp`) and fibres (`fibres.vtp`) with the femur moved by `femur` from the CT pose.
/// `force_n` is one number per bundle in the model's order, shared by its fibres, or empty. Surfaces are those in `meshes`, by the
/// paths the model names; a face that is not given is left out.
pub fn export(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    femur: &Isometry,
    force_n: &[f64],
) -> Vec<(String, String)> {
    let mut files = Vec::new();
    // The patella goes with the femur, as menisci stay with the tibia: no solver moves either.
    let bones = spec.bodies.iter().map(|b| (&b.bone, b.name == "femur" || b.name.starts_with("patella")));
    let faces = spec.contact.pairs.iter().flat_map(|p| [(&p.femur, true), (&p.tibia, false)]);
    let mut done: Vec<&String> = Vec::new();
    for (path, moves) in bones.chain(faces) {
        let Some(MeshValue::Surface(mesh)) = meshes.get(path) else { continue };
        if done.contains(&path) {
            continue;
        }
        done.push(path);
        let stem = path.trim_start_matches("../").replace(['/', '\\'], "_");
        let stem = stem.rsplit_once('.').map_or(stem.as_str(), |(s, _)| s).to_owned();
        let name = format!("{}.vtp", stem.strip_prefix("meshes_").unwrap_or(&stem));
        files.push((name, if moves { surface(&mesh.moved(femur)) } else { surface(mesh) }));
    }
    files.push(("fibres.vtp".to_owned(), fibres(spec, femur, force_n)));
    files
}

fn surface(mesh: &TriMesh) -> String {
    let cells: Vec<&[u32]> = mesh.triangles.iter().map(|t| &t[..]).collect();
    poly_data(&mesh.vertices, "Polys", &cells, "")
}

/// Lines with bundle number, force [N] and length [mm].
fn fibres(spec: &ModelSpec, femur: &Isometry, force_n: &[f64]) -> String {
    let points: Vec<Point> = spec.fibres.iter().flat_map(|f| [femur * f.femur, f.tibia]).collect();
    let lines: Vec<[u32; 2]> = (0..spec.fibres.len() as u32).map(|i| [2 * i, 2 * i + 1]).collect();
    let cells: Vec<&[u32]> = lines.iter().map(|l| &l[..]).collect();
    let bundle = |name: &str| spec.bundles.iter().position(|b| b.name == name);
    let count = |name: &str| spec.fibres.iter().filter(|f| f.bundle == name).count().max(1) as f64;
    let (mut numbers, mut forces, mut lengths) = (String::new(), String::new(), String::new());
    for f in &spec.fibres {
        let place = bundle(&f.bundle);
        let force = place.and_then(|i| force_n.get(i)).map_or(0.0, |n| n / count(&f.bundle));
        let _ = writeln!(numbers, "{}", place.map_or(-1, |i| i as i64));
        let _ = writeln!(forces, "{force:?}");
        let _ = writeln!(lengths, "{:?}", (femur * f.femur - f.tibia).norm());
    }
    let array = |kind: &str, name: &str, text: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">\n{text}</DataArray>\n")
    };
    let data = array("Int32", "bundle", &numbers) + &array("Float64", "force_n", &forces);
    poly_data(&points, "Lines", &cells, &(data + &array("Float64", "length_mm", &lengths)))
}

/// A VTP file (VTK XML poly data), ASCII; `kind` is Polys or Lines.
fn poly_data(points: &[Point], kind: &str, cells: &[&[u32]], cell_data: &str) -> String {
    let n = |k: &str| if k == kind { cells.len() } else { 0 };
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n\
         <PolyData><Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"{}\" NumberOfStrips=\"0\" NumberOfPolys=\"{}\">\n\
         <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n",
        points.len(),
        n("Lines"),
        n("Polys")
    );
    for p in points {
        let _ = writeln!(out, "{:?} {:?} {:?}", p.x, p.y, p.z);
    }
    let _ = writeln!(
        out,
        "</DataArray></Points><{kind}>\n<DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">"
    );
    for c in cells {
        let _ = writeln!(out, "{}", c.iter().map(u32::to_string).collect::<Vec<_>>().join(" "));
    }
    out += "</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">\n";
    let mut end = 0;
    for c in cells {
        end += c.len();
        let _ = writeln!(out, "{end}");
    }
    let _ = writeln!(out, "</DataArray></{kind}>\n<CellData>\n{cell_data}</CellData></Piece></PolyData></VTKFile>");
    out
}

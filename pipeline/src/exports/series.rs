//! A time series for ParaView: one .vtu a pose with bones, contact faces and fibres, and the .pvd that lists them.

use super::{File, named};
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use meshes::{Isometry, Point};
use notices::{Kind, Notice};
use sim::coordinate::Six;
use sim::joint::Joint;
use std::fmt::Write;
use std::path::Path;

const POSE: [&str; 6] = ["fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];

/// A row of the poses: Grood-Suntay coordinates, and a force of each bundle where there are any.
struct Row {
    pose: Six,
    forces: Vec<(String, f64)>,
}

/// model.pvd and model_0000.vtu, ...: a file a row of `table` (results of `simulate`, protocols of `validate`), time being the row's number. A row without
/// equilibrium has no pose and no file; beside the files stands how many there are.
pub(super) fn files(model: &LoadedModel, place: &Path, table: &[u8]) -> Result<(Vec<File>, Vec<Notice>), BuildError> {
    let fault = |e: String| BuildError::in_file(place, e);
    let joint = Joint::new(&model.spec.frames, model.spec.side).map_err(|e| fault(e.to_string()))?;
    let mut out = Vec::new();
    let mut list = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\"><Collection>\n".to_owned();
    let rows = rows(table).map_err(&fault)?;
    for (n, row) in rows.iter().enumerate() {
        let Some(row) = row else { continue };
        let q = joint.coordinates(&row.pose).map_err(|e| fault(format!("row {}: {e}", n + 1)))?;
        let name = format!("model_{n:04}.vtu");
        let _ = writeln!(list, "<DataSet timestep=\"{n}\" part=\"0\" file=\"{name}\"/>");
        out.push((name, grid(model, &joint.pose(&q).femur, &row.forces).into_bytes()));
    }
    list += "</Collection></VTKFile>\n";
    out.push(("model.pvd".into(), list.into_bytes()));
    Ok((out, without_pose(&rows, place).into_iter().chain(of_a_cut_knee(table)).collect()))
}

/// What is said of rows of a cut knee, whose files have the whole one.
fn of_a_cut_knee(table: &[u8]) -> Option<Notice> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(table);
    let at = reader.headers().ok()?.iter().position(|h| h == "without")?;
    let rows: Vec<csv::StringRecord> = reader.records().flatten().collect();
    let cut: Vec<&str> = rows.iter().filter_map(|r| r.get(at)).filter(|name| !name.is_empty()).collect();
    let text = format!("{} rows are of a knee without {}; their files have the whole knee", cut.len(), cut.first()?);
    Some(Kind::NotInFormat.notice(text).count(cut.len()))
}

/// What is said of rows without a pose; nothing where each has one.
fn without_pose(rows: &[Option<Row>], place: &Path) -> Option<Notice> {
    let count = rows.iter().filter(|r| r.is_none()).count();
    let first = rows.iter().position(Option::is_none)?;
    let have = if count == 1 { "has" } else { "have" };
    let text = format!(
        "{count} of {} rows of {} {have} no equilibrium, and no file in the series; the first: row {}",
        rows.len(),
        place.display(),
        first + 1
    );
    Some(Kind::RowFlagged.notice(text).count(count))
}

/// The rows in their order; none of one without equilibrium, whose pose is empty but for the flexion.
fn rows(table: &[u8]) -> Result<Vec<Option<Row>>, String> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(table);
    let header: Vec<String> = reader.headers().map_err(|e| e.to_string())?.iter().map(str::to_owned).collect();
    let place = |name: &str| {
        header
            .iter()
            .position(|h| h == name)
            .ok_or(format!("no column {name}; expected the columns that simulate writes"))
    };
    let mut columns = [0; 6];
    for (column, name) in columns.iter_mut().zip(POSE) {
        *column = place(name)?;
    }
    let forces: Vec<(usize, String)> = header
        .iter()
        .enumerate()
        .filter_map(|(k, h)| Some((k, h.strip_prefix("force_")?.strip_suffix("_n")?.to_owned())))
        .collect();
    let mut out = Vec::new();
    for (n, record) in reader.records().enumerate() {
        let record = record.map_err(|e| e.to_string())?;
        let number = |k: usize| record.get(k).and_then(|x| x.trim().parse::<f64>().ok()).filter(|x| x.is_finite());
        if columns[1..].iter().all(|k| record.get(*k).is_some_and(|cell| cell.trim().is_empty())) {
            out.push(None);
            continue;
        }
        let mut pose = Six::zeros();
        for (k, column) in columns.iter().enumerate() {
            let x = number(*column).ok_or(format!("row {}: {} is not a number", n + 1, POSE[k]))?;
            pose[k] = if k < 3 { x.to_radians() } else { x };
        }
        out.push(Some(Row {
            pose,
            forces: forces.iter().map(|(k, name)| (name.clone(), number(*k).unwrap_or(0.0))).collect(),
        }));
    }
    if out.iter().all(Option::is_none) { Err("no row with a pose".into()) } else { Ok(out) }
}

/// One unstructured grid: triangles (VTK type 5) and lines (3) with part number and fibre force.
fn grid(model: &LoadedModel, femur: &Isometry, forces: &[(String, f64)]) -> String {
    let mut points: Vec<Point> = Vec::new();
    let (mut cells, mut ends, mut types, mut parts, mut loads) =
        (String::new(), String::new(), String::new(), String::new(), String::new());
    let mut end = 0;
    let surfaces = named(model);
    for (part, n) in surfaces.iter().enumerate() {
        let base = points.len() as u32;
        points.extend(n.mesh.vertices.iter().map(|p| if n.femur { femur * p } else { *p }));
        for [a, b, c] in &n.mesh.triangles {
            end += 3;
            let _ = writeln!(cells, "{} {} {}", a + base, b + base, c + base);
            let _ = writeln!(ends, "{end}");
            let _ = writeln!(parts, "{part}");
            types += "5\n";
            loads += "0\n";
        }
    }
    for f in &model.spec.fibres {
        let base = points.len();
        points.extend([femur * f.femur, f.tibia]);
        let count = model.spec.fibres.iter().filter(|g| g.bundle == f.bundle).count() as f64;
        let force = forces.iter().find(|(name, _)| *name == f.bundle).map_or(0.0, |(_, n)| n / count);
        end += 2;
        let _ = writeln!(cells, "{base} {}", base + 1);
        let _ = writeln!(ends, "{end}");
        let _ = writeln!(parts, "{}", surfaces.len());
        types += "3\n";
        let _ = writeln!(loads, "{force}");
    }
    let mut places = String::new();
    for p in &points {
        let _ = writeln!(places, "{:.5} {:.5} {:.5}", p.x, p.y, p.z);
    }
    let count = types.len() / 2;
    let array = |kind: &str, name: &str, text: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">\n{text}</DataArray>\n")
    };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n<UnstructuredGrid><Piece NumberOfPoints=\"{}\" NumberOfCells=\"{count}\">\n\
         <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n{places}</DataArray></Points>\n<Cells>\n{}{}{}</Cells>\n<CellData>\n{}{}</CellData></Piece></UnstructuredGrid></VTKFile>\n",
        points.len(),
        array("Int32", "connectivity", &cells),
        array("Int32", "offsets", &ends),
        array("UInt8", "types", &types),
        array("Int32", "part", &parts),
        array("Float64", "force_n", &loads)
    )
}

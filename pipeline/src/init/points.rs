//! Tables and points: which table of specimen.toml they belong to, by header or labels.

use super::{Filled, Placed, file_name};
use attachments::bundle::LIGAMENTS;
use meshes::Point;
use meshes::surface::TriMesh;
use stages::guess::{Role, frames_of};
use stages::ingest::markup_names;
use stages::specimen::PointFrame;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Landmarks that the build uses where they are given.
const USED: &str = "femoral_head_center, epicondyle_medial, epicondyle_lateral, tibial_shaft_distal, ankle_center";

/// Columns by which a workbook's sheet and a table's header are known.
const COLUMNS: [&str; 16] = [
    "trial", "test", "name", "ligament", "bundle", "fibre", "frame", "x_mm", "y_mm", "z_mm", "fe_deg", "vv_deg",
    "ie_deg", "ml_mm", "ap_mm", "si_mm",
];

/// Points of 3D Slicer or MeshLab: marks where every label is a ligament's, else landmarks.
pub(super) fn markups(path: &Path, bytes: Vec<u8>, filled: &mut Filled) -> Placed {
    let from = path.display().to_string();
    let leave = |why: String| Placed { from: from.clone(), to: None, why, line: None, bytes: vec![] };
    let names = match markup_names(&file_name(path), &bytes) {
        Some(Ok(names)) if !names.is_empty() => names,
        Some(Err(e)) => return leave(format!("cannot be read: {e}")),
        _ => return leave("a list of points, but none in it; save it again".into()),
    };
    let ligaments = names.iter().filter(|n| LIGAMENTS.contains(&n.as_str())).count();
    let key = if ligaments == names.len() { "marks" } else { "landmarks" };
    if filled.paths.contains_key(&("points".to_owned(), key.to_owned())) {
        return leave(format!("{key}, of which another file is taken; put all into one"));
    }
    let lower = from.to_lowercase();
    let ending = ["fcsv", "pp"].into_iter().find(|e| lower.ends_with(&format!(".{e}"))).unwrap_or("mrk.json");
    let to = format!("{key}.{ending}");
    filled.paths.insert(("points".into(), key.into()), to.clone());
    let known = names.iter().filter(|n| USED.split(", ").any(|u| u == n.as_str())).count();
    let hint = match key == "landmarks" && known == 0 {
        true => format!("; none of them is one that the build knows ({USED}): correct the labels"),
        false => String::new(),
    };
    let why = format!("{} {key}, taken to lie in the frame of CT: {}{hint}", names.len(), names.join(", "));
    Placed { from, to: Some(to), why, line: None, bytes }
}

/// A table's place, by its header; points without a frame get that of the surface they lie on.
pub(super) fn table(path: &Path, bytes: Vec<u8>, known: &BTreeMap<Role, TriMesh>, filled: &mut Filled) -> Placed {
    let from = path.display().to_string();
    let names = COLUMNS.map(String::from);
    if from.to_lowercase().ends_with(".tdms") {
        let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
        let to = format!("laxity/{stem}.tdms");
        filled.paths.insert(("laxity".into(), stem), to.clone());
        return Placed { from, to: Some(to), why: "channels of a robot or an apparatus".into(), line: None, bytes };
    }
    let (text, ending) = match sim::text::table(&bytes, &names) {
        // a workbook's rows as they would stand in a CSV
        Ok(table) if table.separator.is_some() => (table.text.replace(';', ","), "xlsx"),
        Ok(table) => (table.text.into_owned(), "csv"),
        Err(kind) => return Placed { from, to: None, why: format!("no table: {kind}"), line: None, bytes },
    };
    let header = header(&text, &names);
    let has = |column: &str| header.split([',', ';', '\t']).any(|c| c.trim() == column);
    let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut place = |table: &str, key: &str, to: String| {
        filled.paths.insert((table.into(), key.into()), to.clone());
        Some(to)
    };
    let points = |key: &str| (key == "landmarks" && has("name") || key == "marks" && has("ligament")) && has("x_mm");
    let (to, why, bytes) = if has("bundle") && has("fibre") {
        (place("points", "attachments", format!("attachments.{ending}")), "fibres given by hand".to_owned(), bytes)
    } else if let Some(key) = ["landmarks", "marks"].into_iter().find(|k| points(k)) {
        let (why, bytes, ending) = match has("frame") {
            true => (format!("{key}, with their frames"), bytes, ending),
            false => framed(&text, known),
        };
        (place("points", key, format!("{key}.{ending}")), why, bytes)
    } else if has("fe_deg") && !header.contains("load") {
        (place("passive", &stem, format!("passive/{stem}.{ending}")), "measured passive flexion".into(), bytes)
    } else if header.contains("load")
        || header.contains("force")
        || header.contains("torque")
        || header.contains("moment")
    {
        (place("laxity", &stem, format!("laxity/{stem}.{ending}")), "measured laxity".into(), bytes)
    } else {
        (None, format!("no table that is known; its header is {header}"), bytes)
    };
    Placed { from, to, why, line: None, bytes }
}

/// The header in lower case: the first line that has three known names, else the first.
fn header(text: &str, names: &[String]) -> String {
    let known = |l: &&str| l.split([',', ';', '\t']).filter(|c| names.contains(&c.trim().to_lowercase())).count() >= 3;
    let first = text.lines().next().unwrap_or_default();
    text.lines().find(known).unwrap_or(first).to_lowercase()
}

/// A table of points with a column `frame` put in, by the surface that they lie nearest to.
fn framed(text: &str, known: &BTreeMap<Role, TriMesh>) -> (String, Vec<u8>, &'static str) {
    let surfaces: Vec<(PointFrame, &TriMesh)> = known
        .iter()
        .filter_map(|(role, mesh)| match role {
            Role::CtFemur | Role::CtTibfib => Some((PointFrame::Ct, mesh)),
            Role::ScanFemur => Some((PointFrame::ScanFemur, mesh)),
            Role::ScanTibfib => Some((PointFrame::ScanTibfib, mesh)),
            Role::CtPatella => None,
        })
        .collect();
    let point = |line: &str| {
        let x: Vec<f64> = line.split(',').rev().take(3).filter_map(|c| c.trim().parse().ok()).collect();
        (x.len() == 3).then(|| Point::new(x[2], x[1], x[0]))
    };
    let mut lines = text.lines();
    let header = lines.next().unwrap_or("").replacen(",x_mm", ",frame,x_mm", 1);
    let (mut out, mut counts) = (header + "\n", BTreeMap::<&str, usize>::new());
    let lines: Vec<(&str, Option<Point>)> = lines.filter(|l| !l.trim().is_empty()).map(|l| (l, point(l))).collect();
    let points: Vec<Point> = lines.iter().filter_map(|l| l.1).collect();
    let mut frames = frames_of(&points, &surfaces).into_iter();
    for (line, point) in lines {
        let frame = point.and_then(|_| frames.next().flatten()).map_or("ct", |frame| match frame {
            PointFrame::Ct => "ct",
            PointFrame::ScanFemur => "scan_femur",
            PointFrame::ScanTibfib => "scan_tibfib",
        });
        *counts.entry(frame).or_default() += 1;
        let (name, rest) = line.split_once(',').unwrap_or((line, ""));
        let _ = writeln!(out, "{name},{frame},{rest}");
    }
    let told: Vec<String> = counts.iter().map(|(f, n)| format!("{n} in {f}")).collect();
    (format!("points without frames; by the surface they lie on: {}", told.join(", ")), out.into_bytes(), "csv")
}

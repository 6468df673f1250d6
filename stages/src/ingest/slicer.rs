//! Points as 3D Slicer keeps them: .mrk.json, .fcsv, and the table that it exports (label, l, p, s or r, a, s).
//! They are turned to LPS from what the file states.

use crate::StageError;
use meshes::Point;
use serde::Deserialize;

/// A named point, and where in its file it stands.
pub(super) struct Placed {
    pub(super) name: String,
    pub(super) point: Point,
    /// Line or number of the point, in words.
    pub(super) place: String,
}

/// The points of a file of 3D Slicer's, LPS; `None` for another kind of file.
pub(super) fn read(path: &str, bytes: &[u8]) -> Option<Result<Vec<Placed>, StageError>> {
    let (text, _) = sim::text::decoded(bytes);
    let text = text.as_ref();
    let fail = |what: String| StageError::file(path, what);
    let lower = path.to_ascii_lowercase();
    if lower.ends_with(".json") || text.trim_start().starts_with('{') {
        return Some(markups(text).map_err(fail));
    }
    if let Some((columns, turn)) = exported(text) {
        return Some(table(text, columns, turn).map_err(fail));
    }
    (lower.ends_with(".fcsv") || text.starts_with("# Markups")).then(|| fiducials(text).map_err(fail))
}

/// Tabs of a line from which on they stand between its cells: a label and three coordinates have three.
const LEAST_TABS: usize = 3;

/// The cells of a line, between commas or tabs.
fn cells(line: &str) -> csv::StringRecord {
    let separator = if line.matches('\t').count() >= LEAST_TABS { b'\t' } else { b',' };
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .delimiter(separator)
        .trim(csv::Trim::All)
        .from_reader(line.as_bytes());
    reader.records().next().and_then(Result::ok).unwrap_or_default()
}

/// The columns of a table that 3D Slicer exports, and the sign of x and y that turns it to LPS; none of another table.
fn exported(text: &str) -> Option<([&'static str; 3], f64)> {
    let header = cells(text.lines().next()?);
    let has = |name: &str| header.iter().any(|c| c.eq_ignore_ascii_case(name));
    let known = [(["l", "p", "s"], 1.0), (["r", "a", "s"], -1.0)];
    known.into_iter().find(|(axes, _)| has("label") && axes.iter().all(|a| has(a)))
}

/// The points of an exported table; one that is announced and not placed (`defined` is 0) is left out.
fn table(text: &str, columns: [&str; 3], turn: f64) -> Result<Vec<Placed>, String> {
    let mut lines = text.lines().enumerate();
    let header = lines.next().map(|(_, line)| cells(line)).unwrap_or_default();
    let at = |name: &str| header.iter().position(|c| c.eq_ignore_ascii_case(name));
    let mut points = Vec::new();
    for (k, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let (row, place) = (cells(line), format!("line {}", k + 1));
        let cell = |name: &str| at(name).and_then(|i| row.get(i)).unwrap_or_default();
        if cell("defined") == "0" {
            continue;
        }
        let mut values = [0.0; 3];
        for (value, name) in values.iter_mut().zip(columns) {
            let read = cell(name).parse::<f64>().ok().filter(|x| x.is_finite());
            *value = read.ok_or_else(|| format!("{place}: {name} is `{}`; expected a number in mm", cell(name)))?;
        }
        let [x, y, z] = values;
        points.push(Placed { name: cell("label").to_string(), point: Point::new(turn * x, turn * y, z), place });
    }
    Ok(points)
}

#[derive(Deserialize)]
struct File {
    markups: Vec<Markup>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Markup {
    #[serde(default)]
    coordinate_system: Option<serde_json::Value>,
    #[serde(default)]
    coordinate_units: Option<serde_json::Value>,
    #[serde(default)]
    control_points: Vec<ControlPoint>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ControlPoint {
    #[serde(default)]
    label: String,
    #[serde(default)]
    position: Option<Vec<f64>>,
    #[serde(default)]
    position_status: Option<String>,
}

fn markups(text: &str) -> Result<Vec<Placed>, String> {
    let file: File = serde_json::from_str(text).map_err(|e| {
        format!("line {}: {e}; expected the markups of 3D Slicer (.mrk.json){}", e.line(), no_json(text))
    })?;
    let mut points = Vec::new();
    let mut unplaced = 0usize;
    for markup in file.markups {
        let system =
            markup.coordinate_system.map_or("LPS".into(), |s| s.as_str().map_or(s.to_string(), str::to_string));
        let turn = turn(&system)?;
        let mm = match &markup.coordinate_units {
            Some(unit) => millimetres(unit)?,
            None => 1.0,
        };
        for (k, p) in markup.control_points.into_iter().enumerate() {
            let place = format!("point {}", k + 1);
            // A point that was announced and not placed has no position.
            if p.position_status.as_deref().is_some_and(|s| s != "defined") {
                unplaced += 1;
                continue;
            }
            match p.position.as_deref() {
                Some([x, y, z]) if [x, y, z].iter().all(|x| x.is_finite()) => {
                    let point = Point::new(turn * x, turn * y, *z) * mm;
                    points.push(Placed { name: p.label, point, place });
                }
                _ => return Err(format!("{place} ({}) has no position of three numbers", p.label)),
            }
        }
    }
    match points.is_empty() && unplaced > 0 {
        true => Err(format!(
            "all {unplaced} points are announced and none is placed (positionStatus): place them in 3D Slicer and save them again"
        )),
        false => Ok(points),
    }
}

/// What is said of a word that other programs write for a number and JSON has not.
fn no_json(text: &str) -> &'static str {
    match ["NaN", "Infinity"].iter().any(|word| text.contains(word)) {
        true => "; JSON has no NaN and no Infinity: take out the points that were not measured",
        false => "",
    }
}

/// The length of `coordinateUnits` [mm]: a unit of UCUM, alone or first in a list with the code's system and its name.
fn millimetres(unit: &serde_json::Value) -> Result<f64, String> {
    let text = unit.as_str().or_else(|| unit.as_array().and_then(|list| list.first()).and_then(|u| u.as_str()));
    match text.map(str::trim) {
        Some("mm" | "") => Ok(1.0),
        Some("cm") => Ok(10.0),
        Some("m") => Ok(1000.0),
        Some("um" | "µm") => Ok(0.001),
        Some("[in_i]" | "in") => Ok(25.4),
        _ => Err(format!("coordinateUnits is {unit}; expected mm, cm, m, um or [in_i]")),
    }
}

/// The sign of x and y that turns a coordinate system to LPS.
fn turn(system: &str) -> Result<f64, String> {
    match system.trim() {
        "LPS" | "1" => Ok(1.0),
        "RAS" | "0" => Ok(-1.0),
        other => Err(format!("the coordinate system is {other}; expected LPS or RAS")),
    }
}

/// What is said of a file of points that went through a spreadsheet.
const SEMICOLONS: &str = ": its cells are parted by semicolons, as a spreadsheet writes them; save it from 3D Slicer, or write commas between cells and decimal points in numbers";

fn fiducials(text: &str) -> Result<Vec<Placed>, String> {
    // Versions before 4.6 do not state it and are in RAS.
    let mut turn_by = -1.0;
    let mut columns: Vec<String> = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label".split(',').map(str::to_string).collect();
    let mut points = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let place = format!("line {}", k + 1);
        if let Some(comment) = line.strip_prefix('#') {
            match comment.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
                Some(("CoordinateSystem", system)) => turn_by = turn(system).map_err(|e| format!("{place}: {e}"))?,
                Some(("columns", names)) => columns = names.split(',').map(|n| n.trim().to_string()).collect(),
                _ => {}
            }
            continue;
        }
        if line.trim().is_empty() {
            continue;
        }
        let row = cells(line);
        let cell = |name: &str| columns.iter().position(|c| c == name).and_then(|k| row.get(k));
        let number = |name: &str| {
            cell(name).and_then(|x| x.parse::<f64>().ok()).filter(|x| x.is_finite()).ok_or_else(|| {
                let parted = if line.contains(';') { SEMICOLONS } else { "" };
                format!("{place}: {name} is `{}`; expected a number in mm{parted}", cell(name).unwrap_or_default())
            })
        };
        let point = Point::new(turn_by * number("x")?, turn_by * number("y")?, number("z")?);
        points.push(Placed { name: cell("label").unwrap_or_default().to_string(), point, place });
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_are_read_in_the_frame_they_state() {
        let json = r#"{"@schema":"x","markups":[{"type":"Fiducial","coordinateSystem":"RAS","coordinateUnits":"mm","controlPoints":[
            {"id":"1","label":"ACL","position":[1.0,2.0,3.0],"positionStatus":"defined"},{"label":"PCL","positionStatus":"undefined"}]}]}"#;
        let read_one = |path: &str, text: &str| read(path, text.as_bytes()).unwrap();
        let points = read_one("a.mrk.json", json).unwrap();
        assert_eq!(points.len(), 1);
        assert_eq!((points[0].name.as_str(), points[0].point), ("ACL", Point::new(-1.0, -2.0, 3.0)));
        let lps = read_one("a.mrk.json", &json.replace("RAS", "LPS")).unwrap();
        assert_eq!(lps[0].point, Point::new(1.0, 2.0, 3.0));
        let listed = json.replace("\"mm\"", "[\"cm\", \"UCUM\", \"centimeter\"]");
        assert_eq!(read_one("a.mrk.json", &listed).unwrap()[0].point, Point::new(-10.0, -20.0, 30.0));
        let quoted = "# CoordinateSystem = LPS\n1,1,2,3,0,0,0,1,1,1,0,\"ACL, \"\"a\"\"\",,\n";
        assert_eq!(read_one("a.fcsv", quoted).unwrap()[0].name, "ACL, \"a\"");
        for (system, sign) in [("LPS", 1.0), ("0", -1.0), ("1", 1.0)] {
            let text = format!(
                "# Markups fiducial file version = 4.11\n# CoordinateSystem = {system}\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n1,1,2,3,0,0,0,1,1,1,0,ACL,,\n"
            );
            let points = read_one("a.fcsv", &text).unwrap();
            assert_eq!((points[0].name.as_str(), points[0].point), ("ACL", Point::new(sign, 2.0 * sign, 3.0)));
        }
        for (path, text, word) in [
            ("a.mrk.json", "{\"markups\": [", "line 1"),
            ("a.mrk.json", &json.replace("RAS", "XYZ"), "LPS or RAS"),
            ("a.mrk.json", &json.replace("\"mm\"", "\"ft\""), "mm"),
            ("a.fcsv", "# CoordinateSystem = LPS\n1,a,2,3", "line 2: x"),
            ("a.fcsv", "# CoordinateSystem = LPS\n1;1,5;2,0;3,25;0;0;0;1;1;1;0;ACL", "parted by semicolons"),
        ] {
            let told = read_one(path, text).err().unwrap().to_string();
            assert!(told.contains(word), "{told}");
        }
        assert!(read("landmarks.csv", b"name,frame,x_mm,y_mm,z_mm\n").is_none());
    }

    #[test]
    fn an_exported_table_is_read_in_the_frame_that_its_columns_name() {
        let read_one = |text: &str| read("a.csv", text.as_bytes()).unwrap();
        let rows = "\"ACL, a\",1,2,3,1,1,1,0,\"\"\nPCL,0,0,0,0,1,1,0,\"\"\n";
        for (axes, sign) in [("l,p,s", 1.0), ("r,a,s", -1.0)] {
            let text = format!("label,{axes},defined,selected,visible,locked,description\n{rows}");
            let tabs = text.replace("\"ACL, a\"", "ACL; a").replace(',', "\t").replace("ACL; a", "ACL, a");
            for text in [text, tabs] {
                let points = read_one(&text).unwrap();
                assert_eq!(points.len(), 1, "{text}");
                assert_eq!((points[0].name.as_str(), points[0].point), ("ACL, a", Point::new(sign, 2.0 * sign, 3.0)));
            }
        }
        let told = read_one("label,l,p,s\nACL,1,two,3\n").err().unwrap().to_string();
        assert!(told.contains("line 2: p is `two`"), "{told}");
    }
}

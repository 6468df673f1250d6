//! landmarks.csv, marks.csv, attachments.csv; points of 3D Slicer.

use super::file::OPTIONAL_PATHS;
use super::space::turned;
use super::{landmark_names, picked, slicer};
use crate::StageError;
use crate::specimen::{IngestOptions, NamedPoint, PointFrame, RawSpecimen, SpecimenFile};
use attachments::bundle::{BUNDLES, LIGAMENTS};
use attachments::site::{Fibre, Source};
use meshes::Point;
use notices::{Kind, Notice};
use sim::names::did_you_mean;

/// Names of ligaments that others use, and ours. By letters they are nearer to another ligament's.
const OTHER_NAMES: [(&str, &str); 3] = [("FCL", "LCL"), ("TCL", "sMCL"), ("ALL", "ALS")];

/// The landmarks; empty without a file.
pub(super) fn landmarks(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    options: &IngestOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Vec<NamedPoint>, StageError> {
    let path = file.points.landmarks.as_deref().unwrap_or(OPTIONAL_PATHS[0]);
    let mut all = named_points((raw, options.is_ras("points")), path, "name", |_| Ok(()), warnings)?;
    landmark_names::settle(path, &mut all, warnings)?;
    // tracked bodies are tied to landmarks of any names
    if file.laxity_format.values().all(|format| format.tracked.is_none()) {
        warnings.extend(landmark_names::none_read(path, &all));
    }
    Ok(all)
}

/// What is said where a file of landmarks lacks the one that frames build on: it may have been cut short.
pub(super) fn missing(file: &SpecimenFile, raw: &RawSpecimen, landmarks: &[NamedPoint]) -> Option<Notice> {
    let path = file.points.landmarks.as_deref().unwrap_or(OPTIONAL_PATHS[0]);
    let given = landmarks.iter().any(|l| l.frame == PointFrame::Ct && l.name == "femoral_head_center");
    let what = "the femur's superior axis is found from its shape, which is rougher";
    (raw.files.contains_key(path) && !given).then(|| {
        Kind::NoFemoralHead.notice(format!("{path} gives no femoral_head_center in frame ct: {what}")).file(path)
    })
}

/// The marks; empty without a file.
pub(super) fn marks(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    options: &IngestOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Vec<NamedPoint>, StageError> {
    named_points(
        (raw, options.is_ras("points")),
        file.points.marks.as_deref().unwrap_or(OPTIONAL_PATHS[1]),
        "ligament",
        |name| {
            if LIGAMENTS.contains(&name) {
                Ok(())
            } else {
                let other = OTHER_NAMES.iter().find(|(other, _)| other.eq_ignore_ascii_case(name));
                let meant = other.map_or_else(
                    || did_you_mean(name, LIGAMENTS),
                    |(_, ours)| format!("; it is another name of {ours}"),
                );
                Err(format!("no ligament is called `{name}`{meant}; expected one of {}", LIGAMENTS.join(", ")))
            }
        },
        warnings,
    )
}

/// The fibres given by hand; empty without a file.
pub(super) fn fibres(
    file: &SpecimenFile,
    raw: &RawSpecimen,
    options: &IngestOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Vec<Fibre>, StageError> {
    let place = |p: Point| if options.is_ras("points") { turned(&p) } else { p };
    let path = file.points.attachments.as_deref().unwrap_or(OPTIONAL_PATHS[2]);
    let columns =
        ["bundle", "fibre", "femur_x_mm", "femur_y_mm", "femur_z_mm", "tibia_x_mm", "tibia_y_mm", "tibia_z_mm"];
    let mut fibres: Vec<Fibre> = Vec::new();
    for row in rows(raw, path, &columns, warnings)? {
        let bundle = row.cells[0].clone();
        if !BUNDLES.iter().any(|b| b.name == bundle) {
            let known: Vec<&str> = BUNDLES.iter().map(|b| b.name.as_str()).collect();
            return Err(row.refuse(&format!(
                "no bundle is called `{bundle}`{}; expected one of {}",
                did_you_mean(&bundle, known.iter().copied()),
                known.join(", ")
            )));
        }
        let fibre = match row.cells[1].parse::<usize>() {
            Ok(n) if (1..=1000).contains(&n) => n,
            _ => return Err(row.refuse(&format!("fibre is `{}`; expected a number from 1", row.cells[1]))),
        };
        if fibres.iter().any(|f| f.bundle == bundle && f.fibre == fibre) {
            return Err(row.refuse(&format!("fibre {fibre} of {bundle} stands twice")));
        }
        fibres.push(Fibre {
            bundle,
            fibre,
            femur: place(row.point(2, &columns)?),
            tibia: place(row.point(5, &columns)?),
            source: Source::Given,
        });
    }
    warnings.extend(copies(path, &fibres));
    Ok(fibres)
}

/// What is told of fibres of two bundles between the same two points: rows that were copied, and given another name.
fn copies(path: &str, fibres: &[Fibre]) -> Option<Notice> {
    let same = |a: &Fibre, b: &Fibre| a.bundle != b.bundle && a.femur == b.femur && a.tibia == b.tibia;
    let before = |k: usize| fibres[..k].iter().find(|f| same(f, &fibres[k]));
    let again: Vec<(&Fibre, &Fibre)> = fibres.iter().enumerate().filter_map(|(k, f)| Some((f, before(k)?))).collect();
    let (f, first) = again.first()?;
    let text = format!(
        "{path}: {} fibres stand at the same two points as one of another bundle, the first {} {} where {} {} is: were rows copied, and their points not changed? Each pulls by itself",
        again.len(),
        f.bundle,
        f.fibre,
        first.bundle,
        first.fibre
    );
    Some(Kind::FibreCount.notice(text).file(path).of(&f.bundle).count(again.len()))
}

/// Named points of a file; with `ras`, those of the CT frame are turned to LPS where the file cannot say its frame.
fn named_points(
    (raw, ras): (&RawSpecimen, bool),
    path: &str,
    name_column: &str,
    check: impl Fn(&str) -> Result<(), String>,
    warnings: &mut Vec<Notice>,
) -> Result<Vec<NamedPoint>, StageError> {
    let columns = [name_column, "frame", "x_mm", "y_mm", "z_mm"];
    let mut points: Vec<NamedPoint> = Vec::new();
    let own = raw.files.get(path).and_then(|bytes| slicer::read(path, bytes));
    // MeshLab's files cannot say their frame, those of 3D Slicer do
    let turns = own.is_none() && ras;
    let other = || raw.files.get(path).and_then(|bytes| picked::read(path, bytes));
    if let Some(read) = own.or_else(other) {
        for mut p in read? {
            if turns {
                p.point = turned(&p.point);
            }
            let refuse = |what: &str| Err(StageError::at(path, &p.place, what));
            if p.name.is_empty() {
                return refuse("the point has no label; expected its name there");
            }
            if let Err(e) = check(&p.name) {
                return refuse(&e);
            }
            if points.iter().any(|q| q.name == p.name) {
                return refuse(&format!("{} stands twice; keep one", p.name));
            }
            points.push(NamedPoint { name: p.name, frame: PointFrame::Ct, point: p.point });
        }
        return Ok(points);
    }
    for row in rows(raw, path, &columns, warnings)? {
        let name = row.cells[0].clone();
        if name.is_empty() {
            return Err(row.refuse(&format!("{name_column} is empty")));
        }
        check(&name).map_err(|e| row.refuse(&e))?;
        let frame = match row.cells[1].as_str() {
            "ct" => PointFrame::Ct,
            "scan_femur" => PointFrame::ScanFemur,
            "scan_tibfib" => PointFrame::ScanTibfib,
            other => return Err(row.refuse(&format!("frame is `{other}`; expected ct, scan_femur or scan_tibfib"))),
        };
        if points.iter().any(|p| p.name == name && p.frame == frame) {
            return Err(row.refuse(&format!("{name} stands twice in frame {}; keep one", row.cells[1])));
        }
        let point = row.point(2, &columns)?;
        let point = if ras && frame == PointFrame::Ct { turned(&point) } else { point };
        points.push(NamedPoint { name, frame, point });
    }
    Ok(points)
}

/// A row's cells in the order of the columns asked for.
struct Row<'a> {
    path: &'a str,
    line: u64,
    /// What stands between cells.
    separator: u8,
    cells: Vec<String>,
}

impl Row<'_> {
    fn refuse(&self, what: &str) -> StageError {
        StageError::line(self.path, self.line as usize, what)
    }

    fn point(&self, at: usize, columns: &[&str]) -> Result<Point, StageError> {
        let mut place = [0.0; 3];
        for (k, value) in place.iter_mut().enumerate() {
            let cell = &self.cells[at + k];
            // between other cells than commas, a comma in a number is its decimal point
            let plain = if self.separator == b',' { cell.clone() } else { cell.replace(',', ".") };
            *value = match plain.parse::<f64>() {
                Ok(x) if x.is_finite() => x,
                _ => {
                    let hint = if cell.contains(',') { "; write a decimal point, not a comma" } else { "" };
                    return Err(self.refuse(&format!("{} is `{cell}`; expected a number in mm{hint}", columns[at + k])));
                }
            };
        }
        Ok(Point::from(place))
    }
}

/// What stands between the cells of a header: commas, else semicolons, else tabs.
fn separator(text: &str) -> u8 {
    let header = text.lines().next().unwrap_or("");
    [b',', b';', b'\t'].into_iter().find(|c| header.contains(char::from(*c))).unwrap_or(b',')
}

/// What is said of a column in another unit than mm, as its name says.
fn in_unit(name: &str, columns: &[&str]) -> Option<String> {
    let (axis, unit) = name.rsplit_once('_')?;
    let factor = [("m", 1000.0), ("cm", 10.0), ("in", 25.4), ("um", 0.001)].into_iter().find(|(u, _)| *u == unit)?.1;
    let column = columns.iter().find(|c| c.strip_suffix("_mm") == Some(axis))?;
    Some(format!(": it is in {unit}, by its name; multiply it by {factor} and call it {column}"))
}

fn rows<'a>(
    raw: &RawSpecimen,
    path: &'a str,
    columns: &[&str],
    warnings: &mut Vec<Notice>,
) -> Result<Vec<Row<'a>>, StageError> {
    let Some(bytes) = raw.files.get(path) else { return Ok(Vec::new()) };
    let expected = columns.join(",");
    let known: Vec<String> = columns.iter().map(|c| (*c).to_owned()).collect();
    let table = sim::text::table(bytes, &known).map_err(|kind| {
        StageError::file(path, format_args!("{kind}; save the table as UTF-8 CSV with header {expected}"))
    })?;
    warnings.extend(table.notes.into_iter().map(|what| what.in_file(path)));
    let separator = table.separator.map_or_else(|| separator(&table.text), |c| c as u8);
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(table.text.as_bytes());
    let mut header = reader.headers().map_err(|e| StageError::file(path, e))?.clone();
    // some programs end each row with a separator
    let width = (0..header.len()).rfind(|&k| header.get(k).is_some_and(|h| !h.is_empty())).map_or(0, |k| k + 1);
    header.truncate(width);
    let refuse = |what: String| StageError::line(path, 1, format_args!("{what}; expected the header {expected}"));
    if header.len() == 1 && header.get(0).is_some_and(|h| h.contains(['|', ' '])) {
        return Err(refuse("the columns are not separated by commas".into()));
    }
    if let Some(unknown) = header.iter().find(|h| !columns.contains(h)) {
        let hint = in_unit(unknown, columns).unwrap_or_else(|| did_you_mean(unknown, columns.iter().copied()));
        return Err(refuse(format!("unknown column `{unknown}`{hint}")));
    }
    let mut place = Vec::new();
    for column in columns {
        place.push(header.iter().position(|h| h == *column).ok_or_else(|| refuse(format!("no column `{column}`")))?);
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| StageError::file(path, e))?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut row = Row { path, line, separator, cells: Vec::new() };
        let beyond = record.iter().skip(width).find(|cell| !cell.is_empty());
        if record.len() < width || beyond.is_some() {
            let cell = beyond.map_or(String::new(), |cell| format!(": `{cell}` stands beyond the last column"));
            return Err(row.refuse(&format!("{} cells; expected {width} ({expected}){cell}", record.len())));
        }
        row.cells = place.iter().map(|&k| record.get(k).unwrap_or("").to_string()).collect();
        rows.push(row);
    }
    Ok(rows)
}

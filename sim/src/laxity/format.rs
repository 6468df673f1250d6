//! Laxity files in a laboratory's own shape (FORMAT 2, `[laxity_format.NAME]`): separator, decimal comma, a row of units, other names,
//! units and signs.
//!
//! A file in another shape is turned into the standard one, cell by cell, before it is read.

use super::columns::{LaxityError, is_comment, is_output, known_columns};
use super::text;
use super::tracked::{Cells, Tracked, to_coordinates};
use super::units::{bracketed, standard_unit, unit, units_of};
use super::usual_tests::test_of;
use crate::coordinate::{ALL, Coordinate, FREE, Free, Load};
use crate::names::did_you_mean;
use csv::StringRecord;
use meshes::frame::Side;
use notices::{Kind, Notice};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

mod decimals;
mod lengths;

/// The shape of a laboratory's files. What is absent is found from the file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaxityFormat {
    /// Between cells: `,`, `;` or a tab.
    pub separator: Option<char>,
    /// Decimal sign: `.` or `,`.
    pub decimal: Option<char>,
    /// Lines above the header.
    pub skip_lines: usize,
    /// Whether a row of units stands below the header.
    pub units_row: Option<bool>,
    /// Where each standard column stands, in which unit and with which sign.
    pub columns: BTreeMap<String, Column>,
    /// Standard columns that are the same in every row.
    pub constants: BTreeMap<String, f64>,
    /// The laboratory's words for tests: `"ant drawer" = "anterior"`. Without a column of tests they are told from the loads.
    pub tests: BTreeMap<String, String>,
    /// The laboratory's words for branches: `up = "loading"`.
    pub branches: BTreeMap<String, String>,
    /// Whether branches are told from the load, in the order of the rows.
    pub branch_from_load: bool,
    /// On which bone the loads act; on the femur their signs turn round.
    pub loads_on: Bone,
    /// Flexions that trials are filed under [deg], where the file has no such column: the nearest is taken.
    pub nominal_flexions_deg: Vec<f64>,
    /// Poses of tracked bodies in place of coordinates, and what turns them into these.
    pub tracked: Option<Tracked>,
    /// Ligaments and bundles that were cut before all trials of the file, where its column `without` does not say so: a list, as ["ACL"].
    pub without: Vec<String>,
    /// What the readings are; with `difference` each loaded trial counts from the unloaded one of its flexion.
    pub readings: Readings,
}

/// What the readings of a file are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Readings {
    /// Poses of the tibia.
    #[default]
    Pose,
    /// Displacements from the unloaded pose at the same flexion.
    Difference,
}

/// A bone that loads act on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Bone {
    /// As the standard has it.
    #[default]
    Tibia,
    /// Their reaction.
    Femur,
}

/// A laboratory's column.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected a column's name, or { name = \"...\", unit = \"...\", positive = \"...\" }")]
pub enum Column {
    /// By its name; unit from the name's brackets or the row of units, else the standard one; the standard sign.
    Name(String),
    /// With more said of it.
    Full(FullColumn),
}

/// A column with its unit and sign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FullColumn {
    /// Its name in the file.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// What a positive value means: `valgus` or `varus`, `external` or `internal`, `lateral` or `medial`, `anterior` or `posterior`, `superior`,
    /// `inferior`, `compression` or `distraction`, `flexion` or `extension`; or `right` or `left`, towards which the tibia goes or its foot turns.
    pub positive: Option<String>,
}

impl Column {
    pub(super) fn name(&self) -> &str {
        match self {
            Column::Name(name) => name,
            Column::Full(full) => &full.name,
        }
    }
    fn unit(&self) -> Option<&str> {
        if let Column::Full(full) = self { full.unit.as_deref() } else { None }
    }
    fn positive(&self) -> Option<&str> {
        if let Column::Full(full) = self { full.positive.as_deref() } else { None }
    }
}

/// The factor that turns a column's sign round, or not.
fn sign(column: &str, positive: &str, side: Side) -> Result<f64, LaxityError> {
    let axis = column.trim_start_matches("load_").split('_').next().unwrap_or("");
    let words: [&str; 4] = match axis {
        "vv" => ["valgus", "varus", "", ""],
        "ie" => ["external", "internal", "", ""],
        "ml" => ["lateral", "medial", "", ""],
        "ap" => ["anterior", "posterior", "", ""],
        "si" => ["superior", "inferior", "compression", "distraction"],
        "fe" | "nominal" => ["flexion", "extension", "", ""],
        _ => {
            return Err(LaxityError::File(format!(
                "columns.{column}: positive stands only with loads and coordinates"
            )));
        }
    };
    let sideways = ["vv", "ie", "ml"].contains(&axis);
    match positive {
        p if p == words[0] || (p == words[2] && !p.is_empty()) => Ok(1.0),
        p if p == words[1] || (p == words[3] && !p.is_empty()) => Ok(-1.0),
        // A right knee's tibia goes right to go lateral, and its foot turns right in valgus and external rotation.
        "right" if sideways => Ok(if side == Side::Right { 1.0 } else { -1.0 }),
        "left" if sideways => Ok(if side == Side::Right { -1.0 } else { 1.0 }),
        other => {
            let known: Vec<&str> = words.into_iter().filter(|w| !w.is_empty()).collect();
            let more = if sideways { ", right or left" } else { "" };
            Err(LaxityError::File(format!(
                "columns.{column}: positive = \"{other}\"; expected {}{more}",
                known.join(", ")
            )))
        }
    }
}

/// A table in the standard columns; each row with its number in the file, the header being row 1.
pub(super) struct Standard {
    pub(super) header: StringRecord,
    pub(super) rows: Vec<(usize, StringRecord)>,
    /// The laboratory's name of a standard column, where it differs.
    pub(super) called: BTreeMap<String, String>,
    pub(super) warnings: Vec<Notice>,
}

/// The cells of a file as they stand.
struct Raw {
    header: Vec<String>,
    units: Vec<String>,
    rows: Vec<(usize, StringRecord)>,
    decimal_comma: bool,
}

/// Turns a file into the standard columns.
pub(super) fn standard(bytes: &[u8], format: &LaxityFormat, side: Side) -> Result<Standard, LaxityError> {
    let mut warnings = Vec::new();
    let mut raw = raw(bytes, format, &mut warnings)?;
    if let Some(tracked) = &format.tracked {
        let other = |c: &Coordinate| format.columns.get(&c.column()).is_some_and(|of| of.name() != c.column());
        if let Some(c) = ALL.into_iter().find(other) {
            return Err(LaxityError::File(format!("columns.{} and poses of bodies: leave one out", c.column())));
        }
        let Raw { header, units, rows, decimal_comma } = &mut raw;
        let mut cells = Cells { header, units, rows, decimal_comma: *decimal_comma };
        to_coordinates(&mut cells, tracked, side, &mut warnings)?;
    }
    let declared = *format != LaxityFormat::default();
    let places = places(&raw, format, declared, side, &mut warnings)?;
    let mut names: Vec<String> = places.iter().map(|p| p.column.clone()).collect();
    for column in format.constants.keys() {
        known(column, "constants")?;
        if names.contains(column) {
            return Err(LaxityError::File(format!("constants.{column}: the file has this column too; keep one")));
        }
        names.push(column.clone());
    }
    let called = places.iter().filter(|p| p.name != p.column).map(|p| (p.column.clone(), p.name.clone())).collect();
    let mut rows = Vec::new();
    for (number, record) in &raw.rows {
        let mut cells: Vec<String> = places.iter().map(|p| p.cell(record, raw.decimal_comma, format)).collect();
        cells.extend(format.constants.values().map(|v| v.to_string()));
        rows.push((*number, cells));
    }
    if declared {
        fill(&mut names, &mut rows, format)?;
    }
    let rows = rows.into_iter().map(|(n, cells)| (n, StringRecord::from(cells))).collect();
    Ok(Standard { header: StringRecord::from(names), rows, called, warnings })
}

/// Splits a file into cells.
fn raw(bytes: &[u8], format: &LaxityFormat, warnings: &mut Vec<Notice>) -> Result<Raw, LaxityError> {
    let declared: Vec<String> = format.columns.values().map(|c| c.name().trim().to_lowercase()).collect();
    let text = text::text(bytes, (format.skip_lines, &declared), warnings)?;
    let first = text.body.lines().next().unwrap_or_default();
    let count = |c: char| first.matches(c).count();
    let found = [';', '\t', ','].into_iter().max_by_key(|c| count(*c)).filter(|c| count(*c) > 0).unwrap_or(',');
    // a workbook's cells are parted already
    let separator = match text.separator.or(format.separator) {
        None => found as u8,
        Some(c @ (',' | ';' | '\t')) => c as u8,
        Some(c) => return Err(LaxityError::File(format!("separator = \"{c}\"; expected \",\", \";\" or \"\\t\""))),
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .trim(csv::Trim::All)
        .flexible(true)
        .from_reader(text.body.as_bytes());
    let header = reader.headers().map_err(|e| LaxityError::row(1, e.to_string()))?;
    let header: StringRecord = header.iter().map(text::visible).collect();
    if separator == b',' && format.decimal == Some(',') {
        return Err(LaxityError::File("separator and decimal are both a comma; save the table with semicolons".into()));
    }
    let mut rows = Vec::new();
    let mut blank = 0;
    for (i, record) in reader.records().enumerate() {
        let row = i + 2;
        let record = record.map_err(|e| LaxityError::row(row, e.to_string()))?;
        let visible: StringRecord = record.iter().map(text::visible).collect();
        let record: StringRecord = visible.iter().map(text::with_minus).collect();
        if is_header(&header, &record) {
            return Err(LaxityError::row(row, SECOND_HEADER.into()));
        }
        match record.iter().all(str::is_empty) {
            true => blank += 1,
            false => rows.push((row, record)),
        }
    }
    let mut rows = lengths::fitted(rows, &header, separator)?;
    if blank > 0 {
        warnings
            .push(Kind::BlankRows.notice(format!("{blank} rows without a single cell are passed over")).count(blank));
    }
    let is_units =
        |r: &StringRecord| r.iter().filter(|c| unit(c).is_some()).count() >= 3 && r.iter().all(|c| !number(c));
    let has_units = format.units_row.unwrap_or_else(|| rows.first().is_some_and(|(_, r)| is_units(r)));
    let units =
        if has_units && !rows.is_empty() { rows.remove(0).1.iter().map(String::from).collect() } else { vec![] };
    let numbers = numbers(&header, format);
    let decimal_comma = decimals::comma((&rows, &numbers), separator, format.decimal)?;
    // numbers of a workbook have points, whatever its texts have
    let is_text = !crate::workbook::looks_zipped(bytes);
    if decimal_comma
        && is_text
        && let Some(refused) = decimals::thousand(&rows, &numbers)
    {
        return Err(refused);
    }
    let mut raw = Raw { header: header.iter().map(String::from).collect(), units, rows, decimal_comma };
    drop_empty(&mut raw);
    drop_index(&mut raw, warnings);
    unmeasured(&mut raw, warnings);
    Ok(raw)
}

/// Standard columns of words.
const WORDS: [&str; 5] = ["trial", "reference", "test", "branch", "flags"];

/// Which columns have numbers that are read. Those of tracked bodies have names of their own, so that there any name may be one.
fn numbers(header: &StringRecord, format: &LaxityFormat) -> Vec<bool> {
    let standard = known_columns();
    let is_number = |name: &str| {
        let own = format.columns.iter().find(|(_, source)| is_called(name, source)).map(|(column, _)| column);
        match own.or_else(|| standard.get(name)) {
            Some(column) => !WORDS.contains(&column.as_str()),
            None => format.tracked.is_some() && !is_comment(name),
        }
    };
    header.iter().map(is_number).collect()
}

/// Cells of a row that are the header's own from which on it is a second header.
const LEAST_NAMES: usize = 3;
/// What is said of it.
const SECOND_HEADER: &str = "a second header: two tables stand one below the other; expected one header and a row a trial. Take this row out; where the trials below it are the same ones, take these out too";

/// Whether a row holds the names of the columns again.
fn is_header(header: &StringRecord, row: &StringRecord) -> bool {
    let same = |(name, cell): &(&str, &str)| !name.is_empty() && name.eq_ignore_ascii_case(cell);
    header.iter().zip(row.iter()).filter(same).count() >= LEAST_NAMES
}

/// Leaves out columns without a name and without a cell, as spreadsheets write them.
fn drop_empty(raw: &mut Raw) {
    let is_empty = |at: usize| raw.rows.iter().all(|(_, r)| r.get(at).is_none_or(str::is_empty));
    let has_unit = |at: usize| raw.units.get(at).is_some_and(|u| !u.is_empty());
    let keeps = |(at, name): (usize, &String)| !name.is_empty() || has_unit(at) || !is_empty(at);
    let kept: Vec<bool> = raw.header.iter().enumerate().map(keeps).collect();
    if raw.rows.is_empty() || kept.iter().all(|k| *k) {
        return;
    }
    let stays = |at: usize| kept.get(at).copied().unwrap_or(true);
    let of = |cells: &[String]| -> Vec<String> {
        cells.iter().enumerate().filter(|(at, _)| stays(*at)).map(|(_, cell)| cell.clone()).collect()
    };
    (raw.header, raw.units) = (of(&raw.header), of(&raw.units));
    for (_, record) in &mut raw.rows {
        *record = record.iter().enumerate().filter(|(at, _)| stays(*at)).map(|(_, cell)| cell).collect();
    }
}

/// Leaves out a first column that only counts the rows, as other programs write their index.
fn drop_index(raw: &mut Raw, warnings: &mut Vec<Notice>) {
    let Some(name) = raw.header.first() else { return };
    let nameless = name.is_empty() || name.starts_with("Unnamed") || name.eq_ignore_ascii_case("index");
    let cell = |r: &StringRecord| r.get(0).and_then(|c| c.parse::<usize>().ok());
    let from = raw.rows.first().and_then(|(_, r)| cell(r));
    let counts = |from: usize| raw.rows.iter().enumerate().all(|(k, (_, r))| cell(r) == Some(from + k));
    if !nameless || raw.header.len() < 2 || !from.is_some_and(counts) {
        return;
    }
    warnings.push(Kind::IndexColumn.notice("the first column counts the rows (an index) and is left out"));
    raw.header.remove(0);
    if !raw.units.is_empty() {
        raw.units.remove(0);
    }
    raw.rows.iter_mut().for_each(|(_, r)| *r = r.iter().skip(1).collect());
}

/// Empties the cells that say in words that nothing was measured.
fn unmeasured(raw: &mut Raw, warnings: &mut Vec<Notice>) {
    let mut words = 0;
    for (_, record) in &mut raw.rows {
        let found = record.iter().filter(|c| text::says_nothing(c)).count();
        if found > 0 {
            words += found;
            *record = record.iter().map(|c| if text::says_nothing(c) { "" } else { c }).collect();
        }
    }
    if words > 0 {
        let what = if words == 1 { "cell such as n/a or NaN is" } else { "cells such as n/a or NaN are" };
        warnings.push(Kind::WordsForNothing.notice(format!("{words} {what} read as not measured")).count(words));
    }
}

fn number(text: &str) -> bool {
    text.replace(',', ".").parse::<f64>().is_ok()
}

/// Where a standard column comes from.
struct Place {
    column: String,
    name: String,
    at: usize,
    factor: f64,
}

impl Place {
    /// The cell in the standard unit and sign, or in the standard words.
    fn cell(&self, record: &StringRecord, decimal_comma: bool, format: &LaxityFormat) -> String {
        let text = record.get(self.at).unwrap_or("");
        let word = |words: &BTreeMap<String, String>| {
            let same = |(theirs, ours): (&String, &String)| theirs.eq_ignore_ascii_case(text).then(|| ours.clone());
            words.iter().find_map(same).unwrap_or_else(|| text.to_lowercase())
        };
        match self.column.as_str() {
            "trial" | "reference" => text.to_owned(),
            "test" if *format != LaxityFormat::default() => word(&format.tests),
            "branch" if *format != LaxityFormat::default() => word(&format.branches),
            "test" | "branch" => text.to_owned(),
            _ => {
                let plain = if decimal_comma { text.replace(',', ".") } else { text.to_owned() };
                match plain.parse::<f64>() {
                    Ok(value) if self.factor != 1.0 => (value * self.factor).to_string(),
                    _ => plain,
                }
            }
        }
    }
}

fn known(column: &str, table: &str) -> Result<(), LaxityError> {
    let known = known_columns();
    if known.contains(column) {
        return Ok(());
    }
    Err(LaxityError::File(format!("{table}.{column} is no standard column{}", did_you_mean(column, &known))))
}

/// Whether a column's name in the file is the one declared, with its unit in brackets or without.
fn is_called(header: &str, source: &Column) -> bool {
    let name = source.name().trim();
    header.trim().eq_ignore_ascii_case(name) || bare(header).eq_ignore_ascii_case(name)
}

/// Where every standard column stands.
fn places(
    raw: &Raw,
    format: &LaxityFormat,
    declared: bool,
    side: Side,
    warnings: &mut Vec<Notice>,
) -> Result<Vec<Place>, LaxityError> {
    let mut used: BTreeSet<usize> = BTreeSet::new();
    let mut places = Vec::new();
    for (column, source) in &format.columns {
        known(column, "columns")?;
        let name = source.name();
        let Some(at) = raw.header.iter().position(|h| is_called(h, source)) else {
            let what = format!(
                "no column \"{name}\", which columns.{column} names{}; the file has {}",
                did_you_mean(name, &raw.header),
                raw.header.join(", ")
            );
            return Err(LaxityError::row(1, what));
        };
        used.insert(at);
        let mut factor = factor(column, source.unit(), raw, at)?;
        if let Some(positive) = source.positive() {
            factor *= sign(column, positive, side)?;
        }
        places.push(Place { column: column.clone(), name: raw.header[at].clone(), at, factor });
    }
    let standard = known_columns();
    let mut left = Vec::new();
    for (at, name) in raw.header.iter().enumerate().filter(|(at, _)| !used.contains(at)) {
        let force = is_output(name) || is_comment(name);
        if declared && !standard.contains(name) && !force || format.columns.contains_key(name) {
            left.push(name.as_str());
            continue;
        }
        let factor = if standard.contains(name) { same_unit(name, raw, at)? } else { 1.0 };
        places.push(Place { column: name.clone(), name: name.clone(), at, factor });
    }
    if !left.is_empty() {
        warnings.push(
            Kind::UnnamedColumns
                .notice(format!(
                    "columns that the format does not name are left out: {}{}",
                    left.join(", "),
                    super::headers::left_out(&left)
                ))
                .count(left.len()),
        );
    }
    for place in places.iter_mut().filter(|p| p.column.starts_with("sd_")) {
        place.factor = place.factor.abs();
    }
    if format.loads_on == Bone::Femur {
        places.iter_mut().filter(|p| p.column.starts_with("load_")).for_each(|p| p.factor = -p.factor);
    }
    Ok(places)
}

/// A column's name without the unit in its brackets.
fn bare(name: &str) -> &str {
    match bracketed(name).and(name.rfind(['[', '('])) {
        Some(open) => name[..open].trim(),
        None => name,
    }
}

/// The factor from a column's unit to the standard one.
fn factor(column: &str, told: Option<&str>, raw: &Raw, at: usize) -> Result<f64, LaxityError> {
    let Some(wanted) = standard_unit(column) else { return Ok(1.0) };
    let row = raw.units.get(at).map(String::as_str).filter(|u| !u.is_empty());
    let Some(text) = told.or(bracketed(&raw.header[at])).or(row) else { return Ok(1.0) };
    match unit(text) {
        Some((quantity, factor)) if quantity == wanted => Ok(factor),
        _ => Err(LaxityError::File(format!(
            "column \"{}\": unit \"{text}\"; expected one of {}",
            raw.header[at],
            units_of(wanted)
        ))),
    }
}

/// A standard column whose row of units says another unit is refused: one of the two is wrong.
fn same_unit(column: &str, raw: &Raw, at: usize) -> Result<f64, LaxityError> {
    let (Some(wanted), Some(row)) = (standard_unit(column), raw.units.get(at).filter(|u| !u.is_empty())) else {
        return Ok(1.0);
    };
    match unit(row) {
        Some((quantity, factor)) if quantity == wanted && (factor - 1.0).abs() < f64::EPSILON => Ok(1.0),
        _ => Err(LaxityError::cell(
            2,
            format!("\"{column}\""),
            format!(
                "the row of units says \"{row}\", the name says {wanted}; give the unit by columns.{column} = {{ name = \"{column}\", unit = \"{row}\" }}"
            ),
        )),
    }
}

/// Fills columns that a declared format may leave out: nominal flexion, test and trial.
fn fill(names: &mut Vec<String>, rows: &mut [(usize, Vec<String>)], format: &LaxityFormat) -> Result<(), LaxityError> {
    let place = |names: &[String], column: &str| names.iter().position(|n| n == column);
    let value = |cells: &[String], at: Option<usize>| at.and_then(|i| cells[i].parse::<f64>().ok());
    for column in FREE.map(Coordinate::load_column) {
        if place(names, &column).is_none() {
            names.push(column);
            rows.iter_mut().for_each(|(_, cells)| cells.push("0".into()));
        }
    }
    for column in FREE.map(Coordinate::column) {
        if place(names, &column).is_none() {
            names.push(column);
            rows.iter_mut().for_each(|(_, cells)| cells.push(String::new()));
        }
    }
    let fe = place(names, "fe_deg");
    if place(names, "nominal_flexion_deg").is_none() && !format.nominal_flexions_deg.is_empty() {
        names.push("nominal_flexion_deg".into());
        for (row, cells) in rows.iter_mut() {
            let Some(fe) = value(cells, fe) else {
                return Err(LaxityError::row(*row, "no flexion measured, so no nominal flexion can be taken".into()));
            };
            let near = |a: &&f64, b: &&f64| (*a - fe).abs().total_cmp(&(*b - fe).abs());
            cells.push(format.nominal_flexions_deg.iter().min_by(near).map_or(String::new(), f64::to_string));
        }
    }
    if place(names, "test").is_none() {
        let at = Free::from_fn(|c| place(names, &c.load_column()));
        names.push("test".into());
        for (_, cells) in rows.iter_mut() {
            let loads = Load::from_fn(|c| value(cells, at[c]).unwrap_or(0.0));
            cells.push(test_of(&loads).name().into());
        }
    }
    if place(names, "trial").is_none() {
        let (test, nominal) = (place(names, "test"), place(names, "nominal_flexion_deg"));
        names.push("trial".into());
        for (row, cells) in rows.iter_mut() {
            let of = |at: Option<usize>| at.map_or("", |i| cells[i].as_str());
            let name = format!("row{row}_{}_{}", of(test), of(nominal));
            cells.push(name);
        }
    }
    Ok(())
}

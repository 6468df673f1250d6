//! The reader: every complaint names the row and the column.

use super::columns::{
    AND, LaxityError, QUADRICEPS_COLUMN, WITHOUT_COLUMN, cut_cell, is_comment, is_output, known_columns,
    required_columns, sd_column,
};
use super::differences;
use super::format::{LaxityFormat, standard};
use super::text;
use super::{Branch, LaxityTrial, TESTS, Test};
use crate::coordinate::{AP, Coordinate, FREE, Free, IE, Load, VV};
use crate::names::did_you_mean;
use csv::StringRecord;
use meshes::frame::Side;
use notices::{Kind, Notice, plain};
use std::collections::{BTreeMap, BTreeSet};

mod beside;
mod branches;
mod failed;

/// The trials of a file and what is odd but not fatal in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LaxityTable {
    /// The trials, in the order of the file.
    pub trials: Vec<LaxityTrial>,
    /// Odd but not fatal, with row and column.
    pub warnings: Vec<Notice>,
}

/// Loads beyond these are taken for another unit.
const LARGEST_LOAD: Load = Load::new(150.0, 150.0, 2000.0, 2000.0, 5000.0);
/// Tension of the quadriceps beyond this is taken for another unit [N].
const LARGEST_QUADRICEPS_N: f64 = 10_000.0;
/// Flexion beyond this is taken for another unit [deg].
const MOST_FLEXION_DEG: f64 = 180.0;
/// Coordinates beyond these are taken for another unit or frame: VV, IE [deg], ML, AP, SI [mm].
const LARGEST_VALUE: Free<f64> = Free([90.0, 120.0, 150.0, 150.0, 300.0]);

/// Reads a laxity CSV in the standard columns (FORMAT 2). Semicolons, decimal commas and a row of units are recognised.
///
/// # Errors
/// An unknown, missing or doubled column, a row of another length, a cell that is no finite number, an unknown test or
/// branch, a doubled trial name, a value far outside what its unit allows. Row numbers count the header as row 1.
pub fn read(bytes: &[u8]) -> Result<LaxityTable, LaxityError> {
    read_as(bytes, &LaxityFormat::default(), Side::Right)
}

/// Flexion as it was measured and as it was meant. What a model is asked needs one of them.
const FLEXIONS: [&str; 2] = ["nominal_flexion_deg", "fe_deg"];

/// [`read`] for a model that is asked: columns of the pose may be absent, all together. One flexion stands for the other, in a file or in a row.
///
/// # Errors
/// As [`read`].
pub fn read_asked(bytes: &[u8]) -> Result<LaxityTable, LaxityError> {
    read_in(bytes, &LaxityFormat::default(), Side::Right, Poses::MayBeAbsent)
}

/// Reads a laxity file in a laboratory's shape; `side` turns signs that name right and left.
///
/// # Errors
/// As [`read`]; also where the file is not as `format` says.
pub fn read_as(bytes: &[u8], format: &LaxityFormat, side: Side) -> Result<LaxityTable, LaxityError> {
    read_in(bytes, format, side, Poses::Expected)
}

/// Whether a file must have the columns of the pose, and both of flexion.
#[derive(Clone, Copy, PartialEq)]
enum Poses {
    Expected,
    MayBeAbsent,
}

fn read_in(bytes: &[u8], format: &LaxityFormat, side: Side, poses: Poses) -> Result<LaxityTable, LaxityError> {
    let standard = standard(bytes, format, side)?;
    let first_cells = standard.rows.iter().filter_map(|(_, record)| record.get(0));
    if let Some(what) = super::headers::other_shape(&standard.header, first_cells) {
        return Err(LaxityError::File(what));
    }
    let columns = columns(&standard.header, poses)?;
    let mut table = LaxityTable { trials: vec![], warnings: standard.warnings };
    let (mut names, mut counted_from) = (BTreeSet::new(), Vec::new());
    for (k, (number, record)) in standard.rows.iter().enumerate() {
        let is_asked = poses == Poses::MayBeAbsent;
        let (number, is_first) = (*number, k == 0);
        let row = Row { number, is_first, is_asked, columns: &columns, record, called: &standard.called };
        let mut trial = trial(&row, &mut table.warnings)?;
        trial.without = without(&row, &format.without)?;
        let in_words = columns.keys().filter(|name| name.as_str() == "flags" || is_comment(name));
        table.warnings.extend(in_words.filter_map(|name| beside::excluded(number, name, row.text(name))));
        if !names.insert(trial.trial.clone()) {
            return row.refuse("trial", &format!("\"{}\" stands in an earlier row; names must differ", trial.trial));
        }
        table.trials.push(trial);
        counted_from.push(row.text("reference").to_owned());
    }
    if table.trials.is_empty() {
        return Err(LaxityError::File("no trial below the header; expected one row per measured trial".into()));
    }
    of_one_state(&table.trials)?;
    if format.branch_from_load {
        branches::branches(&mut table.trials);
    }
    differences::resolve(&mut table.trials, &counted_from, format.readings)?;
    table.warnings = merged(table.warnings, &table.trials);
    table.warnings.extend(beside::summaries(&table.trials));
    Ok(table)
}

/// Notices that differ in their row alone as one, which says of how many rows and where they are: one cause is one line.
fn merged(warnings: Vec<Notice>, trials: &[LaxityTrial]) -> Vec<Notice> {
    let mut groups: Vec<Vec<Notice>> = Vec::new();
    for w in warnings {
        let alike = |g: &&mut Vec<Notice>| {
            let first = &g[0];
            first.row.is_some() && w.row.is_some() && (first.kind, &first.column) == (w.kind, &w.column)
        };
        match groups.iter_mut().find(alike) {
            Some(group) => group.push(w),
            None => groups.push(vec![w]),
        }
    }
    let together = |group: Vec<Notice>| {
        let rows: BTreeSet<usize> = group.iter().filter_map(|w| w.row).collect();
        let count = group.len();
        let first = group.into_iter().next()?;
        if count == 1 {
            return Some(first);
        }
        let at = trials.iter().filter(|t| t.row.is_some_and(|r| rows.contains(&r)));
        let flexions: BTreeSet<i64> = at.map(|t| t.nominal_flexion_deg.round() as i64).collect();
        let all: BTreeSet<i64> = trials.iter().map(|t| t.nominal_flexion_deg.round() as i64).collect();
        let only = flexions.first().filter(|_| flexions.len() == 1 && all.len() > 1);
        let text = format!(
            "{} (and {} more rows alike, the last {}{})",
            first.text,
            count - 1,
            rows.last().copied().unwrap_or_default(),
            only.map_or(String::new(), |f| format!(", all at {f} deg"))
        );
        Some(Notice { text, ..first.count(count) })
    };
    groups.into_iter().filter_map(together).collect()
}

/// The columns that a file with this header must have.
fn required(header: &StringRecord, poses: Poses) -> Vec<String> {
    let mut required = required_columns();
    if poses == Poses::Expected {
        return required;
    }
    let of_the_pose = FREE.map(Coordinate::column);
    if !header.iter().any(|name| of_the_pose.contains(&name.to_owned())) {
        required.retain(|name| !of_the_pose.contains(name));
    }
    required.retain(|name| !FLEXIONS.contains(&name.as_str()));
    if !header.iter().any(|name| FLEXIONS.contains(&name)) {
        // no column has this name, so that it is told as missing
        required.push(FLEXIONS.join(" or "));
    }
    required
}

/// What is said of a column without a name.
const NAMELESS: &str =
    "the column has no name: name it, or leave it out (notes and row numbers of other programs are no part of a table)";

/// Column numbers by name; refuses what is unknown, missing or doubled.
fn columns(header: &StringRecord, poses: Poses) -> Result<BTreeMap<String, usize>, LaxityError> {
    let required = required(header, poses);
    let known = known_columns();
    let mut found = BTreeMap::new();
    for (i, name) in header.iter().enumerate() {
        if !known.contains(name) && !is_output(name) && !is_comment(name) {
            let what = match super::headers::declared(name, header.iter()) {
                _ if name.is_empty() => NAMELESS.to_owned(),
                Some(is) => format!("unknown column \"{name}\": {is}"),
                None => format!(
                    "unknown column \"{name}\"{}; expected one of {}. Other names are declared by [laxity_format.NAME.columns] in specimen.toml",
                    did_you_mean(name, &known),
                    known.iter().cloned().collect::<Vec<_>>().join(", ")
                ),
            };
            return Err(LaxityError::cell(1, (i + 1).to_string(), what));
        }
        if found.insert(name.to_owned(), i).is_some() {
            return Err(LaxityError::cell(1, (i + 1).to_string(), format!("\"{name}\" stands there twice")));
        }
    }
    match required.iter().filter(|c| !found.contains_key(*c)).cloned().collect::<Vec<_>>() {
        missing if missing.is_empty() => Ok(found),
        missing => Err(LaxityError::row(
            1,
            format!(
                "{}missing column {}; other names are declared by [laxity_format.NAME.columns] in specimen.toml",
                if found.is_empty() { "no column name stands there; " } else { "" },
                missing.join(", ")
            ),
        )),
    }
}

/// A row, its number in the file and the names of its cells.
struct Row<'a> {
    number: usize,
    /// Whether no trial stands above it.
    is_first: bool,
    /// Whether a model is asked, so that one flexion is enough.
    is_asked: bool,
    columns: &'a BTreeMap<String, usize>,
    record: &'a StringRecord,
    called: &'a BTreeMap<String, String>,
}

impl Row<'_> {
    /// The cell's text; empty where the column is not there.
    fn text(&self, column: &str) -> &str {
        self.columns.get(column).and_then(|&i| self.record.get(i)).unwrap_or("")
    }

    fn refuse<T>(&self, column: &str, what: &str) -> Result<T, LaxityError> {
        let theirs = self.called.get(column).map_or(String::new(), |name| format!(" (\"{name}\" in the file)"));
        Err(LaxityError::cell(self.number, format!("\"{column}\"{theirs}"), what.into()))
    }

    /// What an empty cell below a filled one is in a sheet; the row above had one, else it had been refused.
    fn if_merged(&self) -> &'static str {
        if self.is_first {
            ""
        } else {
            ". The row above has one: merged cells keep it in their first row alone; unmerge them and fill it down"
        }
    }

    /// A finite number; `None` for an empty cell.
    fn number(&self, column: &str) -> Result<Option<f64>, LaxityError> {
        match self.text(column) {
            "" => Ok(None),
            text => match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(Some(value)),
                _ => {
                    let why = match failed::is_error(text) {
                        true => "; a formula of the sheet failed: mend it, or leave the cell empty".to_owned(),
                        false => text::no_number(text),
                    };
                    self.refuse(column, &format!("\"{text}\" is not a finite number (decimal point, no unit){why}"))
                }
            },
        }
    }

    /// A number no larger than `largest`, else it is taken for another unit.
    fn bounded(&self, column: &str, largest: f64, unit: &str) -> Result<Option<f64>, LaxityError> {
        match self.number(column)? {
            Some(v) if v.abs() > largest && text::is_code(v) => {
                self.refuse(column, &format!("{} {unit} is a code for not measured; leave the cell empty", plain(v)))
            }
            Some(v) if v.abs() > largest => {
                self.refuse(column, &format!("{} {unit} is beyond {largest} {unit}; is it in another unit?", plain(v)))
            }
            value => Ok(value),
        }
    }
}

/// One trial from one row.
fn trial(row: &Row, warnings: &mut Vec<Notice>) -> Result<LaxityTrial, LaxityError> {
    let name = row.text("trial").to_owned();
    if name.is_empty() {
        return row.refuse("trial", "empty; every trial needs a name");
    }
    if failed::is_error(&name) {
        return row.refuse("trial", &format!("\"{name}\" is no name; a formula of the sheet failed: write the name"));
    }
    let test = test(row)?;
    let nominal = nominal(row)?;
    let mut load = Load::default();
    let (mut measured, mut sd) = (Free::all(None), Free::all(None));
    for c in FREE {
        let column = c.load_column();
        let unit = c.load_unit();
        load[c] = match row.bounded(&column, LARGEST_LOAD[c], unit)? {
            Some(value) => value,
            None => {
                warnings.push(
                    Kind::NoLoad
                        .notice(format!("row {}, column \"{column}\": no load measured, taken as 0 {unit}", row.number))
                        .row(row.number)
                        .column(&column),
                );
                0.0
            }
        };
        measured[c] = row.bounded(&c.column(), LARGEST_VALUE[c], c.unit())?;
        sd[c] = row.bounded(&sd_column(c), LARGEST_VALUE[c], c.unit())?;
        if sd[c].is_some_and(|v| v <= 0.0) {
            return row.refuse(&sd_column(c), "a standard deviation must be above 0; leave the cell empty if unknown");
        }
    }
    let fe_deg = flexion(row, nominal, warnings)?;
    if !agrees(test, &load) {
        warnings.push(Kind::LoadAgainstTest.notice(format!(
            "row {}: test \"{}\" but its load does not point that way; clinical signs expected (valgus, external, anterior +)",
            row.number,
            test.name()
        )).row(row.number));
    }
    let (branch, order) = (branch(row)?, order(row)?);
    Ok(LaxityTrial {
        row: Some(row.number),
        trial: name,
        test,
        nominal_flexion_deg: nominal,
        load,
        fe_deg,
        measured,
        sd,
        branch,
        order,
        time_s: row.number("time_s")?,
        quadriceps_n: quadriceps(row)?,
        without: vec![],
        reference: None,
    })
}

/// Tension of the quadriceps; 0 where none is given.
fn quadriceps(row: &Row) -> Result<f64, LaxityError> {
    match row.bounded(QUADRICEPS_COLUMN, LARGEST_QUADRICEPS_N, "N")? {
        Some(tension) if tension < 0.0 => {
            row.refuse(QUADRICEPS_COLUMN, &format!("{} N; a tension is 0 or above", plain(tension)))
        }
        tension => Ok(tension.unwrap_or(0.0)),
    }
}

/// What stands for a knee of which nothing was cut.
const WHOLE: [&str; 4] = ["intact", "none", "whole", "no"];

/// Ligaments and bundles that were cut, in order, each once: "ACL+ALS" is both. Without the column it is what specimen.toml has `declared`, and a column
/// must say the same.
fn without(row: &Row, declared: &[String]) -> Result<Vec<String>, LaxityError> {
    let text = row.text(WITHOUT_COLUMN);
    if text.contains(|c| ",;/&|".contains(c)) || text.split_whitespace().any(|word| word == "and") {
        return row.refuse(WITHOUT_COLUMN, &format!("\"{text}\": names are joined by {AND}, as ACL{AND}ALS"));
    }
    let in_order = |names: &mut dyn Iterator<Item = &str>| -> Vec<String> {
        let is_cut = |name: &&str| !name.is_empty() && WHOLE.iter().all(|whole| !name.eq_ignore_ascii_case(whole));
        let names: BTreeSet<&str> = names.map(str::trim).filter(is_cut).collect();
        names.into_iter().map(String::from).collect()
    };
    let own = in_order(&mut text.split(AND));
    if !own.is_empty() && own.len() < text.split(AND).map(str::trim).collect::<BTreeSet<_>>().len() {
        return row
            .refuse(WITHOUT_COLUMN, &format!("\"{text}\": a knee is whole or it is cut; expected names of ligaments"));
    }
    if declared.is_empty() {
        return Ok(own);
    }
    let names = in_order(&mut declared.iter().flat_map(|d| d.split(AND)));
    if row.columns.contains_key(WITHOUT_COLUMN) && own != names {
        let said = cut_cell(declared);
        let own = if text.is_empty() { "empty, as of a whole knee".to_owned() } else { format!("\"{text}\"") };
        return row.refuse(WITHOUT_COLUMN, &format!("{own}, but specimen.toml declares without = {said}"));
    }
    Ok(names)
}

/// A file is of one state of the knee: frames, noise and conditions are those of a data set.
fn of_one_state(trials: &[LaxityTrial]) -> Result<(), LaxityError> {
    let Some(other) = trials.iter().find(|t| t.without != trials[0].without) else { return Ok(()) };
    let told = |t: &LaxityTrial| if t.without.is_empty() { "empty".into() } else { cut_cell(&t.without) };
    let what = format!(
        "{} where row {} has {}: a file is of one state of the knee; write a file of each, with a name of its own",
        told(other),
        trials[0].row.unwrap_or(0),
        told(&trials[0])
    );
    Err(LaxityError::trial(other, Some(WITHOUT_COLUMN), what))
}

fn test(row: &Row) -> Result<Test, LaxityError> {
    let text = row.text("test");
    if text.is_empty() && beside::is_summary(row.text("trial")) {
        return row.refuse("test", "empty, and the row sums up others by its name: leave it out of the table");
    }
    if text.is_empty() {
        return row.refuse("test", &format!("empty; expected the name of a test{}", row.if_merged()));
    }
    match TESTS.iter().find(|(_, name)| *name == text) {
        Some((test, _)) => Ok(*test),
        None => row.refuse(
            "test",
            &format!(
                "unknown test \"{text}\"{}; expected one of {}. Other words are declared by tests = {{ \"{text}\" = \"...\" }} below [laxity_format.NAME] in specimen.toml",
                did_you_mean(text, TESTS.map(|(_, name)| name)),
                TESTS.map(|(_, name)| name).join(", ")
            ),
        ),
    }
}

fn branch(row: &Row) -> Result<Option<Branch>, LaxityError> {
    match row.text("branch") {
        "" => Ok(None),
        "loading" => Ok(Some(Branch::Loading)),
        "unloading" => Ok(Some(Branch::Unloading)),
        text => row.refuse("branch", &format!("\"{text}\"; expected loading, unloading or nothing")),
    }
}

fn order(row: &Row) -> Result<Option<i64>, LaxityError> {
    match row.text("order") {
        "" => Ok(None),
        text => match text.parse().ok().or_else(|| whole(text)) {
            Some(value) => Ok(Some(value)),
            None => row.refuse("order", &format!("\"{text}\" is not a whole number")),
        },
    }
}

/// Whole numbers beyond this have lost digits as fractions.
const MOST_WHOLE: f64 = 9e15;

/// A whole number that is written as a fraction, as programs do whose column has gaps: 3.0.
fn whole(text: &str) -> Option<i64> {
    text.parse::<f64>().ok().filter(|x| x.fract() == 0.0 && x.abs() < MOST_WHOLE).map(|x| x as i64)
}

/// Flexion as it was meant; where a model is asked and it is not given, the other one.
fn nominal(row: &Row) -> Result<f64, LaxityError> {
    let asked = if row.is_asked { &FLEXIONS[..] } else { &FLEXIONS[..1] };
    for column in asked {
        if let Some(value) = row.bounded(column, MOST_FLEXION_DEG, "deg")? {
            return Ok(value);
        }
    }
    // of a column that the file has
    let own: Vec<&str> = asked.iter().copied().filter(|column| row.columns.contains_key(*column)).collect();
    let both = if own.len() > 1 { format!(", as \"{}\" is", own[1]) } else { String::new() };
    row.refuse(own.first().unwrap_or(&FLEXIONS[0]), &format!("empty{both}; expected degrees{}", row.if_merged()))
}

/// The prescribed flexion: as measured, else nominal with a warning; without one where no column is for it.
fn flexion(row: &Row, nominal: f64, warnings: &mut Vec<Notice>) -> Result<f64, LaxityError> {
    if !row.columns.contains_key("fe_deg") {
        return Ok(nominal);
    }
    let Some(fe) = row.bounded("fe_deg", MOST_FLEXION_DEG, "deg")? else {
        warnings.push(
            Kind::NoFlexion
                .notice(format!(
                    "row {}, column \"fe_deg\": not measured, nominal {} deg taken",
                    row.number,
                    plain(nominal)
                ))
                .row(row.number)
                .column("fe_deg"),
        );
        return Ok(nominal);
    };
    if nominal.abs() >= 20.0 && (fe - nominal.to_radians()).abs() < 0.2 {
        return row.refuse(
            "fe_deg",
            &format!("{} beside nominal {} deg looks like radians; degrees expected", plain(fe), plain(nominal)),
        );
    }
    if (fe - nominal).abs() > 30.0 {
        warnings.push(
            Kind::FlexionFarFromNominal
                .notice(format!(
                    "row {}, column \"fe_deg\": {} deg is far from nominal {} deg",
                    row.number,
                    plain(fe),
                    plain(nominal)
                ))
                .row(row.number)
                .column("fe_deg"),
        );
    }
    Ok(fe)
}

/// Whether the load of a test points where the test's name says, or is next to nothing.
pub(super) fn agrees(test: Test, load: &Load) -> bool {
    let along = match test {
        Test::Anterior => load[AP] / 10.0,
        Test::Posterior => -load[AP] / 10.0,
        Test::Internal => -load[IE],
        Test::External => load[IE],
        Test::Varus => -load[VV],
        Test::Valgus => load[VV],
        Test::Neutral => 0.0,
    };
    along > -0.5
}

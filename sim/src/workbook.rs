//! Workbooks of Excel (.xlsx) as tables of text: shared strings, dates by their format, cached values of formulas [ecma2021].
//!
//! What a part unpacks to is limited, and no size that a file claims is believed.

mod parts;

use crate::xml::{Tag, Tags, plain};
use notices::{Kind, Notice};
use parts::Parts;
use std::collections::BTreeMap;

/// Most columns of a table; a cell beyond is none of a table.
const MOST_COLUMNS: usize = 1000;
/// Most cells of a sheet.
const MOST_CELLS: usize = 4_000_000;
/// Empty rows between two rows that are kept, so that rows keep their numbers; of more, none is.
const MOST_EMPTY: usize = 1000;
/// Rows from the top in which a header may stand.
const HEAD: usize = 50;
/// Cells of a row that are known names, from which on it is a header.
const LEAST_NAMES: usize = 3;
/// Formats of numbers that are dates without saying so in their own words.
const DATES: [std::ops::RangeInclusive<u32>; 2] = [14..=22, 45..=47];
/// Days from Excel's day 0 to 1 March of the year 0, from which civil dates are counted [d].
const DAY_ZERO: i64 = 693_899;
/// Days between Excel's two calendars, from 1900 and from 1904 [d].
const CALENDARS: f64 = 1462.0;

/// Whether the bytes are a zip archive, as a workbook is.
pub(crate) fn looks_zipped(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// A sheet as text: rows of cells between semicolons, and what is told of it.
pub(crate) struct Sheet {
    pub(crate) text: String,
    pub(crate) notes: Vec<Notice>,
}

/// Cells by row and column, from 0.
type Cells = BTreeMap<(usize, usize), String>;

/// The sheet of a workbook that has names of `known` (in lower case) in its header; of several the first, which is told; else the first of all.
///
/// # Errors
/// An archive that is no workbook; a damaged part; a formula without its value.
pub(crate) fn sheet(bytes: &[u8], known: &[String]) -> Result<Sheet, String> {
    let parts = Parts::of(bytes)?;
    if !parts.has("xl/workbook.xml") {
        return Err(match parts.has("content.xml") {
            true => "the file is an OpenDocument sheet (.ods)".into(),
            false => "the file is a zip archive and no Excel workbook (.xlsx)".into(),
        });
    }
    let book = Book::of(&parts)?;
    let mut sheets = Vec::new();
    for (name, path) in &book.sheets {
        if !parts.has(path) {
            continue;
        }
        let read = book.cells(&parts.text(path)?)?;
        sheets.push((name, read));
    }
    let count = sheets.len();
    let fits = |read: &Read| header(&read.cells, known).is_some();
    let fitting: Vec<usize> = (0..count).filter(|k| fits(&sheets[*k].1)).collect();
    let at = fitting.first().copied().unwrap_or(0);
    let mut notes = Vec::new();
    if count == 0 {
        return Err("the workbook has no sheet".into());
    }
    let (name, read) = sheets.swap_remove(at);
    if count > 1 {
        let more =
            if fitting.len() > 1 { format!(", the first of {} such tables", fitting.len()) } else { String::new() };
        notes.push(Kind::SheetChosen.notice(format!("of {count} sheets, \"{name}\" is read{more}")));
    }
    if let Some((row, column)) = read.valueless {
        return Err(format!(
            "sheet \"{name}\", cell {}{}: a formula without its value; open the workbook in Excel or LibreOffice and save it, so that values are kept",
            letters(column),
            row + 1
        ));
    }
    let header = header(&read.cells, known);
    if let Some((cells, _)) = read.merged.iter().find(|(_, last)| header.is_some_and(|h| *last > h)) {
        return Err(format!(
            "sheet \"{name}\", cells {cells}: merged over several rows, so that all but the first are empty; unmerge them and write the value into each"
        ));
    }
    if read.hidden > 0 {
        notes.push(
            Kind::HiddenRows
                .notice(format!("sheet \"{name}\": {} rows that Excel hides are read", read.hidden))
                .count(read.hidden),
        );
    }
    Ok(Sheet { text: text(&read.cells), notes })
}

/// The cells that a merged range calls, and its last row, where it has several.
fn several_rows(tag: &Tag) -> Option<(String, usize)> {
    let range = tag.attribute("ref")?;
    let (from, to) = range.split_once(':')?;
    let (first, last) = (place_of(from)?.0, place_of(to)?.0);
    (last > first).then(|| (range.to_string(), last))
}

/// The first of the rows that holds names that are known.
fn header(cells: &Cells, known: &[String]) -> Option<usize> {
    let mut names = [0; HEAD];
    for ((row, _), cell) in cells.range(..(HEAD, 0)) {
        names[*row] += usize::from(known.contains(&cell.trim().to_lowercase()));
    }
    names.iter().position(|n| *n >= LEAST_NAMES)
}

/// The cells as lines of text, each of the same number of cells.
fn text(cells: &Cells) -> String {
    let width = cells.keys().map(|(_, column)| column + 1).max().unwrap_or(0);
    let mut rows: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
    for ((row, column), cell) in cells {
        rows.entry(*row).or_insert_with(|| vec![""; width])[*column] = cell;
    }
    let empty = ";".repeat(width.saturating_sub(1)) + "\n";
    let (mut out, mut next) = (String::new(), 0);
    for (row, cells) in rows {
        let gap = row - next;
        if gap <= MOST_EMPTY && next > 0 {
            out += &empty.repeat(gap);
        }
        let cells: Vec<String> = cells.into_iter().map(quoted).collect();
        out += &(cells.join(";") + "\n");
        next = row + 1;
    }
    out
}

/// A cell that may hold separators, in quotes, on one line.
fn quoted(cell: &str) -> String {
    let cell = cell.replace(['\n', '\r'], " ");
    match cell.contains([';', '"']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    }
}

/// The letters of a column, from 0.
fn letters(column: usize) -> String {
    let mut out = String::new();
    let mut left = column + 1;
    while left > 0 {
        out.insert(0, char::from(b'A' + ((left - 1) % 26) as u8));
        left = (left - 1) / 26;
    }
    out
}

/// What holds for all sheets.
struct Book {
    /// Names and paths, in the order of the tabs; hidden ones last.
    sheets: Vec<(String, String)>,
    strings: Vec<String>,
    /// By style: whether numbers are dates.
    dates: Vec<bool>,
    from_1904: bool,
}

/// The cells of a sheet, and the first formula without a value.
struct Read {
    cells: Cells,
    valueless: Option<(usize, usize)>,
    /// Cells that stand for several rows: as they are called, and their last row.
    merged: Vec<(String, usize)>,
    /// Rows with cells that Excel does not show.
    hidden: usize,
}

impl Book {
    fn of(parts: &Parts) -> Result<Book, String> {
        let optional = |path: &str| if parts.has(path) { parts.text(path) } else { Ok(String::new()) };
        let workbook = parts.text("xl/workbook.xml")?;
        let relations = optional("xl/_rels/workbook.xml.rels")?;
        let targets: BTreeMap<String, String> = Tags::of(&relations)
            .filter(|t| t.name == "Relationship")
            .filter_map(|t| Some((t.attribute("Id")?, t.attribute("Target")?)))
            .collect();
        let (mut shown, mut hidden, mut from_1904) = (Vec::new(), Vec::new(), false);
        for tag in Tags::of(&workbook) {
            match tag.name {
                "workbookPr" => from_1904 = tag.attribute("date1904").is_some_and(|v| v == "1" || v == "true"),
                "sheet" => {
                    let target = tag.attribute("id").and_then(|id| targets.get(&id).cloned()).unwrap_or_default();
                    let path = target.strip_prefix('/').map_or(format!("xl/{target}"), str::to_owned);
                    let list = if tag.attribute("state").is_some() { &mut hidden } else { &mut shown };
                    list.push((tag.attribute("name").unwrap_or_default(), path));
                }
                _ => {}
            }
        }
        shown.extend(hidden);
        let strings = strings(&optional("xl/sharedStrings.xml")?);
        Ok(Book { sheets: shown, strings, dates: dates(&optional("xl/styles.xml")?), from_1904 })
    }

    /// The cells of a sheet that hold anything.
    fn cells(&self, sheet: &str) -> Result<Read, String> {
        let mut read = Read { cells: Cells::new(), valueless: None, merged: Vec::new(), hidden: 0 };
        let (mut row, mut column) = (0usize, 0usize);
        let mut tags = Tags::of(sheet);
        let mut rows = 0usize;
        while let Some(tag) = tags.next() {
            match tag.name {
                "row" if !tag.closing => {
                    row =
                        tag.attribute("r").and_then(|r| r.parse::<usize>().ok()).unwrap_or(rows + 1).saturating_sub(1);
                    (rows, column) = (row + 1, 0);
                    read.hidden += usize::from(tag.attribute("hidden").is_some_and(|h| h == "1" || h == "true"));
                }
                "mergeCell" if !tag.closing => read.merged.extend(several_rows(&tag)),
                "c" if !tag.closing => {
                    if let Some((r, c)) = tag.attribute("r").and_then(|place| place_of(&place)) {
                        (row, column) = (r, c);
                    }
                    let (value, formula) = if tag.empty { (None, false) } else { self.value(&tag, &mut tags) };
                    match value.filter(|v| !v.trim().is_empty()) {
                        Some(_) if column >= MOST_COLUMNS => {
                            return Err(format!(
                                "a cell in column {}; expected a table of at most {MOST_COLUMNS} columns",
                                column + 1
                            ));
                        }
                        Some(value) => _ = read.cells.insert((row, column), value),
                        None if formula => _ = read.valueless.get_or_insert((row, column)),
                        None => {}
                    }
                    if read.cells.len() > MOST_CELLS {
                        return Err(format!(
                            "more than {MOST_CELLS} cells in a sheet; give a table of the trials alone"
                        ));
                    }
                    column += 1;
                }
                _ => {}
            }
        }
        Ok(read)
    }

    /// The value of a cell, to its end; and whether a formula stands in it.
    fn value(&self, cell: &Tag, tags: &mut Tags) -> (Option<String>, bool) {
        let kind = cell.attribute("t").unwrap_or_default();
        let (mut value, mut own, mut formula) = (None, String::new(), false);
        for tag in tags.by_ref() {
            match (tag.name, tag.closing) {
                ("c", true) => break,
                ("f", false) => formula = true,
                ("v", false) if !tag.empty => value = Some(plain(tag.text)),
                ("t", false) if !tag.empty => own += &plain(tag.text),
                _ => {}
            }
        }
        let value = match (kind.as_str(), value) {
            ("inlineStr", _) => Some(own),
            ("s", Some(v)) => v.trim().parse::<usize>().ok().and_then(|k| self.strings.get(k)).cloned(),
            ("b", Some(v)) => Some(if v.trim() == "1" { "true".into() } else { "false".into() }),
            ("" | "n", Some(v)) if self.is_date(cell) => {
                Some(v.trim().parse().map_or(v, |day| date(day, self.from_1904)))
            }
            (_, value) => value,
        };
        (value, formula)
    }

    fn is_date(&self, cell: &Tag) -> bool {
        let style = cell.attribute("s").and_then(|s| s.parse::<usize>().ok());
        style.and_then(|s| self.dates.get(s)).copied().unwrap_or(false)
    }
}

/// Row and column, from 0, of a cell such as B12.
fn place_of(place: &str) -> Option<(usize, usize)> {
    let digits = place.find(|c: char| c.is_ascii_digit())?;
    let (name, row) = place.split_at(digits);
    let valid = !name.is_empty() && name.len() <= 3 && name.bytes().all(|b| b.is_ascii_uppercase());
    let column = name.bytes().filter(u8::is_ascii_uppercase).fold(0, |n, b| n * 26 + usize::from(b - b'A' + 1));
    let row = row.parse::<usize>().ok().filter(|r| (1..=1 << 20).contains(r))?;
    valid.then(|| (row - 1, column - 1))
}

/// Strings that cells share: of each the text of its runs, without how it is pronounced.
fn strings(xml: &str) -> Vec<String> {
    let (mut all, mut spoken) = (Vec::new(), false);
    for tag in Tags::of(xml) {
        match (tag.name, tag.closing) {
            ("si", false) => all.push(String::new()),
            ("rPh", closing) => spoken = !closing && !tag.empty,
            ("t", false) if !spoken && !tag.empty => {
                if let Some(last) = all.last_mut() {
                    *last += &plain(tag.text);
                }
            }
            _ => {}
        }
    }
    all
}

/// Which styles of cells show dates.
fn dates(xml: &str) -> Vec<bool> {
    let (mut own, mut styles, mut within) = (BTreeMap::new(), Vec::new(), false);
    for tag in Tags::of(xml) {
        match tag.name {
            "numFmt" => {
                if let (Some(Ok(id)), Some(code)) =
                    (tag.attribute("numFmtId").map(|i| i.parse::<u32>()), tag.attribute("formatCode"))
                {
                    own.insert(id, is_date_format(&code));
                }
            }
            "cellXfs" => within = !tag.closing,
            "xf" if within && !tag.closing => {
                let id = tag.attribute("numFmtId").and_then(|i| i.parse::<u32>().ok()).unwrap_or(0);
                styles.push(own.get(&id).copied().unwrap_or_else(|| DATES.iter().any(|range| range.contains(&id))));
            }
            _ => {}
        }
    }
    styles
}

/// Whether a format's own words, outside of quotes and brackets, show days or hours.
fn is_date_format(code: &str) -> bool {
    let (mut quoted, mut bracketed, mut escaped) = (false, false, false);
    for c in code.chars() {
        match c {
            _ if escaped => escaped = false,
            '\\' | '_' | '*' => escaped = true,
            '"' => quoted = !quoted,
            '[' if !quoted => bracketed = true,
            ']' if !quoted => bracketed = false,
            'd' | 'D' | 'y' | 'Y' | 'h' | 'H' | 'm' | 'M' if !quoted && !bracketed => return true,
            _ => {}
        }
    }
    false
}

/// A day of Excel's as a date; a number that is none stays.
fn date(day: f64, from_1904: bool) -> String {
    let days = if from_1904 { day + CALENDARS } else { day };
    if !(0.0..3.0e6).contains(&days) {
        return day.to_string();
    }
    // civil date from days since 1 March of the year 0 [hinnant2014]
    let z = days.floor() as i64 + DAY_ZERO;
    let (era, of_era) = (z.div_euclid(146_097), z.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let (d, m) = (of_year - (153 * month + 2) / 5 + 1, if month < 10 { month + 3 } else { month - 9 });
    let y = year + era * 400 + i64::from(m <= 2);
    let seconds = ((days - days.floor()) * 86_400.0).round() as i64;
    match seconds {
        0 => format!("{y:04}-{m:02}-{d:02}"),
        s => format!("{y:04}-{m:02}-{d:02} {:02}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_letters_and_days_are_excels() {
        for (place, wanted) in [("A1", (0, 0)), ("Z3", (2, 25)), ("AA10", (9, 26)), ("XFD1", (0, 16_383))] {
            assert_eq!(place_of(place), Some(wanted));
            assert_eq!(format!("{}{}", letters(wanted.1), wanted.0 + 1), place);
        }
        assert_eq!(place_of("A0"), None);
        assert_eq!(place_of("1A"), None);
        for (day, wanted) in [(61.0, "1900-03-01"), (43_831.0, "2020-01-01"), (45_351.5, "2024-02-29 12:00:00")] {
            assert_eq!(date(day, false), wanted);
        }
        assert_eq!(date(42_369.0, true), "2020-01-01");
        for (code, wanted) in
            [("0.00", false), ("yyyy-mm-dd", true), ("0.0\" deg\"", false), ("[Red]0", false), ("h:mm", true)]
        {
            assert_eq!(is_date_format(code), wanted, "{code}");
        }
    }
}

//! From the bytes of a table to its text: what programs put around a table is taken off, and told.

use super::columns::{LaxityError, known_columns};
use notices::{Kind, Notice};
use std::borrow::Cow;

mod robot;
mod tdms;
#[cfg(test)]
mod tests;

/// Lines above the header that may be titles or comments.
const MOST_TITLES: usize = 50;
/// Cells of a line that are names of columns, from which on it is the header.
const LEAST_NAMES: usize = 3;

/// A table's text.
pub(super) struct Text<'a> {
    /// The text, from the header on.
    pub(super) body: Cow<'a, str>,
    /// The separator that the file states (`sep=;`).
    pub(super) separator: Option<char>,
}

/// The text of a table, of which so many lines are skipped; `declared` are names of columns beside the standard ones, in lower case.
///
/// # Errors
/// Another kind of file, by its name.
pub(super) fn text<'a>(
    bytes: &'a [u8],
    (skip_lines, declared): (usize, &[String]),
    warnings: &mut Vec<Notice>,
) -> Result<Text<'a>, LaxityError> {
    if tdms::is_tdms(bytes) {
        let body = robot::table(bytes, declared, warnings)?;
        return Ok(Text { body: Cow::Owned(body), separator: Some('\t') });
    }
    let mut known: Vec<String> = known_columns().into_iter().collect();
    known.extend(declared.iter().cloned());
    let table = crate::text::table(bytes, &known).map_err(|kind| {
        LaxityError::File(format!(
            "{kind}; expected a table: an Excel workbook (.xlsx), or the sheet saved as CSV UTF-8"
        ))
    })?;
    warnings.extend(table.notes);
    let (whole, mut separator) = (table.text, table.separator);
    let mut above = skip_lines;
    let mut start = lines(&whole, above)
        .ok_or_else(|| LaxityError::File(format!("skip_lines = {skip_lines}, but the file has fewer lines")))?;
    let first = whole[start..].lines().next().unwrap_or_default().trim().trim_matches('"');
    if let Some(rest) = first.to_ascii_lowercase().strip_prefix("sep=") {
        separator = first.chars().nth(4).filter(|_| !rest.is_empty());
        above += 1;
        start = lines(&whole, above).unwrap_or(whole.len());
    }
    let titles = titles(&whole[start..], &known);
    if titles > 0 {
        warnings.push(
            Kind::TitleLines
                .notice(format!("{titles} lines above the header are passed over (titles or comments)"))
                .count(titles),
        );
        start = lines(&whole, above + titles).unwrap_or(whole.len());
    }
    let body = match whole {
        Cow::Borrowed(text) => Cow::Borrowed(&text[start..]),
        Cow::Owned(text) => Cow::Owned(text[start..].to_owned()),
    };
    Ok(Text { body, separator })
}

/// Where a line begins.
fn lines(text: &str, count: usize) -> Option<usize> {
    match count {
        0 => Some(0),
        n => text.bytes().enumerate().filter(|(_, b)| *b == b'\n').nth(n - 1).map(|(at, _)| at + 1),
    }
}

/// How many lines stand above the header: the first line that names three columns or more; none where no line does.
fn titles(text: &str, known: &[String]) -> usize {
    let names = |line: &str| {
        let cells = line.split([',', ';', '\t']).map(|c| c.trim().trim_matches('"').trim().to_lowercase());
        cells.filter(|c| known.contains(c)).count()
    };
    text.lines().take(MOST_TITLES).position(|line| names(line) >= LEAST_NAMES).unwrap_or(0)
}

/// A cell without the letters that nobody sees: zero-width spaces and joiners, and marks of byte order, as web pages and chats put in.
pub(super) fn visible(cell: &str) -> Cow<'_, str> {
    let unseen = |c: char| matches!(c, '\u{200b}'..='\u{200d}' | '\u{2060}' | '\u{feff}');
    match cell.contains(unseen) {
        true => Cow::Owned(cell.replace(unseen, "").trim().to_owned()),
        false => Cow::Borrowed(cell),
    }
}

/// A number with the sign that typesetting sets for minus: the hyphen, as numbers are read. Other cells stay as they are.
pub(super) fn with_minus(cell: &str) -> Cow<'_, str> {
    let rest = cell.strip_prefix(['\u{2212}', '\u{2013}', '\u{fe63}', '\u{ff0d}']).map(str::trim_start);
    let number = |rest: &&str| rest.starts_with(|c: char| c.is_ascii_digit() || c == '.' || c == ',');
    rest.filter(number).map_or(Cow::Borrowed(cell), |rest| Cow::Owned(format!("-{rest}")))
}

/// Whether a cell says that nothing was measured, in the words of other programs.
pub(super) fn says_nothing(cell: &str) -> bool {
    [
        "n/a", "na", "nan", "#n/a", "null", "none", "-", "--", "\u{2212}", "\u{2013}", "\u{2014}", "nil", "<na>",
        "missing",
    ]
    .contains(&cell.trim().to_ascii_lowercase().as_str())
}

/// Whether commas in the cells are decimal: told where both readings are possible.
///
/// # Errors
/// Numbers with a comma before three digits that may be thousands.
pub(super) fn decimal_comma<'a>(cells: impl Iterator<Item = &'a str>) -> Result<bool, LaxityError> {
    let (mut sure, mut thousands, mut points) = (false, None, false);
    for cell in cells {
        let cell = cell.trim();
        if !cell.chars().all(|c| c.is_ascii_digit() || "+-.,eE".contains(c))
            || !cell.contains(|c: char| c.is_ascii_digit())
        {
            continue;
        }
        points |= cell.contains('.');
        if let Some((before, after)) = cell.trim_start_matches(['+', '-']).split_once(',') {
            let grouped = after.split([',', '.']).next().is_some_and(|d| d.len() == 3);
            let long = before.is_empty() || before.starts_with('0') || before.len() > 3;
            match grouped && !long || cell.matches(',').count() > 1 {
                true => thousands = thousands.or(Some(cell)),
                false => sure = true,
            }
        }
    }
    match thousands {
        Some(cell) if points || !sure => Err(LaxityError::File(format!(
            "\"{cell}\" may be a thousand with a separator or a number with a decimal comma; write thousands without a separator, or declare decimal = \",\" (or \".\") in [laxity_format.NAME]"
        ))),
        _ => Ok(true),
    }
}

/// Numbers that instruments and spreadsheets write where nothing was measured.
const CODES: [f64; 6] = [99.0, 99.9, 99.99, 999.0, 9999.0, 99999.0];

/// Whether a number is a code for a missing one: of nines alone.
pub(super) fn is_code(x: f64) -> bool {
    CODES.contains(&x.abs())
}

/// Why a cell is no number, where that shows.
pub(super) fn no_number(cell: &str) -> String {
    let starts = |t: &str| t.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
    let number = |t: &str| t.trim().parse::<f64>().is_ok();
    if let Some(inner) = cell.strip_prefix('(').and_then(|c| c.strip_suffix(')')).filter(|c| number(c)) {
        return format!("; a number in brackets is negative in bookkeeping: write -{}", inner.trim());
    }
    if let Some(rest) = cell.strip_suffix(['-', '\u{2212}']).filter(|c| number(c)) {
        return format!("; its sign stands behind it: write -{}", rest.trim());
    }
    if let Some(why) = of_a_sheet(cell) {
        return why;
    }
    let parts: Vec<&str> = cell.split(['.', '-', '/']).map(str::trim).collect();
    let of_a_date = |p: &&str| [1, 2, 4].contains(&p.len()) && p.chars().all(|c| c.is_ascii_digit());
    let named = starts(cell) && MONTHS.iter().any(|m| cell.to_lowercase().contains(m));
    if named || parts.len() == 3 && parts.iter().all(of_a_date) {
        return "; a spreadsheet took it for a date: set the cells to numbers and write it again".into();
    }
    let unit = cell.trim_start_matches(|c: char| c.is_ascii_digit() || "+-., ".contains(c));
    if starts(cell) && !unit.is_empty() && !unit.contains(|c: char| c.is_ascii_digit()) {
        return format!("; take \"{unit}\" out of the cells, and declare a unit by [laxity_format.NAME.columns]");
    }
    if cell.chars().any(|c| c.is_numeric() && !c.is_ascii()) {
        return "; its digits are of another script or width: type them as 0 to 9".into();
    }
    if unit.is_empty() && cell.matches('.').count() > 1 {
        return "; it has two decimal marks: where one parts thousands, leave it out".into();
    }
    String::new()
}

/// Why a cell is no number, where a spreadsheet or another program wrote it so.
fn of_a_sheet(cell: &str) -> Option<String> {
    let number = |t: &str| t.trim().parse::<f64>().is_ok();
    if cell.starts_with('#') {
        let narrow = cell.chars().all(|c| c == '#');
        let what = if narrow {
            "the sheet's column was too narrow to show it: widen the column and write it again"
        } else {
            "a formula of the sheet failed: mend it, or leave the cell empty"
        };
        return Some(format!("; {what}"));
    }
    if let Some(rest) = cell.strip_prefix(['\'', '\u{2018}', '\u{2019}']).filter(|rest| number(rest)) {
        return Some(format!("; an apostrophe makes text of it in a sheet: write {rest}"));
    }
    if cell.starts_with(['<', '>', '~', '\u{2264}', '\u{2265}', '\u{2248}']) {
        return Some("; a bound or a guess is no reading: leave the cell empty, or write what was read".into());
    }
    if cell.contains(['\u{b1}']) || cell.contains("+/-") {
        return Some(
            "; its scatter stands beside it: write the reading alone, and the scatter in the column sd_...".into(),
        );
    }
    let plain: String = cell.chars().filter(|c| !c.is_whitespace() && !['\'', '\u{2019}', '_'].contains(c)).collect();
    if plain != cell && number(&plain) {
        return Some(format!("; its digits are parted, as thousands are: write {plain}"));
    }
    let decimal = cell.replace(',', ".");
    let is_below_1 = cell.trim_start_matches(['+', '-']).starts_with(['0', ',']);
    let of_three = cell.rsplit(',').next().is_some_and(|end| end.len() == 3) && !is_below_1;
    if cell.matches(',').count() == 1 && number(&decimal) && of_three {
        let whole = cell.replace(',', "");
        return Some(format!("; a thousand with a separator, or a decimal comma: write {whole} or {decimal}"));
    }
    if cell.matches(',').count() == 1 && number(&decimal) {
        return Some(format!("; a decimal comma: write {decimal}"));
    }
    let exponent = cell.replace(['D', 'd'], "E");
    (exponent != cell && number(&exponent))
        .then(|| format!("; its exponent has a D, as Fortran writes it: write {exponent}"))
}

/// Beginnings of the months' names as spreadsheets write them, in a few languages.
const MONTHS: [&str; 17] = [
    "jan", "feb", "mar", "m\u{e4}r", "apr", "may", "mai", "jun", "jul", "aug", "sep", "oct", "okt", "nov", "dec",
    "dez", "d\u{e9}c",
];

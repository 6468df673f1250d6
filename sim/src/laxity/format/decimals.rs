//! Which sign is the decimal one in a table; and thousands that would be read as units.

use crate::laxity::columns::LaxityError;
use crate::laxity::text;
use csv::StringRecord;

/// The cells of a table that are to be numbers, with row and column. `numbers`: which columns have such.
fn cells<'a>(rows: &'a [(usize, StringRecord)], numbers: &'a [bool]) -> impl Iterator<Item = (usize, usize, &'a str)> {
    rows.iter().flat_map(move |(number, record)| {
        let own = record.iter().enumerate().zip(numbers).filter(|(_, is_number)| **is_number);
        own.map(move |((at, cell), _)| (*number, at, cell))
    })
}

/// Whether commas in the cells are decimal, as declared or as the cells of numbers show.
///
/// # Errors
/// Another sign; numbers with a comma that may be thousands.
pub(super) fn comma(
    (rows, numbers): (&[(usize, StringRecord)], &[bool]),
    separator: u8,
    declared: Option<char>,
) -> Result<bool, LaxityError> {
    match declared {
        None if separator == b',' => Ok(false),
        None => text::decimal_comma(cells(rows, numbers).map(|(_, _, cell)| cell)),
        Some('.') => Ok(false),
        Some(',') => Ok(true),
        Some(c) => Err(LaxityError::File(format!("decimal = \"{c}\"; expected \".\" or \",\""))),
    }
}

/// What a table is refused by whose commas are decimal: the first number whose point parts thousands, which would be read as a thousandth of what it says.
/// Words are no numbers: a comment or a flag such as 2.001 says nothing of them, and makes no comma decimal.
pub(super) fn thousand(rows: &[(usize, StringRecord)], numbers: &[bool]) -> Option<LaxityError> {
    let with_comma = |cell: &str| cell.matches(',').count() == 1 && cell.replace(',', ".").parse::<f64>().is_ok();
    if !cells(rows, numbers).any(|(_, _, cell)| with_comma(cell)) {
        return None;
    }
    let (number, at, cell) = cells(rows, numbers).find(|(_, _, cell)| is_grouped(cell))?;
    let what = format!(
        "\"{cell}\" may be a thousand: the table's commas are decimal, and a point before three digits parts thousands then; write {} or {}",
        cell.replace('.', ""),
        cell.replacen('.', ",", 1)
    );
    Some(LaxityError::cell(number, (at + 1).to_string(), what))
}

/// Whether points stand in a number as in 1.000 or 12.500.000; a number below 1 begins with 0 and is none.
fn is_grouped(cell: &str) -> bool {
    let mut parts = cell.trim_start_matches(['+', '-']).split('.');
    let digits = |part: &str| !part.is_empty() && part.chars().all(|c| c.is_ascii_digit());
    let first = parts.next().is_some_and(|p| digits(p) && p.len() <= 3 && !p.starts_with('0'));
    let rest: Vec<&str> = parts.collect();
    first && !rest.is_empty() && rest.iter().all(|p| digits(p) && p.len() == 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A column of words, and one of numbers.
    const NUMBERS: [bool; 2] = [false, true];

    #[test]
    fn points_that_part_thousands_among_decimal_commas_are_refused_at_their_cell() {
        let of = |cells: &[&str], declared: Option<char>| {
            let row = |(k, c): (usize, &&str)| (k + 2, StringRecord::from(vec!["1.000", *c]));
            let rows: Vec<(usize, StringRecord)> = cells.iter().enumerate().map(row).collect();
            let is_comma = comma((&rows, &NUMBERS), b';', declared).unwrap();
            is_comma.then(|| thousand(&rows, &NUMBERS)).flatten().map(|e| e.to_string())
        };
        for declared in [None, Some(',')] {
            assert_eq!(of(&["30,2", "1000", "0.125", "3.5", "-0,5"], declared), None);
            for thousand in ["1.000", "-12.500"] {
                let told = of(&["30,2", thousand], declared).unwrap();
                assert!(told.starts_with(&format!("row 3, column 2: \"{thousand}\" may be a thousand")), "{told}");
            }
        }
        // a comma in a word is no decimal one
        let words = [(2, StringRecord::from(vec!["0,5", "133.000"]))];
        assert_eq!(thousand(&words, &NUMBERS).map(|e| e.to_string()), None);
        // without a decimal comma, points are decimal
        assert_eq!(of(&["1.000", "30"], None), None);
        assert_eq!(of(&["30,2", "1.000"], Some('.')), None);
    }
}

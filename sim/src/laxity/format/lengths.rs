//! Rows of another length than the header: separators at their end that part nothing, and cells that no column names.

use crate::laxity::columns::LaxityError;
use csv::StringRecord;
use std::collections::BTreeSet;

/// What is said where a comma may be a decimal one.
const COMMAS: &str = "; decimal commas among commas cannot be told apart: save the table with semicolons between cells";

/// The rows with as many cells as the header has. Empty cells beyond it are left out: some programs end rows with a separator. Columns without a name at
/// the header's end may be missing from rows: they come of such separators, too.
///
/// # Errors
/// A row with fewer cells; a cell beyond the header that is not empty; empty ones that decimal commas may have pushed there.
pub(super) fn fitted(
    rows: Vec<(usize, StringRecord)>,
    header: &StringRecord,
    separator: u8,
) -> Result<Vec<(usize, StringRecord)>, LaxityError> {
    let width = header.len();
    let named = (0..width).rfind(|k| header.get(*k).is_some_and(|name| !name.is_empty())).map_or(0, |k| k + 1);
    let are_ends = are_ends(&rows, separator);
    // where the last column is never empty, a decimal comma pushes a number beyond the header
    let is_full = |record: &StringRecord| record.get(width - 1).is_none_or(|last| !last.is_empty());
    let are_full = width > 0 && rows.iter().all(|(_, record)| is_full(record));
    let hint = if separator == b',' { COMMAS } else { "" };
    let fit = |(number, mut record): (usize, StringRecord)| {
        let len = record.len();
        let filled = (width..len).find(|k| record.get(*k).is_some_and(|cell| !cell.is_empty()));
        if let Some(at) = filled {
            let cell = record.get(at).unwrap_or_default();
            let what = format!("\"{cell}\" stands beyond the header, which has {width} columns{hint}");
            return Err(LaxityError::cell(number, (at + 1).to_string(), what));
        }
        if len < named {
            return Err(LaxityError::row(
                number,
                format!(
                    "{len} cells, and the header has {named}; is it a note or a sum below the table? Leave it out; else give the row all its cells"
                ),
            ));
        }
        if len > width && !are_ends && !(are_full && has_point(&record)) {
            let what = format!(
                "{len} cells, of which the last are empty, and the header has {width} columns{hint}; where its numbers are whole, take the separators at the row's end out"
            );
            return Err(LaxityError::row(number, what));
        }
        record.truncate(width);
        (len..width).for_each(|_| record.push_field(""));
        Ok((number, record))
    };
    rows.into_iter().map(fit).collect()
}

/// Whether empty cells at the end come of separators there in every row. A decimal comma makes a cell more, too, and an empty last cell then moves beyond
/// the header. So among commas every row must have as many cells, and a number must have a decimal point. A row that has one itself needs no others where the last column is filled throughout.
fn are_ends(rows: &[(usize, StringRecord)], separator: u8) -> bool {
    let lengths: BTreeSet<usize> = rows.iter().map(|(_, record)| record.len()).collect();
    separator != b',' || lengths.len() == 1 && rows.iter().any(|(_, record)| has_point(record))
}

/// Whether a number of a row has a decimal point.
fn has_point(record: &StringRecord) -> bool {
    record.iter().any(|cell| cell.contains('.') && cell.parse::<f64>().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(columns: usize) -> StringRecord {
        (0..columns).map(|k| format!("c{k}")).collect::<Vec<_>>().into()
    }

    fn rows(all: &[&str], separator: char) -> Vec<(usize, StringRecord)> {
        all.iter().enumerate().map(|(k, row)| (k + 2, row.split(separator).collect())).collect()
    }

    #[test]
    fn separators_at_the_end_are_left_out_and_cells_there_are_named() {
        let plain = rows(&["a,1.5,2", "b,0,3"], ',');
        for (ends, separator) in
            [(["a,1.5,2,", "b,0,3,"], ','), (["a,1.5,2,,,", "b,0,3,,,"], ','), (["a;1.5;2;", "b;0;3"], ';')]
        {
            assert_eq!(fitted(rows(&ends, separator), &header(3), separator as u8), Ok(plain.clone()), "{ends:?}");
        }
        let told = |all: &[&str]| fitted(rows(all, ','), &header(3), b',').unwrap_err().to_string();
        let beyond = told(&["a,1.5,2,", "b,0,3,x"]);
        assert!(beyond.starts_with("row 3, column 4: \"x\" stands beyond the header"), "{beyond}");
        assert!(told(&["a,1.5,2", "b,0"]).starts_with("row 3: 2 cells, and the header has 3"));
        // the note is at fault, and no row with a separator more
        assert!(told(&["a,1.5,2,", "end"]).starts_with("row 3: 1 cells, and the header has 3"));
    }

    #[test]
    fn ragged_ends_are_left_out_where_a_number_of_the_row_has_a_point_and_the_last_column_is_filled() {
        let plain = rows(&["a,1.5,2", "b,0.5,3"], ',');
        for ends in [["a,1.5,2,", "b,0.5,3"], ["a,1.5,2", "b,0.5,3,,"], ["a,1.5,2,,,", "b,0.5,3,"]] {
            assert_eq!(fitted(rows(&ends, ','), &header(3), b','), Ok(plain.clone()), "{ends:?}");
        }
        // the header has the separators, and no row or only one
        let ended: StringRecord = vec!["c0", "c1", "c2", "", ""].into();
        for ends in [["a,1.5,2", "b,0.5,3"], ["a,1.5,2,,", "b,0.5,3"]] {
            let all = fitted(rows(&ends, ','), &ended, b',').unwrap();
            assert_eq!(all, rows(&["a,1.5,2,,", "b,0.5,3,,"], ','), "{ends:?}");
        }
        let told = fitted(rows(&["a,1.5"], ','), &ended, b',').unwrap_err().to_string();
        assert!(told.starts_with("row 2: 2 cells, and the header has 3"), "{told}");
    }

    /// The last cell is empty, and a decimal comma parts one before it: the row has an empty cell too many.
    #[test]
    fn an_empty_cell_that_a_decimal_comma_pushed_beyond_the_header_is_refused() {
        for all in [["a,1,5,", "b,0.5,"], ["a,1,5,", "b,0,5,"], ["a,1,0.5,", "b,0.5,"]] {
            let told = fitted(rows(&all, ','), &header(3), b',').unwrap_err().to_string();
            assert!(told.starts_with("row 2: 4 cells") && told.contains("decimal commas"), "{told}");
        }
    }
}

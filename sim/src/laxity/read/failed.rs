//! Cells in which a spreadsheet says that a formula failed.

/// What LibreOffice writes before the number of an error.
const NUMBERED: &str = "err:";
/// Letters of an error's name from which on it is one: `#NUM!` has the fewest.
const LEAST_LETTERS: usize = 3;

/// Whether a cell is the error of a formula, in any language: `#REF!`, `#NAME?`, `#DIV/0!`, `Err:502`.
pub(super) fn is_error(cell: &str) -> bool {
    let small = cell.trim().to_lowercase();
    let is_number = |digits: &str| !digits.is_empty() && digits.chars().all(|c| c.is_ascii_digit());
    let named = small.strip_prefix('#').and_then(|rest| rest.strip_suffix(['!', '?']));
    let letters = |name: &str| name.chars().filter(|c| c.is_alphabetic()).count();
    small.strip_prefix(NUMBERED).is_some_and(is_number)
        || named.is_some_and(|name| letters(name) >= LEAST_LETTERS && !name.contains(char::is_whitespace))
}

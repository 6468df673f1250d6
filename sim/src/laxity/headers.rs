//! Names of columns that are a standard one by another name or in another unit: told with the line that declares them.

use super::columns::{WITHOUT_COLUMN, known_columns};
use super::units::unit;
use csv::StringRecord;

/// Names of columns in one cell, or below each other, from which on a table has another shape.
const LEAST_NAMES: usize = 3;

/// What is said of a table of another shape: a web page, cells that are not parted, rows and columns exchanged.
pub(super) fn other_shape<'a>(header: &StringRecord, first_cells: impl Iterator<Item = &'a str>) -> Option<String> {
    let known = known_columns();
    let first = header.get(0)?.trim();
    if first.starts_with('<') {
        return Some("the file is a web page with a table in it; open it in a spreadsheet and save it as CSV".into());
    }
    let between = |c: char| !(c.is_alphanumeric() || c == '_');
    let inside = first.split(between).filter(|word| known.contains(*word)).count();
    if header.len() == 1 && inside >= LEAST_NAMES {
        return Some("its cells are parted by another sign; expected commas, semicolons or tabs between them".into());
    }
    let below = first_cells.filter(|cell| known.contains(*cell)).count();
    (known.contains(first) && below >= LEAST_NAMES).then(|| {
        format!("the table lies on its side: {below} names of columns stand below \"{first}\"; transpose it, so that each trial is a row")
    })
}

/// The standard column that a name means, the unit that it says, and that unit's factor to the standard one; none where it means none.
fn meant(name: &str) -> Option<(String, String, f64)> {
    let between = |c: char| c.is_whitespace() || "_-[](),/".contains(c);
    let parts: Vec<&str> = name.split(between).filter(|part| !part.is_empty()).collect();
    let known = known_columns();
    (1..parts.len()).find_map(|at| {
        let said = parts[at..].join(" ");
        let (quantity, factor) = unit(&said)?;
        let column = format!("{}_{quantity}", parts[..at].join("_").to_lowercase());
        known.contains(&column).then_some((column, said, factor))
    })
}

/// The line of specimen.toml that declares a column of this name.
fn line(name: &str) -> Option<String> {
    let (column, unit, factor) = meant(name)?;
    let same = (factor - 1.0).abs() < f64::EPSILON;
    Some(if same {
        format!("{column} = \"{name}\"")
    } else {
        format!("{column} = {{ name = \"{name}\", unit = \"{unit}\" }}")
    })
}

/// Words by which laboratories call what was cut of a knee before a trial.
const CUT: [&str; 7] = ["cut", "state", "condition", "section", "deficien", "resect", "transect"];

/// What is said of a column that is no standard one, where its name tells what it is; with the lines for all of the file's that do.
pub(super) fn declared<'a>(name: &str, all: impl Iterator<Item = &'a str>) -> Option<String> {
    if CUT.iter().any(|word| name.to_lowercase().contains(word)) {
        return Some(format!(
            "if it says which ligaments were cut, call it {WITHOUT_COLUMN}: ACL, or ACL+ALS; empty for the whole knee. A file is of one state"
        ));
    }
    let (column, unit, factor) = meant(name)?;
    let standard = known_columns();
    let lines: Vec<String> = all.filter(|other| !standard.contains(*other)).filter_map(line).collect();
    let how = if (factor - 1.0).abs() < f64::EPSILON { "by another name".into() } else { format!("in {unit}") };
    Some(format!(
        "it is {column} {how}. Declare below [laxity_format.NAME.columns] in specimen.toml: {}",
        lines.join("; ")
    ))
}

/// What is said of columns that a format leaves out, where one is a standard one by its name.
pub(super) fn left_out(names: &[&str]) -> String {
    let found = names.iter().find_map(|name| Some((name, declared(name, names.iter().copied())?)));
    found.map_or(String::new(), |(name, is)| format!("; of \"{name}\": {is}"))
}

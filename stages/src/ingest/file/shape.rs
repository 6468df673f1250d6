//! What a specimen.toml lacks as a whole, and the key at which it is not as expected.

/// What a specimen needs at the least.
const LEAST: &str = "[specimen] with id and side, [ct] with femur and tibfib, and [scans] with femur and tibfib (or [segmentation], or [cartilage])";

/// What is said of a file in which nothing is written but comments.
pub(super) fn empty(text: &str) -> Option<String> {
    let nothing = text.lines().map(str::trim).all(|line| line.is_empty() || line.starts_with('#'));
    nothing.then(|| {
        format!("the file is empty: no key stands in it; expected {LEAST}. The command init writes one to fill in")
    })
}

/// A parser's complaint with the key or the table that it is about, and with what was expected there.
pub(super) fn placed(text: &str, e: &toml::de::Error, what: String) -> String {
    let before = e.span().and_then(|s| text.get(..s.start)).unwrap_or("");
    let at = before.matches('\n').count();
    let table = text.lines().take(at + 1).filter_map(header).last();
    if let Some(missing) = what.strip_prefix("missing field `").and_then(|rest| rest.split('`').next()) {
        return lacking(table, missing);
    }
    let key = text.lines().nth(at).and_then(|line| line.split_once('=')).map(|(key, _)| key.trim());
    let Some(key) = key.filter(|_| what.starts_with("invalid type") || what.starts_with("wanted")) else { return what };
    let name = table.map_or(key.to_owned(), |table| format!("{table}.{key}"));
    let is_word = what.contains("expected a string") || what.contains("wanted string");
    let write = if is_word { format!("; write a word or a path in quotes, as {key} = \"...\"") } else { String::new() };
    format!("{name}: {what}{write}")
}

/// The name in a table's header.
fn header(line: &str) -> Option<&str> {
    line.trim().strip_prefix('[')?.split(']').next().map(|name| name.trim_start_matches('[').trim())
}

/// What is said of a table or of a key that is not there.
fn lacking(table: Option<&str>, missing: &str) -> String {
    match (table, missing) {
        (_, "specimen") => format!("the table [specimen] is missing; expected {LEAST}"),
        (Some("specimen"), "side") => {
            "specimen.side is missing; expected side = \"left\" or side = \"right\" below [specimen]".into()
        }
        (Some(table), key) => format!("{table}.{key} is missing; expected {key} = ... below [{table}]"),
        (None, key) => format!("the key {key} is missing; expected {LEAST}"),
    }
}

#[cfg(test)]
mod tests {
    use crate::ingest::parse_specimen_file;

    fn refused(text: &str) -> String {
        parse_specimen_file(text).unwrap_err().to_string()
    }

    #[test]
    fn a_file_without_a_key_or_a_table_says_what_it_needs() {
        for text in ["", "  \n\n", "# a knee\n", "\u{feff}"] {
            let told = refused(text);
            assert!(told.starts_with("specimen.toml: the file is empty"), "{told}");
            assert!(told.contains("[specimen] with id and side") && told.contains("init"), "{told}");
        }
        let told = refused("[ct]\nfemur = \"a.stl\"\n");
        assert!(told.contains("the table [specimen] is missing"), "{told}");
        let told = refused("[specimen]\nid = \"k\"\n");
        assert!(told.contains("line 1: specimen.side is missing") && told.contains("side = \"left\""), "{told}");
        let told = refused("[specimen]\nid = \"k\"\nside = \"left\"\n\n[scans]\nfemur = \"a.ply\"\n");
        assert!(told.contains("line 5: scans.tibfib is missing"), "{told}");
    }

    #[test]
    fn a_value_of_another_kind_is_told_by_its_key() {
        for value in ["3", "true", "[\"a.stl\"]"] {
            let told = refused(&format!("[specimen]\nid = \"k\"\nside = \"left\"\n[ct]\nfemur = {value}\n"));
            for word in ["line 5: ct.femur: invalid type", "expected a string", "femur = \"...\""] {
                assert!(told.contains(word), "{word}: {told}");
            }
        }
        let told = refused("[specimen]\nid = \"k\"\nside = \"left\"\nage_years = \"old\"\n");
        assert!(told.contains("specimen.age_years: invalid type") && !told.contains("in quotes"), "{told}");
    }
}

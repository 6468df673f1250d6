//! specimen.toml as its bytes say it, and the names that it says against those in the specimen's folder.

use super::file::{OPTIONAL_PATHS, named};
use crate::StageError;
use crate::specimen::SpecimenFile;

/// The text of specimen.toml: of UTF-8, or of UTF-16 or UTF-32, as editors on Windows write it.
///
/// # Errors
/// Another encoding, by the line at which it shows. It is not guessed: a path with another letter is another file.
pub fn specimen_text(bytes: &[u8]) -> Result<String, StageError> {
    let (text, told) = sim::text::decoded(bytes);
    if told.is_none() {
        return Ok(text.into_owned());
    }
    let good = std::str::from_utf8(bytes).err().map_or(0, |e| e.valid_up_to());
    let above = bytes.iter().take(good).filter(|b| **b == b'\n').count();
    let is_text = text.chars().all(|c| c >= ' ' || ['\t', '\r', '\n'].contains(&c));
    let what = match text.lines().nth(above).map(str::trim).filter(|_| is_text) {
        Some(line) => format!(
            "the file is not UTF-8: by its bytes it is Latin-1 or Windows-1252, in which this line is `{line}`; save it as UTF-8 (in an editor: Save as, encoding UTF-8)"
        ),
        None => "the file is no text; expected a text in UTF-8".into(),
    };
    Err(StageError::line("specimen.toml", above + 1, what))
}

/// Refuses a file that is not there by the name of one that is, and whose letters are of another case: a disk of another system takes both for one.
/// Refuses a folder where a file is expected. `is_there` and `list` look into the specimen's folder: at a path, and for the names in a folder, of which
/// the empty one is the specimen's.
///
/// # Errors
/// The key, the path and the name that is there.
pub fn check_case(
    file: &SpecimenFile,
    is_there: impl Fn(&str) -> bool,
    list: impl Fn(&str) -> Vec<String>,
) -> Result<(), StageError> {
    for (key, path) in named(file) {
        check_is_file(&key, &path, &list)?;
        if !is_there(&path)
            && let Some(found) = in_another_case(&path, &list)
        {
            return Err(StageError::specimen(format!(
                "{key} names {path}, which is not there, and {found} is: letters in another case make another name; write {key} = \"{found}\", or rename the file"
            )));
        }
    }
    let given = [
        ("landmarks", &file.points.landmarks),
        ("marks", &file.points.marks),
        ("attachments", &file.points.attachments),
    ];
    for (path, (key, own)) in OPTIONAL_PATHS.iter().zip(given) {
        if own.is_none()
            && !is_there(path)
            && let Some(found) = in_another_case(path, &list)
        {
            return Err(StageError::file(
                &found,
                format!(
                    "nothing reads it: the table beside specimen.toml is called {path}, and letters in another case make another name; rename it, or name it: {key} = \"{found}\" in [points]"
                ),
            ));
        }
    }
    Ok(())
}

/// The only key that may name a folder: a DICOM series.
const MAY_BE_FOLDER: &str = "ct.volume";
/// Files of a folder that a message names.
const NAMES_TOLD: usize = 5;

/// Refuses a folder that a key of a file names, with the files in it.
fn check_is_file(key: &str, path: &str, list: &impl Fn(&str) -> Vec<String>) -> Result<(), StageError> {
    let names = list(path.trim_end_matches('/'));
    let Some(first) = names.first().filter(|_| key != MAY_BE_FOLDER) else { return Ok(()) };
    let last = key.rsplit('.').next().unwrap_or(key).to_lowercase();
    let likeliest = names.iter().find(|name| name.to_lowercase().contains(&last)).unwrap_or(first);
    let folder = path.trim_end_matches(['/', '.']);
    let within = if folder.is_empty() { likeliest.clone() } else { format!("{folder}/{likeliest}") };
    let more = if names.len() > NAMES_TOLD { ", ..." } else { "" };
    Err(StageError::specimen(format!(
        "{key} = \"{path}\" is a folder; expected a file, and it holds {}{more}: name one of them, as {key} = \"{within}\"",
        names.iter().take(NAMES_TOLD).map(String::as_str).collect::<Vec<_>>().join(", ")
    )))
}

/// The path as it is in the folder, where the case of its letters is all that differs.
fn in_another_case(path: &str, list: &impl Fn(&str) -> Vec<String>) -> Option<String> {
    let mut found = String::new();
    for part in path.split('/').filter(|part| !["", "."].contains(part)) {
        let (names, small) = (list(&found), part.to_lowercase());
        let same = names.iter().find(|name| *name == part);
        let name = same.or_else(|| names.iter().find(|name| name.to_lowercase() == small))?;
        if !found.is_empty() {
            found.push('/');
        }
        found += name;
    }
    Some(found).filter(|found| found != path.trim_end_matches('/'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::parse_specimen_file;

    const TOML: &str = "[specimen]\nid = \"k\"\nside = \"left\"\nnote = \"\u{dc}bung\"\n\n[ct]\nfemur = \"ct/Femur.stl\"\ntibfib = \"ct/tibfib.stl\"\n\n[scans]\nfemur = \"a.ply\"\ntibfib = \"b.ply\"\n";

    #[test]
    fn the_specimen_file_is_read_in_wide_encodings_and_named_in_narrow_ones() {
        let wide = |of: fn(u16) -> [u8; 2]| TOML.encode_utf16().flat_map(of).collect::<Vec<u8>>();
        let little = [vec![0xff, 0xfe], wide(u16::to_le_bytes)].concat();
        let big = [vec![0xfe, 0xff], wide(u16::to_be_bytes)].concat();
        let marked = [b"\xef\xbb\xbf", TOML.as_bytes()].concat();
        for bytes in [little, big, wide(u16::to_le_bytes), marked, TOML.as_bytes().to_vec()] {
            assert_eq!(specimen_text(&bytes).as_deref(), Ok(TOML));
        }
        let narrow: Vec<u8> = TOML.chars().map(|c| c as u8).collect();
        let told = specimen_text(&narrow).unwrap_err().to_string();
        assert!(told.starts_with("specimen.toml, line 4: the file is not UTF-8"), "{told}");
        for word in ["Latin-1", "note = \"\u{dc}bung\"", "save it as UTF-8"] {
            assert!(told.contains(word), "{word}: {told}");
        }
        assert!(specimen_text(b"PK\x03\x04\xff\xfe\x01").unwrap_err().to_string().contains("no text"));
    }

    #[test]
    fn a_folder_in_a_file_s_place_is_told_with_its_key_and_files() {
        let list = |path: &str| match path {
            "ct" => vec!["femur.stl".to_owned(), "tibfib.stl".to_owned()],
            "." => vec!["ct".to_owned()],
            _ => vec![],
        };
        let said =
            |toml: &str| check_case(&parse_specimen_file(toml).unwrap(), |_| true, list).map_err(|e| e.to_string());
        assert_eq!(said(TOML), Ok(()));
        for (from, to, key) in [
            ("ct/tibfib.stl", "ct", "ct.tibfib = \"ct\""),
            ("ct/tibfib.stl", "ct/", "ct.tibfib = \"ct/\""),
            ("ct/tibfib.stl", ".", "ct.tibfib = \".\""),
            ("a.ply", "ct", "scans.femur = \"ct\""),
        ] {
            let told = said(&TOML.replace(from, to)).unwrap_err();
            assert!(told.starts_with(&format!("specimen.toml: {key} is a folder; expected a file")), "{told}");
        }
        let told = said(&TOML.replace("ct/tibfib.stl", "ct")).unwrap_err();
        assert!(
            told.ends_with("holds femur.stl, tibfib.stl: name one of them, as ct.tibfib = \"ct/tibfib.stl\""),
            "{told}"
        );
        let surfaces = "[ct]\nfemur = \"ct/Femur.stl\"\ntibfib = \"ct/tibfib.stl\"";
        assert_eq!(said(&TOML.replace(surfaces, "[ct]\nvolume = \"ct\"")), Ok(()));
    }

    #[test]
    fn a_name_in_letters_of_another_case_is_told_with_the_one_that_is_there() {
        let folder = |files: &'static [&'static str]| {
            let is_there = move |path: &str| files.iter().any(|f| *f == path || f.starts_with(&format!("{path}/")));
            let list = move |path: &str| {
                let start = if path.is_empty() { String::new() } else { format!("{path}/") };
                let names = files.iter().filter_map(|f| f.strip_prefix(&start)?.split('/').next());
                names.map(String::from).collect::<Vec<String>>()
            };
            (is_there, list)
        };
        let file = parse_specimen_file(TOML).unwrap();
        let said = |files: &'static [&'static str]| {
            let (is_there, list) = folder(files);
            check_case(&file, is_there, list).map_err(|e| e.to_string())
        };
        assert_eq!(said(&["ct/Femur.stl", "ct/tibfib.stl", "a.ply", "b.ply", "marks.csv"]), Ok(()));
        // what is not there at all is another message's
        assert_eq!(said(&["ct/tibfib.stl"]), Ok(()));
        let others: [&'static [&'static str]; 3] =
            [&["ct/femur.stl", "ct/tibfib.stl"], &["CT/FEMUR.STL"], &["Ct/Femur.stl"]];
        for files in others {
            let told = said(files).unwrap_err();
            assert!(told.contains("ct.femur names ct/Femur.stl, which is not there"), "{told}");
            assert!(told.contains(&format!("ct.femur = \"{}\"", files[0])), "{told}");
        }
        let told = said(&["ct/Femur.stl", "ct/tibfib.stl", "a.ply", "b.ply", "Landmarks.CSV"]).unwrap_err();
        assert!(told.starts_with("Landmarks.CSV: nothing reads it"), "{told}");
        assert!(told.contains("landmarks = \"Landmarks.CSV\" in [points]"), "{told}");
    }
}

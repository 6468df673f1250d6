//! What was changed by hand in an export is not written over: an export keeps the digests of its files, and looks before it writes.

use super::File;
use crate::error::BuildError;
use crate::{record, store};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// The file of an export in which the digests stand.
const SOURCE: &str = "model.source.json";

/// Digests of files by their names.
type Digests = BTreeMap<String, String>;

/// The digests that exports into this folder have kept, of files that are still there.
fn kept(out: &Path) -> Digests {
    let told = store::read(&out.join(SOURCE)).ok().and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
    let mut kept: Digests = told.and_then(|t| serde_json::from_value(t["files"].clone()).ok()).unwrap_or_default();
    kept.retain(|name, _| store::exists(&out.join(name)));
    kept
}

/// Refuses to write over a file that is not as an export left it, unless forced; then keeps the digests of those to be written.
///
/// Errors: such a file, with what to do.
pub(super) fn guarded(out: &Path, files: &mut [File], force: bool) -> Result<(), BuildError> {
    let mut digests = kept(out);
    let edited = |(name, bytes): &&File| {
        let own = |there: Vec<u8>| there == *bytes || digests.get(name) == Some(&record::hash(&there));
        name != SOURCE && store::read(&out.join(name)).is_ok_and(|there| !own(there))
    };
    if let Some((name, _)) = files.iter().find(edited).filter(|_| !force) {
        let place = out.join(name);
        let told = format!(
            "{} is not as the last export here left it, so it is not written over; give a new folder, move that file away, or add --force",
            place.display()
        );
        return Err(BuildError::edited(&place, told));
    }
    digests.extend(files.iter().filter(|f| f.0 != SOURCE).map(|(name, bytes)| (name.clone(), record::hash(bytes))));
    for (_, bytes) in files.iter_mut().filter(|f| f.0 == SOURCE) {
        if let Ok(mut told) = serde_json::from_slice::<Value>(bytes) {
            told["files"] = json!(digests);
            *bytes = record::json(&told);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files of an export, and what it is of.
    fn files(text: &str) -> Vec<File> {
        let own =
            ["a.inp", "Geometry/b.stl", "predictions.csv"].map(|n| (n.to_owned(), format!("{n} {text}").into_bytes()));
        own.into_iter().chain([(SOURCE.to_owned(), b"{\"model\": \"knee\"}".to_vec())]).collect()
    }

    fn export(out: &Path, mut files: Vec<File>, force: bool) -> Result<(), BuildError> {
        guarded(out, &mut files, force)?;
        store::write_all(out, &files)
    }

    #[test]
    fn an_export_replaces_what_exports_wrote() {
        let folder = tempfile::tempdir().unwrap();
        for text in ["one", "two", "one"] {
            export(folder.path(), files(text), false).unwrap();
        }
        // another format in the same folder, and the first again
        let other = vec![("c.ply".to_owned(), b"c".to_vec()), (SOURCE.to_owned(), b"{}".to_vec())];
        export(folder.path(), other, false).unwrap();
        export(folder.path(), files("three"), false).unwrap();
        assert_eq!(store::read(&folder.path().join("a.inp")).unwrap(), b"a.inp three");
        let told: Value = serde_json::from_slice(&store::read(&folder.path().join(SOURCE)).unwrap()).unwrap();
        assert_eq!(told["files"].as_object().unwrap().len(), 4);
        assert_eq!(told["model"], "knee");
    }

    #[test]
    fn no_file_that_was_changed_or_is_no_exports_is_written_over_unless_forced() {
        for edited in files("") {
            let (name, place) = (edited.0.clone(), tempfile::tempdir().unwrap());
            let path = place.path().join(&name);
            // changed after an export, and where nothing tells of one
            for (known, again) in [(true, "two"), (false, "one")] {
                export(place.path(), files("one"), true).unwrap();
                if !known {
                    store::discard(&place.path().join(SOURCE));
                }
                store::write(&path, b"by hand").unwrap();
                let refused = export(place.path(), files(again), false);
                if name == SOURCE {
                    continue; // it is the program's own
                }
                let error = refused.unwrap_err();
                assert!(crate::output::advice(&error).contains("--force"));
                let told = error.to_string();
                assert!(told.contains(&path.display().to_string()) && told.contains("--force"), "{told}");
                assert_eq!(store::read(&path).unwrap(), b"by hand");
            }
            export(place.path(), files("two"), true).unwrap();
            export(place.path(), files("three"), false).unwrap();
        }
    }
}

//! What was changed by hand in an export is not written over: an export keeps the digests of its files, and looks before it writes.

use super::File;
use crate::error::BuildError;
use crate::{record, store};
use notices::{Kind, Notice};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// The file of an export in which the digests stand.
const SOURCE: &str = "model.source.json";

/// Digests of files by their names.
type Digests = BTreeMap<String, String>;

/// Endings of files that take parts of others beside them, as main files of decks do and protocols of FEBio.
const TAKING: [&str; 3] = [".feb", ".inp", ".osim"];
/// Names of files in a sentence, at most. Ours: a line or two.
const MOST_NAMED: usize = 5;

/// What the folder says of the export before.
fn told(out: &Path) -> Option<Value> {
    store::read(&out.join(SOURCE)).ok().and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok())
}

/// The digests that exports into this folder have kept, of files that are still there.
fn kept(out: &Path) -> Digests {
    let mut kept: Digests = told(out).and_then(|t| serde_json::from_value(t["files"].clone()).ok()).unwrap_or_default();
    kept.retain(|name, _| store::exists(&out.join(name)));
    kept
}

/// Whether a file that is to be written is there otherwise than an export left it.
fn is_edited(out: &Path, digests: &Digests, (name, bytes): &File) -> bool {
    let own = |there: Vec<u8>| there == *bytes || digests.get(name) == Some(&record::hash(&there));
    name != SOURCE && store::read(&out.join(name)).is_ok_and(|there| !own(there))
}

/// What is said of such a file.
fn refused(out: &Path, name: &str) -> BuildError {
    let place = out.join(name);
    let told = format!(
        "{} is not as the last export here left it, so it is not written over; give a new folder, move that file away, or add --force",
        place.display()
    );
    BuildError::edited(&place, told)
}

/// Refuses, before the work that makes them, what would be refused after it: `files` that are made already, and those that `later` names where
/// they are no longer as an export left them.
///
/// Errors: such a file, with what to do.
pub(super) fn looked_at(out: &Path, files: &[File], later: &[&str], force: bool) -> Result<(), BuildError> {
    if force {
        return Ok(());
    }
    let digests = kept(out);
    let changed = |name: &str| {
        let before = digests.get(name);
        before.is_some_and(|d| store::read(&out.join(name)).is_ok_and(|there| record::hash(&there) != *d))
    };
    let now = files.iter().find(|file| is_edited(out, &digests, file)).map(|file| file.0.as_str());
    let then = later.iter().copied().find(|name| changed(name));
    now.or(then).map_or(Ok(()), |name| Err(refused(out, name)))
}

/// Files of earlier exports that this one does not write, and that would take parts of its own.
pub(super) struct Earlier {
    /// As an export left them: they go.
    pub(super) gone: Vec<String>,
    /// What is said of the others, which stay.
    pub(super) notices: Vec<Notice>,
}

impl Earlier {
    fn of(out: &Path, digests: &Digests, files: &[File]) -> Earlier {
        let is_written = |name: &str| files.iter().any(|file| file.0 == name);
        let taking = |name: &str| {
            TAKING.iter().any(|end| name.ends_with(*end) && files.iter().any(|file| file.0.ends_with(*end)))
        };
        // the names stand in a file: nothing is removed beyond the folder
        let here = |name: &str| !name.contains(['/', '\\']);
        let own = |name: &&String| here(name.as_str()) && taking(name.as_str()) && !is_written(name.as_str());
        let as_left = |name: &String| {
            store::read(&out.join(name)).is_ok_and(|there| digests.get(name) == Some(&record::hash(&there)))
        };
        let (gone, edited): (Vec<String>, Vec<String>) = digests.keys().filter(own).cloned().partition(as_left);
        let mut notices = Vec::new();
        if !edited.is_empty() {
            let text = format!(
                "files of an earlier export that were changed since stay, and take parts of this one's beside them: {}; move them away",
                named(&edited)
            );
            notices.push(Kind::NotInFormat.notice(text).count(edited.len()));
        }
        let ours = files.iter().find(|file| file.0 == SOURCE);
        let model = |t: Option<Value>| t.map(|t| t["digest"].clone()).unwrap_or_default();
        let is_other = model(told(out)) != model(ours.and_then(|(_, bytes)| serde_json::from_slice(bytes).ok()));
        let stays = |name: &&String| !is_written(name.as_str()) && !gone.contains(*name) && !edited.contains(*name);
        let left: Vec<String> = digests.keys().filter(stays).cloned().collect();
        if is_other && !left.is_empty() {
            let text = format!("files of an earlier export stay in the folder, of another model: {}", named(&left));
            notices.push(Kind::NotInFormat.notice(text).count(left.len()));
        }
        Earlier { gone, notices }
    }

    /// Removes what goes; to be called once the new files stand.
    pub(super) fn removed(&self, out: &Path) {
        self.gone.iter().for_each(|name| store::discard(&out.join(name)));
    }

    /// What is said of what went: a line, or nothing.
    pub(super) fn line(&self) -> String {
        if self.gone.is_empty() {
            return String::new();
        }
        format!("removed, as they are of an earlier export: {}\n", named(&self.gone))
    }
}

/// The first names, and how many more there are.
fn named(names: &[String]) -> String {
    let first = names[..names.len().min(MOST_NAMED)].join(", ");
    if names.len() > MOST_NAMED { format!("{first} and {} more", names.len() - MOST_NAMED) } else { first }
}

/// Refuses to write over a file that is not as an export left it, unless forced; then keeps the digests of those to be written. Gives what earlier
/// exports left.
///
/// Errors: such a file, with what to do.
pub(super) fn guarded(out: &Path, files: &mut [File], force: bool) -> Result<Earlier, BuildError> {
    let mut digests = kept(out);
    if let Some((name, _)) = files.iter().find(|file| is_edited(out, &digests, file)).filter(|_| !force) {
        return Err(refused(out, name));
    }
    let earlier = Earlier::of(out, &digests, files);
    digests.retain(|name, _| !earlier.gone.contains(name));
    digests.extend(files.iter().filter(|f| f.0 != SOURCE).map(|(name, bytes)| (name.clone(), record::hash(bytes))));
    for (_, bytes) in files.iter_mut().filter(|f| f.0 == SOURCE) {
        if let Ok(mut told) = serde_json::from_slice::<Value>(bytes) {
            told["files"] = json!(digests);
            *bytes = record::json(&told);
        }
    }
    Ok(earlier)
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

    fn export(out: &Path, mut files: Vec<File>, force: bool) -> Result<Earlier, BuildError> {
        looked_at(out, &files, &[], force)?;
        let earlier = guarded(out, &mut files, force)?;
        store::write_all(out, &files)?;
        earlier.removed(out);
        Ok(earlier)
    }

    /// An export of a model: these names, and what it is of.
    fn of_model(model: &str, names: &[&str]) -> Vec<File> {
        let own = names.iter().map(|name| ((*name).to_owned(), format!("{name} of {model}").into_bytes()));
        let source = record::json(&json!({"model": model, "digest": model}));
        own.chain([(SOURCE.to_owned(), source)]).collect()
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
                let Err(error) = refused else { panic!("{name} is written over") };
                assert!(crate::output::advice(&error).contains("--force"));
                let told = error.to_string();
                assert!(told.contains(&path.display().to_string()) && told.contains("--force"), "{told}");
                assert_eq!(store::read(&path).unwrap(), b"by hand");
            }
            export(place.path(), files("two"), true).unwrap();
            export(place.path(), files("three"), false).unwrap();
        }
    }

    /// A file that takes parts of others goes with its export; one that was changed stays, by its name; other formats stay.
    #[test]
    fn no_file_of_an_earlier_export_takes_the_parts_of_a_later_one() {
        for end in TAKING {
            let [main, first, second] =
                ["model", "model_A_trial_1", "model_A_trial_2"].map(|stem| format!("{stem}{end}"));
            for (model, is_other) in [("A", false), ("B", true)] {
                let folder = tempfile::tempdir().unwrap();
                let out = folder.path();
                export(out, of_model("A", &["bone.stl"]), false).unwrap();
                export(out, of_model("A", &[&main, &first, &second]), false).unwrap();
                store::write(&out.join(&second), b"by hand").unwrap();
                let earlier = export(out, of_model(model, &[&main]), false).unwrap();
                assert_eq!(earlier.gone, std::slice::from_ref(&first));
                assert!(earlier.line().contains(&first));
                assert!(!store::exists(&out.join(&first)) && store::exists(&out.join(&main)));
                assert_eq!(store::read(&out.join(&second)).unwrap(), b"by hand");
                assert!(earlier.notices[0].contains(&second) && !earlier.notices[0].contains(&first));
                assert_eq!(earlier.notices.iter().any(|n| n.contains("another model: bone.stl")), is_other);
                assert!(store::exists(&out.join("bone.stl")));
                let kept = kept(out);
                assert!(kept.contains_key(&main) && !kept.contains_key(&first));
                // the same again leaves nothing to remove
                assert!(export(out, of_model(model, &[&main]), false).unwrap().gone.is_empty());
            }
        }
    }

    /// A list that names files beyond the folder removes none.
    #[test]
    fn nothing_beyond_the_folder_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let (out, beyond) = (folder.path().join("out"), folder.path().join("other.feb"));
        store::write(&beyond, b"another's").unwrap();
        let listed = json!({"files": {"../other.feb": record::hash(b"another's")}});
        store::write(&out.join(SOURCE), &record::json(&listed)).unwrap();
        assert!(export(&out, of_model("A", &["model.feb"]), false).unwrap().gone.is_empty());
        assert!(store::exists(&beyond));
    }

    /// What is written only after long work is looked at before it, and what nobody changed is in nobody's way.
    #[test]
    fn a_changed_file_is_refused_before_the_work_that_makes_it_anew() {
        let later = ["predictions.csv", "ligament_forces.csv"];
        for name in later {
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path();
            looked_at(out, &files("one"), &later, false).unwrap();
            export(out, of_model("A", &later), false).unwrap();
            looked_at(out, &[], &later, false).unwrap();
            store::write(&out.join(name), b"by hand").unwrap();
            let told = looked_at(out, &[], &later, false).unwrap_err().to_string();
            assert!(told.contains(name) && told.contains("--force"), "{told}");
            looked_at(out, &[], &later, true).unwrap();
        }
    }
}

//! What a command wrote where `--out` says. Its digest is kept beside it, so that what was changed since, or is another's, is not written over.

use super::{is_standard_output, linked, list, put, read};
use crate::error::BuildError;
use crate::progress::detail;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder beside results in which their digests stand, a file for each of them: two commands at work in one folder then share no file.
const KEPT: &str = ".written";

thread_local! {
    static RULE: RefCell<Option<Rule>> = const { RefCell::new(None) };
}

/// Nothing that is at the place of `--out` is written over, but what a command wrote there and nobody changed since.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rule {
    out: PathBuf,
    is_folder: bool,
    force: bool,
}

/// A result, by the folder that keeps its digest and its name from there.
struct Own {
    base: PathBuf,
    name: String,
}

impl Rule {
    /// Of the folder or file that `--out` names; with `force` all may be written over.
    pub fn of(out: &Path, is_folder: bool, force: bool) -> Rule {
        Rule { out: out.to_path_buf(), is_folder, force }
    }

    /// Does `work` on this thread under a rule, or without one.
    pub fn holds<T>(rule: Option<Rule>, work: impl FnOnce() -> T) -> T {
        struct Left(Option<Rule>);
        impl Drop for Left {
            fn drop(&mut self) {
                let before = self.0.take();
                RULE.set(before);
            }
        }
        let _left = Left(RULE.replace(rule));
        work()
    }

    /// Refuses what could not be written at the end, before any work is done for its sake: a file that no earlier command left so. Files of
    /// other names are no concern of the command.
    ///
    /// Errors: the first such file, with what to do.
    pub fn is_free(&self, leaves: &Leaves) -> Result<(), BuildError> {
        if self.force {
            return Ok(());
        }
        if !self.is_folder {
            return file_at(&self.out)?.map_or(Ok(()), |file| file.is_free(None));
        }
        let own = |name: String| Own { base: self.out.clone(), name };
        leaves.sure.iter().cloned().map(&own).try_for_each(|f| f.is_free(None))?;
        let may = |name: &String| leaves.perhaps.iter().any(|pattern| is_like(pattern, name));
        let known = below(&self.out.join(KEPT), "");
        known.into_iter().filter(may).map(&own).try_for_each(|f| f.is_free(None))
    }

    /// Refuses a file in the folder that is not known as a result, whatever is to be written there.
    ///
    /// Errors: the file, with what to do.
    fn may_write(&self, name: &str) -> Result<(), BuildError> {
        if self.force || !self.is_folder {
            return Ok(());
        }
        Own { base: self.out.clone(), name: name.to_owned() }.is_free(None)
    }
}

/// What a command leaves in the folder of `--out`, as far as it is known before the work.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Leaves {
    /// Files that it writes, or removes where they are of an earlier run, whatever comes of the work.
    pub sure: Vec<String>,
    /// Files that it may write: `*` stands for what the work tells. Of them results that were changed count, and not what others put there.
    pub perhaps: Vec<String>,
}

/// Whether a name is of a pattern, in which one `*` may stand for any letters.
fn is_like(pattern: &str, name: &str) -> bool {
    match pattern.split_once('*') {
        Some((before, after)) => {
            name.len() >= before.len() + after.len() && name.starts_with(before) && name.ends_with(after)
        }
        None => name == pattern,
    }
}

/// Refuses files of a folder that could not be written at the end, by names that a command knows once it has read its input.
///
/// Errors: the first such file, with what to do.
pub(crate) fn are_free(folder: &Path, names: impl IntoIterator<Item = String>) -> Result<(), BuildError> {
    let Some(rule) = rule(folder, true) else { return Ok(()) };
    names.into_iter().try_for_each(|name| rule.may_write(&name))
}

/// Removes a result of an earlier command from a folder of results, where it is there: it would be read as of this one.
///
/// Errors: a file that is not known as such a result, under a rule of the folder.
pub(crate) fn removed(folder: &Path, name: &str) -> Result<(), BuildError> {
    if let Some(rule) = rule(folder, true) {
        rule.may_write(name)?;
    }
    let _ = fs::remove_file(folder.join(KEPT).join(name));
    let _ = fs::remove_file(folder.join(name));
    Ok(())
}

/// The rule that holds on this thread for a folder of results, or for a file.
fn rule(place: &Path, is_folder: bool) -> Option<Rule> {
    let same = |r: &Rule| r.is_folder == is_folder && (r.out == place || (is_folder && is_one(&r.out, place)));
    RULE.with(|r| r.borrow().clone()).filter(same)
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Whether two paths are one folder that is there.
fn is_one(a: &Path, b: &Path) -> bool {
    let [a, b] = [a, b].map(|p| fs::canonicalize(p).ok());
    a.is_some() && a == b
}

/// Names of the files below a folder, by their paths from it.
fn below(folder: &Path, prefix: &str) -> Vec<String> {
    let inner = |name: String| match folder.join(&name).is_dir() {
        true => below(&folder.join(&name), &format!("{prefix}{name}/")),
        false => vec![format!("{prefix}{name}")],
    };
    list(folder).into_iter().filter(|n| !n.starts_with(".tmp-")).flat_map(inner).collect()
}

/// The file that `--out` names, where a link leads to it; none of standard output, a device, a pipe.
fn file_at(path: &Path) -> Result<Option<Own>, BuildError> {
    if is_standard_output(path) || fs::metadata(path).is_ok_and(|there| !there.is_file()) {
        return Ok(None);
    }
    let path = linked(path)?;
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let base = path.parent().map(Path::to_path_buf).unwrap_or_default();
    Ok(Some(Own { base, name }))
}

impl Own {
    fn path(&self) -> PathBuf {
        self.base.join(&self.name)
    }

    fn place_of_digests(&self) -> PathBuf {
        self.base.join(KEPT).join(&self.name)
    }

    /// Digests with which the program left this file: two where it was stopped while it wrote.
    fn kept(&self) -> BTreeSet<String> {
        let text = fs::read_to_string(self.place_of_digests()).unwrap_or_default();
        text.lines().map(str::to_owned).collect()
    }

    fn keep(&self, digests: &BTreeSet<String>) -> Result<(), BuildError> {
        let lines: String = digests.iter().map(|d| format!("{d}\n")).collect();
        self.share_folder();
        put(&self.place_of_digests(), lines.as_bytes())
    }

    /// Who may write results beside each other may keep their digests, too: a new folder of digests has the permissions of that of the results.
    fn share_folder(&self) {
        let kept = self.base.join(KEPT);
        let base = if self.base.as_os_str().is_empty() { Path::new(".") } else { self.base.as_path() };
        let is_new = fs::create_dir_all(base).is_ok() && fs::create_dir(&kept).is_ok();
        if let Some(there) = fs::metadata(base).ok().filter(|_| is_new) {
            let _ = fs::set_permissions(&kept, there.permissions());
        }
    }

    /// The same; a digest that cannot be kept loses no result. The next command then asks for `--force`.
    fn keep_if_possible(&self, digests: &BTreeSet<String>) {
        if let Err(error) = self.keep(digests) {
            detail::tell(|| format!("the digest of {} is not kept: {error}", self.path().display()));
        }
    }

    /// The digest of what is there; none of no file and of an empty one, in which nothing can be lost.
    ///
    /// Errors: a file that cannot be read; nobody knows what would be lost.
    fn there(&self) -> Result<Option<String>, BuildError> {
        let path = self.path();
        let is_file = fs::metadata(&path).is_ok_and(|there| there.is_file() && there.len() > 0);
        if is_file { read(&path).map(|bytes| Some(hash(&bytes))) } else { Ok(None) }
    }

    /// Refuses to write over what is there, unless the program left it so, or it is what is to be written.
    fn is_free(&self, new: Option<&[u8]>) -> Result<(), BuildError> {
        let Some(there) = self.there()? else { return Ok(()) };
        let kept = self.kept();
        if kept.contains(&there) || new.is_some_and(|bytes| hash(bytes) == there) {
            return Ok(());
        }
        let path = self.path();
        let what = match kept.is_empty() {
            true => "is not known as the result of an earlier command",
            false => "was changed since it was written",
        };
        let told = format!(
            "{} {what}, so it is not written over; give another --out, move that file away, or add --force",
            path.display()
        );
        Err(BuildError::edited(&path, told))
    }

    /// Writes the file. Its digests are kept before and after, so that a run that is stopped leaves none which is taken for an edit.
    fn write(&self, bytes: &[u8]) -> Result<(), BuildError> {
        let new = BTreeSet::from([hash(bytes)]);
        let there = self.there().ok().flatten().filter(|there| !new.contains(there));
        self.keep_if_possible(&new.iter().cloned().chain(there.clone()).collect());
        put(&self.path(), bytes)?;
        if there.is_some() {
            self.keep_if_possible(&new);
        }
        Ok(())
    }
}

/// Writes one file under the rule; false where none holds for it, and nothing was done.
pub(super) fn wrote_file(path: &Path, bytes: &[u8]) -> Result<bool, BuildError> {
    let Some(rule) = rule(path, false) else { return Ok(false) };
    let Some(file) = file_at(path)? else { return Ok(false) };
    if !rule.force {
        file.is_free(Some(bytes))?;
    }
    file.write(bytes)?;
    Ok(true)
}

/// The same of files below a folder: all of them are looked at before the first is written.
pub(super) fn wrote_all(folder: &Path, files: &[(String, Vec<u8>)]) -> Result<bool, BuildError> {
    let Some(rule) = rule(folder, true) else { return Ok(false) };
    let result = |name: &String| Own { base: folder.to_path_buf(), name: name.clone() };
    for (name, bytes) in files.iter().filter(|_| !rule.force) {
        result(name).is_free(Some(bytes))?;
    }
    for (name, bytes) in files {
        result(name).write(bytes)?;
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store;

    /// Files of a folder; `text` is their content.
    fn files(text: &str) -> Vec<(String, Vec<u8>)> {
        ["a.json", "kla/b.csv"].map(|n| (n.to_owned(), format!("{n} {text}").into_bytes())).to_vec()
    }

    /// What such a command leaves in a folder.
    fn leaves() -> Leaves {
        Leaves { sure: ["a.json", "kla/b.csv"].map(String::from).to_vec(), perhaps: vec!["kla/c-*.csv".into()] }
    }

    fn place(out: &Path, is_folder: bool) -> PathBuf {
        if is_folder { out.to_path_buf() } else { out.join("a.json") }
    }

    /// The end of one command: into a folder, or into the file a.json of it.
    fn written(out: &Path, is_folder: bool, text: &str, force: bool) -> Result<(), BuildError> {
        let place = place(out, is_folder);
        Rule::holds(Some(Rule::of(&place, is_folder, force)), || match is_folder {
            true => store::write_all(&place, &files(text)),
            false => store::write(&place, &files(text)[0].1),
        })
    }

    /// One command, with the look before its work.
    fn command(out: &Path, is_folder: bool, text: &str, force: bool) -> Result<(), BuildError> {
        Rule::of(&place(out, is_folder), is_folder, force).is_free(&leaves())?;
        written(out, is_folder, text, force)
    }

    #[test]
    fn a_command_replaces_what_it_wrote_and_an_empty_file() {
        for is_folder in [true, false] {
            let folder = tempfile::tempdir().unwrap();
            store::write(&folder.path().join("a.json"), b"").unwrap();
            for text in ["one", "two", "two", "one"] {
                command(folder.path(), is_folder, text, false).unwrap();
                assert_eq!(read(&folder.path().join("a.json")).unwrap(), files(text)[0].1);
            }
            // the same bytes by another hand are no loss, which is known once there are new ones
            fs::remove_dir_all(folder.path().join(KEPT)).unwrap();
            assert!(command(folder.path(), is_folder, "one", false).is_err());
            written(folder.path(), is_folder, "one", false).unwrap();
            command(folder.path(), is_folder, "two", false).unwrap();
        }
    }

    #[test]
    fn no_edit_and_no_file_of_others_is_written_over_unless_forced() {
        for (is_folder, edited) in [(true, "a.json"), (true, "kla/b.csv"), (false, "a.json")] {
            for is_known in [true, false] {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join(edited);
                if is_known {
                    command(folder.path(), is_folder, "one", false).unwrap();
                }
                store::write(&path, b"by hand").unwrap();
                // before the work, and again when its results are to be written
                let looked = Rule::of(&place(folder.path(), is_folder), is_folder, false).is_free(&leaves());
                for error in [looked.unwrap_err(), written(folder.path(), is_folder, "two", false).unwrap_err()] {
                    let (told, advice) = (error.to_string(), crate::output::advice(&error));
                    assert!(told.contains(&path.display().to_string()) && told.contains("--force"), "{told}");
                    assert!(advice.contains("--force") && error.exit_status() == 1, "{advice}");
                    assert_eq!(read(&path).unwrap(), b"by hand");
                }
                // nothing else was begun
                let other = folder.path().join(if edited == "a.json" { "kla/b.csv" } else { "a.json" });
                assert!(!store::exists(&other) || read(&other).unwrap().ends_with(b"one"), "{edited}");
                command(folder.path(), is_folder, "two", true).unwrap();
                command(folder.path(), is_folder, "three", false).unwrap();
            }
        }
    }

    #[test]
    fn an_edit_is_told_before_the_work_and_a_stop_while_writing_is_none() {
        for is_folder in [true, false] {
            let folder = tempfile::tempdir().unwrap();
            command(folder.path(), is_folder, "one", false).unwrap();
            let place = place(folder.path(), is_folder);
            let looked = || Rule::of(&place, is_folder, false).is_free(&leaves());
            looked().unwrap();
            // stopped before, and behind, the file itself
            let file = Own { base: folder.path().to_path_buf(), name: "a.json".into() };
            let both = BTreeSet::from(["one", "two"].map(|text| hash(&files(text)[0].1)));
            file.keep(&both).unwrap();
            looked().unwrap();
            store::write(&file.path(), &files("two")[0].1).unwrap();
            looked().unwrap();
            store::write(&file.path(), b"by hand").unwrap();
            assert!(looked().is_err());
            Rule::of(&place, is_folder, true).is_free(&leaves()).unwrap();
        }
    }

    #[test]
    fn a_folder_stops_a_command_by_what_it_would_write_alone() {
        let names = ["a.json", "kla/b.csv", "kla/c-1.csv", "kla/d.csv", "c-1.csv"];
        for (name, is_known) in names.into_iter().flat_map(|name| [(name, true), (name, false)]) {
            let folder = tempfile::tempdir().unwrap();
            if is_known {
                let all = names.map(|n| (n.to_owned(), b"of a command".to_vec()));
                let rule = Rule::of(folder.path(), true, false);
                Rule::holds(Some(rule), || store::write_all(folder.path(), &all)).unwrap();
            }
            store::write(&folder.path().join(name), b"by hand").unwrap();
            let would = leaves().sure.iter().any(|n| n == name) || (is_known && name == "kla/c-1.csv");
            let looked = Rule::of(folder.path(), true, false).is_free(&leaves());
            assert_eq!(looked.is_err(), would, "{name}, known: {is_known}");
            let asked = |name: &str| {
                Rule::holds(Some(Rule::of(folder.path(), true, false)), || are_free(folder.path(), [name.to_owned()]))
            };
            assert!(asked(name).is_err() && asked("none.csv").is_ok(), "{name}");
            assert!(are_free(folder.path(), [name.to_owned()]).is_ok(), "no rule holds");
        }
    }

    #[test]
    fn a_pattern_is_of_names_with_both_of_its_ends() {
        let told = ["c/*-1.toml", "a.csv"]
            .map(|p| ["c/x-1.toml", "c/-1.toml", "c/x-2.toml", "x-1.toml", "a.csv"].map(|n| is_like(p, n)));
        assert_eq!(told, [[true, true, false, false, false], [false, false, false, false, true]]);
        assert!(!is_like("ab*ba", "aba"), "the ends must not share a letter");
    }

    #[test]
    fn a_digest_that_cannot_be_kept_loses_no_result() {
        for is_folder in [true, false] {
            let folder = tempfile::tempdir().unwrap();
            // a file in the way of their folder, as another person's folder is
            store::write(&folder.path().join(KEPT), b"notes").unwrap();
            command(folder.path(), is_folder, "one", false).unwrap();
            assert_eq!(read(&folder.path().join("a.json")).unwrap(), files("one")[0].1);
            assert!(command(folder.path(), is_folder, "two", false).is_err());
            command(folder.path(), is_folder, "two", true).unwrap();
            assert_eq!(read(&folder.path().join("a.json")).unwrap(), files("two")[0].1);
            assert_eq!(read(&folder.path().join(KEPT)).unwrap(), b"notes");
        }
    }

    #[test]
    #[cfg(unix)]
    fn who_may_write_a_result_beside_another_may_keep_its_digest() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        for mode in [0o777, 0o770] {
            let shared = folder.path().join(format!("{mode:o}"));
            fs::create_dir(&shared).unwrap();
            fs::set_permissions(&shared, fs::Permissions::from_mode(mode)).unwrap();
            command(&shared, false, "one", false).unwrap();
            let kept = fs::metadata(shared.join(KEPT)).unwrap().permissions().mode();
            assert_eq!(kept & 0o777, mode);
        }
    }

    #[test]
    fn a_rule_is_of_its_place_and_of_its_command() {
        let folder = tempfile::tempdir().unwrap();
        let [a, b] = ["a.csv", "b.csv"].map(|n| folder.path().join(n));
        store::write(&a, b"by hand").unwrap();
        store::write(&b, b"by hand").unwrap();
        Rule::holds(Some(Rule::of(&a, false, false)), || {
            assert!(store::write(&a, b"new").is_err());
            store::write(&b, b"new").unwrap();
        });
        store::write(&a, b"new").unwrap();
        // a folder may be named in more than one way
        let within = folder.path().join("within");
        store::make_folder(&within).unwrap();
        let roundabout = within.join("..").join("within");
        store::write(&within.join("a.json"), b"by hand").unwrap();
        let refused =
            Rule::holds(Some(Rule::of(&roundabout, true, false)), || store::write_all(&within, &files("one")));
        assert!(refused.is_err());
    }
}

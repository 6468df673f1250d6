//! The one door to the file system.
#![expect(clippy::disallowed_methods, reason = "the one door to the file system")]

pub mod given;
#[cfg(feature = "fetch")]
pub mod part;
pub mod written;

use crate::error::{BuildError, Place};
use crate::progress::detail;
use crate::suggested::{command, command_on};
use sim::names::did_you_mean;
use stages::specimen::{RawSpecimen, SpecimenFile};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Component, Path, PathBuf};

/// The largest file that is read [bytes]: ten times the largest scan in use.
const LARGEST_FILE: u64 = 2 << 30;

/// Reads a file whole; refuses one beyond [`LARGEST_FILE`].
pub fn read(path: &Path) -> Result<Vec<u8>, BuildError> {
    if let Some(bytes) = given::bytes(path) {
        return Ok(bytes);
    }
    let wrong = |why: String| BuildError::at(Place::of(path), format!("cannot read {}: {why}", path.display()));
    let failed = |e: std::io::Error| {
        fault(&e, path, format!("cannot read {}: {}{}", path.display(), words(&e), near_file(path, &e)))
    };
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if metadata.is_dir() {
        return Err(wrong("it is a folder, a file was expected".into()));
    }
    let mut bytes = Vec::new();
    file.take(LARGEST_FILE + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(wrong(format!("it is larger than {} GiB; is it the right file?", LARGEST_FILE >> 30)));
    }
    detail::tell(|| format!("reads {} ({} bytes)", path.display(), bytes.len()));
    Ok(bytes)
}

/// The folder that was most likely meant.
fn near_folder(path: &Path) -> String {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let known: Vec<String> = list(folder).into_iter().filter(|n| folder.join(n).is_dir()).collect();
    did_you_mean(&name, &known)
}

/// The file in the same folder that was most likely meant, where a file is not there.
fn near_file(path: &Path, e: &std::io::Error) -> String {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match e.kind() {
        std::io::ErrorKind::NotFound => did_you_mean(&name, &list(folder)),
        _ => String::new(),
    }
}

/// Reads a UTF-8 file.
pub fn read_text(path: &Path) -> Result<String, BuildError> {
    String::from_utf8(read(path)?).map_err(|e| {
        let told = format!("{}: not UTF-8 at byte {}", path.display(), e.utf8_error().valid_up_to());
        BuildError::at(Place::of(path), told)
    })
}

/// Reads the file called `name` in `folder`, whatever the case of its letters, as Abaqus on Windows would.
pub fn read_beside(folder: &Path, name: &str) -> Result<Vec<u8>, BuildError> {
    let name = name.replace('\\', "/");
    let exact = folder.join(&name);
    let place = if exact.exists() {
        exact
    } else {
        let parent = exact.parent().unwrap_or(folder).to_path_buf();
        let last = exact.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        list(&parent).into_iter().find(|n| n.eq_ignore_ascii_case(&last)).map_or(exact, |n| parent.join(n))
    };
    read(&place)
}

/// The first of `paths` that is a file; the last where none is.
pub fn first_that_exists(paths: &[PathBuf]) -> PathBuf {
    paths.iter().find(|p| p.is_file()).or(paths.last()).cloned().unwrap_or_default()
}

/// A folder beside `dir` that is not there: `knee-2`, `knee-3`, ...
pub fn free_beside(dir: &Path) -> PathBuf {
    let name = match dir.file_name() {
        Some(name) => name.to_string_lossy().into_owned(),
        None => "knee".into(),
    };
    let beside = |n: usize| match dir.file_name() {
        Some(_) => dir.with_file_name(format!("{name}-{n}")),
        None => dir.join(format!("{name}-{n}")),
    };
    (2..).map(beside).find(|place| !place.exists()).unwrap_or_else(|| beside(2))
}

/// The specimen's folder, where its build or one of its files is given in its place.
fn specimen_of(given: &Path) -> Option<PathBuf> {
    let inside = given.is_file() || (exists(&given.join("log.jsonl")) && !exists(&given.join("specimen.toml")));
    let above = given.parent().map(|p| if p.as_os_str().is_empty() { Path::new(".") } else { p });
    above.filter(|above| inside && exists(&above.join("specimen.toml"))).map(Path::to_path_buf)
}

/// Reads specimen.toml and every file it names that is there, relative to `folder`.
pub fn read_specimen(folder: &Path) -> Result<(SpecimenFile, RawSpecimen), BuildError> {
    if let Some(own) = specimen_of(folder) {
        let what = if folder.is_dir() { "the folder of a build" } else { "a file" };
        let told =
            format!("{} is {what}; expected the specimen's folder, which is {}", folder.display(), own.display());
        return Err(BuildError::of_file(folder, told));
    }
    if !folder.is_dir() {
        return Err(BuildError::of_file(
            folder,
            format!(
                "{} is not a specimen folder: no such folder{}; expected the folder that holds specimen.toml. A new one: {}",
                folder.display(),
                near_folder(folder),
                command_on("init", folder)
            ),
        ));
    }
    if !folder.join("specimen.toml").exists() {
        return Err(BuildError::of_file(
            folder,
            format!(
                "{} holds no specimen.toml; expected a specimen folder. Make one from these files: {}",
                folder.display(),
                command("init", [free_beside(folder).as_os_str(), OsStr::new("--from"), folder.as_os_str()])
            ),
        ));
    }
    let refuse = |e: stages::StageError| BuildError::of_stage("ingest", &e);
    let toml = stages::ingest::specimen_text(&read(&folder.join("specimen.toml"))?).map_err(refuse)?;
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let file = stages::ingest::parse_specimen_file(&toml).map_err(refuse)?;
    let is_there = |path: &str| inside(folder, path).is_some_and(|place| place.exists());
    stages::ingest::check_case(&file, is_there, |path| list(&folder.join(path))).map_err(refuse)?;
    let mut wanted = stages::ingest::paths_of(&file);
    wanted.extend(stages::ingest::OPTIONAL_PATHS.map(String::from));
    while let Some(path) = wanted.pop() {
        // What is missing is told by ingest, which knows who names it and whether it matters.
        let Some(place) = inside(folder, &path).filter(|p| p.exists() && !files.contains_key(&path)) else { continue };
        if Some(&path) == file.ct.volume.as_ref() && place.is_dir() {
            wanted.extend(series(&place, &path)?);
            continue;
        }
        if place.is_dir() {
            let what =
                format!("{path} is an empty folder; expected a file: put the file there, and name it in specimen.toml");
            return Err(refuse(stages::StageError::specimen(what)));
        }
        let bytes = read(&place)?;
        wanted.extend(stages::ingest::paths_named_in(&path, &bytes));
        files.insert(path, bytes);
    }
    Ok((file, RawSpecimen { toml, files }))
}

/// The paths of the files in a folder and the folders in it, as DICOM series lie: at most four deep and 20,000.
fn series(folder: &Path, name: &str) -> Result<Vec<String>, BuildError> {
    let mut found = Vec::new();
    let mut open = vec![(folder.to_path_buf(), name.trim_end_matches('/').to_string(), 0)];
    while let Some((place, name, depth)) = open.pop() {
        for entry in list(&place).into_iter().filter(|n| !n.starts_with('.')) {
            let (place, name) = (place.join(&entry), format!("{name}/{entry}"));
            if !place.is_dir() {
                found.push(name);
            } else if depth < 4 {
                open.push((place, name, depth + 1));
            }
        }
        if found.len() > 20_000 {
            return Err(BuildError::of_file(
                folder,
                format!("{}: more than 20000 files; expected the folder of one DICOM series", folder.display()),
            ));
        }
    }
    Ok(found)
}

/// `folder/path`, unless `path` leads out of the folder.
fn inside(folder: &Path, path: &str) -> Option<PathBuf> {
    let within = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
    within.then(|| folder.join(path))
}

/// A build's folder, locked against a second writer while the value lives.
pub struct BuildFolder {
    root: PathBuf,
    _lock: File,
}

impl BuildFolder {
    /// Opens or makes the folder, takes its lock, and sweeps what an interrupted build left behind.
    pub fn open(root: &Path) -> Result<BuildFolder, BuildError> {
        let wrong = |e: std::io::Error| fault(&e, root, format!("cannot write to {}: {}", root.display(), words(&e)));
        in_the_way(root)?;
        fs::create_dir_all(root).map_err(wrong)?;
        let lock = File::options().create(true).truncate(false).write(true).open(root.join(".lock")).map_err(wrong)?;
        lock.try_lock().map_err(|_| {
            let told = format!("another build-model is at work in {}; wait for it or give --out", root.display());
            BuildError::Machine { told, place: Some(Place::of(root)) }
        })?;
        for entry in fs::read_dir(root).map_err(wrong)?.flatten() {
            if entry.file_name().to_string_lossy().starts_with(".tmp-") {
                remove(&entry.path());
            }
        }
        Ok(BuildFolder { root: root.to_path_buf(), _lock: lock })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.root
    }

    /// Writes a file whole or not at all.
    pub fn write_file(&self, name: &str, bytes: &[u8]) -> Result<(), BuildError> {
        let temporary = self.root.join(format!(".tmp-{name}"));
        let result = fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, self.root.join(name)));
        result.map_err(|e| {
            remove(&temporary);
            let place = self.root.join(name);
            fault(&e, &place, format!("cannot write {}: {}", place.display(), words(&e)))
        })
    }

    /// Replaces the folder `name` by one with `files` in it, whole or not at all.
    pub fn write_folder(&self, name: &str, files: &[(String, Vec<u8>)]) -> Result<(), BuildError> {
        detail::tell(|| format!("writes {} ({} files)", self.root.join(name).display(), files.len()));
        let temporary = self.root.join(format!(".tmp-{name}"));
        let target = self.root.join(name);
        let result = fill(&temporary, files).and_then(|()| {
            let old = self.root.join(format!(".tmp-{name}-old"));
            if target.exists() {
                fs::rename(&target, &old)?;
            }
            fs::rename(&temporary, &target)?;
            remove(&old);
            Ok(())
        });
        result.map_err(|e| {
            remove(&temporary);
            fault(&e, &target, format!("cannot write {}: {}", target.display(), words(&e)))
        })
    }

    /// The files of the folder `name`, by path below it; `None` where it cannot be read.
    pub fn read_folder(&self, name: &str) -> Option<BTreeMap<String, Vec<u8>>> {
        let mut files = BTreeMap::new();
        gather(&self.root.join(name), "", &mut files)?;
        Some(files)
    }

    /// A file of the build; `None` where it cannot be read.
    pub fn read_file(&self, name: &str) -> Option<Vec<u8>> {
        fs::read(self.root.join(name)).ok()
    }
}

fn fill(folder: &Path, files: &[(String, Vec<u8>)]) -> std::io::Result<()> {
    remove(folder);
    fs::create_dir_all(folder)?;
    for (name, bytes) in files {
        let path = folder.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)?;
        }
        let mut file = File::create(&path)?;
        file.write_all(bytes)?;
        file.flush()?;
    }
    Ok(())
}

fn gather(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) -> Option<()> {
    for entry in fs::read_dir(folder).ok()? {
        let entry = entry.ok()?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type().ok()?.is_dir() {
            gather(&entry.path(), &format!("{name}/"), files)?;
        } else {
            files.insert(name, fs::read(entry.path()).ok()?);
        }
    }
    Some(())
}

/// A file that stands where a folder is wanted, at the path or above it.
fn in_the_way(path: &Path) -> Result<(), BuildError> {
    if is_standard_output(path) {
        let told = "- is standard output, and a folder was expected; name one, or ./- for a folder of that name";
        return Err(BuildError::Usage(told.into()));
    }
    let leads_nowhere = |p: &&Path| p.is_symlink() && !p.exists();
    if let Some(link) = path.ancestors().find(leads_nowhere) {
        let to = fs::read_link(link).map(|to| to.display().to_string()).unwrap_or_default();
        let told = format!(
            "cannot write to {}: the link {} leads to {to}, which is not there; make it, or name another folder",
            path.display(),
            link.display()
        );
        return Err(BuildError::of_file(link, told));
    }
    match path.ancestors().find(|p| p.exists()).filter(|p| !p.is_dir()) {
        None => Ok(()),
        Some(file) => Err(BuildError::of_file(
            file,
            format!(
                "cannot write to {}: {} is a file, a folder was expected; name another, or move the file away",
                path.display(),
                file.display()
            ),
        )),
    }
}

/// Refuses a path at which no folder can be: a file stands there or above it.
pub(crate) fn may_be_folder(path: &Path) -> Result<(), BuildError> {
    in_the_way(path)
}

/// Refuses a path at which no file can be: a folder stands there.
pub(crate) fn may_be_file(path: &Path) -> Result<(), BuildError> {
    if !is_standard_output(path) && path.is_dir() {
        return Err(BuildError::of_file(path, format!("cannot write {}: it is a folder, name a file", path.display())));
    }
    Ok(())
}

/// Writes files below `folder`, making folders as needed (for commands whose output is not a build). Under a [`written::Rule`] of the folder
/// all of them are looked at before.
pub fn write_all(folder: &Path, files: &[(String, Vec<u8>)]) -> Result<(), BuildError> {
    in_the_way(folder)?;
    if written::wrote_all(folder, files)? {
        return Ok(());
    }
    for (name, bytes) in files {
        write(&folder.join(name), bytes)?;
    }
    Ok(())
}

/// Writes one file whole or not at all, making its folder as needed. A link is followed, `-` is standard output, and a device or a pipe is
/// written to: nothing that is not a file is replaced by one. A [`written::Rule`] of the file holds.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), BuildError> {
    if written::wrote_file(path, bytes)? { Ok(()) } else { put(path, bytes) }
}

/// Writes one file, whatever stands there.
fn put(path: &Path, bytes: &[u8]) -> Result<(), BuildError> {
    detail::tell(|| format!("writes {} ({} bytes)", path.display(), bytes.len()));
    let wrong = |e: std::io::Error| fault(&e, path, format!("cannot write {}: {}", path.display(), words(&e)));
    if is_standard_output(path) {
        return print(bytes);
    }
    may_be_file(path)?;
    match fs::metadata(path) {
        // a pipe among them, whose link leads to no path
        Ok(there) if !there.is_file() => {
            let device = File::options().write(true).open(path);
            return device.and_then(|mut d| d.write_all(bytes)).map_err(wrong);
        }
        _ => {}
    }
    let path = &linked(path)?;
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(parent).map_err(wrong)?;
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let temporary = parent.join(format!(".tmp-{name}"));
    fs::write(&temporary, bytes).and_then(|()| fs::rename(&temporary, path)).map_err(|e| {
        remove(&temporary);
        wrong(e)
    })
}

/// Writes to standard output. A reader that has seen enough (`| head`) is no fault.
///
/// # Errors
/// The machine's: a full disk behind it.
pub fn print(bytes: &[u8]) -> Result<(), BuildError> {
    let mut out = std::io::stdout();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            let told = format!("cannot write to standard output: {}", words(&e));
            Err(BuildError::Machine { told, place: None })
        }
        _ => Ok(()),
    }
}

/// Whether a path stands for standard output.
pub fn is_standard_output(path: &Path) -> bool {
    path == Path::new("-")
}

/// Where a link leads, also one that leads to a file which is not there yet; the path itself where it is none.
fn linked(path: &Path) -> Result<PathBuf, BuildError> {
    let mut place = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let Ok(next) = fs::read_link(&place) else { return Ok(place) };
        place = place.parent().unwrap_or(Path::new("")).join(next);
    }
    let told = format!("cannot write {}: its links lead round in a ring; name another file", path.display());
    Err(BuildError::of_file(path, told))
}

/// Most links that are followed one after another, as Linux has it [-].
const MOST_LINKS: usize = 40;

/// A fault of the file that is named, or, of any other kind, of the machine.
fn fault(e: &std::io::Error, path: &Path, told: String) -> BuildError {
    use std::io::ErrorKind::{IsADirectory, NotADirectory, NotFound, UnexpectedEof};
    match e.kind() {
        NotFound | IsADirectory | NotADirectory | UnexpectedEof => BuildError::at(Place::of(path), told),
        _ => BuildError::Machine { told, place: Some(Place::of(path)) },
    }
}

/// The path without links and dots; its folder must exist.
pub fn absolute(path: &Path) -> Result<PathBuf, BuildError> {
    let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
    path.canonicalize().map_err(|e| fault(&e, path, format!("cannot read {}: {}", path.display(), words(&e))))
}

/// Makes a folder and those above it; gives it without links and dots.
pub fn make_folder(path: &Path) -> Result<PathBuf, BuildError> {
    in_the_way(path)?;
    fs::create_dir_all(path)
        .map_err(|e| fault(&e, path, format!("cannot write to {}: {}", path.display(), words(&e))))?;
    absolute(path)
}

/// Removes a file where there is one.
pub fn discard(path: &Path) {
    remove(path);
}

/// Whether a path exists.
pub fn exists(path: &Path) -> bool {
    given::is(path) || path.exists()
}

/// Whether a path is a folder.
pub fn is_folder(path: &Path) -> bool {
    path.is_dir()
}

/// The day on which a file was written, as `2026-11-27` (UTC); `None` where the system does not tell.
pub fn written_on(path: &Path) -> Option<String> {
    let written = fs::metadata(path).ok()?.modified().ok()?;
    let seconds = written.duration_since(std::time::UNIX_EPOCH).ok()?.as_secs();
    Some(day(seconds / SECONDS_A_DAY))
}

const SECONDS_A_DAY: u64 = 86_400;

/// The date so many days after 1970-01-01.
fn day(mut days: u64) -> String {
    let is_leap = |y: u64| y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(is_leap(year)) {
        days -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(is_leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 1;
    for length in lengths {
        if days < length {
            break;
        }
        days -= length;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", days + 1)
}

/// Names in a folder, ascending; empty where it cannot be read.
pub fn list(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Files below a folder with their sizes in bytes, by their paths from it, ascending; empty where it cannot be read.
pub fn sizes(folder: &Path) -> Vec<(String, u64)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        match entry.metadata() {
            Ok(data) if data.is_dir() => {
                found.extend(sizes(&entry.path()).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)));
            }
            Ok(data) => found.push((name, data.len())),
            Err(_) => {}
        }
    }
    found.sort();
    found
}

/// Sets the process' peak memory back to what it uses now, where the system allows it.
pub fn reset_peak_memory() {
    let _ = fs::write("/proc/self/clear_refs", "5");
}

/// The process' peak memory since the last reset [MiB], where the system tells it.
pub fn peak_memory_mib() -> Option<f64> {
    status_mib("VmHWM:")
}

/// The process' memory now [MiB], where the system tells it.
pub fn memory_mib() -> Option<f64> {
    status_mib("VmRSS:")
}

fn status_mib(key: &str) -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with(key))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}

fn remove(path: &Path) {
    let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
}

fn words(e: &std::io::Error) -> String {
    match e.kind() {
        std::io::ErrorKind::NotFound => "no such file".into(),
        std::io::ErrorKind::PermissionDenied => "no permission".into(),
        std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
            "the disk is full; free some space or give --out on another disk".into()
        }
        std::io::ErrorKind::FileTooLarge => {
            "the file would be larger than this machine allows (ulimit -f); raise that limit or give --out on another disk".into()
        }
        _ => e.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::day;

    #[test]
    fn days_are_dates_also_about_leap_years() {
        let dates = [0, 58, 59, 789, 790, 11_016, 20_784].map(day);
        let known = ["1970-01-01", "1970-02-28", "1970-03-01", "1972-02-29", "1972-03-01", "2000-02-29", "2026-11-27"];
        assert_eq!(dates, known);
    }
}

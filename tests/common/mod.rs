//! What the whole-path tests share: a synthetic specimen, the program, and the shared data where it is.
#![allow(dead_code, reason = "each test binary uses its part")]
#![expect(clippy::disallowed_methods, reason = "tests prepare and look at files")]
#![allow(clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used, reason = "tests")]

pub(crate) mod lines;
pub(crate) mod phantoms;
pub(crate) mod readers;
mod shared;

pub(crate) use shared::shared;

use assert_cmd::Command;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::TempDir;

/// The program.
pub(crate) fn build_model() -> Command {
    Command::cargo_bin("build-model").expect("the program is built with the tests")
}

/// A phantom in a folder of its own.
pub(crate) fn phantom(id: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in &phantoms::made(id).files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    folder
}

/// A phantom with all of its stages built, once a run; its stages' folders stay as they are.
pub(crate) fn built() -> &'static Path {
    static BUILT: OnceLock<TempDir> = OnceLock::new();
    BUILT
        .get_or_init(|| {
            let folder = phantom("S192803-phantom");
            build_model().arg(folder.path()).arg("--quiet").assert().success();
            folder
        })
        .path()
}

/// Every file below `folder` by path, without what tells the time.
pub(crate) fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    gather(folder, "", &mut found);
    found.remove("log.jsonl");
    found
}

fn gather(folder: &Path, prefix: &str, found: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type().unwrap().is_dir() {
            gather(&entry.path(), &format!("{name}/"), found);
        } else {
            found.insert(name, fs::read(entry.path()).unwrap());
        }
    }
}

/// Names of the files that differ.
pub(crate) fn differing(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    a.keys().chain(b.keys()).filter(|name| a.get(*name) != b.get(*name)).cloned().collect()
}

/// The text of a file.
pub(crate) fn text(path: &Path) -> String {
    String::from_utf8(fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))).unwrap()
}

/// A JSON file.
pub(crate) fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&text(path)).unwrap()
}

/// Writes a file.
pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::write(path, bytes).unwrap();
}

/// A table with one of `every` rows, from the first on, and with those of the names `kept`.
pub(crate) fn thinned(table: &str, every: usize, kept: &[&str]) -> String {
    let named = |line: &str| kept.contains(&line.split(',').next().unwrap());
    let stays = |n: usize, line: &str| n == 0 || n % every == 1 % every || named(line);
    table.lines().enumerate().filter(|(n, line)| stays(*n, line)).map(|(_, line)| format!("{line}\n")).collect()
}

/// Reads a file.
pub(crate) fn read(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap()
}

/// Copies a folder.
pub(crate) fn copy(from: &Path, to: &Path) {
    for (name, bytes) in files(from) {
        let path = to.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

/// The Python that has the libraries of other people: `GENU_PYTHON`, or python3.
fn python() -> String {
    std::env::var("GENU_PYTHON").unwrap_or_else(|_| "python3".into())
}

/// Runs a script of tests/exports; false, with a word on why, where a reader is not installed.
pub(crate) fn reads(test: &str, script: &str, arguments: &[&str]) -> bool {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/exports").join(script);
    let Ok(run) = std::process::Command::new(python()).arg(script).args(arguments).output() else {
        eprintln!("{test}: skipped, {} is not there", python());
        return false;
    };
    let (said, faults) = (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    print!("{said}");
    if run.status.code() == Some(77) {
        eprintln!("{test}: skipped, {said}");
        return false;
    }
    assert!(run.status.success(), "{said}{faults}");
    true
}

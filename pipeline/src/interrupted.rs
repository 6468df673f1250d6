//! Ctrl-C at the command line: what is kept of the work, and how to go on.
#![expect(clippy::print_stderr, reason = "the command line talks to the person at it")]

use crate::inspect;
use crate::quoted::word;
use crate::stage::parts;
use crate::store;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The exit status of a command that was interrupted.
pub const STATUS: i32 = 130;

/// Work that goes on where it was.
#[derive(Clone, Debug)]
enum AtWork {
    /// A build, by its folder.
    Build(PathBuf),
    /// A search that keeps its state in this file.
    Search(PathBuf),
}

static AT_WORK: Mutex<Option<AtWork>> = Mutex::new(None);

/// From now on Ctrl-C ends the process with a word. The second call in a process does nothing.
pub fn listen() {
    let _ = ctrlc::set_handler(|| {
        let at_work = AT_WORK.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let command: Vec<String> = std::env::args().skip(1).collect();
        eprintln!("\nbuild-model: interrupted. {}", words(at_work.as_ref(), &command));
        std::process::exit(STATUS);
    });
}

/// A build works in `folder`; as long as what is given back lives.
pub fn building(folder: &Path) -> impl Drop + use<> {
    Told::of(AtWork::Build(folder.to_path_buf()))
}

/// A search keeps its state in `file`.
pub fn searching(file: &Path) -> impl Drop + use<> {
    Told::of(AtWork::Search(file.to_path_buf()))
}

struct Told;

impl Told {
    fn of(work: AtWork) -> Told {
        *AT_WORK.lock().unwrap_or_else(PoisonError::into_inner) = Some(work);
        Told
    }
}

impl Drop for Told {
    fn drop(&mut self) {
        *AT_WORK.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

fn words(at_work: Option<&AtWork>, command: &[String]) -> String {
    match at_work {
        None => "Nothing is kept of this command".into(),
        Some(AtWork::Search(file)) if store::exists(file) => {
            format!("The search is kept in {}. Go on: {}", file.display(), again(command))
        }
        Some(AtWork::Search(_)) => {
            "Nothing is kept of this search: it had not come to a point at which it can go on".into()
        }
        Some(AtWork::Build(folder)) => {
            let records = inspect::records(folder).unwrap_or_default();
            let done: Vec<&str> = records.iter().filter(|r| !r.outdated).map(|r| r.stage.as_str()).collect();
            let parts = parts::kept(folder);
            let mut kept = match done.last() {
                None => "No stage is finished".to_owned(),
                Some(last) => format!("Kept in {}: {} stages, up to {last}", folder.display(), done.len()),
            };
            if !parts.is_empty() {
                kept += &format!(", and of the stage at work {}", parts.join(", "));
            }
            format!("{kept}. Go on: {}", again(command))
        }
    }
}

/// The command that goes on: as it was given, without what would begin anew.
fn again(command: &[String]) -> String {
    let mut out = vec!["build-model".to_owned()];
    let mut words = command.iter();
    while let Some(w) = words.next() {
        match w.as_str() {
            "--force" => {}
            "--from" => drop(words.next()),
            w if w.starts_with("--from=") => {}
            w => out.push(word(w)),
        }
    }
    out.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_that_goes_on_does_not_begin_anew() {
        let given = ["build", "my knee", "--force", "--from", "bones", "--set", "bones.edge_mm=2"].map(String::from);
        assert_eq!(again(&given), "build-model build 'my knee' --set bones.edge_mm=2");
        assert!(words(None, &given).contains("Nothing is kept"));
        let none = AtWork::Search("/nowhere/checkpoint.cbor".into());
        assert!(words(Some(&none), &given).contains("Nothing is kept"));
        let none = AtWork::Build("/nowhere".into());
        assert!(words(Some(&none), &given).starts_with("No stage is finished. Go on: build-model build 'my knee'"));
    }
}

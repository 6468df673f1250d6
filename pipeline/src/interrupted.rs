//! Ctrl-C at the command line: what is kept of the work, and how to go on.
#![expect(clippy::print_stderr, reason = "the command line talks to the person at it")]

use crate::suggested::command;
use std::sync::{Arc, Mutex, PoisonError};

/// The exit status of a command that was interrupted.
pub const STATUS: i32 = 130;

/// What is kept at the moment, in words; `None` where nothing is.
type Kept = Arc<dyn Fn() -> Option<String> + Send + Sync>;

static AT_WORK: Mutex<Option<Kept>> = Mutex::new(None);

/// From now on Ctrl-C ends the process with a word about `command`, without the program's name. The second call in a process does nothing.
pub fn listen(command: Vec<String>) {
    let _ = ctrlc::set_handler(move || {
        let at_work = AT_WORK.lock().unwrap_or_else(PoisonError::into_inner).clone();
        eprintln!("\nbuild-model: interrupted. {}", words(at_work.and_then(|kept| kept()), &command));
        std::process::exit(STATUS);
    });
}

/// Work is going on of which `kept` tells what is kept, as long as what is given back lives.
pub fn working(kept: impl Fn() -> Option<String> + Send + Sync + 'static) -> AtWork {
    *AT_WORK.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(kept));
    AtWork
}

/// Work that is going on.
pub struct AtWork;

impl Drop for AtWork {
    fn drop(&mut self) {
        *AT_WORK.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

fn words(kept: Option<String>, command: &[String]) -> String {
    match kept {
        None => "Nothing is kept of this command".into(),
        Some(kept) => format!("{kept}. Go on: {}", again(command)),
    }
}

/// The command that goes on: as it was given, without what would begin anew. `--force` begins a build anew; to `calibrate` it says what may
/// be written over.
fn again(given: &[String]) -> String {
    let mut out = Vec::new();
    let mut words = given.iter();
    let is_search = given.first().is_some_and(|verb| verb == "calibrate");
    while let Some(w) = words.next() {
        match w.as_str() {
            "--anew" => {}
            "--force" if !is_search => {}
            "--from" => {
                words.next();
            }
            w if w.starts_with("--from=") => {}
            w => out.push(w),
        }
    }
    match out.split_first() {
        Some((first, rest)) => command(first, rest),
        None => command("build", [] as [&str; 0]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_that_goes_on_does_not_begin_anew() {
        let given = ["build", "my knee", "--force", "--from", "bones", "--set", "bones.edge_mm=2"].map(String::from);
        assert_eq!(
            words(Some("Kept in my knee/build".into()), &given),
            "Kept in my knee/build. Go on: build-model build 'my knee' --set bones.edge_mm=2"
        );
        assert!(words(None, &given).contains("Nothing is kept"));
        let search = ["calibrate", "knee", "--force", "--targets", "kla.csv", "--anew", "--out", "c"].map(String::from);
        let told = words(Some("The search is kept".into()), &search);
        assert!(told.ends_with("build-model calibrate knee --force --targets kla.csv --out c"), "{told}");
    }
}

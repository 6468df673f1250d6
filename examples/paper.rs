//! Writes docs/paper.md: the paper's tables beside ours, from its own parameters on its own knee.
//!
//! `cargo run --release --example paper -- [--check] [--builds BUILDS] [SHARED]`: SHARED holds the published data (../shared). BUILDS holds finished builds
//! called S192803 and S193761 (those of `--example results`); with it the part about our own calibrations is written anew, else it is kept.
//! `--check` writes nothing: it compares the page with what the program says, and fails where a word differs or a number by more than its last digit shows.
#![expect(clippy::print_stderr, clippy::print_stdout, reason = "says what was found")]

use genu::error::BuildError;
use genu::{paper, stale, store};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut args: Vec<String> = std::env::args().skip(1).collect();
    let check = args.iter().position(|a| a == "--check").map(|at| args.remove(at)).is_some();
    let builds = args.iter().position(|a| a == "--builds").filter(|at| at + 1 < args.len()).map(|at| {
        args.remove(at);
        PathBuf::from(args.remove(at))
    });
    let shared = PathBuf::from(args.first().map_or("../shared", String::as_str));
    if !store::exists(&shared.join("published/S192803")) {
        println!("paper: skipped, {} is not there", shared.join("published/S192803").display());
        return ExitCode::SUCCESS;
    }
    match run(&shared, builds.as_deref(), check) {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(e) => {
            eprintln!("{e}");
            ExitCode::FAILURE
        }
    }
}

fn run(shared: &Path, builds: Option<&Path>, check: bool) -> Result<String, BuildError> {
    let old = store::read_text(Path::new(paper::PAGE)).unwrap_or_default();
    let (old_first, old_second) = old.split_once(paper::BUILDS).unwrap_or((&old, ""));
    let (first, drawn) = paper::published_part(shared)?;
    if check {
        let told = stale::differences(old_first, &first);
        return match told.first() {
            None => Ok(format!("{} says what the program says\n", paper::PAGE)),
            Some(_) => Err(BuildError::File(format!(
                "{} is older than the program; write it anew with `cargo run --release --example paper`:\n{}",
                paper::PAGE,
                told.join("\n")
            ))),
        };
    }
    let (second, more) = match builds {
        Some(builds) => paper::calibrated_part(builds, shared)?,
        None => (old_second.to_owned(), vec![]),
    };
    let page = if second.trim().is_empty() { first } else { first + paper::BUILDS + &second };
    store::write(Path::new(paper::PAGE), page.as_bytes())?;
    for (name, bytes) in drawn.into_iter().chain(more) {
        store::write(&Path::new("docs/pictures").join(name), &bytes)?;
    }
    Ok(format!("{} is written\n", paper::PAGE))
}

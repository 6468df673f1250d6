//! Feeds a reader corrupted files for a while, and stops at the first that makes it panic, hang, or take memory beyond what the bytes warrant.
//!
//! `cargo run --release --example fuzz -- READER MINUTES [SEED]`; without a reader it lists them. A reader that kills the process leaves the file in
//! `fuzz-READER.bin`, which becomes a case of tests/readers.rs. Under `ulimit -v 600000` memory that is asked for and never touched counts too.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "says what it found")]

#[path = "../tests/common/readers.rs"]
mod readers;

use genu::store::{self, memory_mib, peak_memory_mib, reset_peak_memory};
use readers::{Dice, Reader, corrupted, readers};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Longest for one file [s].
const LONGEST: u64 = 10;
/// Memory beyond ten times the file [MiB].
const MEMORY: f64 = 64.0;
/// Corrupted files that were read and are corrupted further.
const POOL: usize = 64;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let all = readers();
    let known: Vec<&str> = all.iter().map(|r| r.name).collect();
    let (Some(reader), Some(minutes)) =
        (all.iter().find(|r| args.first().is_some_and(|a| a == r.name)), args.get(1).and_then(|m| m.parse().ok()))
    else {
        eprintln!("usage: fuzz READER MINUTES [SEED]; READER is one of {}", known.join(", "));
        return ExitCode::from(2);
    };
    let seed = args.get(2).and_then(|s| s.parse().ok()).unwrap_or(1);
    fuzz(reader, minutes, seed)
}

/// The file at work and since when, for the eye that watches the clock.
struct Watched {
    file: Mutex<Vec<u8>>,
    since: AtomicU64,
}

fn fuzz(reader: &Reader, minutes: f64, seed: u64) -> ExitCode {
    let start = Instant::now();
    let place = PathBuf::from(format!("fuzz-{}.bin", reader.name));
    let watched = Arc::new(Watched { file: Mutex::new(Vec::new()), since: AtomicU64::new(0) });
    watch(watched.clone(), start, place.clone());
    let mut dice = Dice(seed);
    let mut pool = reader.corpus.clone();
    let (mut tried, mut taken, mut slowest, mut most) = (0_u64, 0_u64, 0.0_f64, 0.0_f64);
    while start.elapsed().as_secs_f64() < 60.0 * minutes {
        let parent = dice.below(pool.len());
        let bytes = corrupted(&pool[parent], &mut dice);
        if let Ok(mut file) = watched.file.lock() {
            file.clone_from(&bytes);
        }
        reset_peak_memory();
        let before = memory_mib().unwrap_or(0.0);
        watched.since.store(start.elapsed().as_millis() as u64 + 1, Ordering::SeqCst);
        let began = Instant::now();
        let result = std::panic::catch_unwind(|| (reader.read)(&bytes));
        let seconds = began.elapsed().as_secs_f64();
        watched.since.store(0, Ordering::SeqCst);
        let grown = (peak_memory_mib().unwrap_or(0.0) - before).max(0.0);
        tried += 1;
        (slowest, most) = (slowest.max(seconds), most.max(grown));
        let limit = MEMORY + 10.0 * bytes.len() as f64 / 1_048_576.0;
        let Ok(read) = result else { return found(&place, &bytes, "panic") };
        if grown > limit {
            return found(&place, &bytes, &format!("{grown:.0} MiB for {} bytes", bytes.len()));
        }
        if read {
            taken += 1;
            let at = reader.corpus.len() + dice.below(POOL);
            match pool.get_mut(at) {
                Some(old) => *old = bytes,
                None => pool.push(bytes),
            }
        }
    }
    println!(
        "{}: {tried} files in {minutes} minutes from seed {seed}, {taken} read, slowest {slowest:.3} s, most memory {most:.1} MiB",
        reader.name
    );
    ExitCode::SUCCESS
}

/// Ends the process when one file takes too long.
fn watch(watched: Arc<Watched>, start: Instant, place: PathBuf) {
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let since = watched.since.load(Ordering::SeqCst);
            if since > 0 && start.elapsed().as_millis() as u64 > since + 1000 * LONGEST {
                let bytes = watched.file.lock().map(|f| f.clone()).unwrap_or_default();
                found(&place, &bytes, &format!("more than {LONGEST} s"));
                std::process::exit(1);
            }
        }
    });
}

fn found(place: &std::path::Path, bytes: &[u8], what: &str) -> ExitCode {
    eprintln!("{what}: the file is {}", place.display());
    if let Err(e) = store::write(place, bytes) {
        eprintln!("{e}");
    }
    ExitCode::FAILURE
}

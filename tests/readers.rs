//! Every reader on corrupted files: an answer or an error, soon and in little memory. Longer: `cargo run --release --example fuzz`.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use crate::common::readers::{Dice, corrupted, readers};
use genu::store::peak_memory_mib;
use std::time::Instant;

const EACH: usize = 400;

#[test]
fn corrupted_files_are_refused_or_read() {
    for reader in readers() {
        let before = peak_memory_mib().unwrap_or(0.0);
        let mut taken = 0;
        for (k, file) in reader.corpus.iter().enumerate() {
            let mut dice = Dice(1000 + k as u64);
            for i in 0..EACH {
                let bytes = corrupted(file, &mut dice);
                let start = Instant::now();
                taken += usize::from((reader.read)(&bytes));
                let seconds = start.elapsed().as_secs_f64();
                assert!(seconds < 10.0, "{} {k} {i}: {seconds:.1} s", reader.name);
            }
        }
        let grown = peak_memory_mib().unwrap_or(0.0) - before;
        println!("{}: {taken} of {} read, {grown:.0} MiB", reader.name, EACH * reader.corpus.len());
        assert!(grown <= 65.0, "{}: memory grew by {grown:.0} MiB", reader.name);
    }
}

#[test]
fn the_files_they_come_from_are_read() {
    for reader in readers() {
        for (k, file) in reader.corpus.iter().enumerate() {
            // The second deck holds more keywords and no whole knee.
            assert_eq!((reader.read)(file), (reader.name, k) != ("inp", 1), "{} {k}", reader.name);
        }
    }
}

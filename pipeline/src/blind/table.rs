//! Scores in words.

use super::regret::{middle, words};
use blindbench::score::{Score, Share};

/// A share in words: its name, its count, its interval.
fn line(name: &str, share: &Share) -> String {
    let (low, high) = share.interval();
    format!(
        "{name:<44} {:>4} of {:<4} {:>5.1} % (95 %: {:.1} to {:.1})\n",
        share.hits,
        share.of,
        100.0 * share.hits as f64 / share.of.max(1) as f64,
        100.0 * low,
        100.0 * high
    )
}

/// Whether weights are to be believed, in words; nothing where no answer was given.
fn reliability(s: &Score) -> String {
    let Some(error) = s.calibration_error else { return String::new() };
    let mut out = format!(
        "weights: expected calibration error {error:.2}; of answers that were given a weight, those that say just what is hidden\n"
    );
    for bin in &s.reliability {
        out += &line(&format!("weight {:.1} to {:.1}, mean {:.2}: right", bin.from, bin.to, bin.weight), &bin.right);
    }
    out
}

pub(super) fn table(s: &Score) -> String {
    let mut out = words(&s.regrets);
    out.extend(s.shares.iter().map(|(name, share)| line(name, share)));
    if !s.beside.is_empty() {
        let [half, most] = [0.5, 0.9].map(|part| middle(&s.beside, part));
        out += &format!(
            "states reported beside the truth, of cuts and whole knees: median {half:.0}, nine of ten to {most:.0}\n"
        );
    }
    out += &reliability(s);
    out += &format!(
        "size error: median {:.2}; gap closed (strong): median {:.2}, lower quartile {:.2}\n",
        middle(&s.size_errors, 0.5),
        middle(&s.closed, 0.5),
        middle(&s.closed, 0.25)
    );
    out.extend(s.failures.iter().map(|f| format!("failed: {f}\n")));
    out
}

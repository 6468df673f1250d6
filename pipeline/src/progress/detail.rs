//! `--verbose`: what a command does while it works, line by line on standard error.
#![expect(clippy::print_stderr, reason = "the command line talks to the person at it")]

use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Long work tells how far it is no more often than this: a search alone has thousands of steps.
const SELDOM: Duration = Duration::from_secs(1);

static BEGUN: OnceLock<Instant> = OnceLock::new();
static LAST_STEP: Mutex<Option<Instant>> = Mutex::new(None);

/// From now on this process tells details.
pub fn begin(program: &str) {
    let _ = BEGUN.set(Instant::now());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    tell(|| format!("build-model {program}, {cores} cores"));
}

/// Whether details are told.
pub fn is_on() -> bool {
    BEGUN.get().is_some()
}

/// A detail.
pub fn tell(what: impl FnOnce() -> String) {
    if let Some(begun) = BEGUN.get() {
        eprint!("{}", line(begun.elapsed(), &what()));
    }
}

/// How far long work is.
pub fn step(what: impl FnOnce() -> String) {
    if !is_on() {
        return;
    }
    let mut last = LAST_STEP.lock().unwrap_or_else(PoisonError::into_inner);
    if last.is_none_or(|at| at.elapsed() >= SELDOM) {
        *last = Some(Instant::now());
        tell(what);
    }
}

/// The end of the command; its peak memory since the last stage [MiB], where the system tells it.
pub fn end(status: u8, peak_mib: Option<f64>) {
    let peak = peak_mib.map(|mib| format!(", {mib:.0} MiB at most since the last stage")).unwrap_or_default();
    tell(|| format!("ends with {status}{peak}"));
}

/// "   1.25 s  reads a.csv": seconds since the command began.
fn line(elapsed: Duration, what: &str) -> String {
    format!("{:8.2} s  {what}\n", elapsed.as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_worked_out_for_details_that_nobody_wants() {
        assert!(!is_on());
        tell(|| unreachable!("a detail"));
        step(|| unreachable!("a step"));
        assert_eq!(line(Duration::from_millis(1250), "reads a"), "    1.25 s  reads a\n");
    }
}

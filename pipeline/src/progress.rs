//! Progress on standard error, and only where that is a terminal.

use crate::run_log::{Record, STAGES};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;

/// A bar over the stages, or nothing.
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar, hidden when `quiet` or when standard error is not a terminal.
    pub fn new(quiet: bool) -> Progress {
        let visible = !quiet && std::io::stderr().is_terminal();
        let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(STAGES.len() as u64), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:20} {pos}/{len} {msg} {elapsed}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar }
    }

    /// A stage begins.
    pub fn start(&self, stage: &str) {
        self.bar.set_message(stage.to_string());
    }

    /// A line above the bar.
    pub fn note(&self, line: &str) {
        self.bar.println(line);
    }

    /// Tells how far a long stage has come, beside the bar.
    pub fn teller(&self) -> impl Fn(&str) + use<> {
        let bar = self.bar.clone();
        move |words| bar.set_message(words.to_string())
    }

    /// A stage is done.
    pub fn done(&self, record: &Record) {
        self.bar.inc(1);
        let state = if record.cached { "unchanged".to_string() } else { format!("{:.1} s", record.seconds) };
        self.bar.println(format!("{:12} {state}", record.stage));
    }
}

/// A bar over one search, with the time left, or nothing.
pub struct Searching {
    bar: ProgressBar,
}

impl Searching {
    /// A bar, hidden when `quiet` or when standard error is not a terminal.
    pub fn new(quiet: bool, what: &str) -> Searching {
        let visible = !quiet && std::io::stderr().is_terminal();
        let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(1000), target);
        if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:20} {msg} {elapsed}, {eta} left") {
            bar.set_style(style);
        }
        bar.set_prefix(what.to_string());
        Searching { bar }
    }

    /// A share of the work is done, 0 to 1.
    pub fn show(&self, share: f64, message: &str) {
        self.bar.set_position((share * 1000.0) as u64);
        self.bar.set_message(message.to_string());
    }
}

impl Drop for Searching {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

//! Progress on standard error, and only where that is a terminal; and to a watcher, where a program asks for it.

pub mod detail;

use crate::record::Record;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::cell::RefCell;
use std::io::IsTerminal;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How far a command has come.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The stage at work; the name of the data for a verb without stages.
    pub stage: String,
    /// Share of the whole that is done, 0 to 1. A build counts its stages.
    pub share: f64,
    /// Words for a reader.
    pub message: String,
}

/// Who is told of events. It may unwind to stop the work.
pub type Watcher = Arc<dyn Fn(&Event) + Send + Sync>;

thread_local! {
    static WATCHER: RefCell<Option<Watcher>> = const { RefCell::new(None) };
}

/// Does `work` on this thread; `watcher` is told how far it is.
pub fn watched<T>(watcher: Watcher, work: impl FnOnce() -> T) -> T {
    struct Left(Option<Watcher>);
    impl Drop for Left {
        fn drop(&mut self) {
            let before = self.0.take();
            WATCHER.with(|w| *w.borrow_mut() = before);
        }
    }
    let _left = Left(WATCHER.with(|w| w.borrow_mut().replace(watcher)));
    work()
}

fn watcher() -> Option<Watcher> {
    WATCHER.with(|w| w.borrow().clone())
}

fn tell(watcher: Option<&Watcher>, stage: &str, share: f64, message: &str) {
    if let Some(watcher) = watcher {
        watcher(&Event { stage: stage.to_owned(), share, message: message.to_owned() });
    }
}

/// A bar over the stages, or nothing.
pub struct Progress {
    bar: ProgressBar,
    watcher: Option<Watcher>,
}

impl Progress {
    /// A bar over `stages` stages, hidden when `quiet` or when standard error is not a terminal.
    pub fn new(quiet: bool, stages: usize) -> Progress {
        let visible = !quiet && !detail::is_on() && std::io::stderr().is_terminal();
        let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(stages as u64), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:20} {pos}/{len} {msg} {elapsed}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Progress { bar, watcher: watcher() }
    }

    /// A stage begins.
    pub fn start(&self, stage: &str) {
        self.bar.set_message(stage.to_string());
        detail::tell(|| format!("{stage} begins"));
        tell(self.watcher.as_ref(), stage, share(&self.bar), "begins");
    }

    /// A line above the bar.
    pub fn note(&self, line: &str) {
        self.bar.println(line);
        detail::tell(|| line.to_owned());
    }

    /// Tells how far a long stage has come, beside the bar.
    pub fn teller(&self) -> impl Fn(&str) + use<> {
        let (bar, watcher) = (self.bar.clone(), self.watcher.clone());
        move |words| {
            bar.set_message(words.to_string());
            detail::step(|| words.to_owned());
            let stage = words.split_whitespace().next().unwrap_or_default();
            tell(watcher.as_ref(), stage, share(&bar), words);
        }
    }

    /// A stage is done.
    pub fn done(&self, record: &Record) {
        self.bar.inc(1);
        let state = if record.cached { "unchanged".to_string() } else { format!("{:.1} s", record.seconds) };
        self.bar.println(format!("{:12} {state}", record.stage));
        detail::tell(|| format!("{} is done: {state}, {} MiB", record.stage, record.peak_memory_mib));
        tell(self.watcher.as_ref(), &record.stage, share(&self.bar), &state);
    }
}

/// How much time is left, in words, when a share of work that began so long ago is done; empty before a twentieth of it is.
pub fn left(begun: Instant, share: f64) -> String {
    if !(0.05..1.0).contains(&share) {
        return String::new();
    }
    let seconds = begun.elapsed().as_secs_f64() * (1.0 / share - 1.0);
    match seconds {
        0.0..90.0 => format!(", about {seconds:.0} s left"),
        _ => format!(", about {:.0} min left", seconds / 60.0),
    }
}

/// The share of the stages that are done.
fn share(bar: &ProgressBar) -> f64 {
    bar.position() as f64 / bar.length().unwrap_or(1) as f64
}

/// A bar over one search, with the time left, or nothing.
pub struct Searching {
    bar: ProgressBar,
    what: String,
    begun: Instant,
    watcher: Option<Watcher>,
}

impl Searching {
    /// A bar, hidden when `quiet` or when standard error is not a terminal.
    pub fn new(quiet: bool, what: &str) -> Searching {
        let visible = !quiet && !detail::is_on() && std::io::stderr().is_terminal();
        let target = if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(1000), target);
        if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:20} {msg}") {
            bar.set_style(style);
        }
        bar.set_prefix(what.to_string());
        Searching { bar, what: what.to_owned(), begun: Instant::now(), watcher: watcher() }
    }

    /// A share of the work is done, 0 to 1.
    pub fn show(&self, share: f64, message: &str) {
        self.bar.set_position((share * 1000.0) as u64);
        let words = format!("{message}{}", left(self.begun, share));
        self.bar.set_message(words.clone());
        detail::step(|| format!("{}: {:.0} %, {words}", self.what, 100.0 * share));
        tell(self.watcher.as_ref(), &self.what, share, &words);
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

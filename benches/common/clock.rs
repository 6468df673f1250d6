//! Time that a benchmark takes: of processor, which other work on the machine changes little.

use std::time::Instant;

/// Time of this thread on the processor, or of the clock.
pub(crate) struct Clock(Instant, Option<u64>);

impl Clock {
    /// Starts it.
    pub(crate) fn start() -> Clock {
        Clock(Instant::now(), Clock::nanoseconds())
    }

    fn nanoseconds() -> Option<u64> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        text.split_whitespace().next()?.parse().ok()
    }

    /// Since the start [ms].
    pub(crate) fn milliseconds(&self) -> f64 {
        match (self.1, Clock::nanoseconds()) {
            (Some(from), Some(to)) => (to - from) as f64 * 1e-6,
            _ => 1e3 * self.0.elapsed().as_secs_f64(),
        }
    }
}

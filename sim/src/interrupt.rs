//! A request from outside to stop what is being simulated, heard between increments.
//!
//! A host that cannot end its process (Python at Ctrl-C) asks; the work it asks of unwinds with [`Interrupted`], through
//! every thread that hears the request, to the host. Other work of the process goes on. Results do not depend on it.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    static HEARD: RefCell<Option<Request>> = const { RefCell::new(None) };
}

/// What the work unwinds with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// The request of one call: every thread that works for the call hears it.
#[derive(Clone, Debug, Default)]
pub struct Request(Arc<AtomicBool>);

impl Request {
    /// Asks whatever hears this request to stop.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether a stop was asked for.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// From now on this thread hears this request, and no other.
    pub fn hear(&self) {
        HEARD.with(|heard| *heard.borrow_mut() = Some(self.clone()));
    }
}

/// Goes on, or unwinds with [`Interrupted`] where a stop was asked of this thread. No panic message is written.
pub fn check() {
    if HEARD.with(|heard| heard.borrow().as_ref().is_some_and(Request::is_asked)) {
        std::panic::resume_unwind(Box::new(Interrupted));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_threads_that_hear_the_request_stop() {
        let (one, other) = (Request::default(), Request::default());
        one.ask();
        let stops = |request: Option<Request>| {
            let work = move || {
                request.iter().for_each(Request::hear);
                check();
            };
            std::thread::spawn(work).join().is_err_and(|payload| payload.is::<Interrupted>())
        };
        assert!(stops(Some(one)));
        assert!(!stops(Some(other)) && !stops(None));
    }
}

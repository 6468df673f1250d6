//! A request from outside to stop what is being simulated, heard between increments.
//!
//! A host that cannot end its process (Python at Ctrl-C) asks; whatever simulates then unwinds with [`Interrupted`],
//! through every thread, to the host. Nothing else in the program asks, so results do not depend on it.

use std::sync::atomic::{AtomicBool, Ordering};

static ASKED: AtomicBool = AtomicBool::new(false);

/// What the work unwinds with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

/// Asks all that is being simulated in this process to stop.
pub fn ask() {
    ASKED.store(true, Ordering::Relaxed);
}

/// Takes the request back, once what should stop has stopped.
pub fn withdraw() {
    ASKED.store(false, Ordering::Relaxed);
}

/// Goes on, or unwinds with [`Interrupted`] where a stop was asked for. No panic message is written.
pub fn check() {
    if ASKED.load(Ordering::Relaxed) {
        std::panic::resume_unwind(Box::new(Interrupted));
    }
}

//! The solvers against closed answers, the laws they keep, their orders of convergence: docs/verification.md holds the figures printed here.
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]
#![expect(clippy::unwrap_used, reason = "a test's helpers")]

mod closed;
mod convergence;
mod fallen;
mod faults;
mod flags;
mod laws;
mod layers;
mod menisci;
mod patella;
mod protocols;
mod quasistatic;
mod rig;
mod states;
mod wrap;

use sim::explicit::{ExplicitOptions, Increments};

/// Fixed increments and the specification's own masses.
fn fixed(increment_s: f64) -> ExplicitOptions {
    ExplicitOptions {
        control: Increments::Fixed,
        longest_increment_s: increment_s,
        mass_scale: 1.0,
        ..ExplicitOptions::default()
    }
}

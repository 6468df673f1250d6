//! The integration tests of calibration, one program: each further one would link everything again.

mod common;
mod displacements;
mod published_knee;
mod published_targets;
mod small_knee;

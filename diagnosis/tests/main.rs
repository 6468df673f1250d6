//! The integration tests of diagnosis, one program: each further one would link everything again.

mod apparatus;
mod common;
mod components;
mod contradictions;
mod cuts;
mod fields;
mod fits;
mod jumps;
mod mirrored;
mod nuisances;
mod pairs;
mod pulls;
mod rests;
mod small_knee;
mod suspects;
mod unloaded;
mod wide;

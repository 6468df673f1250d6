//! A calibrated knee in the reader's hands.
//!
//! The report packs a model, its contact surfaces and the samples of its calibration ([`pack`]). A page opens the pack ([`Knee::open`]) and asks
//! for trials ([`Knee::told`]) and for intervals ([`Knee::bands`]); the answers are those of `build-model simulate`, by the same functions. In a
//! browser the page speaks to [`answer`] through memory (`web`): requests and replies are JSON, so nothing else is shared.
//!
//! Loads act on the tibia in clinical signs [N m, N]; poses are in degrees and mm.

pub mod ask;
pub mod knee;
pub mod pack;
pub mod pressure;
#[cfg(target_arch = "wasm32")]
pub mod web;

pub use ask::answer;
pub use knee::{Asked, Knee};
pub use pack::{Packed, pack};

/// This crate for a browser, compressed: made by `.ci/module`. A machine that installs the program may not have the target to make it.
#[cfg(not(target_arch = "wasm32"))]
pub const MODULE: &[u8] = include_bytes!("../module/live.wasm.gz");

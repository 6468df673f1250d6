//! An independent laboratory: laxity data of a knee in which an effect is hidden, with sealed truth.
//!
//! Nothing here knows the simulator or the catalogue: another contact law on one pass of unmerged nodes, five to seven jittered fibres a bundle
//! with an exponential toe, equilibrium by minimising energy, effects in other forms than the catalogue's, ligaments drawn more widely than the
//! diagnosis supposes, noise that is correlated within a condition, and outliers.
//!
//! Start with [`laboratory::make`]: a knee and what to hide give laxity data and their truth.
//!
//! ```
//! let kinds = blindbench::laboratory::kinds(12);
//! assert_eq!(kinds.len(), 12);
//! ```

pub mod asked;
mod cuts;
mod draw;
pub mod frames;
pub mod further;
pub mod hidden;
pub mod knee;
pub mod laboratory;
mod over;
mod pose;
mod read;
pub mod reliability;
mod rest;
mod said;
pub mod score;
mod share;
pub mod surfaces;
mod tissue;
pub mod unknown;

/// Why the laboratory cannot work.
#[derive(Debug, thiserror::Error, Clone, PartialEq)]
pub enum BenchError {
    /// The knee is at fault.
    #[error("knee: {0}")]
    Knee(String),
    /// The plan is at fault.
    #[error("plan: {0}")]
    Plan(String),
    /// What is to be hidden is at fault.
    #[error("{0}")]
    Effect(String),
}

#[cfg(test)]
mod flat;

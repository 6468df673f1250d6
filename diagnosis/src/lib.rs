//! Where a model and measured data disagree, which missing effect explains it, and what happens when it is added.
//!
//! Pure: values in, values out. Its method: docs/theory/discrepancy.md.
//!
//! Start with [`diagnosis::diagnose`]. The effects that it looks for are rows of a catalogue:
//!
//! ```
//! let catalogue = diagnosis::catalogue::Catalogue::shipped();
//! assert!(catalogue.find("meniscus").is_ok());
//! ```

mod against;
mod astray;
pub mod atlas;
#[cfg(test)]
mod bare;
pub mod bench;
pub mod candidate;
pub mod carried;
pub mod catalogue;
pub mod component;
pub mod contradiction;
pub mod covariance;
pub mod criteria;
pub mod curves;
pub mod detection;
pub mod diagnosis;
pub mod discrepancy;
pub mod effect;
pub mod error;
pub mod exchange;
pub mod excluded;
pub mod fit;
mod form;
pub mod held_out;
pub mod jacobian;
mod jumped;
pub mod map;
pub mod next_test;
pub mod noise;
pub mod nuisance;
pub mod outlier;
mod plain;
pub mod plain_unnamed;
pub mod predict;
pub mod preparation;
pub mod problem;
pub mod regret;
pub mod report;
pub mod rim;
pub mod screen;
pub mod search;
pub mod trial;
pub(crate) mod unexplained;
mod verdict;
mod ways;
pub mod words;

pub use error::DiagnosisError;

//! Where a model and measured data disagree, which missing effect explains it, and what happens when it is added.
//!
//! Pure: values in, values out. Its method: docs/theory/discrepancy.md.
//!
//! Start with [`diagnosis::diagnose`]. The effects that it looks for are rows of a catalogue:
//!
//! ```
//! let catalogue = diagnosis::effect::catalogue::Catalogue::shipped();
//! assert!(catalogue.find("meniscus").is_ok());
//! ```

pub mod criteria;
pub mod diagnosis;
pub mod discrepancy;
pub mod effect;
pub mod error;
pub mod fit;
pub mod problem;
pub mod report;
pub mod search;

pub use error::DiagnosisError;

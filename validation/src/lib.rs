//! Calibrated models of a knee compared: the validation protocols, the paper's tables and figures with its own values beside ours.
//!
//! Pure: values in, values out, no files, no clock. Angles are degrees, forces N and moments N m.

pub mod figures;
pub mod passive;
pub mod plot;
pub mod published;
pub mod tables;
pub mod validate;

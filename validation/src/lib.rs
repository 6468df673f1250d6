//! Calibrated models of a knee compared: the validation protocols, the paper's tables and figures with its own values beside ours.
//!
//! Pure: values in, values out, no files, no clock. Angles are degrees, forces N and moments N m.
//!
//! Start with [`validate::Source`] (a calibrated model, simulated through the protocols) and [`tables::tables`].
//!
//! ```
//! let table4 = validation::published::parameters("S192803", "kla");
//! assert!(table4.is_some_and(|row| !row.is_empty()));
//! ```

pub mod apart;
pub mod cross;
pub mod figures;
pub mod paper;
pub mod parameters;
pub mod passive;
pub mod plot;
pub mod published;
pub mod sensitivity;
pub mod solvers;
pub mod tables;
pub mod validate;

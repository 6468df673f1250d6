//! Experiments on a knee model: residual and cost, calibration of ligaments to laxity.
//!
//! Pure: values in, values out, no files, no clock. Angles are degrees and moments N m here, since these are the units of what
//! was measured; the solver's own units stay in `sim`.
//!
//! Start with [`session::Session`]: a knee, its data sets and the options give a calibration that can be kept and resumed. The parameters are
//! [`design::Design`]:
//!
//! ```
//! let design = calibration::design::Design::table3();
//! assert_eq!(design.at(&vec![0.0; design.len()]).len(), design.len()); // lower bounds of Table 3
//! ```

pub mod calibrate;
pub mod changed;
pub mod cost;
pub mod design;
pub mod error;
pub mod evidence;
pub mod experiment;
pub mod inferred;
pub mod kinds;
pub mod knee;
mod last;
mod mechanics;
pub mod next_test;
pub mod options;
pub mod plateau;
pub mod posterior;
pub mod priors;
pub mod problem;
pub mod recipe;
pub mod reports;
pub mod rig;
pub mod samples;
pub mod session;
pub mod shared;
pub mod simplex;
pub mod swarm;
pub mod targets;
pub mod test_set;
#[cfg(test)]
mod toy;
pub mod unknown;
pub mod unknowns;
mod unmeasured;

pub use error::CalibrationError;

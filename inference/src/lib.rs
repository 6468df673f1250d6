//! What is known of a knee after it was measured.
//!
//! Start with [`posterior::infer`]: a [`posterior::Forward`] (what a point of the parameter space predicts), a [`noise::Likelihood`] (what was measured
//! and how it scatters) and the prior (each [`parameter::Parameter`] is a function of a standard normal number) give modes, evidence and samples.
//! [`knee::Trials`] is the forward model of a knee. This crate knows no ligament by name and no effect.
//!
//! ```
//! use inference::noise::Likelihood;
//! use inference::posterior::{infer, Forward, PosteriorOptions, Point};
//! use nalgebra::{DMatrix, DVector};
//!
//! /// One number, measured twice.
//! struct Twice;
//! impl Forward for Twice {
//!     type State = ();
//!     fn size(&self) -> usize { 1 }
//!     fn at(&self, z: &DVector<f64>, _: Option<(&DVector<f64>, &())>) -> Option<Point<()>> {
//!         let reading = DVector::from_element(2, z[0]);
//!         Some(Point { reading, jacobian: DMatrix::from_element(2, 1, 1.0), ..Point::default() })
//!     }
//! }
//! let mut likelihood = Likelihood::independent(DVector::from_vec(vec![1.0, 1.2]), vec![1.0, 1.0], vec![0, 0]);
//! let found = infer(&Twice, &mut likelihood, &[], &PosteriorOptions { scale_noise: false, ..PosteriorOptions::default() }).unwrap();
//! // Prior precision 1 and two readings of precision 1: mean 2.2 / 3, standard deviation 1 / sqrt(3). The search ends where a step promises less than
//! // a set fall of the log probability, so the mode is right to a small part of that deviation.
//! assert!((found.modes[0].z[0] - 2.2 / 3.0).abs() < 0.01 / 3f64.sqrt());
//! ```

mod box_step;
pub mod discrepancy;
pub mod error;
pub mod frames;
pub mod jacobian;
pub mod knee;
pub mod least_squares;
pub mod linear;
pub mod next_test;
pub mod noise;
pub mod parameter;
pub mod posterior;
pub mod quantity;
pub mod random;
pub mod shift;
pub mod temper;
pub mod trial;
pub mod weights;
pub mod whitening;

pub use error::InferenceError;

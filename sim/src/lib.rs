//! Knee mechanics without anatomy: a specification becomes an immutable model and a state.
//!
//! Units: mm, N, s, tonne, MPa, radian inside; the specification file is in mm, N, N/mm, degrees where its keys say so.
//!
//! Start with [`trials::solve_trials`]: a [`model::Model`] of a [`spec::ModelSpec`], and the trials of a laxity file, give a pose and forces a trial.
//!
//! ```
//! let file = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm
//! drawer,anterior,30,0,0,0,133,0,30,,,,6.5,
//! ";
//! let table = sim::laxity::read(file.as_bytes()).unwrap();
//! assert_eq!(table.trials[0].load[sim::coordinate::AP], 133.0); // [N]
//! ```

pub mod condensed;
pub mod contact;
pub mod coordinate;
pub mod deck;
pub mod equilibrium;
pub mod error;
pub mod explicit;
mod flag;
pub mod flags;
pub mod graft;
pub mod interrupt;
pub mod joint;
pub mod jumps;
pub mod laxity;
pub mod ligament;
pub mod menisci;
pub mod mesh;
pub mod model;
pub mod names;
pub mod patella;
mod portable;
pub mod protocols;
pub mod quasistatic;
pub mod reach;
pub mod sensitivity;
pub mod spec;
pub mod steps;
pub mod text;
pub mod trials;
pub mod uncertainty;
pub mod vtk;
mod workbook;
pub mod wrap;
pub mod xml;

pub use error::SimError;
pub use model::{Model, compile};

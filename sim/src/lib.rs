//! Knee mechanics without anatomy: a specification becomes an immutable model and a state.
//!
//! Units: mm, N, s, tonne, MPa, radian inside; the specification file is in mm, N, N/mm, degrees where its keys say so.

pub mod contact;
pub mod deck;
pub mod deformable;
pub mod equilibrium;
pub mod error;
pub mod explicit;
pub mod interrupt;
pub mod joint;
pub mod laxity;
pub mod ligament;
pub mod mesh;
pub mod model;
pub mod names;
pub mod protocols;
pub mod quasistatic;
pub mod sensitivity;
pub mod spec;
pub mod steps;
pub mod trials;
pub mod uncertainty;
pub mod vtk;

pub use error::SimError;
pub use model::{Model, compile};

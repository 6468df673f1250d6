//! The integration tests of sim, one program: each further one would link everything again.

mod displacements;
mod laxity_outliers;
mod laxity_shapes;
mod laxity_sources;
mod laxity_states;
mod verification;

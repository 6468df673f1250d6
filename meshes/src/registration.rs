//! Rigid registration of a partial, partly covered scan onto the surface of a bone.
//!
//! The order: [`start`] makes starting poses from pairs of points or from [`features`], [`icp`] brings one close,
//! [`bare`] says which of the scan is bare bone, [`fit`] fits and grades on that alone.

pub mod bare;
pub mod correlated;
pub mod features;
pub mod field;
pub mod fit;
pub mod icp;
pub mod rigid;
pub mod sample;
pub mod start;
pub mod target;

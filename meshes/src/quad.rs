//! Quadrilateral meshes of flat regions: a regular grid inside, one ring along the outline.

pub mod grid;
pub mod outline;
pub mod raster;

pub use grid::{QuadGrid, quads_within};
pub use outline::Outline;
pub use raster::Raster;

//! Geometry values of the knee and algorithms on them.
//!
//! Units throughout: millimetre, radian. No files, no clock, no terminal, no random numbers but of a seed: it runs in a browser, too. The crate `formats` reads and writes files.
//! Surfaces are plain values ([`surface::TriMesh`], [`hex::HexMesh`]); queries on them are built once ([`query::SurfaceQuery`]).
//!
//! ```
//! use meshes::Point;
//! use meshes::query::SurfaceQuery;
//! use meshes::shapes::icosphere;
//!
//! let ball = icosphere(10.0, 4);
//! let query = SurfaceQuery::new(&ball).unwrap();
//! let outside_mm = query.signed_distance(&Point::new(0.0, 0.0, 12.0));
//! assert!((outside_mm - 2.0).abs() < 0.1);
//! ```

pub mod boolean;
pub mod frame;
pub mod gap;
pub mod grnn;
mod halfedge;
pub mod hex;
pub mod holes;
pub mod measure;
pub mod min_cut;
pub mod parametrise;
pub mod plane;
pub mod quad;
pub mod query;
pub mod registration;
pub mod remesh;
pub mod render;
pub mod repair;
pub mod section;
pub mod shapes;
pub mod skirt;
pub mod smooth;
pub mod surface;
pub mod surface_net;
pub mod sweep;
pub mod tidy;
pub mod topology;
pub mod unit;
pub mod volume;

/// A point in space [mm].
pub type Point = nalgebra::Point3<f64>;
/// A displacement [mm] or a direction [-].
pub type Vector = nalgebra::Vector3<f64>;
/// A rigid motion; translation in mm.
pub type Isometry = nalgebra::Isometry3<f64>;

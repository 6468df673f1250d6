//! Deformable solids of 8-node hexahedra, rigid bodies that carry them, and contact between their faces, by explicit dynamics.
//!
//! Elements have one integration point: the uniform-gradient strain-displacement operator and the hourglass control of Flanagan and
//! Belytschko [flanagan1981], as Abaqus' C3D8R has them, here about the reference configuration (total Lagrangian, [miller2007]): the
//! deformation gradient is that of the mean, the stress follows from it alone, and a rigid rotation leaves no stress at any angle.
//! Nodes are free, or fixed to a rigid body that is fixed, moved or loaded. Faces touch by penalty, both passes, with friction.
//! Central differences with mass-proportional damping; masses as they are, scaled element by element to one stable increment, or all made
//! to it (dynamic relaxation). Units: mm, N, s, tonne, MPa.
//!
//! Threads share elements and nodes; every sum has a fixed order, so that results do not depend on their number.

mod advance;
mod body;
mod check;
mod element;
mod energy;
mod error;
mod face;
mod fields;
mod kernel;
mod law;
mod mass;
mod model;
pub mod press;
mod project;
mod touch;
mod wide;

pub use advance::State;
pub use body::{Motion, Ramp};
pub use energy::Ledger;
pub use error::DeformableError;
pub use fields::{Fields, contact_pressure, fields};
pub use law::{Law, Material};
pub use mass::{Masses, Scaling};
pub use model::{Model, compile};

use meshes::Point;
use meshes::hex::HexMesh;
use serde::{Deserialize, Serialize};

/// Everything that is simulated together.
#[derive(Clone, Debug, PartialEq)]
pub struct Assembly {
    /// Rigid bodies.
    pub bodies: Vec<Body>,
    /// Deformable solids.
    pub solids: Vec<Solid>,
    /// Rigid faces.
    pub rigid_faces: Vec<RigidFace>,
    /// Faces that may touch.
    pub pairs: Vec<[Face; 2]>,
}

/// A rigid body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// For messages.
    pub name: String,
    /// How it moves.
    pub motion: Motion,
}

/// A deformable solid. Its `bony_nodes` are fixed to a body, its `articular_quads` are its face.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// For messages.
    pub name: String,
    /// Nodes and elements; only volumes must be positive, layers are not needed.
    pub mesh: HexMesh,
    /// What it is made of.
    pub material: Material,
    /// The body that carries its bony nodes.
    pub body: usize,
    /// Nodes that may not move along some of the axes.
    pub rollers: Vec<(u32, [bool; 3])>,
}

/// A rigid face: quadrilaterals with outward normals on a body.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidFace {
    /// For messages.
    pub name: String,
    /// Nodes [mm].
    pub nodes: Vec<Point>,
    /// Quadrilaterals, counter-clockwise seen from outside.
    pub quads: Vec<[u32; 4]>,
    /// The body that carries it.
    pub body: usize,
}

/// A face that may touch another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Face {
    /// The articular face of a solid.
    Articular(usize),
    /// A rigid face.
    Rigid(usize),
}

/// How motion, contact and hourglass modes are computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Hourglass stiffness, often called kappa [-]; 0 for none [flanagan1981].
    pub hourglass_stiffness: f64,
    /// Hourglass viscosity, share of density times dilatational wave speed [-]; 0 for none.
    pub hourglass_viscosity: f64,
    /// Penalty: pressure over penetration [MPa/mm].
    pub penalty_mpa_per_mm: f64,
    /// Coulomb friction [-].
    pub friction: f64,
    /// Penetration beyond which a node counts as behind the other face [mm].
    pub deepest_mm: f64,
    /// Masses.
    pub scaling: Scaling,
    /// Share of the stable increment that is used [-].
    pub safety: f64,
    /// Mass-proportional damping.
    pub damping: Damping,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            hourglass_stiffness: 0.05,
            hourglass_viscosity: 0.0,
            penalty_mpa_per_mm: 300.0,
            friction: 0.03,
            deepest_mm: 1.0,
            scaling: Scaling::None,
            safety: 0.8,
            damping: Damping::Mass(500.0),
        }
    }
}

/// Mass-proportional damping.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Damping {
    /// A constant factor on the mass [1/s].
    Mass(f64),
    /// Critical for the frequency in which the solids move, estimated from their forces at every increment [underwood1983].
    Critical,
}

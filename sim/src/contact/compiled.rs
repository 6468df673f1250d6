//! Sides compiled last, shared by models of one knee: they differ in ligaments, loads and effects, and nearly always touch by the same surfaces.
//!
//! A side depends on what it is made from alone, so that sharing one changes no answer.

use super::Side;
use super::field::Field;
use super::nodes::Nodes;
use super::rim::RimEdge;
use crate::error::SimError;
use meshes::Isometry;
use meshes::surface::TriMesh;
use std::sync::{Arc, Mutex, PoisonError};

/// Sides that are kept [-]: those of two knees with a patella, each of some ten megabytes.
const KEPT: usize = 10;

/// What a side is made from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Source {
    /// The surface, CT coordinates.
    pub(super) mesh: TriMesh,
    /// Thickness of the layer at each vertex [mm]; none given: nothing gives way.
    pub(super) thickness: Vec<f64>,
    /// Grid coordinates from CT coordinates.
    pub(super) frame: Isometry,
    /// Nodes nearer to each other than this are merged [mm].
    pub(super) spacing_mm: f64,
}

/// Kept sides, the one used last first.
static SIDES: Mutex<Vec<(Source, Arc<Side>)>> = Mutex::new(Vec::new());

/// The side of a source, which errors call `name`; compiled where it is not among those that are kept.
pub(super) fn side(source: Source, name: &str) -> Result<Arc<Side>, SimError> {
    if let Some(kept) = taken(&source) {
        return Ok(kept);
    }
    let Source { mesh, thickness, frame, spacing_mm } = &source;
    let field = Field::with_thickness(mesh, thickness, *frame, name)?;
    let nodes = Nodes::new(mesh, thickness, frame, *spacing_mm);
    let made = Arc::new(Side { nodes, field, rim: RimEdge::of(mesh) });
    let mut sides = SIDES.lock().unwrap_or_else(PoisonError::into_inner);
    sides.insert(0, (source, made.clone()));
    sides.truncate(KEPT);
    Ok(made)
}

/// The kept side of a source, which becomes the one used last.
fn taken(source: &Source) -> Option<Arc<Side>> {
    let mut sides = SIDES.lock().unwrap_or_else(PoisonError::into_inner);
    let at = sides.iter().position(|(s, _)| s == source)?;
    sides[..=at].rotate_right(1);
    Some(sides[0].1.clone())
}

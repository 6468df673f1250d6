//! Meshes of a model as values.

use meshes::Point;
use meshes::hex::HexMesh;
use meshes::surface::TriMesh;

/// A tetrahedral mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Node positions, n x 3 [mm].
    pub nodes: Vec<Point>,
    /// Node indices of each element, m x 4.
    pub elements: Vec<[u32; 4]>,
}

/// A mesh of the model.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshValue {
    /// A surface, to be written as PLY.
    Surface(TriMesh),
    /// Hexahedra, to be written as VTU.
    Hex(HexMesh),
    /// Tetrahedra, to be written as VTU.
    Tet(TetMesh),
}

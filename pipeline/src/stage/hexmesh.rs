//! Stage 7, hexmesh: hexahedral cartilage.

use super::artifacts::hexes;
use super::{Files, Stage, Values, Work, hexahedra, reported};
use crate::kept::Kept;
use crate::options::BuildOptions;
use crate::report::geometry::Pool;
use crate::report::picture::Picture;
use crate::report::scene::Scene;
use stages::StageError;
use stages::cartilage::Cartilage;
use stages::hexmesh::{HexCartilage, HexmeshOptions, hexmesh};

reported!(HexCartilage);

/// The stage.
pub(crate) struct Hexmesh;

impl Stage for Hexmesh {
    const NUMBER: &'static str = "07";
    const NAME: &'static str = "hexmesh";
    const TELLING: &'static [&'static str] = &["elements", "scaled_jacobian_min"];
    type Inputs<'a> = (&'a Kept<Cartilage>,);
    type Options = HexmeshOptions;
    type Value = HexCartilage;
    type Fault = StageError;

    fn options(all: &BuildOptions) -> &HexmeshOptions {
        &all.hexmesh
    }

    fn run((cartilage,): Self::Inputs<'_>, options: &HexmeshOptions, _: &Work) -> Result<HexCartilage, StageError> {
        hexmesh(cartilage, options)
    }

    /// Hexahedra with their scaled Jacobian.
    fn artifacts(h: &HexCartilage, _: Self::Inputs<'_>) -> Files {
        hexes(h.meshes.named())
    }

    fn scene(v: &Values, pool: &mut Pool) -> Option<Scene> {
        v.of::<HexCartilage>().map(|h| hexahedra::scene(Self::NAME, &h.meshes, pool))
    }

    fn stills(v: &Values) -> Option<Vec<Picture>> {
        hexahedra::stills(v, v.of::<HexCartilage>()?.meshes.named())
    }
}

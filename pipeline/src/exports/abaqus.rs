//! An Abaqus deck: the model's files, a main file a protocol, and with `--poses` one for each row of a laxity file or of results.

use super::{File, steps, texts};
use crate::error::BuildError;
use crate::model_file::LoadedModel;
use crate::store;
use meshes::hex::HexMesh;
use notices::{Kind, Notice};
use sim::mesh::{MeshValue, TetMesh};
use std::path::Path;

/// The deck and what it lacks; `asked` is a laxity file, or what `simulate` wrote: each of its rows becomes a main file.
pub(super) fn files(
    loaded: &mut LoadedModel,
    model: &Path,
    asked: Option<&Path>,
) -> Result<(Vec<File>, Vec<Notice>), BuildError> {
    let lacking = solids(loaded)?;
    let (trials, mut warnings) = steps::trials(asked)?;
    let written = decks::export_with(&loaded.spec, &loaded.meshes, &trials);
    let deck = written.map_err(|e| BuildError::in_file(model, e))?;
    let others = deck.warnings.into_iter().filter(|w| !lacking.iter().any(|path| w.file.as_ref() == Some(path)));
    warnings.extend(others);
    warnings.extend(lacking.iter().map(|path| {
        let text =
            format!("{path} is not there: its cartilage is left out of the deck as a solid (contact does not need it)");
        Kind::SolidMissing.notice(text).file(path)
    }));
    let imposed = decks::imposed(&loaded.spec, &trials).map_err(|e| BuildError::in_file(model, e))?;
    let mut files = texts(deck.files);
    files.push(steps::list(&imposed, ".inp", asked));
    Ok((files, warnings))
}

/// Reads the cartilage solids that the model names into its meshes; gives the paths of those that are not there.
fn solids(model: &mut LoadedModel) -> Result<Vec<String>, BuildError> {
    let named: Vec<String> =
        model.spec.bodies.iter().filter(|b| b.acts()).flat_map(|b| b.cartilage.iter().cloned()).collect();
    let mut lacking = Vec::new();
    for name in named {
        let place = model.folder.join(&name);
        if !store::exists(&place) {
            lacking.push(name);
            continue;
        }
        let read = formats::vtk::read_solids(&store::read(&place)?).map_err(|e| BuildError::in_file(&place, e))?;
        let mesh = match read.tetrahedra.is_empty() {
            true => MeshValue::Hex(HexMesh { nodes: read.nodes, elements: read.hexahedra, ..HexMesh::default() }),
            false if read.hexahedra.is_empty() => {
                MeshValue::Tet(TetMesh { nodes: read.nodes, elements: read.tetrahedra })
            }
            false => {
                let what = "hexahedra and tetrahedra in one mesh; expected one kind throughout";
                return Err(BuildError::in_file(&place, what));
            }
        };
        model.meshes.insert(name, mesh);
    }
    Ok(lacking)
}

//! model.json and the meshes it names, in and out.

use crate::error::BuildError;
use crate::store;
use sim::abaqus::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;
use std::path::Path;

/// A model with the surfaces it names, by the paths it names them.
pub struct LoadedModel {
    /// model.json.
    pub spec: ModelSpec,
    /// Its surfaces. Volume meshes are not read: contact and bones are surfaces.
    pub meshes: BTreeMap<String, MeshValue>,
}

/// Reads `path` (or the model.json in it, or the assembled model of a build) and the surfaces it names.
pub fn load(path: &Path) -> Result<LoadedModel, BuildError> {
    let path = store::first_that_exists(&[
        path.join("model.json"),
        path.join("build/09-assemble/model.json"),
        path.join("09-assemble/model.json"),
        path.to_path_buf(),
    ]);
    let text = store::read_text(&path)?;
    let spec: ModelSpec = serde_json::from_str(&text).map_err(|e| {
        BuildError::File(format!(
            "{} line {} column {}: {e}; expected a model.json as build-model writes it",
            path.display(),
            e.line(),
            e.column()
        ))
    })?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut meshes = BTreeMap::new();
    let bones = spec.bodies.iter().map(|b| &b.bone);
    for name in bones.chain(spec.contact.pairs.iter().flat_map(|p| [&p.femur, &p.tibia])) {
        if meshes.contains_key(name) {
            continue;
        }
        let place = folder.join(name);
        let bytes =
            store::read(&place).map_err(|e| BuildError::File(format!("{} names {name}: {e}", path.display())))?;
        let read = meshes::format::read_surface(name, &bytes, &BTreeMap::new())
            .map_err(|e| BuildError::File(format!("{}: {e}", place.display())))?;
        meshes.insert(name.clone(), MeshValue::Surface(read.mesh));
    }
    Ok(LoadedModel { spec, meshes })
}

/// `import-abaqus`: a deck becomes a model in `out`.
pub fn import_abaqus(deck: &Path, out: &Path) -> Result<String, BuildError> {
    let folder = deck.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let main = deck.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut read = |name: &str| store::read_beside(folder, name).map_err(|e| e.to_string());
    let imported = sim::abaqus::import(&main, &mut read).map_err(|e| BuildError::File(e.to_string()))?;
    let files = imported.files().map_err(|e| BuildError::File(e.to_string()))?;
    store::write_all(out, &files)?;
    let mut text = warned(&imported.warnings);
    text += &format!(
        "{}: {} fibres in {} bundles, {} contact pairs\nThe model is {}\n",
        imported.spec.id,
        imported.spec.fibres.len(),
        imported.spec.bundles.len(),
        imported.spec.contact.pairs.len(),
        out.join("model.json").display()
    );
    Ok(text)
}

/// What a model can be exported as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// An Abaqus/Explicit deck.
    Abaqus,
    /// VTK PolyData for ParaView.
    Vtk,
}

/// `export`: a model as other programs read it, in `out`.
pub fn export(model: &Path, format: Format, out: &Path) -> Result<String, BuildError> {
    let loaded = load(model)?;
    let (files, warnings) = match format {
        Format::Abaqus => {
            let deck = sim::abaqus::export(&loaded.spec, &loaded.meshes)
                .map_err(|e| BuildError::File(format!("{}: {e}", model.display())))?;
            (deck.files, deck.warnings)
        }
        Format::Vtk => (sim::vtk::export(&loaded.spec, &loaded.meshes, &meshes::Isometry::identity(), &[]), Vec::new()),
    };
    let files: Vec<(String, Vec<u8>)> = files.into_iter().map(|(name, text)| (name, text.into_bytes())).collect();
    store::write_all(out, &files)?;
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    Ok(format!("{}{} in {}\n", warned(&warnings), names.join(", "), out.display()))
}

fn warned(warnings: &[String]) -> String {
    warnings.iter().map(|w| format!("warning: {w}\n")).collect()
}

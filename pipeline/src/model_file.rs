//! model.json and the meshes it names, in and out.

use crate::error::{BuildError, Place};
use crate::record::json;
use crate::store;
use crate::which_model::{WhichModel, chosen, standing};
use notices::{Kind, Notice};
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use stages::PerCartilage;
use stages::assemble::Assembled;
use stages::bones::Bones;
use stages::cartilage::Cartilage;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// A model with the surfaces it names, by the paths it names them.
pub struct LoadedModel {
    /// model.json.
    pub spec: ModelSpec,
    /// Its surfaces. Volume meshes are not read: contact and bones are surfaces.
    pub meshes: BTreeMap<String, MeshValue>,
    /// Its folder, absolute.
    pub folder: PathBuf,
    /// The file as it was found.
    pub file: PathBuf,
}

impl LoadedModel {
    /// The first line of every answer: which model it is of.
    pub fn line(&self) -> String {
        format!("model {}\n{}", self.told(), self.wraps().map_or(String::new(), |told| format!("{told}\n")))
    }

    /// Which ligaments wrap over which bones, in words; none where all are straight.
    pub fn wraps(&self) -> Option<String> {
        let wrap = self.spec.wrap.as_ref()?;
        let bundles = match wrap.bundles.len() {
            n if n == self.spec.bundles.len() => "all ligaments".to_owned(),
            _ => wrap.bundles.join(", "),
        };
        Some(format!("{bundles} wrap over {}", wrap.over.join(" and ")))
    }

    /// Its id, what it was calibrated to, where it lies and its digest.
    pub fn told(&self) -> String {
        let (id, standing) = (&self.spec.id, standing(&self.spec));
        format!("{id}, {standing}: {} (digest {})", self.file.display(), self.told_digest())
    }

    /// The model in one line of a file, the same wherever the build lies: id, stage, what it was calibrated to, digest.
    pub fn label(&self) -> String {
        format!("{}, {}: {}, digest {}", self.spec.id, standing(&self.spec), self.place(), self.told_digest())
    }

    /// Where in its build the model lies ("10-calibrate/joint/model.json"), or its file's name.
    pub fn place(&self) -> String {
        let parts: Vec<String> = self.file.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
        let stage = parts.iter().rposition(|p| p.starts_with("09-") || p.starts_with("10-") || p.starts_with("12-"));
        parts[stage.unwrap_or(parts.len().saturating_sub(1))..].join("/")
    }

    /// The stage of the build that made it; none of a model outside a build.
    pub fn stage(&self) -> Option<String> {
        let place = self.place();
        let (number, stage) = place.split('/').next()?.split_once('-')?;
        let is_folder = place.contains('/') && number.len() == 2 && number.bytes().all(|b| b.is_ascii_digit());
        is_folder.then(|| stage.to_owned())
    }

    /// The first digits of its digest, and what they are of: a file's own digest is another.
    fn told_digest(&self) -> String {
        format!("{} of model and surfaces", self.short_digest())
    }

    /// The first digits of its digest.
    pub fn short_digest(&self) -> String {
        digest(self).chars().take(12).collect()
    }
}

/// What is wrong with a text that should be a model, behind the name of its file.
fn fault_of(text: &str, e: &serde_json::Error) -> String {
    let begins = text.trim_start().chars().next();
    match begins {
        None => " is empty".to_owned(),
        Some('{') => {
            let place = format!(" at line {} column {}", e.line(), e.column());
            format!(" line {} column {}: {}", e.line(), e.column(), e.to_string().trim_end_matches(&place))
        }
        Some(_) => " is no JSON file".to_owned(),
    }
}

/// How the line that names the model begins.
pub const MODEL_LINE: &str = "model ";

/// Reads the model that `path` means ([`chosen`]; of a build the best known) and the surfaces it names.
pub fn load(path: &Path) -> Result<LoadedModel, BuildError> {
    load_which(path, &WhichModel::default())
}

/// [`load`] of the model of a build that is wanted.
pub fn load_which(path: &Path, which: &WhichModel) -> Result<LoadedModel, BuildError> {
    let path = chosen(path, which)?;
    let text = store::read_text(&path)?;
    let spec: ModelSpec = serde_json::from_str(&text).map_err(|e| {
        let told = format!("{}{}; expected a model.json as build-model writes it", path.display(), fault_of(&text, &e));
        BuildError::at(Place::in_json(&path, &e), told)
    })?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut meshes = BTreeMap::new();
    for name in surfaces(&spec) {
        if meshes.contains_key(name) {
            continue;
        }
        let place = folder.join(name);
        let bytes = store::read(&place)
            .map_err(|e| BuildError::of_file(&path, format!("{} names {name}: {e}", path.display())))?;
        let read = formats::read_surface(name, &bytes, &BTreeMap::new()).map_err(|e| BuildError::in_file(&place, e))?;
        meshes.insert(name.clone(), MeshValue::Surface(read.mesh));
    }
    let folder = store::absolute(folder)?;
    Ok(LoadedModel { spec, meshes, folder, file: path })
}

/// The surfaces that a model names.
fn surfaces(spec: &ModelSpec) -> impl Iterator<Item = &String> {
    let bones = spec.bodies.iter().map(|b| &b.bone);
    let patella = spec.patella.iter().flat_map(|p| p.contact.meshes()).map(|(_, name)| name);
    bones.chain(spec.contact.meshes()).chain(patella)
}

/// A calibrated model of a build as it would be read back: `spec`, whose paths are those of the assembled model, in the folder of a source.
pub(crate) fn calibrated_model(assembled: &LoadedModel, spec: &ModelSpec, source: &str) -> LoadedModel {
    let (from, folder) = (Path::new("/09-assemble"), Path::new("/10-calibrate").join(source));
    let own = |name: &String| {
        let mesh = assembled.meshes.get(name)?.clone();
        Some((between(&folder, &from.join(name)), mesh))
    };
    let meshes = surfaces(spec).filter_map(own).collect();
    LoadedModel { spec: moved(spec, from, &folder), meshes, file: folder.join("model.json"), folder }
}

/// The model of a build as it would be read back.
pub(crate) fn assembled_model(assembled: &Assembled, bones: &Bones, cartilage: &Cartilage) -> LoadedModel {
    let contact = assembled.contact.named().map(|(name, mesh)| (format!("contact/{name}.ply"), mesh));
    let bony = assembled.bony.iter().flat_map(PerCartilage::named);
    let bony = bony.map(|(name, mesh)| (format!("contact/{name}_bony.ply"), mesh));
    let patella = bones.patella.as_ref();
    let own = assembled.patella.iter().flat_map(|p| {
        let seen = p.seen.iter().map(|mesh| ("contact/patella_seen.ply".to_string(), mesh));
        let surfaces = [("contact/patella.ply", &p.face), ("contact/patella_ground.ply", &p.ground)];
        seen.chain(surfaces.map(|(name, mesh)| (name.to_string(), mesh)))
    });
    let bones = bones.surfaces.named().map(|(name, mesh)| (format!("../03-bones/{name}.ply"), mesh));
    let patella = patella.map(|mesh| ("../03-bones/patella.ply".to_string(), mesh));
    let carried = cartilage.bodies.iter().map(|(name, mesh)| (format!("../04-cartilage/{name}.ply"), mesh));
    let meshes = contact
        .into_iter()
        .chain(bony)
        .chain(carried)
        .chain(bones)
        .chain(patella)
        .chain(own)
        .map(|(name, mesh)| (name, MeshValue::Surface(mesh.clone())))
        .collect();
    let folder = PathBuf::from("09-assemble");
    LoadedModel { spec: assembled.spec.clone(), meshes, file: folder.join("model.json"), folder }
}

/// The specification as it reads from the folder `to`, when its mesh paths are relative to the folder `from`; both absolute.
pub fn moved(spec: &ModelSpec, from: &Path, to: &Path) -> ModelSpec {
    let mut out = spec.clone();
    let place = |name: &mut String| *name = between(to, &from.join(&*name));
    out.bodies.iter_mut().flat_map(|b| std::iter::once(&mut b.bone).chain(&mut b.cartilage)).for_each(place);
    out.contact.pairs.iter_mut().flat_map(|p| [&mut p.femur, &mut p.tibia]).for_each(place);
    out.menisci.iter_mut().flat_map(|m| [&mut m.femur, &mut m.tibia]).for_each(place);
    out.patella.iter_mut().flat_map(|p| p.contact.meshes_mut()).for_each(place);
    if let Some(layer) = &mut out.contact.layer {
        let faces = std::mem::take(&mut layer.bony_faces).into_iter();
        layer.bony_faces = faces
            .map(|(mut face, mut bony)| {
                place(&mut face);
                place(&mut bony);
                (face, bony)
            })
            .collect();
    }
    out
}

/// [`moved`] of the text of a model.json.
pub fn moved_text(text: &str, from: &Path, to: &Path) -> Result<String, BuildError> {
    let spec: ModelSpec = serde_json::from_str(text).map_err(|e| {
        let told = format!("the model as edited: {e}; expected what model.json has, build-model schema model");
        BuildError::File(told)
    })?;
    Ok(String::from_utf8_lossy(&json(&moved(&spec, from, to))).into_owned())
}

/// The path of `file` from the folder `from`, with forward slashes.
pub(crate) fn between(from: &Path, file: &Path) -> String {
    let plain = |path: &Path| {
        let mut parts: Vec<String> = Vec::new();
        for c in path.components() {
            match c {
                Component::ParentDir => {
                    parts.pop();
                }
                Component::CurDir => {}
                other => parts.push(other.as_os_str().to_string_lossy().into_owned()),
            }
        }
        parts
    };
    let (from, file) = (plain(from), plain(file));
    let shared = from.iter().zip(&file).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..".to_owned(), from.len() - shared);
    up.chain(file[shared..].iter().cloned()).collect::<Vec<_>>().join("/")
}

/// A warning for a verb that leaves a model's added effects out; none where there are none.
pub fn left_out(spec: &ModelSpec, verb: &str) -> Option<Notice> {
    let names: Vec<&str> = spec.components.iter().filter_map(|c| c["effect"].as_str()).collect();
    let told = format!("{verb} leaves out what was added to the model: {} (diagnose takes it in)", names.join(", "));
    (!names.is_empty()).then(|| Kind::ComponentsLeftOut.notice(told).count(names.len()))
}

/// What a verb takes into its predictions of a model's added effects, and what it leaves out; empty where there are none.
pub fn taken_in(spec: &ModelSpec, data_set: Option<&str>) -> Result<String, BuildError> {
    let acting = diagnosis::report::predict::acting(spec, data_set).map_err(|e| BuildError::File(e.to_string()))?;
    let mut text = String::new();
    for (c, _) in &acting {
        let note = if c.kept == "session" { " (it belongs to the session, not to the knee)" } else { "" };
        text += &format!("with {} of {}{note}\n", c.effect, c.scope);
    }
    if acting.len() < spec.components.len() {
        let left = spec.components.len() - acting.len();
        text += &format!(
            "{left} added effects do not act here: they belong to an apparatus or to another data set, or have no size\n"
        );
    }
    Ok(text)
}

/// Digest of a model and the surfaces it names.
pub fn digest(model: &LoadedModel) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&json(&model.spec));
    for (name, mesh) in &model.meshes {
        // solids lie beside the model in an export; they are none of it
        if let MeshValue::Surface(mesh) = mesh {
            hasher.update(name.as_bytes());
            let numbers = mesh.vertices.iter().flat_map(|p| p.coords.iter().copied().collect::<Vec<f64>>());
            numbers.for_each(|x| {
                hasher.update(&x.to_le_bytes());
            });
        }
    }
    hasher.finalize().to_hex().to_string()
}

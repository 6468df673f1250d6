//! FEBio files of rigid-body knees: read into a model.
//!
//! Femur and tibia are the rigid bodies that a sliding contact joins. The model's CT pose is the pose of the file. Units are mm, N and MPa. Loads, held
//! motions, muscles, the patella and parts that deform but for cartilage on bone are left out and told.

mod bodies;
mod contact;
mod curves;
mod frames;
mod known;
mod ligaments;
mod mesh;
mod sides;

use crate::DeckError;
use crate::elements::Judged;
use crate::faces::{SOLID_MM, extent, thickened};
use crate::import::{ImportedDeck, check_unit, ct_pose};
use crate::opensim::Given;
use crate::tree::{Tree, text};
use bodies::{Bodies, Knee};
pub use frames::ANATOMICAL;
pub use known::elements;
use mesh::Mesh;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::mesh::MeshValue;
use sim::spec::{BodySpec, ContactSpec, FramesSpec, ModelSpec, PoseSpec, Units};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Formats that are read.
const VERSIONS: [&str; 3] = ["4.0", "3.0", "2.5"];
/// What a comment begins with that holds the model's id: FEBio has no place for it.
pub const MODEL: &str = "model: ";
/// Units in which a file may state that it is: mm, N, s, and so MPa.
const UNITS: &str = "mm-N-s";
/// Mass [tonne] and rotary inertia [tonne mm2] of a bone: a dissected knee's femur of 1 kg, 0.01 kg m2. Ours; only explicit dynamics reads it.
const USUAL_MASS: (f64, f64) = (1e-3, 10.0);

/// Imports the knee of the FEBio file `bytes`, called `main`.
///
/// # Errors
/// The file and line that cannot be read or are refused, or what the file lacks of a knee.
pub fn import(main: &str, bytes: &[u8], given: &Given) -> Result<ImportedDeck, DeckError> {
    let text = plain(main, bytes)?;
    let tree = Tree::new(main, &text, "a FEBio file (.feb)", Some(','))?;
    document(&tree)?;
    let Judged { objects, told } = known::TABLE.judge(&tree, tree.root())?;
    module(&tree, &objects)?;
    let mesh = Mesh::new(&tree, &objects)?;
    let bodies = Bodies::new(&tree, &mesh, &objects)?;
    let contacts = sides::contacts(&tree, &mesh, &bodies, &objects)?;
    let knee = Knee::find(&tree, &bodies, &sides::sided(&contacts), given)?;
    let (ligaments, springs_told) = ligaments::ligaments(&tree, (&mesh, &bodies, &knee), &objects)?;
    let middles = sides::middles(&mesh, &contacts, &knee);
    let axes = frames::axes(&tree, (&mesh, &bodies, &knee), (&ligaments.fibres, middles), &objects, given.side)?;
    let frames =
        FramesSpec { femur: axes.femur, tibia: axes.tibia, gs_ct_pose: PoseSpec::default(), chain: None, grid: None };
    let contact = contact::contact(&tree, (&mesh, &bodies, &knee), &contacts, &frames)?;
    let mut warnings = told;
    warnings.extend([springs_told, axes.told, contact.told].into_iter().flatten());
    let rest = bodies.rest(&knee);
    if !rest.is_empty() {
        let what = format!("rigid bodies that are no part of femur and tibia are left out: {}", rest.join(", "));
        warnings.push(Kind::DeckOdd.notice(what).count(rest.len()));
    }
    let mut meshes = contact.meshes;
    let (specs, bones) = bones(&tree, (&mesh, &bodies, &knee), &contact.spec, &mut meshes, &mut warnings)?;
    warnings.extend(crate::held::ends(&ligaments.fibres, bones.each_ref().map(Option::as_ref)));
    warnings.extend(crate::held::copies(&ligaments.fibres));
    warnings.extend(crate::usual::whole(&ligaments.bundles, &contact.spec, &specs));
    let mut spec = ModelSpec {
        schema: "model/1".into(),
        id: identity(&tree, main),
        side: axes.side,
        units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
        frames,
        bodies: specs,
        contact: contact.spec,
        bundles: ligaments.bundles,
        fibres: ligaments.fibres,
        wrap: None,
        menisci: Vec::new(),
        toe_end_multiple: ligaments.ends,
        protocols: Vec::new(),
        components: Vec::new(),
        calibrated: None,
        uncertainty: None,
        patella: None,
        warnings: notices::texts(&warnings),
    };
    let fault = |message: String| DeckError { file: main.to_owned(), line: 0, message };
    spec.frames.gs_ct_pose = ct_pose(&spec).map_err(|e| fault(e.message))?;
    crate::usual::wide(&spec.contact, &meshes).map_err(|e| fault(e.message))?;
    // what a simulation would refuse is refused here, where the file is known
    sim::compile(&spec, &meshes).map_err(|e| fault(e.to_string()))?;
    Ok(ImportedDeck { spec, meshes, warnings })
}

/// The file as text. FEBio's own programs write UTF-8 or Latin letters (ISO-8859-1), and say which.
fn plain<'a>(main: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, DeckError> {
    let fault = |message: String| DeckError { file: main.to_owned(), line: 0, message };
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text.strip_prefix('\u{feff}').unwrap_or(text)),
        Err(_) if bytes.contains(&0) => return Err(fault("the file is no text; expected a FEBio file (.feb)".into())),
        Err(_) => Cow::Owned(bytes.iter().map(|b| char::from(*b)).collect()),
    };
    if !text.trim_start().starts_with('<') {
        return Err(fault("the file does not begin as XML; expected a FEBio file (.feb)".into()));
    }
    Ok(text)
}

/// Whether the file is FEBio's, of a format that is read.
fn document(tree: &Tree<'_>) -> Result<(), DeckError> {
    let root = tree.root();
    if root.tag_name().name() != "febio_spec" {
        return Err(tree.error(root, format!("the file is a <{}>; expected a <febio_spec>", root.tag_name().name())));
    }
    let version = root.attribute("version").unwrap_or("none").trim();
    if !VERSIONS.contains(&version) {
        let all = VERSIONS.join(", ");
        let what =
            format!("the format is of version {version}; expected {all}: open the file in FEBio Studio and save it");
        return Err(tree.error(root, what));
    }
    Ok(())
}

/// Whether physics and units are those of a model.
fn module(tree: &Tree<'_>, objects: &[Node<'_, '_>]) -> Result<(), DeckError> {
    let Some(&node) = objects.iter().find(|o| o.tag_name().name() == "Module") else { return Ok(()) };
    let kind = node.attribute("type").unwrap_or("solid").trim();
    if !["solid", "explicit-solid"].contains(&kind) {
        return Err(tree.error(node, format!("its type is \"{kind}\"; expected solid: cartilage is elastic here")));
    }
    let units = text(node, "units").unwrap_or("");
    if !["", UNITS].contains(&units) {
        return Err(tree.error(node, format!("the units are {units}; expected {UNITS}, which are mm, N and MPa")));
    }
    Ok(())
}

/// The model's id as an export left it in a comment, else the name of the file.
fn identity(tree: &Tree<'_>, main: &str) -> String {
    let comments = tree.root().children().filter(Node::is_comment);
    let mut told = comments.filter_map(|c| c.text()?.trim().strip_prefix(MODEL.trim_end()).map(str::trim));
    if let Some(id) = told.find(|id| !id.is_empty()) {
        return id.to_owned();
    }
    let file = main.rsplit(['/', '\\']).next().unwrap_or(main);
    file.strip_suffix(".feb").unwrap_or(file).to_owned()
}

/// Femur and tibia, whose bones are put among the meshes, and the bones that the file shows.
fn bones(
    tree: &Tree<'_>,
    (mesh, bodies, knee): (&Mesh, &Bodies<'_, '_>, &Knee),
    contact: &ContactSpec,
    meshes: &mut BTreeMap<String, MeshValue>,
    warnings: &mut Vec<Notice>,
) -> Result<(Vec<BodySpec>, [Option<TriMesh>; 2]), DeckError> {
    let (mut specs, mut shown) = (Vec::new(), [None, None]);
    for (k, (name, file, body)) in
        [("femur", "femur", knee.femur), ("tibia", "tibfib", knee.tibia)].into_iter().enumerate()
    {
        let bone = match largest(mesh, bodies, body) {
            Some(bone) => {
                shown[k] = Some(bone.clone());
                bone
            }
            None => {
                let what = format!(
                    "{name}: no part of the rigid body is closed; its contact surface, {SOLID_MM} mm thick, stands for the bone in pictures"
                );
                warnings.push(Kind::DeckOdd.notice(what).of(name));
                let pair = &contact.pairs[0];
                match meshes.get(if k == 0 { &pair.femur } else { &pair.tibia }) {
                    Some(MeshValue::Surface(face)) => thickened(face, SOLID_MM),
                    _ => TriMesh::default(),
                }
            }
        };
        check_unit(name, &bone).map_err(|e| DeckError { file: tree.file.to_owned(), line: 0, message: e.message })?;
        let path = format!("meshes/{file}.ply");
        meshes.insert(path.clone(), MeshValue::Surface(bone));
        let (mass_tonne, inertia_tonne_mm2) = USUAL_MASS;
        specs.push(BodySpec { name: name.into(), bone: path, cartilage: vec![], mass_tonne, inertia_tonne_mm2 });
    }
    Ok((specs, shown))
}

/// The largest closed part of a body, turned outwards.
fn largest(mesh: &Mesh, bodies: &Bodies<'_, '_>, body: usize) -> Option<TriMesh> {
    let own = |k: &usize| {
        let first = mesh.parts[*k].elements.first().and_then(|e| e.first());
        bodies.of_part[*k].is_some_and(|m| bodies.materials[m].rigid)
            && first.is_some_and(|n| bodies.of_node(*n) == Some(body))
    };
    let mut best: Option<TriMesh> = None;
    for k in (0..mesh.parts.len()).filter(own) {
        let surface = mesh.triangles(&Mesh::boundary(&mesh.parts[k]));
        let better = best.as_ref().is_none_or(|b| extent(b) < extent(&surface));
        if better && !surface.triangles.is_empty() && Topology::of(&surface).is_closed() {
            best = Some(if surface.volume() < 0.0 { surface.flipped() } else { surface });
        }
    }
    best
}

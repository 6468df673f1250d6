//! OpenSim models with JAM's knee parts: read into a model.
//!
//! Femur and tibia are the bodies that a Smith2018ArticularContactForce joins. Everything is put into the tibia's coordinates, in mm, in the pose of the
//! coordinates' default values: that is the model's CT pose. Muscles, the patella and what is above and below the knee are left out and told.

mod bones;
mod contact;
mod document;
mod forces;
mod joints;
mod knee;
mod known;
mod ligaments;
mod places;
mod wrapped;

use crate::DeckError;
use crate::elements::Judged;
pub use crate::faces::thickened;
use crate::import::{ImportedDeck, check_unit, ct_pose};
use crate::keyword::ReadFile;
use crate::tree::{Tree, name_of, text};
pub use knee::ANATOMICAL;
pub use known::elements;
use meshes::Point;
use meshes::frame::Side;
use meshes::surface::TriMesh;
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::mesh::MeshValue;
use sim::spec::{BodySpec, ContactSpec, FramesSpec, ModelSpec, PoseSpec, Units};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// OpenSim's lengths are in m.
const MM_PER_M: f64 = 1000.0;

/// What is said of the knee where the file does not tell it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Given {
    /// Name of the femur's body.
    pub femur: Option<String>,
    /// Name of the tibia's body.
    pub tibia: Option<String>,
    /// Which knee.
    pub side: Option<Side>,
}

/// Imports the knee of the OpenSim model `bytes`, called `main`; `read` hands over a mesh by the name the model gives it.
///
/// # Errors
/// The file and line that cannot be read or are refused, or what the model lacks of a knee.
pub fn import(main: &str, bytes: &[u8], read: &mut ReadFile, given: &Given) -> Result<ImportedDeck, DeckError> {
    let text = plain(main, bytes)?;
    let tree = Tree::new(main, &text, "an OpenSim model", None)?;
    let model = tree.model()?;
    let Judged { objects, told } = known::TABLE.judge(&tree, model)?;
    let mut files = Files { main, read };
    let places = places::Places::new(&tree, model, &objects)?;
    let forces = forces::forces(&tree, &places, &objects)?;
    let knee = knee::Knee::find(&tree, &places, &forces, given)?;
    let ligaments = ligaments::ligaments(&tree, &places, &knee, &objects)?;
    let axes = knee::axes(&tree, &places, &knee, &ligaments.fibres, given.side)?;
    let frames =
        FramesSpec { femur: axes.femur, tibia: axes.tibia, gs_ct_pose: PoseSpec::default(), chain: None, grid: None };
    let contact = contact::contact(&knee, &forces, &frames, &mut files)?;
    let mut warnings = told;
    warnings.extend(model_told(&tree, &places, &knee, (model, &objects))?);
    warnings.extend([ligaments.told, axes.told, contact.told].into_iter().flatten());
    let mut meshes = contact.meshes;
    let (bodies, bones) =
        bodies((&tree, &places, &knee), (&objects, &contact.spec), (&mut meshes, &mut warnings), &mut files)?;
    warnings.extend(crate::held::ends(&ligaments.fibres, bones.each_ref().map(Option::as_ref)));
    warnings.extend(crate::held::copies(&ligaments.fibres));
    warnings.extend(crate::usual::whole(&ligaments.bundles, &contact.spec, &bodies));
    let mut spec = ModelSpec {
        schema: "model/1".into(),
        id: identity(main, model),
        side: axes.side,
        units: Units { length: "mm".into(), force: "N".into(), pressure: "MPa".into(), angle: "deg".into() },
        frames,
        bodies,
        contact: contact.spec,
        bundles: ligaments.bundles,
        fibres: ligaments.fibres,
        wrap: None,
        menisci: Vec::new(),
        toe_end_multiple: BTreeMap::new(),
        protocols: Vec::new(),
        components: Vec::new(),
        calibrated: None,
        uncertainty: None,
        patella: None,
        warnings: notices::texts(&warnings),
    };
    spec.frames.gs_ct_pose = ct_pose(&spec).map_err(|e| files.fault(0, e.message))?;
    // what a simulation would refuse is refused here, where the file is known
    sim::compile(&spec, &meshes).map_err(|e| files.fault(0, e.to_string()))?;
    Ok(ImportedDeck { spec, meshes, warnings })
}

/// Femur and tibia, whose bones are put among the meshes, and the bones that the model shows.
fn bodies(
    (tree, places, knee): (&Tree<'_>, &places::Places<'_, '_>, &knee::Knee),
    (objects, contact): (&[Node<'_, '_>], &ContactSpec),
    (meshes, warnings): (&mut BTreeMap<String, MeshValue>, &mut Vec<Notice>),
    files: &mut Files<'_, '_>,
) -> Result<(Vec<BodySpec>, [Option<TriMesh>; 2]), DeckError> {
    let pair = &contact.pairs[0];
    let (mut bodies, mut bones) = (Vec::new(), [None, None]);
    for femur in [true, false] {
        let face = match meshes.get(if femur { &pair.femur } else { &pair.tibia }) {
            Some(MeshValue::Surface(mesh)) => mesh.clone(),
            _ => TriMesh::default(),
        };
        let (bone, shown) = bones::bone(tree, places, knee, (femur, objects, &face), files, warnings)?;
        let (name, file) = if femur { ("femur", "femur") } else { ("tibia", "tibfib") };
        check_unit(name, &bone).map_err(|e| files.fault(0, e.message))?;
        let body = if femur { knee.femur } else { knee.tibia };
        let ((mass_tonne, inertia_tonne_mm2), usual) = knee::mass(tree, places, body)?;
        if usual {
            let what = format!("{}: no mass or inertia above 0: 1 kg and 0.01 kg m2 are taken", places.name(body));
            warnings.push(Kind::DeckOdd.notice(what).of(name));
        }
        let path = format!("meshes/{file}.ply");
        bones[usize::from(!femur)] = shown.then(|| bone.clone());
        meshes.insert(path.clone(), MeshValue::Surface(bone));
        bodies.push(BodySpec { name: name.into(), bone: path, cartilage: vec![], mass_tonne, inertia_tonne_mm2 });
    }
    Ok((bodies, bones))
}

/// The file as text: UTF-8, with OpenSim's doubled colons put into names that XML's parsers take, without moving a line.
fn plain<'a>(main: &str, bytes: &'a [u8]) -> Result<Cow<'a, str>, DeckError> {
    let fault = |message: String| DeckError { file: main.to_owned(), line: 0, message };
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        DeckError { line, ..fault("the text is not UTF-8, as OpenSim writes it".into()) }
    })?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if !text.trim_start().starts_with('<') {
        return Err(fault("the file does not begin as XML; expected an OpenSim model (.osim)".into()));
    }
    Ok(match text.contains("::ContactParameters") {
        true => Cow::Owned(text.replace("::ContactParameters", "__ContactParameters")),
        false => Cow::Borrowed(text),
    })
}

/// The model's name, or its file's.
fn identity(main: &str, model: Node<'_, '_>) -> String {
    let file = main.rsplit(['/', '\\']).next().unwrap_or(main);
    match name_of(model) {
        "" => file.strip_suffix(".osim").unwrap_or(file).to_owned(),
        name => name.to_owned(),
    }
}

/// Gravity, units, locked coordinates, and bodies that are no part of the knee.
fn model_told(
    tree: &Tree<'_>,
    places: &places::Places<'_, '_>,
    knee: &knee::Knee,
    (model, objects): (Node<'_, '_>, &[Node<'_, '_>]),
) -> Result<Vec<Notice>, DeckError> {
    for (property, known) in [("length_units", ["m", "meters", "metres"]), ("force_units", ["N", "newtons", "newton"])]
    {
        let given = text(model, property).unwrap_or("").to_lowercase();
        if !given.is_empty() && !known.iter().any(|k| k.to_lowercase() == given) {
            return Err(tree.error(model, format!("<{property}> is {given}, expected {}", known[0])));
        }
    }
    let mut told = Vec::new();
    if tree.numbers(model, "gravity", [0.0; 3])?.iter().any(|g| *g != 0.0) {
        told.push(Kind::DeckOdd.notice("gravity is left out: the knee bears the loads of its trials alone"));
    }
    let locked = |n: &&Node<'_, '_>| {
        let on = |p: &str| text(**n, p) == Some("true");
        n.tag_name().name() == "Coordinate" && (on("locked") || on("prescribed"))
    };
    let between = places.between(knee.tibia, knee.femur).unwrap_or_default();
    let own = |n: &&Node<'_, '_>| between.iter().any(|j| n.ancestors().any(|a| a == j.node));
    let held: Vec<&str> = objects.iter().filter(locked).filter(own).map(|n| name_of(*n)).collect();
    if !held.is_empty() {
        let what = format!("coordinates are locked or prescribed there and free here: {}", held.join(", "));
        told.push(Kind::DeckOdd.notice(what).count(held.len()));
    }
    let rest: Vec<&str> =
        (1..places.bodies.len()).filter(|b| knee.place(*b).is_none()).map(|b| places.name(b)).collect();
    // bodies without extent between the knee's joints are how a chain is written
    let links: Vec<usize> = between.iter().flat_map(|j| [j.parent.body, j.child.body]).collect();
    let rest: Vec<&str> = rest.into_iter().filter(|name| !links.iter().any(|b| places.name(*b) == *name)).collect();
    if !rest.is_empty() {
        let what = format!("bodies that are no part of femur and tibia are left out: {}", rest.join(", "));
        told.push(Kind::DeckOdd.notice(what).count(rest.len()));
    }
    Ok(told)
}

/// A point of an element [mm].
fn point(tree: &Tree<'_>, node: Node<'_, '_>, property: &str) -> Result<Point, DeckError> {
    Ok(Point::from(tree.numbers(node, property, [0.0; 3])?) * MM_PER_M)
}

/// The files that a model names.
struct Files<'r, 'f> {
    main: &'r str,
    read: &'r mut ReadFile<'f>,
}

impl Files<'_, '_> {
    /// A fault of the model's file.
    fn fault(&self, line: usize, message: String) -> DeckError {
        DeckError { file: self.main.to_owned(), line, message }
    }

    /// A surface in the file's own units: beside the model, or in its folder Geometry, where OpenSim looks.
    fn surface(&mut self, name: &str) -> Result<TriMesh, String> {
        let beside = (self.read)(name);
        let bytes = beside.or_else(|first| (self.read)(&format!("Geometry/{name}")).map_err(|_| first))?;
        let read = formats::read_surface(name, &bytes, &BTreeMap::new()).map_err(|e| format!("{name}: {e}"))?;
        let mesh = read.welded().mesh;
        if mesh.triangles.is_empty() {
            return Err(format!("{name} has no triangles"));
        }
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests;

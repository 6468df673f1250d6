//! Sliding contacts: which surfaces meet, on which bones, and by which law they press.
//!
//! Between rigid faces the penalty is the law: pressure over overclosure [MPa/mm], once a pass. Cartilage that deforms is a layer on bone: an elastic foundation
//! of its modulus, Poisson's ratio and thickness, and its penalty is a matter of numerics.

use super::bodies::{Bodies, Knee};
use super::known::key;
use super::mesh::Mesh;
use super::sides::{Side, Sliding, is_on};
use crate::DeckError;
use crate::faces::{facing, free_path};
use crate::tree::{Tree, brief, name_of, text};
use meshes::Point;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::contact::layer::confined_modulus;
use sim::mesh::MeshValue;
use sim::spec::{ContactSpec, FramesSpec, LayerLaw, LayerSpec, PairSpec};
use std::collections::BTreeMap;

/// A layer is nowhere taken thinner than this [mm]: as of a build by thickness. Ours.
const THINNEST_MM: f64 = 0.5;
/// More than any pressure a millimetre of a cartilage [MPa/mm]; beyond, the unit is another. Ours.
const STIFFEST: f64 = 1e6;

/// The contact of a knee, and its surfaces.
pub(super) struct Contact {
    pub(super) spec: ContactSpec,
    pub(super) meshes: BTreeMap<String, MeshValue>,
    pub(super) told: Vec<Notice>,
}

/// By what a contact presses.
#[derive(Clone, Copy, PartialEq)]
enum Law {
    /// Pressure over overclosure [MPa/mm].
    Line(f64),
    /// Young's modulus [MPa], Poisson's ratio.
    Layer(f64, f64, LayerLaw),
}

/// Contact between femur and tibia.
///
/// Errors: none; pairs of several laws; what no model of ours can do.
pub(super) fn contact(
    tree: &Tree<'_>,
    (mesh, bodies, knee): (&Mesh, &Bodies<'_, '_>, &Knee),
    contacts: &[Sliding<'_, '_>],
    frames: &FramesSpec,
) -> Result<Contact, DeckError> {
    let sides = |c: &Sliding<'_, '_>| -> Option<[bool; 2]> {
        let of = |k: usize| c.sides[k].as_ref().and_then(|s| knee.is_femur(s.body));
        Some([of(0)?, of(1)?]).filter(|[a, b]| a != b)
    };
    let own: Vec<_> = contacts.iter().filter_map(|c| Some((c, sides(c)?))).collect();
    let Some((first, _)) = own.first() else {
        let what = format!("no sliding contact is between {} and {}", bodies.name(knee.femur), bodies.name(knee.tibia));
        return Err(DeckError { file: tree.file.to_owned(), line: 0, message: what });
    };
    let mut told = Vec::new();
    let law = law(tree, bodies, first, &mut told)?;
    let friction = friction(tree, first, &mut told)?;
    let mut out = Contact { spec: empty(friction), meshes: BTreeMap::new(), told };
    let mut paths: BTreeMap<&str, String> = BTreeMap::new();
    for (contact, femoral) in &own {
        if self::law(tree, bodies, contact, &mut Vec::new())? != law
            || self::friction(tree, contact, &mut Vec::new())? != friction
        {
            let what = format!(
                "{} and {} press by different laws; expected one law between femur and tibia",
                name_of(first.node),
                name_of(contact.node)
            );
            return Err(tree.error(contact.node, what));
        }
        let mut named = [String::new(), String::new()];
        for (side, femoral) in contact.sides.iter().flatten().zip(femoral) {
            if !paths.contains_key(side.surface.as_str()) {
                let path = free_path(if *femoral { "femur" } else { "tibia" }, &out.meshes);
                take(mesh, frames, side, (*femoral, &path, law), &mut out);
                paths.insert(&side.surface, path);
            }
            named[usize::from(!femoral)] = paths[side.surface.as_str()].clone();
        }
        let [femur, tibia] = named;
        let pair = PairSpec { femur, tibia };
        if !out.spec.pairs.contains(&pair) {
            out.spec.pairs.push(pair);
        }
    }
    table(&mut out, law);
    let others: Vec<&str> = contacts.iter().filter(|c| sides(c).is_none()).map(|c| name_of(c.node)).collect();
    if !others.is_empty() {
        let what = format!("contact that is not between femur and tibia is left out: {}", others.join(", "));
        out.told.push(Kind::DeckOdd.notice(what).count(others.len()));
    }
    if own.iter().any(|(c, _)| c.node.ancestors().any(|a| ["step", "Step"].contains(&a.tag_name().name()))) {
        out.told.push(Kind::DeckOdd.notice("contact acts from a step on there; here it acts always"));
    }
    Ok(out)
}

fn empty(friction: f64) -> ContactSpec {
    ContactSpec {
        overclosure_mm: vec![0.0, 1.0],
        pressure_mpa: vec![0.0, 1.0],
        friction,
        damping: 0.0,
        pairs: Vec::new(),
        layer: None,
    }
}

/// The law of a contact.
fn law(
    tree: &Tree<'_>,
    bodies: &Bodies<'_, '_>,
    contact: &Sliding<'_, '_>,
    told: &mut Vec<Notice>,
) -> Result<Law, DeckError> {
    let node = contact.node;
    let fault = |what: &str| Err(tree.error(node, what));
    for (name, why) in [
        ("tension", "holds surfaces together (tension); expected 0"),
        ("shell_bottom_primary", "presses by the other side of a shell; expected 0"),
        ("shell_bottom_secondary", "presses by the other side of a shell; expected 0"),
        ("self_contact", "is of a surface with itself; expected 0"),
    ] {
        if is_on(node, name) {
            return fault(why);
        }
    }
    if tree.number(node, "offset", 0.0)? != 0.0 {
        return fault("begins at an offset; expected 0");
    }
    if tree.number(node, "penalty_sf", 1.0)? != 1.0 {
        return fault("has a penalty that grows (penalty_sf); expected 1");
    }
    if is_on(node, "node_reloc") {
        told.push(Kind::DeckOdd.notice(format!("{}: node_reloc moves nodes there and none here", name_of(node))));
    }
    let mut layers = contact.sides.iter().flatten().filter_map(|s| s.layer.as_ref());
    let Some((part, _)) = layers.next() else { return penalty(tree, node) };
    let first = material(tree, bodies, *part)?;
    match layers.next().map(|(part, _)| material(tree, bodies, *part)).transpose()? {
        Some(second) if second != first => fault("its cartilages are of two materials; expected one material for both"),
        _ => Ok(first),
    }
}

/// The law of rigid faces.
fn penalty(tree: &Tree<'_>, node: Node<'_, '_>) -> Result<Law, DeckError> {
    let laugon = text(node, "laugon").unwrap_or("0").to_uppercase();
    if !["0", "PENALTY"].contains(&laugon.as_str()) {
        let what = format!("laugon is {}: rigid faces would not give way at all; expected PENALTY", brief(&laugon));
        return Err(tree.error(node, what));
    }
    if is_on(node, "auto_penalty") {
        let what = "auto_penalty is 1: the pressure of rigid faces would follow the size of each element; expected 0, and the penalty in MPa/mm";
        return Err(tree.error(node, what));
    }
    let penalty = tree.number(node, "penalty", 1.0)?;
    if !(penalty > 0.0 && penalty < STIFFEST) {
        return Err(tree.error(node, format!("penalty is {penalty}, expected MPa/mm, above 0 and below {STIFFEST:e}")));
    }
    // each pass adds its own force
    Ok(Law::Line(if is_on(node, "two_pass") { 2.0 * penalty } else { penalty }))
}

/// The law of a cartilage's material.
fn material(tree: &Tree<'_>, bodies: &Bodies<'_, '_>, part: usize) -> Result<Law, DeckError> {
    let Some(m) = bodies.of_part[part].map(|m| &bodies.materials[m]) else {
        let what = "a cartilage has no material that is read; expected a domain with one".to_owned();
        return Err(DeckError { file: tree.file.to_owned(), line: 0, message: what });
    };
    let number = |name: &str| tree.number(m.node, name, f64::NAN);
    let of_bulk = |shear: f64, bulk: f64| {
        let e = 9.0 * bulk * shear / (3.0 * bulk + shear);
        (e, (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear)))
    };
    let ((e, v), law) = match m.node.attribute("type").unwrap_or("").trim() {
        "neo-Hookean" | "Holmes-Mow" => ((number("E")?, number("v")?), LayerLaw::Logarithmic),
        "isotropic elastic" | "St.Venant-Kirchhoff" => ((number("E")?, number("v")?), LayerLaw::Linear),
        "Mooney-Rivlin" => {
            let shear = 2.0 * (number("c1")? + tree.number(m.node, "c2", 0.0)?);
            (of_bulk(shear, number("k")?), LayerLaw::Logarithmic)
        }
        "incomp neo-Hookean" => (of_bulk(number("G")?, number("k")?), LayerLaw::Logarithmic),
        other => {
            let what = format!(
                "a cartilage is of \"{}\"; expected neo-Hookean, isotropic elastic, St.Venant-Kirchhoff, Holmes-Mow, Mooney-Rivlin or incomp neo-Hookean",
                brief(other)
            );
            return Err(tree.error(m.node, what));
        }
    };
    if !(e > 0.0 && e < 1e5 && (0.0..0.5).contains(&v)) {
        let what = format!(
            "a cartilage's modulus is {e} MPa and its Poisson's ratio {v}; expected above 0, and 0 to below 0.5"
        );
        return Err(tree.error(m.node, what));
    }
    Ok(Law::Layer(e, v, law))
}

/// The friction of a contact; FEBio has none between facets.
fn friction(tree: &Tree<'_>, contact: &Sliding<'_, '_>, told: &mut Vec<Notice>) -> Result<f64, DeckError> {
    let given = tree.number(contact.node, "fric_coeff", 0.0)?;
    if given < 0.0 {
        return Err(tree.error(contact.node, format!("fric_coeff is {given}, expected 0 or more")));
    }
    let facets = key(contact.node).contains("facet-on-facet") || key(contact.node).contains("facet-to-facet");
    if facets && given > 0.0 {
        told.push(Kind::DeckOdd.notice("FEBio passes over the friction of sliding-facet-on-facet: so is it here"));
        return Ok(0.0);
    }
    Ok(given)
}

/// Takes a surface, and of cartilage that deforms its face on bone.
fn take(mesh: &Mesh, frames: &FramesSpec, side: &Side, (femoral, path, law): (bool, &str, Law), out: &mut Contact) {
    let mut surface = mesh.triangles(&side.faces);
    if Topology::of(&surface).is_closed() {
        surface = facing(&surface, femoral, frames);
        let what = format!(
            "{}: the surface is closed; its side towards the joint presses, {} of its triangles",
            side.surface,
            surface.triangles.len()
        );
        out.told.push(Kind::DeckOdd.notice(what).of(&side.surface));
    }
    if let (Some((_, bony)), Law::Layer(youngs_modulus_mpa, poissons_ratio, law)) = (&side.layer, law) {
        let bony_path = path.replace("articular", "bony");
        out.meshes.insert(bony_path.clone(), MeshValue::Surface(mesh.triangles(bony)));
        let layer = out.spec.layer.get_or_insert_with(|| LayerSpec {
            law,
            youngs_modulus_mpa,
            poissons_ratio,
            edge_spread: 0.0,
            least_thickness_mm: THINNEST_MM,
            bony_faces: BTreeMap::new(),
        });
        layer.bony_faces.insert(path.to_owned(), bony_path);
    }
    out.meshes.insert(path.to_owned(), MeshValue::Surface(surface));
}

/// The table: the penalty's line, or that of layers of their mean thickness.
fn table(out: &mut Contact, law: Law) {
    let slope = match law {
        Law::Line(slope) => slope,
        Law::Layer(e, v, _) => confined_modulus(e, v) / thickness(out).max(THINNEST_MM),
    };
    out.spec.pressure_mpa = vec![0.0, slope];
}

/// Mean thickness of the layers of both bones together [mm].
fn thickness(out: &Contact) -> f64 {
    let mesh = |path: &String| match out.meshes.get(path) {
        Some(MeshValue::Surface(mesh)) => Some(mesh),
        _ => None,
    };
    let mean = |femur: bool| {
        let all = out.spec.layer.iter().flat_map(|l| &l.bony_faces).filter(|(p, _)| p.contains("femur") == femur);
        let means: Vec<f64> = all.filter_map(|(path, bony)| Some(apart(mesh(path)?, mesh(bony)?))).collect();
        means.iter().sum::<f64>() / means.len().max(1) as f64
    };
    mean(true) + mean(false)
}

/// Mean distance of a face's vertices from another.
fn apart(face: &TriMesh, bony: &TriMesh) -> f64 {
    let Some(query) = SurfaceQuery::new(bony) else { return 0.0 };
    let far = |p: &Point| query.nearest(p).distance;
    face.vertices.iter().map(far).sum::<f64>() / face.vertices.len().max(1) as f64
}

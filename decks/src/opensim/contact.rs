//! Smith2018ArticularContactForce: which surfaces meet, and the law of their pressure.
//!
//! JAM: `p = M d / h`, or `p = -M ln(1 - d / h)`, of an overclosure `d` on layers of `h` together, with `M = E (1 - v) / ((1 + v) (1 - 2 v))`. Lumped, both
//! layers have the mean of `E` and of `v`; else each has its own, and both bear one pressure. A model has one law for all its pairs.

use super::knee::Knee;
use super::places::Places;
use super::tree::{Tree, child, name_of, text};
use super::{Files, MM_PER_M};
use crate::DeckError;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Isometry, Vector};
use notices::{Kind, Notice};
use roxmltree::Node;
use sim::contact::layer::confined_modulus;
use sim::mesh::MeshValue;
use sim::spec::{ContactSpec, FramesSpec, LayerLaw, LayerSpec, PairSpec};
use std::collections::BTreeMap;

/// JAM's values where a file has none: modulus [Pa], Poisson's ratio [-], thickness, least and largest thickness [m], deepest overclosure [m].
const MODULUS_PA: f64 = 1e6;
const POISSONS_RATIO: f64 = 0.5;
const THICKNESS_M: f64 = 0.005;
const LEAST_M: f64 = 0.001;
/// Points of a table that follows the logarithm, and the strain up to which it does, as `sim`'s own law by thickness [-].
const POINTS: usize = 40;
const MOST_STRAIN: f64 = 0.8;
/// Least and largest thickness that a model takes [mm].
const THINNEST_MM: f64 = 0.05;
const THICKEST_MM: f64 = 5.0;
/// Laws that differ by less than this share are one.
const SAME: f64 = 1e-9;

/// A contact mesh.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    pub(super) name: String,
    pub(super) body: usize,
    pub(super) body_name: String,
    /// From its own coordinates to its body's [mm].
    place: Isometry,
    scale: Vector,
    pub(super) file: String,
    back: Option<String>,
    /// [MPa]
    modulus: f64,
    poisson: f64,
    /// [mm]
    thickness: f64,
    least: f64,
    line: usize,
}

/// A contact force: its target and its casting mesh.
#[derive(Clone, Debug)]
pub(super) struct Force {
    name: String,
    pub(super) meshes: [Mesh; 2],
    lumped: bool,
    law: LayerLaw,
    from: f64,
    line: usize,
}

/// The contact forces that act.
///
/// Errors: a mesh that is not there, numbers that no cartilage has.
pub(super) fn forces<'a, 'i>(
    tree: &Tree<'_>,
    places: &Places<'a, 'i>,
    objects: &[Node<'a, 'i>],
) -> Result<Vec<Force>, DeckError> {
    let of = |class: &'static str| objects.iter().copied().filter(move |o| o.tag_name().name() == class);
    let mut found = Vec::new();
    for node in of("Smith2018ArticularContactForce") {
        if !tree.flag(node, "appliesForce", true)? {
            continue;
        }
        let mesh = |socket: &str| {
            let named = text(node, socket).unwrap_or("");
            let last = named.rsplit('/').next().unwrap_or(named);
            let given = of("Smith2018ContactMesh").find(|m| name_of(*m) == last && !last.is_empty());
            given.map(|m| read_mesh(tree, places, m)).unwrap_or_else(|| {
                let what = format!("<{socket}> names \"{named}\", which is no Smith2018ContactMesh of the model");
                Err(tree.error(node, what))
            })
        };
        let law = match text(node, "elastic_foundation_formulation").unwrap_or("linear") {
            "linear" => LayerLaw::Linear,
            "nonlinear" => LayerLaw::Logarithmic,
            other => {
                let what = format!("<elastic_foundation_formulation> is \"{other}\", expected linear or nonlinear");
                return Err(tree.error(node, what));
            }
        };
        found.push(Force {
            name: name_of(node).to_owned(),
            meshes: [mesh("socket_target_mesh")?, mesh("socket_casting_mesh")?],
            lumped: tree.flag(node, "use_lumped_contact_model", true)?,
            law,
            from: tree.number(node, "min_proximity", 0.0)? * MM_PER_M,
            line: tree.line(node),
        });
    }
    Ok(found)
}

fn read_mesh<'a, 'i>(tree: &Tree<'_>, places: &Places<'a, 'i>, node: Node<'a, 'i>) -> Result<Mesh, DeckError> {
    let fault = |what: String| Err(tree.error(node, what));
    let frame = places.socket(node, "socket_frame")?;
    let own = tree.motion(node, "location", "orientation")?;
    let scale = tree.numbers(node, "scale_factors", [1.0; 3])?;
    if scale.iter().any(|s| *s <= 0.0) {
        return fault(format!("<scale_factors> are {scale:?}, expected above 0"));
    }
    let file = text(node, "mesh_file").unwrap_or("").to_owned();
    if file.is_empty() {
        return fault("<mesh_file> is missing; expected a surface as STL, OBJ or VTP".into());
    }
    let variable = tree.flag(node, "use_variable_thickness", false)?;
    let back = text(node, "mesh_back_file").filter(|b| variable && !b.is_empty()).map(str::to_owned);
    if variable && back.is_none() {
        return fault("<use_variable_thickness> is true without <mesh_back_file>".into());
    }
    let modulus = tree.number(node, "elastic_modulus", MODULUS_PA)? * 1e-6;
    let poisson = tree.number(node, "poissons_ratio", POISSONS_RATIO)?;
    let thickness = tree.number(node, "thickness", THICKNESS_M)? * MM_PER_M;
    let least = tree.number(node, "min_thickness", LEAST_M)? * MM_PER_M;
    if modulus <= 0.0 || modulus >= 1e5 {
        return fault(format!("<elastic_modulus> is {modulus:e} MPa, expected Pa: above 0 and below 1e11"));
    }
    if !(0.0..0.5).contains(&poisson) {
        return fault(format!(
            "<poissons_ratio> is {poisson}, expected 0 to below 0.5 (JAM takes 0.5 where none is given, which nothing can press)"
        ));
    }
    if !(thickness > 0.0 && thickness <= 20.0) {
        return fault(format!("<thickness> is {thickness} mm, expected metres: above 0 and at most 0.02"));
    }
    let (name, body_name) = (name_of(node).to_owned(), places.name(frame.body).to_owned());
    let (scale, place, line) = (Vector::from(scale), frame.place * own, tree.line(node));
    Ok(Mesh { name, body: frame.body, body_name, place, scale, file, back, modulus, poisson, thickness, least, line })
}

impl Mesh {
    /// A file of it in the knee's coordinates [mm].
    fn surface(&self, knee: &Knee, files: &mut Files<'_, '_>, file: &str) -> Result<TriMesh, DeckError> {
        let place = knee.place(self.body).unwrap_or_else(Isometry::identity) * self.place;
        let mut mesh = files.surface(file).map_err(|e| files.fault(self.line, e))?;
        for p in &mut mesh.vertices {
            *p = place * meshes::Point::from(p.coords.component_mul(&self.scale) * MM_PER_M);
        }
        Ok(mesh)
    }
}

/// The contact of a knee, and its surfaces.
pub(super) struct Contact {
    pub(super) spec: ContactSpec,
    pub(super) meshes: BTreeMap<String, MeshValue>,
    pub(super) told: Vec<Notice>,
}

/// Contact between femur and tibia.
///
/// Errors: none; pairs of several laws; surfaces that cannot be read.
pub(super) fn contact(
    knee: &Knee,
    forces: &[Force],
    frames: &FramesSpec,
    files: &mut Files<'_, '_>,
) -> Result<Contact, DeckError> {
    let (own, others): (Vec<&Force>, Vec<&Force>) = forces.iter().partition(|f| knee.joins(f));
    let Some(first) = own.first() else {
        return Err(files.fault(0, "no Smith2018ArticularContactForce acts between femur and tibia".into()));
    };
    let mut out = Contact { spec: table_of(first, files)?, meshes: BTreeMap::new(), told: Vec::new() };
    let mut paths: BTreeMap<(String, usize), String> = BTreeMap::new();
    for force in &own {
        if !same(&table_of(force, files)?, &out.spec) || (force.law, force.has_back()) != (first.law, first.has_back())
        {
            let what = format!(
                "{} and {} press by different laws; expected one law between femur and tibia",
                first.name, force.name
            );
            return Err(files.fault(force.line, what));
        }
        let [mut femur, mut tibia] = [String::new(), String::new()];
        for mesh in &force.meshes {
            let femoral = knee.bone(mesh.body) == knee.femur;
            let key = (mesh.name.clone(), mesh.body);
            if !paths.contains_key(&key) {
                let path = free_path(if femoral { "femur" } else { "tibia" }, &out.meshes);
                take((knee, frames), (force, mesh), (femoral, &path), files, &mut out)?;
                paths.insert(key.clone(), path);
            }
            *(if femoral { &mut femur } else { &mut tibia }) = paths[&key].clone();
        }
        out.spec.pairs.push(PairSpec { femur, tibia });
        if force.from > 0.0 {
            out.told.push(
                Kind::DeckOdd.notice(format!("{}: min_proximity is passed over: contact begins at 0", force.name)),
            );
        }
    }
    if !others.is_empty() {
        let names: Vec<&str> = others.iter().map(|f| f.name.as_str()).collect();
        let text = format!("contact that is not between femur and tibia is left out: {}", names.join(", "));
        out.told.push(Kind::DeckOdd.notice(text).count(others.len()));
    }
    Ok(out)
}

fn same(a: &ContactSpec, b: &ContactSpec) -> bool {
    let close = |a: &[f64], b: &[f64]| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME * (1.0 + b.abs()))
    };
    close(&a.overclosure_mm, &b.overclosure_mm) && close(&a.pressure_mpa, &b.pressure_mpa)
}

fn free_path(bone: &str, taken: &BTreeMap<String, MeshValue>) -> String {
    let name = |n: usize| match n {
        0 => format!("meshes/articular_{bone}.ply"),
        n => format!("meshes/articular_{bone}_{}.ply", n + 1),
    };
    (0..).map(name).find(|n| !taken.contains_key(n)).unwrap_or_default()
}

/// Takes a surface, and the face on bone where thickness is counted from it.
fn take(
    (knee, frames): (&Knee, &FramesSpec),
    (force, mesh): (&Force, &Mesh),
    (femoral, path): (bool, &str),
    files: &mut Files<'_, '_>,
    out: &mut Contact,
) -> Result<(), DeckError> {
    let mut surface = mesh.surface(knee, files, &mesh.file.clone())?;
    if Topology::of(&surface).is_closed() {
        surface = facing(&surface, femoral, frames);
        out.told.push(
            Kind::DeckOdd
                .notice(format!(
                    "{}: the surface is closed; its side towards the joint presses, {} of its triangles",
                    mesh.name,
                    surface.triangles.len()
                ))
                .of(&mesh.name),
        );
    }
    if force.has_back() {
        let bony = path.replace("articular", "bony");
        let back = match &mesh.back {
            Some(file) => mesh.surface(knee, files, file)?,
            // a layer of one thickness has its back that far behind
            None => behind(&surface, mesh.thickness),
        };
        out.meshes.insert(bony.clone(), MeshValue::Surface(back));
        let (modulus, poisson) = force.material();
        let least = force.meshes.iter().map(|m| m.least).fold(THINNEST_MM, f64::max).min(THICKEST_MM);
        let layer = out.spec.layer.get_or_insert_with(|| LayerSpec {
            law: force.law,
            youngs_modulus_mpa: modulus,
            poissons_ratio: poisson,
            edge_spread: 0.0,
            least_thickness_mm: least,
            bony_faces: BTreeMap::new(),
        });
        layer.bony_faces.insert(path.to_owned(), bony);
    }
    out.meshes.insert(path.to_owned(), MeshValue::Surface(surface));
    Ok(())
}

/// The side of a closed cartilage towards the joint: of the tibia what looks up, of the femur what looks away from its axis.
fn facing(surface: &TriMesh, femoral: bool, frames: &FramesSpec) -> TriMesh {
    let (origin, across) = (frames.femur.origin, frames.femur.medial);
    let keep = |t: usize| {
        let [a, b, c] = surface.corners(t);
        let from = (a.coords + b.coords + c.coords) / 3.0 - origin.coords;
        let way = if femoral { from - across * from.dot(&across) } else { frames.tibia.superior };
        surface.area_vector(t).dot(&way) > 0.0
    };
    surface.submesh(keep).0
}

fn behind(surface: &TriMesh, depth: f64) -> TriMesh {
    let normals = surface.vertex_normals();
    let vertices = surface.vertices.iter().zip(&normals).map(|(p, n)| p - n * depth).collect();
    TriMesh { vertices, triangles: surface.triangles.clone() }
}

impl Force {
    /// Whether one of its layers has a thickness of its own at each place.
    fn has_back(&self) -> bool {
        self.meshes.iter().any(|m| m.back.is_some())
    }

    /// Modulus [MPa] and Poisson's ratio of both layers, where they are taken as one.
    fn material(&self) -> (f64, f64) {
        let [a, b] = &self.meshes;
        ((a.modulus + b.modulus) / 2.0, (a.poisson + b.poisson) / 2.0)
    }

    /// Overclosure [mm] and pressure [MPa] of layers of one thickness each.
    fn table(&self) -> (Vec<f64>, Vec<f64>) {
        let [a, b] = &self.meshes;
        let (modulus, poisson) = self.material();
        let lumped = confined_modulus(modulus, poisson);
        let height = a.thickness + b.thickness;
        let [ka, kb] = [a, b].map(|m| confined_modulus(m.modulus, m.poisson));
        match (self.law, self.lumped) {
            (LayerLaw::Linear, true) => (vec![0.0, 1.0], vec![0.0, lumped / height]),
            (LayerLaw::Linear, false) => (vec![0.0, 1.0], vec![0.0, 1.0 / (a.thickness / ka + b.thickness / kb)]),
            (LayerLaw::Logarithmic, lump) => {
                let stiffest = if lump { lumped } else { ka.max(kb) };
                let most = -stiffest * (1.0 - MOST_STRAIN).ln();
                let pressure: Vec<f64> = (0..=POINTS).map(|n| most * n as f64 / POINTS as f64).collect();
                let depth = |p: &f64| match lump {
                    true => height * (1.0 - (-p / lumped).exp()),
                    false => a.thickness * (1.0 - (-p / ka).exp()) + b.thickness * (1.0 - (-p / kb).exp()),
                };
                (pressure.iter().map(depth).collect(), pressure)
            }
        }
    }
}

/// The contact of a force without its pairs.
///
/// Errors: layers of two materials, one of which has a thickness of its own at each place.
fn table_of(force: &Force, files: &Files<'_, '_>) -> Result<ContactSpec, DeckError> {
    let [a, b] = &force.meshes;
    if force.has_back() && !force.lumped && (a.modulus, a.poisson) != (b.modulus, b.poisson) {
        let what = format!(
            "{} and {} are of two materials and one has a thickness that varies; expected one material, or use_lumped_contact_model true",
            a.name, b.name
        );
        return Err(files.fault(force.line, what));
    }
    let (overclosure_mm, pressure_mpa) = force.table();
    Ok(ContactSpec { overclosure_mm, pressure_mpa, friction: 0.0, damping: 0.0, pairs: Vec::new(), layer: None })
}

/// Whether the model holds contact meshes of a file.
pub(super) fn names_file(objects: &[Node<'_, '_>], file: &str) -> bool {
    let of = |o: &&Node<'_, '_>| o.tag_name().name() == "Smith2018ContactMesh";
    objects.iter().filter(of).any(|m| child(*m, "mesh_file").and_then(|f| f.text()).is_some_and(|t| t.trim() == file))
}

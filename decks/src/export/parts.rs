//! The included files: meshes, joint, ligaments, contact.

use super::number;
use meshes::{Point, Vector};
use notices::{Kind, Notice};
use sim::SimError;
use sim::joint::Joint;
use sim::mesh::MeshValue;
use sim::spec::{AxisSpec, BundleSpec, ModelSpec};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Reference nodes of the bones.
pub(super) const TIBIA: u64 = 1;
const FEMUR: u64 = 2;
/// Toes behind slack at which the last line of a table has its first point [-], as in the published decks.
const LINE_FROM: f64 = 4.0;

/// A line with a node.
fn node(out: &mut String, label: u64, p: &Point) {
    let _ = writeln!(out, "{label}, {}, {}, {}", number(p.x), number(p.y), number(p.z));
}

/// Labels handed out so far.
struct Labels {
    next: u64,
}

impl Labels {
    /// First label of a block of `n`.
    fn take(&mut self, n: usize) -> u64 {
        let first = self.next;
        self.next += n as u64;
        first
    }
}

/// Meshes, and what they are as bodies: two files, so that a reader of meshes finds nothing else in the first.
#[derive(Default)]
pub(super) struct Geometry {
    /// Nodes of all meshes, one block.
    nodes: String,
    /// Elements, a set a mesh.
    elements: String,
    /// Reference nodes, masses, rigid bodies, ties, sections and surfaces.
    pub(super) bodies: String,
}

impl Geometry {
    /// The file of the meshes.
    pub(super) fn meshes(&self) -> String {
        format!("*NODE\n{}{}", self.nodes, self.elements)
    }
}

/// Bones, cartilages and contact faces, each a rigid body tied to its bone.
pub(super) fn geometry(
    spec: &ModelSpec,
    meshes: &BTreeMap<String, MeshValue>,
    warnings: &mut Vec<Notice>,
) -> Result<Geometry, SimError> {
    let mut out = Geometry::default();
    for (label, name) in [(TIBIA, "tibia"), (FEMUR, "femur")] {
        let origin = if label == FEMUR { &spec.frames.femur.origin } else { &spec.frames.tibia.origin };
        let _ = writeln!(out.bodies, "** reference node of the {name}\n*NODE");
        node(&mut out.bodies, label, origin);
    }
    let mut labels = Labels { next: 1_000_001 };
    for body in spec.bodies.iter().filter(|b| b.acts()) {
        let femur = body.name == "femur";
        let (reference, upper) = if femur { (FEMUR, "FEMUR") } else { (TIBIA, "TIBIA") };
        let bone = meshes.get(&body.bone).ok_or_else(|| missing(&body.bone))?;
        mesh_block(&mut out, &mut labels, &format!("BONE-{upper}"), bone);
        let _ = writeln!(out.bodies, "*RIGID BODY, ELSET=BONE-{upper}, REF NODE={reference}");
        point_mass(&mut out.bodies, reference, upper, [body.mass_tonne, body.inertia_tonne_mm2]);
        for path in &body.cartilage {
            match meshes.get(path) {
                Some(mesh @ (MeshValue::Hex(_) | MeshValue::Tet(_))) => {
                    part(&mut out, &mut labels, &set_name("CART", path, femur), mesh, reference);
                    let set = set_name("CART", path, femur);
                    let _ = writeln!(out.bodies, "*SOLID SECTION, ELSET={set}, MATERIAL=CARTILAGE\n1.0,");
                }
                _ => warnings.push(
                    Kind::SolidMissing
                        .notice(format!("{path}: no solid mesh given, left out (contact does not need it)"))
                        .file(path),
                ),
            }
        }
    }
    out.bodies += "*MATERIAL, NAME=CARTILAGE\n*DENSITY\n1.81e-8,\n*ELASTIC, TYPE=ISO\n12.0, 0.45\n";
    let mut done = Vec::new();
    for pair in &spec.contact.pairs {
        for (path, femur) in [(&pair.femur, true), (&pair.tibia, false)] {
            if done.contains(path) {
                continue;
            }
            let mesh = meshes.get(path).filter(|m| matches!(m, MeshValue::Surface(_))).ok_or_else(|| missing(path))?;
            let set = set_name("ART", path, femur);
            part(&mut out, &mut labels, &set, mesh, if femur { FEMUR } else { TIBIA });
            let _ = writeln!(out.bodies, "*SURFACE, TYPE=ELEMENT, NAME=SURF-{set}\n{set}, SPOS");
            done.push(path.clone());
        }
    }
    Ok(out)
}

fn missing(path: &str) -> SimError {
    SimError::Spec(format!("mesh {path} is not given, or is no surface"))
}

/// A set's name from a mesh's path: which bone, which side, so that the importer names it alike.
pub(super) fn set_name(prefix: &str, path: &str, femur: bool) -> String {
    let stem = path.rsplit(['/', '\\']).next().unwrap_or(path).to_lowercase();
    let stem = stem.rsplit_once('.').map_or(stem.as_str(), |(s, _)| s).to_owned();
    let compartment = match (stem.contains("med"), stem.contains("lat")) {
        (true, _) => "-MED",
        (_, true) => "-LAT",
        _ => "",
    };
    format!("{prefix}-{}{compartment}", if femur { "FEMUR" } else { "TIBIA" })
}

/// A mesh as a rigid body with its own reference node, tied to a bone's.
fn part(out: &mut Geometry, labels: &mut Labels, set: &str, mesh: &MeshValue, bone: u64) {
    mesh_block(out, labels, set, mesh);
    let (reference, out) = (labels.take(1), &mut out.bodies);
    let _ = writeln!(out, "*NODE");
    node(out, reference, &Point::origin());
    let _ = writeln!(out, "*RIGID BODY, ELSET={set}, REF NODE={reference}\n*MPC\nBEAM, {reference}, {bone}");
}

fn mesh_block(out: &mut Geometry, labels: &mut Labels, set: &str, mesh: &MeshValue) {
    let (points, kind, elements): (&[Point], &str, Vec<&[u32]>) = match mesh {
        MeshValue::Surface(m) => (&m.vertices, "R3D3", m.triangles.iter().map(|e| &e[..]).collect()),
        MeshValue::Hex(m) => (&m.nodes, "C3D8R", m.elements.iter().map(|e| &e[..]).collect()),
        MeshValue::Tet(m) => (&m.nodes, "C3D4", m.elements.iter().map(|e| &e[..]).collect()),
    };
    let first = labels.take(points.len());
    for (i, p) in points.iter().enumerate() {
        node(&mut out.nodes, first + i as u64, p);
    }
    let (number, out) = (labels.take(elements.len()), &mut out.elements);
    let _ = writeln!(out, "*ELEMENT, TYPE={kind}, ELSET={set}");
    for (i, e) in elements.iter().enumerate() {
        let nodes: Vec<String> = e.iter().map(|n| (first + u64::from(*n)).to_string()).collect();
        let _ = writeln!(out, "{}, {}", number + i as u64, nodes.join(", "));
    }
}

fn point_mass(out: &mut String, at: u64, name: &str, [mass, inertia]: [f64; 2]) {
    let (m, i) = (number(mass), number(inertia));
    let (e, r) = (100 + at, 200 + at);
    let _ = writeln!(out, "*ELEMENT, TYPE=MASS, ELSET={name}_MASS\n{e}, {at}\n*MASS, ELSET={name}_MASS\n{m},");
    let _ = writeln!(out, "*ELEMENT, TYPE=ROTARYI, ELSET={name}_ROT\n{r}, {at}");
    let _ = writeln!(out, "*ROTARY INERTIA, ELSET={name}_ROT\n{i}, {i}, {i}");
}

/// Frames and the chain of three cylindrical connectors.
pub(super) fn joint(spec: &ModelSpec, joint: &Joint) -> String {
    let mut out =
        String::from("** frames: origin, then medial, anterior, superior, 100 mm away\n*NODE, NSET=REF_FRAMES\n");
    for (base, f) in [(1001, &spec.frames.femur), (1011, &spec.frames.tibia)] {
        node(&mut out, base, &f.origin);
        for (i, axis) in [f.medial, f.anterior, f.superior].iter().enumerate() {
            node(&mut out, base + 1 + i as u64, &(f.origin + axis * 100.0));
        }
    }
    let [si, ap, ml] = match &spec.frames.chain {
        Some(chain) => [chain.si, chain.ap, chain.ml],
        None => {
            let [si, ap, ml] = *joint.axes();
            [si, ap, AxisSpec { point: nearest_point(&ml, &ap), ..ml }]
        }
    };
    out += "** 1021 tibia, 1022 and 1023 ends of the floating axis, 1024 femur\n*NODE\n";
    for (label, p) in [(1021, si.point), (1022, ap.point), (1023, ml.point), (1024, ml.point)] {
        node(&mut out, label, &p);
    }
    for (base, axis) in [(1031, si), (1041, ap), (1051, ml)] {
        node(&mut out, base, &(axis.point + axis.direction * 100.0));
        node(&mut out, base + 1, &(axis.point + aside(&axis.direction) * 100.0));
        node(&mut out, base + 2, &axis.point);
    }
    out += "*MPC\n";
    for label in (1001..=1004).chain([1024]).chain(1051..=1053) {
        let _ = writeln!(out, "BEAM, {label}, {FEMUR}");
    }
    for label in (1011..=1014).chain([1021]).chain(1031..=1033).chain(1041..=1043) {
        let _ = writeln!(out, "BEAM, {label}, {TIBIA}");
    }
    for (element, set, a, b, base) in
        [(1061, "SI", 1021, 1022, 1031), (1062, "AP", 1022, 1023, 1041), (1063, "ML", 1023, 1024, 1051)]
    {
        let _ = writeln!(out, "*ELEMENT, TYPE=CONN3D2, ELSET=AXIS_TF_{set}\n{element}, {a}, {b}");
        let _ = writeln!(out, "*CONNECTOR SECTION, ELSET=AXIS_TF_{set}\nCYLINDRICAL,\nAXIS_TF_{set}_ORI,");
        let _ = writeln!(out, "*ORIENTATION, NAME=AXIS_TF_{set}_ORI, DEFINITION=NODES");
        let _ = writeln!(out, "{base}, {}, {}", base + 1, base + 2);
    }
    out += "*ELEMENT, TYPE=MASS, ELSET=AXIS_MASS\n1071, 1022\n1072, 1023\n*MASS, ELSET=AXIS_MASS\n1e-6,\n";
    out += "*ELEMENT, TYPE=ROTARYI, ELSET=AXIS_ROT\n1073, 1022\n1074, 1023\n*ROTARY INERTIA, ELSET=AXIS_ROT\n0.001, 0.001, 0.001\n";
    out
}

/// A unit vector square to `d`.
fn aside(d: &Vector) -> Vector {
    let least = d.iamin();
    let mut e = Vector::zeros();
    e[least] = 1.0;
    d.cross(&e).normalize()
}

/// The point of axis `a` nearest to axis `b`.
fn nearest_point(a: &AxisSpec, b: &AxisSpec) -> Point {
    let n = a.direction.cross(&b.direction);
    a.point + a.direction * ((b.point - a.point).cross(&b.direction).dot(&n) / n.norm_squared())
}

/// Fibres as axial connectors with the bundle's force table, in terms of its parameters.
pub(super) fn ligaments(spec: &ModelSpec) -> Result<String, SimError> {
    let mut out = String::new();
    let mut label = 2001;
    let mut sets = Vec::new();
    for b in &spec.bundles {
        let fibres: Vec<_> = spec.fibres.iter().filter(|f| f.bundle == b.name).collect();
        if fibres.is_empty() {
            continue;
        }
        let (mut nodes, mut elements, mut ties) = (String::new(), String::new(), String::new());
        for f in &fibres {
            node(&mut nodes, label, &f.femur);
            node(&mut nodes, label + 1, &f.tibia);
            let _ = writeln!(ties, "BEAM, {label}, {FEMUR}\nBEAM, {}, {TIBIA}", label + 1);
            let _ = writeln!(elements, "{label}, {label}, {}", label + 1);
            label += 2;
        }
        let name = &b.name;
        let _ = write!(out, "*NODE\n{nodes}*ELEMENT, TYPE=CONN3D2, ELSET={name}_1D\n{elements}*MPC\n{ties}");
        force_table(&mut out, b, fibres.len(), spec.toe_end_multiple.get(name).copied())?;
        sets.push(format!("{name}_1D"));
    }
    let _ = writeln!(out, "*ELSET, ELSET=FIBRES\n{}", sets.join("\n"));
    Ok(out)
}

fn force_table(out: &mut String, b: &BundleSpec, fibres: usize, end: Option<f64>) -> Result<(), SimError> {
    let n = &b.name;
    let _ = writeln!(out, "*CONNECTOR SECTION, ELSET={n}_1D, BEHAVIOR={n}_BEHAVIOR\nAXIAL,\n*PARAMETER");
    for (key, value) in [
        ("L", b.reference_length_mm),
        ("EREF", b.reference_strain),
        ("ET", b.toe_strain),
        ("K2", b.stiffness_n_per_mm),
        ("N", fibres as f64),
    ] {
        let _ = writeln!(out, "{n}_{key}={}", number(value));
    }
    let _ = writeln!(out, "{n}_L0={n}_L/{n}_EREF\n{n}_T={n}_ET*{n}_L0\n{n}_D0={n}_L0-{n}_L\n{n}_DF={n}_D0-50.0");
    let mut rows = format!("0.0, <{n}_DF>\n0.0, <{n}_D0>\n");
    for (i, [x, f]) in rows_of(b, fibres, end)?.into_iter().enumerate() {
        let _ = writeln!(out, "{n}_U{i}={n}_D0+{}*{n}_T\n{n}_F{i}={n}_K2/{n}_N*{n}_T*{}", number(x), number(f));
        let _ = writeln!(rows, "<{n}_F{i}>, <{n}_U{i}>");
    }
    let _ =
        write!(out, "*CONNECTOR BEHAVIOR, NAME={n}_BEHAVIOR\n*CONNECTOR ELASTICITY, COMPONENT=1, NONLINEAR\n{rows}");
    out.push_str("*CONNECTOR DAMPING, COMPONENT=1\n0.05\n");
    Ok(())
}

/// Rows of a law's table behind slack: stretch in toes, force over stiffness times toe; its last line by two points, as the published decks have it.
fn rows_of(b: &BundleSpec, fibres: usize, end: Option<f64>) -> Result<Vec<[f64; 2]>, SimError> {
    let law = sim::ligament::of_fibres(b, fibres, end)?;
    let mut rows: Vec<[f64; 2]> = law.shape().into_iter().skip(1).collect();
    for toes in [LINE_FROM, law.table_end] {
        if rows.last().is_none_or(|last| last[0] < toes) {
            let force = law.response(toes * law.toe_mm()).force;
            rows.push([toes, force * fibres as f64 / (law.stiffness * law.toe_mm())]);
        }
    }
    Ok(rows)
}

/// The pressure-overclosure law and the pairs.
pub(super) fn contact(spec: &ModelSpec) -> String {
    let c = &spec.contact;
    let mut out =
        String::from("*SURFACE INTERACTION, NAME=RIGID_INTERACT\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n");
    for (p, o) in c.pressure_mpa.iter().zip(&c.overclosure_mm) {
        let _ = writeln!(out, "{}, {}", number(*p), number(*o));
    }
    let _ = writeln!(out, "*FRICTION\n{},", number(c.friction));
    let _ = writeln!(out, "*CONTACT DAMPING, DEFINITION=DAMPING COEFFICIENT\n{},", number(c.damping));
    for (i, pair) in c.pairs.iter().enumerate() {
        let _ = writeln!(
            out,
            "*CONTACT PAIR, CPSET=PAIR_{}, MECHANICAL CONSTRAINT=PENALTY, INTERACTION=RIGID_INTERACT, WEIGHT=0.5",
            i + 1
        );
        let (tibia, femur) = (set_name("ART", &pair.tibia, false), set_name("ART", &pair.femur, true));
        let _ = writeln!(out, "SURF-{tibia}, SURF-{femur}");
    }
    out
}

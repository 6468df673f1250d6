//! The contact forces and meshes that an OpenSim model states, and the law of their pressure.
//!
//! JAM: `p = M d / h`, or `p = -M ln(1 - d / h)`, of an overclosure `d` on layers of `h` together, with `M = E (1 - v) / ((1 + v) (1 - 2 v))`. Lumped, both
//! layers have the mean of `E` and of `v`; else each has its own, and both bear one pressure.

use super::MM_PER_M;
use super::places::Places;
use crate::DeckError;
use crate::tree::{Tree, child, name_of, text};
use meshes::{Isometry, Vector};
use notices::plain;
use roxmltree::Node;
use sim::contact::layer::confined_modulus;
use sim::spec::LayerLaw;

/// JAM's values where a file has none: modulus [Pa], Poisson's ratio [-], thickness, least and largest thickness [m], deepest overclosure [m].
const MODULUS_PA: f64 = 1e6;
const POISSONS_RATIO: f64 = 0.5;
const THICKNESS_M: f64 = 0.005;
const LEAST_M: f64 = 0.001;
/// Points of a table that follows the logarithm, and the strain up to which it does, as `sim`'s own law by thickness [-].
const POINTS: usize = 40;
const MOST_STRAIN: f64 = 0.8;
/// A contact mesh.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    pub(super) name: String,
    pub(super) body: usize,
    pub(super) body_name: String,
    /// From its own coordinates to its body's [mm].
    pub(super) place: Isometry,
    pub(super) scale: Vector,
    pub(super) file: String,
    pub(super) back: Option<String>,
    /// [MPa]
    pub(super) modulus: f64,
    pub(super) poisson: f64,
    /// [mm]
    pub(super) thickness: f64,
    pub(super) least: f64,
    pub(super) line: usize,
}

/// A contact force: its target and its casting mesh.
#[derive(Clone, Debug)]
pub(super) struct Force {
    pub(super) name: String,
    pub(super) meshes: [Mesh; 2],
    pub(super) lumped: bool,
    pub(super) law: LayerLaw,
    pub(super) from: f64,
    pub(super) line: usize,
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
        return fault(format!("<thickness> is {} mm, expected metres: above 0 and at most 0.02", plain(thickness)));
    }
    let (name, body_name) = (name_of(node).to_owned(), places.name(frame.body).to_owned());
    let (scale, place, line) = (Vector::from(scale), frame.place * own, tree.line(node));
    Ok(Mesh { name, body: frame.body, body_name, place, scale, file, back, modulus, poisson, thickness, least, line })
}

impl Force {
    /// Whether one of its layers has a thickness of its own at each place.
    pub(super) fn has_back(&self) -> bool {
        self.meshes.iter().any(|m| m.back.is_some())
    }

    /// Modulus [MPa] and Poisson's ratio of both layers, where they are taken as one.
    pub(super) fn material(&self) -> (f64, f64) {
        let [a, b] = &self.meshes;
        ((a.modulus + b.modulus) / 2.0, (a.poisson + b.poisson) / 2.0)
    }

    /// Overclosure [mm] and pressure [MPa] of layers of one thickness each.
    pub(super) fn table(&self) -> (Vec<f64>, Vec<f64>) {
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

/// Whether the model holds contact meshes of a file.
pub(super) fn names_file(objects: &[Node<'_, '_>], file: &str) -> bool {
    let of = |o: &&Node<'_, '_>| o.tag_name().name() == "Smith2018ContactMesh";
    objects.iter().filter(of).any(|m| child(*m, "mesh_file").and_then(|f| f.text()).is_some_and(|t| t.trim() == file))
}

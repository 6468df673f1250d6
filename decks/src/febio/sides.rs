//! Which surfaces slide on each other, and on which bodies they lie: of a rigid part, or of cartilage that deforms.

use super::bodies::{Bodies, Knee, Sided};
use super::known::key;
use super::mesh::{Face, Mesh, sorted};
use crate::DeckError;
use crate::tree::{Tree, brief, text};
use meshes::{Point, Vector};
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};

/// A surface in contact.
pub(super) struct Side {
    pub(super) surface: String,
    pub(super) body: usize,
    pub(super) faces: Vec<Face>,
    /// Of cartilage that deforms: its part, and its faces on bone.
    pub(super) layer: Option<(usize, Vec<Face>)>,
    names: String,
}

/// A sliding contact; `None` on a side that lies on no rigid body.
pub(super) struct Sliding<'a, 'i> {
    pub(super) node: Node<'a, 'i>,
    pub(super) sides: [Option<Side>; 2],
}

/// Finds which body a surface is of.
struct Finder<'t, 'a, 'i> {
    mesh: &'t Mesh,
    bodies: &'t Bodies<'a, 'i>,
    /// Outer faces of the solid parts that deform, in the order of the file.
    outer: BTreeMap<usize, Vec<Face>>,
    known: BTreeMap<usize, BTreeSet<Face>>,
    tied: Vec<[String; 2]>,
}

/// The sliding contacts of a file.
///
/// Errors: a pair that is not there.
pub(super) fn contacts<'a, 'i>(
    tree: &Tree<'_>,
    mesh: &Mesh,
    bodies: &Bodies<'a, 'i>,
    objects: &[Node<'a, 'i>],
) -> Result<Vec<Sliding<'a, 'i>>, DeckError> {
    let of = |tied: bool| {
        let all = objects.iter().copied().filter(|o| o.tag_name().name() == "contact");
        all.filter(move |c| key(*c).contains("tied") == tied)
    };
    let pair = |node: Node<'a, 'i>| {
        let named = node.attribute("surface_pair").unwrap_or("");
        let found = mesh.pairs.get(named).cloned();
        found.ok_or_else(|| tree.error(node, format!("\"{}\" is no SurfacePair of the mesh", brief(named))))
    };
    let tied = of(true).map(pair).collect::<Result<Vec<_>, _>>()?;
    let deforms = |k: &usize| mesh.parts[*k].solid && !bodies.of_part[*k].is_some_and(|m| bodies.materials[m].rigid);
    let outer: BTreeMap<usize, Vec<Face>> =
        (0..mesh.parts.len()).filter(deforms).map(|k| (k, Mesh::boundary(&mesh.parts[k]))).collect();
    let known = outer.iter().map(|(k, faces)| (*k, faces.iter().map(sorted).collect())).collect();
    let finder = Finder { mesh, bodies, outer, known, tied };
    let mut out: Vec<Sliding> = Vec::new();
    for node in of(false) {
        let names = pair(node)?;
        let flips = [["flip_primary", "flip_master"], ["flip_secondary", "flip_slave"]];
        let mut sides = [None, None];
        for (k, name) in names.iter().enumerate() {
            let flip = flips[k].iter().any(|f| is_on(node, f));
            sides[k] = finder.side(name, flip).map_err(|what| {
                let line = mesh.surfaces.get(name).map_or(0, |s| s.line);
                DeckError { file: tree.file.to_owned(), line, message: format!("surface {name}: {what}") }
            })?;
        }
        out.push(Sliding { node, sides });
    }
    Ok(out)
}

/// The bodies of the contacts between bodies, with what names say of them.
pub(super) fn sided(contacts: &[Sliding<'_, '_>]) -> Vec<[Sided; 2]> {
    let one = |s: &Side| (s.body, s.names.clone());
    contacts.iter().filter_map(|c| Some([one(c.sides[0].as_ref()?), one(c.sides[1].as_ref()?)])).collect()
}

/// Whether a parameter is there and not 0.
pub(super) fn is_on(node: Node<'_, '_>, name: &str) -> bool {
    text(node, name).is_some_and(|t| t.parse::<f64>().is_ok_and(|x| x != 0.0) || t == "true")
}

impl Finder<'_, '_, '_> {
    fn side(&self, surface: &str, flip: bool) -> Result<Option<Side>, String> {
        let Some(read) = self.mesh.surfaces.get(surface).filter(|s| !s.faces.is_empty()) else {
            return Err("it has no faces".into());
        };
        let mut faces = read.faces.clone();
        let within = |part: &usize| faces.iter().all(|f| self.known[part].contains(&sorted(f)));
        let layer = match self.outer.keys().copied().find(|p| within(p)) {
            Some(part) => match self.on_bone(part, &faces)? {
                Some((body, bony)) => Some((body, part, bony)),
                None => return Ok(None),
            },
            None => None,
        };
        let body = match &layer {
            Some((body, ..)) => *body,
            None => {
                let on: BTreeSet<Option<usize>> = faces.iter().flatten().map(|n| self.bodies.of_node(*n)).collect();
                match (on.len(), on.first()) {
                    (1, Some(Some(body))) => *body,
                    _ => return Ok(None),
                }
            }
        };
        if flip {
            faces.iter_mut().for_each(|f| f.reverse());
        }
        let part = layer.as_ref().map_or("", |(_, part, _)| self.mesh.parts[*part].name.as_str());
        let names = format!("{surface} {part}");
        let layer = layer.map(|(_, part, bony)| (part, bony));
        Ok(Some(Side { surface: surface.to_owned(), body, faces, layer, names }))
    }

    /// The body on which a part that deforms lies, and its faces there: those whose nodes are fixed to it, and those tied to it.
    fn on_bone(&self, part: usize, pressing: &[Face]) -> Result<Option<(usize, Vec<Face>)>, String> {
        let pressing: BTreeSet<Face> = pressing.iter().map(sorted).collect();
        let of = |n: &usize| self.bodies.of_node(*n);
        let mut bony: Vec<Face> = Vec::new();
        let mut on = BTreeSet::new();
        for face in self.outer[&part].iter().filter(|f| !pressing.contains(&sorted(f))) {
            let all: BTreeSet<Option<usize>> = face.iter().map(of).collect();
            if let (1, Some(Some(body))) = (all.len(), all.first()) {
                on.insert(*body);
                bony.push(face.clone());
            }
        }
        for [a, b] in self.tied.iter().flat_map(|[a, b]| [[a, b], [b, a]]) {
            let (Some(own), Some(other)) = (self.mesh.surfaces.get(a), self.mesh.surfaces.get(b)) else { continue };
            let bodies: BTreeSet<Option<usize>> = other.faces.iter().flatten().map(of).collect();
            let whole = own.faces.iter().all(|f| self.known[&part].contains(&sorted(f)));
            if let (true, 1, Some(Some(body))) = (whole && !own.faces.is_empty(), bodies.len(), bodies.first()) {
                on.insert(*body);
                bony.extend(own.faces.iter().cloned());
            }
        }
        let name = &self.mesh.parts[part].name;
        match (on.len(), on.first()) {
            (0, _) => Ok(None),
            (1, Some(body)) => Ok(Some((*body, bony))),
            _ => Err(format!("the part {name} is fixed to several rigid bodies; expected one")),
        }
    }
}

/// The middles of the faces of femur and tibia.
pub(super) fn middles(mesh: &Mesh, contacts: &[Sliding<'_, '_>], knee: &Knee) -> [Point; 2] {
    [knee.femur, knee.tibia].map(|body| {
        let own = contacts.iter().flat_map(|c| &c.sides).flatten().filter(|s| s.body == body);
        let points: Vec<Point> = own.flat_map(|s| s.faces.iter().flatten()).map(|n| mesh.points[*n]).collect();
        let sum: Vector = points.iter().map(|p| p.coords).sum();
        Point::from(sum / points.len().max(1) as f64)
    })
}

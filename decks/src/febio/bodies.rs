//! Rigid bodies of a FEBio file, what belongs to them, and which are femur and tibia.

use super::known::key;
use super::mesh::Mesh;
use crate::DeckError;
use crate::axes::{FEMORAL, TIBIAL};
use crate::opensim::Given;
use crate::tree::{Tree, brief, name_of, text};
use meshes::Point;
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};

/// A material.
pub(super) struct Material<'a, 'i> {
    pub(super) name: String,
    id: String,
    pub(super) node: Node<'a, 'i>,
    pub(super) rigid: bool,
}

/// Materials, and which rigid body each node is of. A body goes by the number of its material; what is locked to another goes by the other's.
pub(super) struct Bodies<'a, 'i> {
    pub(super) materials: Vec<Material<'a, 'i>>,
    /// The material of each part.
    pub(super) of_part: Vec<Option<usize>>,
    of_node: Vec<Option<usize>>,
    root: Vec<usize>,
}

impl<'a, 'i> Bodies<'a, 'i> {
    /// Reads materials, domains, locks and the nodes that are fixed to bodies.
    ///
    /// Errors: names that lead nowhere, a node on two bodies.
    pub(super) fn new(tree: &'a Tree<'i>, mesh: &Mesh, objects: &[Node<'a, 'i>]) -> Result<Self, DeckError> {
        let of = |name: &'static str| objects.iter().copied().filter(move |o| o.tag_name().name() == name);
        // those that are passed over among them: a message may have to name one
        let all = tree.root().descendants().filter(|n| n.tag_name().name() == "material");
        let materials: Vec<Material> = all
            .map(|node| {
                let id = node.attribute("id").unwrap_or("").trim().to_owned();
                let name = Some(name_of(node).trim()).filter(|n| !n.is_empty()).unwrap_or(&id).to_owned();
                Material { name, id, node, rigid: node.attribute("type").map(str::trim) == Some("rigid body") }
            })
            .collect();
        let root = (0..materials.len()).collect();
        let of_part = mesh.parts.iter().map(|_| None).collect();
        let of_node = vec![None; mesh.points.len()];
        let mut out = Bodies { materials, of_part, of_node, root };
        out.domains(tree, mesh, &of("SolidDomain").chain(of("ShellDomain")).collect::<Vec<_>>())?;
        let connectors: Vec<_> = of("rigid_connector").chain(of("constraint")).collect();
        out.lock(tree, &connectors)?;
        out.fix(tree, mesh, &of("bc").chain(of("rigid")).collect::<Vec<_>>())?;
        Ok(out)
    }

    /// The material that a text names: by name, else by number.
    pub(super) fn named(&self, text: &str) -> Option<usize> {
        let text = text.trim();
        let by = |fits: &dyn Fn(&Material) -> bool| self.materials.iter().position(fits);
        by(&|m| m.name == text).or_else(|| by(&|m| m.id == text && !text.is_empty()))
    }

    fn body(&self, tree: &Tree<'_>, node: Node<'_, '_>, text: &str) -> Result<usize, DeckError> {
        match self.named(text).filter(|m| self.materials[*m].rigid) {
            Some(body) => Ok(self.of(body)),
            None => {
                let rigid: Vec<&str> = self.rigid().map(|m| self.materials[m].name.as_str()).collect();
                let what = format!("\"{}\" is no rigid body; the file has {}", brief(text), rigid.join(", "));
                Err(tree.error(node, what))
            }
        }
    }

    /// Materials that are rigid bodies, those locked to another among them.
    fn rigid(&self) -> impl Iterator<Item = usize> {
        (0..self.materials.len()).filter(|m| self.materials[*m].rigid)
    }

    /// The body to which a body is locked, or itself.
    fn of(&self, body: usize) -> usize {
        self.root[body]
    }

    /// The body of a node.
    pub(super) fn of_node(&self, node: usize) -> Option<usize> {
        self.of_node[node].map(|b| self.of(b))
    }

    fn domains(&mut self, tree: &Tree<'_>, mesh: &Mesh, domains: &[Node<'a, 'i>]) -> Result<(), DeckError> {
        for (k, part) in mesh.parts.iter().enumerate() {
            let domain = domains.iter().find(|d| name_of(**d) == part.name);
            let named = domain.and_then(|d| d.attribute("mat")).or(part.material.as_deref());
            let Some(named) = named else { continue };
            let found = self.named(named);
            if found.is_none() {
                let at = domain.copied().unwrap_or(tree.root());
                return Err(tree.error(at, format!("\"{}\" is no material of the file", brief(named))));
            }
            self.of_part[k] = found;
            if let Some(body) = found.filter(|m| self.materials[*m].rigid) {
                part.elements.iter().flatten().for_each(|&n| self.of_node[n] = Some(body));
            }
        }
        Ok(())
    }

    /// Joins bodies that a lock or a parent holds together.
    fn lock(&mut self, tree: &Tree<'_>, connectors: &[Node<'a, 'i>]) -> Result<(), DeckError> {
        let mut pairs = Vec::new();
        for &node in connectors.iter().filter(|c| key(**c).ends_with(":rigid lock")) {
            let end = |name: &str| self.body(tree, node, text(node, name).unwrap_or(""));
            pairs.push((end("body_a")?, end("body_b")?));
        }
        for (k, material) in self.materials.iter().enumerate().filter(|(_, m)| m.rigid) {
            if let Some(parent) = text(material.node, "parent_id") {
                pairs.push((self.body(tree, material.node, parent)?, k));
            }
        }
        for (a, b) in pairs {
            let (a, b) = (self.root[a], self.root[b]);
            self.root.iter_mut().filter(|r| **r == b).for_each(|r| *r = a);
        }
        Ok(())
    }

    /// Gives the nodes of a set to the body to which a condition fixes them.
    fn fix(&mut self, tree: &Tree<'_>, mesh: &Mesh, conditions: &[Node<'a, 'i>]) -> Result<(), DeckError> {
        for &node in conditions {
            let named = node.attribute("rb").or_else(|| text(node, "rb")).unwrap_or("");
            let body = self.body(tree, node, named)?;
            let set = node.attribute("node_set").unwrap_or("").trim();
            let Some(nodes) = mesh.named_nodes(set) else {
                return Err(tree.error(node, format!("\"{}\" is no node set of the mesh", brief(set))));
            };
            for n in nodes {
                if self.of_node(n).is_some_and(|other| other != body) {
                    return Err(tree.error(node, "it fixes a node that is of another rigid body already"));
                }
                self.of_node[n] = Some(body);
            }
        }
        Ok(())
    }

    /// Names of a body, and of what is locked to it.
    pub(super) fn name(&self, body: usize) -> &str {
        &self.materials[body].name
    }

    /// Bodies that are no part of femur and tibia.
    pub(super) fn rest(&self, knee: &Knee) -> Vec<&str> {
        let own = [knee.femur, knee.tibia];
        self.rigid().filter(|b| !own.contains(&self.of(*b))).map(|b| self.name(b)).collect()
    }

    /// The centre of mass that a body's material states.
    pub(super) fn centre(&self, tree: &Tree<'_>, body: usize) -> Result<Option<Point>, DeckError> {
        let given = tree.list(self.materials[body].node, "center_of_mass")?;
        Ok(<[f64; 3]>::try_from(given.as_slice()).ok().map(Point::from))
    }
}

/// Femur and tibia.
pub(super) struct Knee {
    pub(super) femur: usize,
    pub(super) tibia: usize,
}

/// A body in contact, and the names of its surface and part.
pub(super) type Sided = (usize, String);

impl Knee {
    /// Finds the two bodies: as given, or those that contact joins and whose names say so.
    ///
    /// Errors: none or several.
    pub(super) fn find(
        tree: &Tree<'_>,
        bodies: &Bodies<'_, '_>,
        contacts: &[[Sided; 2]],
        given: &Given,
    ) -> Result<Knee, DeckError> {
        let whole = |message: String| DeckError { file: tree.file.to_owned(), line: 0, message };
        let asked = |option: &str, name: &Option<String>| match name {
            None => Ok(None),
            Some(name) => {
                bodies.named(name).filter(|b| bodies.materials[*b].rigid).map(|b| Some(bodies.of(b))).ok_or_else(|| {
                    let all: Vec<&str> = bodies.rigid().map(|b| bodies.name(b)).collect();
                    let near = sim::names::did_you_mean(name, all.iter().copied());
                    whole(format!("{option}: the file has no rigid body {name}{near}; it has {}", all.join(", ")))
                })
            }
        };
        let (femur, tibia) = (asked("--femur", &given.femur)?, asked("--tibia", &given.tibia)?);
        let (femur, tibia) = match (femur, tibia) {
            (Some(femur), Some(tibia)) => (femur, tibia),
            _ => one(bodies, &pairs(bodies, contacts, (femur, tibia)), contacts).map_err(whole)?,
        };
        if femur == tibia {
            return Err(whole(format!("femur and tibia are one rigid body, {}", bodies.name(femur))));
        }
        Ok(Knee { femur, tibia })
    }

    /// Whether a body is the femur, the tibia, or neither.
    pub(super) fn is_femur(&self, body: usize) -> Option<bool> {
        if body == self.femur { Some(true) } else { (body == self.tibia).then_some(false) }
    }
}

/// Bodies that contact joins: those asked for, else those whose names say so, or failing that the names of their surfaces.
fn pairs(
    bodies: &Bodies<'_, '_>,
    contacts: &[[Sided; 2]],
    (femur, tibia): (Option<usize>, Option<usize>),
) -> BTreeSet<(usize, usize)> {
    let has = |name: &str, words: &[&str; 3]| words.iter().any(|w| name.to_lowercase().contains(w));
    let says = |side: &Sided, own: &[&str; 3], other: &[&str; 3]| {
        let name = bodies.name(side.0);
        has(name, own) || (!has(name, other) && has(&side.1, own) && !has(&side.1, other))
    };
    let mut found = BTreeSet::new();
    for [one, two] in contacts {
        for (a, b) in [(one, two), (two, one)] {
            let femoral = femur.map_or_else(|| says(a, &FEMORAL, &TIBIAL), |f| a.0 == f);
            let tibial = tibia.map_or_else(|| says(b, &TIBIAL, &FEMORAL), |t| b.0 == t);
            if femoral && tibial && a.0 != b.0 {
                found.insert((a.0, b.0));
            }
        }
    }
    found
}

fn one(
    bodies: &Bodies<'_, '_>,
    pairs: &BTreeSet<(usize, usize)>,
    contacts: &[[Sided; 2]],
) -> Result<(usize, usize), String> {
    let mut all = pairs.iter();
    let shown = |(f, t): (usize, usize)| format!("{} and {}", bodies.name(f), bodies.name(t));
    match (all.next(), all.next()) {
        (Some(one), None) => Ok(*one),
        (Some(_), _) => {
            let which: Vec<String> = pairs.iter().map(|p| shown(*p)).collect();
            let which = which.join("; ");
            Err(format!("the file has more than one knee: {which}; say which: --femur BODY --tibia BODY"))
        }
        (None, _) if contacts.is_empty() => Err(
            "no sliding contact is between rigid bodies, or cartilages on them; expected one between the cartilages of femur and tibia, such as sliding-elastic".into(),
        ),
        (None, _) => {
            let which: BTreeMap<String, ()> = contacts.iter().map(|[a, b]| (shown((a.0, b.0)), ())).collect();
            let which: Vec<String> = which.into_keys().collect();
            let which = which.join("; ");
            Err(format!("which bodies are femur and tibia cannot be told: contact is between {which}; say it: --femur BODY --tibia BODY"))
        }
    }
}

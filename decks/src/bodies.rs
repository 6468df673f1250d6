//! Which nodes move together, which body is the fixed one, the joint's chain and frames.

use super::model::{Connector, DeckModel};
use crate::DeckError;
use meshes::{Point, Vector};
use sim::spec::{AxisSpec, ChainSpec};
use std::collections::BTreeMap;

/// Groups of nodes that move as one.
#[derive(Default)]
pub(super) struct Groups {
    up: BTreeMap<u64, u64>,
    size: BTreeMap<u64, u64>,
}

impl Groups {
    /// Ties nodes by rigid bodies, beams and beam connectors.
    pub(super) fn of(model: &DeckModel) -> Groups {
        let mut groups = Groups::default();
        for (set, node) in &model.rigid {
            for &e in model.elsets.get(set).into_iter().flatten() {
                for &n in &model.elements[e].nodes {
                    groups.join(n, *node);
                }
            }
        }
        for [a, b] in &model.ties {
            groups.join(*a, *b);
        }
        for c in model.connectors.iter().filter(|c| c.kind == "beam") {
            for &e in model.elsets.get(&c.elset).into_iter().flatten() {
                if let [a, b] = model.elements[e].nodes[..] {
                    groups.join(a, b);
                }
            }
        }
        groups
    }

    /// The node that stands for the group of `node`.
    pub(super) fn root(&self, mut node: u64) -> u64 {
        while let Some(&up) = self.up.get(&node) {
            node = up;
        }
        node
    }

    fn join(&mut self, a: u64, b: u64) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return;
        }
        let size = |root: u64| self.size.get(&root).copied().unwrap_or(1);
        let (small, large, total) =
            if size(a) > size(b) { (b, a, size(a) + size(b)) } else { (a, b, size(a) + size(b)) };
        self.up.insert(small, large);
        self.size.insert(large, total);
    }
}

/// The two bodies, as roots, and the chain between them.
pub(super) struct Bodies {
    pub(super) groups: Groups,
    pub(super) femur: u64,
    pub(super) tibia: u64,
    pub(super) chain: ChainSpec,
    /// Element sets of the tibial, floating and femoral connectors.
    pub(super) axes: [String; 3],
}

impl Bodies {
    /// Finds them: the tibia is held fixed, three cylindrical connectors lead from it to the femur.
    pub(super) fn of(model: &DeckModel) -> Result<Bodies, DeckError> {
        let groups = Groups::of(model);
        let roots: Vec<u64> = model.fixed.iter().map(|n| groups.root(*n)).collect();
        let [tibia] = roots[..] else {
            return Err(DeckError::whole(format!(
                "{} bodies held fixed by *BOUNDARY, expected one (the tibia's reference node, ENCASTRE){}",
                roots.len(),
                if roots.is_empty() && !model.has_step {
                    "; the deck has no *STEP: was the file cut short?"
                } else {
                    ""
                }
            )));
        };
        let mut links: Vec<(&Connector, u64, u64)> = Vec::new();
        for c in model.connectors.iter().filter(|c| c.kind == "cylindrical") {
            match model.elsets.get(&c.elset).map(Vec::as_slice) {
                Some([e]) if model.elements[*e].nodes.len() == 2 => {
                    links.push((c, model.elements[*e].nodes[0], model.elements[*e].nodes[1]));
                }
                _ => return Err(model.error(c.at, format!("connector set {} should hold one element", c.elset))),
            }
        }
        let mut axes = Vec::new();
        let mut names = Vec::new();
        let mut here = tibia;
        for _ in 0..3 {
            let Some(i) = links.iter().position(|(_, a, b)| groups.root(*a) == here || groups.root(*b) == here) else {
                return Err(DeckError::whole(
                    "no chain of three CYLINDRICAL connectors leads from the fixed body to the femur",
                ));
            };
            let (c, a, b) = links.remove(i);
            here = if groups.root(a) == here { groups.root(b) } else { groups.root(a) };
            axes.push(axis(model, c, a)?);
            names.push(c.elset.clone());
        }
        let (Ok(names), Ok([si, ap, ml])) = (<[String; 3]>::try_from(names), <[AxisSpec; 3]>::try_from(axes)) else {
            return Err(DeckError::whole("the joint's chain needs three axes"));
        };
        Ok(Bodies { groups, femur: here, tibia, chain: ChainSpec { si, ap, ml }, axes: names })
    }

    /// True for a node of the femur, false for one of the tibia.
    pub(super) fn is_femoral(&self, node: u64) -> Option<bool> {
        match self.groups.root(node) {
            root if root == self.femur => Some(true),
            root if root == self.tibia => Some(false),
            _ => None,
        }
    }
}

/// Axis of a connector: through its first node, along the first direction of its orientation.
fn axis(model: &DeckModel, connector: &Connector, first: u64) -> Result<AxisSpec, DeckError> {
    let missing =
        || model.error(connector.at, format!("connector set {} needs an ORIENTATION by nodes", connector.elset));
    let [a, _, c] = connector.orientation.as_ref().and_then(|o| model.orientations.get(o)).ok_or_else(missing)?;
    let direction = (position(model, *a)? - position(model, *c)?).try_normalize(1e-9).ok_or_else(missing)?;
    Ok(AxisSpec { point: position(model, first)?, direction })
}

/// A node's position.
pub(super) fn position(model: &DeckModel, node: u64) -> Result<Point, DeckError> {
    model
        .nodes
        .get(&node)
        .copied()
        .ok_or_else(|| DeckError::whole(format!("node {} is used but not defined", model.scopes.label(node))))
}

/// Origin and medial-lateral, anterior, superior nodes of a body's frame: the four nodes of set `ref_frames` tied to it.
/// Axes are made orthonormal (the deck rounds its nodes): the first kept, the third turned least.
pub(super) fn frame(model: &DeckModel, bodies: &Bodies, femur: bool) -> Result<(Point, [Vector; 3]), DeckError> {
    let name = if femur { "femur" } else { "tibia" };
    let mut nodes: Vec<u64> = model.nsets.get("ref_frames").cloned().unwrap_or_default();
    nodes.retain(|n| bodies.is_femoral(*n) == Some(femur));
    nodes.sort_unstable();
    nodes.dedup();
    let [o, x, y, z] = nodes[..] else {
        return Err(DeckError::whole(format!(
            "node set ref_frames holds {} nodes of the {name}, expected 4 (origin, medial-lateral, anterior, superior)",
            nodes.len()
        )));
    };
    let origin = position(model, o)?;
    let flat = || DeckError::whole(format!("the {name}'s frame nodes {o}, {x}, {y}, {z} do not span a frame"));
    let x = (position(model, x)? - origin).try_normalize(1e-9).ok_or_else(flat)?;
    let y = position(model, y)? - origin;
    let z = position(model, z)? - origin;
    let z = (z - x * x.dot(&z)).try_normalize(1e-6).ok_or_else(flat)?;
    let third = z.cross(&x);
    Ok((origin, [x, if third.dot(&y) < 0.0 { -third } else { third }, z]))
}

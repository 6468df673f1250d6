//! Where bodies and frames of an OpenSim model are, in the pose of its coordinates' default values.

use super::joints::{Frame, Joint, joint};
use crate::DeckError;
use crate::tree::{Tree, brief, name_of, shown, text};
use meshes::Isometry;
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};

/// Frames hang on frames no deeper than this. Ours.
const DEEPEST_FRAME: usize = 50;
/// More bodies and frames than any model has: whole bodies have 30 to 100. Ours.
const MOST_BODIES: usize = 2_000;
const MOST_FRAMES: usize = 10_000;
/// Classes of joints that are read.
pub(super) const JOINTS: [&str; 9] = [
    "CustomJoint",
    "WeldJoint",
    "PinJoint",
    "SliderJoint",
    "UniversalJoint",
    "GimbalJoint",
    "BallJoint",
    "PlanarJoint",
    "FreeJoint",
];

/// Bodies, frames and joints of a model.
pub(super) struct Places<'a, 'i> {
    tree: &'a Tree<'i>,
    /// Bodies; ground is the first.
    pub(super) bodies: Vec<Node<'a, 'i>>,
    names: Vec<String>,
    /// Bodies and offset frames by their paths.
    paths: BTreeMap<String, Node<'a, 'i>>,
    /// Joints whose two bodies are known.
    pub(super) joints: Vec<Joint<'a, 'i>>,
}

impl<'a, 'i> Places<'a, 'i> {
    /// Of the objects that are read.
    ///
    /// Errors: two bodies of one name; a frame that hangs on nothing; a joint that cannot be read.
    pub(super) fn new(tree: &'a Tree<'i>, model: Node<'a, 'i>, objects: &[Node<'a, 'i>]) -> Result<Self, DeckError> {
        let of = |class: &str| objects.iter().copied().filter(|o| o.tag_name().name() == class).collect::<Vec<_>>();
        let mut bodies = of("Ground");
        if bodies.len() != 1 {
            let what = format!("the model has {} elements <Ground>, expected one", bodies.len());
            return Err(tree.error(model, what));
        }
        bodies.extend(of("Body"));
        let frames = of("PhysicalOffsetFrame");
        if bodies.len() > MOST_BODIES || frames.len() > MOST_FRAMES {
            let what = format!(
                "the model has {} bodies and {} offset frames; expected at most {MOST_BODIES} and {MOST_FRAMES}",
                bodies.len(),
                frames.len()
            );
            return Err(tree.error(model, what));
        }
        let names: Vec<String> = bodies.iter().map(|b| name_of(*b).to_owned()).collect();
        let mut seen = BTreeSet::new();
        for (body, name) in bodies.iter().zip(&names) {
            if name.is_empty() || !seen.insert(name) {
                return Err(tree.error(*body, "its name is missing or another body's; expected a name of its own"));
            }
        }
        let mut places = Places { tree, bodies, names, paths: BTreeMap::new(), joints: Vec::new() };
        for frame in places.bodies.iter().copied().chain(frames).collect::<Vec<_>>() {
            places.paths.entry(path_of(frame)).or_insert(frame);
        }
        for node in objects.iter().copied().filter(|o| JOINTS.contains(&o.tag_name().name())) {
            let frames = [places.socket(node, "socket_parent_frame")?, places.socket(node, "socket_child_frame")?];
            let joint = joint(tree, frames, node)?;
            places.joints.push(joint);
        }
        Ok(places)
    }

    /// The name of a body.
    pub(super) fn name(&self, body: usize) -> &str {
        &self.names[body]
    }

    /// The body of that name.
    pub(super) fn body(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// The frame that a socket of `owner` names; `..` where it names none.
    ///
    /// Errors: no such frame.
    pub(super) fn socket(&self, owner: Node<'a, 'i>, socket: &str) -> Result<Frame, DeckError> {
        let given = text(owner, socket).filter(|t| !t.is_empty());
        let named = given.unwrap_or("..");
        let node = self.named(owner, named).ok_or_else(|| {
            let what = format!("<{socket}> names \"{}\", which is no body or offset frame of the model", brief(named));
            self.tree.error(owner, what)
        })?;
        self.frame(node)
    }

    /// An offset frame of that name that is fixed to a body.
    pub(super) fn offset_frame(&self, name: &str, body: usize) -> Result<Option<Frame>, DeckError> {
        for node in self.paths.values().filter(|n| name_of(**n) == name && n.tag_name().name() == "PhysicalOffsetFrame")
        {
            let frame = self.frame(*node)?;
            if frame.body == body {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }

    /// A body or an offset frame as a frame.
    pub(super) fn frame(&self, mut node: Node<'a, 'i>) -> Result<Frame, DeckError> {
        let first = node;
        let mut place = Isometry::identity();
        for _ in 0..DEEPEST_FRAME {
            if let Some(body) = self.bodies.iter().position(|b| *b == node) {
                return Ok(Frame { body, place });
            }
            place = self.tree.motion(node, "translation", "orientation")? * place;
            let named = text(node, "socket_parent").filter(|t| !t.is_empty()).unwrap_or("..");
            node = self.named(node, named).ok_or_else(|| {
                let what = format!("<socket_parent> names \"{}\", which is no frame of the model", brief(named));
                self.tree.error(node, what)
            })?;
        }
        Err(self.tree.error(first, "leads to no body: its parents lead in a circle"))
    }

    /// The body or offset frame at a path: absolute, relative to `owner`, or by its name alone where one frame has it.
    fn named(&self, owner: Node<'a, 'i>, path: &str) -> Option<Node<'a, 'i>> {
        let exact = |path: &str| self.paths.get(path).copied();
        let relative = || exact(&joined(&path_of(owner), path));
        let found = if path.starts_with('/') { exact(path) } else { relative().or_else(|| self.inside(owner, path)) };
        found.or_else(|| {
            let last = path.rsplit('/').next()?;
            let mut of_name = self.paths.values().filter(|n| name_of(**n) == last);
            of_name.next().filter(|_| of_name.next().is_none()).copied()
        })
    }

    /// A frame that `owner` or an owner of it holds under that name.
    fn inside(&self, owner: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
        owner.ancestors().find_map(|o| self.paths.get(&joined(&path_of(o), name)).copied())
    }

    /// Bodies that weld joints hold to one body, itself among them.
    pub(super) fn welded_to(&self, body: usize) -> BTreeSet<usize> {
        let mut group = BTreeSet::from([body]);
        let mut open = vec![body];
        while let Some(one) = open.pop() {
            for j in self.joints.iter().filter(|j| j.is_rigid()) {
                for (a, b) in [(j.parent.body, j.child.body), (j.child.body, j.parent.body)] {
                    if a == one && group.insert(b) {
                        open.push(b);
                    }
                }
            }
        }
        group
    }

    /// Joints between two bodies, in order from the first; none where no chain of joints leads there.
    pub(super) fn between(&self, from: usize, to: usize) -> Option<Vec<&Joint<'a, 'i>>> {
        let mut came: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
        let mut open = std::collections::VecDeque::from([from]);
        while let Some(one) = open.pop_front() {
            for (k, j) in self.joints.iter().enumerate() {
                for (a, b) in [(j.parent.body, j.child.body), (j.child.body, j.parent.body)] {
                    if a == one && b != from && !came.contains_key(&b) {
                        came.insert(b, (a, k));
                        open.push_back(b);
                    }
                }
            }
        }
        let (mut way, mut at) = (Vec::new(), to);
        while at != from {
            let (before, joint) = came.get(&at)?;
            way.push(&self.joints[*joint]);
            at = *before;
        }
        way.reverse();
        Some(way)
    }

    /// From the coordinates of `to` to those of `from` [mm]: at the default pose, or where every coordinate is 0.
    pub(super) fn place(&self, from: usize, to: usize, at_zero: bool) -> Option<Isometry> {
        let mut place = Isometry::identity();
        let mut at = from;
        for joint in self.between(from, to)? {
            let along = joint.motion(at_zero);
            let forwards = joint.parent.body == at;
            place *= if forwards { along } else { along.inverse() };
            at = if forwards { joint.child.body } else { joint.parent.body };
        }
        Some(place)
    }

    /// A body as messages name it.
    pub(super) fn shown(&self, body: usize) -> String {
        shown(self.bodies[body])
    }
}

/// The path of an object: the names of what holds it, below the model.
pub(super) fn path_of(node: Node<'_, '_>) -> String {
    let mut names: Vec<String> = node
        .ancestors()
        .filter(|n| n.is_element() && !["Model", "OpenSimDocument"].contains(&n.tag_name().name()))
        .filter_map(|n| match (name_of(n), n.tag_name().name()) {
            ("", set) if set.ends_with("Set") => Some(set.to_lowercase()),
            ("", _) => None,
            (name, _) => Some(name.to_owned()),
        })
        .collect();
    names.reverse();
    format!("/{}", names.join("/"))
}

/// A relative path seen from an absolute one.
fn joined(base: &str, relative: &str) -> String {
    let mut parts: Vec<&str> = base.split('/').filter(|p| !p.is_empty()).collect();
    for part in relative.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop();
            }
            name => parts.push(name),
        }
    }
    format!("/{}", parts.join("/"))
}

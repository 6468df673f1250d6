//! Nodes, parts, sets and surfaces of a FEBio file, of format 2.5 to 4.0.

use super::known::key;
use crate::DeckError;
use crate::tree::{Tree, brief, name_of};
use meshes::Point;
use meshes::surface::TriMesh;
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};

/// A face by its corners.
pub(super) type Face = Vec<usize>;

/// The shape of a part's elements: name in a file, corners, faces of a solid, each from outside against the clock.
struct Shape {
    name: &'static str,
    corners: usize,
    faces: &'static [&'static [usize]],
}

/// Shapes that are read; nodes between corners are passed over, as faces are flat here.
const SHAPES: [Shape; 9] = [
    Shape {
        name: "hex",
        corners: 8,
        faces: &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]],
    },
    Shape { name: "penta", corners: 6, faces: &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]] },
    Shape { name: "tet", corners: 4, faces: &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]] },
    Shape { name: "pyra", corners: 5, faces: &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]] },
    Shape { name: "tri", corners: 3, faces: &[&[0, 1, 2]] },
    Shape { name: "quad", corners: 4, faces: &[&[0, 1, 2, 3]] },
    Shape { name: "q4", corners: 4, faces: &[&[0, 1, 2, 3]] },
    Shape { name: "line", corners: 2, faces: &[] },
    Shape { name: "truss", corners: 2, faces: &[] },
];

/// A part: elements of one shape.
pub(super) struct Part {
    pub(super) name: String,
    /// Its material where the elements state it (format 2.5).
    pub(super) material: Option<String>,
    pub(super) elements: Vec<Vec<usize>>,
    /// Whether it has a volume.
    pub(super) solid: bool,
    faces: &'static [&'static [usize]],
}

/// A surface with its line.
pub(super) struct Surface {
    pub(super) faces: Vec<Face>,
    pub(super) line: usize,
}

/// The mesh of a file.
#[derive(Default)]
pub(super) struct Mesh {
    pub(super) points: Vec<Point>,
    labels: BTreeMap<u64, usize>,
    pub(super) parts: Vec<Part>,
    pub(super) sets: BTreeMap<String, Vec<usize>>,
    pub(super) surfaces: BTreeMap<String, Surface>,
    /// Primary and secondary surface.
    pub(super) pairs: BTreeMap<String, [String; 2]>,
    pub(super) springs: BTreeMap<String, Vec<[usize; 2]>>,
}

impl Mesh {
    /// Reads the mesh out of the elements that are read.
    ///
    /// Errors: numbers that cannot be read, nodes that are not there, names given twice.
    pub(super) fn new(tree: &Tree<'_>, objects: &[Node<'_, '_>]) -> Result<Mesh, DeckError> {
        let mut mesh = Mesh::default();
        let of = |name: &'static str| objects.iter().copied().filter(move |o| o.tag_name().name() == name);
        for group in of("Nodes") {
            mesh.nodes(tree, group)?;
        }
        for group in of("Elements") {
            let part = mesh.part(tree, group)?;
            if mesh.parts.iter().any(|p| p.name == part.name) && !part.name.is_empty() && part.material.is_none() {
                return Err(tree.error(group, "another part has its name; expected a name of its own"));
            }
            mesh.parts.push(part);
        }
        for set in of("NodeSet") {
            let nodes = mesh.node_set(tree, set)?;
            mesh.sets.insert(name_of(set).to_owned(), nodes);
        }
        for surface in of("Surface") {
            let faces = elements(surface).map(|f| mesh.face(tree, f)).collect::<Result<_, _>>()?;
            let read = Surface { faces, line: tree.line(surface) };
            if mesh.surfaces.insert(name_of(surface).to_owned(), read).is_some() {
                return Err(tree.error(surface, "another surface has its name; expected a name of its own"));
            }
        }
        for pair in of("SurfacePair") {
            let side =
                |names: [&str; 2]| {
                    let found = elements(pair).find(|c| names.contains(&c.tag_name().name()));
                    let name = found.and_then(|c| c.attribute("surface").or(c.text())).unwrap_or("").trim();
                    match mesh.surfaces.contains_key(name) {
                        true => Ok(name.to_owned()),
                        false => Err(tree
                            .error(pair, format!("its {} is \"{}\", no surface of the mesh", names[0], brief(name)))),
                    }
                };
            let both = [side(["primary", "master"])?, side(["secondary", "slave"])?];
            mesh.pairs.insert(name_of(pair).to_owned(), both);
        }
        for set in of("DiscreteSet") {
            let pair = |e: Node<'_, '_>| {
                let nodes = mesh.labels_in(tree, e)?;
                <[usize; 2]>::try_from(nodes)
                    .map_err(|n| tree.error(e, format!("it has {} nodes, expected 2", n.len())))
            };
            let springs = elements(set).map(pair).collect::<Result<_, _>>()?;
            mesh.springs.insert(name_of(set).to_owned(), springs);
        }
        Ok(mesh)
    }

    fn nodes(&mut self, tree: &Tree<'_>, group: Node<'_, '_>) -> Result<(), DeckError> {
        let mut own = Vec::new();
        for node in elements(group) {
            let id = label(tree, node)?;
            let given = tree.numbers_in(node)?;
            let Ok(at) = <[f64; 3]>::try_from(given.as_slice()) else {
                return Err(tree.error(node, format!("node {id} has {} numbers, expected 3", given.len())));
            };
            if self.labels.insert(id, self.points.len()).is_some() {
                return Err(tree.error(node, format!("node {id} is given twice")));
            }
            own.push(self.points.len());
            self.points.push(Point::from(at));
        }
        for name in [group.attribute("name"), group.attribute("set")].into_iter().flatten() {
            self.sets.insert(name.to_owned(), own.clone());
        }
        Ok(())
    }

    fn part(&self, tree: &Tree<'_>, group: Node<'_, '_>) -> Result<Part, DeckError> {
        let kind = group.attribute("type").unwrap_or("").to_lowercase();
        let Some(shape) = SHAPES.iter().find(|s| kind.starts_with(s.name)) else {
            let all: Vec<&str> = SHAPES.iter().map(|s| s.name).collect();
            return Err(tree.error(group, format!("its type is \"{}\", expected {}", brief(&kind), all.join(", "))));
        };
        let mut read = Vec::new();
        for element in elements(group) {
            let mut nodes = self.labels_in(tree, element)?;
            if nodes.len() < shape.corners {
                let what = format!("a {} with {} nodes, expected {}", shape.name, nodes.len(), shape.corners);
                return Err(tree.error(element, what));
            }
            nodes.truncate(shape.corners);
            read.push(nodes);
        }
        Ok(Part {
            name: group.attribute("name").or(group.attribute("elset")).unwrap_or("").to_owned(),
            material: group.attribute("mat").map(str::to_owned),
            elements: read,
            solid: shape.faces.len() > 1,
            faces: shape.faces,
        })
    }

    /// Nodes of a set: as text with ranges, or an element a node.
    fn node_set(&self, tree: &Tree<'_>, set: Node<'_, '_>) -> Result<Vec<usize>, DeckError> {
        let mut nodes = Vec::new();
        for child in elements(set) {
            let id = label(tree, child)?;
            nodes.push(self.labels.get(&id).copied().ok_or_else(|| lost(tree, child, &id.to_string()))?);
        }
        if nodes.is_empty() {
            nodes = self.labels_in(tree, set)?;
        }
        Ok(nodes)
    }

    fn face(&self, tree: &Tree<'_>, face: Node<'_, '_>) -> Result<Face, DeckError> {
        let corners = if key(face).starts_with("tri") { 3 } else { 4 };
        let mut nodes = self.labels_in(tree, face)?;
        if nodes.len() < corners {
            return Err(tree.error(face, format!("it has {} nodes, expected {corners}", nodes.len())));
        }
        nodes.truncate(corners);
        Ok(nodes)
    }

    /// The nodes that an element's text names; `2:6` and `2:6:2` are ranges.
    fn labels_in(&self, tree: &Tree<'_>, node: Node<'_, '_>) -> Result<Vec<usize>, DeckError> {
        let mut found = Vec::new();
        let words = node.text().unwrap_or("").split(|c: char| c.is_whitespace() || c == ',');
        for word in words.filter(|w| !w.is_empty()) {
            let number = |text: &str| text.parse::<u64>().map_err(|_| lost(tree, node, word));
            let ends = word.split(':').map(number).collect::<Result<Vec<u64>, _>>()?;
            match ends[..] {
                [one] => found.push(self.labels.get(&one).copied().ok_or_else(|| lost(tree, node, word))?),
                [first, last] | [first, last, _] if first <= last => {
                    let step = ends.get(2).copied().unwrap_or(1).max(1);
                    let within = self.labels.range(first..=last).filter(|(id, _)| (*id - first) % step == 0);
                    found.extend(within.map(|(_, at)| *at));
                }
                _ => return Err(lost(tree, node, word)),
            }
        }
        Ok(found)
    }

    /// A node set by the name that a condition gives: of nodes, or of a surface's (`@surface:NAME`).
    pub(super) fn named_nodes(&self, name: &str) -> Option<Vec<usize>> {
        if let Some(surface) = name.strip_prefix("@surface:") {
            let faces = &self.surfaces.get(surface)?.faces;
            return Some(faces.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect());
        }
        for prefix in ["@elem_set:", "@part_list:", "@part:"] {
            if let Some(part) = name.strip_prefix(prefix) {
                let part = self.parts.iter().find(|p| p.name == part)?;
                return Some(part.elements.iter().flatten().copied().collect::<BTreeSet<_>>().into_iter().collect());
            }
        }
        self.sets.get(name).cloned()
    }

    /// The faces of a part that no second element has.
    pub(super) fn boundary(part: &Part) -> Vec<Face> {
        let all: Vec<Face> =
            part.elements.iter().flat_map(|e| part.faces.iter().map(|f| f.iter().map(|&c| e[c]).collect())).collect();
        if !part.solid {
            return all;
        }
        let mut counts: BTreeMap<Face, usize> = BTreeMap::new();
        all.iter().for_each(|f| *counts.entry(sorted(f)).or_default() += 1);
        all.into_iter().filter(|f| counts[&sorted(f)] == 1).collect()
    }

    /// Faces as triangles; vertices in the order of the file.
    pub(super) fn triangles<'f>(&self, faces: impl IntoIterator<Item = &'f Face>) -> TriMesh {
        let faces: Vec<&Face> = faces.into_iter().collect();
        let used: BTreeSet<usize> = faces.iter().copied().flatten().copied().collect();
        let place: BTreeMap<usize, u32> = used.iter().enumerate().map(|(k, n)| (*n, k as u32)).collect();
        let mut out = TriMesh { vertices: used.iter().map(|&n| self.points[n]).collect(), triangles: Vec::new() };
        for face in faces {
            let at: Vec<u32> = face.iter().map(|n| place[n]).collect();
            let parts: &[[usize; 3]] = if at.len() == 3 { &[[0, 1, 2]] } else { &[[0, 1, 2], [0, 2, 3]] };
            let whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
            out.triangles.extend(parts.iter().map(|p| p.map(|k| at[k])).filter(whole));
        }
        out
    }
}

/// A face whoever has it.
pub(super) fn sorted(face: &Face) -> Face {
    let mut out = face.clone();
    out.sort_unstable();
    out
}

/// The elements within an element.
fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(Node::is_element)
}

fn label(tree: &Tree<'_>, node: Node<'_, '_>) -> Result<u64, DeckError> {
    let given = node.attribute("id").unwrap_or("").trim();
    given.parse().map_err(|_| tree.error(node, format!("its id is \"{}\", expected a whole number", brief(given))))
}

fn lost(tree: &Tree<'_>, node: Node<'_, '_>, word: &str) -> DeckError {
    tree.error(node, format!("\"{}\" is no node of the mesh", brief(word)))
}

//! The compiled model: immutable, ready for increments.

use super::element::Element;
use super::face::Surface;
use super::kernel::Block;
use super::mass::{Masses, Weigh, highest_squared};
use super::touch::Pass;
use super::wide::LANES;
use super::{Assembly, Face, Motion, Options, Solid, check};
use crate::error::DeformableError;
use std::collections::BTreeMap;

/// A node that no body carries.
pub(super) const FREE: u32 = u32::MAX;
/// An assembly ready for simulation.
#[derive(Clone, Debug)]
pub struct Model {
    pub(super) start: Vec<[f64; 3]>,
    pub(super) mass: Vec<f64>,
    /// The body that carries each node, or [`FREE`].
    pub(super) carrier: Vec<u32>,
    /// Axes along which a node is held, one bit each.
    pub(super) held: Vec<u8>,
    pub(super) blocks: Vec<Block>,
    /// Where each node's forces lie in the blocks' forces: `gather[offsets[n]..offsets[n + 1]]`.
    pub(super) offsets: Vec<u32>,
    pub(super) gather: Vec<u32>,
    pub(super) faces: Vec<Surface>,
    pub(super) passes: Vec<Pass>,
    pub(super) motions: Vec<Motion>,
    pub(super) options: Options,
    /// First node of each solid, and of each rigid face after them.
    pub(super) first_node: Vec<usize>,
    /// Which faces of the assembly `faces` are.
    pub(super) face_of: BTreeMap<Face, usize>,
    /// Shortest edge of an element [mm].
    pub(super) shortest: f64,
    solids: Vec<Solid>,
    told: Masses,
}

impl Model {
    /// The masses in use and the increment.
    pub fn masses(&self) -> Masses {
        self.told
    }

    /// The options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The solids, as they were given.
    pub fn solids(&self) -> &[Solid] {
        &self.solids
    }

    /// Nodes of a solid among the model's.
    pub fn nodes_of(&self, solid: usize) -> std::ops::Range<usize> {
        let first = self.first_node[solid];
        first..first + self.solids[solid].mesh.nodes.len()
    }

    /// How much of the increment is left with nodes at `x`, by the element that has become stiffest [-]; 1 where none has.
    pub(super) fn increment_left(&self, x: &[[f64; 3]]) -> f64 {
        let of_element = |(solid, first, nodes): (&Solid, usize, &[u32; 8])| {
            let element = Element::new(&nodes.map(|n| solid.mesh.nodes[n as usize]));
            let deformation = element.deformation(&nodes.map(|n| x[first + n as usize].into()));
            let strained = (deformation - nalgebra::Matrix3::identity()).amax() > 0.02;
            if !strained {
                return 1.0;
            }
            let bound = |f: &nalgebra::Matrix3<f64>| highest_squared(&element, &solid.material, f);
            (bound(&nalgebra::Matrix3::identity()) / bound(&deformation)).sqrt().min(1.0)
        };
        let all = self.solids.iter().zip(&self.first_node);
        all.flat_map(|(solid, &first)| solid.mesh.elements.iter().map(move |nodes| (solid, first, nodes)))
            .map(of_element)
            .fold(1.0, f64::min)
    }
}

/// Checks and compiles an assembly.
///
/// Errors: numbers that are not finite or in the wrong unit, inverted or flat elements (by number), solids fixed to nothing.
pub fn compile(assembly: Assembly, options: &Options) -> Result<Model, DeformableError> {
    check::assembly(&assembly, options)?;
    let mut parts = Parts::default();
    for solid in &assembly.solids {
        parts.nodes(&solid.mesh.nodes, solid.body, &solid.mesh.bony_nodes);
        let first = parts.first_node.last().copied().unwrap_or(0);
        for (n, axes) in &solid.rollers {
            let bits = (0..3).filter(|&a| axes[a]).map(|a| 1 << a).sum::<u8>();
            parts.held[first + *n as usize] |= bits;
        }
    }
    for face in &assembly.rigid_faces {
        let all: Vec<u32> = (0..face.nodes.len() as u32).collect();
        parts.nodes(&face.nodes, face.body, &all);
    }
    let mut weigh = Weigh::new(parts.start.len(), options.scaling);
    let (blocks, shortest) = blocks(&assembly.solids, &parts.first_node, options, &mut weigh);
    let (faces, passes, face_of) = surfaces(&assembly, &parts);
    let stiffness = penalty_stiffness(&faces, &passes, options, parts.start.len());
    weigh.increment(&stiffness, options.safety);
    let (offsets, gather) = node_lists(&blocks, parts.start.len());
    Ok(Model {
        mass: weigh.mass,
        told: weigh.told,
        start: parts.start,
        carrier: parts.carrier,
        held: parts.held,
        first_node: parts.first_node,
        blocks,
        offsets,
        gather,
        faces,
        passes,
        face_of,
        motions: assembly.bodies.iter().map(|b| b.motion.clone()).collect(),
        options: options.clone(),
        shortest,
        solids: assembly.solids,
    })
}

#[derive(Default)]
struct Parts {
    start: Vec<[f64; 3]>,
    carrier: Vec<u32>,
    held: Vec<u8>,
    first_node: Vec<usize>,
}

impl Parts {
    fn nodes(&mut self, nodes: &[meshes::Point], body: usize, carried: &[u32]) {
        let first = self.start.len();
        self.first_node.push(first);
        self.start.extend(nodes.iter().map(|p| [p.x, p.y, p.z]));
        self.carrier.resize(self.start.len(), FREE);
        self.held.resize(self.start.len(), 0);
        carried.iter().for_each(|&n| self.carrier[first + n as usize] = body as u32);
    }
}

/// Blocks of all solids, their masses added to `weigh`, and the shortest edge.
fn blocks(solids: &[Solid], first_node: &[usize], options: &Options, weigh: &mut Weigh) -> (Vec<Block>, f64) {
    let mut blocks = Vec::new();
    let mut shortest = f64::INFINITY;
    for (s, solid) in solids.iter().enumerate() {
        for (group, elements) in solid.mesh.elements.chunks(LANES).enumerate() {
            let list: Vec<([u32; 8], Element)> = elements
                .iter()
                .map(|nodes| {
                    let places = nodes.map(|n| solid.mesh.nodes[n as usize]);
                    for (a, b) in [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7)] {
                        shortest = f64::min(shortest, (places[b] - places[a]).norm());
                    }
                    (nodes.map(|n| first_node[s] as u32 + n), Element::new(&places))
                })
                .collect();
            list.iter().for_each(|(nodes, e)| weigh.element(nodes, e, &solid.material));
            let place = (s as u32, (group * LANES) as u32);
            blocks.push(Block::new(
                &list,
                place,
                &solid.material,
                (options.hourglass_stiffness, options.hourglass_viscosity),
            ));
        }
    }
    (blocks, shortest)
}

type Surfaces = (Vec<Surface>, Vec<Pass>, BTreeMap<Face, usize>);

fn surfaces(assembly: &Assembly, parts: &Parts) -> Surfaces {
    let (mut faces, mut passes, mut face_of) = (Vec::new(), Vec::new(), BTreeMap::new());
    let mut index = |face: Face| {
        *face_of.entry(face).or_insert_with(|| {
            let (quads, slot) = match face {
                Face::Articular(n) => (&assembly.solids[n].mesh.articular_quads, n),
                Face::Rigid(n) => (&assembly.rigid_faces[n].quads, assembly.solids.len() + n),
            };
            let first = parts.first_node[slot] as u32;
            faces.push(Surface::new(quads.iter().map(|q| q.map(|n| n + first)).collect(), &parts.start));
            faces.len() - 1
        })
    };
    for [a, b] in &assembly.pairs {
        let (a, b) = (index(*a), index(*b));
        passes.push(Pass { nodes: a, face: b });
        passes.push(Pass { nodes: b, face: a });
    }
    (faces, passes, face_of)
}

/// Stiffness of the penalty that may bear on each node [N/mm]: as a node of its own pass, and under the nodes of the other face.
fn penalty_stiffness(faces: &[Surface], passes: &[Pass], options: &Options, nodes: usize) -> Vec<f64> {
    let mut out = vec![0f64; nodes];
    for pass in passes {
        let (own, other) = (&faces[pass.nodes], &faces[pass.face]);
        let mean = other.area.iter().sum::<f64>() / other.area.len().max(1) as f64;
        for (&n, area) in own.nodes.iter().zip(&own.area) {
            let bears = 0.5 * options.penalty_mpa_per_mm * (area + 1.5 * area.max(mean));
            // friction's spring adds to that of the penalty
            out[n as usize] = out[n as usize].max(1.1 * bears);
        }
    }
    out
}

/// Lists by node of the places of its forces.
fn node_lists(blocks: &[Block], nodes: usize) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; nodes + 1];
    let real = |f: &mut dyn FnMut(usize, u32)| {
        for (b, block) in blocks.iter().enumerate() {
            for lane in 0..block.count as usize {
                for (c, corner) in block.nodes.iter().enumerate() {
                    f(corner[lane] as usize, (b * 8 * 3 * LANES + c * 3 * LANES + lane) as u32);
                }
            }
        }
    };
    real(&mut |n, _| offsets[n + 1] += 1);
    for n in 0..nodes {
        offsets[n + 1] += offsets[n];
    }
    let mut next = offsets.clone();
    let mut gather = vec![0u32; offsets[nodes] as usize];
    real(&mut |n, place| {
        gather[next[n] as usize] = place;
        next[n] += 1;
    });
    (offsets, gather)
}

//! Contact: each node of a face that has sunk into the other is pushed out by a penalty, both passes at half weight, and held by friction.

use super::Options;
use super::face::{Grid, NONE, Surface, dot, minus, norm};
use super::project::foot;
use rayon::prelude::*;

/// Nodes within this of the other face are followed [mm].
const SKIN: f64 = 1.5;
/// Friction's stiffness, share of the penalty [-].
const STICK: f64 = 0.5;
/// Nodes a thread takes at a time.
const CHUNK: usize = 256;

/// Nodes of one face over the quadrilaterals of another.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pass {
    pub(super) nodes: usize,
    pub(super) face: usize,
}

/// A node of a pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    /// Quadrilateral it is over, `NONE` where it is far; its foot's natural coordinates.
    pub(super) quad: u32,
    pub(super) at: [f64; 2],
    pub(super) weights: [f64; 4],
    /// Force on the node [N], its normal part, and friction's part.
    pub(super) force: [f64; 3],
    pub(super) normal: f64,
    pub(super) friction: [f64; 3],
    /// Stored in penalty and sticking, dissipated in this increment [N mm].
    pub(super) stored: f64,
    pub(super) lost: f64,
}

const APART: Touch = Touch {
    quad: NONE,
    at: [0.0; 2],
    weights: [0.0; 4],
    force: [0.0; 3],
    normal: 0.0,
    friction: [0.0; 3],
    stored: 0.0,
    lost: 0.0,
};

/// All contact under way.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    pub(super) touches: Vec<Vec<Touch>>,
    grid: Grid,
    /// Places of the faces' nodes at the last search.
    searched: Vec<[f64; 3]>,
    /// Dissipated by friction so far, stored now [N mm].
    pub(super) lost: f64,
    pub(super) stored: f64,
}

impl Contact {
    pub(super) fn new(faces: &[Surface], passes: &[Pass]) -> Contact {
        let touches = passes.iter().map(|p| vec![APART; faces[p.nodes].nodes.len()]).collect();
        Contact { touches, grid: Grid::default(), searched: Vec::new(), lost: 0.0, stored: 0.0 }
    }

    /// Adds the forces on the nodes at `x`, which moved with `v` over the last increment `dt`, to `out`.
    pub(super) fn forces(
        &mut self,
        (faces, passes): (&[Surface], &[Pass]),
        (x, v, dt): (&[[f64; 3]], &[[f64; 3]], f64),
        options: &Options,
        out: &mut [[f64; 3]],
    ) {
        if self.moved(faces, x) {
            self.search(faces, passes, x);
        }
        self.stored = 0.0;
        for (pass, touches) in passes.iter().zip(&mut self.touches) {
            let (own, other) = (&faces[pass.nodes], &faces[pass.face]);
            let one = |(n, touch): (usize, &mut Touch)| {
                if touch.quad != NONE {
                    *touch = follow(touch, (own.nodes[n], own.area[n]), other, (x, v, dt), options);
                }
            };
            touches
                .par_chunks_mut(CHUNK)
                .enumerate()
                .for_each(|(c, chunk)| chunk.iter_mut().enumerate().for_each(|(n, t)| one((c * CHUNK + n, t))));
            for (touch, &node) in touches.iter().zip(&own.nodes) {
                if touch.normal <= 0.0 {
                    continue;
                }
                self.stored += touch.stored;
                self.lost += touch.lost;
                let corners = &other.quads[touch.quad as usize];
                let mut add = |n: u32, share: f64| {
                    out[n as usize].iter_mut().zip(&touch.force).for_each(|(o, f)| *o += share * f);
                };
                add(node, 1.0);
                corners.iter().zip(&touch.weights).for_each(|(&corner, w)| add(corner, -w));
            }
        }
    }

    /// Whether any node of a face moved so far since the last search that another may have come near.
    fn moved(&self, faces: &[Surface], x: &[[f64; 3]]) -> bool {
        let mut nodes = faces.iter().flat_map(|f| &f.nodes);
        let far = |(n, old): (&u32, &[f64; 3])| {
            let d = minus(&x[*n as usize], old);
            dot(&d, &d) > (SKIN / 4.0) * (SKIN / 4.0)
        };
        self.searched.is_empty() || nodes.by_ref().zip(&self.searched).any(far)
    }

    fn search(&mut self, faces: &[Surface], passes: &[Pass], x: &[[f64; 3]]) {
        self.searched.clear();
        self.searched.extend(faces.iter().flat_map(|f| &f.nodes).map(|&n| x[n as usize]));
        for (pass, touches) in passes.iter().zip(&mut self.touches) {
            let (own, other) = (&faces[pass.nodes], &faces[pass.face]);
            self.grid.fill(other, x, SKIN + other.longest);
            let grid = &self.grid;
            // centres lie at most an edge's length from the points of their quadrilateral
            let reach = SKIN + other.longest;
            touches.par_chunks_mut(CHUNK).enumerate().for_each(|(c, chunk)| {
                for (n, touch) in chunk.iter_mut().enumerate() {
                    let n = c * CHUNK + n;
                    if touch.normal > 0.0 {
                        continue;
                    }
                    let normal = own.normal(own.at_node[n], x);
                    let quad = grid.nearest(other, x, (&x[own.nodes[n] as usize], &normal), reach);
                    *touch = Touch { quad, ..APART };
                }
            });
        }
    }
}

/// The touch of one node an increment later.
fn follow(
    before: &Touch,
    (node, area): (u32, f64),
    other: &Surface,
    (x, v, dt): (&[[f64; 3]], &[[f64; 3]], f64),
    options: &Options,
) -> Touch {
    let p = &x[node as usize];
    // beyond the rim a node keeps the quadrilateral it came from
    let Some(foot) = foot(other, x, p, (before.quad, before.at)) else {
        return Touch { quad: before.quad, ..APART };
    };
    let apart = Touch { quad: foot.quad, at: foot.at, ..APART };
    if foot.height >= 0.0 || foot.height < -options.deepest_mm {
        return apart;
    }
    let k = 0.5 * options.penalty_mpa_per_mm * area;
    let normal = -k * foot.height;
    let mut stored = 0.5 * normal * -foot.height;
    let (mut friction, mut lost) = ([0.0; 3], 0.0);
    if options.friction > 0.0 {
        let corners = other.quads[foot.quad as usize].map(|n| &v[n as usize]);
        let slide: [f64; 3] =
            std::array::from_fn(|a| v[node as usize][a] - (0..4).map(|c| foot.weights[c] * corners[c][a]).sum::<f64>());
        let stick = STICK * k;
        let mut trial: [f64; 3] = std::array::from_fn(|a| before.friction[a] - stick * dt * slide[a]);
        let along = dot(&trial, &foot.normal);
        trial.iter_mut().zip(&foot.normal).for_each(|(t, n)| *t -= along * n);
        let (size, most) = (norm(&trial), options.friction * normal);
        friction = if size > most { trial.map(|t| t * (most / size)) } else { trial };
        let held = size.min(most);
        lost = held * (size - held) / stick;
        stored += 0.5 * held * held / stick;
    }
    let force = std::array::from_fn(|a| normal * foot.normal[a] + friction[a]);
    Touch { weights: foot.weights, force, normal, friction, stored, lost, ..apart }
}

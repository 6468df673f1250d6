//! Columns of hexahedra between a bony and an articular face, and the improvement of their shape.

mod fold;

use crate::hex::HexMesh;
use crate::quad::grid::neighbours;
use crate::query::SurfaceQuery;
use crate::{Point, Vector};

/// A quadrilateral mesh twice: on the bony face and, node above node, on the articular face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Columns {
    /// Foot of each column [mm].
    pub bony: Vec<Point>,
    /// Head of each column [mm].
    pub articular: Vec<Point>,
    /// Quadrilaterals, counter-clockwise seen from the articular side.
    pub quads: Vec<[u32; 4]>,
    /// Whether each column stands on the outline.
    pub on_outline: Vec<bool>,
}

/// The two faces the columns stand between; normals of both towards the articular side.
pub struct Faces<'a> {
    /// The bony face.
    pub bony: &'a SurfaceQuery,
    /// The articular face, side walls included.
    pub articular: &'a SurfaceQuery,
}

/// Evening out makes no corner worse than this scaled Jacobian.
const LEAST_RELAXED: f64 = 0.4;
/// A corner's share of the cost begins to weigh below this scaled Jacobian.
const GOOD: f64 = 0.6;
/// Weight of that part.
const BAD_WEIGHT: f64 = 20.0;
/// Weight of in-plane edges outside the wanted range.
const LENGTH_WEIGHT: f64 = 4.0;
/// Weight of in-plane edges outside the range that must not be left.
const LIMIT_WEIGHT: f64 = 60.0;
/// Weight of columns of the outline leaving it.
const STAY_WEIGHT: f64 = 0.15;

impl Columns {
    /// Hexahedra of `layers` equal layers. Node `layer * columns + column`.
    pub fn hexahedra(&self, layers: usize) -> HexMesh {
        let (n, layers) = (self.bony.len() as u32, layers.max(1));
        let mut mesh = HexMesh::default();
        for k in 0..=layers {
            let share = k as f64 / layers as f64;
            mesh.nodes.extend(self.bony.iter().zip(&self.articular).map(|(b, a)| b + (a - b) * share));
        }
        let top = layers as u32 * n;
        for k in 0..layers as u32 {
            mesh.elements.extend(self.quads.iter().map(|&[a, b, c, d]| {
                let (low, high) = (k * n, (k + 1) * n);
                [a + low, b + low, c + low, d + low, a + high, b + high, c + high, d + high]
            }));
        }
        mesh.bony_nodes = (0..n).collect();
        mesh.articular_nodes = (top..top + n).collect();
        mesh.bony_quads = self.quads.iter().map(|&[a, b, c, d]| [d, c, b, a]).collect();
        mesh.articular_quads = self.quads.iter().map(|q| q.map(|v| v + top)).collect();
        mesh
    }

    /// Evens out both faces: nodes off the outline towards the mean of their neighbours, far ones weighing more, back onto
    /// their face; `sweeps` times.
    pub fn relax(&mut self, faces: &Faces, sweeps: usize) {
        let neighbours = neighbours(self.bony.len(), &self.quads);
        let around = self.quads_around();
        let inner: Vec<usize> = (0..self.bony.len()).filter(|n| !self.on_outline[*n]).collect();
        for _ in 0..sweeps {
            for (side, query) in [faces.bony, faces.articular].into_iter().enumerate() {
                for &n in &inner {
                    let nodes = if side == 0 { &self.bony } else { &self.articular };
                    let place = query.nearest(&(nodes[n] + pull(nodes, n, &neighbours[n]) * 0.5)).point;
                    // At a notch of the outline the mean of the neighbours may lie beyond it.
                    let before = self.worst(&around[n], (n, side), &nodes[n]);
                    if self.worst(&around[n], (n, side), &place) >= before.min(LEAST_RELAXED) {
                        *self.node_mut(n, side) = place;
                    }
                }
            }
        }
    }

    /// The least scaled Jacobian at a corner of `quads` with node `v` of one face at `place`.
    fn worst(&self, quads: &[u32], (v, side): (usize, usize), place: &Point) -> f64 {
        quads.iter().flat_map(|&q| corner_shapes(&self.corners(q, (v, side), place))).fold(f64::INFINITY, f64::min)
    }

    /// Corners of the column of quadrilateral `q`, bony ones first, with node `v` of one face at `place`.
    fn corners(&self, q: u32, (v, side): (usize, usize), place: &Point) -> [Point; 8] {
        let quad = self.quads[q as usize].map(|c| c as usize);
        std::array::from_fn(|k| {
            let (c, face) = (quad[k % 4], k / 4);
            if c == v && face == side {
                *place
            } else if face == 0 {
                self.bony[c]
            } else {
                self.articular[c]
            }
        })
    }

    /// Moves nodes along their faces wherever that lowers a cost of the shape of the elements around them.
    ///
    /// The cost is the sum over element corners of (1 - s)^2 with s the scaled Jacobian, with a steep part for bad corners, and a part
    /// for in-plane edges outside 0.6 to 1.25 `edge` [mm], steep outside 0.5 to 1.28. Pattern search node by node in a fixed order: four directions,
    /// the step halved where none helps; badly shaped columns also move whole. Columns of the outline are held near it. At most `sweeps` sweeps.
    pub fn optimise(&mut self, faces: &Faces, edge: f64, sweeps: usize) {
        let around = self.quads_around();
        let neighbours = neighbours(self.bony.len(), &self.quads);
        let home = [self.bony.clone(), self.articular.clone()];
        let n = self.bony.len();
        let mut step = vec![0.15 * edge; 2 * n];
        let mut active = vec![true; n];
        for _ in 0..sweeps {
            let mut next = vec![false; n];
            for v in (0..n).filter(|v| active[*v]) {
                for side in 0..2 {
                    let search = Search { columns: self, around: &around[v], edge, home: home[side][v] };
                    let Some(found) = search.better(v, side, step[side * n + v], faces) else {
                        step[side * n + v] *= 0.5;
                        next[v] |= step[side * n + v] > 0.01 * edge;
                        continue;
                    };
                    *self.node_mut(v, side) = found;
                    next[v] = true;
                    neighbours[v].iter().for_each(|&m| next[m as usize] = true);
                }
                if self.worst(&around[v], (v, 0), &self.bony[v]) < GOOD
                    && self.shift(v, &around[v], [home[0][v], home[1][v]], edge, faces)
                {
                    step[v] = step[v].max(0.05 * edge);
                    step[n + v] = step[n + v].max(0.05 * edge);
                    next[v] = true;
                    neighbours[v].iter().for_each(|&m| next[m as usize] = true);
                }
            }
            active = next;
        }
    }

    /// Moves a whole column where that lowers the cost: where both its ends are badly placed, moving one twists it.
    fn shift(&mut self, v: usize, around: &[u32], home: [Point; 2], edge: f64, faces: &Faces) -> bool {
        let cost = |columns: &Columns| -> f64 {
            let ends = [columns.bony[v], columns.articular[v]];
            (0..2).map(|side| Search { columns, around, edge, home: home[side] }.cost(v, side, &ends[side])).sum()
        };
        let [x, y] = Search { columns: self, around, edge, home: home[0] }.directions(v, 0);
        let (here, before) = ([self.bony[v], self.articular[v]], cost(self));
        let mut best = (before - 1e-6, here);
        for size in [0.3, 0.1] {
            for direction in [x, -x, y, -y, (x + y) * 0.7, (x - y) * 0.7, (y - x) * 0.7, -(x + y) * 0.7] {
                let by = direction * (size * edge);
                self.bony[v] = faces.bony.nearest(&(here[0] + by)).point;
                self.articular[v] = faces.articular.nearest(&(here[1] + by)).point;
                let new = cost(self);
                if new < best.0 {
                    best = (new, [self.bony[v], self.articular[v]]);
                }
            }
        }
        [self.bony[v], self.articular[v]] = best.1;
        best.0 < before - 1e-6
    }

    fn node_mut(&mut self, v: usize, side: usize) -> &mut Point {
        if side == 0 { &mut self.bony[v] } else { &mut self.articular[v] }
    }

    fn quads_around(&self) -> Vec<Vec<u32>> {
        let mut around = vec![Vec::new(); self.bony.len()];
        for (q, quad) in self.quads.iter().enumerate() {
            quad.iter().for_each(|&v| around[v as usize].push(q as u32));
        }
        around
    }
}

/// From a node towards its neighbours, far ones weighing more, so that lengths even out [mm].
fn pull(nodes: &[Point], n: usize, neighbours: &[u32]) -> Vector {
    let (mut sum, mut weights) = (Vector::zeros(), 0.0);
    for &m in neighbours {
        let edge = nodes[m as usize] - nodes[n];
        sum += edge * edge.norm_squared();
        weights += edge.norm_squared();
    }
    if weights > 0.0 { sum / weights } else { sum }
}

/// Scaled Jacobians at the corners of a column, bony ones first.
fn corner_shapes(p: &[Point; 8]) -> [f64; 8] {
    std::array::from_fn(|c| {
        let (k, base) = (c % 4, c / 4 * 4);
        let up = p[k + 4] - p[k];
        let (next, last) = (p[base + (k + 1) % 4] - p[c], p[base + (k + 3) % 4] - p[c]);
        let lengths = (next.norm_squared() * last.norm_squared()).sqrt() * up.norm();
        if lengths > 0.0 { next.cross(&last).dot(&up) / lengths } else { -1.0 }
    })
}

/// The search for a better place of one node.
struct Search<'a> {
    columns: &'a Columns,
    around: &'a [u32],
    edge: f64,
    home: Point,
}

impl Search<'_> {
    fn better(&self, v: usize, side: usize, step: f64, faces: &Faces) -> Option<Point> {
        let (nodes, query) =
            if side == 0 { (&self.columns.bony, faces.bony) } else { (&self.columns.articular, faces.articular) };
        let here = nodes[v];
        let cost = self.cost(v, side, &here);
        if cost < 1e-3 {
            return None;
        }
        let [x, y] = self.directions(v, side);
        let mut best = (cost, here);
        for direction in [x, -x, y, -y] {
            let there = here + direction * step;
            let new = self.cost(v, side, &there);
            if new < best.0 {
                best = (new, there);
            }
        }
        if best.0 >= cost {
            return None;
        }
        let there = query.nearest(&best.1).point;
        (self.cost(v, side, &there) < cost - 1e-6).then_some(there)
    }

    /// Two orthogonal directions in the plane of the quadrilaterals around, the first along one of their edges.
    fn directions(&self, v: usize, side: usize) -> [Vector; 2] {
        let nodes = if side == 0 { &self.columns.bony } else { &self.columns.articular };
        let corner = |q: u32, k: usize| nodes[self.columns.quads[q as usize][k] as usize];
        let normal: Vector = self
            .around
            .iter()
            .map(|&q| (corner(q, 2) - corner(q, 0)).cross(&(corner(q, 3) - corner(q, 1))))
            .sum::<Vector>()
            .try_normalize(0.0)
            .unwrap_or_else(Vector::zeros);
        let quad = self.columns.quads[self.around[0] as usize];
        let k = quad.iter().position(|&c| c as usize == v).unwrap_or(0);
        let along = nodes[quad[(k + 1) % 4] as usize] - nodes[v];
        let x = (along - normal * along.dot(&normal)).try_normalize(0.0).unwrap_or_else(Vector::zeros);
        [x, normal.cross(&x)]
    }

    fn cost(&self, v: usize, side: usize, place: &Point) -> f64 {
        let columns = self.columns;
        let mut sum = 0.0;
        for &q in self.around {
            let p = columns.corners(q, (v, side), place);
            sum += self.shape_cost(&p, side);
        }
        if columns.on_outline[v] {
            sum += STAY_WEIGHT * (place - self.home).norm_squared() / (self.edge * self.edge);
        }
        sum
    }

    fn shape_cost(&self, p: &[Point; 8], side: usize) -> f64 {
        let mut sum = 0.0;
        for s in corner_shapes(p) {
            sum += (1.0 - s).powi(2);
            if s < GOOD {
                sum += BAD_WEIGHT * (GOOD - s).powi(2);
            }
        }
        for k in 0..4 {
            let length = (p[4 * side + (k + 1) % 4] - p[4 * side + k]).norm() / self.edge;
            let outside = |low: f64, high: f64| (low - length).max(0.0).powi(2) + (length - high).max(0.0).powi(2);
            sum += LENGTH_WEIGHT * outside(0.6, 1.25) + LIMIT_WEIGHT * outside(0.5, 1.28);
        }
        sum
    }
}

//! Columns of hexahedra between a bony and an articular face, and the improvement of their shape.

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
        for _ in 0..sweeps {
            for (nodes, query) in [(&mut self.bony, faces.bony), (&mut self.articular, faces.articular)] {
                let old = nodes.clone();
                for (n, list) in neighbours.iter().enumerate().filter(|(n, _)| !self.on_outline[*n]) {
                    // Long edges pull more, so that lengths even out.
                    let pull = |m: u32| (old[m as usize] - old[n]) * (old[m as usize] - old[n]).norm_squared();
                    let weight: f64 = list.iter().map(|&m| (old[m as usize] - old[n]).norm_squared()).sum();
                    let step = list.iter().map(|&m| pull(m)).sum::<Vector>() / weight.max(f64::MIN_POSITIVE);
                    nodes[n] = query.nearest(&(old[n] + step * 0.5)).point;
                }
            }
        }
    }

    /// Moves nodes along their faces wherever that lowers a cost of the shape of the elements around them.
    ///
    /// The cost is the sum over element corners of (1 - s)^2 with s the scaled Jacobian, with a steep part for bad corners, and a part
    /// for in-plane edges outside 0.6 to 1.25 `edge` [mm], steep outside 0.5 to 1.28. Pattern search node by node in a fixed order: four directions,
    /// the step halved where none helps. Columns of the outline are held near it. At most `sweeps` sweeps.
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
            }
            active = next;
        }
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
            let quad = columns.quads[q as usize];
            let mut p = [Point::origin(); 8];
            for k in 0..4 {
                let c = quad[k] as usize;
                p[k] = if c == v && side == 0 { *place } else { columns.bony[c] };
                p[k + 4] = if c == v && side == 1 { *place } else { columns.articular[c] };
            }
            sum += self.shape_cost(&p, side);
        }
        if columns.on_outline[v] {
            sum += STAY_WEIGHT * (place - self.home).norm_squared() / (self.edge * self.edge);
        }
        sum
    }

    fn shape_cost(&self, p: &[Point; 8], side: usize) -> f64 {
        let mut sum = 0.0;
        let quad = |base: usize, k: usize| p[base + k % 4];
        for k in 0..4 {
            let up = p[k + 4] - p[k];
            let height = up.norm().max(f64::MIN_POSITIVE);
            for base in [0, 4] {
                let (next, last) = (quad(base, k + 1) - p[base + k], quad(base, k + 3) - p[base + k]);
                let lengths = (next.norm_squared() * last.norm_squared()).sqrt() * height;
                let s = if lengths > 0.0 { next.cross(&last).dot(&up) / lengths } else { -1.0 };
                sum += (1.0 - s).powi(2);
                if s < GOOD {
                    sum += BAD_WEIGHT * (GOOD - s).powi(2);
                }
            }
            let length = (quad(4 * side, k + 1) - p[4 * side + k]).norm() / self.edge;
            let outside = |low: f64, high: f64| (low - length).max(0.0).powi(2) + (length - high).max(0.0).powi(2);
            sum += LENGTH_WEIGHT * outside(0.6, 1.25) + LIMIT_WEIGHT * outside(0.5, 1.28);
        }
        sum
    }
}

//! Faces that may touch: quadrilaterals with their neighbours, nodes with their tributary areas, and the search for who is near whom.

use std::collections::BTreeMap;

/// No quadrilateral.
pub(super) const NONE: u32 = u32::MAX;

/// A face of the model; node numbers are the model's.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// Quadrilaterals, outward normals.
    pub(super) quads: Vec<[u32; 4]>,
    /// The quadrilateral across each edge (edge k runs from corner k to k + 1); `NONE` at the rim.
    pub(super) across: Vec<[u32; 4]>,
    /// Its nodes, ascending, with their tributary areas at the start [mm2].
    pub(super) nodes: Vec<u32>,
    pub(super) area: Vec<f64>,
    /// Quadrilaterals at each node of `nodes`: the first, for a normal.
    pub(super) at_node: Vec<u32>,
    /// Longest edge at the start [mm].
    pub(super) longest: f64,
}

impl Surface {
    pub(super) fn new(quads: Vec<[u32; 4]>, x: &[[f64; 3]]) -> Surface {
        let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut areas: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
        let mut longest: f64 = 0.0;
        for (q, quad) in quads.iter().enumerate() {
            let p = quad.map(|n| x[n as usize]);
            let share = norm(&cross(&minus(&p[2], &p[0]), &minus(&p[3], &p[1]))) / 8.0;
            for k in 0..4 {
                edges.insert((quad[k], quad[(k + 1) % 4]), q as u32);
                areas.entry(quad[k]).or_insert((0.0, q as u32)).0 += share;
                longest = longest.max(norm(&minus(&p[(k + 1) % 4], &p[k])));
            }
        }
        let find = |a: u32, b: u32| edges.get(&(b, a)).copied().unwrap_or(NONE);
        let across = quads.iter().map(|q| std::array::from_fn(|k| find(q[k], q[(k + 1) % 4]))).collect();
        let nodes = areas.keys().copied().collect();
        let (area, at_node) = areas.into_values().unzip();
        Surface { quads, across, nodes, area, at_node, longest }
    }

    /// Area vector of a quadrilateral times two.
    #[inline]
    pub(super) fn normal(&self, quad: u32, x: &[[f64; 3]]) -> [f64; 3] {
        let p = self.quads[quad as usize].map(|n| &x[n as usize]);
        cross(&minus(p[2], p[0]), &minus(p[3], p[1]))
    }
}

/// Quadrilaterals sorted into cells of a grid; kept from search to search, so that a search allocates nothing once it has grown.
#[derive(Clone, Debug, Default)]
pub(super) struct Grid {
    low: [f64; 3],
    cell: f64,
    size: [usize; 3],
    starts: Vec<u32>,
    sorted: Vec<u32>,
    centres: Vec<[f64; 3]>,
}

/// Cells along an axis, at most.
const MOST_CELLS: usize = 96;

impl Grid {
    /// Sorts the quadrilaterals of a face by their centres.
    pub(super) fn fill(&mut self, face: &Surface, x: &[[f64; 3]], cell: f64) {
        self.centres.clear();
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for quad in &face.quads {
            let p = quad.map(|n| &x[n as usize]);
            let centre: [f64; 3] = std::array::from_fn(|a| p.iter().map(|p| p[a]).sum::<f64>() / 4.0);
            for a in 0..3 {
                bounds[0][a] = bounds[0][a].min(centre[a]);
                bounds[1][a] = bounds[1][a].max(centre[a]);
            }
            self.centres.push(centre);
        }
        let widest = (0..3).map(|a| bounds[1][a] - bounds[0][a]).fold(0.0, f64::max);
        self.low = bounds[0];
        self.cell = cell.max(widest / (MOST_CELLS - 1) as f64);
        self.size = std::array::from_fn(|a| {
            let cells = ((bounds[1][a] - bounds[0][a]) / self.cell) as usize + 1;
            cells.min(MOST_CELLS)
        });
        let cells = self.size.iter().product::<usize>();
        self.starts.clear();
        self.starts.resize(cells + 1, 0);
        for q in 0..self.centres.len() {
            let at = self.place(&self.centres[q]);
            self.starts[at + 1] += 1;
        }
        for c in 0..cells {
            self.starts[c + 1] += self.starts[c];
        }
        self.sorted.clear();
        self.sorted.resize(self.centres.len(), 0);
        // backwards, so that each cell's count leads to its start again
        for q in (0..self.centres.len()).rev() {
            let at = self.place(&self.centres[q]);
            self.starts[at + 1] -= 1;
            self.sorted[self.starts[at + 1] as usize] = q as u32;
        }
        let total = self.sorted.len() as u32;
        self.starts.rotate_left(1);
        self.starts[cells] = total;
    }

    fn place(&self, p: &[f64; 3]) -> usize {
        let at: [usize; 3] =
            std::array::from_fn(|a| (((p[a] - self.low[a]) / self.cell).max(0.0) as usize).min(self.size[a] - 1));
        (at[2] * self.size[1] + at[1]) * self.size[0] + at[0]
    }

    /// The quadrilateral with the nearest centre among those whose area vector points against `normal`, within `reach` [mm]; `NONE` where
    /// there is none.
    pub(super) fn nearest(
        &self,
        face: &Surface,
        x: &[[f64; 3]],
        (p, normal): (&[f64; 3], &[f64; 3]),
        reach: f64,
    ) -> u32 {
        let mut range = [[0usize; 2]; 3];
        for (a, r) in range.iter_mut().enumerate() {
            let (low, high) = ((p[a] - reach - self.low[a]) / self.cell, (p[a] + reach - self.low[a]) / self.cell);
            let off = high < 0.0 || low >= self.size[a] as f64;
            if off || !low.is_finite() || !high.is_finite() {
                return NONE;
            }
            *r = [low.max(0.0) as usize, (high as usize).min(self.size[a] - 1)];
        }
        let (mut best, mut found) = (reach * reach, NONE);
        for k in range[2][0]..=range[2][1] {
            for j in range[1][0]..=range[1][1] {
                let row = (k * self.size[1] + j) * self.size[0];
                let (from, to) = (self.starts[row + range[0][0]], self.starts[row + range[0][1] + 1]);
                for &q in &self.sorted[from as usize..to as usize] {
                    let d = minus(p, &self.centres[q as usize]);
                    let squared = dot(&d, &d);
                    if squared < best && dot(&face.normal(q, x), normal) < 0.0 {
                        (best, found) = (squared, q);
                    }
                }
            }
        }
        found
    }
}

#[inline(always)]
pub(super) fn minus(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
pub(super) fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
pub(super) fn norm(a: &[f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

//! Quadrilaterals within an outline: the squares of a regular grid well inside, and a ring from them to the outline.

use super::Outline;
use crate::parametrise::Flat;
use nalgebra::Vector2;
use std::collections::BTreeMap;

/// A flat quadrilateral mesh, conforming, without pinched nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct QuadGrid {
    /// Node positions [mm].
    pub nodes: Vec<Flat>,
    /// Corner nodes of each quadrilateral, counter-clockwise.
    pub quads: Vec<[u32; 4]>,
    /// Whether each node lies on the outline.
    pub on_outline: Vec<bool>,
}

/// Squares are kept whose corners are deeper inside than this, in edges: room for the ring.
const RING_WIDTH: f64 = 0.6;
/// Grid positions tried along each axis.
const OFFSETS: usize = 6;
/// Smoothing sweeps.
const SWEEPS: usize = 40;

/// The mesh of edge `edge` [mm] within `outline`; empty when no square fits.
///
/// The stepped border of the squares gets one ring of quadrilaterals out to the outline (pillowing, [mitchell1995]), so
/// that no element has two edges on a smooth outline. The grid's offset is the one with the fewest steps.
pub fn quads_within(outline: &Outline, edge: f64) -> QuadGrid {
    let (lo, hi) = outline.bounds();
    let size = ((hi - lo) / edge).map(|s| s.ceil() as usize + 2);
    let mut best: Option<(f64, Squares)> = None;
    for offset in 0..OFFSETS * OFFSETS {
        let shift = Vector2::new((offset % OFFSETS) as f64, (offset / OFFSETS) as f64) / OFFSETS as f64 * edge;
        let squares = Squares::within(outline, lo - shift, edge, (size.x, size.y));
        let steps = squares.steps();
        // A square more is worth as much as a step less: no grid wins by leaving the border empty.
        let score = squares.kept.iter().filter(|k| **k).count() as f64 - steps as f64;
        if best.as_ref().is_none_or(|(b, _)| score > *b) {
            best = Some((score, squares));
        }
    }
    let Some((_, squares)) = best else { return QuadGrid::default() };
    let mut grid = squares.with_ring(outline);
    smooth(&mut grid, outline);
    grid
}

/// Squares of a grid, `width` x `height`.
struct Squares {
    corner: Flat,
    edge: f64,
    width: usize,
    height: usize,
    kept: Vec<bool>,
}

impl Squares {
    fn within(outline: &Outline, corner: Flat, edge: f64, (width, height): (usize, usize)) -> Squares {
        let mut squares = Squares { corner, edge, width, height, kept: vec![false; width * height] };
        let depth: Vec<f64> = (0..(width + 1) * (height + 1))
            .map(|k| outline.depth(&squares.node(k % (width + 1), k / (width + 1))) / edge)
            .collect();
        for j in 0..height {
            for i in 0..width {
                let lowest = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .map(|(a, b)| depth[(j + b) * (width + 1) + i + a])
                    .into_iter()
                    .fold(f64::INFINITY, f64::min);
                squares.kept[j * width + i] = lowest >= RING_WIDTH;
            }
        }
        squares.tidy();
        squares
    }

    fn node(&self, i: usize, j: usize) -> Flat {
        self.corner + Vector2::new(i as f64, j as f64) * self.edge
    }

    fn at(&self, i: isize, j: isize) -> bool {
        i >= 0
            && j >= 0
            && (i as usize) < self.width
            && (j as usize) < self.height
            && self.kept[j as usize * self.width + i as usize]
    }

    /// Kept squares around node (i, j): lower left, lower right, upper right, upper left.
    fn around(&self, i: usize, j: usize) -> [bool; 4] {
        let (i, j) = (i as isize, j as isize);
        [self.at(i - 1, j - 1), self.at(i, j - 1), self.at(i, j), self.at(i - 1, j)]
    }

    /// Drops squares that hang by one side or touch at a corner alone, and all but the largest part, until none does.
    fn tidy(&mut self) {
        loop {
            let mut drop = Vec::new();
            for j in 0..self.height {
                for i in 0..self.width {
                    let (x, y) = (i as isize, j as isize);
                    let sides = [self.at(x - 1, y), self.at(x + 1, y), self.at(x, y - 1), self.at(x, y + 1)];
                    let pinched = [(0, 0), (1, 0), (0, 1), (1, 1)].iter().any(|&(a, b)| {
                        let c = self.around(i + a, j + b);
                        c == [true, false, true, false] || c == [false, true, false, true]
                    });
                    if self.at(x, y) && (pinched || sides.iter().filter(|s| **s).count() < 2) {
                        drop.push(j * self.width + i);
                    }
                }
            }
            if drop.is_empty() {
                break;
            }
            drop.into_iter().for_each(|k| self.kept[k] = false);
        }
        let raster = super::Raster { origin: self.corner, pitch: self.edge, width: self.width, height: self.height };
        self.kept = raster.largest_part(&self.kept);
    }

    /// Nodes where the border turns.
    fn steps(&self) -> usize {
        (0..=self.height)
            .flat_map(|j| (0..=self.width).map(move |i| (i, j)))
            .filter(|&(i, j)| matches!(self.around(i, j).iter().filter(|c| **c).count(), 1 | 3))
            .count()
    }

    fn with_ring(&self, outline: &Outline) -> QuadGrid {
        let mut grid = QuadGrid::default();
        let mut index: BTreeMap<(usize, usize), u32> = BTreeMap::new();
        let mut border: Vec<((usize, usize), (usize, usize))> = Vec::new();
        for j in 0..self.height {
            for i in 0..self.width {
                let (x, y) = (i as isize, j as isize);
                if !self.at(x, y) {
                    continue;
                }
                let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                grid.quads.push(corners.map(|c| {
                    *index.entry(c).or_insert_with(|| {
                        grid.nodes.push(self.node(c.0, c.1));
                        (grid.nodes.len() - 1) as u32
                    })
                }));
                let beyond = [(x, y - 1), (x + 1, y), (x, y + 1), (x - 1, y)];
                for (k, &(a, b)) in beyond.iter().enumerate() {
                    if !self.at(a, b) {
                        border.push((corners[k], corners[(k + 1) % 4]));
                    }
                }
            }
        }
        let inner = grid.nodes.len();
        let mut outer: BTreeMap<u32, u32> = BTreeMap::new();
        for (from, to) in border {
            let (a, b) = (index[&from], index[&to]);
            let [c, d] = [a, b].map(|n| {
                *outer.entry(n).or_insert_with(|| {
                    grid.nodes.push(outline.foot(&grid.nodes[n as usize]));
                    (grid.nodes.len() - 1) as u32
                })
            });
            grid.quads.push([b, a, c, d]);
        }
        grid.on_outline = (0..grid.nodes.len()).map(|n| n >= inner).collect();
        grid
    }
}

/// Smoothing makes no corner worse than this sine.
const LEAST_SINE: f64 = 0.4;

/// Each node towards the mean of its neighbours; those of the outline along it. No corner is turned over by it: at a sharp
/// notch of the outline the feet of neighbours may change places.
fn smooth(grid: &mut QuadGrid, outline: &Outline) {
    let neighbours = neighbours(grid.nodes.len(), &grid.quads);
    let mut around = vec![Vec::new(); grid.nodes.len()];
    for q in &grid.quads {
        q.iter().for_each(|&n| around[n as usize].push(*q));
    }
    for _ in 0..SWEEPS {
        for (n, list) in neighbours.iter().enumerate() {
            let edge = grid.on_outline[n];
            // Along the outline, the inner neighbour's foot counts as much as both neighbours on the outline together.
            let weight = |m: u32| if edge && !grid.on_outline[m as usize] { 2.0 } else { 1.0 };
            let total: f64 = list.iter().map(|&m| weight(m)).sum();
            let mean = list.iter().map(|&m| grid.nodes[m as usize].coords * weight(m)).sum::<Vector2<f64>>() / total;
            let moved = Flat::from(0.4 * grid.nodes[n].coords + 0.6 * mean);
            let place = if edge { outline.foot(&moved) } else { moved };
            let here = grid.nodes[n];
            let before = least_sine(&grid.nodes, &around[n]);
            grid.nodes[n] = place;
            if least_sine(&grid.nodes, &around[n]) < before.min(LEAST_SINE) {
                grid.nodes[n] = here;
            }
        }
    }
}

/// The least sine of a corner of `quads`; negative where one is turned over.
fn least_sine(nodes: &[Flat], quads: &[[u32; 4]]) -> f64 {
    let corner = |q: &[u32; 4], k: usize| {
        let [last, here, next] = [k + 3, k, k + 1].map(|i| nodes[q[i % 4] as usize]);
        let (a, b) = (next - here, last - here);
        let lengths = (a.norm_squared() * b.norm_squared()).sqrt();
        if lengths > 0.0 { a.perp(&b) / lengths } else { -1.0 }
    };
    quads.iter().flat_map(|q| (0..4).map(move |k| corner(q, k))).fold(f64::INFINITY, f64::min)
}

/// Neighbours of each node along edges, each list ascending.
pub fn neighbours(nodes: usize, quads: &[[u32; 4]]) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); nodes];
    for q in quads {
        for k in 0..4 {
            let (a, b) = (q[k], q[(k + 1) % 4]);
            lists[a as usize].push(b);
            lists[b as usize].push(a);
        }
    }
    for list in &mut lists {
        list.sort_unstable();
        list.dedup();
    }
    lists
}

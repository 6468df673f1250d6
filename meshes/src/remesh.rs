//! Isotropic remeshing of a closed surface: edges of one length, well-shaped triangles, the shape kept.

use crate::halfedge::{HalfEdges, next, prev};
use crate::query::SurfaceQuery;
use crate::surface::TriMesh;
use crate::{Point, Vector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How to remesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemeshOptions {
    /// Wanted edge length [mm].
    pub edge_mm: f64,
    /// Rounds of split, collapse, flip, relax and project [-].
    pub rounds: usize,
}

impl Default for RemeshOptions {
    fn default() -> Self {
        RemeshOptions { edge_mm: 1.5, rounds: 6 }
    }
}

/// Why a surface cannot be remeshed.
#[derive(Debug, thiserror::Error, Clone, PartialEq, Eq)]
pub enum RemeshError {
    /// The method works on closed surfaces.
    #[error("surface is not closed and two-manifold: repair it before remeshing")]
    NotClosed,
    /// The wanted edge length is not a positive number.
    #[error("wanted edge length is not a positive number")]
    EdgeLength,
}

/// Gives the closed surface `mesh` edges of about `options.edge_mm`, vertices on the surface it had.
///
/// Method: split, collapse, flip, relax tangentially, project [botsch2004], bounds 4/3 and 4/5 of the
/// wanted length. Ours differs: triangles bear `labels` (one each, or none), and edges between labels are features
/// that stay where they are, as curves; a vertex is projected onto the part of the surface with its own label; a change that
/// would fold the surface is refused.
///
/// Cost O(rounds n log n). Guarantees: closed stays closed, with the same number of bodies and handles.
pub fn remesh(mesh: &TriMesh, labels: &[u32], options: &RemeshOptions) -> Result<(TriMesh, Vec<u32>), RemeshError> {
    if !(options.edge_mm > 0.0 && options.edge_mm.is_finite()) {
        return Err(RemeshError::EdgeLength);
    }
    let mut edges = HalfEdges::new(mesh, labels).ok_or(RemeshError::NotClosed)?;
    let shape = Shape::of(&edges, mesh);
    for round in 0..options.rounds {
        split_long(&mut edges, options.edge_mm * 4.0 / 3.0);
        collapse_short(&mut edges, options.edge_mm);
        flip_for_valence(&mut edges);
        relax(&mut edges, &shape);
        if round + 1 == options.rounds {
            flip_for_angle(&mut edges);
            mend_slivers(&mut edges, options.edge_mm);
        }
    }
    Ok(edges.compacted())
}

/// The surface as it was: one query a label, and the feature curves between them.
struct Shape {
    parts: BTreeMap<u32, SurfaceQuery>,
    curve: Vec<[Point; 2]>,
}

impl Shape {
    fn of(edges: &HalfEdges, mesh: &TriMesh) -> Shape {
        let mut labels = edges.label.clone();
        labels.sort_unstable();
        labels.dedup();
        let parts = labels
            .into_iter()
            .filter_map(|l| Some((l, SurfaceQuery::new(&mesh.submesh(|t| edges.label[t] == l).0)?)))
            .collect();
        let curve = (0..edges.start.len() as u32)
            .filter(|&h| h < edges.twin[h as usize] && edges.is_feature(h))
            .map(|h| [edges.start[h as usize], edges.end(h)].map(|v| edges.points[v as usize]))
            .collect();
        Shape { parts, curve }
    }

    fn onto_curve(&self, p: &Point) -> Point {
        let mut best = (f64::INFINITY, *p);
        for &[a, b] in &self.curve {
            let along = b - a;
            let s = ((p - a).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            let q = a + along * s;
            let d = (p - q).norm_squared();
            if d < best.0 {
                best = (d, q);
            }
        }
        best.1
    }
}

/// Splits edges longer than `limit` at their middles, the longest first: short ones first would make fans of slivers.
fn split_long(edges: &mut HalfEdges, limit: f64) {
    loop {
        let mut long: Vec<(f64, u32)> = (0..edges.start.len() as u32)
            .filter(|&h| !edges.dead[h as usize / 3] && h < edges.twin[h as usize])
            .map(|h| (edges.length(h), h))
            .filter(|&(length, _)| length > limit)
            .collect();
        let Some(longest) = long.iter().map(|e| e.0).max_by(f64::total_cmp) else { return };
        long.retain(|e| e.0 > 0.7 * longest);
        long.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(&y.1)));
        for (length, h) in long {
            // an earlier split may have halved this edge
            if edges.length(h) >= length {
                let ends = [edges.start[h as usize], edges.end(h)].map(|v| edges.points[v as usize]);
                edges.split(h, nalgebra::center(&ends[0], &ends[1]));
            }
        }
    }
}

fn collapse_short(edges: &mut HalfEdges, edge_mm: f64) {
    for h in 0..edges.start.len() as u32 {
        if !edges.dead[h as usize / 3] && edges.length(h) < edge_mm * 0.8 && may_collapse(edges, h, edge_mm * 4.0 / 3.0)
        {
            edges.collapse(h);
        }
    }
}

/// Whether the start of `h` can move into its end: the surface stays a manifold, features stay, nothing folds or grows long.
fn may_collapse(edges: &HalfEdges, h: u32, longest: f64) -> bool {
    let (u, v) = (edges.start[h as usize], edges.end(h));
    let features = edges.feature_valence(u);
    if features > 0 && (features != 2 || !edges.is_feature(h)) {
        return false;
    }
    let (c, d) = (edges.start[prev(h) as usize], edges.start[prev(edges.twin[h as usize]) as usize]);
    let mut shared = 0;
    for e in edges.around(u) {
        let w = edges.end(e);
        if w != v && edges.joined(w, v) {
            shared += 1;
        }
    }
    if shared != 2 || c == d || edges.around(c).count() <= 3 || edges.around(d).count() <= 3 {
        return false;
    }
    let target = edges.points[v as usize];
    let whole = edges.length(h) < 1e-3 * longest;
    edges.around(u).all(|e| {
        let (a, b) = (edges.end(e), edges.end(next(e)));
        if a == v || b == v {
            return true;
        }
        let [p, q, r] = [u, a, b].map(|i| edges.points[i as usize]);
        let before = (q - p).cross(&(r - p));
        let after = (q - target).cross(&(r - target));
        (target - q).norm() <= longest
            && (target - r).norm() <= longest
            && (whole || !folds(&before, &after))
            && (after.norm() > 0.0)
            && (shape_quality(&target, &q, &r) > 0.2f64.min(0.5 * shape_quality(&p, &q, &r)))
    })
}

/// Whether a triangle's area vector turns by more than about 60 degrees.
fn folds(before: &Vector, after: &Vector) -> bool {
    before.dot(after) < 0.5 * before.norm() * after.norm()
}

/// 1 for an equilateral triangle, 0 for a degenerate one.
fn shape_quality(a: &Point, b: &Point, c: &Point) -> f64 {
    let sum = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
    if sum > 0.0 { 2.0 * 3f64.sqrt() * (b - a).cross(&(c - a)).norm() / sum } else { 0.0 }
}

fn flip_for_valence(edges: &mut HalfEdges) {
    let mut valence: Vec<i32> = (0..edges.points.len() as u32).map(|v| edges.around(v).count() as i32).collect();
    for h in 0..edges.start.len() as u32 {
        let Some([a, b, c, d]) = flippable(edges, h) else { continue };
        let off = |v: u32, change: i32| (valence[v as usize] + change - 6).pow(2);
        let before = off(a, 0) + off(b, 0) + off(c, 0) + off(d, 0);
        let after = off(a, -1) + off(b, -1) + off(c, 1) + off(d, 1);
        if after < before && flip_is_sound(edges, [a, b, c, d], 0.6) {
            edges.flip(h);
            for (v, change) in [(a, -1), (b, -1), (c, 1), (d, 1)] {
                valence[v as usize] += change;
            }
        }
    }
}

fn flip_for_angle(edges: &mut HalfEdges) {
    for h in 0..edges.start.len() as u32 {
        if let Some(corners) = flippable(edges, h)
            && flip_is_sound(edges, corners, 1.05)
        {
            edges.flip(h);
        }
    }
}

/// Triangles of less quality than this are slivers [-]: needles of 15 degrees and less. Four published bones and their phantoms have none below 0.7 but for a few such.
const SLIVER: f64 = 0.45;
/// Mending a sliver may leave another beside it; this many passes at most [-].
const PASSES: usize = 3;

/// Removes slivers that the last move left: three points that it laid onto one straight feature. The longest edge turns; where it cannot, a corner
/// goes along a feature, or into a neighbour.
fn mend_slivers(edges: &mut HalfEdges, edge_mm: f64) {
    for _ in 0..PASSES {
        let slivers: Vec<u32> = (0..edges.dead.len() as u32).filter(|&t| is_sliver(edges, t)).collect();
        if slivers.is_empty() {
            return;
        }
        for t in slivers {
            // a neighbour's mending may have removed or mended it
            if is_sliver(edges, t) {
                mend_sliver(edges, t, edge_mm);
            }
        }
    }
}

fn is_sliver(edges: &HalfEdges, t: u32) -> bool {
    let [a, b, c] = [0, 1, 2].map(|k| edges.points[edges.start[(3 * t + k) as usize] as usize]);
    !edges.dead[t as usize] && shape_quality(&a, &b, &c) < SLIVER
}

fn mend_sliver(edges: &mut HalfEdges, t: u32, edge_mm: f64) {
    let mut sides = [0, 1, 2].map(|k| 3 * t + k);
    sides.sort_by(|x, y| edges.length(*y).total_cmp(&edges.length(*x)).then(x.cmp(y)));
    let longest = sides[0];
    let turned = longest.min(edges.twin[longest as usize]);
    if let Some(corners) = flippable(edges, turned)
        && flip_is_sound(edges, corners, 1.05)
    {
        return edges.flip(turned);
    }
    let both_ways = sides.into_iter().rev().flat_map(|h| [h, edges.twin[h as usize]]);
    let found = both_ways.collect::<Vec<_>>().into_iter().find(|&h| may_collapse(edges, h, 2.0 * edge_mm));
    if let Some(h) = found {
        edges.collapse(h);
    }
}

/// The ends and the opposite corners of an edge that could be turned.
fn flippable(edges: &HalfEdges, h: u32) -> Option<[u32; 4]> {
    let g = edges.twin[h as usize];
    if edges.dead[h as usize / 3] || h > g || edges.is_feature(h) {
        return None;
    }
    let (a, b) = (edges.start[h as usize], edges.start[g as usize]);
    let (c, d) = (edges.start[prev(h) as usize], edges.start[prev(g) as usize]);
    let free = c != d && !edges.joined(c, d) && edges.around(a).nth(3).is_some() && edges.around(b).nth(3).is_some();
    free.then_some([a, b, c, d])
}

/// Whether the worse triangle after the flip is at least `gain` times as good as the worse one before, and nothing folds.
fn flip_is_sound(edges: &HalfEdges, [a, b, c, d]: [u32; 4], gain: f64) -> bool {
    let [a, b, c, d] = [a, b, c, d].map(|v| edges.points[v as usize]);
    let before = shape_quality(&a, &b, &c).min(shape_quality(&b, &a, &d));
    let after = shape_quality(&d, &c, &a).min(shape_quality(&c, &d, &b));
    let normal = (b - a).cross(&(c - a)) + (a - b).cross(&(d - b));
    let (first, second) = ((c - d).cross(&(a - d)), (d - c).cross(&(b - c)));
    after > gain * before && !folds(&normal, &first) && !folds(&normal, &second) && !folds(&first, &second)
}

/// Moves each vertex to the weighted centre of its neighbours within the tangent plane, then onto the surface as it was.
fn relax(edges: &mut HalfEdges, shape: &Shape) {
    let count = edges.points.len();
    let mut area = vec![0.0; count];
    let mut normal = vec![Vector::zeros(); count];
    for t in (0..edges.dead.len()).filter(|&t| !edges.dead[t]) {
        let corner = [0, 1, 2].map(|k| edges.start[3 * t + k] as usize);
        let [p, q, r] = corner.map(|v| edges.points[v]);
        let n = (q - p).cross(&(r - p));
        for v in corner {
            area[v] += n.norm();
            normal[v] += n;
        }
    }
    let moved: Vec<Point> =
        (0..count as u32).into_par_iter().map(|v| relaxed(edges, shape, v, &area, &normal)).collect();
    let before = std::mem::replace(&mut edges.points, moved);
    undo_folds(edges, &before);
}

fn relaxed(edges: &HalfEdges, shape: &Shape, v: u32, area: &[f64], normal: &[Vector]) -> Point {
    let p = edges.points[v as usize];
    let Some(first) = edges.around(v).next() else { return p };
    match edges.feature_valence(v) {
        0 => {
            let (mut sum, mut weight) = (Vector::zeros(), 0.0);
            for h in edges.around(v) {
                let w = edges.end(h) as usize;
                sum += area[w] * (edges.points[w] - p);
                weight += area[w];
            }
            let Some(n) = normal[v as usize].try_normalize(0.0).filter(|_| weight > 0.0) else { return p };
            let step = sum / weight;
            let wanted = p + (step - n * n.dot(&step));
            shape.parts.get(&edges.label[first as usize / 3]).map_or(p, |part| part.nearest(&wanted).point)
        }
        2 => {
            let sum: Vector =
                edges.around(v).filter(|&h| edges.is_feature(h)).map(|h| edges.points[edges.end(h) as usize] - p).sum();
            shape.onto_curve(&(p + sum * 0.25))
        }
        _ => p,
    }
}

/// Puts back the corners of triangles that the move turned over, until none is.
fn undo_folds(edges: &mut HalfEdges, before: &[Point]) {
    for _ in 0..4 {
        let mut back = Vec::new();
        for t in (0..edges.dead.len()).filter(|&t| !edges.dead[t]) {
            let corner = [0, 1, 2].map(|k| edges.start[3 * t + k] as usize);
            let old = area_vector(corner.map(|v| before[v]));
            let new = area_vector(corner.map(|v| edges.points[v]));
            if old.dot(&new) <= 0.1 * old.norm() * new.norm() {
                back.extend(corner);
            }
        }
        if back.is_empty() {
            return;
        }
        for v in back {
            edges.points[v] = before[v];
        }
    }
    edges.points.copy_from_slice(before);
}

fn area_vector([a, b, c]: [Point; 3]) -> Vector {
    (b - a).cross(&(c - a))
}

#[cfg(test)]
mod tests;

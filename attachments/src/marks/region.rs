//! The region an outline encloses, up to the middle of its line.

use super::MarkOptions;
use super::outline::{Inked, Interior};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use std::collections::BTreeMap;

/// A flat piece of a region.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Its corners [mm].
    pub corners: [Point; 3],
    /// Unit normal of the surface around it.
    pub normal: Vector,
}

impl Piece {
    /// Its area [mm2].
    pub fn area(&self) -> f64 {
        let [a, b, c] = self.corners;
        (b - a).cross(&(c - a)).norm() / 2.0
    }

    /// Its middle [mm].
    pub fn middle(&self) -> Point {
        Point::from(self.corners.iter().map(|p| p.coords).sum::<Vector>() / 3.0)
    }
}

/// An outlined region on a scan, scan frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// Area-weighted centroid [mm]; on a curved bone a little off the surface.
    pub centroid: Point,
    /// Area up to the middle of the line [mm2].
    pub area_mm2: f64,
    /// Median width of the line [mm].
    pub line_width_mm: f64,
    /// Share of the outline that was missing and has been bridged, by angle [-].
    pub gap_fraction: f64,
    /// Vertices of the scan inside, ascending.
    pub vertices: Vec<u32>,
    /// The region as triangles, cut along the middle of the line.
    pub pieces: Vec<Piece>,
}

impl Region {
    /// Whether a fifth or more of the smaller of the two regions is shared.
    pub fn overlaps(&self, other: &Region) -> bool {
        let shared = self.vertices.iter().filter(|v| other.vertices.binary_search(v).is_ok()).count();
        5 * shared >= self.vertices.len().min(other.vertices.len())
    }
}

/// How far around an interior the surface is looked at [mm].
const MARGIN: f64 = 10.0;
/// Smallest share of bare bone in a region: a blot with a shiny spot is no outline [-].
const BARE_MIN: f64 = 0.12;
/// Radius over which the scan's normals are averaged [mm].
const NORMAL_RADIUS: f64 = 2.5;

/// The region around `interior`, or `None` if its size or its line are not those of an outlined attachment.
///
/// The line's width is the median over the inner edge of the distance to bare bone on the other side, so that a smear or a neighbouring
/// line on one side does not move the region's edge, which lies half that distance outside the interior.
pub fn measure(surface: &Inked, normals: &[Vector], interior: &Interior, options: &MarkOptions) -> Option<Region> {
    let centre = mean(surface.mesh, &interior.vertices)?;
    let radius =
        interior.vertices.iter().map(|&v| (surface.mesh.vertices[v as usize] - centre).norm()).fold(0.0, f64::max);
    let patch = surface.patch(&interior.vertices, &centre, radius + MARGIN);
    let inside = filled(surface, &interior.vertices, &patch);
    let rim: Vec<u32> = inside
        .iter()
        .copied()
        .filter(|&v| surface.neighbours[v as usize].iter().any(|w| inside.binary_search(w).is_err()))
        .collect();
    let far_side = far_side(surface, &inside, &rim, &patch)?;
    let depth: BTreeMap<u32, f64> = patch
        .iter()
        .map(|&v| (v, if inside.binary_search(&v).is_ok() { 0.0 } else { distance(surface.mesh, v, &rim) }))
        .collect();
    let pieces = clipped(surface, normals, &depth, far_side / 2.0);
    let area_mm2: f64 = pieces.iter().map(Piece::area).sum();
    let line_width_mm = far_side - edge_length(surface, &rim);
    let areas = surface.mesh.vertex_areas();
    let bare: f64 = inside.iter().filter(|&&v| !surface.ink[v as usize]).map(|&v| areas[v as usize]).sum();
    let fits = (options.area_min_mm2..options.area_max_mm2).contains(&area_mm2)
        && line_width_mm <= options.line_width_max_mm
        && bare > BARE_MIN * area_mm2;
    let moment = pieces.iter().fold(Vector::zeros(), |s, p| s + p.area() * p.middle().coords);
    let vertices = depth.iter().filter(|(_, d)| **d < far_side / 2.0).map(|(&v, _)| v).collect();
    fits.then(|| Region {
        centroid: Point::from(moment / area_mm2),
        area_mm2,
        line_width_mm,
        gap_fraction: interior.gap_fraction,
        vertices,
        pieces,
    })
}

fn mean(mesh: &TriMesh, vertices: &[u32]) -> Option<Point> {
    let sum = vertices.iter().fold(Vector::zeros(), |s, &v| s + mesh.vertices[v as usize].coords);
    (!vertices.is_empty()).then(|| Point::from(sum / vertices.len() as f64))
}

/// `vertices` and all of the patch that they fence off from its edge: specks of ink, a screw, writing. Ascending.
fn filled(surface: &Inked, vertices: &[u32], patch: &[u32]) -> Vec<u32> {
    let within = |v: &u32| patch.binary_search(v).is_ok();
    let mut seen: BTreeMap<u32, bool> = patch.iter().map(|&v| (v, false)).collect();
    vertices.iter().for_each(|&v| _ = seen.insert(v, true));
    let mut parts: Vec<(bool, Vec<u32>)> = Vec::new();
    for &seed in patch {
        if seen.insert(seed, true) == Some(true) {
            continue;
        }
        let (mut part, mut next, mut reaches_edge) = (vec![seed], 0, false);
        while let Some(&v) = part.get(next) {
            next += 1;
            for w in &surface.neighbours[v as usize] {
                if !within(w) {
                    reaches_edge = true;
                } else if seen.insert(*w, true) == Some(false) {
                    part.push(*w);
                }
            }
        }
        parts.push((reaches_edge, part));
    }
    if parts.iter().all(|p| !p.0)
        && let Some(largest) = parts.iter_mut().max_by_key(|p| p.1.len())
    {
        largest.0 = true;
    }
    let mut all = vertices.to_vec();
    parts.into_iter().filter(|p| !p.0).for_each(|p| all.extend(p.1));
    all.sort_unstable();
    all
}

/// Median distance from the inner edge of the line to bare bone outside it [mm].
fn far_side(surface: &Inked, inside: &[u32], rim: &[u32], patch: &[u32]) -> Option<f64> {
    let ink = |v: u32| surface.ink[v as usize];
    let outside: Vec<u32> = patch.iter().copied().filter(|&v| !ink(v) && inside.binary_search(&v).is_err()).collect();
    let mut widths: Vec<f64> = rim
        .iter()
        .filter(|&&v| surface.neighbours[v as usize].iter().any(|&w| ink(w)))
        .map(|&v| distance(surface.mesh, v, &outside))
        .filter(|w| w.is_finite())
        .collect();
    let middle = widths.len() / 2;
    (!widths.is_empty()).then(|| *widths.select_nth_unstable_by(middle, f64::total_cmp).1)
}

fn distance(mesh: &TriMesh, v: u32, to: &[u32]) -> f64 {
    let p = mesh.vertices[v as usize];
    to.iter().map(|&w| (mesh.vertices[w as usize] - p).norm_squared()).fold(f64::INFINITY, f64::min).sqrt()
}

/// Mean length of the edges at `rim` [mm].
fn edge_length(surface: &Inked, rim: &[u32]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for &v in rim {
        for &w in &surface.neighbours[v as usize] {
            sum += (surface.mesh.vertices[v as usize] - surface.mesh.vertices[w as usize]).norm();
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

/// The surface where `depth`, linear over each triangle, is below `level`.
fn clipped(surface: &Inked, normals: &[Vector], depth: &BTreeMap<u32, f64>, level: f64) -> Vec<Piece> {
    let mesh = surface.mesh;
    let near: Vec<u32> = depth.iter().filter(|(_, d)| **d < level + NORMAL_RADIUS).map(|(&v, _)| v).collect();
    let mut pieces = Vec::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let depths = triangle.map(|v| depth.get(&v).copied().unwrap_or(f64::INFINITY));
        if depths.iter().all(|&d| d >= level) || depths.iter().any(|d| d.is_infinite()) {
            continue;
        }
        let corners = mesh.corners(t);
        let mut polygon: Vec<Point> = Vec::with_capacity(4);
        for k in 0..3 {
            let (p, q) = (corners[k], corners[(k + 1) % 3]);
            let (d, e) = (depths[k], depths[(k + 1) % 3]);
            if d < level {
                polygon.push(p);
            }
            if (d < level) != (e < level) {
                polygon.push(p + (q - p) * ((level - d) / (e - d)));
            }
        }
        let middle = Point::from(polygon.iter().map(|p| p.coords).sum::<Vector>() / polygon.len() as f64);
        let normal = smooth_normal(mesh, normals, &near, &middle);
        pieces.extend(parted(&polygon).into_iter().map(|corners| Piece { corners, normal }));
    }
    pieces
}

/// The triangles of a polygon of three or four corners: four are parted along the shorter diagonal. So they are the same wherever it begins and
/// whichever way it goes round: the mirror image of a scan has the mirrored region.
fn parted(polygon: &[Point]) -> Vec<[Point; 3]> {
    match *polygon {
        [a, b, c, d] if (d - b).norm_squared() < (c - a).norm_squared() => vec![[a, b, d], [b, c, d]],
        _ => polygon.windows(2).skip(1).map(|pair| [polygon[0], pair[0], pair[1]]).collect(),
    }
}

fn smooth_normal(mesh: &TriMesh, normals: &[Vector], near: &[u32], p: &Point) -> Vector {
    let sum = near
        .iter()
        .filter(|&&v| (mesh.vertices[v as usize] - p).norm_squared() < NORMAL_RADIUS * NORMAL_RADIUS)
        .fold(Vector::zeros(), |s, &v| s + normals[v as usize]);
    sum.try_normalize(0.0).unwrap_or_else(Vector::zeros)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_is_parted_alike_wherever_it_begins_and_whichever_way_it_goes() {
        let corners = [[0.0, 0.0], [3.0, 0.2], [2.5, 1.0], [-0.5, 1.3]].map(|[x, y]| Point::new(x, y, 0.0));
        let middles = |polygon: &[Point]| {
            let mut all: Vec<[f64; 2]> =
                parted(polygon).iter().map(|c| [0, 1].map(|k| c.iter().map(|p| p[k]).sum::<f64>() / 3.0)).collect();
            all.sort_by(|a, b| a[0].total_cmp(&b[0]));
            all
        };
        let first = middles(&corners);
        assert_eq!(first.len(), 2);
        for start in 0..4 {
            let mut turned = corners;
            turned.rotate_left(start);
            for _ in 0..2 {
                let same = middles(&turned);
                let off = first.iter().zip(&same).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max);
                assert!(off < 1e-12, "{start}: {off}");
                turned.reverse();
            }
        }
        assert_eq!(parted(&corners[..3]), vec![[corners[0], corners[1], corners[2]]]);
    }
}

//! The bone inside a line of ink: parts that a closed line fences off, and parts that a broken line nearly does.

use super::MarkOptions;
use meshes::min_cut::{WeightedEdge, min_cut};
use meshes::surface::TriMesh;
use meshes::{Point, Vector};
use std::collections::{BTreeMap, VecDeque};

/// A scan with its ink.
pub struct Inked<'a> {
    /// The scan's surface.
    pub mesh: &'a TriMesh,
    /// Neighbours of each vertex along edges.
    pub neighbours: &'a [Vec<u32>],
    /// Whether each vertex carries ink.
    pub ink: &'a [bool],
}

/// Vertices without ink inside an outline.
#[derive(Clone, Debug, PartialEq)]
pub struct Interior {
    /// The vertices, ascending.
    pub vertices: Vec<u32>,
    /// Share of the outline that is missing, by angle seen from its middle [-].
    pub gap_fraction: f64,
}

impl Inked<'_> {
    fn point(&self, v: u32) -> Point {
        self.mesh.vertices[v as usize]
    }

    /// The vertices that hang together with `seed` among those for which `open` holds, in order of discovery.
    pub(super) fn flood(&self, seed: u32, seen: &mut [bool], open: impl Fn(u32) -> bool) -> Vec<u32> {
        seen[seed as usize] = true;
        let mut found = vec![seed];
        let mut next = 0;
        while let Some(&v) = found.get(next) {
            next += 1;
            for &w in &self.neighbours[v as usize] {
                if open(w) && !std::mem::replace(&mut seen[w as usize], true) {
                    found.push(w);
                }
            }
        }
        found
    }

    /// The connected part of the surface around `centre`, started at `seeds`, within `radius` [mm].
    pub(super) fn patch(&self, seeds: &[u32], centre: &Point, radius: f64) -> Vec<u32> {
        let mut seen: BTreeMap<u32, ()> = BTreeMap::new();
        let mut queue: VecDeque<u32> = seeds.iter().copied().collect();
        seen.extend(seeds.iter().map(|&v| (v, ())));
        while let Some(v) = queue.pop_front() {
            for &w in &self.neighbours[v as usize] {
                if !seen.contains_key(&w) && (self.point(w) - centre).norm() < radius {
                    seen.insert(w, ());
                    queue.push_back(w);
                }
            }
        }
        seen.into_keys().collect()
    }
}

/// Parts of the bone that ink alone, or ink and a short stretch of the scan's border, cuts off from the rest.
pub fn closed(surface: &Inked, options: &MarkOptions) -> Vec<Interior> {
    let areas = surface.mesh.vertex_areas();
    let border = border_vertices(surface.mesh);
    let mut seen = surface.ink.to_vec();
    let mut interiors = Vec::new();
    for seed in 0..surface.ink.len() as u32 {
        if seen[seed as usize] {
            continue;
        }
        let mut part = surface.flood(seed, &mut seen, |v| !surface.ink[v as usize]);
        let area: f64 = part.iter().map(|&v| areas[v as usize]).sum();
        if area > options.area_max_mm2 {
            continue;
        }
        let fenced = part.iter().filter(|&&v| meets_ink(surface, v)).count();
        let open = part.iter().filter(|&&v| border[v as usize] && !meets_ink(surface, v)).count();
        let gap_fraction = open as f64 / (open + fenced).max(1) as f64;
        if fenced > 0 && gap_fraction <= options.gap_fraction_max {
            part.sort_unstable();
            interiors.push(Interior { vertices: part, gap_fraction });
        }
    }
    interiors
}

fn meets_ink(surface: &Inked, v: u32) -> bool {
    surface.neighbours[v as usize].iter().any(|&w| surface.ink[w as usize])
}

fn border_vertices(mesh: &TriMesh) -> Vec<bool> {
    let mut sides: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for &[a, b, c] in &mesh.triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *sides.entry((p.min(q), p.max(q))).or_default() += 1;
        }
    }
    let mut border = vec![false; mesh.vertices.len()];
    for (&(p, q), _) in sides.iter().filter(|(_, n)| **n == 1) {
        border[p as usize] = true;
        border[q as usize] = true;
    }
    border
}

/// Spacing of the points that stand for a fragment of ink [mm].
const FRAGMENT_SPACING: f64 = 1.0;
/// A cluster of ink wider than this is no outline of a ligament [mm], nor one narrower than the second.
const CLUSTER_WIDTH: [f64; 2] = [70.0, 3.0];
/// More clusters than this are noise, not drawing.
const CLUSTERS: usize = 300;

/// Parts of the bone around which ink goes most of the way.
///
/// Fragments of ink are gathered to clusters at several distances; around the middle of each the cheapest closed curve is sought that
/// runs in ink where it can ([`close_around`]).
pub fn broken(surface: &Inked, options: &MarkOptions) -> Vec<Interior> {
    let mut interiors = Vec::new();
    for cluster in clusters(surface, options.fragment_distance_mm) {
        let mut best: Option<Interior> = None;
        let mut middle = mean(&cluster);
        for _ in 0..3 {
            let Some(interior) = close_around(surface, &middle, &cluster) else { break };
            middle = mean(&interior.vertices.iter().map(|&v| surface.point(v)).collect::<Vec<_>>());
            if best.as_ref().is_none_or(|b| interior.gap_fraction < b.gap_fraction) {
                best = Some(interior);
            }
        }
        interiors.extend(best.filter(|b| b.gap_fraction <= options.gap_fraction_max));
    }
    interiors.sort_by(|a, b| a.gap_fraction.total_cmp(&b.gap_fraction));
    interiors
}

fn mean(points: &[Point]) -> Point {
    let sum = points.iter().fold(Vector::zeros(), |s, p| s + p.coords);
    Point::from(sum / points.len().max(1) as f64)
}

/// Points of the ink, gathered: each fragment by itself, then joined at half and at the whole `distance`.
fn clusters(surface: &Inked, distance: f64) -> Vec<Vec<Point>> {
    let mut seen: Vec<bool> = surface.ink.iter().map(|i| !i).collect();
    let mut fragments: Vec<Vec<Point>> = Vec::new();
    for seed in 0..seen.len() as u32 {
        if !seen[seed as usize] {
            let mut part = surface.flood(seed, &mut seen, |v| surface.ink[v as usize]);
            part.sort_unstable();
            fragments.push(thinned(part.iter().map(|&v| surface.point(v))));
        }
    }
    let mut all = fragments.clone();
    for reach in [distance / 2.0, distance] {
        all.extend(joined(&fragments, reach));
    }
    all.retain(|c| width(c) < CLUSTER_WIDTH[0] && width(c) > CLUSTER_WIDTH[1]);
    all.dedup();
    all.sort_by_key(|c| std::cmp::Reverse(c.len()));
    all.truncate(CLUSTERS);
    all
}

fn thinned(points: impl Iterator<Item = Point>) -> Vec<Point> {
    let mut kept: Vec<Point> = Vec::new();
    for p in points {
        if kept.iter().all(|k| (k - p).norm() >= FRAGMENT_SPACING) {
            kept.push(p);
        }
    }
    kept
}

fn width(points: &[Point]) -> f64 {
    let middle = mean(points);
    2.0 * points.iter().map(|p| (p - middle).norm()).fold(0.0, f64::max)
}

fn joined(fragments: &[Vec<Point>], reach: f64) -> Vec<Vec<Point>> {
    let mut group: Vec<usize> = (0..fragments.len()).collect();
    for i in 0..fragments.len() {
        for j in 0..i {
            let near = |p: &Point| fragments[j].iter().any(|q| (p - q).norm() < reach);
            if group[i] != group[j] && fragments[i].iter().any(near) {
                let (low, high) = (group[i].min(group[j]), group[i].max(group[j]));
                group.iter_mut().filter(|g| **g == high).for_each(|g| *g = low);
            }
        }
    }
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    group.iter().enumerate().for_each(|(i, &g)| members.entry(g).or_default().push(i));
    members
        .into_values()
        .filter(|m| m.len() > 1)
        .map(|m| m.iter().flat_map(|&i| fragments[i].clone()).collect())
        .collect()
}

/// Cost of a millimetre in ink, beside ink and on bare bone, per millimetre of distance from the middle.
const COST: [f64; 3] = [0.05, 0.1, 1.0];
/// How much dearer bare bone becomes with its distance from the line's course, per share of the radius [-]; our own choice.
const PULL: f64 = 5.0;
/// Radius that certainly lies inside the outline [mm], and how far past the ink the outline may run [mm].
const CORE: f64 = 1.2;
const BEYOND: f64 = 8.0;

/// The cheapest closed curve on the surface around `middle`, where ink is nearly free and bare bone costs by the angle it spans.
///
/// Method: a minimum cut between the middle and everything beyond the ink, edges weighted by length over distance from the middle, so
/// that small circles are no cheaper than large ones [appleton2006]; theirs is a continuous flow in the plane, ours is Dinic's on the scan's edges. Ours too:
/// bare bone costs more away from the course that the ink suggests ([`Course`]), or a gap at a tight bend would be cut short.
fn close_around(surface: &Inked, middle: &Point, cluster: &[Point]) -> Option<Interior> {
    let seed = nearest_vertex(surface, middle)?;
    if surface.ink[seed as usize] {
        return None;
    }
    let centre = surface.point(seed);
    let reach = BEYOND + cluster.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max);
    let patch = surface.patch(&[seed], &centre, reach);
    let local: BTreeMap<u32, u32> = patch.iter().enumerate().map(|(i, &v)| (v, i as u32)).collect();
    let core = |v: u32| v == seed || (!surface.ink[v as usize] && (surface.point(v) - centre).norm() < CORE);
    let source: Vec<u32> = patch.iter().filter(|&&v| core(v)).map(|v| local[v]).collect();
    let outer = |v: u32| surface.neighbours[v as usize].iter().any(|w| !local.contains_key(w));
    let sink: Vec<u32> = patch.iter().filter(|&&v| outer(v)).map(|v| local[v]).collect();
    if sink.is_empty() {
        return None;
    }
    let course = Course::of(cluster, &centre);
    let mut edges: Vec<WeightedEdge> = Vec::new();
    let mut spans: Vec<(u32, u32, f64, bool)> = Vec::new();
    for &a in &patch {
        for &b in surface.neighbours[a as usize].iter().filter(|&&b| b > a && local.contains_key(&b)) {
            let between = nalgebra::center(&surface.point(a), &surface.point(b));
            let angle = (surface.point(a) - surface.point(b)).norm() / (0.5 + (between - centre).norm());
            let inked = surface.ink[a as usize] || surface.ink[b as usize];
            let beside = meets_ink(surface, a) || meets_ink(surface, b);
            let cost = if inked {
                COST[0]
            } else if beside {
                COST[1]
            } else {
                COST[2] * (1.0 + PULL * course.off(&between))
            };
            edges.push((local[&a], local[&b], (1e6 * cost * angle) as u64 + 1));
            spans.push((local[&a], local[&b], angle, beside || inked));
        }
    }
    let inside = min_cut(patch.len(), &edges, &source, &sink);
    let cut = spans.iter().filter(|s| inside[s.0 as usize] != inside[s.1 as usize]);
    let (bare, whole) = cut.fold((0.0, 0.0), |(b, w), s| (if s.3 { b } else { b + s.2 }, w + s.2));
    let vertices = patch.iter().copied().filter(|v| inside[local[v] as usize] && !surface.ink[*v as usize]).collect();
    (whole > 0.0).then_some(Interior { vertices, gap_fraction: bare / whole })
}

/// The course of a broken line around its middle: log of the radius by angle, a Fourier series of low order through the ink.
struct Course {
    centre: Point,
    axes: [Vector; 2],
    series: [f64; 5],
}

impl Course {
    fn of(ink: &[Point], centre: &Point) -> Course {
        let middle = mean(ink);
        let spread: nalgebra::Matrix3<f64> = ink.iter().map(|p| (p - middle) * (p - middle).transpose()).sum();
        let eigen = spread.symmetric_eigen();
        let flat = eigen.eigenvalues.imin();
        let axis = |k: usize| eigen.eigenvectors.column((flat + k) % 3).into_owned();
        let mut course = Course { centre: *centre, axes: [axis(1), axis(2)], series: [0.0; 5] };
        let mut normal = nalgebra::Matrix5::from_diagonal(&nalgebra::Vector5::new(1e-6, 1.0, 1.0, 4.0, 4.0));
        let mut right = nalgebra::Vector5::zeros();
        for p in ink {
            let (row, log) = course.row(p);
            normal += row * row.transpose();
            right += row * log;
        }
        if let Some(found) = normal.cholesky() {
            course.series = found.solve(&right).into();
        }
        course
    }

    fn row(&self, p: &Point) -> (nalgebra::Vector5<f64>, f64) {
        let [x, y] = self.axes.map(|a| a.dot(&(p - self.centre)));
        let angle = y.atan2(x);
        let row = nalgebra::Vector5::new(1.0, angle.cos(), angle.sin(), (2.0 * angle).cos(), (2.0 * angle).sin());
        (row, x.hypot(y).max(0.3).ln())
    }

    /// How far a point lies from the course, as a share of the radius.
    fn off(&self, p: &Point) -> f64 {
        let (row, log) = self.row(p);
        (log - row.dot(&nalgebra::Vector5::from(self.series))).abs()
    }
}

fn nearest_vertex(surface: &Inked, p: &Point) -> Option<u32> {
    let used = (0..surface.mesh.vertices.len() as u32).filter(|&v| !surface.neighbours[v as usize].is_empty());
    used.min_by(|&a, &b| (surface.point(a) - p).norm_squared().total_cmp(&(surface.point(b) - p).norm_squared()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_course_of_a_broken_ellipse_bridges_its_gap_where_a_chord_cuts_it_short() {
        // 6 by 4.5 mm, a gap of 60 degrees about one tip, tilted in space and seen from a little off its middle
        let tilt = nalgebra::Rotation3::new(Vector::new(0.4, -0.7, 0.2));
        let at = |degrees: f64| {
            let a = degrees.to_radians();
            Point::from(tilt * Vector::new(6.0 * a.cos(), 4.5 * a.sin(), 0.0))
        };
        let ink: Vec<Point> = (30..330).map(|d| at(f64::from(d))).collect();
        let course = Course::of(&ink, &at(90.0).map(|x| 0.1 * x));
        let chord = nalgebra::center(&at(30.0), &at(-30.0));
        let worst = [-20.0, -10.0, 0.0, 10.0, 20.0].map(|d| course.off(&at(d))).into_iter().fold(0.0, f64::max);
        assert!(worst < 0.05 && course.off(&chord) > 2.0 * worst, "{worst} {}", course.off(&chord));
        // no ink on which a series stands: it pulls to nothing far away
        assert!(Course::of(&ink[..1], &Point::origin()).off(&ink[0]) < 0.2);
    }
}

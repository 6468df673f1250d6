//! Plane sections of a surface.

use crate::surface::TriMesh;
use crate::{Point, Vector};
use std::collections::BTreeMap;

/// One connected piece of a plane section.
#[derive(Clone, Debug)]
pub struct Outline {
    /// Enclosed area [mm2]: positive for the outside of a body, negative for a cavity.
    pub area: f64,
    /// Centroid of the enclosed area [mm]; of the points where no area is enclosed.
    pub centroid: Point,
    /// Starting point of each segment, in no particular order [mm].
    pub points: Vec<Point>,
    /// Length [mm].
    pub length: f64,
    /// Distance between loose ends [mm]; 0 where the outline closes.
    pub gap: f64,
    /// Triangle of each segment.
    pub triangles: Vec<u32>,
}

/// Cuts `mesh` with the plane through `origin` with unit `normal`: connected pieces, largest area first.
///
/// Area and centroid are sums over directed segments (Green's theorem), so that an open or ill-joined outline still has
/// a sensible one; the segments follow the triangles' orientation. Cost O(n log n).
pub fn section(mesh: &TriMesh, origin: &Point, normal: &Vector) -> Vec<Outline> {
    let height: Vec<f64> = mesh.vertices.iter().map(|p| (p - origin).dot(normal)).collect();
    let mut segments: Vec<Segment> = Vec::new();
    for (t, &triangle) in mesh.triangles.iter().enumerate() {
        segments.extend(crossing(mesh, &height, t as u32, triangle));
    }
    let mut outlines: Vec<Outline> = grouped(&segments)
        .into_iter()
        .map(|group| outline(group.into_iter().map(|s| &segments[s]), origin, normal))
        .collect();
    outlines.sort_by(|a, b| b.area.total_cmp(&a.area));
    outlines
}

struct Segment {
    from: ((u32, u32), Point),
    to: ((u32, u32), Point),
    triangle: u32,
}

/// Where the plane crosses a triangle: from the edge that leads down through it to the edge that leads up.
fn crossing(mesh: &TriMesh, height: &[f64], t: u32, triangle: [u32; 3]) -> Option<Segment> {
    let at = |a: u32, b: u32| {
        let (a, b) = (a.min(b), a.max(b));
        let (ha, hb) = (height[a as usize], height[b as usize]);
        let (pa, pb) = (mesh.vertices[a as usize], mesh.vertices[b as usize]);
        ((a, b), pa + (pb - pa) * (ha / (ha - hb)))
    };
    let (mut from, mut to) = (None, None);
    for i in 0..3 {
        let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
        match (height[a as usize] >= 0.0, height[b as usize] >= 0.0) {
            (true, false) => from = Some(at(a, b)),
            (false, true) => to = Some(at(a, b)),
            _ => {}
        }
    }
    Some(Segment { from: from?, to: to?, triangle: t })
}

/// Segments that hang together, each group in order.
fn grouped(segments: &[Segment]) -> Vec<Vec<usize>> {
    let mut parent: Vec<usize> = (0..segments.len()).collect();
    fn root(parent: &mut [usize], mut v: usize) -> usize {
        while parent[v] != v {
            parent[v] = parent[parent[v]];
            v = parent[v];
        }
        v
    }
    let mut seen: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for (s, segment) in segments.iter().enumerate() {
        for edge in [segment.from.0, segment.to.0] {
            let other = *seen.entry(edge).or_insert(s);
            let (a, b) = (root(&mut parent, s), root(&mut parent, other));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for s in 0..segments.len() {
        groups.entry(root(&mut parent, s)).or_default().push(s);
    }
    groups.into_values().collect()
}

fn outline<'a>(segments: impl Iterator<Item = &'a Segment> + Clone, origin: &Point, normal: &Vector) -> Outline {
    let points: Vec<Point> = segments.clone().map(|s| s.from.1).collect();
    let mean = points.iter().fold(Vector::zeros(), |sum, p| sum + (p - origin)) / points.len().max(1) as f64;
    let centre = origin + mean;
    let (mut area, mut moment, mut length, mut gap) = (0.0, Vector::zeros(), 0.0, Vector::zeros());
    for s in segments.clone() {
        let (a, b) = (s.from.1 - centre, s.to.1 - centre);
        let piece = a.cross(&b).dot(normal) / 2.0;
        area += piece;
        moment += (a + b) * (piece / 3.0);
        length += (b - a).norm();
        gap += b - a;
    }
    let small = area.abs() <= 1e-9 * length * length;
    let centroid = if small { centre } else { centre + moment / area };
    Outline { area, centroid, length, gap: gap.norm(), triangles: segments.map(|s| s.triangle).collect(), points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cuboid, icosphere};

    #[test]
    fn a_sphere_is_cut_in_a_circle() {
        let sphere = icosphere(10.0, 4);
        let normal = Vector::new(0.3, -0.5, 0.8).normalize();
        let cut = section(&sphere, &(Point::origin() + normal * 6.0), &normal);
        assert_eq!(cut.len(), 1);
        assert!((cut[0].area / (64.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
        assert!((cut[0].centroid - (Point::origin() + normal * 6.0)).norm() < 0.05);
        assert!(cut[0].gap < 1e-9);
    }

    #[test]
    fn a_cavity_counts_negative_and_a_missing_side_opens_the_outline() {
        let cube = cuboid([4.0, 4.0, 4.0]);
        let hole = cuboid([1.0, 1.0, 1.0]).flipped();
        let hole = hole.moved(&crate::Isometry::translation(1.0, 1.0, 1.0));
        let cut = section(&TriMesh::joined([&cube, &hole]), &Point::new(0.0, 0.0, 1.5), &Vector::z());
        assert_eq!(cut.len(), 2);
        assert!((cut[0].area - 16.0).abs() < 1e-9 && (cut[1].area + 1.0).abs() < 1e-9);
        let (open, _) = cube.submesh(|t| cube.triangle_normals()[t].x < 0.5);
        assert!(section(&open, &Point::new(0.0, 0.0, 1.5), &Vector::z())[0].gap > 3.9);
    }
}

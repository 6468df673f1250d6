//! Triangle surfaces as plain values.

use crate::{Isometry, Point, Vector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An indexed triangle surface: vertices [mm], triangles counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriMesh {
    /// Vertex positions, n x 3 [mm].
    pub vertices: Vec<Point>,
    /// Vertex indices of each triangle, m x 3.
    pub triangles: Vec<[u32; 3]>,
}

/// A surface scan: a surface with, where the scanner gave them, colours.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColouredMesh {
    /// The surface.
    pub mesh: TriMesh,
    /// Red, green, blue per vertex; empty where the file has none.
    pub colours: Vec<[u8; 3]>,
}

impl ColouredMesh {
    /// The scan with vertices of equal position (to the last bit) made one, in order of first appearance; their colour is
    /// the mean. Triangles stay, also those that lose a corner by it.
    pub fn welded(&self) -> ColouredMesh {
        let mut index: BTreeMap<[u64; 3], u32> = BTreeMap::new();
        let mut welded = ColouredMesh::default();
        let mut sums: Vec<([u32; 3], u32)> = Vec::new();
        let mut new_index = Vec::with_capacity(self.mesh.vertices.len());
        for (v, p) in self.mesh.vertices.iter().enumerate() {
            // Adding zero makes -0 and 0 one.
            let key = [p.x, p.y, p.z].map(|x| (x + 0.0).to_bits());
            let new = *index.entry(key).or_insert_with(|| {
                welded.mesh.vertices.push(*p);
                sums.push(([0; 3], 0));
                (sums.len() - 1) as u32
            });
            new_index.push(new);
            if let Some(colour) = self.colours.get(v) {
                let (sum, count) = &mut sums[new as usize];
                (0..3).for_each(|k| sum[k] += u32::from(colour[k]));
                *count += 1;
            }
        }
        welded.mesh.triangles = self.mesh.triangles.iter().map(|t| t.map(|v| new_index[v as usize])).collect();
        if !self.colours.is_empty() {
            welded.colours = sums.iter().map(|(s, n)| s.map(|x| ((x + n / 2) / (*n).max(1)) as u8)).collect();
        }
        welded
    }
}

impl TriMesh {
    /// The three corners of triangle `t` [mm].
    pub fn corners(&self, t: usize) -> [Point; 3] {
        self.triangles[t].map(|v| self.vertices[v as usize])
    }

    /// Normal of triangle `t` times twice its area [mm2].
    pub fn area_vector(&self, t: usize) -> Vector {
        let [a, b, c] = self.corners(t);
        (b - a).cross(&(c - a))
    }

    /// Unit normal of each triangle; zero for a degenerate one.
    pub fn triangle_normals(&self) -> Vec<Vector> {
        (0..self.triangles.len())
            .map(|t| self.area_vector(t).try_normalize(0.0).unwrap_or_else(Vector::zeros))
            .collect()
    }

    /// Area-weighted unit normal of each vertex; zero for an unused one.
    pub fn vertex_normals(&self) -> Vec<Vector> {
        let mut normals = vec![Vector::zeros(); self.vertices.len()];
        for (t, triangle) in self.triangles.iter().enumerate() {
            let n = self.area_vector(t);
            for &v in triangle {
                normals[v as usize] += n;
            }
        }
        for n in &mut normals {
            *n = n.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        }
        normals
    }

    /// A third of the area of the triangles around each vertex [mm2].
    pub fn vertex_areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.vertices.len()];
        for (t, triangle) in self.triangles.iter().enumerate() {
            let a = self.area_vector(t).norm() / 6.0;
            for &v in triangle {
                areas[v as usize] += a;
            }
        }
        areas
    }

    /// Surface area [mm2].
    pub fn area(&self) -> f64 {
        (0..self.triangles.len()).map(|t| self.area_vector(t).norm() / 2.0).sum()
    }

    /// Enclosed volume [mm3]; positive when closed with outward normals.
    pub fn volume(&self) -> f64 {
        let Some(&origin) = self.vertices.first() else {
            return 0.0;
        };
        (0..self.triangles.len())
            .map(|t| {
                let [a, b, c] = self.corners(t).map(|p| p - origin);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum()
    }

    /// Area-weighted centroid of the surface [mm]; `None` without area.
    pub fn centroid(&self) -> Option<Point> {
        let mut sum = Vector::zeros();
        let mut area = 0.0;
        for t in 0..self.triangles.len() {
            let a = self.area_vector(t).norm();
            let [p, q, r] = self.corners(t);
            sum += a * (p.coords + q.coords + r.coords) / 3.0;
            area += a;
        }
        (area > 0.0).then(|| Point::from(sum / area))
    }

    /// Smallest and largest coordinates [mm]; `None` when empty.
    pub fn bounds(&self) -> Option<(Point, Point)> {
        let first = *self.vertices.first()?;
        Some(
            self.vertices
                .iter()
                .fold((first, first), |(lo, hi), p| (lo.coords.inf(&p.coords).into(), hi.coords.sup(&p.coords).into())),
        )
    }

    /// The surface moved by `pose`.
    pub fn moved(&self, pose: &Isometry) -> TriMesh {
        TriMesh { vertices: self.vertices.iter().map(|p| pose * p).collect(), triangles: self.triangles.clone() }
    }

    /// The surface with every triangle turned over.
    pub fn flipped(mut self) -> TriMesh {
        for t in &mut self.triangles {
            t.swap(1, 2);
        }
        self
    }

    /// The part made of the triangles for which `keep` holds, unused vertices dropped,
    /// and the old index of each kept vertex.
    pub fn submesh(&self, keep: impl Fn(usize) -> bool) -> (TriMesh, Vec<u32>) {
        let mut new_index = vec![u32::MAX; self.vertices.len()];
        let mut old_index = Vec::new();
        let mut part = TriMesh::default();
        for (t, triangle) in self.triangles.iter().enumerate() {
            if !keep(t) {
                continue;
            }
            part.triangles.push(triangle.map(|v| {
                let slot = &mut new_index[v as usize];
                if *slot == u32::MAX {
                    *slot = old_index.len() as u32;
                    old_index.push(v);
                    part.vertices.push(self.vertices[v as usize]);
                }
                *slot
            }));
        }
        (part, old_index)
    }

    /// One surface from several, side by side.
    pub fn joined<'a>(parts: impl IntoIterator<Item = &'a TriMesh>) -> TriMesh {
        let mut whole = TriMesh::default();
        for part in parts {
            let offset = whole.vertices.len() as u32;
            whole.vertices.extend_from_slice(&part.vertices);
            whole.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + offset)));
        }
        whole
    }
}

#[cfg(test)]
mod tests {
    use crate::shapes;

    #[test]
    fn sphere_measures_approach_the_analytic_ones() {
        let sphere = shapes::icosphere(10.0, 4);
        let volume = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
        assert!((sphere.volume() / volume - 1.0).abs() < 3e-3);
        assert!((sphere.area() / (400.0 * std::f64::consts::PI) - 1.0).abs() < 3e-3);
        assert!(sphere.flipped().volume() < 0.0);
    }
}

//! Half-edges of a closed surface, for local changes: split, collapse, flip.
//!
//! Half-edge `h` belongs to triangle `h / 3` and leads from its own corner to the next corner of that triangle.

use crate::Point;
use crate::surface::TriMesh;

/// A closed two-manifold triangle surface under change. Removed triangles and vertices stay as holes in the lists
/// until [`HalfEdges::compacted`].
pub(crate) struct HalfEdges {
    pub(crate) points: Vec<Point>,
    /// Start vertex of each half-edge.
    pub(crate) start: Vec<u32>,
    /// The half-edge of the neighbouring triangle along the same edge.
    pub(crate) twin: Vec<u32>,
    /// Whether each triangle is removed.
    pub(crate) dead: Vec<bool>,
    /// A label of each triangle; edges between labels are features.
    pub(crate) label: Vec<u32>,
    /// A half-edge that starts at each vertex; `u32::MAX` for a removed one.
    pub(crate) leaving: Vec<u32>,
}

/// The next half-edge of the same triangle.
pub(crate) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The previous half-edge of the same triangle.
pub(crate) fn prev(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl HalfEdges {
    /// Builds the structure; `None` when the surface is not closed and two-manifold at every edge and vertex.
    pub(crate) fn new(mesh: &TriMesh, labels: &[u32]) -> Option<HalfEdges> {
        let start: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        let count = start.len() as u32;
        if start.iter().any(|&v| v as usize >= mesh.vertices.len()) {
            return None;
        }
        let end = |h: u32| start[next(h) as usize];
        let mut by_edge: Vec<(u32, u32, u32)> = (0..count)
            .map(|h| {
                let (a, b) = (start[h as usize], end(h));
                (a.min(b), a.max(b), h)
            })
            .collect();
        by_edge.sort_unstable();
        let mut twin = vec![u32::MAX; start.len()];
        for pair in by_edge.chunks(2) {
            let &[(a, b, h), (c, d, g)] = pair else { return None };
            if (a, b) != (c, d) || a == b || start[h as usize] == start[g as usize] {
                return None;
            }
            (twin[h as usize], twin[g as usize]) = (g, h);
        }
        if by_edge.windows(3).any(|w| (w[0].0, w[0].1) == (w[2].0, w[2].1)) {
            return None;
        }
        let mut leaving = vec![u32::MAX; mesh.vertices.len()];
        let mut valence = vec![0u32; mesh.vertices.len()];
        for h in 0..count {
            leaving[start[h as usize] as usize] = h;
            valence[start[h as usize] as usize] += 1;
        }
        let triangles = mesh.triangles.len();
        let label = if labels.len() == triangles { labels.to_vec() } else { vec![0; triangles] };
        let edges =
            HalfEdges { points: mesh.vertices.clone(), start, twin, dead: vec![false; triangles], label, leaving };
        let one_fan = (0..edges.points.len() as u32)
            .all(|v| edges.leaving[v as usize] == u32::MAX || edges.around(v).count() as u32 == valence[v as usize]);
        one_fan.then_some(edges)
    }

    /// The end vertex of a half-edge.
    pub(crate) fn end(&self, h: u32) -> u32 {
        self.start[next(h) as usize]
    }

    /// Half-edges that start at `v`, in turn about it.
    pub(crate) fn around(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let first = self.leaving[v as usize];
        let mut at = Some(first).filter(|&h| h != u32::MAX);
        std::iter::from_fn(move || {
            let h = at?;
            let following = self.twin[prev(h) as usize];
            at = (following != first).then_some(following);
            Some(h)
        })
    }

    /// Length of a half-edge [mm].
    pub(crate) fn length(&self, h: u32) -> f64 {
        (self.points[self.start[h as usize] as usize] - self.points[self.end(h) as usize]).norm()
    }

    /// Whether the triangles on both sides bear different labels.
    pub(crate) fn is_feature(&self, h: u32) -> bool {
        self.label[h as usize / 3] != self.label[self.twin[h as usize] as usize / 3]
    }

    /// Number of feature edges at `v`.
    pub(crate) fn feature_valence(&self, v: u32) -> usize {
        self.around(v).filter(|&h| self.is_feature(h)).count()
    }

    /// Whether an edge joins `a` and `b`.
    pub(crate) fn joined(&self, a: u32, b: u32) -> bool {
        self.around(a).any(|h| self.end(h) == b)
    }

    fn link(&mut self, h: u32, g: u32) {
        self.twin[h as usize] = g;
        self.twin[g as usize] = h;
    }

    /// Puts a vertex at `p` on the edge of `h`; both its triangles become two.
    pub(crate) fn split(&mut self, h: u32, p: Point) -> u32 {
        let g = self.twin[h as usize];
        let (hn, gn) = (next(h), next(g));
        let (b, c) = (self.start[hn as usize], self.end(hn));
        let (a, d) = (self.start[gn as usize], self.end(gn));
        let m = self.points.len() as u32;
        self.points.push(p);
        // triangles (a, b, c) and (b, a, d) keep the halves at their first vertex: (a, m, c) and (b, m, d)
        let (far_h, far_g) = (self.twin[hn as usize], self.twin[gn as usize]);
        self.start[hn as usize] = m;
        self.start[gn as usize] = m;
        let (t, u) = (self.start.len() as u32, self.start.len() as u32 + 3);
        self.start.extend([m, b, c, m, a, d]);
        self.twin.extend([u32::MAX; 6]);
        self.dead.extend([false; 2]);
        self.label.extend([self.label[h as usize / 3], self.label[g as usize / 3]]);
        self.link(t, g); // m-b with b-m
        self.link(u, h); // m-a with a-m
        self.link(t + 1, far_h); // b-c
        self.link(u + 1, far_g); // a-d
        self.link(t + 2, hn); // c-m with m-c
        self.link(u + 2, gn); // d-m with m-d
        self.leaving.push(t);
        self.leaving[a as usize] = h;
        self.leaving[b as usize] = g;
        m
    }

    /// Turns the edge of `h` within its two triangles; the caller has checked that the new edge does not exist.
    pub(crate) fn flip(&mut self, h: u32) {
        let g = self.twin[h as usize];
        let (hn, hp, gn, gp) = (next(h), prev(h), next(g), prev(g));
        let (a, b) = (self.start[h as usize], self.start[g as usize]);
        let (c, d) = (self.start[hp as usize], self.start[gp as usize]);
        let (bc, ca) = (self.twin[hn as usize], self.twin[hp as usize]);
        let (ad, db) = (self.twin[gn as usize], self.twin[gp as usize]);
        // (a, b, c), (b, a, d) become (d, c, a) on h's triangle and (c, d, b) on g's
        self.start[h as usize] = d;
        self.start[hn as usize] = c;
        self.start[hp as usize] = a;
        self.start[g as usize] = c;
        self.start[gn as usize] = d;
        self.start[gp as usize] = b;
        self.link(hn, ca);
        self.link(hp, ad);
        self.link(gn, db);
        self.link(gp, bc);
        self.leaving[a as usize] = hp;
        self.leaving[b as usize] = gp;
        self.leaving[c as usize] = g;
        self.leaving[d as usize] = h;
    }

    /// Removes the start of `h` by moving it into its end; the caller has checked that the surface stays a manifold.
    pub(crate) fn collapse(&mut self, h: u32) {
        let g = self.twin[h as usize];
        let (u, v) = (self.start[h as usize], self.end(h));
        let fan: Vec<u32> = self.around(u).collect();
        for e in fan {
            self.start[e as usize] = v;
        }
        let (hn, hp, gn, gp) = (next(h), prev(h), next(g), prev(g));
        let (c, d) = (self.start[hp as usize], self.start[gp as usize]);
        let (bc, ca) = (self.twin[hn as usize], self.twin[hp as usize]);
        let (ad, db) = (self.twin[gn as usize], self.twin[gp as usize]);
        self.link(bc, ca);
        self.link(ad, db);
        self.dead[h as usize / 3] = true;
        self.dead[g as usize / 3] = true;
        self.leaving[u as usize] = u32::MAX;
        self.leaving[v as usize] = ca;
        self.leaving[c as usize] = bc;
        self.leaving[d as usize] = ad;
    }

    /// The surface without holes in the lists, and the labels of its triangles.
    pub(crate) fn compacted(&self) -> (TriMesh, Vec<u32>) {
        let mut index = vec![u32::MAX; self.points.len()];
        let mut mesh = TriMesh::default();
        let mut labels = Vec::new();
        for t in (0..self.dead.len()).filter(|&t| !self.dead[t]) {
            let triangle = [0, 1, 2].map(|k| {
                let slot = &mut index[self.start[3 * t + k] as usize];
                if *slot == u32::MAX {
                    *slot = mesh.vertices.len() as u32;
                    mesh.vertices.push(self.points[self.start[3 * t + k] as usize]);
                }
                *slot
            });
            mesh.triangles.push(triangle);
            labels.push(self.label[t]);
        }
        (mesh, labels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;
    use crate::topology::Topology;

    #[test]
    fn local_changes_keep_the_surface_closed() {
        let mut edges = HalfEdges::new(&icosphere(10.0, 2), &[]).unwrap();
        let middle = nalgebra::center(&edges.points[edges.start[0] as usize], &edges.points[edges.end(0) as usize]);
        let m = edges.split(0, middle);
        assert_eq!(edges.around(m).count(), 4);
        let h = edges.around(m).next().unwrap();
        edges.flip(next(h));
        let h = edges.around(m).next().unwrap();
        edges.collapse(h);
        let (mesh, labels) = edges.compacted();
        assert!(Topology::of(&mesh).is_closed());
        assert_eq!(Topology::of(&mesh).euler_characteristic, 2);
        assert_eq!(labels.len(), mesh.triangles.len());
    }

    #[test]
    fn an_open_surface_is_refused() {
        let mut mesh = icosphere(1.0, 1);
        mesh.triangles.pop();
        assert!(HalfEdges::new(&mesh, &[]).is_none());
    }
}

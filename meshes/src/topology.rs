//! How the triangles of a surface hang together.

use crate::surface::TriMesh;
use std::collections::BTreeMap;

/// Counts that tell whether a surface is closed and consistently turned, and into which bodies it falls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Edges with one triangle only.
    pub boundary_edges: usize,
    /// Edges with more than two triangles, or two turned the same way round.
    pub irregular_edges: usize,
    /// Triangles that name a vertex twice.
    pub degenerate_triangles: usize,
    /// Component number of each triangle (joined through shared vertices), largest component first.
    pub component_of_triangle: Vec<u32>,
    /// Number of components.
    pub components: usize,
    /// V - E + F over used vertices.
    pub euler_characteristic: i64,
}

impl Topology {
    /// Examines `mesh`.
    pub fn of(mesh: &TriMesh) -> Topology {
        let mut edges: BTreeMap<(u32, u32), (u32, u32)> = BTreeMap::new();
        let mut degenerate_triangles = 0;
        for &[a, b, c] in &mesh.triangles {
            if a == b || b == c || c == a {
                degenerate_triangles += 1;
                continue;
            }
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let count = edges.entry((p.min(q), p.max(q))).or_default();
                if p < q { count.0 += 1 } else { count.1 += 1 }
            }
        }
        let boundary_edges = edges.values().filter(|(f, b)| f + b == 1).count();
        let irregular_edges = edges.values().filter(|&&(f, b)| f + b > 2 || (f + b == 2 && f != b)).count();
        let (component_of_triangle, components) = components(mesh);
        let mut used = vec![false; mesh.vertices.len()];
        mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
        let used = used.iter().filter(|u| **u).count() as i64;
        let euler_characteristic = used - edges.len() as i64 + (mesh.triangles.len() - degenerate_triangles) as i64;
        Topology {
            boundary_edges,
            irregular_edges,
            degenerate_triangles,
            component_of_triangle,
            components,
            euler_characteristic,
        }
    }

    /// Every edge has exactly two triangles turned opposite ways, and none is degenerate.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges == 0 && self.irregular_edges == 0 && self.degenerate_triangles == 0 && self.components > 0
    }
}

/// Neighbours of each vertex along edges, each list ascending.
pub fn vertex_neighbours(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); mesh.vertices.len()];
    for &[a, b, c] in &mesh.triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            neighbours[p as usize].push(q);
            neighbours[q as usize].push(p);
        }
    }
    for list in &mut neighbours {
        list.sort_unstable();
        list.dedup();
    }
    neighbours
}

fn components(mesh: &TriMesh) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for t in &mesh.triangles {
        for pair in [(t[0], t[1]), (t[1], t[2])] {
            let (p, q) = (root(&mut parent, pair.0), root(&mut parent, pair.1));
            parent[p.max(q) as usize] = p.min(q);
        }
    }
    let roots: Vec<u32> = mesh.triangles.iter().map(|t| root(&mut parent, t[0])).collect();
    let mut size: BTreeMap<u32, usize> = BTreeMap::new();
    roots.iter().for_each(|r| *size.entry(*r).or_default() += 1);
    let mut order: Vec<(u32, usize)> = size.into_iter().collect();
    order.sort_by_key(|&(r, n)| (std::cmp::Reverse(n), r));
    let rank: BTreeMap<u32, u32> = order.iter().enumerate().map(|(i, &(r, _))| (r, i as u32)).collect();
    (roots.iter().map(|r| rank[r]).collect(), order.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::{cuboid, icosphere};

    #[test]
    fn counts_follow_what_is_cut() {
        let mut mesh = cuboid([1.0, 1.0, 1.0]);
        assert_eq!(Topology::of(&mesh).euler_characteristic, 2);
        mesh.triangles.pop();
        assert_eq!(Topology::of(&mesh).boundary_edges, 3);
    }

    #[test]
    fn components_are_numbered_by_size() {
        let joined = TriMesh::joined([&cuboid([1.0, 1.0, 1.0]), &icosphere(1.0, 1)]);
        let topology = Topology::of(&joined);
        assert_eq!(topology.components, 2);
        assert_eq!(topology.component_of_triangle[0], 1);
        assert!(topology.is_closed());
    }
}

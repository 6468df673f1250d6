//! Gaps between quadrilateral contact faces, right for either diagonal of a quadrilateral.

use crate::query::SurfaceQuery;
use crate::surface::TriMesh;
use crate::{Point, Vector};
use std::collections::{BTreeMap, BTreeSet};

/// A contact face to measure gaps to: every quadrilateral split along both diagonals, so that the nearest of the two counts.
pub struct ContactFace {
    query: SurfaceQuery,
    triangles: Vec<[u32; 3]>,
    border: BTreeSet<(u32, u32)>,
    border_nodes: BTreeSet<u32>,
}

/// How far a point is from a contact face, and the way out.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Distance [mm]; negative behind the face.
    pub gap: f64,
    /// Unit direction away from the face.
    pub away: Vector,
    /// The quadrilateral that is nearest.
    pub quad: usize,
}

/// Beyond the rim, points farther than this are not over the face [mm].
const RIM_REACH: f64 = 0.3;
/// Both ways of splitting a quadrilateral.
const TRIANGLES_A_QUAD: usize = 4;

impl ContactFace {
    /// The face made of `quads` with outward normals; `None` when empty.
    pub fn new(nodes: &[Point], quads: &[[u32; 4]]) -> Option<ContactFace> {
        let triangles: Vec<[u32; 3]> =
            quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d], [a, b, d], [b, c, d]]).collect();
        let (mesh, old) = TriMesh { vertices: nodes.to_vec(), triangles }.submesh(|_| true);
        let mut uses: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut new = BTreeMap::new();
        old.iter().enumerate().for_each(|(n, o)| {
            new.insert(*o, n as u32);
        });
        for q in quads {
            for k in 0..4 {
                let (a, b) = (new[&q[k]], new[&q[(k + 1) % 4]]);
                *uses.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
        let border: BTreeSet<(u32, u32)> = uses.into_iter().filter(|u| u.1 == 1).map(|u| u.0).collect();
        let border_nodes = border.iter().flat_map(|e| [e.0, e.1]).collect();
        Some(ContactFace { query: SurfaceQuery::new(&mesh)?, triangles: mesh.triangles, border, border_nodes })
    }

    /// The gap at `p`; `None` beyond the rim.
    pub fn gap(&self, p: &Point) -> Option<Gap> {
        let near = self.query.nearest(p);
        let normal = self.query.smooth_normal(&near);
        let offset = p - near.point;
        let quad = near.triangle as usize / TRIANGLES_A_QUAD;
        if self.is_rim(near.triangle, near.barycentric) {
            if near.distance > RIM_REACH {
                return None;
            }
            // Beside the rim, only how far it is behind counts, not how far aside.
            let height = offset.dot(&normal);
            if height < 0.0 {
                return Some(Gap { gap: height, away: normal, quad });
            }
        }
        let behind = offset.dot(&normal) < 0.0;
        let away = match offset.try_normalize(1e-3) {
            Some(direction) if behind => -direction,
            Some(direction) => direction,
            None => normal,
        };
        Some(Gap { gap: if behind { -near.distance } else { near.distance }, away, quad })
    }

    fn is_rim(&self, triangle: u32, barycentric: [f64; 3]) -> bool {
        let corners = self.triangles[triangle as usize];
        let held: Vec<u32> = (0..3).filter(|&k| barycentric[k] > 1e-9).map(|k| corners[k]).collect();
        match held[..] {
            [a] => self.border_nodes.contains(&a),
            [a, b] => self.border.contains(&(a.min(b), a.max(b))),
            _ => false,
        }
    }
}

/// Points that stand for the quadrilaterals when gaps to another face are measured, each the middle of two nodes:
/// nodes (twice the same), the middles of edges, and the middles of both diagonals.
pub fn probes(quads: &[[u32; 4]]) -> Vec<(u32, u32)> {
    let mut pairs = BTreeSet::new();
    for &[a, b, c, d] in quads {
        for (p, q) in [(a, a), (b, b), (c, c), (d, d), (a, b), (b, c), (c, d), (d, a), (a, c), (b, d)] {
            pairs.insert((p.min(q), p.max(q)));
        }
    }
    pairs.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plate() -> ContactFace {
        let nodes: Vec<Point> = (0..25).map(|k| Point::new(f64::from(k % 5), f64::from(k / 5), 0.0)).collect();
        let quads: Vec<[u32; 4]> = (0..16)
            .map(|k| {
                let a = k / 4 * 5 + k % 4;
                [a, a + 1, a + 6, a + 5]
            })
            .collect();
        ContactFace::new(&nodes, &quads).unwrap()
    }

    #[test]
    fn gaps_have_their_sign_and_end_at_the_rim() {
        let plate = plate();
        let above = plate.gap(&Point::new(1.3, 2.1, 0.7)).unwrap();
        assert!((above.gap - 0.7).abs() < 1e-12 && above.away.z > 0.99);
        let below = plate.gap(&Point::new(1.3, 2.1, -3.0)).unwrap();
        assert!((below.gap + 3.0).abs() < 1e-12 && below.away.z > 0.99);
        assert!(plate.gap(&Point::new(5.0, 2.0, -3.0)).is_none());
        assert!(plate.gap(&Point::new(4.1, 2.0, -0.1)).is_some());
    }

    #[test]
    fn either_diagonal_counts() {
        let nodes =
            [(0.0, 0.0, 0.0), (1.0, 0.0, 0.2), (1.0, 1.0, 0.0), (0.0, 1.0, 0.2)].map(|(x, y, z)| Point::new(x, y, z));
        let face = ContactFace::new(&nodes, &[[0, 1, 2, 3]]).unwrap();
        assert!(face.gap(&Point::new(0.5, 0.5, 0.25)).unwrap().gap < 0.06);
    }
}

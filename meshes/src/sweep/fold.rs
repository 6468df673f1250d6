//! Quadrilaterals that have folded shut are taken out.

use super::{Columns, corner_shapes};
use crate::Point;

impl Columns {
    /// Takes out quadrilaterals whose column has a corner below the scaled Jacobian `least` and two opposite nodes, not both on the
    /// outline, within `reach` [mm] of each other: these become one node. Returns how many.
    ///
    /// No search that moves nodes opens such a fold, since every way out of it leads through worse shapes.
    pub fn collapse_folded(&mut self, least: f64, reach: f64) -> usize {
        let mut taken = 0;
        while let Some((quad, kept, gone)) = self.folded(least, reach) {
            self.quads.remove(quad);
            self.quads.iter_mut().flatten().filter(|v| **v == gone).for_each(|v| *v = kept);
            self.quads.iter_mut().flatten().filter(|v| **v > gone).for_each(|v| *v -= 1);
            self.bony.remove(gone as usize);
            self.articular.remove(gone as usize);
            self.on_outline.remove(gone as usize);
            taken += 1;
        }
        taken
    }

    /// The first quadrilateral to take out, the node that stays and the one that goes.
    fn folded(&self, least: f64, reach: f64) -> Option<(usize, u32, u32)> {
        self.quads.iter().enumerate().find_map(|(q, quad)| {
            let corners = self.corners(q as u32, (usize::MAX, 0), &self.bony[0]);
            if corner_shapes(&corners).into_iter().all(|s| s >= least) {
                return None;
            }
            (0..2).find_map(|k| {
                let [one, other, side, across] = [quad[k], quad[k + 2], quad[k + 1], quad[(k + 3) % 4]];
                let apart = |nodes: &[Point]| (nodes[one as usize] - nodes[other as usize]).norm();
                let near = apart(&self.bony) < reach && apart(&self.articular) < reach;
                let outer = |v: u32| self.on_outline[v as usize];
                let stays = [side, across].into_iter().all(|v| self.quads_at(v) > if outer(v) { 1 } else { 3 });
                let (kept, gone) = if outer(other) { (other, one) } else { (one, other) };
                (near && stays && !outer(gone)).then_some((q, kept, gone))
            })
        })
    }

    fn quads_at(&self, v: u32) -> usize {
        self.quads.iter().filter(|q| q.contains(&v)).count()
    }
}

#[cfg(test)]
mod tests {
    use crate::Point;
    use crate::sweep::Columns;

    #[test]
    fn a_folded_quadrilateral_is_closed_and_the_rest_stays_whole() {
        // 5 x 5 nodes, flat; an inner node is drawn onto the one across its quadrilateral, which lies on the outline.
        let at = |k: u32, z: f64| Point::new(f64::from(k % 5), f64::from(k / 5), z);
        let quads: Vec<[u32; 4]> = (0..16).map(|k| k / 4 * 5 + k % 4).map(|a| [a, a + 1, a + 6, a + 5]).collect();
        let outline = |k: u32| k.is_multiple_of(5) || k % 5 == 4 || !(5..20).contains(&k);
        let mut columns = Columns {
            bony: (0..25).map(|k| at(k, 0.0)).collect(),
            articular: (0..25).map(|k| at(k, 2.0)).collect(),
            quads,
            on_outline: (0..25).map(outline).collect(),
        };
        assert_eq!(columns.clone().collapse_folded(0.1, 0.3), 0);
        // The outline and the inner node beside it leave room for the quadrilaterals that take the place.
        for nodes in [&mut columns.bony, &mut columns.articular] {
            for (k, x, y) in [(7, 1.05, 0.05), (2, 2.0, -0.5), (6, 0.75, 1.0)] {
                (nodes[k].x, nodes[k].y) = (x, y);
            }
        }
        assert_eq!(columns.collapse_folded(0.1, 0.3), 1);
        assert_eq!((columns.quads.len(), columns.bony.len()), (15, 24));
        assert!(columns.quads.iter().flatten().all(|&v| v < 24));
        let mesh = columns.hexahedra(1);
        assert!((0..15).all(|e| mesh.scaled_jacobian(e) > 0.0));
    }
}

//! Filling what a set of voxels encloses.

use super::Grid;
use super::components::neighbours;
use std::collections::VecDeque;

/// Whether each voxel lies outside of `wall`: it can be reached from the grid's border without crossing the wall.
///
/// What the wall encloses on the border itself, in the plane of one of the six faces, is not outside either: a bone that runs
/// out of the picture shows its marrow there.
pub fn outside(grid: &Grid, wall: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut out = vec![false; grid.count()];
    let mut open = VecDeque::new();
    for axis in 0..3 {
        for end in [0, grid.size[axis].saturating_sub(1)] {
            for at in face_outside(grid, axis, end, &wall) {
                if !out[at] {
                    out[at] = true;
                    open.push_back(at);
                }
            }
        }
    }
    while let Some(at) = open.pop_front() {
        for next in neighbours(grid, at) {
            if !out[next] && !wall(next) {
                out[next] = true;
                open.push_back(next);
            }
        }
    }
    out
}

/// The voxels of a face of the grid that can be reached within it from its rim.
fn face_outside(grid: &Grid, axis: usize, end: usize, wall: &impl Fn(usize) -> bool) -> Vec<usize> {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let (nu, nv) = (grid.size[u], grid.size[v]);
    let place = |a: usize, b: usize| {
        let mut voxel = [0; 3];
        (voxel[axis], voxel[u], voxel[v]) = (end, a, b);
        grid.at(voxel)
    };
    let mut seen = vec![false; nu * nv];
    let mut open: Vec<[usize; 2]> = Vec::new();
    let mut found = Vec::new();
    let mut visit = |a: usize, b: usize, open: &mut Vec<[usize; 2]>| {
        let at = place(a, b);
        if !seen[b * nu + a] && !wall(at) {
            seen[b * nu + a] = true;
            open.push([a, b]);
            found.push(at);
        }
    };
    for a in 0..nu {
        visit(a, 0, &mut open);
        visit(a, nv - 1, &mut open);
    }
    for b in 0..nv {
        visit(0, b, &mut open);
        visit(nu - 1, b, &mut open);
    }
    while let Some([a, b]) = open.pop() {
        for (da, db) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
            let (Some(a), Some(b)) = (a.checked_add_signed(da), b.checked_add_signed(db)) else { continue };
            if a < nu && b < nv {
                visit(a, b, &mut open);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;
    use nalgebra::Matrix3;

    #[test]
    fn a_tube_that_runs_out_of_the_picture_is_filled() {
        let grid = Grid { size: [12, 12, 9], origin: Point::origin(), axes: Matrix3::identity() };
        let ring = |i: usize| {
            let [x, y, _] = grid.voxel(i);
            let r = (x as f64 - 5.5).hypot(y as f64 - 5.5);
            (3.0..4.7).contains(&r)
        };
        let out = outside(&grid, ring);
        for (i, &out) in out.iter().enumerate() {
            let [x, y, _] = grid.voxel(i);
            assert_eq!(out, (x as f64 - 5.5).hypot(y as f64 - 5.5) >= 4.7, "{:?}", grid.voxel(i));
        }
    }
}

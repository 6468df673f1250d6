//! Pieces of a set of voxels that hang together.

use super::Grid;

/// Pieces of a set, by voxels that share a face.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Components {
    /// Number of the piece at each voxel, counted from 1, in the order of their first voxels; 0 outside the set.
    pub piece: Vec<u32>,
    /// Voxels of each piece, the first entry those of none.
    pub voxels: Vec<usize>,
}

/// The pieces of the voxels for which `set` holds.
pub fn components(grid: &Grid, set: impl Fn(usize) -> bool) -> Components {
    let mut found = Components { piece: vec![0; grid.count()], voxels: vec![0] };
    let mut open = Vec::new();
    for start in 0..grid.count() {
        if found.piece[start] != 0 || !set(start) {
            continue;
        }
        let number = found.voxels.len() as u32;
        found.piece[start] = number;
        open.push(start);
        let mut count = 0;
        while let Some(at) = open.pop() {
            count += 1;
            for next in neighbours(grid, at) {
                if found.piece[next] == 0 && set(next) {
                    found.piece[next] = number;
                    open.push(next);
                }
            }
        }
        found.voxels.push(count);
    }
    found
}

/// The voxels that share a face with the one at `at`.
pub fn neighbours(grid: &Grid, at: usize) -> impl Iterator<Item = usize> + use<> {
    let voxel = grid.voxel(at);
    let (size, strides) = (grid.size, grid.strides());
    (0..6).filter_map(move |side| {
        let axis = side / 2;
        if side % 2 == 0 {
            (voxel[axis] > 0).then(|| at - strides[axis])
        } else {
            (voxel[axis] + 1 < size[axis]).then(|| at + strides[axis])
        }
    })
}

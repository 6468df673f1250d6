//! Label maps as programs and hands leave them: specks, holes, pieces that hang by a bridge of one voxel.

use meshes::volume::Grid;
use meshes::volume::components::{Components, components, neighbours};
use meshes::volume::outline::Part;
use std::collections::BTreeSet;

/// A piece that hangs on by at most this many faces of voxels hangs by a bridge [-].
const BRIDGE_FACES: usize = 4;
/// Fewer voxels beyond a bridge are roughness of the surface [-].
const LEAST_BLOB: usize = 30;

/// What was mended.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mended {
    /// Volumes of the pieces taken away [mm3], largest first.
    pub(super) specks_mm3: Vec<f64>,
    /// Volume of enclosed holes that were filled [mm3].
    pub(super) holes_mm3: f64,
    /// Pieces taken away that hung by a bridge.
    pub(super) bridged: usize,
}

/// Keeps the `most` largest pieces of a part that have at least `share` of the largest, and fills the holes that they enclose. `bridges`: pieces that
/// hang by a bridge are taken away first. Gives also the share of the second piece in the largest, before.
pub(super) fn clean(part: &mut Part, most: usize, share: f64, bridges: bool) -> (Mended, f64) {
    let mut mended = Mended::default();
    let voxel = part.grid.voxel_mm3();
    if bridges {
        // a fibula may touch the tibia: where two pieces are looked for, a large one is parted, not taken away
        mended.bridged = cut_bridges(part, if most > 1 { share } else { f64::INFINITY });
    }
    let pieces = components(&part.grid, |i| part.inside[i]);
    let mut order: Vec<usize> = (1..pieces.voxels.len()).collect();
    order.sort_by_key(|&p| (std::cmp::Reverse(pieces.voxels[p]), p));
    let largest = order.first().map_or(0, |&p| pieces.voxels[p]) as f64;
    let second = order.get(1).map_or(0.0, |&p| pieces.voxels[p] as f64 / largest);
    let kept: Vec<usize> =
        order.iter().copied().take(most).filter(|&p| pieces.voxels[p] as f64 >= share * largest).collect();
    for &p in order.iter().filter(|p| !kept.contains(p)) {
        mended.specks_mm3.push(pieces.voxels[p] as f64 * voxel);
    }
    for (i, &p) in pieces.piece.iter().enumerate() {
        part.inside[i] = p != 0 && kept.contains(&(p as usize));
    }
    let filled = fill(part);
    mended.holes_mm3 = filled as f64 * voxel;
    (mended, second)
}

/// Fills what no way leads out of; gives the number of voxels.
fn fill(part: &mut Part) -> usize {
    let outside = components(&part.grid, |i| !part.inside[i]);
    let mut filled = 0;
    // The border of a part is outside, so the first voxel's piece is the way out.
    let out = outside.piece.first().copied().unwrap_or(0);
    for (i, &p) in outside.piece.iter().enumerate() {
        if p != 0 && p != out {
            part.inside[i] = true;
            filled += 1;
        }
    }
    filled
}

/// Takes away pieces that hang on the largest by a few faces of voxels, and gives their number; those of `own` of the largest or more are parted
/// from it and stay.
fn cut_bridges(part: &mut Part, own: f64) -> usize {
    let grid = part.grid.clone();
    let deep = |i: usize| part.inside[i] && neighbours(&grid, i).all(|n| part.inside[n]);
    let cores: Components = components(&grid, deep);
    let largest = (1..cores.voxels.len()).max_by_key(|&p| cores.voxels[p]);
    let mut cut = 0;
    for blob in 1..cores.voxels.len() {
        if Some(blob) == largest || cores.voxels[blob] < LEAST_BLOB {
            continue;
        }
        let core = (0..grid.count()).filter(|&i| cores.piece[i] as usize == blob);
        let member: BTreeSet<usize> = core.flat_map(|i| cube(&grid, i)).filter(|&i| part.inside[i]).collect();
        let faces: usize = member
            .iter()
            .map(|&i| neighbours(&grid, i).filter(|n| part.inside[*n] && !member.contains(n)).count())
            .sum();
        if faces == 0 || faces > BRIDGE_FACES {
            continue;
        }
        if cores.voxels[blob] as f64 >= own * largest.map_or(0, |p| cores.voxels[p]) as f64 {
            let touches = |i: usize| neighbours(&grid, i).any(|n| part.inside[n] && !member.contains(&n));
            let bridge: Vec<usize> = member.iter().copied().filter(|&i| touches(i)).collect();
            bridge.into_iter().for_each(|i| part.inside[i] = false);
        } else {
            member.iter().for_each(|&i| part.inside[i] = false);
            cut += 1;
        }
    }
    cut
}

/// A voxel and those that touch it by a face, an edge or a corner: what erosion by faces took from a convex piece comes back.
fn cube(grid: &Grid, at: usize) -> impl Iterator<Item = usize> + use<> {
    let (voxel, size, strides) = (grid.voxel(at), grid.size, grid.strides());
    (0..27_usize).filter_map(move |n| {
        let step = [n % 3, n / 3 % 3, n / 9];
        let place: Option<Vec<usize>> = (0..3)
            .map(|k| (voxel[k] + step[k]).checked_sub(1).filter(|&v| v < size[k]).map(|v| v * strides[k]))
            .collect();
        place.map(|p| p.iter().sum())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::Point;
    use nalgebra::Matrix3;

    /// A box of 20 voxels with a box of 7 that hangs by a bridge, a speck, and a hole.
    fn part() -> Part {
        let grid = Grid { size: [40, 24, 24], origin: Point::origin(), axes: Matrix3::identity() };
        let within = |v: [usize; 3], low: [usize; 3], n: usize| (0..3).all(|k| (low[k]..low[k] + n).contains(&v[k]));
        let inside = (0..grid.count())
            .map(|i| {
                let v = grid.voxel(i);
                let hole = within(v, [8, 8, 8], 3);
                let bridge = v[1] == 10 && v[2] == 10 && (22..26).contains(&v[0]);
                within(v, [2, 2, 2], 20) && !hole || within(v, [26, 7, 7], 7) || bridge || v == [36, 20, 20]
            })
            .collect();
        Part { grid, inside }
    }

    #[test]
    fn specks_holes_and_bridges_are_mended_and_told() {
        let mut cleaned = part();
        let (mended, second) = clean(&mut cleaned, 1, 0.0, true);
        assert_eq!(mended.bridged, 1);
        assert!((mended.holes_mm3 - 27.0).abs() < 1e-9, "{mended:?}");
        assert!(mended.specks_mm3.iter().sum::<f64>() < 6.0 && !mended.specks_mm3.is_empty(), "{mended:?}");
        assert!(second < 0.01, "{second}");
        let left = cleaned.inside.iter().filter(|i| **i).count();
        assert!((8000..8010).contains(&left), "{left}");
        let mut whole = part();
        let (mended, _) = clean(&mut whole, 1, 0.0, false);
        assert_eq!(mended.bridged, 0);
        assert!(whole.inside.iter().filter(|i| **i).count() > 8300);
    }

    #[test]
    fn a_fibula_that_touches_the_tibia_is_parted_and_stays() {
        let mut both = part();
        let (mended, second) = clean(&mut both, 2, 0.01, true);
        assert_eq!(mended.bridged, 0);
        assert!((0.03..0.06).contains(&second), "{second}");
        assert_eq!(components(&both.grid, |i| both.inside[i]).voxels.len() - 1, 2);
    }
}

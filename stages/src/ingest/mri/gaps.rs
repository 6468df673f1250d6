//! Cartilage that does not reach its bone in a label map.

use meshes::volume::Labels;
use notices::{Kind, Notice};

/// Share of a cartilage's voxels that touch its bone, below which a gap parts them [-]. Ours: in a segmented knee, in one that was made of published
/// bones and in a phantom it is 0.07 to 0.4, by thickness and voxel; with a gap of a voxel it is 0.
const LEAST_TOUCHING: f64 = 0.02;

/// The share of the voxels of one structure that have a voxel of another one beside them [-].
fn touching(map: &Labels, cartilage: &[u8], bone: &[u8]) -> f64 {
    let (size, strides) = (map.grid.size, map.grid.strides());
    let (mut all, mut touch) = (0usize, 0usize);
    for (i, _) in map.values.iter().enumerate().filter(|(_, label)| cartilage.contains(label)) {
        let at = map.grid.voxel(i);
        let is_bone = |k: usize| bone.contains(&map.values[k]);
        let beside = |a: usize| at[a] > 0 && is_bone(i - strides[a]) || at[a] + 1 < size[a] && is_bone(i + strides[a]);
        all += 1;
        touch += usize::from((0..3).any(beside));
    }
    touch as f64 / all.max(1) as f64
}

/// What is told of a cartilage that a gap parts from its bone.
pub(super) fn apart(path: &str, key: &str, map: &Labels, cartilage: &[u8], bone: &[u8]) -> Option<Notice> {
    let share = touching(map, cartilage, bone);
    (share < LEAST_TOUCHING).then(|| {
        let text = format!(
            "{path}: {:.1} % of the voxels of {key} touch its bone, expected {:.0} % and more: is there a gap between them (a bone or a cartilage drawn too small, a label between them that is left out)? The cartilage would float",
            100.0 * share,
            100.0 * LEAST_TOUCHING
        );
        Kind::CartilageVolume.notice(text).file(path).of(key)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshes::Point;
    use meshes::volume::Grid;
    use nalgebra::Matrix3;

    #[test]
    fn a_gap_of_a_voxel_is_told_and_cartilage_on_bone_is_not() {
        let with = |slices: [u8; 5]| Labels {
            grid: Grid { size: [4, 3, 5], origin: Point::origin(), axes: Matrix3::identity() },
            values: slices.iter().flat_map(|label| [*label; 12]).collect(),
        };
        assert!(apart("l", "c", &with([5, 5, 1, 1, 0]), &[1], &[5]).is_none());
        let told = apart("l", "c", &with([5, 5, 0, 1, 1]), &[1], &[5]).unwrap();
        assert!(told.text.contains("0.0 % of the voxels of c"), "{}", told.text);
        // the map's first and last slices do not touch
        assert!(apart("l", "c", &with([5, 0, 0, 0, 1]), &[1], &[5]).is_some());
    }
}

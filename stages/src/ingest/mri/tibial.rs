//! One label for the cartilage of both plateaus, parted into the medial and the lateral one.

use super::labels::Found;
use crate::StageError;
use crate::anatomy::rough_axes;
use meshes::frame::Side;
use meshes::volume::components::components;
use meshes::{Point, Vector};
use notices::{Kind, Notice};

/// Share of the largest piece above which both plateaus are one piece, and are parted by the plane between them [-].
const ONE_PIECE: f64 = 0.85;

impl Found<'_> {
    /// A label that nothing uses, and the map in which the lateral plateau's cartilage has it.
    ///
    /// # Errors
    /// Bones whose directions cannot be told; a cartilage on one side alone.
    pub(super) fn parted(&self, side: Side, warnings: &mut Vec<Notice>) -> Result<(u8, Vec<u8>), StageError> {
        let label = self.labels.get("tibial_cartilage_medial").copied().unwrap_or_default();
        let free = (1..=255u8).find(|l| !self.map.values.contains(l));
        let Some(free) = free else {
            return Err(self.fail("all 255 labels are used: leave out what is not needed".into()));
        };
        let axes = {
            let mut quiet = Vec::new();
            let bones = self.bones(&mut quiet)?;
            rough_axes(&bones.femur, &bones.tibfib, side)?
        };
        let grid = &self.map.grid;
        let place = |v: usize| grid.point(&Vector::from(grid.voxel(v).map(|i| i as f64)));
        let pieces = components(grid, |v| self.map.values[v] == label);
        let along = |p: Point| (p - axes.joint).dot(&axes.lateral);
        let mut sums = vec![(0.0, 0usize); pieces.voxels.len()];
        for (v, piece) in pieces.piece.iter().enumerate().filter(|(_, piece)| **piece > 0) {
            let (sum, count) = &mut sums[*piece as usize];
            *sum += along(place(v));
            *count += 1;
        }
        let total: usize = sums.iter().map(|s| s.1).sum();
        let mut large: Vec<(f64, usize)> = sums.iter().filter(|s| s.1 > 0).map(|s| (s.0 / s.1 as f64, s.1)).collect();
        large.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        let (middle, whole) = match large[..] {
            [first, second, ..] if (first.1 as f64) < ONE_PIECE * total as f64 => {
                (f64::midpoint(first.0, second.0), true)
            }
            _ => (0.0, false),
        };
        let lateral = |v: usize, piece: u32| match whole {
            true => sums[piece as usize].0 / sums[piece as usize].1.max(1) as f64 > middle,
            false => along(place(v)) > middle,
        };
        let mut values = self.map.values.clone();
        for (v, piece) in pieces.piece.iter().enumerate().filter(|(_, piece)| **piece > 0) {
            if lateral(v, *piece) {
                values[v] = free;
            }
        }
        let how = if whole { "its pieces" } else { "the middle of the joint, as it is one piece" };
        warnings.push(
            Kind::BothPlateaus
                .notice(format!(
                    "{}: label {label} holds the cartilage of both plateaus; it is parted by {how}",
                    self.path
                ))
                .file(self.path),
        );
        Ok((free, values))
    }
}

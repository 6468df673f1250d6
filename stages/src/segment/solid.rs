//! Solid bodies of bone: dense voxels, closed, filled, parted.

use super::SegmentOptions;
use crate::StageError;
use meshes::volume::components::components;
use meshes::volume::distance::distance_to;
use meshes::volume::fill::outside;
use meshes::volume::watershed::{NeckOptions, part_at_necks};
use meshes::volume::{Labels, Volume, crop};

/// The bodies in a part of the volume.
pub(super) struct Bodies {
    /// First and last voxel of the part.
    pub low: [usize; 3],
    /// Last voxel of the part.
    pub high: [usize; 3],
    /// The body at each voxel of the part, from 1; with seeds in their order.
    pub body: Vec<u32>,
    /// The seeds' labels, ascending; none without seeds.
    pub seeds: Vec<u8>,
}

/// Dense voxels smaller together than this are noise, vessels or the table's screws [mm3].
const SPECK_MM3: f64 = 300.0;

/// The bodies of bone in a volume.
pub(super) fn bodies(
    volume: &Volume,
    seeds: Option<&Labels>,
    threshold: f64,
    options: &SegmentOptions,
) -> Result<Bodies, StageError> {
    let grid = &volume.grid;
    let pieces = components(grid, |i| f64::from(volume.values[i]) >= threshold);
    let speck = SPECK_MM3 / grid.voxel_mm3();
    let large: Vec<bool> = pieces.voxels.iter().map(|&n| n as f64 >= speck).collect();
    let kept = |i: usize| pieces.piece[i] != 0 && large[pieces.piece[i] as usize];
    let margin = grid.spacing().map(|s| ((2.0 * options.closing_mm + 2.0) / s).ceil() as usize);
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for i in (0..grid.count()).filter(|&i| kept(i)) {
        let voxel = grid.voxel(i);
        for k in 0..3 {
            low[k] = low[k].min(voxel[k]);
            high[k] = high[k].max(voxel[k]);
        }
    }
    if low[0] == usize::MAX {
        return Err(StageError::Knee(format!(
            "no voxel cluster of the CT volume above {threshold:.0} is as large as a bone; expected a knee: give segment.threshold"
        )));
    }
    for k in 0..3 {
        low[k] = low[k].saturating_sub(margin[k]);
        high[k] = (high[k] + margin[k]).min(grid.size[k] - 1);
    }
    let whole: Vec<bool> = (0..grid.count()).map(kept).collect();
    drop(pieces);
    let (part, dense) = (grid.part(low, high), crop(grid, &whole, low, high));
    drop(whole);
    let near = distance_to(&part, |i| dense[i]);
    let reach = options.closing_mm as f32;
    let out = outside(&part, |i| near[i] <= reach);
    // Marrow is what the closed cortex encloses; it is grown back to the cortex. A narrow gap between two bones, which the
    // closing bridges too, has no such core and stays open.
    let core: Vec<bool> = (0..part.count()).map(|i| !out[i] && near[i] > reach).collect();
    drop((near, out));
    let back = reach + 0.5 * part.spacing().into_iter().fold(0.0, f64::max) as f32;
    let marrow = distance_to(&part, |i| core[i]);
    let out = outside(&part, |i| dense[i] || marrow[i] <= back);
    drop((marrow, core));
    let depth = distance_to(&part, |i| out[i]);
    let seeds = seeds.map(|s| crop(grid, &s.values, low, high));
    let necks = NeckOptions {
        neck_share: options.neck_share,
        least_voxels: (0.25 * options.least_bone_mm3 / grid.voxel_mm3()) as usize,
    };
    let body = part_at_necks(&part, &depth, |i| seeds.as_ref().map_or(0, |s| s[i]), &necks);
    // Only seeds inside bone count.
    let mut used: Vec<u8> =
        seeds.iter().flatten().zip(&body).filter(|(s, b)| **s != 0 && **b != 0).map(|(s, _)| *s).collect();
    used.sort_unstable();
    used.dedup();
    Ok(Bodies { low, high, body, seeds: used })
}

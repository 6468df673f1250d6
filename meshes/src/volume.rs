//! Values on a regular grid in space: CT volumes and label maps.

pub mod blur;
pub mod components;
pub mod distance;
pub mod fill;
pub mod histogram;
pub mod outline;
pub mod watershed;

use crate::{Point, Vector};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// Where the voxels of a regular grid lie. The axes need be neither square to each other (a tilted gantry shears them) nor
/// right-handed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// Voxels along each axis.
    pub size: [usize; 3],
    /// Centre of the first voxel [mm].
    pub origin: Point,
    /// From a voxel to its next along each axis, in columns [mm].
    pub axes: Matrix3<f64>,
}

/// A number at each voxel, the first axis running fastest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Volume {
    /// Where the voxels lie.
    pub grid: Grid,
    /// One value a voxel.
    pub values: Vec<f32>,
}

/// A label at each voxel, 0 for none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Labels {
    /// Where the voxels lie.
    pub grid: Grid,
    /// One label a voxel; kept as runs.
    #[serde(with = "runs")]
    pub values: Vec<u8>,
}

impl Default for Grid {
    fn default() -> Self {
        Grid { size: [0; 3], origin: Point::origin(), axes: Matrix3::identity() }
    }
}

impl Grid {
    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.size.iter().product()
    }

    /// Distance between neighbours along each axis [mm].
    pub fn spacing(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.axes.column(k).norm())
    }

    /// Volume of a voxel [mm3].
    pub fn voxel_mm3(&self) -> f64 {
        self.axes.determinant().abs()
    }

    /// Place of a voxel in the list.
    pub fn at(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }

    /// The voxel at a place in the list.
    pub fn voxel(&self, at: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [at % nx, at / nx % ny, at / (nx * ny)]
    }

    /// Where a voxel, whole or between, lies [mm].
    pub fn point(&self, index: &Vector) -> Point {
        self.origin + self.axes * index
    }

    /// Voxel coordinates of a point; `None` where the grid is flat.
    pub fn index_from_mm(&self) -> Option<Matrix3<f64>> {
        self.axes.try_inverse().filter(|m| m.iter().all(|x| x.is_finite()))
    }

    /// Steps in the list to the next voxel along each axis.
    pub fn strides(&self) -> [usize; 3] {
        [1, self.size[0], self.size[0] * self.size[1]]
    }

    /// The part of the grid from voxel `low` to voxel `high`, both in it.
    pub fn part(&self, low: [usize; 3], high: [usize; 3]) -> Grid {
        Grid {
            size: [0, 1, 2].map(|k| high[k] - low[k] + 1),
            origin: self.point(&Vector::from(low.map(|x| x as f64))),
            axes: self.axes,
        }
    }

    /// Whether two grids have their voxels at the same places, to a tenth of a voxel.
    pub fn same_places(&self, other: &Grid) -> bool {
        let far = Vector::from(self.size.map(|x| x as f64));
        let reach = 0.1 * self.spacing().into_iter().fold(f64::INFINITY, f64::min);
        self.size == other.size
            && (self.origin - other.origin).norm() < reach
            && (self.point(&far) - other.point(&far)).norm() < reach
    }
}

/// The values of `grid` between voxels `low` and `high`, both in.
pub fn crop<T: Copy>(grid: &Grid, values: &[T], low: [usize; 3], high: [usize; 3]) -> Vec<T> {
    let mut out = Vec::with_capacity(grid.part(low, high).count());
    for k in low[2]..=high[2] {
        for j in low[1]..=high[1] {
            let start = grid.at([low[0], j, k]);
            out.extend_from_slice(&values[start..=start + high[0] - low[0]]);
        }
    }
    out
}

impl Volume {
    /// The value between voxels, linear along each axis; beyond the border, that of the border.
    pub fn sample(&self, index: &Vector) -> f64 {
        let size = self.grid.size;
        let (mut low, mut share, mut step) = ([0; 3], [0.0; 3], [0; 3]);
        for k in 0..3 {
            let x = index[k].clamp(0.0, (size[k] - 1) as f64);
            low[k] = (x as usize).min(size[k].saturating_sub(2));
            share[k] = x - low[k] as f64;
            step[k] = if size[k] > 1 { self.grid.strides()[k] } else { 0 };
        }
        let start = self.grid.at(low);
        let value = |dx: usize, dy: usize, dz: usize| {
            f64::from(self.values[start + dx * step[0] + dy * step[1] + dz * step[2]])
        };
        let along = |dy, dz| value(0, dy, dz) + (value(1, dy, dz) - value(0, dy, dz)) * share[0];
        let plane = |dz| along(0, dz) + (along(1, dz) - along(0, dz)) * share[1];
        plane(0) + (plane(1) - plane(0)) * share[2]
    }
}

/// Labels as runs of one label each.
mod runs {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(values: &[u8], to: S) -> Result<S::Ok, S::Error> {
        let runs: Vec<(u8, u32)> = values.chunk_by(|a, b| a == b).map(|run| (run[0], run.len() as u32)).collect();
        runs.serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u8>, D::Error> {
        let runs = Vec::<(u8, u32)>::deserialize(from)?;
        Ok(runs.into_iter().flat_map(|(label, count)| std::iter::repeat_n(label, count as usize)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_sampled_exactly_and_crops_keep_places() {
        let grid = Grid {
            size: [4, 5, 6],
            origin: Point::new(1.0, 2.0, 3.0),
            axes: Matrix3::from_diagonal(&Vector::new(0.5, 2.0, 1.5)),
        };
        let value = |p: &Point| 2.0 * p.x - p.y + 0.5 * p.z;
        let values = (0..grid.count())
            .map(|i| value(&grid.point(&Vector::from(grid.voxel(i).map(|x| x as f64)))) as f32)
            .collect();
        let volume = Volume { grid: grid.clone(), values };
        let index = Vector::new(1.3, 2.6, 4.9);
        assert!((volume.sample(&index) - value(&grid.point(&index))).abs() < 1e-5);
        let part = grid.part([1, 1, 2], [3, 4, 4]);
        let values = crop(&grid, &volume.values, [1, 1, 2], [3, 4, 4]);
        assert_eq!(values.len(), part.count());
        let cropped = Volume { grid: part, values };
        let at = Vector::new(1.0, 1.0, 1.0);
        assert!((cropped.sample(&at) - volume.sample(&Vector::new(2.0, 2.0, 3.0))).abs() < 1e-6);
    }
}

//! Gaussian blur on a grid.

use super::Grid;
use rayon::prelude::*;

/// Blurs `values` with a Gaussian of standard deviation `sigma_mm` along each axis; beyond the border the border's value goes on.
/// Gives by how much the blur reduces the standard deviation of noise that differs from voxel to voxel [-].
pub fn blur(grid: &Grid, values: &mut [f32], sigma_mm: f64) -> f64 {
    let mut left = 1.0;
    for (axis, spacing) in grid.spacing().into_iter().enumerate() {
        let kernel = kernel(sigma_mm / spacing);
        left *= kernel.iter().map(|w| f64::from(w * w)).sum::<f64>().sqrt();
        along(grid, values, axis, &kernel);
    }
    left
}

/// Weights of a Gaussian, `sigma` in voxels, summing to 1.
fn kernel(sigma: f64) -> Vec<f32> {
    let reach = (3.5 * sigma).ceil().max(0.0) as i32;
    let weight: Vec<f64> = (-reach..=reach).map(|k| (-0.5 * (f64::from(k) / sigma.max(1e-9)).powi(2)).exp()).collect();
    let sum: f64 = weight.iter().sum();
    weight.iter().map(|w| (w / sum) as f32).collect()
}

fn along(grid: &Grid, values: &mut [f32], axis: usize, kernel: &[f32]) {
    let (n, stride, reach) = (grid.size[axis], grid.strides()[axis], kernel.len() / 2);
    let before = values.to_vec();
    let row = grid.size[0];
    values.par_chunks_mut(row).enumerate().for_each(|(r, out)| {
        for (i, value) in out.iter_mut().enumerate() {
            let at = r * row + i;
            let place = grid.voxel(at)[axis];
            let start = at - place * stride;
            *value = (0..kernel.len())
                .map(|k| kernel[k] * before[start + (place + k).saturating_sub(reach).min(n - 1) * stride])
                .sum();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;
    use nalgebra::Matrix3;

    #[test]
    fn a_constant_stays_and_a_point_spreads() {
        let grid = Grid { size: [15, 15, 15], origin: Point::origin(), axes: Matrix3::identity() * 0.5 };
        let mut flat = vec![3.0f32; grid.count()];
        blur(&grid, &mut flat, 0.6);
        assert!(flat.iter().all(|x| (x - 3.0).abs() < 1e-5));
        let mut point = vec![0.0f32; grid.count()];
        point[grid.at([7, 7, 7])] = 1.0;
        let left = blur(&grid, &mut point, 0.6);
        let sum: f32 = point.iter().sum();
        let spread: f32 = (0..grid.count()).map(|i| point[i] * (grid.voxel(i)[1] as f32 - 7.0).powi(2) * 0.25).sum();
        assert!((sum - 1.0).abs() < 1e-4 && (spread.sqrt() - 0.6).abs() < 0.01, "{sum} {spread}");
        let energy: f32 = point.iter().map(|x| x * x).sum();
        assert!((f64::from(energy).sqrt() - left).abs() < 1e-6);
    }
}

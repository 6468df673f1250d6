//! Exact Euclidean distance on a grid [felzenszwalb2012].

use super::Grid;
use rayon::prelude::*;

/// Distance [mm] of each voxel to the nearest voxel of `set`, 0 on it, infinite where `set` is empty.
///
/// Axes are taken as square to each other; a tilted gantry's are not quite, which matters little for what this is used for.
/// Cost O(n); the same on any number of threads.
pub fn distance_to(grid: &Grid, set: impl Fn(usize) -> bool + Sync) -> Vec<f32> {
    let mut squared: Vec<f32> =
        (0..grid.count()).into_par_iter().map(|i| if set(i) { 0.0 } else { f32::INFINITY }).collect();
    let [nx, ny, nz] = grid.size;
    let [dx, dy, dz] = grid.spacing();
    if squared.is_empty() {
        return squared;
    }
    squared.par_chunks_mut(nx).for_each(|row| {
        let mut work = Parabolas::new(nx);
        let out: Vec<f32> = work.envelope(row.iter().copied(), dx).to_vec();
        row.copy_from_slice(&out);
    });
    squared.par_chunks_mut(nx * ny).for_each(|slice| {
        let mut work = Parabolas::new(ny);
        for i in 0..nx {
            let out = work.envelope((0..ny).map(|j| slice[j * nx + i]), dy).to_vec();
            for (j, value) in out.into_iter().enumerate() {
                slice[j * nx + i] = value;
            }
        }
    });
    let planes: Vec<Vec<f32>> = (0..ny)
        .into_par_iter()
        .map(|j| {
            let mut work = Parabolas::new(nz);
            let mut plane = Vec::with_capacity(nx * nz);
            for i in 0..nx {
                plane.extend_from_slice(work.envelope((0..nz).map(|k| squared[(k * ny + j) * nx + i]), dz));
            }
            plane
        })
        .collect();
    squared.par_chunks_mut(nx * ny).enumerate().for_each(|(k, slice)| {
        for (j, row) in slice.chunks_mut(nx).enumerate() {
            for (i, value) in row.iter_mut().enumerate() {
                *value = planes[j][i * nz + k].sqrt();
            }
        }
    });
    squared
}

/// The lower envelope of parabolas along one line.
struct Parabolas {
    value: Vec<f32>,
    apex: Vec<usize>,
    from: Vec<f64>,
    out: Vec<f32>,
}

impl Parabolas {
    fn new(n: usize) -> Parabolas {
        Parabolas { value: vec![0.0; n], apex: vec![0; n], from: vec![0.0; n + 1], out: vec![0.0; n] }
    }

    /// min over q of value(q) + (step (p - q))^2.
    fn envelope(&mut self, line: impl Iterator<Item = f32>, step: f64) -> &[f32] {
        let n = self.value.len();
        self.value.iter_mut().zip(line).for_each(|(v, x)| *v = x);
        let height = |v: &[f32], q: usize| f64::from(v[q]) / (step * step) + (q * q) as f64;
        let mut count = 0;
        for q in 0..n {
            if self.value[q].is_infinite() {
                continue;
            }
            while count > 0 {
                let r = self.apex[count - 1];
                let meet = (height(&self.value, q) - height(&self.value, r)) / (2 * (q - r)) as f64;
                if meet > self.from[count - 1] {
                    self.from[count] = meet;
                    break;
                }
                count -= 1;
            }
            if count == 0 {
                self.from[0] = f64::NEG_INFINITY;
            }
            self.apex[count] = q;
            count += 1;
        }
        if count == 0 {
            self.out.fill(f32::INFINITY);
            return &self.out;
        }
        let mut k = 0;
        for p in 0..n {
            while k + 1 < count && self.from[k + 1] < p as f64 {
                k += 1;
            }
            let away = step * (p as f64 - self.apex[k] as f64);
            self.out[p] = (f64::from(self.value[self.apex[k]]) + away * away) as f32;
        }
        &self.out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn agrees_with_trying_all() {
        let grid = Grid {
            size: [9, 7, 11],
            origin: Point::origin(),
            axes: Matrix3::from_diagonal(&Vector3::new(0.7, 1.1, 0.6)),
        };
        let set: Vec<bool> = (0..grid.count()).map(|i| i * 2_654_435_761 % 97 < 3).collect();
        let found = distance_to(&grid, |i| set[i]);
        let place = |i: usize| grid.point(&Vector3::from(grid.voxel(i).map(|x| x as f64)));
        for (i, &found) in found.iter().enumerate() {
            let right =
                (0..set.len()).filter(|&j| set[j]).map(|j| (place(i) - place(j)).norm()).fold(f64::INFINITY, f64::min);
            assert!((f64::from(found) - right).abs() < 1e-4, "{i}: {found} {right}");
        }
        assert!(distance_to(&grid, |_| false).iter().all(|d| d.is_infinite()));
    }
}

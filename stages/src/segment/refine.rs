//! Moves a surface onto the edge of the bone that it lies at.

use super::SegmentOptions;
use meshes::smooth::{TaubinOptions, taubin};
use meshes::surface::TriMesh;
use meshes::topology::vertex_neighbours;
use meshes::volume::Volume;
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Rounds of finding edges and moving to them.
const ROUNDS: usize = 3;
/// A rise or fall against the trend, over the height of the edge so far, that ends the search for its foot or top [-].
const TURN: f64 = 0.1;

/// Moves each vertex along its normal to half the height of its edge: midway between the densest value inside and the least
/// outside, each the first met on the way from the surface. A thin cortex is not as bright as a thick one, so a
/// fixed threshold would lie too deep in it. Steps are the median over the neighbours; vertices on the border of the picture stay.
pub(super) fn refine(mesh: &mut TriMesh, volume: &Volume, threshold: f64, options: &SegmentOptions) {
    let Some(index_from_mm) = volume.grid.index_from_mm() else { return };
    let picture = Picture { volume, index_from_mm };
    let neighbours = vertex_neighbours(mesh);
    let fixed: Vec<bool> = mesh.vertices.iter().map(|p| picture.on_border(p)).collect();
    let step = 0.2 * volume.grid.spacing().into_iter().fold(f64::INFINITY, f64::min);
    for round in 0..ROUNDS {
        let normals = mesh.vertex_normals();
        let found: Vec<Option<f64>> = mesh
            .vertices
            .par_iter()
            .zip(&normals)
            .zip(&fixed)
            .map(
                |((p, n), fixed)| {
                    if *fixed { None } else { picture.edge(p, n, threshold, options.edge_reach_mm, step) }
                },
            )
            .collect();
        let median: Vec<f64> = (0..found.len()).map(|v| middle(v, &found, &neighbours)).collect();
        for v in 0..median.len() {
            if !fixed[v] {
                mesh.vertices[v] += normals[v] * median[v];
            }
        }
        let rounds = if round + 1 < ROUNDS { 2 } else { options.smoothing_rounds };
        taubin(mesh, &fixed, &TaubinOptions { rounds, ..TaubinOptions::default() });
    }
}

/// Median of the steps found at a vertex and its neighbours; 0 where none was found.
fn middle(v: usize, found: &[Option<f64>], neighbours: &[Vec<u32>]) -> f64 {
    let mut all: Vec<f64> = neighbours[v].iter().filter_map(|&n| found[n as usize]).chain(found[v]).collect();
    all.sort_by(f64::total_cmp);
    match all.len() {
        0 => 0.0,
        n if n % 2 == 1 => all[n / 2],
        n => f64::midpoint(all[n / 2 - 1], all[n / 2]),
    }
}

struct Picture<'a> {
    volume: &'a Volume,
    index_from_mm: Matrix3<f64>,
}

impl Picture<'_> {
    fn value(&self, p: &Point) -> f64 {
        self.volume.sample(&(self.index_from_mm * (p - self.volume.grid.origin)))
    }

    /// Less than a voxel from the end of the picture.
    fn on_border(&self, p: &Point) -> bool {
        let index = self.index_from_mm * (p - self.volume.grid.origin);
        (0..3).any(|k| index[k] < 1.0 || index[k] > self.volume.grid.size[k] as f64 - 2.0)
    }

    /// How far along the outward normal half the height of the edge nearest to `p` lies; `None` where there is none in reach.
    fn edge(&self, p: &Point, normal: &Vector, threshold: f64, reach: f64, step: f64) -> Option<f64> {
        let n = (2.0 * reach / step).ceil() as isize;
        let values: Vec<f64> = (-n..=n).map(|k| self.value(&(p + normal * (k as f64 * step)))).collect();
        let at = |k: isize| values[(k + n) as usize];
        // The nearest place where the value falls below the threshold on the way out.
        let falls = |k: &isize| at(*k) >= threshold && at(*k + 1) < threshold;
        let near = (reach / step) as isize;
        let start = (-near..near).filter(falls).min_by_key(|k| (2 * k + 1).abs())?;
        let (mut top, mut foot) = (at(start), at(start + 1));
        for k in (-n..start).rev() {
            if at(k) < top - TURN * (top - foot) && start - k > 1 {
                break;
            }
            top = top.max(at(k));
        }
        for k in start + 2..=n {
            if at(k) > foot + TURN * (top - foot) {
                break;
            }
            foot = foot.min(at(k));
        }
        let half = f64::midpoint(top, foot);
        let crosses = |k: &isize| at(*k) >= half && at(*k + 1) < half;
        let k = (-n..n).filter(crosses).min_by_key(|k| (k - start).abs())?;
        Some((k as f64 + (at(k) - half) / (at(k) - at(k + 1))) * step)
    }
}

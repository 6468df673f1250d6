//! What is in a fibre's way: the signed distance from a bone, sampled once on a coarse grid fixed in the bone's frame and interpolated by quadratic
//! B-splines. Its gradient is continuous, so that a fibre's force is.

use crate::error::SimError;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::{Isometry, Point, Vector};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Grid spacing [mm]: about a triangle's edge, and a fifth of the least radius that a ligament bends over.
const SPACING: f64 = 1.5;
/// Grid nodes along an edge of a block that is sampled as a whole.
const BLOCK: usize = 4;
/// Depth below and height above the surface to which the distance is sampled exactly [mm]; straight fibres run 9 mm deep at most.
const BAND: [f64; 2] = [14.0, 3.0];
/// Half a block's diagonal [mm].
const REACH: f64 = SPACING * BLOCK as f64 * 0.87;
/// More grid nodes than this are refused: a surface of absurd size.
const MOST_NODES: usize = 20_000_000;

/// A bone's sampled distance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Obstacle {
    /// Grid coordinates (local, mm) from CT coordinates in the CT pose.
    pub(super) local_from_ct: Isometry,
    /// First node [grid spacings].
    low: [f64; 3],
    size: [usize; 3],
    coefficients: Vec<f32>,
}

/// Distance and derivatives in the grid's frame.
pub(super) struct Sample {
    /// Signed distance [mm], positive outside.
    pub(super) distance: f64,
    /// Its gradient [-].
    pub(super) gradient: Vector,
    /// Its second derivatives [1/mm].
    pub(super) hessian: Matrix3<f64>,
}

impl Obstacle {
    /// Samples a closed surface (CT coordinates), between two heights in the bone's frame [mm].
    ///
    /// # Errors
    /// An empty surface, or one of absurd size.
    pub(crate) fn new(
        surface: &TriMesh,
        local_from_ct: Isometry,
        heights: [f64; 2],
        name: &str,
    ) -> Result<Obstacle, SimError> {
        let fault = |what: String| SimError::Spec(format!("surface {name}, over which ligaments wrap: {what}"));
        let local = surface.moved(&local_from_ct);
        let query = SurfaceQuery::new(&local).ok_or_else(|| fault("it has no triangles".into()))?;
        let (mut lo, mut hi) = local.bounds().ok_or_else(|| fault("it is empty".into()))?;
        (lo.z, hi.z) = (lo.z.max(heights[0]), hi.z.min(heights[1]));
        if lo.z >= hi.z {
            return Err(fault("it lies beside the fibres".into()));
        }
        let pad = SPACING * 3.0;
        let low: [f64; 3] = std::array::from_fn(|k| ((lo[k] - pad) / SPACING).floor());
        let blocks: [usize; 3] =
            std::array::from_fn(|k| (((hi[k] + pad) / SPACING).ceil() - low[k]) as usize / BLOCK + 1);
        let size = blocks.map(|b| b * BLOCK);
        if size.iter().try_fold(1usize, |a, b| a.checked_mul(*b)).is_none_or(|n| n > MOST_NODES) {
            return Err(fault(format!("it is {:.0} mm across; is it in mm?", (hi - lo).norm())));
        }
        let mut out = Obstacle { local_from_ct, low, size, coefficients: Vec::new() };
        let samples = out.samples(&query, blocks);
        out.coefficients = out.prefiltered(&samples);
        Ok(out)
    }

    /// Exact distances in the blocks near the surface; in the others one for the block, no further from the surface than any point of it.
    fn samples(&self, query: &SurfaceQuery, blocks: [usize; 3]) -> Vec<f32> {
        let [nx, ny, _] = self.size;
        let node = |place: [usize; 3]| Point::from(Vector::from_fn(|a, _| (self.low[a] + place[a] as f64) * SPACING));
        let slabs: Vec<Vec<f32>> = (0..blocks[2])
            .into_par_iter()
            .map(|bz| {
                let mut slab = vec![0f32; nx * ny * BLOCK];
                for by in 0..blocks[1] {
                    for bx in 0..blocks[0] {
                        let corner = [bx * BLOCK, by * BLOCK, bz * BLOCK];
                        let half = Vector::repeat((BLOCK as f64 - 1.0) / 2.0 * SPACING);
                        let centre = query.signed_distance(&(node(corner) + half));
                        let near = centre > -BAND[0] - REACH && centre < BAND[1] + REACH;
                        for n in 0..BLOCK.pow(3) {
                            let (i, j, k) = (n % BLOCK, n / BLOCK % BLOCK, n / BLOCK / BLOCK);
                            let p = node([corner[0] + i, corner[1] + j, corner[2] + k]);
                            let distance = if near { query.signed_distance(&p) } else { centre - REACH };
                            slab[(k * ny + corner[1] + j) * nx + corner[0] + i] = distance as f32;
                        }
                    }
                }
                slab
            })
            .collect();
        slabs.concat()
    }

    /// Spline coefficients by local quasi-interpolation, of third order: `c = s - (second differences) / 8`.
    fn prefiltered(&self, samples: &[f32]) -> Vec<f32> {
        let [nx, ny, nz] = self.size;
        let mut coefficients = samples.to_vec();
        for k in 1..nz - 1 {
            for j in 1..ny - 1 {
                for i in 1..nx - 1 {
                    let at = (k * ny + j) * nx + i;
                    let s = |o: usize| samples[at + o] + samples[at - o] - 2.0 * samples[at];
                    coefficients[at] = samples[at] - (s(1) + s(nx) + s(nx * ny)) / 8.0;
                }
            }
        }
        coefficients
    }

    /// The grid node nearest to a local point and the offset from it; `None` off the grid.
    #[inline]
    fn cell(&self, p: &Vector) -> Option<(usize, [f64; 3])> {
        let (mut index, mut offset) = ([0usize; 3], [0.0; 3]);
        for a in 0..3 {
            let x = p[a] * (1.0 / SPACING) - self.low[a];
            if !(x > 1.0 && x < self.size[a] as f64 - 2.0) {
                return None;
            }
            index[a] = (x + 0.5) as usize;
            offset[a] = x - index[a] as f64;
        }
        Some(((index[2] * self.size[1] + index[1]) * self.size[0] + index[0], offset))
    }

    /// Three coefficients along x, at row `j` of plane `k` around a cell's node.
    #[inline]
    fn row(&self, at: usize, j: usize, k: usize) -> [f64; 3] {
        let [nx, ny, _] = self.size;
        let start = at + k * nx * ny + j * nx - nx * ny - nx - 1;
        let row = &self.coefficients[start..start + 3];
        [f64::from(row[0]), f64::from(row[1]), f64::from(row[2])]
    }

    /// Signed distance at a local point [mm]; off the grid nothing is in the way.
    #[inline]
    #[expect(clippy::needless_range_loop, reason = "rows and planes are counted, not gone through")]
    pub(super) fn distance(&self, p: &Vector) -> f64 {
        let Some((at, offset)) = self.cell(p) else { return f64::INFINITY };
        let [wx, wy, wz] = offset.map(|t| weights(t).0);
        let mut sum = 0.0;
        for k in 0..3 {
            let mut plane = 0.0;
            for j in 0..3 {
                let [a, b, c] = self.row(at, j, k);
                plane += (a * wx[0] + b * wx[1] + c * wx[2]) * wy[j];
            }
            sum += plane * wz[k];
        }
        sum
    }

    /// Distance and derivatives at a local point; `None` off the grid.
    #[inline]
    pub(super) fn sample(&self, p: &Vector) -> Option<Sample> {
        let (at, offset) = self.cell(p)?;
        let [(wx, dx), (wy, dy), (wz, dz)] = offset.map(weights);
        // rows along x are contracted first, then along y, then along z
        let mut plane = [[0.0; 6]; 3];
        for (k, slot) in plane.iter_mut().enumerate() {
            for j in 0..3 {
                let [a, b, c] = self.row(at, j, k);
                let (v, d, s) = (a * wx[0] + b * wx[1] + c * wx[2], a * dx[0] + b * dx[1] + c * dx[2], a - 2.0 * b + c);
                slot[0] += v * wy[j];
                slot[1] += d * wy[j];
                slot[2] += s * wy[j];
                slot[3] += v * dy[j];
                slot[4] += d * dy[j];
                slot[5] += v * CURVE[j];
            }
        }
        let z = |n: usize, w: &[f64; 3]| plane[0][n] * w[0] + plane[1][n] * w[1] + plane[2][n] * w[2];
        let (g, h) = (1.0 / SPACING, 1.0 / (SPACING * SPACING));
        let (xy, xz, yz) = (z(4, &wz) * h, z(1, &dz) * h, z(3, &dz) * h);
        Some(Sample {
            distance: z(0, &wz),
            gradient: Vector::new(z(1, &wz) * g, z(3, &wz) * g, z(0, &dz) * g),
            hessian: Matrix3::new(z(2, &wz) * h, xy, xz, xy, z(5, &wz) * h, yz, xz, yz, z(0, &CURVE) * h),
        })
    }
}

/// Second derivative of the spline's three weights.
const CURVE: [f64; 3] = [1.0, -2.0, 1.0];

/// Weights of the three nodes around offset `t` in [-1/2, 1/2], and their derivatives.
#[inline]
fn weights(t: f64) -> ([f64; 3], [f64; 3]) {
    let (a, b) = (0.5 - t, 0.5 + t);
    ([a * a / 2.0, 0.75 - t * t, b * b / 2.0], [-a, -2.0 * t, b])
}

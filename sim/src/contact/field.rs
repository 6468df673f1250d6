//! Distance field of an articular surface: sampled once on a grid fixed in the bone's frame, then interpolated by quadratic B-splines, so that
//! value, gradient and curvature cost the same wherever the point lies, and the force is the gradient of an energy.
//!
//! The distance is signed by the surface's outward normals. Beyond the rim of an open patch a point is pushed out of contact over
//! [`RIM`] mm: nothing behind or beside the patch is ever in contact.

use super::cells::Cells;
use crate::error::SimError;
use crate::portable;
use meshes::query::Nearest;
use meshes::surface::TriMesh;
use meshes::topology::Topology;
use meshes::{Isometry, Point, Vector};
use nalgebra::Matrix3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Grid spacing [mm].
const SPACING: f64 = 0.75;
/// Grid nodes along an edge of a block that is sampled as a whole.
const BLOCK: usize = 4;
/// Depth [mm] below and height above the surface to which the distance is sampled exactly.
const BAND: [f64; 2] = [5.0, 2.5];
/// Breadth of the fading beyond a rim [mm].
const RIM: f64 = 1.0;
/// Numbers between this and twice as much have a spacing of 1.
const WHOLE: f64 = 4503599627370496.0;
/// More grid nodes than this are refused: a surface of absurd size.
const MOST_NODES: usize = 60_000_000;

/// The sampled distance.
#[derive(Clone, Debug)]
pub struct Field {
    /// Grid coordinates (local, mm) from CT coordinates in the CT pose.
    pub local_from_ct: Isometry,
    /// First node [grid spacings].
    low: [f64; 3],
    size: [usize; 3],
    /// Last node but one, counted from the first.
    high: [f64; 3],
    coefficients: Vec<f32>,
    /// Coefficients of the thickness of the layer below the nearest point of the surface; empty where nothing gives way.
    thickness: Vec<f32>,
    /// How far the points nearest to each grid node are from contact.
    cells: Cells,
    /// By axis, whether contact may lie at the grid's first and last cells: behind an open patch everything is deep, as far as the grid reaches.
    open: [[bool; 2]; 3],
}

/// Distance, gradient, second derivatives (xx, xy, xz, yy, yz, zz).
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Signed distance [mm], positive outside.
    pub distance: f64,
    /// Its gradient [-], grid frame.
    pub gradient: [f64; 3],
    /// Its second derivatives [1/mm], grid frame.
    pub hessian: [f64; 6],
}

impl Field {
    /// Samples the distance from `surface` (CT coordinates) on a grid fixed in `local_from_ct`.
    pub fn new(surface: &TriMesh, local_from_ct: Isometry, name: &str) -> Result<Field, SimError> {
        Field::with_thickness(surface, &[], local_from_ct, name)
    }

    /// [`Field::new`] with the thickness of the layer at each vertex [mm]; none given: nothing gives way.
    pub(crate) fn with_thickness(
        surface: &TriMesh,
        thickness: &[f64],
        local_from_ct: Isometry,
        name: &str,
    ) -> Result<Field, SimError> {
        let local = surface.moved(&local_from_ct);
        let exact = Exact::new(&local, name)?;
        let (lo, hi) = local.bounds().ok_or_else(|| SimError::Spec(format!("surface {name} is empty")))?;
        let pad = BAND[1] + SPACING * (BLOCK as f64 + 2.0);
        let low: [f64; 3] = std::array::from_fn(|k| ((lo[k] - pad) / SPACING).floor());
        let blocks: [usize; 3] =
            std::array::from_fn(|k| (((hi[k] + pad) / SPACING).ceil() - low[k]) as usize / BLOCK + 1);
        let size = blocks.map(|b| b * BLOCK);
        if size.iter().try_fold(1usize, |a, b| a.checked_mul(*b)).is_none_or(|n| n > MOST_NODES) {
            return Err(SimError::Spec(format!("surface {name} is {:.0} mm across; is it in mm?", (hi - lo).norm())));
        }
        let mut field = Field {
            local_from_ct,
            low,
            size,
            high: size.map(|n| n as f64 - 2.0),
            coefficients: Vec::new(),
            thickness: Vec::new(),
            cells: Cells::default(),
            open: Default::default(),
        };
        let (distances, thicknesses) = field.sample_blocks(&exact, blocks, thickness);
        field.coefficients = field.prefiltered(&distances);
        field.cells = Cells::new(&field.coefficients, field.size, SPACING);
        field.open = field.open_faces();
        if !thicknesses.is_empty() {
            field.thickness = field.prefiltered(&thicknesses);
            field.thickness.push(0.0);
        }
        // the last row is read to its register's end
        field.coefficients.push(0.0);
        Ok(field)
    }

    /// Exact distances in the blocks near the surface, that of the block's centre in the others; and the thickness there, given at vertices,
    /// where it is.
    fn sample_blocks(&self, exact: &Exact, blocks: [usize; 3], thickness: &[f64]) -> (Vec<f32>, Vec<f32>) {
        let [nx, ny, nz] = self.size;
        let node = |i: usize, j: usize, k: usize| {
            let at = |a: usize, i: f64| (self.low[a] + i) * SPACING;
            Point::new(at(0, i as f64), at(1, j as f64), at(2, k as f64))
        };
        let reach = SPACING * BLOCK as f64 * 3f64.sqrt() / 2.0 + 2.0 * SPACING;
        let layered = if thickness.is_empty() { 0 } else { nx * ny * BLOCK };
        let slabs: Vec<(Vec<f32>, Vec<f32>)> = (0..blocks[2])
            .into_par_iter()
            .map(|bz| {
                let (mut slab, mut below) = (vec![0f32; nx * ny * BLOCK], vec![0f32; layered]);
                for by in 0..blocks[1] {
                    for bx in 0..blocks[0] {
                        let corner = [bx * BLOCK, by * BLOCK, bz * BLOCK];
                        let half = Vector::repeat((BLOCK as f64 - 1.0) / 2.0 * SPACING);
                        let middle = node(corner[0], corner[1], corner[2]) + half;
                        let mut last = (middle, exact.near(&middle, f64::INFINITY));
                        let centre = exact.at(&middle, &last.1, thickness);
                        let near = centre.0 > -BAND[0] - reach && centre.0 < BAND[1] + reach;
                        for n in 0..BLOCK.pow(3) {
                            let (i, j, k) = (n % BLOCK, n / BLOCK % BLOCK, n / BLOCK / BLOCK);
                            let p = node(corner[0] + i, corner[1] + j, corner[2] + k);
                            let (distance, thick) = if near {
                                // no further from it than the point before by more than the way between
                                let known = last.1.distance + (p - last.0).norm() + 1e-9;
                                last = (p, exact.near(&p, known));
                                exact.at(&p, &last.1, thickness)
                            } else {
                                centre
                            };
                            let at = (k * ny + corner[1] + j) * nx + corner[0] + i;
                            slab[at] = distance as f32;
                            if let Some(slot) = below.get_mut(at) {
                                *slot = thick as f32;
                            }
                        }
                    }
                }
                (slab, below)
            })
            .collect();
        debug_assert_eq!(slabs.iter().map(|s| s.0.len()).sum::<usize>(), nx * ny * nz);
        let (distances, thicknesses): (Vec<_>, Vec<_>) = slabs.into_iter().unzip();
        (distances.concat(), thicknesses.concat())
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

    /// Lower bound of the distance [mm] from a local point to anything deeper than `start`.
    #[inline]
    pub(crate) fn apart(&self, p: &[f64; 3], start: f64) -> f64 {
        self.cell(p).map_or_else(|| self.beyond(p, start), |(at, _)| self.cells.apart(at, start))
    }

    /// Lower bound of the motion [mm] without which a local point cannot come deeper than `start`.
    #[inline]
    pub(crate) fn clearance(&self, p: &[f64; 3], start: f64) -> f64 {
        self.cell(p).map_or_else(|| self.beyond(p, start), |(at, offset)| self.cells.clearance(at, &offset, start))
    }

    /// By axis, whether any of the first and of the last cells may be in contact.
    fn open_faces(&self) -> [[bool; 2]; 3] {
        let last = self.size.map(|n| n - 2);
        let mut open = [[false; 2]; 3];
        for k in 1..=last[2] {
            for j in 1..=last[1] {
                for i in 1..=last[0] {
                    let place = [i, j, k];
                    let at_face = (0..3).any(|a| place[a] == 1 || place[a] == last[a]);
                    if at_face && self.cells.may_touch((k * self.size[1] + j) * self.size[0] + i) {
                        for a in 0..3 {
                            open[a][0] |= place[a] == 1;
                            open[a][1] |= place[a] == last[a];
                        }
                    }
                }
            }
        }
        open
    }

    /// Lower bound of the distance [mm] from a point off the grid to anything deeper than `start`: to the nearest face behind which there may be contact.
    #[inline(never)]
    fn beyond(&self, p: &[f64; 3], start: f64) -> f64 {
        let x: [f64; 3] = std::array::from_fn(|a| p[a] / SPACING - self.low[a]);
        let off: [f64; 3] = std::array::from_fn(|a| (x[a] - x[a].clamp(1.0, self.high[a])).powi(2));
        let bounds = Cells::bounds(start);
        let mut least = f64::INFINITY;
        for a in 0..3 {
            let beside = off[(a + 1) % 3] + off[(a + 2) % 3];
            for (face, open) in [1.0, self.high[a]].into_iter().zip(self.open[a]) {
                if open || !bounds {
                    least = least.min(beside + (x[a] - face).powi(2));
                }
            }
        }
        least.sqrt() * SPACING
    }

    /// Three coefficients along x, at `j`, `k` of the 27 around a cell's node, and the one after, which fills a processor's register.
    #[inline(always)]
    fn row(&self, of: &[f32], at: usize, j: usize, k: usize) -> Row {
        let [nx, ny, _] = self.size;
        let start = at + k * nx * ny + j * nx - nx * ny - nx - 1;
        let row = &of[start..start + 4];
        [f64::from(row[0]), f64::from(row[1]), f64::from(row[2]), f64::from(row[3])]
    }

    /// The grid cell of a local point and its offset from the nearest node; `None` outside.
    #[inline]
    fn cell(&self, p: &[f64; 3]) -> Option<(usize, [f64; 3])> {
        let mut index = [0usize; 3];
        let mut offset = [0.0; 3];
        for a in 0..3 {
            let x = p[a] * (1.0 / SPACING) - self.low[a];
            if !(x > 1.0 && x < self.high[a]) {
                return None;
            }
            // the sum is rounded to a whole number, which its last bits hold
            let rounded = x + WHOLE;
            index[a] = rounded.to_bits() as u32 as usize;
            offset[a] = x - (rounded - WHOLE);
        }
        Some(((index[2] * self.size[1] + index[1]) * self.size[0] + index[0], offset))
    }

    /// Distance and derivatives, the second ones where `CURVED`, at a local point; `None` where it is above `highest` or off the grid.
    #[inline]
    pub(crate) fn sample<const CURVED: bool>(&self, p: &[f64; 3], highest: f64) -> Option<Sample> {
        let (at, offset) = self.cell(p)?;
        self.spline::<CURVED>(&self.coefficients, (at, &offset.map(weights)), highest)
    }

    /// [`Field::sample`], and the thickness of the layer below the nearest point of the surface with its derivatives [mm], as `distance`; 0 where
    /// nothing gives way.
    #[inline]
    pub(super) fn sample_layered<const CURVED: bool>(&self, p: &[f64; 3], highest: f64) -> Option<(Sample, Sample)> {
        let (at, offset) = self.cell(p)?;
        let weights = offset.map(weights);
        let distance = self.spline::<CURVED>(&self.coefficients, (at, &weights), highest)?;
        let below = if self.thickness.is_empty() {
            Some(Sample { distance: 0.0, gradient: [0.0; 3], hessian: [0.0; 6] })
        } else {
            self.spline::<CURVED>(&self.thickness, (at, &weights), f64::INFINITY)
        };
        Some((distance, below?))
    }

    /// The spline of some coefficients in a cell, by the weights and their derivatives along each axis; `None` where it is above `highest`.
    #[inline(always)]
    fn spline<const CURVED: bool>(
        &self,
        of: &[f32],
        (at, weights): (usize, &[Weights; 3]),
        highest: f64,
    ) -> Option<Sample> {
        let [(wx, dx), (wy, dy), (wz, dz)] = *weights;
        // rows along x are summed along y, then along z, then contracted: a row at a time is what a processor does at once
        let (mut value, mut slope, mut curve) = ([ZEROS; 3], [ZEROS; 3], [ZEROS; 3]);
        for k in 0..3 {
            for j in 0..3 {
                let row = self.row(of, at, j, k);
                add(&mut value[k], &row, wy[j]);
                add(&mut slope[k], &row, dy[j]);
                if CURVED {
                    add(&mut curve[k], &row, CURVE[j]);
                }
            }
        }
        let (here, by_y, by_z) = (sum(&value, &wz), sum(&slope, &wz), sum(&value, &dz));
        let distance = along(&here, &wx);
        if distance > highest {
            return None;
        }
        let (g, h) = (1.0 / SPACING, 1.0 / (SPACING * SPACING));
        let hessian = if CURVED {
            [
                along(&here, &CURVE) * h,
                along(&by_y, &dx) * h,
                along(&by_z, &dx) * h,
                along(&sum(&curve, &wz), &wx) * h,
                along(&sum(&slope, &dz), &wx) * h,
                along(&sum(&value, &CURVE), &wx) * h,
            ]
        } else {
            [0.0; 6]
        };
        let gradient = [along(&here, &dx) * g, along(&by_y, &wx) * g, along(&by_z, &wx) * g];
        Some(Sample { distance, gradient, hessian })
    }
}

/// Numbers at nodes along x; the last is of no use.
type Row = [f64; 4];
const ZEROS: Row = [0.0; 4];

#[inline(always)]
fn add(to: &mut Row, row: &Row, weight: f64) {
    for (to, x) in to.iter_mut().zip(row) {
        *to += x * weight;
    }
}

/// The weighted sum of three rows.
#[inline(always)]
fn sum(rows: &[Row; 3], weights: &[f64; 3]) -> Row {
    let mut out = ZEROS;
    for (row, w) in rows.iter().zip(weights) {
        add(&mut out, row, *w);
    }
    out
}

#[inline(always)]
fn along(row: &Row, weights: &[f64; 3]) -> f64 {
    row[0] * weights[0] + row[1] * weights[1] + row[2] * weights[2]
}

/// Second derivative of the spline's three weights.
const CURVE: [f64; 3] = [1.0, -2.0, 1.0];

/// Weights of three nodes, and their derivatives.
type Weights = ([f64; 3], [f64; 3]);

/// Weights of the three nodes around offset `t` in [-1/2, 1/2], and their derivatives.
#[inline]
fn weights(t: f64) -> Weights {
    let (a, b) = (0.5 - t, 0.5 + t);
    ([a * a / 2.0, 0.75 - t * t, b * b / 2.0], [-a, -2.0 * t, b])
}

/// Exact signed distance from a triangle surface, with the rim's fading.
struct Exact {
    query: meshes::query::SurfaceQuery,
    triangles: Vec<[u32; 3]>,
    face: Vec<Vector>,
    vertex: Vec<Vector>,
    rim: BTreeSet<(u32, u32)>,
    rim_vertex: Vec<bool>,
}

impl Exact {
    fn new(mesh: &TriMesh, name: &str) -> Result<Exact, SimError> {
        check(mesh, name)?;
        let query = meshes::query::SurfaceQuery::new(mesh)
            .ok_or_else(|| SimError::Spec(format!("surface {name} has no triangles")))?;
        let face = mesh.triangle_normals();
        let mut vertex = vec![Vector::zeros(); mesh.vertices.len()];
        let mut count = std::collections::BTreeMap::new();
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let p = mesh.corners(t);
            for k in 0..3 {
                let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                vertex[triangle[k] as usize] += face[t] * u.angle(&v);
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                *count.entry((a.min(b), a.max(b))).or_insert(0) += 1;
            }
        }
        let rim: BTreeSet<(u32, u32)> = count.into_iter().filter(|&(_, n)| n == 1).map(|(e, _)| e).collect();
        let mut rim_vertex = vec![false; mesh.vertices.len()];
        rim.iter().for_each(|&(a, b)| (rim_vertex[a as usize], rim_vertex[b as usize]) = (true, true));
        vertex.iter_mut().for_each(|n| *n = n.try_normalize(0.0).unwrap_or_default());
        Ok(Exact { query, triangles: mesh.triangles.clone(), face, vertex, rim, rim_vertex })
    }

    /// The nearest point of the surface, known to lie nearer than `known` [mm].
    fn near(&self, p: &Point, known: f64) -> Nearest {
        if known.is_finite() { self.query.nearest_within(p, known) } else { self.query.nearest(p) }
    }

    /// Distance, and at the nearest point of the surface the thickness, given at vertices; 0 without any.
    fn at(&self, p: &Point, near: &Nearest, thickness: &[f64]) -> (f64, f64) {
        let corners = self.triangles[near.triangle as usize];
        let share = |k: usize| near.barycentric[k] * thickness.get(corners[k] as usize).copied().unwrap_or(0.0);
        (self.distance(p, near), (0..3).map(share).sum())
    }

    fn distance(&self, p: &Point, near: &Nearest) -> f64 {
        let t = near.triangle as usize;
        let corner = self.triangles[t];
        let on: Vec<usize> = (0..3).filter(|&k| near.barycentric[k] > 1e-9).collect();
        let v = p - near.point;
        let (normal, at_rim) = match on.as_slice() {
            [k] => (self.vertex[corner[*k] as usize], self.rim_vertex[corner[*k] as usize]),
            [j, k] => {
                let (a, b) = (corner[*j].min(corner[*k]), corner[*j].max(corner[*k]));
                let rim = self.rim.contains(&(a, b));
                (if rim { self.face[t] } else { self.vertex[a as usize] + self.vertex[b as usize] }, rim)
            }
            _ => (self.face[t], false),
        };
        let height = v.dot(&normal);
        if height >= 0.0 {
            return near.distance;
        }
        if !at_rim {
            return -near.distance;
        }
        let beyond = (v - normal * height).norm();
        height * (1.0 - beyond / RIM).max(0.0) + beyond
    }
}

/// Refuses surfaces that cannot carry contact.
fn check(mesh: &TriMesh, name: &str) -> Result<(), SimError> {
    let fault = |m: String| Err(SimError::Spec(format!("surface {name}: {m}")));
    if let Some(i) = mesh.vertices.iter().position(|p| !p.coords.iter().all(|x| x.abs() < 1e6)) {
        return fault(format!("vertex {i} is not finite"));
    }
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= mesh.vertices.len())) {
        return fault(format!("triangle {t} names a vertex that is not there"));
    }
    let topology = Topology::of(mesh);
    if topology.irregular_edges > 0 {
        return fault(format!(
            "{} edges join triangles turned opposite ways; orient the surface outwards",
            topology.irregular_edges
        ));
    }
    if topology.boundary_edges == 0 && mesh.volume() < 0.0 {
        return fault("closed but inside out; turn its triangles over".into());
    }
    Ok(())
}

/// Frame whose axes are (medial or lateral, anterior, superior), right-handed, origin in the bone's frame: the grid moves with the bone.
pub fn bone_frame(frame: &meshes::frame::AnatomicalFrame) -> Isometry {
    let first = frame.anterior.cross(&frame.superior);
    let rows = Matrix3::from_rows(&[first.transpose(), frame.anterior.transpose(), frame.superior.transpose()]);
    let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&portable::nearest_rotation(&rows));
    Isometry::from_parts((-(turn * frame.origin.coords)).into(), turn)
}

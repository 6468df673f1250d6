//! Flattening a sheet of surface to the plane with little distortion.

use crate::surface::TriMesh;
use crate::topology::vertex_neighbours;
use crate::{Point, Vector};
use nalgebra::{DMatrix, SymmetricEigen};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A point of the flattened sheet [mm].
pub type Flat = nalgebra::Point2<f64>;

/// Landmarks of the first layout.
const LANDMARKS: usize = 80;
/// Rounds of the refinement.
const ROUNDS: usize = 60;
/// Steps of the linear solver in each round.
const SOLVER_STEPS: usize = 40;
/// Cotangent weights below this count as this, so that the system stays positive definite.
const SMALLEST_COTANGENT: f64 = 0.05;

/// The vertices of a connected sheet laid out in the plane, triangles counter-clockwise, lengths kept as well as may be.
///
/// First layout: landmark multidimensional scaling of distances along edges [desilva2004]; refined as rigidly as
/// possible [liu2008], cotangents clamped from below. Both see lengths alone, so moving the sheet changes nothing.
/// `None` for a sheet without two extents, or not connected. Cost O(n) a round.
pub fn flatten(sheet: &TriMesh) -> Option<Vec<Flat>> {
    let mut flat = first_layout(sheet)?;
    let doubled: f64 = sheet.triangles.iter().map(|t| doubled_area(&flat, t)).sum();
    if doubled < 0.0 {
        flat.iter_mut().for_each(|p| p.y = -p.y);
    }
    let rest: Vec<Rest> = (0..sheet.triangles.len()).map(|t| Rest::of(sheet, t)).collect();
    for _ in 0..ROUNDS {
        rigid_round(sheet, &rest, &mut flat);
    }
    flat.iter().all(|p| p.x.is_finite() && p.y.is_finite()).then_some(flat)
}

/// Twice the signed area of a flattened triangle [mm2].
pub fn doubled_area(flat: &[Flat], triangle: &[u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|v| flat[v as usize]);
    (b - a).perp(&(c - a))
}

fn first_layout(sheet: &TriMesh) -> Option<Vec<Flat>> {
    let n = sheet.vertices.len();
    if n < 3 || sheet.triangles.is_empty() {
        return None;
    }
    let neighbours = vertex_neighbours(sheet);
    let (landmarks, distances) = landmark_distances(sheet, &neighbours)?;
    let k = landmarks.len();
    let squared = DMatrix::from_fn(k, k, |i, j| distances[i][landmarks[j]].powi(2));
    let row_mean: Vec<f64> = (0..k).map(|i| squared.row(i).sum() / k as f64).collect();
    let mean = row_mean.iter().sum::<f64>() / k as f64;
    let gram = DMatrix::from_fn(k, k, |i, j| {
        0.5 * (row_mean[i] + row_mean[j] - mean - 0.5 * (squared[(i, j)] + squared[(j, i)]))
    });
    let eigen = SymmetricEigen::new(gram);
    let mut order: Vec<usize> = (0..k).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let axes = [*order.first()?, *order.get(1)?];
    if eigen.eigenvalues[axes[1]] <= 1e-9 * eigen.eigenvalues[axes[0]].max(f64::MIN_POSITIVE) {
        return None;
    }
    let place = |v: usize, axis: usize| {
        let sum: f64 = (0..k).map(|i| eigen.eigenvectors[(i, axis)] * (distances[i][v].powi(2) - row_mean[i])).sum();
        -0.5 * sum / eigen.eigenvalues[axis].sqrt()
    };
    Some((0..n).map(|v| Flat::new(place(v, axes[0]), place(v, axes[1]))).collect())
}

/// Landmarks spread by farthest-point sampling and the distance of every vertex from each; `None` when not connected.
fn landmark_distances(sheet: &TriMesh, neighbours: &[Vec<u32>]) -> Option<(Vec<usize>, Vec<Vec<f64>>)> {
    // Distances within rounding count as equal, so that a moved sheet gets the same landmarks.
    let coarse = |d: f64| (d * 1e6).round();
    let farthest = |d: &[f64]| (0..d.len()).max_by(|&a, &b| coarse(d[a]).total_cmp(&coarse(d[b])).then(b.cmp(&a)));
    let first = farthest(&along_edges(sheet, neighbours, 0))?;
    let (mut landmarks, mut distances) = (vec![first], vec![along_edges(sheet, neighbours, first)]);
    let mut nearest = distances[0].clone();
    if nearest.iter().any(|d| !d.is_finite()) {
        return None;
    }
    while landmarks.len() < LANDMARKS.min(sheet.vertices.len()) {
        let next = farthest(&nearest)?;
        let from_next = along_edges(sheet, neighbours, next);
        nearest.iter_mut().zip(&from_next).for_each(|(a, b)| *a = a.min(*b));
        landmarks.push(next);
        distances.push(from_next);
    }
    Some((landmarks, distances))
}

/// Shortest way along edges from `start` to every vertex [mm].
fn along_edges(sheet: &TriMesh, neighbours: &[Vec<u32>], start: usize) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; sheet.vertices.len()];
    distance[start] = 0.0;
    // Bits of non-negative floats order as the floats do.
    let mut queue = BinaryHeap::from([Reverse((0u64, start as u32))]);
    while let Some(Reverse((bits, v))) = queue.pop() {
        let d = f64::from_bits(bits);
        if d > distance[v as usize] {
            continue;
        }
        for &w in &neighbours[v as usize] {
            let through = d + (sheet.vertices[v as usize] - sheet.vertices[w as usize]).norm();
            if through < distance[w as usize] {
                distance[w as usize] = through;
                queue.push(Reverse((through.to_bits(), w)));
            }
        }
    }
    distance
}

/// A triangle at rest in its own plane: edge k leads from corner k to k + 1, `weight` is the cotangent opposite.
struct Rest {
    edges: [nalgebra::Vector2<f64>; 3],
    weights: [f64; 3],
}

impl Rest {
    fn of(sheet: &TriMesh, t: usize) -> Rest {
        let [a, b, c]: [Point; 3] = sheet.corners(t);
        let (ab, ac): (Vector, Vector) = (b - a, c - a);
        let x = ab.try_normalize(0.0).unwrap_or_else(Vector::zeros);
        let (cx, cy) = (ac.dot(&x), (ac - x * ac.dot(&x)).norm());
        let corners = [Flat::origin(), Flat::new(ab.norm(), 0.0), Flat::new(cx, cy)];
        let edges = [0, 1, 2].map(|k| corners[(k + 1) % 3] - corners[k]);
        let area = edges[0].perp(&-edges[2]).abs().max(f64::MIN_POSITIVE);
        let weights = [0, 1, 2].map(|k| {
            let cotangent = -edges[(k + 1) % 3].dot(&edges[(k + 2) % 3]) / area;
            if cotangent.is_finite() { cotangent.clamp(SMALLEST_COTANGENT, 1.0 / SMALLEST_COTANGENT) } else { 1.0 }
        });
        Rest { edges, weights }
    }
}

/// One local step (best rotation of each triangle) and one global step (all positions at once).
fn rigid_round(sheet: &TriMesh, rest: &[Rest], flat: &mut [Flat]) {
    let mut wanted = vec![nalgebra::Vector2::zeros(); flat.len()];
    for (t, r) in sheet.triangles.iter().zip(rest) {
        let (mut along, mut across) = (0.0, 0.0);
        for k in 0..3 {
            let now = flat[t[(k + 1) % 3] as usize] - flat[t[k] as usize];
            along += r.weights[k] * r.edges[k].dot(&now);
            across += r.weights[k] * r.edges[k].perp(&now);
        }
        let turn = nalgebra::Rotation2::new(across.atan2(along));
        for k in 0..3 {
            let pull = r.weights[k] * (turn * r.edges[k]);
            wanted[t[(k + 1) % 3] as usize] += pull;
            wanted[t[k] as usize] -= pull;
        }
    }
    solve(sheet, rest, &wanted, flat);
}

/// Conjugate gradients on the weighted Laplacian, from the present positions; the mean stays where it is.
fn solve(sheet: &TriMesh, rest: &[Rest], wanted: &[nalgebra::Vector2<f64>], flat: &mut [Flat]) {
    type V = Vec<nalgebra::Vector2<f64>>;
    let laplacian = |x: &V| {
        let mut y: V = vec![nalgebra::Vector2::zeros(); x.len()];
        for (t, r) in sheet.triangles.iter().zip(rest) {
            for k in 0..3 {
                let (i, j) = (t[k] as usize, t[(k + 1) % 3] as usize);
                let pull = r.weights[k] * (x[j] - x[i]);
                y[j] += pull;
                y[i] -= pull;
            }
        }
        y
    };
    let mut diagonal = vec![f64::MIN_POSITIVE; flat.len()];
    for (t, r) in sheet.triangles.iter().zip(rest) {
        for k in 0..3 {
            diagonal[t[k] as usize] += r.weights[k];
            diagonal[t[(k + 1) % 3] as usize] += r.weights[k];
        }
    }
    let dot = |a: &V, b: &V| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
    let precondition = |r: &V| -> V { r.iter().zip(&diagonal).map(|(r, d)| r / *d).collect() };
    let mut x: V = flat.iter().map(|p| p.coords).collect();
    let mut residual: V = wanted.iter().zip(laplacian(&x)).map(|(b, a)| b - a).collect();
    let mut z = precondition(&residual);
    let mut direction = z.clone();
    let mut size = dot(&residual, &z);
    let stop = 1e-16 * size;
    for _ in 0..SOLVER_STEPS {
        let image = laplacian(&direction);
        let curvature = dot(&direction, &image);
        if size <= stop || curvature <= 0.0 {
            break;
        }
        let step = size / curvature;
        for i in 0..x.len() {
            x[i] += step * direction[i];
            residual[i] -= step * image[i];
        }
        z = precondition(&residual);
        let next = dot(&residual, &z);
        let keep = next / size;
        direction.iter_mut().zip(&z).for_each(|(d, z)| *d = z + keep * *d);
        size = next;
    }
    flat.iter_mut().zip(x).for_each(|(p, x)| *p = Flat::from(x));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Isometry;

    /// A sheet of squares bent about an axis of radius `radius` [mm].
    fn bent_sheet(radius: f64) -> TriMesh {
        let (columns, rows) = (25u32, 15u32);
        let place = |i: u32, j: u32| {
            let angle = f64::from(i) / radius;
            Point::new(radius * angle.sin(), f64::from(j), radius * angle.cos())
        };
        let mut mesh = TriMesh::default();
        for j in 0..rows {
            mesh.vertices.extend((0..columns).map(|i| place(i, j)));
        }
        for j in 0..rows - 1 {
            for i in 0..columns - 1 {
                let a = j * columns + i;
                mesh.triangles.extend([[a, a + 1, a + columns + 1], [a, a + columns + 1, a + columns]]);
            }
        }
        mesh
    }

    #[test]
    fn a_bent_sheet_unrolls_without_stretch_wherever_it_lies() {
        let sheet = bent_sheet(6.0);
        let moved = sheet.moved(&Isometry::new(Vector::new(5.0, -80.0, 30.0), Vector::new(0.4, 1.1, -0.6)));
        let (flat, flat_moved) = (flatten(&sheet).unwrap(), flatten(&moved).unwrap());
        for t in &sheet.triangles {
            assert!(doubled_area(&flat, t) > 0.0);
            for k in 0..3 {
                let (i, j) = (t[k] as usize, t[(k + 1) % 3] as usize);
                let rest = (sheet.vertices[i] - sheet.vertices[j]).norm();
                assert!(((flat[i] - flat[j]).norm() / rest - 1.0).abs() < 0.01);
                assert!(((flat[i] - flat[j]).norm() - (flat_moved[i] - flat_moved[j]).norm()).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn what_is_not_a_sheet_is_refused() {
        assert!(flatten(&TriMesh::default()).is_none());
        let line = TriMesh {
            vertices: (0..4).map(|i| Point::new(f64::from(i), 0.0, 0.0)).collect(),
            triangles: vec![[0, 1, 2], [1, 2, 3]],
        };
        assert!(flatten(&line).is_none());
        let two = TriMesh::joined([&bent_sheet(5.0), &bent_sheet(5.0)]);
        assert!(flatten(&two).is_none());
    }
}

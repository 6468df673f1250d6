//! The surface on which a scalar field is zero, by naive surface nets in f64 [gibson1998].

use crate::surface::TriMesh;
use crate::{Point, Vector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// The zero surface of `field` (negative inside) within the box from `low` to `high` [mm], on a grid of `spacing` [mm].
///
/// A vertex lies in each cell that the surface crosses, at the mean of its edges' crossings, then moved onto the surface by
/// two Newton steps along the field's gradient. Normals point to where the field is positive. Closed where the field is
/// positive all along the box; every edge has two triangles where the field is smooth at the scale of a cell.
/// `None` when the grid would have more than 100 million points or the box or spacing is no size.
pub fn surface_net(field: &(impl Fn(&Point) -> f64 + Sync), low: Point, high: Point, spacing: f64) -> Option<TriMesh> {
    let size = (high - low) / spacing;
    if !(spacing > 0.0 && size.iter().all(|x| x.is_finite() && *x >= 1.0) && size.product() < 1e8) {
        return None;
    }
    let n: [usize; 3] = std::array::from_fn(|k| size[k].ceil() as usize + 1);
    let at = |i: usize, j: usize, k: usize| low + Vector::new(i as f64, j as f64, k as f64) * spacing;
    let slices: Vec<Vec<f64>> = (0..n[2])
        .into_par_iter()
        .map(|k| (0..n[0] * n[1]).map(|c| field(&at(c % n[0], c / n[0], k))).collect())
        .collect();
    let value = |c: [usize; 3]| slices[c[2]][c[1] * n[0] + c[0]];
    let mut cells = BTreeMap::new();
    let mut mesh = TriMesh::default();
    for k in 0..n[2] - 1 {
        for j in 0..n[1] - 1 {
            for i in 0..n[0] - 1 {
                if let Some(place) = crossing([i, j, k], &value) {
                    cells.insert([i, j, k], mesh.vertices.len() as u32);
                    mesh.vertices.push(low + place * spacing);
                }
            }
        }
    }
    mesh.vertices.par_iter_mut().for_each(|p| *p = settled(field, *p, spacing));
    for &cell in cells.keys() {
        for axis in 0..3 {
            quad(cell, axis, &value, &cells, &mut mesh);
        }
    }
    Some(mesh)
}

/// Mean crossing of a cell's edges, in grid units.
fn crossing(cell: [usize; 3], value: &impl Fn([usize; 3]) -> f64) -> Option<Vector> {
    let corner = |c: usize| [cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2 & 1)];
    let values: [f64; 8] = std::array::from_fn(|c| value(corner(c)));
    let place = |c: usize| Vector::from(corner(c).map(|x| x as f64));
    let (mut sum, mut count) = (Vector::zeros(), 0.0);
    for a in 0..8 {
        for b in [a | 1, a | 2, a | 4] {
            if b != a && (values[a] < 0.0) != (values[b] < 0.0) {
                let t = values[a] / (values[a] - values[b]);
                sum += place(a) + (place(b) - place(a)) * t;
                count += 1.0;
            }
        }
    }
    (count > 0.0).then(|| sum / count)
}

fn settled(field: &impl Fn(&Point) -> f64, mut p: Point, spacing: f64) -> Point {
    let h = 0.05 * spacing;
    for _ in 0..2 {
        let gradient = Vector::from_fn(|k, _| {
            let mut step = Vector::zeros();
            step[k] = h;
            (field(&(p + step)) - field(&(p - step))) / (2.0 * h)
        });
        let step = gradient * (field(&p) / gradient.norm_squared().max(1e-12));
        // Beyond a quarter of a cell the field has an edge, where Newton goes astray.
        p -= step * (0.25 * spacing / step.norm().max(0.25 * spacing));
    }
    p
}

/// The two triangles across the grid edge that leaves `cell`'s corner along `axis`, if the field changes sign on it.
fn quad(
    cell: [usize; 3],
    axis: usize,
    value: &impl Fn([usize; 3]) -> f64,
    cells: &BTreeMap<[usize; 3], u32>,
    mesh: &mut TriMesh,
) {
    let mut end = cell;
    end[axis] += 1;
    let inside = value(cell) < 0.0;
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    if inside == (value(end) < 0.0) || cell[u] == 0 || cell[v] == 0 {
        return;
    }
    let around = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(du, dv)| {
        let mut c = cell;
        c[u] -= du;
        c[v] -= dv;
        cells.get(&c).copied()
    });
    let [Some(a), Some(b), Some(c), Some(d)] = around else { return };
    let corners = if inside { [a, b, c, d] } else { [d, c, b, a] };
    let [p, q, r, s] = corners.map(|x| mesh.vertices[x as usize]);
    let [a, b, c, d] = corners;
    if (p - r).norm_squared() <= (q - s).norm_squared() {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    } else {
        mesh.triangles.extend([[a, b, d], [b, c, d]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::Topology;

    #[test]
    fn a_sphere_is_closed_outward_and_exact_at_its_vertices() {
        let field = |p: &Point| p.coords.norm() - 10.0;
        let mesh = surface_net(&field, Point::new(-12.0, -12.5, -13.0), Point::new(12.0, 12.0, 12.0), 0.9).unwrap();
        let topology = Topology::of(&mesh);
        assert!(topology.is_closed());
        assert_eq!(topology.euler_characteristic, 2);
        assert!((mesh.volume() / (4000.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 0.01);
        assert!(mesh.vertices.iter().all(|p| field(p).abs() < 1e-6));
    }

    #[test]
    fn no_size_no_surface() {
        let field = |p: &Point| p.x;
        assert!(surface_net(&field, Point::origin(), Point::new(1.0, 1.0, 1.0), 0.0).is_none());
        assert!(surface_net(&field, Point::origin(), Point::new(1e9, 1e9, 1e9), 1.0).is_none());
    }
}

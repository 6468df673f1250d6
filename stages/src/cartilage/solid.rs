//! From a patch of bone and the scan above it to a closed solid.

use super::region::Patch;
use super::{CartilageOptions, CartilageSolid};
use crate::StageError;
use meshes::holes::boundary_loops;
use meshes::query::SurfaceQuery;
use meshes::remesh::{RemeshOptions, remesh};
use meshes::surface::TriMesh;
use meshes::topology::{Topology, vertex_neighbours};
use meshes::{Point, Vector};
use rayon::prelude::*;

const BONY: u32 = 0;
const ARTICULAR: u32 = 1;

/// Extrudes `patch`, meshes it evenly and fits its articular face to the scan.
pub(super) fn solid(
    bone: &str,
    patch: &Patch,
    scan: &TriMesh,
    options: &CartilageOptions,
) -> Result<CartilageSolid, StageError> {
    let fail = |why: &str| {
        StageError::part("cartilage", format_args!("a solid of the {bone} {why}; look at the registered scan there"))
    };
    let walls = SurfaceQuery::new(scan).ok_or_else(|| fail("has no scan"))?;
    let (mut mesh, mut labels) = extruded(patch);
    for rounds in [3, 2] {
        let wanted = RemeshOptions { edge_mm: options.edge_mm, rounds };
        (mesh, labels) = remesh(&mesh, &labels, &wanted).map_err(|e| fail(&format!("cannot be meshed ({e})")))?;
        fit(&mut mesh, &labels, &walls);
    }
    with_thickness(mesh, &labels).map_err(|why| fail(&why))
}

/// Meshes evenly a body whose triangles are `of_scan` or of the bone.
pub(super) fn finished(
    bone: &str,
    mesh: &TriMesh,
    of_scan: &[bool],
    options: &CartilageOptions,
) -> Result<CartilageSolid, StageError> {
    let fail = |why: &str| {
        StageError::part("cartilage", format_args!("a solid of the {bone} {why}; look at the registered scan there"))
    };
    let labels: Vec<u32> = of_scan.iter().map(|s| if *s { ARTICULAR } else { BONY }).collect();
    let wanted = RemeshOptions { edge_mm: options.edge_mm, rounds: 4 };
    let (mesh, labels) = remesh(mesh, &labels, &wanted).map_err(|e| fail(&format!("cannot be meshed ({e})")))?;
    with_thickness(mesh, &labels).map_err(|why| fail(&why))
}

/// The solid with its thickness; refused where it is not one closed body of two faces.
fn with_thickness(mesh: TriMesh, labels: &[u32]) -> Result<CartilageSolid, String> {
    let topology = Topology::of(&mesh);
    if !topology.is_closed() || topology.components != 1 {
        return Err("is not one closed body".into());
    }
    if mesh.volume() <= 0.0 {
        return Err("is turned inside out".into());
    }
    let thickness_mm = thickness(&mesh, labels).ok_or("has no two faces")?;
    let articular = labels.iter().map(|&l| l == ARTICULAR).collect();
    Ok(CartilageSolid { solid: mesh, articular, thickness_mm })
}

/// The patch as the floor, its copy at the scan's height as the ceiling, and a wall between their rims.
fn extruded(patch: &Patch) -> (TriMesh, Vec<u32>) {
    let count = patch.bone.vertices.len() as u32;
    let neighbours = vertex_neighbours(&patch.bone);
    let inner = smoothed(&patch.inner, &neighbours);
    let outer = smoothed(&patch.outer, &neighbours);
    let at = |heights: &[f64]| -> Vec<Point> {
        patch.bone.vertices.iter().zip(&patch.normals).zip(heights).map(|((p, n), h)| p + n * *h).collect()
    };
    let mut mesh = TriMesh { vertices: at(&inner), triangles: Vec::new() };
    mesh.vertices.extend(at(&outer));
    let mut labels = Vec::new();
    for &[a, b, c] in &patch.bone.triangles {
        mesh.triangles.extend([[a, c, b], [a + count, b + count, c + count]]);
        labels.extend([BONY, ARTICULAR]);
    }
    for rim in boundary_loops(&patch.bone) {
        for (i, &a) in rim.iter().enumerate() {
            let b = rim[(i + 1) % rim.len()];
            mesh.triangles.extend([[a, b, b + count], [a, b + count, a + count]]);
            labels.extend([ARTICULAR; 2]);
        }
    }
    (mesh, labels)
}

/// The field without outliers (median of the neighbourhood, twice), then averaged once.
fn smoothed(field: &[f64], neighbours: &[Vec<u32>]) -> Vec<f64> {
    let mut field = field.to_vec();
    for _ in 0..2 {
        field = (0..field.len())
            .map(|v| {
                let mut near: Vec<f64> = neighbours[v].iter().map(|&w| field[w as usize]).collect();
                near.push(field[v]);
                meshes::measure::percentile(&mut near, 0.5)
            })
            .collect();
    }
    (0..field.len()).map(|v| 0.5 * field[v] + 0.5 * super::vertices::mean(&field, &neighbours[v], field[v])).collect()
}

/// Moves the articular face onto the scan by a smooth displacement; the rim and the bony face stay.
fn fit(mesh: &mut TriMesh, labels: &[u32], walls: &SurfaceQuery) {
    let normals = mesh.vertex_normals();
    let mut free = vec![true; mesh.vertices.len()];
    for (t, l) in mesh.triangles.iter().zip(labels) {
        if *l == BONY {
            t.iter().for_each(|&v| free[v as usize] = false);
        }
    }
    let wanted: Vec<Option<Vector>> = (0..mesh.vertices.len())
        .into_par_iter()
        .map(|v| {
            let p = mesh.vertices[v];
            let near = walls.nearest(&p);
            let faces = walls.normal(near.triangle).dot(&normals[v]) > 0.3;
            (free[v] && faces && near.distance < 1.0).then(|| near.point - p)
        })
        .collect();
    let neighbours = vertex_neighbours(mesh);
    let mut step: Vec<Vector> = wanted.iter().map(|w| w.unwrap_or_else(Vector::zeros)).collect();
    for _ in 0..2 {
        step = (0..step.len())
            .map(|v| {
                if !free[v] {
                    return Vector::zeros();
                }
                let known: Vec<usize> =
                    neighbours[v].iter().map(|&w| w as usize).filter(|&w| free[w] && wanted[w].is_some()).collect();
                let sum: Vector = known.iter().map(|&w| step[w]).sum();
                let mean = if known.is_empty() { step[v] } else { sum / known.len() as f64 };
                if wanted[v].is_some() { step[v] * 0.5 + mean * 0.5 } else { mean }
            })
            .collect();
    }
    let before = mesh.vertices.clone();
    mesh.vertices.iter_mut().zip(&step).for_each(|(p, s)| *p += s);
    undo_folds(mesh, &before);
}

/// Puts back corners of triangles that the fit turned by more than 80 degrees.
fn undo_folds(mesh: &mut TriMesh, before: &[Point]) {
    let old = TriMesh { vertices: before.to_vec(), triangles: mesh.triangles.clone() };
    for _ in 0..5 {
        let bad: Vec<usize> = (0..mesh.triangles.len())
            .filter(|&t| {
                let (a, b) = (old.area_vector(t), mesh.area_vector(t));
                a.dot(&b) < 0.17 * a.norm() * b.norm() || b.norm() < 1e-4
            })
            .collect();
        for t in bad {
            for v in mesh.triangles[t] {
                mesh.vertices[v as usize] = before[v as usize];
            }
        }
    }
}

/// From the bony face along its normal to the articular one, from the articular face to the nearest of the bony one [mm].
fn thickness(mesh: &TriMesh, labels: &[u32]) -> Option<Vec<f64>> {
    let faces = [BONY, ARTICULAR].map(|l| mesh.submesh(|t| labels[t] == l));
    let queries = [SurfaceQuery::new(&faces[0].0)?, SurfaceQuery::new(&faces[1].0)?];
    let mut thickness = vec![f64::NAN; mesh.vertices.len()];
    let mut touched = vec![0u8; mesh.vertices.len()];
    for (k, (_, old)) in faces.iter().enumerate() {
        old.iter().for_each(|&v| touched[v as usize] |= 1 << k);
    }
    let normals = faces[0].0.vertex_normals();
    for (i, &v) in faces[0].1.iter().enumerate() {
        let p = mesh.vertices[v as usize];
        let nearest = queries[1].nearest(&p).distance;
        let along = queries[1].ray(&p, &-normals[i], 2.0 * nearest + 1.0).map_or(nearest, |h| h.distance);
        thickness[v as usize] = along;
    }
    for &v in &faces[1].1 {
        thickness[v as usize] = queries[0].nearest(&mesh.vertices[v as usize]).distance;
    }
    for (t, on) in thickness.iter_mut().zip(touched) {
        if on == 3 || !t.is_finite() {
            *t = 0.0;
        }
    }
    Some(thickness)
}

//! Which body is which bone.

use super::SegmentOptions;
use super::solid::Bodies;
use crate::StageError;
use meshes::volume::{Labels, Volume};
use meshes::{Point, Vector};
use nalgebra::Matrix3;
use notices::{Kind, Notice};

/// A body above this share of the largest is a femur or a tibia [-]; a patella has a tenth of a cropped femur.
const LARGE_SHARE: f64 = 0.35;
/// A body this many times as long as wide is a fibula [-]; a patella is about 1.2.
const LONG: f64 = 2.5;

/// Size and shape of a body.
struct Shape {
    number: u32,
    volume: f64,
    centre: Point,
    /// Longest over middle extent [-].
    slenderness: f64,
}

/// The label map of the bones.
///
/// Femur and tibia are the two largest bodies; a long slender one is the fibula and lies nearer to the tibia; what is left and nearest
/// to the femur is the patella. Nothing depends on the axes of the picture. Bodies numbered by seeds keep the seeds' names.
pub(super) fn named(
    volume: &Volume,
    bodies: &Bodies,
    options: &SegmentOptions,
    warnings: &mut Vec<Notice>,
) -> Result<Labels, StageError> {
    let part = volume.grid.part(bodies.low, bodies.high);
    let count = bodies.body.iter().copied().max().unwrap_or(0);
    let shapes = shapes(&part, &bodies.body, count, options.least_bone_mm3);
    let name = if bodies.seeds.is_empty() {
        by_shape(&shapes, count, warnings)?
    } else {
        (0..=count as usize).map(|b| if b == 0 { 0 } else { bodies.seeds.get(b - 1).copied().unwrap_or(0) }).collect()
    };
    let mut labels = vec![0; volume.grid.count()];
    for (i, &b) in bodies.body.iter().enumerate() {
        let [x, y, z] = part.voxel(i);
        labels[volume.grid.at([x + bodies.low[0], y + bodies.low[1], z + bodies.low[2]])] = name[b as usize];
    }
    Ok(Labels { grid: volume.grid.clone(), values: labels })
}

fn shapes(part: &meshes::volume::Grid, body: &[u32], count: u32, least: f64) -> Vec<Shape> {
    let n = count as usize + 1;
    let (mut voxels, mut sum, mut square) = (vec![0.0; n], vec![Vector::zeros(); n], vec![Matrix3::zeros(); n]);
    for (i, &b) in body.iter().enumerate().filter(|(_, b)| **b != 0) {
        let p = part.point(&Vector::from(part.voxel(i).map(|x| x as f64))) - part.origin;
        voxels[b as usize] += 1.0;
        sum[b as usize] += p;
        square[b as usize] += p * p.transpose();
    }
    let mut shapes: Vec<Shape> = (1..n)
        .filter(|&b| voxels[b] * part.voxel_mm3() >= least)
        .map(|b| {
            let mean: Vector = sum[b] / voxels[b];
            let spread: Matrix3<f64> = square[b] / voxels[b] - mean * mean.transpose();
            let mut extents: Vec<f64> = spread.symmetric_eigenvalues().iter().copied().collect();
            extents.sort_by(f64::total_cmp);
            Shape {
                number: b as u32,
                volume: voxels[b] * part.voxel_mm3(),
                centre: part.origin + mean,
                slenderness: (extents[2] / extents[1].max(1e-9)).sqrt(),
            }
        })
        .collect();
    shapes.sort_by(|a, b| b.volume.total_cmp(&a.volume));
    shapes
}

fn by_shape(shapes: &[Shape], count: u32, warnings: &mut Vec<Notice>) -> Result<Vec<u8>, StageError> {
    let largest = shapes.first().map_or(0.0, |s| s.volume);
    let large = shapes.iter().filter(|s| s.volume >= LARGE_SHARE * largest && s.slenderness < 2.0 * LONG).count();
    if large != 2 {
        let sizes = shapes.iter().take(6).map(|s| format!("{:.1}", s.volume / 1000.0)).collect::<Vec<_>>().join(", ");
        return Err(StageError::Knee(format!(
            "the CT volume shows {large} large bones (bodies of {sizes} cm3); expected 2, femur and tibia: crop the picture to one knee, or part the bones by hand in a label map ([ct] labels, with --set segment.labels_are=seeds)"
        )));
    }
    let mut name = vec![0; count as usize + 1];
    let (a, b) = (&shapes[0], &shapes[1]);
    let nearer_b = |s: &Shape| (s.centre - b.centre).norm() < (s.centre - a.centre).norm();
    let fibula = shapes[2..].iter().find(|s| s.slenderness >= LONG);
    // Without a fibula of its own the surfaces decide, later, which one looks like a femur.
    let (femur, tibia) = if fibula.is_none_or(nearer_b) { (a, b) } else { (b, a) };
    name[femur.number as usize] = 1;
    name[tibia.number as usize] = 2;
    if let Some(fibula) = fibula {
        name[fibula.number as usize] = 3;
    }
    let rest = || shapes[2..].iter().filter(|s| s.slenderness < LONG);
    let gap = |s: &Shape| (s.centre - femur.centre).norm();
    if let Some(patella) = rest().min_by(|s, t| gap(s).total_cmp(&gap(t))) {
        name[patella.number as usize] = 4;
    }
    let unnamed = shapes.iter().filter(|s| name[s.number as usize] == 0).count();
    if unnamed > 0 {
        warnings.push(Kind::BodiesLeftOut.notice(format!(
            "{unnamed} more bodies of bone in the CT volume are left out: they are no femur, tibia, fibula or patella"
        )));
    }
    Ok(name)
}

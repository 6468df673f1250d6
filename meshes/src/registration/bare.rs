//! Which part of a scan is bare bone: not cartilage, screw, sticker, ink or ragged edge.

use super::icp::{Standing, standing};
use super::target::{Target, nearest_in, tree_of};
use crate::surface::ColouredMesh;
use crate::{Isometry, Point, Vector};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A scan with what registration asks of it again and again.
pub struct Scan<'a> {
    /// The scan itself.
    pub mesh: &'a ColouredMesh,
    /// Unit vertex normals, outward.
    pub normals: Vec<Vector>,
    /// Area of each vertex [mm2].
    pub areas: Vec<f64>,
    /// Whether a vertex lies within 1.5 mm of the scan's border.
    pub at_border: Vec<bool>,
}

/// Where each vertex of a scan stands, and what it is taken for.
pub struct Classified {
    /// By vertex.
    pub standing: Vec<Standing>,
    /// Bare bone, fit for registration.
    pub bare: Vec<bool>,
    /// Bare bone or what should be: seen well, and not covered by anything.
    pub bone_like: Vec<bool>,
    /// How far bare bone lies outside the bone as a whole [mm], as where a segmentation made it too small; 0 where chance may be why.
    pub level: f64,
    /// Robust standard deviation of the residual about bare bone [mm].
    pub spread: f64,
}

/// Prepares a scan; normals are turned over where its triangles face inward as a whole.
pub fn prepare(mesh: &ColouredMesh) -> Scan<'_> {
    let surface = &mesh.mesh;
    let mut normals = surface.vertex_normals();
    if faces_inward(surface) {
        normals.iter_mut().for_each(|n| *n = -*n);
    }
    let mut edges: Vec<(u32, u32)> = surface
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(p, q)| (p.min(q), p.max(q)))
        .collect();
    edges.sort_unstable();
    let border: Vec<Point> = edges
        .chunk_by(|a, b| a == b)
        .filter(|run| run.len() == 1)
        .map(|run| surface.vertices[run[0].0 as usize])
        .collect();
    let at_border = within(&surface.vertices, &border, 1.5);
    Scan { mesh, normals, areas: surface.vertex_areas(), at_border }
}

/// Whether a surface, perhaps open, faces inward as a whole: its flux of the position about its centroid is negative.
pub fn faces_inward(surface: &crate::surface::TriMesh) -> bool {
    let Some(centre) = surface.centroid() else { return false };
    let flux = (0..surface.triangles.len()).map(|t| surface.area_vector(t).dot(&(surface.corners(t)[0] - centre)));
    flux.sum::<f64>() < 0.0
}

/// Tells bare bone from the rest under a pose.
///
/// Bone spreads to both sides of its level, zero or what a segmentation's bias makes of it; what covers it lies outside only,
/// so the spread is taken from the inner side. Vertices well outside, with a margin of 1.5 mm, are covered; where colours tell covered from bare, colours decide too.
pub fn classify(target: &Target, scan: &Scan, pose: &Isometry) -> Classified {
    let vertices = &scan.mesh.mesh.vertices;
    let standing =
        (0..vertices.len()).into_par_iter().map(|i| standing(target, &(pose * vertices[i]), &(pose * scan.normals[i])));
    tell(scan, standing.collect())
}

/// As [`classify`], where it is known how the vertices stand.
pub fn tell(scan: &Scan, standing: Vec<Standing>) -> Classified {
    let vertices = &scan.mesh.mesh.vertices;
    let seen: Vec<bool> = standing
        .iter()
        .zip(&scan.at_border)
        .map(|(s, border)| !border && s.facing > 0.8 && s.distance < 10.0 && s.residual.abs() > 0.9 * s.distance)
        .collect();
    let level = level(&standing, &seen);
    let spread = inner_spread(&standing, &seen, level);
    let lift = (4.0 * spread).clamp(0.4, 1.0);
    let raised: Vec<bool> = standing.iter().zip(&seen).map(|(s, seen)| *seen && s.residual - level > lift).collect();
    let off: Vec<Point> = (0..vertices.len()).filter(|&i| raised[i]).map(|i| vertices[i]).collect();
    let mut covered = within(vertices, &off, 1.5);
    if let Some(by_colour) = covered_by_colour(&scan.mesh.colours, &seen, &raised) {
        covered.iter_mut().zip(by_colour).for_each(|(c, k)| *c |= k);
    }
    let bone_like: Vec<bool> = (0..vertices.len()).map(|i| seen[i] && !covered[i]).collect();
    let reach = (4.0 * spread).min(1.5);
    let bare = (0..vertices.len()).map(|i| bone_like[i] && (standing[i].residual - level).abs() < reach).collect();
    Classified { standing, bare, bone_like, level, spread }
}

/// Residuals looked at for a level [mm], the width of the peak that bare bone makes among them, and the share of them it holds.
const NEAR: f64 = 1.2;
const PEAK: f64 = 0.4;
const PEAK_SHARE: f64 = 0.5;
/// Levels that correlated errors of a segmentation may have by chance [mm].
const CHANCE: f64 = 0.15;

/// The median of the densest residuals, where they stand out and it is not chance [mm].
fn level(standing: &[Standing], seen: &[bool]) -> f64 {
    let near = standing.iter().zip(seen).filter(|(s, seen)| **seen && s.residual.abs() < NEAR);
    let mut near: Vec<f64> = near.map(|(s, _)| s.residual).collect();
    near.sort_by(f64::total_cmp);
    let (mut from, mut best) = (0, 0..0);
    for (to, residual) in near.iter().enumerate() {
        while residual - near[from] > PEAK {
            from += 1;
        }
        if to + 1 - from > best.len() {
            best = from..to + 1;
        }
    }
    if (best.len() as f64) < PEAK_SHARE * near.len() as f64 {
        return 0.0;
    }
    near.get(best.start + best.len() / 2).copied().filter(|m| m.abs() > CHANCE).unwrap_or(0.0)
}

/// Robust standard deviation of the residuals about their level, from the inner side alone [mm].
fn inner_spread(standing: &[Standing], seen: &[bool], level: f64) -> f64 {
    let mut inner: Vec<f64> = standing
        .iter()
        .zip(seen)
        .filter(|(s, seen)| **seen && s.residual < level)
        .map(|(s, _)| level - s.residual)
        .collect();
    if inner.is_empty() {
        return 1.0;
    }
    let middle = inner.len() / 2;
    let (_, median, _) = inner.select_nth_unstable_by(middle, f64::total_cmp);
    (1.4826 * *median).max(0.01)
}

/// Whether each point lies within `reach` [mm] of one of `others`.
fn within(points: &[Point], others: &[Point], reach: f64) -> Vec<bool> {
    let Some(tree) = tree_of(others) else {
        return vec![false; points.len()];
    };
    points.par_iter().map(|p| nearest_in(&tree, p).1 < reach * reach).collect()
}

/// Colours (in cells of 32) that occur mostly on what is raised; `None` without colours.
fn covered_by_colour(colours: &[[u8; 3]], seen: &[bool], raised: &[bool]) -> Option<Vec<bool>> {
    if colours.len() != seen.len() {
        return None;
    }
    let cell = |c: &[u8; 3]| c.map(|v| v / 32);
    let mut counts: BTreeMap<[u8; 3], [f64; 2]> = BTreeMap::new();
    for ((c, _), raised) in colours.iter().zip(seen).zip(raised).filter(|((_, seen), _)| **seen) {
        counts.entry(cell(c)).or_default()[usize::from(*raised)] += 1.0;
    }
    Some(colours.iter().map(|c| counts.get(&cell(c)).is_some_and(|[bare, raised]| *raised > *bare)).collect())
}

//! Fields over the vertices of a surface: means, normals, connected sets.

use meshes::Vector;
use meshes::measure::percentile;
use meshes::surface::TriMesh;
use std::cmp::Reverse;

/// Median height of the scan where it lies close to the bone, so is bone [mm].
pub(super) fn bias(heights: impl Iterator<Item = f64>, least: f64) -> f64 {
    percentile(&mut heights.filter(|h| h.abs() < 2.0 * least).collect::<Vec<_>>(), 0.5)
}

/// Mean of a field over neighbours.
pub(super) fn mean(field: &[f64], neighbours: &[u32], own: f64) -> f64 {
    if neighbours.is_empty() {
        return own;
    }
    neighbours.iter().map(|&w| field[w as usize]).sum::<f64>() / neighbours.len() as f64
}

/// Unit normals at vertices, averaged with their neighbours' in `rounds`.
pub(super) fn smooth_normals(mesh: &TriMesh, neighbours: &[Vec<u32>], rounds: usize) -> Vec<Vector> {
    let mut normals = mesh.vertex_normals();
    for _ in 0..rounds {
        normals = (0..normals.len())
            .map(|v| {
                let sum: Vector = neighbours[v].iter().map(|&w| normals[w as usize]).sum();
                (sum + normals[v]).try_normalize(1e-9).unwrap_or(normals[v])
            })
            .collect();
    }
    normals
}

/// Connected sets of vertices for which `belongs` holds, most vertices first.
pub(super) fn bodies(neighbours: &[Vec<u32>], belongs: impl Fn(u32) -> bool) -> Vec<Vec<u32>> {
    let count = neighbours.len();
    let mut seen = vec![false; count];
    let mut all = Vec::new();
    for seed in 0..count as u32 {
        if seen[seed as usize] || !belongs(seed) {
            continue;
        }
        seen[seed as usize] = true;
        let mut body = vec![seed];
        let mut done = 0;
        while let Some(&v) = body.get(done) {
            done += 1;
            for &w in &neighbours[v as usize] {
                if !seen[w as usize] && belongs(w) {
                    seen[w as usize] = true;
                    body.push(w);
                }
            }
        }
        all.push(body);
    }
    all.sort_by_key(|b| (Reverse(b.len()), b[0]));
    all
}

//! Grades of a surface: lengths of edges and angles of triangles.

use crate::surface::TriMesh;
use serde::{Deserialize, Serialize};

/// Lengths of edges and the smallest angle of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EdgeQuality {
    /// First percentile of edge length [mm].
    pub edge_p01_mm: f64,
    /// Median edge length [mm].
    pub edge_p50_mm: f64,
    /// 99th percentile of edge length [mm].
    pub edge_p99_mm: f64,
    /// Smallest angle of any triangle [degree].
    pub min_angle_deg: f64,
}

/// Grades `mesh`; zeros for an empty one.
pub fn edge_quality(mesh: &TriMesh) -> EdgeQuality {
    let mut lengths = Vec::with_capacity(3 * mesh.triangles.len());
    let mut min_angle = f64::INFINITY;
    for t in 0..mesh.triangles.len() {
        let p = mesh.corners(t);
        for k in 0..3 {
            let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
            lengths.push(u.norm());
            min_angle = min_angle.min(u.cross(&v).norm().atan2(u.dot(&v)).to_degrees());
        }
    }
    if lengths.is_empty() {
        return EdgeQuality::default();
    }
    EdgeQuality {
        edge_p01_mm: percentile(&mut lengths, 0.01),
        edge_p50_mm: percentile(&mut lengths, 0.5),
        edge_p99_mm: percentile(&mut lengths, 0.99),
        min_angle_deg: min_angle,
    }
}

/// The value below which the share `q` of `values` lies (nearest rank); reorders them; zero for none.
pub fn percentile(values: &mut [f64], q: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let rank = ((values.len() - 1) as f64 * q.clamp(0.0, 1.0)).round() as usize;
    *values.select_nth_unstable_by(rank, f64::total_cmp).1
}

//! Nodes of a surface with their tributary areas, in clusters that are passed over as a whole where they are far off.

use meshes::surface::TriMesh;
use meshes::{Isometry, Point};
use std::collections::BTreeMap;

/// Edge of a cluster's cell [mm].
const CLUSTER: f64 = 4.0;

/// Nodes, sorted by cluster, CT coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    pub(super) position: Vec<[f64; 3]>,
    pub(super) area: Vec<f64>,
    /// Thickness of the layer below each [mm]; 0 where nothing gives way.
    pub(super) thickness: Vec<f64>,
    pub(super) clusters: Vec<Cluster>,
    /// Least and greatest coordinates.
    pub(super) extent: [[f64; 3]; 2],
}

#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub(super) centre: [f64; 3],
    pub(super) radius: f64,
    pub(super) range: std::ops::Range<usize>,
}

impl Nodes {
    /// The nodes of `mesh`, merged within cells of `spacing` of the bone's frame; `thickness` [mm] at its vertices, or none.
    pub(crate) fn new(mesh: &TriMesh, thickness: &[f64], frame: &Isometry, spacing: f64) -> Nodes {
        let areas = mesh.vertex_areas();
        // area, and sums of place and thickness by area
        let mut merged: BTreeMap<[i64; 4], (f64, [f64; 3], f64)> = BTreeMap::new();
        for (i, p) in mesh.vertices.iter().enumerate() {
            let local = frame * p;
            let key = if spacing > 0.0 {
                let k = local.coords.map(|x| (x / spacing).floor() as i64);
                [k.x, k.y, k.z, 0]
            } else {
                [0, 0, 0, i as i64]
            };
            let slot = merged.entry(key).or_insert((0.0, [0.0; 3], 0.0));
            slot.0 += areas[i];
            (0..3).for_each(|a| slot.1[a] += areas[i] * p[a]);
            slot.2 += areas[i] * thickness.get(i).copied().unwrap_or(0.0);
        }
        let mut cells: BTreeMap<[i64; 3], Vec<(f64, Point, f64)>> = BTreeMap::new();
        for (area, sum, thick) in merged.into_values().filter(|(a, ..)| *a > 0.0) {
            let p = Point::new(sum[0] / area, sum[1] / area, sum[2] / area);
            let k = (frame * p).coords.map(|x| (x / CLUSTER).floor() as i64);
            cells.entry([k.x, k.y, k.z]).or_default().push((area, p, thick / area));
        }
        let extent = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let (position, area, thickness, clusters) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut nodes = Nodes { position, area, thickness, clusters, extent };
        for cell in cells.into_values() {
            let start = nodes.position.len();
            let low = cell.iter().fold(cell[0].1, |m, (_, p, _)| m.inf(p));
            let high = cell.iter().fold(cell[0].1, |m, (_, p, _)| m.sup(p));
            let centre = nalgebra::center(&low, &high).coords;
            let radius = cell.iter().map(|(_, p, _)| (p.coords - centre).norm()).fold(0.0, f64::max);
            for (area, p, thick) in &cell {
                nodes.position.push([p.x, p.y, p.z]);
                for a in 0..3 {
                    nodes.extent[0][a] = nodes.extent[0][a].min(p[a]);
                    nodes.extent[1][a] = nodes.extent[1][a].max(p[a]);
                }
                nodes.area.push(*area);
                nodes.thickness.push(*thick);
            }
            let range = start..nodes.position.len();
            nodes.clusters.push(Cluster { centre: [centre.x, centre.y, centre.z], radius, range });
        }
        nodes
    }
}

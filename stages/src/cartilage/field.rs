//! The thickness field: what the scan has above each vertex of the bone.

use super::vertices::{bias, mean, smooth_normals};
use super::{CartilageOptions, thin_rim};
use meshes::measure::percentile;
use meshes::query::SurfaceQuery;
use meshes::shapes::subdivided;
use meshes::surface::TriMesh;
use meshes::topology::vertex_neighbours;
use meshes::{Point, Vector};
use rayon::prelude::*;

/// The bone's surface, fine, with what lies above each of its vertices.
pub(super) struct Domain {
    /// The bone, each triangle of the model's surface in four.
    pub(super) bone: TriMesh,
    /// Neighbours along edges.
    pub(super) neighbours: Vec<Vec<u32>>,
    /// Smooth unit normals.
    pub(super) normals: Vec<Vector>,
    /// Height at which cartilage begins above the bone's surface: the bone's own error there, or the top of a cleft [mm].
    pub(super) inner: Vec<f64>,
    /// Height at which it ends [mm].
    pub(super) outer: Vec<f64>,
    /// Robust standard deviation of the scan about the corrected bone where bone is bare [mm].
    pub(super) bare_sd: f64,
    /// Rims thinner than what tells cartilage from bone, that the scan itself shows: it steps down from them to bare bone.
    pub(super) thin_rim: Vec<bool>,
}

impl Domain {
    /// Looks from every vertex of `bone`, made from a surface of CT whose edges are `ct_edge_mm` long in the median; `None` for an empty surface.
    pub(super) fn new(bone: &TriMesh, scan: &TriMesh, ct_edge_mm: f64, options: &CartilageOptions) -> Option<Domain> {
        Domain::with_error(bone, scan, ct_edge_mm, options).map(|(domain, _)| domain)
    }

    /// The same, and by vertex how high the true bone lies above the surface of CT [mm].
    pub(super) fn with_error(
        bone: &TriMesh,
        scan: &TriMesh,
        ct_edge_mm: f64,
        options: &CartilageOptions,
    ) -> Option<(Domain, Vec<f64>)> {
        let walls = SurfaceQuery::new(scan)?;
        let (bone, neighbours, normals, reach) = looking_out(bone, options.reach_mm)?;
        let seen: Vec<Option<[f64; 2]>> = (0..bone.vertices.len())
            .into_par_iter()
            .map(|v| extent(&walls, &bone.vertices[v], &normals[v], reach[v], options.cleft_mm))
            .collect();
        let cleft = filled(&seen.iter().map(|s| s.map(|x| x[0])).collect::<Vec<_>>(), &neighbours);
        let outer = filled(&seen.iter().map(|s| s.map(|x| x[1])).collect::<Vec<_>>(), &neighbours);
        let thin_rim = if ct_edge_mm > thin_rim::RESOLVED_MM {
            vec![false; bone.vertices.len()]
        } else {
            let tops: Vec<Point> = (0..outer.len()).map(|v| bone.vertices[v] + normals[v] * outer[v]).collect();
            thin_rim::thin_rim(&outer, &thin_rim::feet(scan, &walls, &tops), &neighbours, options)
        };
        let (error, bare_sd) = bone_error(&seen, &neighbours, &thin_rim, options.least_thickness_mm);
        let inner = cleft.iter().zip(&error).map(|(c, e)| if *c > 0.0 { c.max(*e) } else { *e }).collect();
        Some((Domain { bone, neighbours, normals, inner, outer, bare_sd, thin_rim }, error))
    }

    /// Thickness at a vertex [mm].
    pub(super) fn thickness(&self, v: usize) -> f64 {
        self.outer[v] - self.inner[v]
    }
}

/// A bone's surface, fine; its vertices' neighbours and smooth normals; how far each can look along its normal [mm].
type Lookout = (TriMesh, Vec<Vec<u32>>, Vec<Vector>, Vec<f64>);

/// Each triangle of `bone` in four. The bone itself, met again (a notch's other wall, the fibula), ends what can be cartilage.
pub(super) fn looking_out(bone: &TriMesh, reach_mm: f64) -> Option<Lookout> {
    let coarse = SurfaceQuery::new(bone)?;
    let bone = subdivided(bone);
    let neighbours = vertex_neighbours(&bone);
    let normals = smooth_normals(&bone, &neighbours, 4);
    let reach = bone
        .vertices
        .par_iter()
        .zip(&normals)
        .map(|(p, n)| coarse.ray(&(p + n * 0.5), n, reach_mm).map_or(reach_mm, |h| h.distance))
        .collect();
    Some((bone, neighbours, normals, reach))
}

/// Where cartilage begins and ends above `p` along `n`; `None` where the scan has a hole.
///
/// Walls of the scan are counted from 1 mm inside the bone: one passed outward ends material, one passed inward begins it.
pub(super) fn extent(walls: &SurfaceQuery, p: &Point, n: &Vector, reach: f64, cleft: f64) -> Option<[f64; 2]> {
    const INSIDE: f64 = 1.0;
    let mut depth = 1;
    let mut from = -INSIDE;
    let mut begin = 0.0;
    let mut end: Option<f64> = None;
    for _ in 0..16 {
        let Some(hit) = walls.ray(&(p + n * from), n, reach - from) else { break };
        let height = from + hit.distance;
        from = height + 1e-6;
        if walls.normal(hit.triangle).dot(n) > 0.0 {
            depth -= 1;
            if depth == 0 {
                end = Some(height);
            }
        } else {
            depth += 1;
            if depth == 1
                && let Some(last) = end
            {
                if height - last > cleft {
                    break;
                }
                // material below the cleft is bone, not cartilage, when it ends about where bone does
                if last < 0.8 {
                    begin = height.max(0.0);
                }
            }
        }
    }
    end.map(|e| [if e > begin { begin } else { 0.0 }, e])
}

/// How high the true bone lies above the surface of CT, and the spread about that on bare bone [mm].
///
/// Where bone is bare, which a thin `rim` is not, the scan is the better measure of it. Its height there, a smooth error of
/// segmentation, is carried in under the cartilage over about the correlation length of such errors, and to the bone's median farther in.
fn bone_error(seen: &[Option<[f64; 2]>], neighbours: &[Vec<u32>], rim: &[bool], least: f64) -> (Vec<f64>, f64) {
    let height = |v: usize| seen[v].map(|x| x[1]).filter(|_| !rim[v]);
    let bias = bias((0..seen.len()).filter_map(height), least);
    let thin = |v: usize| height(v).is_some_and(|h| (h - bias).abs() < 0.8 * least);
    // a rim belongs to the cartilage: bare vertices have bare ones two edges around them
    let mut bare: Vec<bool> = (0..seen.len()).map(thin).collect();
    for _ in 0..2 {
        bare = (0..bare.len()).map(|v| bare[v] && neighbours[v].iter().all(|&w| bare[w as usize])).collect();
    }
    let start: Vec<f64> = (0..seen.len()).map(|v| height(v).filter(|_| bare[v]).unwrap_or(bias)).collect();
    let mut error = start.clone();
    for _ in 0..60 {
        error = (0..error.len())
            .map(|v| {
                let around = mean(&error, &neighbours[v], error[v]);
                if bare[v] { 0.15 * start[v] + 0.85 * around } else { 0.01 * bias + 0.99 * around }
            })
            .collect();
    }
    let mut spread: Vec<f64> = (0..seen.len()).filter(|&v| bare[v]).map(|v| (start[v] - error[v]).abs()).collect();
    (error, 1.4826 * percentile(&mut spread, 0.5))
}

/// Values with gaps filled from around them, layer by layer, then relaxed.
fn filled(values: &[Option<f64>], neighbours: &[Vec<u32>]) -> Vec<f64> {
    let mut known: Vec<Option<f64>> = values.to_vec();
    for _ in 0..40 {
        let next: Vec<Option<f64>> = (0..known.len())
            .map(|v| {
                known[v].or_else(|| {
                    let near: Vec<f64> = neighbours[v].iter().filter_map(|&w| known[w as usize]).collect();
                    (!near.is_empty()).then(|| near.iter().sum::<f64>() / near.len() as f64)
                })
            })
            .collect();
        known = next;
    }
    let mut field: Vec<f64> = known.into_iter().map(|x| x.unwrap_or(0.0)).collect();
    for _ in 0..40 {
        field = (0..field.len())
            .map(|v| if values[v].is_some() { field[v] } else { mean(&field, &neighbours[v], field[v]) })
            .collect();
    }
    field
}

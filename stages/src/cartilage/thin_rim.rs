//! Rims thinner than what tells cartilage from bone: the scan itself steps down from them to bare bone.

use super::CartilageOptions;
use super::vertices::{bias, mean, smooth_normals};
use meshes::Point;
use meshes::query::SurfaceQuery;
use meshes::surface::TriMesh;
use meshes::topology::vertex_neighbours;
use rayon::prelude::*;

/// Median edge of a surface of CT beyond which thin rims are not looked for [mm]: coarser triangles cut the bone's own edges by as much as such a rim is high.
pub(super) const RESOLVED_MM: f64 = 2.0;
/// Fall of the scan from a thin rim, as a share of a rim's thickness; errors of CT do not fall so steeply.
const STEP: f64 = 2.0 / 3.0;
/// How far a thin rim reaches from cartilage, and how far beyond it the bone it steps down to is looked for, edges of about 0.7 mm.
const REACH: usize = 5;
/// Distance over which a crease of the scan is looked for [mm]; about the width of a step's foot.
const CREASE_REACH_MM: f64 = 1.2;
/// Hollow curvature of a crease [1/mm]. A step of 0.3 mm has about 0.3 at its foot, the noise of a scan of 0.02 mm makes 0.03, hollows of bone are rounder. Our own trials.
const CREASE: f64 = 0.2;
/// Rounds in which tongues and specks of a rim are taken away.
const ROUNDS: usize = 2;

/// Which of the points `tops` of a scan lie in a crease of it, as at the foot of a wall.
pub(super) fn feet(scan: &TriMesh, walls: &SurfaceQuery, tops: &[Point]) -> Vec<bool> {
    let neighbours = vertex_neighbours(scan);
    let normals = smooth_normals(scan, &neighbours, 1);
    let creased: Vec<bool> = (0..scan.vertices.len())
        .into_par_iter()
        .map(|v| {
            let p = scan.vertices[v];
            let (rise, reach) = around(scan, &neighbours, v).iter().fold((0.0, 1e-9), |(rise, reach), &w| {
                let d = scan.vertices[w as usize] - p;
                (rise + 2.0 * d.dot(&normals[v]), reach + d.norm_squared())
            });
            rise / reach > CREASE
        })
        .collect();
    let corners = |p: &Point| scan.triangles[walls.nearest(p).triangle as usize];
    tops.par_iter().map(|p| corners(p).iter().any(|&w| creased[w as usize])).collect()
}

/// Vertices next to `v`, and those within [`CREASE_REACH_MM`] that are joined to it by such; sixty at most, the nearest rings first.
fn around(scan: &TriMesh, neighbours: &[Vec<u32>], v: usize) -> Vec<u32> {
    const MOST: usize = 60;
    let is_near = |w: u32| (scan.vertices[w as usize] - scan.vertices[v]).norm() < CREASE_REACH_MM;
    let mut found = neighbours[v].clone();
    let mut next = 0;
    while next < found.len() && found.len() < MOST {
        let from = found[next];
        next += 1;
        if is_near(from) {
            for &w in &neighbours[from as usize] {
                if w as usize != v && is_near(w) && !found.contains(&w) {
                    found.push(w);
                }
            }
        }
    }
    found
}

/// Vertices of the bone next to cartilage from which the scan, at heights `outer`, steps down by [`STEP`] of a rim's thickness or more, up to the foot of the step.
pub(super) fn thin_rim(outer: &[f64], feet: &[bool], neighbours: &[Vec<u32>], options: &CartilageOptions) -> Vec<bool> {
    let count = outer.len();
    let touches = |marked: &[bool], v: usize| neighbours[v].iter().any(|&w| marked[w as usize]);
    let bias = bias(outer.iter().copied(), options.least_thickness_mm);
    let mut low: Vec<f64> = (0..count).map(|v| 0.5 * outer[v] + 0.5 * mean(outer, &neighbours[v], outer[v])).collect();
    let mut near = feet.to_vec();
    for _ in 0..REACH {
        low = (0..count).map(|v| neighbours[v].iter().map(|&w| low[w as usize]).fold(low[v], f64::min)).collect();
        near = (0..count).map(|v| near[v] || touches(&near, v)).collect();
    }
    let thick: Vec<bool> = outer.iter().map(|h| h - bias > options.least_thickness_mm).collect();
    let steps = |v: usize| near[v] && outer[v] - low[v] > options.rim_thickness_mm * STEP;
    let mut rim = thick.clone();
    for _ in 0..REACH {
        // beyond a foot is bare bone
        let from: Vec<bool> = (0..count).map(|v| rim[v] && !feet[v]).collect();
        rim = (0..count).map(|v| rim[v] || steps(v) && touches(&from, v)).collect();
    }
    for _ in 0..ROUNDS {
        let among = |v: usize| 2 * neighbours[v].iter().filter(|&&w| rim[w as usize]).count() >= neighbours[v].len();
        rim = (0..count).map(|v| thick[v] || rim[v] && among(v)).collect();
    }
    (0..count).map(|v| rim[v] && !thick[v]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 60;

    /// A grid of 0.7 mm with the top of cartilage `ends` [(x, height)] on flat bone: the scan, the neighbours, and the places across.
    fn scan(ends: &[(f64, f64)]) -> (TriMesh, Vec<Vec<u32>>, Vec<f64>) {
        let x: Vec<f64> = (0..SIDE * SIDE).map(|v| 0.7 * ((v % SIDE) as f64 - 29.5)).collect();
        let height = |x: f64| match ends.iter().position(|e| x < e.0) {
            Some(0) => ends[0].1,
            Some(k) => {
                let ((a, from), (b, to)) = (ends[k - 1], ends[k]);
                from + (to - from) * (x - a) / (b - a)
            }
            None => 0.0,
        };
        let vertices = (0..SIDE * SIDE).map(|v| Point::new(x[v], 0.7 * (v / SIDE) as f64, height(x[v]))).collect();
        let cells = (0..SIDE * (SIDE - 1)).filter(|v| v % SIDE + 1 < SIDE).map(|v| v as u32);
        let side = SIDE as u32;
        let mesh = TriMesh {
            vertices,
            triangles: cells.flat_map(|v| [[v, v + 1, v + side + 1], [v, v + side + 1, v + side]]).collect(),
        };
        let neighbours = vertex_neighbours(&mesh);
        (mesh, neighbours, x)
    }

    /// The rim found where CT errs by `most` in waves of `length` [mm].
    fn found(ends: &[(f64, f64)], most: f64, length: f64) -> (Vec<bool>, Vec<f64>, Vec<f64>) {
        let (scan, neighbours, x) = scan(ends);
        let error = |p: &Point| most * (std::f64::consts::TAU * (p.x + p.y) / length).sin();
        let outer: Vec<f64> = scan.vertices.iter().map(|p| p.z + error(p)).collect();
        let feet = feet(&scan, &SurfaceQuery::new(&scan).unwrap(), &scan.vertices);
        (thin_rim(&outer, &feet, &neighbours, &CartilageOptions::default()), outer, x)
    }

    #[test]
    fn a_rim_that_the_scan_steps_down_from_is_found() {
        for width in [2.0, 3.0] {
            let (rim, outer, x) = found(&[(-10.0, 2.0), (0.0, 0.5), (width, 0.3)], 0.1, 40.0);
            for v in 0..x.len() {
                assert!(!rim[v] || x[v] < width + 0.7, "{width}: {} at {}", outer[v], x[v]);
                let is_rim = (0.0..width).contains(&x[v]) && outer[v] <= 0.5;
                assert!(rim[v] || !is_rim, "{width}: {} at {}", outer[v], x[v]);
            }
            assert!(rim.iter().any(|r| *r));
        }
    }

    #[test]
    fn waves_of_ct_beyond_a_wall_are_no_rim_however_steep() {
        for length in [40.0, 12.0, 8.0] {
            let (rim, outer, x) = found(&[(0.0, 2.0)], 0.2, length);
            for v in (0..x.len()).filter(|v| rim[*v]) {
                assert!(x[v] < 1.5, "{length}: {} at {}", outer[v], x[v]);
            }
        }
    }

    #[test]
    fn a_smooth_scan_has_no_feet() {
        let (mesh, ..) = scan(&[(-10.0, 3.0), (10.0, 1.0), (30.0, 0.0)]);
        let walls = SurfaceQuery::new(&mesh).unwrap();
        assert!(!feet(&mesh, &walls, &mesh.vertices).contains(&true));
    }
}

//! Points spread over a surface in proportion to area, independent of pose and of how finely it is triangulated.

use crate::surface::TriMesh;
use crate::{Point, Vector};

/// Oriented points.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Places, n x 3 [mm].
    pub points: Vec<Point>,
    /// Unit normals, n x 3.
    pub normals: Vec<Vector>,
}

/// `count` points of the surface, evenly in area: systematic over the triangles in their order, within a triangle by
/// the R2 sequence [roberts2018]. Normals are interpolated vertex normals. Empty for a surface without area.
pub fn spread(mesh: &TriMesh, count: usize) -> Samples {
    let vertex_normals = mesh.vertex_normals();
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(|t| mesh.area_vector(t).norm()).collect();
    let step = areas.iter().sum::<f64>() / count.max(1) as f64;
    let mut samples = Samples::default();
    if !(step > 0.0 && step.is_finite()) {
        return samples;
    }
    let mut passed = 0.0;
    for (t, area) in areas.iter().enumerate() {
        passed += area;
        while samples.points.len() < count && (samples.points.len() as f64 + 0.5) * step < passed {
            let k = samples.points.len() as f64;
            let (mut u, mut v) = ((0.5 + k * 0.754_877_666_246_693).fract(), (0.5 + k * 0.569_840_290_998_053).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            let [a, b, c] = mesh.corners(t);
            let [na, nb, nc] = mesh.triangles[t].map(|i| vertex_normals[i as usize]);
            let normal = na * (1.0 - u - v) + nb * u + nc * v;
            samples.points.push(a + u * (b - a) + v * (c - a));
            let flat = mesh.area_vector(t) / *area;
            samples.normals.push(normal.try_normalize(1e-12).unwrap_or(flat));
        }
    }
    samples
}

/// Indices of about `count` entries, systematic over the cumulated `weight`; every entry of positive weight where there are no more.
pub fn systematic(weight: &[f64], count: usize) -> Vec<usize> {
    let positive = weight.iter().filter(|w| **w > 0.0).count();
    if positive <= count {
        return (0..weight.len()).filter(|&i| weight[i] > 0.0).collect();
    }
    let step = weight.iter().filter(|w| **w > 0.0).sum::<f64>() / count as f64;
    let (mut passed, mut taken, mut chosen) = (0.0, 0usize, Vec::with_capacity(count));
    for (i, w) in weight.iter().enumerate().filter(|(_, w)| **w > 0.0) {
        passed += w;
        if (taken as f64 + 0.5) * step < passed {
            chosen.push(i);
            taken = (passed / step - 0.5).ceil().max(taken as f64 + 1.0) as usize;
        }
    }
    chosen
}

/// Indices of up to `count` points far apart: each the farthest from those before, the first the farthest from the mean
/// [gonzalez1985]; and for each point which of them is nearest. Stops early when all points are within `spacing` [mm].
pub fn farthest(points: &[Point], count: usize, spacing: f64) -> (Vec<usize>, Vec<u32>) {
    let mut chosen = Vec::new();
    let mut nearest = vec![0u32; points.len()];
    if points.is_empty() {
        return (chosen, nearest);
    }
    let mean = points.iter().map(|p| p.coords).sum::<Vector>() / points.len() as f64;
    let mut distance: Vec<f64> = points.iter().map(|p| (p.coords - mean).norm_squared()).collect();
    let mut next = argmax(&distance);
    distance.fill(f64::INFINITY);
    while chosen.len() < count && distance[next] > spacing * spacing {
        let centre = points[next];
        let rank = chosen.len() as u32;
        chosen.push(next);
        for (i, p) in points.iter().enumerate() {
            let d = (p - centre).norm_squared();
            if d < distance[i] {
                distance[i] = d;
                nearest[i] = rank;
            }
        }
        next = argmax(&distance);
    }
    (chosen, nearest)
}

fn argmax(values: &[f64]) -> usize {
    (0..values.len()).fold(0, |best, i| if values[i] > values[best] { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;

    #[test]
    fn samples_lie_on_the_surface_and_cover_it_evenly() {
        let samples = spread(&icosphere(10.0, 3), 2000);
        assert_eq!(samples.points.len(), 2000);
        let up = samples.points.iter().filter(|p| p.z > 5.0).count();
        assert!((up as f64 / 2000.0 - 0.25).abs() < 0.02, "cap holds a quarter of the area, found {up} of 2000");
        assert!(samples.points.iter().zip(&samples.normals).all(|(p, n)| p.coords.normalize().dot(n) > 0.99));
    }

    #[test]
    fn farthest_points_keep_their_distance() {
        let points = icosphere(10.0, 3).vertices;
        let (chosen, nearest) = farthest(&points, 40, 0.0);
        assert_eq!(chosen.len(), 40);
        assert!(nearest.iter().zip(&points).all(|(k, p)| (points[chosen[*k as usize]] - p).norm() < 4.5));
    }
}

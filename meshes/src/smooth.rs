//! Smoothing that does not shrink.

use crate::Vector;
use crate::surface::TriMesh;
use crate::topology::vertex_neighbours;

/// How to smooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaubinOptions {
    /// Weight of the shrinking step [-].
    pub lambda: f64,
    /// Pass-band frequency k = 1/lambda + 1/mu [-].
    pub pass_band: f64,
    /// Pairs of a shrinking and a growing step [-].
    pub rounds: usize,
}

impl Default for TaubinOptions {
    fn default() -> Self {
        TaubinOptions { lambda: 0.5, pass_band: 0.1, rounds: 10 }
    }
}

/// Smooths without shrinking: a step of weight lambda towards the neighbours' centre and one of weight mu < 0 away from it
/// [taubin1995]; neighbours weigh as one over their distance, so that uneven triangles do not drift. Vertices with `fixed` stay.
pub fn taubin(mesh: &mut TriMesh, fixed: &[bool], options: &TaubinOptions) {
    let neighbours = vertex_neighbours(mesh);
    let mu = 1.0 / (options.pass_band - 1.0 / options.lambda);
    for _ in 0..options.rounds {
        for weight in [options.lambda, mu] {
            let step: Vec<Vector> = neighbours
                .iter()
                .enumerate()
                .map(
                    |(v, list)| {
                        if fixed.get(v).copied().unwrap_or(false) { Vector::zeros() } else { umbrella(mesh, v, list) }
                    },
                )
                .collect();
            for (p, s) in mesh.vertices.iter_mut().zip(step) {
                *p += s * weight;
            }
        }
    }
}

fn umbrella(mesh: &TriMesh, v: usize, neighbours: &[u32]) -> Vector {
    let p = mesh.vertices[v];
    let (mut sum, mut total) = (Vector::zeros(), 0.0);
    for &w in neighbours {
        let d = mesh.vertices[w as usize] - p;
        let weight = 1.0 / d.norm().max(1e-6);
        sum += d * weight;
        total += weight;
    }
    if total > 0.0 { sum / total } else { sum }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;

    #[test]
    fn noise_falls_and_volume_stays() {
        let mut sphere = icosphere(20.0, 5);
        for (i, p) in sphere.vertices.iter_mut().enumerate() {
            let noise = 2.0 * ((i as f64 * 12.9898).sin() * 43_758.545_3).fract();
            p.coords *= 1.0 + 0.1 * noise / 20.0;
        }
        let spread = |m: &TriMesh| {
            let r: Vec<f64> = m.vertices.iter().map(|p| p.coords.norm()).collect();
            let mean = r.iter().sum::<f64>() / r.len() as f64;
            (r.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / r.len() as f64).sqrt()
        };
        let (before, volume) = (spread(&sphere), sphere.volume());
        taubin(&mut sphere, &[], &TaubinOptions::default());
        assert!(spread(&sphere) < 0.6 * before, "{} {before}", spread(&sphere));
        assert!((sphere.volume() / volume - 1.0).abs() < 1e-3);
    }
}

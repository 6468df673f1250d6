//! Kernel regression of displacements, known to its users as a generalised regression neural network [specht1991].

use crate::{Point, Vector};
use rayon::prelude::*;

/// Weight of standing still, against 1 for a sample at the place itself.
const STILL: f64 = 1.0;

/// Displacements [mm] at `places`: the mean of the samples' vectors, weighted by exp(-d^2 / 2 spread^2).
///
/// Ours differs from the plain mean: standing still has a weight too, so that the field fades out beyond the samples
/// instead of keeping the value of the last one; samples farther than four spreads do not count.
/// Each place sums in the order of the samples. Cost O(places x samples).
pub fn displacements(samples: &[(Point, Vector)], spread: f64, places: &[Point]) -> Vec<Vector> {
    let scale = -0.5 / (spread * spread);
    let reach = 16.0 * spread * spread;
    let pushing = samples.iter().filter(|s| s.1 != Vector::zeros()).map(|s| s.0.coords);
    let Some((lo, hi)) = pushing.map(|p| (p, p)).reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1))) else {
        return vec![Vector::zeros(); places.len()];
    };
    let (lo, hi) = (lo.add_scalar(-4.0 * spread), hi.add_scalar(4.0 * spread));
    let at = |place: &Point| {
        if place.coords.inf(&lo) != lo || place.coords.sup(&hi) != hi {
            return Vector::zeros();
        }
        let (mut sum, mut weights) = (Vector::zeros(), STILL);
        for (point, vector) in samples {
            let squared = (place - point).norm_squared();
            if squared < reach {
                let weight = (scale * squared).exp();
                weights += weight;
                sum += vector * weight;
            }
        }
        sum / weights
    };
    places.par_iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dense_constant_field_is_kept_and_fades_out() {
        let push = Vector::new(0.1, -0.2, 0.3);
        let sample = |i: u32| (Point::new(f64::from(i % 40) * 0.1, f64::from(i / 40) * 0.1, 0.0), push);
        let samples: Vec<(Point, Vector)> = (0..1600).map(sample).collect();
        let places: Vec<Point> = (0..100).map(|i| Point::new(2.0 + 0.1 * f64::from(i), 2.0, 0.0)).collect();
        let moved = displacements(&samples, 1.0, &places);
        assert!((moved[0] - push).norm() < 0.01 * push.norm());
        assert_eq!(moved[99], Vector::zeros());
        // Nowhere a step: neighbouring places move alike.
        assert!(moved.windows(2).all(|w| w[1].norm() <= w[0].norm() && (w[1] - w[0]).norm() < 0.1 * push.norm()));
    }

    #[test]
    fn the_field_lies_between_its_samples() {
        let samples = [(Point::origin(), Vector::x()), (Point::new(4.0, 0.0, 0.0), Vector::zeros())];
        let middle = displacements(&samples, 2.0, &[Point::new(2.0, 0.0, 0.0), Point::new(1.0, 0.0, 0.0)]);
        assert!(middle[0].x > 0.2 && middle[0].x < 0.5);
        assert!(middle[1].x > middle[0].x && middle[1].x < 1.0);
    }
}

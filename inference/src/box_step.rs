//! The least point of a quadratic form in a box, walls by an active set.

use nalgebra::{DMatrix, DVector};

/// Least and largest that a number may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least.
    pub low: f64,
    /// Largest.
    pub high: f64,
}

impl Bounds {
    /// The value within the bounds that is nearest to `x`.
    pub fn clamp(self, x: f64) -> f64 {
        x.clamp(self.low, self.high)
    }

    /// The same bounds, counted from `x`.
    pub(crate) fn from(self, x: f64) -> Bounds {
        Bounds { low: self.low - x, high: self.high - x }
    }
}

/// Least of `g d + d H d / 2` with `room` for each number of `d`, for a positive definite H: a primal active-set method [nocedal2006, section 16.5]
/// from d = 0, one wall at a time.
pub(crate) fn box_step(hessian: &DMatrix<f64>, gradient: &DVector<f64>, room: &[Bounds]) -> DVector<f64> {
    let n = room.len();
    let (low, high): (Vec<f64>, Vec<f64>) = room.iter().map(|r| (r.low.min(0.0), r.high.max(0.0))).unzip();
    let mut step = DVector::zeros(n);
    let mut fixed: Vec<bool> =
        (0..n).map(|k| (low[k] >= 0.0 && gradient[k] > 0.0) || (high[k] <= 0.0 && gradient[k] < 0.0)).collect();
    for _ in 0..6 * n + 6 {
        let free: Vec<usize> = (0..n).filter(|&k| !fixed[k]).collect();
        let Some(way) = newton(hessian, gradient, &step, &free) else { break };
        let room = |a: usize| {
            let (k, d) = (free[a], way[a]);
            let limit = if d > 0.0 { high[k] } else { low[k] };
            if d == 0.0 { f64::INFINITY } else { ((limit - step[k]) / d).max(0.0) }
        };
        let first =
            (0..free.len()).map(|a| (room(a), a)).fold((1.0, None), |m, (t, a)| if t < m.0 { (t, Some(a)) } else { m });
        for (a, &k) in free.iter().enumerate() {
            step[k] = (step[k] + first.0 * way[a]).clamp(low[k], high[k]);
        }
        if let Some(a) = first.1 {
            let k = free[a];
            step[k] = if way[a] > 0.0 { high[k] } else { low[k] };
            fixed[k] = true;
            continue;
        }
        let slope = gradient + hessian * &step;
        let pull = |k: usize| if step[k] <= low[k] { -slope[k] } else { slope[k] };
        let back = (0..n).filter(|&k| fixed[k] && high[k] > low[k]).map(|k| (pull(k), k));
        match back.fold((1e-12 * gradient.amax(), None), |m, (p, k)| if p > m.0 { (p, Some(k)) } else { m }).1 {
            Some(k) => fixed[k] = false,
            None => break,
        }
    }
    step
}

/// The way from the step to the least over the free coordinates; `None` where the Hessian is not positive definite.
fn newton(
    hessian: &DMatrix<f64>,
    gradient: &DVector<f64>,
    step: &DVector<f64>,
    free: &[usize],
) -> Option<DVector<f64>> {
    let slope = gradient + hessian * step;
    let h = DMatrix::from_fn(free.len(), free.len(), |a, b| hessian[(free[a], free[b])]);
    let rhs = DVector::from_fn(free.len(), |a, _| -slope[free[a]]);
    if free.is_empty() { Some(rhs) } else { h.cholesky().map(|c| c.solve(&rhs)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_step_is_no_worse_than_any_point_of_a_grid() {
        let h = DMatrix::from_row_slice(2, 2, &[2.0, 1.8, 1.8, 2.0]);
        for g in [[-3.0, 1.0], [1.0, -3.0], [-1.0, -1.0], [0.5, 0.2], [-2.0, 3.0]] {
            let g = DVector::from_row_slice(&g);
            let value = |d: &DVector<f64>| g.dot(d) + 0.5 * d.dot(&(&h * d));
            let room = [0.4, 0.7].map(|x: f64| Bounds { low: -x, high: (1.0 - x).min(0.5) });
            let step = box_step(&h, &g, &room);
            let best = value(&step);
            for i in 0..=50 {
                for j in 0..=50 {
                    let (x, y) = (f64::from(i) / 50.0 - 0.4, f64::from(j) / 50.0 - 0.7);
                    if x.abs() <= 0.5 && y.abs() <= 0.5 {
                        assert!(best <= value(&DVector::from_row_slice(&[x, y])) + 1e-9, "{g:?} {step:?} {x} {y}");
                    }
                }
            }
        }
    }
}

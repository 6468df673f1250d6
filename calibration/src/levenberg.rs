//! Least squares in a unit box by Levenberg and Marquardt [marquardt1963], walls by an active set.

use nalgebra::{DMatrix, DVector};

/// A sum of squares at a point: residuals and their derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Residuals {
    /// The residuals.
    pub value: DVector<f64>,
    /// A row a residual, a column a coordinate.
    pub jacobian: DMatrix<f64>,
}

impl Residuals {
    /// Half the sum of squares.
    pub fn half_sum(&self) -> f64 {
        0.5 * self.value.norm_squared()
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Most evaluations.
    pub evaluations: usize,
    /// Relative fall of the sum below which it has converged [-].
    pub fall: f64,
}

/// Where a descent ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Descent {
    /// The point.
    pub point: Vec<f64>,
    /// Residuals and derivatives there.
    pub residuals: Residuals,
    /// Evaluations spent.
    pub evaluations: usize,
}

/// Descends from a point of the unit box; `None` when the start cannot be evaluated. A point that cannot be evaluated is a failed step.
pub fn descend(start: &[f64], evaluate: &dyn Fn(&[f64]) -> Option<Residuals>, stop: Stop) -> Option<Descent> {
    let mut point: Vec<f64> = start.iter().map(|x| x.clamp(0.0, 1.0)).collect();
    let mut here = evaluate(&point)?;
    let (mut damping, mut growth, mut evaluations, mut small) = (1e-2, 2.0, 1, 0);
    while evaluations < stop.evaluations {
        let hessian = here.jacobian.tr_mul(&here.jacobian);
        let gradient = here.jacobian.tr_mul(&here.value);
        let mut damped = hessian.clone();
        for k in 0..point.len() {
            damped[(k, k)] += damping * hessian[(k, k)].max(1e-12);
        }
        let step = box_step(&damped, &gradient, &point, f64::INFINITY);
        let promised = -(gradient.dot(&step) + 0.5 * step.dot(&(&hessian * &step)));
        if step.amax() < 1e-9 || promised <= 1e-14 * here.half_sum() {
            break;
        }
        let tried: Vec<f64> = point.iter().zip(step.iter()).map(|(x, d)| (x + d).clamp(0.0, 1.0)).collect();
        evaluations += 1;
        let next = evaluate(&tried).filter(|r| r.half_sum() < here.half_sum());
        let Some(next) = next else {
            damping *= growth;
            growth *= 2.0;
            if damping > 1e10 {
                break;
            }
            continue;
        };
        let fall = here.half_sum() - next.half_sum();
        small = if fall < stop.fall * here.half_sum() { small + 1 } else { 0 };
        let gain = (fall / promised).min(2.0);
        damping = (damping * (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 3.0)).max(1e-9);
        growth = 2.0;
        (point, here) = (tried, next);
        if small >= 2 {
            break;
        }
    }
    Some(Descent { point, residuals: here, evaluations })
}

/// Least of `g d + d H d / 2` with `point + d` in the unit box and no coordinate of `d` beyond `radius`, for a positive definite H: a primal
/// active-set method [nocedal2006, section 16.5] from d = 0, one wall at a time.
pub fn box_step(hessian: &DMatrix<f64>, gradient: &DVector<f64>, point: &[f64], radius: f64) -> DVector<f64> {
    let n = point.len();
    let low: Vec<f64> = point.iter().map(|x| (-x).max(-radius)).collect();
    let high: Vec<f64> = point.iter().map(|x| (1.0 - x).min(radius)).collect();
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

    const STOP: Stop = Stop { evaluations: 200, fall: 1e-12 };

    /// Fits a exp(-b t) with a = 4 x, b = 6 y.
    fn decay(p: &[f64]) -> Option<Residuals> {
        let t = |i: usize| 0.1 * i as f64;
        let (a, b) = (4.0 * p[0], 6.0 * p[1]);
        let value = DVector::from_fn(20, |i, _| a * (-b * t(i)).exp() - 2.0 * (-3.0 * t(i)).exp());
        let jacobian = DMatrix::from_fn(20, 2, |i, k| (-b * t(i)).exp() * if k == 0 { 4.0 } else { -6.0 * t(i) * a });
        Some(Residuals { value, jacobian })
    }

    #[test]
    fn finds_the_truth_inside_and_the_wall_before_it() {
        let fit = descend(&[0.9, 0.1], &decay, STOP).unwrap();
        assert!((fit.point[0] - 0.5).abs() < 1e-6 && (fit.point[1] - 0.5).abs() < 1e-6, "{:?}", fit.point);
        // the least of |d - target| in the box is the nearest point of the box
        let target = [1.7, 0.3, -0.4];
        let miss = |p: &[f64]| {
            let value = DVector::from_fn(3, |i, _| p[i] - target[i]);
            Some(Residuals { value, jacobian: DMatrix::identity(3, 3) })
        };
        let fit = descend(&[0.5; 3], &miss, STOP).unwrap();
        assert!(fit.point.iter().zip([1.0, 0.3, 0.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{:?}", fit.point);
    }

    #[test]
    fn the_box_step_is_no_worse_than_any_point_of_a_grid() {
        let h = DMatrix::from_row_slice(2, 2, &[2.0, 1.8, 1.8, 2.0]);
        for g in [[-3.0, 1.0], [1.0, -3.0], [-1.0, -1.0], [0.5, 0.2], [-2.0, 3.0]] {
            let g = DVector::from_row_slice(&g);
            let value = |d: &DVector<f64>| g.dot(d) + 0.5 * d.dot(&(&h * d));
            let step = box_step(&h, &g, &[0.4, 0.7], 0.5);
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

    #[test]
    fn points_that_cannot_be_evaluated_are_stepped_back_from() {
        let part = |p: &[f64]| decay(p).filter(|_| p[0] > 0.2);
        let fit = descend(&[0.9, 0.1], &part, STOP).unwrap();
        assert!((fit.point[0] - 0.5).abs() < 1e-5);
        assert!(descend(&[0.1, 0.1], &part, STOP).is_none());
    }
}

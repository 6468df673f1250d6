//! Least squares under a standard normal prior by Levenberg and Marquardt [marquardt1963].

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Half a sum of squares at a point: its value, gradient and Gauss-Newton Hessian, the prior included.
#[derive(Clone, Debug)]
pub struct Quadratic {
    /// Half the sum of squares.
    pub value: f64,
    /// Its gradient.
    pub gradient: DVector<f64>,
    /// Its Hessian without second derivatives of the residuals; positive definite by the prior.
    pub hessian: DMatrix<f64>,
}

impl Quadratic {
    /// The Hessian's factor.
    pub fn factor(&self) -> Option<Cholesky<f64, Dyn>> {
        Cholesky::new(self.hessian.clone())
    }

    /// The step to the least point of the quadratic form, each diagonal entry enlarged by the share `damping`.
    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut damped = self.hessian.clone();
        (0..damped.nrows()).for_each(|k| damped[(k, k)] *= 1.0 + damping);
        Some(-Cholesky::new(damped)?.solve(&self.gradient))
    }

    /// By how much the form falls along a step.
    fn fall(&self, step: &DVector<f64>) -> f64 {
        -(self.gradient.dot(step) + 0.5 * step.dot(&(&self.hessian * step)))
    }
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Most evaluations.
    pub evaluations: usize,
    /// Fall of half the sum of squares below which it has converged [-]: log probability.
    pub fall: f64,
}

/// Where a descent ended.
#[derive(Clone, Debug)]
pub struct Least<S> {
    /// The point.
    pub z: DVector<f64>,
    /// The quadratic form there.
    pub form: Quadratic,
    /// What the evaluation there left.
    pub state: S,
    /// Evaluations spent.
    pub evaluations: usize,
    /// Whether the last steps promised less than [`Stop::fall`].
    pub converged: bool,
}

/// Furthest that a number goes in one step [-], in standard deviations of its prior: no further than samples of the prior lie apart.
const LONGEST: f64 = 2.5;

/// Descends from `start`; `None` when it cannot be evaluated. A point that cannot be evaluated is a failed step.
pub fn descend<S: Clone>(
    start: DVector<f64>,
    mut evaluate: impl FnMut(&DVector<f64>, Option<(&DVector<f64>, &S)>) -> Option<(Quadratic, S)>,
    stop: Stop,
) -> Option<Least<S>> {
    let mut z = start;
    let (mut form, mut state) = evaluate(&z, None)?;
    let (mut damping, mut growth, mut evaluations, mut converged) = (1e-3, 4.0, 1, false);
    while evaluations < stop.evaluations {
        let Some(mut step) = form.step(damping) else { break };
        let most = step.amax();
        if most > LONGEST {
            step *= LONGEST / most;
        }
        let promised = form.fall(&step);
        if promised < stop.fall {
            converged = true;
            break;
        }
        let tried = &z + &step;
        evaluations += 1;
        let next = evaluate(&tried, Some((&z, &state))).filter(|(f, _)| f.value < form.value);
        let Some((next, left)) = next else {
            damping *= growth;
            growth *= 2.0;
            if damping > 1e8 {
                break;
            }
            continue;
        };
        let gain = ((form.value - next.value) / promised).min(2.0);
        damping = (damping * (1.0 - (2.0 * gain - 1.0).powi(3)).max(0.1)).max(1e-6);
        growth = 4.0;
        (z, form, state) = (tried, next, left);
    }
    Some(Least { z, form, state, evaluations, converged })
}

//! Least squares under a prior, within bounds where there are some, by Levenberg and Marquardt [marquardt1963], with steps no longer than they are trusted
//! [conn2000].

pub use crate::box_step::Bounds;
use crate::box_step::box_step;
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

    /// The step to the least point of the quadratic form with `room` for each number, each diagonal entry enlarged by the share `damping`.
    fn step(&self, damping: f64, room: &[Bounds]) -> Option<DVector<f64>> {
        let mut damped = self.hessian.clone();
        (0..damped.nrows()).for_each(|k| damped[(k, k)] *= 1.0 + damping);
        if room.is_empty() {
            return Some(-Cholesky::new(damped)?.solve(&self.gradient));
        }
        Some(box_step(&damped, &self.gradient, room))
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
    /// Half the sum of squares above which a fit is poor [-], and which of its valleys it lies in no matter.
    pub poor: f64,
    /// Most evaluations of a poor fit.
    pub poor_evaluations: usize,
}

impl Stop {
    /// After so many evaluations, however poor the fit, or a smaller fall than this.
    pub fn after(evaluations: usize, fall: f64) -> Stop {
        Stop { evaluations, fall, poor: f64::INFINITY, poor_evaluations: evaluations }
    }

    fn allows(&self, evaluations: usize, value: f64) -> bool {
        evaluations < if value > self.poor { self.poor_evaluations.min(self.evaluations) } else { self.evaluations }
    }
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
/// Damping of the first step, and the least of all [-]. Where bundles fall slack the form bends within a step: with less damping real knees' steps were
/// the same, and as many were refused.
const DAMPING: [f64; 2] = [1e-2, 3e-3];
/// Least damping after a refused step [-]: less did not change the next one.
const AFTER_REFUSAL: f64 = 0.1;
/// Share of a refused step that is tried next, at least, at most, and where there was no answer [-].
const SHARE: [f64; 3] = [0.1, 0.5, 0.25];
/// Share of the promised fall that a good step and a poor step bring [-], by which the trusted length grows and shrinks [conn2000].
const GOOD_AND_POOR: [f64; 2] = [0.75, 0.25];
/// Factors on the length of a good and a poor step that is trusted next [-] [conn2000].
const LENGTHS: [f64; 2] = [3.0, 0.7];
/// Damping at which a search gives up [-].
const STUCK: f64 = 1e8;

/// How far the quadratic form is trusted.
struct Trust {
    damping: f64,
    growth: f64,
    length: f64,
}

impl Trust {
    fn new() -> Trust {
        Trust { damping: DAMPING[0], growth: 4.0, length: f64::INFINITY }
    }

    /// The next step; `None` where the form has none.
    fn step(&self, form: &Quadratic, room: &[Bounds]) -> Option<DVector<f64>> {
        let mut step = form.step(self.damping, room)?;
        let most = step.amax();
        if most > LONGEST {
            step *= LONGEST / most;
        }
        let length = step.norm();
        if length > self.length {
            step *= self.length / length;
        }
        Some(step)
    }

    /// A step was refused: the next one ends where a parabola through both values has its least.
    fn refused(&mut self, form: &Quadratic, step: &DVector<f64>, reached: Option<f64>) {
        let slope = form.gradient.dot(step);
        let least = |r: f64| (-slope / (2.0 * (r - form.value - slope))).clamp(SHARE[0], SHARE[1]);
        self.length = reached.map_or(SHARE[2], least) * step.norm();
        self.damping = (self.damping * self.growth).max(AFTER_REFUSAL);
        self.growth *= 2.0;
    }

    /// A step was taken that brought `gain` times the promised fall.
    fn taken(&mut self, gain: f64, step: &DVector<f64>) {
        let length = step.norm();
        if gain > GOOD_AND_POOR[0] {
            self.length = self.length.max(LENGTHS[0] * length);
        } else if gain < GOOD_AND_POOR[1] {
            self.length = self.length.min(LENGTHS[1] * length);
        }
        self.damping = (self.damping * (1.0 - (2.0 * gain.min(2.0) - 1.0).powi(3)).max(0.1)).max(DAMPING[1]);
        self.growth = 4.0;
    }
}

/// Descends from `start`, each number within its own of the `bounds` where there are some; `None` when it cannot be evaluated. A point that cannot be
/// evaluated is a failed step.
pub fn descend<S>(
    start: DVector<f64>,
    bounds: &[Bounds],
    mut evaluate: impl FnMut(&DVector<f64>, Option<(&DVector<f64>, &S)>) -> Option<(Quadratic, S)>,
    stop: Stop,
) -> Option<Least<S>> {
    let mut z = start;
    let (mut form, mut state) = evaluate(&z, None)?;
    let (mut trust, mut evaluations, mut converged) = (Trust::new(), 1, false);
    while stop.allows(evaluations, form.value) && trust.damping <= STUCK {
        let room: Vec<Bounds> = bounds.iter().zip(&z).map(|(b, x)| b.from(*x)).collect();
        let Some(step) = trust.step(&form, &room) else { break };
        let promised = form.fall(&step);
        if promised < stop.fall || promised.is_nan() {
            converged = !promised.is_nan();
            break;
        }
        let mut tried = &z + &step;
        tried.iter_mut().zip(bounds).for_each(|(x, b)| *x = b.clamp(*x));
        evaluations += 1;
        let found = evaluate(&tried, Some((&z, &state)));
        let reached = found.as_ref().map(|(f, _)| f.value);
        let Some((next, left)) = found.filter(|(f, _)| f.value < form.value) else {
            trust.refused(&form, &step, reached);
            continue;
        };
        trust.taken((form.value - next.value) / promised, &step);
        (z, form, state) = (tried, next, left);
    }
    Some(Least { z, form, state, evaluations, converged })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bundle's kind of form: a number is pulled to 3, and another residual, 40 times as steep, begins where the number is above 1.
    fn kinked(z: &DVector<f64>) -> (Quadratic, ()) {
        let (pull, bent) = (z[0] - 3.0, 40.0 * (z[0] - 1.0).max(0.0));
        let steep = if bent > 0.0 { 40.0 } else { 0.0 };
        let value = 0.5 * (z[0] * z[0] + pull * pull + bent * bent);
        let gradient = DVector::from_element(1, z[0] + pull + steep * bent);
        (Quadratic { value, gradient, hessian: DMatrix::from_element(1, 1, 2.0 + steep * steep) }, ())
    }

    #[test]
    fn the_least_point_behind_a_kink_is_found_from_either_side() {
        // where all three residuals pull: z + (z - 3) + 1600 (z - 1) = 0
        let least = 1603.0 / 1602.0;
        for start in [-4.0, 0.0, 0.9, 1.1, 4.0] {
            let stop = Stop::after(12, 1e-6);
            let found = descend(DVector::from_element(1, start), &[], |z, _| Some(kinked(z)), stop).unwrap();
            let above = found.form.value - kinked(&DVector::from_element(1, least)).0.value;
            assert!((0.0..0.05).contains(&above), "{start}: {above} above the least after {}", found.evaluations);
        }
    }

    #[test]
    fn a_refused_step_is_followed_by_a_shorter_one_and_an_answer_missing_costs_no_fit() {
        let mut asked = Vec::new();
        let wall = |z: &DVector<f64>, _: Option<(&DVector<f64>, &())>| {
            asked.push(z[0]);
            (z[0] < 1.2).then(|| {
                let of = |x: f64| DVector::from_element(1, x);
                let value = 0.5 * (z[0] * z[0] + 9.0 * (z[0] - 2.0).powi(2));
                (
                    Quadratic {
                        value,
                        gradient: of(z[0] + 9.0 * (z[0] - 2.0)),
                        hessian: DMatrix::from_element(1, 1, 10.0),
                    },
                    (),
                )
            })
        };
        let found = descend(DVector::zeros(1), &[], wall, Stop::after(20, 1e-4)).unwrap();
        assert!(found.z[0] > 1.0 && found.z[0] < 1.2, "{}", found.z[0]);
        assert!(asked[1] > 1.2 && asked[2] < 0.6 * asked[1], "{asked:?}");
    }

    /// A valley along which two numbers hang together, its least at (3, -1) outside of the unit box.
    fn valley(z: &DVector<f64>) -> (Quadratic, ()) {
        let hessian = DMatrix::from_row_slice(2, 2, &[2.0, 1.8, 1.8, 2.0]);
        let from = z - DVector::from_vec(vec![3.0, -1.0]);
        let gradient = &hessian * &from;
        (Quadratic { value: 0.5 * from.dot(&gradient), gradient, hessian }, ())
    }

    #[test]
    fn bounds_are_kept_and_the_least_point_within_them_is_found() {
        let bounds = [Bounds { low: 0.0, high: 1.0 }; 2];
        let value = |x: f64, y: f64| valley(&DVector::from_vec(vec![x, y])).0.value;
        let grid = (0..=50).flat_map(|i| (0..=50).map(move |j| (f64::from(i) / 50.0, f64::from(j) / 50.0)));
        let least = grid.map(|(x, y)| value(x, y)).fold(f64::INFINITY, f64::min);
        for start in [[0.0, 0.0], [1.0, 1.0], [0.5, 0.9]] {
            let within = |z: &DVector<f64>| z.iter().zip(&bounds).all(|(x, b)| (b.low..=b.high).contains(x));
            let evaluate = |z: &DVector<f64>, _: Option<(&DVector<f64>, &())>| {
                assert!(within(z), "{z}");
                Some(valley(z))
            };
            let found = descend(DVector::from_row_slice(&start), &bounds, evaluate, Stop::after(20, 1e-9)).unwrap();
            assert!(found.form.value < least + 1e-6, "{start:?}: {} beside {least}", found.form.value);
        }
        // a number that is held stays, and the other goes where it is least beside it
        let held = [Bounds { low: 0.5, high: 0.5 }, Bounds { low: -10.0, high: 10.0 }];
        let found =
            descend(DVector::from_element(2, 0.5), &held, |z, _| Some(valley(z)), Stop::after(20, 1e-12)).unwrap();
        assert!(found.z[0] == 0.5 && (found.z[1] - 1.25).abs() < 1e-3, "{}", found.z);
    }

    #[test]
    fn a_poor_fit_ends_sooner() {
        let evaluations = |poor: f64| {
            let stop = Stop { poor, poor_evaluations: 2, ..Stop::after(12, 1e-9) };
            descend(DVector::from_element(1, -4.0), &[], |z, _| Some(kinked(z)), stop).unwrap().evaluations
        };
        assert_eq!(evaluations(0.1), 2);
        assert!(evaluations(1e9) > 2);
    }
}

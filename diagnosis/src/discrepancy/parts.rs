//! Components of a field: its value in every trial.

use super::kinds::{Bone, Course, Kind, LOADS, MIDDLE, Part, amplitude};
use super::suspects::{acting, impinging, larger, pulls, swayed};
use crate::fit::Fit;
use crate::problem::Problem;
use crate::problem::trial::PER_UNIT;
use nalgebra::DMatrix;
use sim::coordinate::{Coordinate, FE, FREE, Six};
use sim::equilibrium::Start;

/// Over which flexion and which motion the field changes, in the order of [`Six`] [rad, mm].
const RANGES: [f64; 6] = [0.52, 0.05, 0.17, 4.0, 5.0, 4.0];
/// Share of a field's largest component below which its components are left out [-].
const SMALL: f64 = 1e-4;

/// Independent components of a field of amplitude 1 about a fit, whose ligaments leave the knee at the poses `unloaded`; none where the model has nothing of
/// what it is about.
pub(super) fn parts(problem: &Problem, (fit, unloaded): (&Fit, &[Start]), kind: &Kind) -> Vec<Part> {
    match kind.course {
        Course::Larger { apart } => acting(problem, fit, kind, &|here| vec![larger(here, apart)]),
        Course::Impinging(from) => acting(problem, fit, kind, &|here| vec![impinging(here, from)]),
        Course::Pull(bone) => acting(problem, fit, kind, &|here| pulls(here, bone).to_vec()),
        Course::Sway(bone) => sways(problem, fit, kind, bone),
        _ => {
            let coordinates = kind.only.as_ref().map_or(&FREE[..], std::slice::from_ref);
            coordinates.iter().flat_map(|&c| along(problem, (fit, unloaded), kind, c)).collect()
        }
    }
}

/// Those in coordinate `c`.
fn along(problem: &Problem, (fit, unloaded): (&Fit, &[Start]), kind: &Kind, c: Coordinate) -> Vec<Part> {
    let n = problem.trials.len();
    let acts = |i: usize| problem.acts(kind.scope, problem.trials[i].source);
    let amplitude = amplitude(kind.is_force, c);
    let column = |value: &dyn Fn(usize) -> f64| -> Part {
        let at = |i: usize| if acts(i) { amplitude * value(i) } else { 0.0 };
        (0..n).map(|i| Six::from_fn(|k, _| if k == c.index() { at(i) } else { 0.0 })).collect()
    };
    let load = |i: usize, d: Coordinate| problem.trials[i].load()[d] / LOADS[d.index()];
    let moved = |i: usize| fit.linear.rests[i].q[c] - unloaded[i].q[c];
    match kind.course {
        Course::Constant => vec![column(&|_| 1.0)],
        Course::Load => vec![column(&|i| load(i, c))],
        Course::Across(d) => vec![column(&|i| load(i, d))],
        Course::Scale => vec![column(&|i| moved(i) / RANGES[c.index()])],
        Course::Stop { sign, from } => {
            let farthest = (0..n).filter(|&i| acts(i)).map(|i| sign * moved(i)).fold(0.0, f64::max);
            vec![column(&|i| -sign * (sign * moved(i) - from * farthest).max(0.0) / (0.5 * RANGES[c.index()]))]
        }
        Course::Near { bent } => {
            let to = |i: usize| (problem.trials[i].flexion() / MIDDLE - 1.0) * if bent { 1.0 } else { -1.0 };
            vec![column(&|i| to(i).max(0.0))]
        }
        Course::Flexion | Course::Motion => {
            let correlation = DMatrix::from_fn(n, n, |i, k| {
                let mut d = ((problem.trials[i].flexion() - problem.trials[k].flexion()) / RANGES[FE.index()]).powi(2);
                if kind.course == Course::Motion {
                    d += ((moved(i) - moved(k)) / RANGES[c.index()]).powi(2);
                }
                if acts(i) && acts(k) { (-0.5 * d).exp() } else { 0.0 }
            });
            let eigen = correlation.symmetric_eigen();
            let least = SMALL * eigen.eigenvalues.max();
            let pairs = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).filter(|(v, _)| **v > least);
            pairs.map(|(value, vector)| column(&|i| value.sqrt() * vector[i])).collect()
        }
        Course::Sway(_) | Course::Larger { .. } | Course::Impinging(_) | Course::Pull(_) => vec![],
    }
}

/// A bone's frame turned with the size of the load, an axis a component.
fn sways(problem: &Problem, fit: &Fit, kind: &Kind, bone: Bone) -> Vec<Part> {
    let misread = |i: usize, axis: usize| -> Six {
        let trial = &problem.trials[i];
        if !problem.acts(kind.scope, trial.source) {
            return Six::zeros();
        }
        let gs = problem.models.of(trial.source).joint.grood_suntay(&fit.linear.rests[i].q);
        let by = swayed(&gs, &trial.load(), bone)[axis];
        let mut out = Six::zeros();
        out[FE] = by[FE].to_degrees();
        FREE.iter().zip(PER_UNIT).for_each(|(&c, unit)| out[c] = by[c] / unit);
        out
    };
    (0..3).map(|axis| (0..problem.trials.len()).map(|i| misread(i, axis)).collect()).collect()
}

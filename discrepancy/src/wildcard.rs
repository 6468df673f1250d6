//! Candidate zero: fields of generalised forces, or of misreadings, of no name, from the same in every trial to smooth in flexion and motion, along the
//! load or across it. Where they explain what a named effect leaves, or more than it does, the answer is outside the catalogue.

mod words;

use crate::covariance::Readings;
use crate::equilibrium::Bench;
use crate::error::DiscrepancyError;
use crate::fit::Fit;
use crate::problem::{Problem, Scope};
use crate::robust::price;
use crate::screen::Marginal;
use crate::slopes::Slopes;
use crate::trial::READ;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sim::joint::{FE, Six};

/// Amplitudes of the force field: VV, IE [N mm], ML, AP, SI [N].
const FORCES: [f64; 5] = [3000.0, 1000.0, 20.0, 20.0, 40.0];
/// Amplitudes of misreadings: VV, IE [deg], ML, AP, SI [mm].
const READINGS: [f64; 5] = [2.0, 2.0, 2.0, 2.0, 2.0];
/// Over which flexion [rad] and over which motion (rotations [rad], translations [mm]) the field changes.
const RANGES: (f64, [f64; 5]) = (0.52, [0.05, 0.17, 4.0, 5.0, 4.0]);
/// Amplitude of a misread flexion [deg].
const FLEXION: f64 = 3.0;
/// The coordinate of a misread flexion, after the five of a reading.
const BENT: usize = 5;

/// Sizes of a field over those amplitudes [-].
const SIZES: [f64; 3] = [0.3, 1.0, 3.0];
/// Loads that count as one: VV, IE [N mm], ML, AP, SI [N].
const LOADS: [f64; 5] = [5000.0, 4000.0, 100.0, 100.0, 100.0];
/// Share of a field's largest component below which its components are left out [-].
const SMALL: f64 = 1e-4;

/// What a field follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// Nothing: the same in every trial.
    Constant,
    /// Flexion.
    Flexion,
    /// Flexion and the motion from the unloaded pose.
    Motion,
    /// The load along its coordinate.
    Load,
    /// The load along another.
    Across(usize),
    /// The motion from the unloaded pose along its coordinate, in proportion: a reading of another scale.
    Scale,
}

/// A kind of field.
#[derive(Clone, Copy, Debug)]
struct Kind {
    is_force: bool,
    course: Course,
    scope: Scope,
    /// The only coordinate that it has (five of a reading, and flexion for misreadings); the five otherwise.
    only: Option<usize>,
}

impl Kind {
    /// Whether what it follows is anywhere: without load along an axis nothing follows that.
    fn is_felt(&self, problem: &Problem) -> bool {
        let axis = match self.course {
            Course::Load => self.only,
            Course::Across(d) => Some(d),
            _ => None,
        };
        let loaded = |d: usize| problem.trials.iter().any(|t| self.scope.covers(t.source) && t.load[READ[d]] != 0.0);
        axis.is_none_or(loaded)
    }
}

/// Size of a field in coordinate `c`: force [N mm, N] or misreading [deg, mm].
fn amplitude(is_force: bool, c: usize) -> f64 {
    match (is_force, c) {
        (_, BENT) => FLEXION,
        (true, _) => FORCES[c],
        (false, _) => READINGS[c],
    }
}

/// What the wildcard explains beyond a fit.
#[derive(Clone, Debug)]
pub struct Wildcard {
    /// Log Bayes factor of a field of unknown kind against the fit alone.
    pub log_bayes_factor: f64,
    /// Log evidence of the fit and a field of unknown kind, on the scale of [`Fit::log_evidence`]; linear about the fit.
    pub log_evidence: f64,
    /// Whether the best kind is a field of forces (or of misreadings).
    pub is_force: bool,
    /// What it follows.
    pub course: Course,
    /// Where it acts.
    pub scope: Scope,
    /// Its mean: generalised force [N mm, N] or misreading [deg, mm] in the five coordinates of a reading, then misread flexion [deg]; six a trial.
    pub mean: Vec<[f64; 6]>,
}

/// What moves a trial's readings: five loads, and a misread flexion.
#[derive(Clone, Copy, Debug)]
struct Response {
    loads: [[f64; 5]; 5],
    flexion: [f64; 5],
}

impl Response {
    /// Change of reading `d` by one unit of a field in coordinate `c`.
    fn by(&self, is_force: bool, c: usize, d: usize) -> f64 {
        match (is_force, c) {
            (true, _) => self.loads[c][d],
            (false, BENT) => self.flexion[d],
            (false, _) => f64::from(u8::from(d == c)),
        }
    }
}

/// Responses of all readings.
fn responses(problem: &Problem, fit: &Fit) -> Result<Vec<Response>, DiscrepancyError> {
    let model = problem.model_at(&fit.unknowns)?;
    Ok(problem
        .trials
        .par_iter()
        .zip(&fit.linear.rests)
        .map(|(trial, rest)| {
            let effects = problem.effects_in(trial.source, &fit.hypothesis, &fit.unknowns);
            let slopes = Slopes::new(Bench { model: &model, effects: &effects, place: &problem.place }, trial, rest);
            let mut bent = Six::zeros();
            bent[FE] = 1f64.to_radians();
            Response { loads: slopes.loads(), flexion: slopes.by(&bent, &Six::zeros()) }
        })
        .collect())
}

/// All kinds of field, each as likely as another.
fn kinds(sources: usize) -> Vec<Kind> {
    use Course::{Across, Constant, Flexion, Load, Motion, Scale};
    let scopes: Vec<Scope> =
        std::iter::once(Scope::Both).chain((0..if sources > 1 { sources } else { 0 }).map(Scope::Only)).collect();
    let mut shapes: Vec<(bool, Course, Option<usize>)> = Vec::new();
    for only in std::iter::once(None).chain((0..5).map(Some)) {
        // a misreading that follows the motion in any way would be the motion itself; in proportion it is a scale
        shapes.extend([Constant, Flexion, Motion, Load].map(|course| (true, course, only)));
        shapes.extend([Constant, Flexion, Scale, Load].map(|course| (false, course, only)));
    }
    shapes.extend([Constant, Flexion].map(|course| (false, course, Some(BENT))));
    for (c, d) in (0..5).flat_map(|c| (0..5).filter(move |d| *d != c).map(move |d| (c, d))) {
        shapes.extend([true, false].map(|is_force| (is_force, Across(d), Some(c))));
    }
    let kind =
        |scope: Scope, (is_force, course, only): (bool, Course, Option<usize>)| Kind { is_force, course, scope, only };
    scopes.iter().flat_map(|&scope| shapes.iter().map(move |&shape| kind(scope, shape))).collect()
}

/// Fields beside a fit to some readings of some scatter: what they explain together, each kind and size as likely as another, and the mean of the best.
///
/// Errors: a model that cannot be evaluated.
pub fn wildcard(
    problem: &Problem,
    (readings, covariance): (&Readings, &DMatrix<f64>),
    fit: &Fit,
) -> Result<Wildcard, DiscrepancyError> {
    let responses = responses(problem, fit)?;
    let marginal = Marginal::new(fit, readings, covariance)?;
    let kinds: Vec<Kind> = kinds(problem.sources.len()).into_iter().filter(|k| k.is_felt(problem)).collect();
    let gains: Vec<[f64; 3]> = kinds
        .par_iter()
        .map(|kind| {
            let parts = parts(problem, fit, kind);
            Spectrum::new(&marginal, readings, &signature(&parts, &responses, kind)).gains()
        })
        .collect();
    let flat: Vec<f64> = gains.iter().flatten().copied().collect();
    let k = (0..flat.len()).max_by(|&a, &b| flat[a].total_cmp(&flat[b])).unwrap_or(0);
    let kind = &kinds[k / SIZES.len()];
    let mean = flat.iter().map(|g| (g - flat[k]).exp()).sum::<f64>() / flat.len() as f64;
    let parts = parts(problem, fit, kind);
    let spectrum = Spectrum::new(&marginal, readings, &signature(&parts, &responses, kind));
    let log_bayes_factor = flat[k] + mean.ln();
    Ok(Wildcard {
        log_bayes_factor,
        log_evidence: log_bayes_factor + marginal.log_density() - price(fit.odd.len()),
        is_force: kind.is_force,
        course: kind.course,
        scope: kind.scope,
        mean: at_trials(&parts, &spectrum.weights(SIZES[k % SIZES.len()]), problem.trials.len()),
    })
}

/// Independent components of a field of amplitude 1: coordinate and a value a trial.
fn parts(problem: &Problem, fit: &Fit, kind: &Kind) -> Vec<(usize, Vec<f64>)> {
    let n = problem.trials.len();
    let acts = |i: usize| kind.scope.covers(problem.trials[i].source);
    let mut out = Vec::new();
    for c in kind.only.map_or(0..5, |c| c..c + 1) {
        let amplitude = amplitude(kind.is_force, c);
        let column = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..n).map(|i| if acts(i) { amplitude * value(i) } else { 0.0 }).collect()
        };
        let load = |i: usize, d: usize| problem.trials[i].load[READ[d]] / LOADS[d];
        let moved = |i: usize| fit.linear.rests[i].q[READ[c]] - problem.trials[i].neutral[READ[c]];
        match kind.course {
            Course::Constant => out.push((c, column(&|_| 1.0))),
            Course::Load => out.push((c, column(&|i| load(i, c)))),
            Course::Across(d) => out.push((c, column(&|i| load(i, d)))),
            Course::Scale => out.push((c, column(&|i| moved(i) / RANGES.1[c]))),
            Course::Flexion | Course::Motion => {
                let correlation = DMatrix::from_fn(n, n, |i, k| {
                    let mut d = ((problem.trials[i].flexion - problem.trials[k].flexion) / RANGES.0).powi(2);
                    if kind.course == Course::Motion {
                        d += ((moved(i) - moved(k)) / RANGES.1[c]).powi(2);
                    }
                    if acts(i) && acts(k) { (-0.5 * d).exp() } else { 0.0 }
                });
                let eigen = correlation.symmetric_eigen();
                let largest = eigen.eigenvalues.max();
                for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
                    if *value > SMALL * largest {
                        out.push((c, column(&|i| value.sqrt() * vector[i])));
                    }
                }
            }
        }
    }
    out
}

/// What the components change of the readings: a column a component, five rows a trial.
fn signature(parts: &[(usize, Vec<f64>)], responses: &[Response], kind: &Kind) -> DMatrix<f64> {
    DMatrix::from_fn(5 * responses.len(), parts.len(), |r, k| {
        let ((i, d), (c, values)) = ((r / 5, r % 5), &parts[k]);
        values[i] * responses[i].by(kind.is_force, *c, d)
    })
}

/// A field in the directions in which its components are told apart.
struct Spectrum {
    values: DVector<f64>,
    vectors: DMatrix<f64>,
    /// The residual along each.
    along: DVector<f64>,
}

impl Spectrum {
    fn new(marginal: &Marginal, readings: &Readings, signature: &DMatrix<f64>) -> Spectrum {
        let white = marginal.whitening.white(&readings.rows_of(signature));
        let eigen = white.tr_mul(&white).symmetric_eigen();
        let along = eigen.eigenvectors.tr_mul(&white.tr_mul(&marginal.white));
        Spectrum { values: eigen.eigenvalues, vectors: eigen.eigenvectors, along }
    }

    /// Log Bayes factor of each size.
    fn gains(&self) -> [f64; 3] {
        SIZES.map(|size| {
            let of = |(value, along): (&f64, &f64)| {
                let spread = 1.0 + size * size * value.max(0.0);
                0.5 * (size * size * along * along / spread - spread.ln())
            };
            self.values.iter().zip(self.along.iter()).map(of).sum()
        })
    }

    /// Most probable weights of the components at a size.
    fn weights(&self, size: f64) -> DVector<f64> {
        let part = |value: f64, along: f64| size * size * along / (1.0 + size * size * value.max(0.0));
        &self.vectors * self.values.zip_map(&self.along, part)
    }
}

/// A field's value at every trial.
fn at_trials(parts: &[(usize, Vec<f64>)], weights: &DVector<f64>, trials: usize) -> Vec<[f64; 6]> {
    let mut out = vec![[0.0; 6]; trials];
    for ((c, values), weight) in parts.iter().zip(weights.iter()) {
        values.iter().zip(&mut out).for_each(|(v, at)| at[*c] += v * weight);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::covariance::Whitening;

    /// Readings of `n` rows with a scatter of two in each, and a residual.
    fn marginal(residual: &DVector<f64>) -> (Marginal, Readings) {
        let n = residual.len();
        let whitening = Whitening::new(DMatrix::identity(n, n) * 4.0).unwrap();
        let readings = Readings { rows: (0..n).map(|r| (r / 5, r % 5)).collect(), measured: residual.clone() };
        (Marginal { white: whitening.white_vector(residual), before: residual.clone(), whitening }, readings)
    }

    #[test]
    fn a_field_gains_what_the_densities_with_and_without_its_covariance_differ_by() {
        let residual = DVector::from_fn(20, |r, _| (r as f64 * 1.3).sin() * 3.0);
        let signature = DMatrix::from_fn(20, 3, |r, k| ((r * (k + 2)) as f64 * 0.4).cos());
        let (marginal, readings) = marginal(&residual);
        let gains = Spectrum::new(&marginal, &readings, &signature).gains();
        let density = |size: f64| {
            let scatter = DMatrix::identity(20, 20) * 4.0 + &signature * signature.transpose() * (size * size);
            let w = Whitening::new(scatter).unwrap();
            -0.5 * (w.white_vector(&residual).norm_squared() + w.log_determinant())
        };
        for (gain, size) in gains.iter().zip(SIZES) {
            assert!((gain - (density(size) - density(0.0))).abs() < 1e-9, "{size}: {gain}");
        }
    }

    #[test]
    fn a_field_that_is_there_is_found_at_its_size_and_one_that_is_not_loses() {
        let signature = DMatrix::from_fn(60, 1, |r, _| if r % 5 == 3 { 2.0 } else { 0.0 });
        let (there, readings) = marginal(&(signature.column(0) * 5.0));
        let found = Spectrum::new(&there, &readings, &signature);
        assert!(found.gains()[2] > 30.0, "{:?}", found.gains());
        assert!((found.weights(3.0)[0] - 5.0).abs() < 0.1, "{}", found.weights(3.0));
        let (nothing, readings) = marginal(&DVector::zeros(60));
        assert!(Spectrum::new(&nothing, &readings, &signature).gains().iter().all(|g| *g < 0.0));
    }

    #[test]
    fn fields_act_in_all_data_sets_or_in_one_and_misreadings_follow_no_motion() {
        let two = kinds(2);
        // eight courses in one coordinate or all five, misread flexion two ways, loads across: twenty pairs, as forces and as misreadings
        assert_eq!(two.len(), 3 * (8 * 6 + 2 + 2 * 20));
        assert!(two.iter().all(|k| k.is_force || k.course != Course::Motion));
        assert!(two.iter().all(|k| k.only != Some(BENT) || !k.is_force));
        assert!(kinds(1).iter().all(|k| k.scope == Scope::Both));
    }
}

//! Candidate zero: fields of generalised forces, or of misreadings, of no name, from the same in every trial to smooth in flexion and motion. Where they
//! explain what a named effect leaves, the answer is outside the catalogue.

use crate::covariance::Readings;
use crate::equilibrium::Bench;
use crate::error::DiscrepancyError;
use crate::fit::Fit;
use crate::problem::{Problem, Scope, Slopes};
use crate::screen::Marginal;
use crate::search::Search;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sim::joint::{AP, IE, ML, SI, VV};

/// Amplitudes of the force field: VV, IE [N mm], ML, AP, SI [N].
const FORCES: [f64; 5] = [3000.0, 1000.0, 20.0, 20.0, 40.0];
/// Amplitudes of misreadings: VV, IE [deg], ML, AP, SI [mm].
const READINGS: [f64; 5] = [2.0, 2.0, 2.0, 2.0, 2.0];
/// Over which flexion [rad] and over which motion (rotations [rad], translations [mm]) the field changes.
const RANGES: (f64, [f64; 5]) = (0.52, [0.05, 0.17, 4.0, 5.0, 4.0]);
/// Coordinates of a reading.
const READ: [usize; 5] = [VV, IE, ML, AP, SI];

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
}

/// A kind of field.
#[derive(Clone, Copy, Debug)]
struct Kind {
    is_force: bool,
    course: Course,
    scope: Scope,
    /// The only coordinate that it has; all of them otherwise.
    only: Option<usize>,
}

/// What the wildcard explains beyond a fit.
#[derive(Clone, Debug)]
pub struct Wildcard {
    /// Log Bayes factor of a field of unknown kind against the fit alone.
    pub log_bayes_factor: f64,
    /// Whether the best kind is a field of forces (or of misreadings).
    pub is_force: bool,
    /// What it follows.
    pub course: Course,
    /// Where it acts.
    pub scope: Scope,
    /// Its mean: generalised force [N mm, N] or misreading [deg, mm], five a trial.
    pub mean: Vec<[f64; 5]>,
}

/// Responses of all readings to loads: five by five a trial.
fn responses(problem: &Problem, fit: &Fit) -> Result<Vec<[[f64; 5]; 5]>, DiscrepancyError> {
    let model = problem.model_at(&fit.unknowns)?;
    Ok(problem
        .trials
        .par_iter()
        .zip(&fit.linear.rests)
        .map(|(trial, rest)| {
            let effects = problem.effects_in(trial.source, &fit.hypothesis, &fit.unknowns);
            Slopes::new(Bench { model: &model, effects: &effects, place: &problem.place }, trial, rest).loads()
        })
        .collect())
}

/// All kinds of field, each as likely as another.
fn kinds(sources: usize) -> Vec<Kind> {
    let scopes: Vec<Scope> =
        std::iter::once(Scope::Both).chain((0..if sources > 1 { sources } else { 0 }).map(Scope::Only)).collect();
    let mut out = Vec::new();
    for is_force in [true, false] {
        for course in [Course::Constant, Course::Flexion, Course::Motion, Course::Load] {
            // a misreading that follows the motion would be the motion itself
            if !is_force && course == Course::Motion {
                continue;
            }
            for &scope in &scopes {
                for only in std::iter::once(None).chain((0..5).map(Some)) {
                    out.push(Kind { is_force, course, scope, only });
                }
            }
        }
    }
    out
}

/// Fields beside a fit of the search: what they explain together, each kind and size as likely as another, and the mean of the best.
///
/// Errors: a model that cannot be evaluated.
pub fn wildcard(problem: &Problem, search: &Search, fit: &Fit) -> Result<Wildcard, DiscrepancyError> {
    let responses = responses(problem, fit)?;
    let marginal = Marginal::new(fit, &search.readings, &search.covariance)?;
    let kinds = kinds(problem.sources.len());
    let gains: Vec<[f64; 3]> = kinds
        .par_iter()
        .map(|kind| {
            let parts = parts(problem, fit, kind);
            Spectrum::new(&marginal, &search.readings, &signature(&parts, &responses, kind)).gains()
        })
        .collect();
    let flat: Vec<f64> = gains.iter().flatten().copied().collect();
    let k = (0..flat.len()).max_by(|&a, &b| flat[a].total_cmp(&flat[b])).unwrap_or(0);
    let kind = &kinds[k / SIZES.len()];
    let mean = flat.iter().map(|g| (g - flat[k]).exp()).sum::<f64>() / flat.len() as f64;
    let parts = parts(problem, fit, kind);
    let spectrum = Spectrum::new(&marginal, &search.readings, &signature(&parts, &responses, kind));
    Ok(Wildcard {
        log_bayes_factor: flat[k] + mean.ln(),
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
    let amplitudes = if kind.is_force { FORCES } else { READINGS };
    let mut out = Vec::new();
    for c in (0..5).filter(|c| kind.only.is_none_or(|o| o == *c)) {
        let column = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..n).map(|i| if acts(i) { amplitudes[c] * value(i) } else { 0.0 }).collect()
        };
        match kind.course {
            Course::Constant => out.push((c, column(&|_| 1.0))),
            Course::Load => out.push((c, column(&|i| problem.trials[i].load[READ[c]] / LOADS[c]))),
            Course::Flexion | Course::Motion => {
                let moved = |i: usize| fit.linear.rests[i].q[READ[c]] - problem.trials[i].neutral[READ[c]];
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
fn signature(parts: &[(usize, Vec<f64>)], responses: &[[[f64; 5]; 5]], kind: &Kind) -> DMatrix<f64> {
    DMatrix::from_fn(5 * responses.len(), parts.len(), |r, k| {
        let ((i, d), (c, values)) = ((r / 5, r % 5), &parts[k]);
        let by = if kind.is_force { responses[i][*c][d] } else { f64::from(u8::from(d == *c)) };
        values[i] * by
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
fn at_trials(parts: &[(usize, Vec<f64>)], weights: &DVector<f64>, trials: usize) -> Vec<[f64; 5]> {
    let mut out = vec![[0.0; 5]; trials];
    for ((c, values), weight) in parts.iter().zip(weights.iter()) {
        values.iter().zip(&mut out).for_each(|(v, at)| at[*c] += v * weight);
    }
    out
}

impl Wildcard {
    /// In words: which coordinate, at which flexion, at which load, where, and how large.
    pub fn words(&self, problem: &Problem) -> String {
        const NAMES: [&str; 5] =
            ["varus-valgus", "internal-external rotation", "medial-lateral", "anterior-posterior", "axial"];
        let scale = if self.is_force { FORCES } else { READINGS };
        let mean = |keep: &dyn Fn(usize) -> bool, c: usize| {
            let values: Vec<f64> = (0..self.mean.len()).filter(|&i| keep(i)).map(|i| self.mean[i][c]).collect();
            values.iter().sum::<f64>() / values.len().max(1) as f64
        };
        let size = |c: usize| {
            let acting: Vec<f64> = (0..self.mean.len())
                .filter(|&i| self.scope.covers(problem.trials[i].source))
                .map(|i| (self.mean[i][c] / scale[c]).powi(2))
                .collect();
            acting.iter().sum::<f64>()
        };
        let c = (0..5).max_by(|&a, &b| size(a).total_cmp(&size(b))).unwrap_or(3);
        let acts = |i: usize| self.scope.covers(problem.trials[i].source);
        let bent = |i: usize| problem.trials[i].nominal > 45.0;
        let pushed = |i: usize| problem.trials[i].load[READ[c]].abs() > 1e-6;
        let (near, far) = (mean(&|i| acts(i) && !bent(i), c), mean(&|i| acts(i) && bent(i), c));
        let (at_rest, loaded) = (mean(&|i| acts(i) && !pushed(i), c), mean(&|i| acts(i) && pushed(i), c));
        let profile = if near * far < 0.0 {
            "changes sign with flexion"
        } else if near.abs() > 2.0 * far.abs() {
            "is largest near extension"
        } else if far.abs() > 2.0 * near.abs() {
            "is largest in flexion"
        } else {
            "is much the same at all flexions"
        };
        let load = if at_rest.abs() > 0.5 * loaded.abs() { "is there without load" } else { "comes with load" };
        let place = match self.scope {
            Scope::Both => "in every data set".to_owned(),
            Scope::Only(s) => format!("in {} only", problem.sources[s]),
        };
        let (per, unit) = match (self.is_force, c < 2) {
            (true, true) => (1e-3, "N m"),
            (true, false) => (1.0, "N"),
            (false, true) => (1.0, "deg"),
            (false, false) => (1.0, "mm"),
        };
        let kind = if self.is_force { "acts like a force on the tibia" } else { "acts like a misreading" };
        let start = format!("It {kind} in {} {place}", NAMES[c]);
        match self.course {
            Course::Constant => {
                format!("{start}: {:+.1} {unit}, the same at all flexions and loads.", mean(&acts, c) * per)
            }
            Course::Load => {
                let load = |i: usize| problem.trials[i].load[READ[c]] / LOADS[c];
                let most =
                    (0..self.mean.len()).filter(|&i| acts(i)).max_by(|&a, &b| load(a).abs().total_cmp(&load(b).abs()));
                let by = most.filter(|&i| load(i) != 0.0).map_or(0.0, |i| self.mean[i][c] / load(i));
                let (size, unit_load) = if c < 2 { (LOADS[c] * 1e-3, "N m") } else { (LOADS[c], "N") };
                format!("{start}: {:+.1} {unit} for every {size:.0} {unit_load} of load along it.", by * per)
            }
            Course::Flexion | Course::Motion => format!(
                "{start}: {:+.1} {unit} at 0 to 45 deg, {:+.1} {unit} beyond; it {profile} and {load}.",
                near * per,
                far * per
            ),
        }
    }
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
        assert_eq!(two.len(), (4 + 3) * 3 * 6);
        assert!(two.iter().all(|k| k.is_force || k.course != Course::Motion));
        assert!(kinds(1).iter().all(|k| k.scope == Scope::Both));
    }
}

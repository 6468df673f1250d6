//! Candidate zero: fields of generalised forces, or of misreadings, of no name, from the same in every trial to smooth in flexion and motion, along the
//! load or across it; and suspects that are no effects of the catalogue: one-sided stops, forces near extension or in flexion alone, trackers that sway,
//! bones of another size, cruciates that press on each other, pulls along lines of no name. What the catalogue has a name for is not
//! among them. Where they explain what a named effect leaves, or more than it does, the answer is outside the catalogue.

mod kinds;
mod parts;
pub mod suspects;
mod words;

use crate::effect::bench::Bench;
use crate::effect::candidate::Scope;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::screen::Marginal;
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::problem::jacobian::Jacobian;
use crate::problem::outlier::price;
use crate::problem::trial::at_row;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sim::coordinate::{Coordinate, FE, Free, Six};

pub use kinds::{Bone, Course};
use kinds::{FIELD, Kind, Part, kinds, shares};
use parts::parts;

/// Sizes of a field over those amplitudes [-].
const SIZES: [f64; 3] = [0.3, 1.0, 3.0];

/// What fields of no name explain beyond a fit.
#[derive(Clone, Debug)]
pub struct Discrepancy {
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
    /// Weights of its components [-].
    pub amounts: Vec<f64>,
    /// Its mean in every trial: generalised force [N mm, N] or misreading [deg, mm].
    pub mean: Vec<Six>,
}

/// What moves a trial's readings: five loads, and a misread flexion.
#[derive(Clone, Copy, Debug)]
struct Response {
    loads: Free<Free<f64>>,
    flexion: Free<f64>,
}

impl Response {
    /// Change of reading `d` by one unit of a field in coordinate `c`.
    fn by(&self, is_force: bool, c: Coordinate, d: Coordinate) -> f64 {
        match (is_force, c) {
            (false, FE) => self.flexion[d],
            (true, FE) => 0.0,
            (true, _) => self.loads[c][d],
            (false, _) => f64::from(u8::from(d == c)),
        }
    }
}

/// Responses of all readings.
fn responses(problem: &Problem, fit: &Fit) -> Result<Vec<Response>, DiagnosisError> {
    let models = problem.models_at(&fit.unknowns)?;
    Ok(problem
        .trials
        .par_iter()
        .zip(&fit.linear.rests)
        .map(|(trial, rest)| {
            let effects = problem.effects_in(trial.source, &fit.hypothesis, &fit.unknowns);
            let model = models.of(trial.source);
            let jacobian = Jacobian::new(Bench { model, effects: &effects, place: &problem.place }, trial, rest);
            let mut bent = Six::zeros();
            bent[FE] = 1f64.to_radians();
            Response { loads: jacobian.loads(), flexion: jacobian.by(&bent, &Six::zeros()) }
        })
        .collect())
}

/// Fields beside a fit to some readings of some scatter: what they explain together, each size as likely as another, and the mean of the likeliest.
///
/// Errors: a model that cannot be evaluated.
pub fn discrepancy(
    problem: &Problem,
    (readings, covariance): (&Readings, &DMatrix<f64>),
    fit: &Fit,
) -> Result<Discrepancy, DiagnosisError> {
    let responses = responses(problem, fit)?;
    let marginal = Marginal::new(fit, readings, covariance)?;
    let is_one = |k: &Kind| k.is_felt(problem) && !k.has_a_name(&problem.catalogue);
    let kinds: Vec<Kind> = kinds(&problem.asked()).into_iter().filter(is_one).collect();
    let unloaded = problem.neutrals(&problem.trials, &problem.models_at(&fit.unknowns)?);
    let gains: Vec<[f64; 3]> = kinds
        .par_iter()
        .map(|kind| {
            let of = parts(problem, (fit, &unloaded), kind);
            Spectrum::new(&marginal, readings, &signature(&of, &responses, kind.is_force)).gains()
        })
        .collect();
    let odds = shares(&kinds);
    let flat: Vec<f64> =
        gains.iter().zip(&odds).flat_map(|(of, odds)| of.map(|g| g + (odds / SIZES.len() as f64).ln())).collect();
    let k = (0..flat.len()).max_by(|&a, &b| flat[a].total_cmp(&flat[b])).unwrap_or(0);
    let kind = &kinds[k / SIZES.len()];
    let all = flat.iter().map(|g| (g - flat[k]).exp()).sum::<f64>();
    let of = parts(problem, (fit, &unloaded), kind);
    let spectrum = Spectrum::new(&marginal, readings, &signature(&of, &responses, kind.is_force));
    let weights = spectrum.weights(SIZES[k % SIZES.len()]);
    let log_bayes_factor = flat[k] + all.ln();
    Ok(Discrepancy {
        log_bayes_factor,
        log_evidence: log_bayes_factor + marginal.log_density() - price(fit.outliers.len()),
        is_force: kind.is_force,
        course: kind.course,
        scope: kind.scope,
        amounts: weights.iter().copied().collect(),
        mean: at_trials(&of, &weights, problem.trials.len()),
    })
}

/// What the components change of the readings: a column a component, five rows a trial.
fn signature(parts: &[Part], responses: &[Response], is_force: bool) -> DMatrix<f64> {
    DMatrix::from_fn(5 * responses.len(), parts.len(), |r, k| {
        let ((i, d), part) = (at_row(r), &parts[k]);
        let felt = FIELD.iter().filter(|&&c| part[i][c] != 0.0);
        felt.map(|&c| part[i][c] * responses[i].by(is_force, c, d)).sum()
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
fn at_trials(parts: &[Part], weights: &DVector<f64>, trials: usize) -> Vec<Six> {
    let mut out = vec![Six::zeros(); trials];
    for (part, weight) in parts.iter().zip(weights.iter()) {
        for (value, at) in part.iter().zip(&mut out) {
            *at += value * *weight;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use inference::whitening::Whitening;

    /// Readings of `n` rows with a scatter of two in each, and a residual.
    fn marginal(residual: &DVector<f64>) -> (Marginal, Readings) {
        let n = residual.len();
        let whitening = Whitening::new(DMatrix::identity(n, n) * 4.0).unwrap();
        let readings = Readings { rows: (0..n).map(at_row).collect(), measured: residual.clone() };
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
}

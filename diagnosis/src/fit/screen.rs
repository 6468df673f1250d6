//! The linear screen: what each candidate could explain, ligaments and contact marginalised, in closed form.

use crate::effect::bench::Bench;
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::{Fit, REACH};
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::problem::jacobian::Jacobian;
use crate::problem::trial::at_row;
use inference::whitening::Whitening;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use sim::coordinate::Free;

/// Derivatives of all readings (five a trial) by the scaled parameters of each candidate, at a fit.
///
/// Errors: a model that cannot be evaluated.
pub fn signatures(problem: &Problem, at: &Fit, candidates: &[Candidate]) -> Result<Vec<DMatrix<f64>>, DiagnosisError> {
    let models = problem.models_at(&at.unknowns)?;
    // a candidate's columns do not depend on its scope but for the rows that it leaves zero
    let mut kinds: Vec<&Candidate> = Vec::new();
    let kind_of: Vec<usize> = candidates
        .iter()
        .map(|c| {
            let same = |k: &&Candidate| k.effect.id == c.effect.id && k.variant == c.variant;
            kinds.iter().position(same).unwrap_or_else(|| {
                kinds.push(c);
                kinds.len() - 1
            })
        })
        .collect();
    let trials = problem.unloaded_at(&problem.trials, &models, &at.hypothesis);
    let columns: Vec<Vec<Vec<Free<f64>>>> = trials
        .par_iter()
        .zip(&at.linear.rests)
        .map(|(trial, rest)| {
            let effects = problem.effects_in(trial.source, &at.hypothesis, &at.unknowns);
            let model = models.of(trial.source);
            let jacobian = Jacobian::new(Bench { model, effects: &effects, place: &problem.place }, trial, rest);
            kinds.iter().map(|c| jacobian.candidate(c, &c.nothing(), true)).collect()
        })
        .collect();
    let rows = 5 * problem.trials.len();
    Ok(candidates
        .iter()
        .zip(&kind_of)
        .map(|(c, &kind)| {
            DMatrix::from_fn(rows, c.size(), |r, k| {
                let (i, d) = at_row(r);
                if problem.acts(c.scope, problem.trials[i].source) { columns[i][kind][k][d] } else { 0.0 }
            })
        })
        .collect())
}

/// The readings' distribution when nothing is missing: residual before the fit of the ligaments, and its scatter with theirs.
#[derive(Clone, Debug)]
pub struct Marginal {
    /// Whitened residual.
    pub white: DVector<f64>,
    /// The residual as it is.
    pub before: DVector<f64>,
    /// The scatter, ligaments and whatever else the fit had free marginalised.
    pub whitening: Whitening,
}

impl Marginal {
    /// At a fit.
    ///
    /// Errors: a covariance that is not positive definite.
    pub fn new(fit: &Fit, readings: &Readings, covariance: &DMatrix<f64>) -> Result<Marginal, DiagnosisError> {
        let jacobian = readings.rows_of(&fit.linear.jacobian);
        let covariance = crate::problem::outlier::widened(covariance, &fit.outliers);
        let whitening = Whitening::new(readings.block_of(&covariance) + &jacobian * jacobian.transpose())?;
        let before = &fit.residual + jacobian * fit.from_means();
        Ok(Marginal { white: whitening.white_vector(&before), before, whitening })
    }

    /// Log density of the readings, up to a constant common to all of the same readings.
    pub fn log_density(&self) -> f64 {
        -0.5 * (self.white.norm_squared() + self.whitening.log_determinant())
    }

    /// The most probable unknowns of the fit beside `size` of a candidate, whose signature is given.
    pub fn beside(
        &self,
        fit: &Fit,
        readings: &Readings,
        signature: &DMatrix<f64>,
        size: &DVector<f64>,
    ) -> DVector<f64> {
        let left = &self.before - readings.rows_of(signature) * size;
        let from_means = readings.rows_of(&fit.linear.jacobian).tr_mul(&self.whitening.solve(&left));
        from_means + DVector::from_column_slice(&fit.means)
    }
}

/// A candidate in the screen's coordinates.
#[derive(Clone, Debug)]
pub struct Score {
    /// Whitened signature.
    pub white: DMatrix<f64>,
    /// Of `I + white' white / width^-2`: its factor.
    factor: Cholesky<f64, nalgebra::Dyn>,
    width: f64,
}

impl Score {
    /// A signature whose parameters have standard deviation `width` (in units of the catalogue's).
    pub fn new(signature: &DMatrix<f64>, readings: &Readings, marginal: &Marginal, width: f64) -> Option<Score> {
        let white = marginal.whitening.white(&readings.rows_of(signature)) * width;
        let n = white.ncols();
        let factor = Cholesky::new(DMatrix::identity(n, n) + white.tr_mul(&white))?;
        Some(Score { white, factor, width })
    }

    /// Log Bayes factor of the candidate against nothing, for a whitened residual.
    pub fn log_bayes_factor(&self, white: &DVector<f64>) -> f64 {
        let b = self.white.tr_mul(white);
        0.5 * b.dot(&self.factor.solve(&b)) - self.occam()
    }

    /// Size of parameter `k` alone, in units of the catalogue's standard deviations, whose expected log Bayes factor is `evidence`; none beyond
    /// what a fit would reach.
    pub fn size_for(&self, k: usize, evidence: f64) -> Option<f64> {
        let mut unit = DVector::zeros(self.white.ncols());
        unit[k] = 1.0 / self.width;
        // a whitened residual that is the signature itself: what it earns grows with the square of its size
        let b = self.white.tr_mul(&(&self.white * &unit));
        let square = 0.5 * b.dot(&self.factor.solve(&b));
        let size = ((evidence + self.occam()) / square).sqrt();
        (size.is_finite() && size < REACH).then_some(size)
    }

    /// Price of its free parameters [nats].
    fn occam(&self) -> f64 {
        self.factor.l_dirty().diagonal().iter().map(|x| x.ln()).sum()
    }

    /// Most probable parameters, in units of the catalogue's standard deviations.
    pub fn estimate(&self, white: &DVector<f64>) -> DVector<f64> {
        self.factor.solve(&self.white.tr_mul(white)) * self.width
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::coordinate::VV;

    #[test]
    fn the_bayes_factor_is_the_ratio_of_two_normal_densities() {
        let n = 6;
        let scatter = DMatrix::from_fn(n, n, |a, b| if a == b { 2.0 } else { 0.3 });
        let signature = DMatrix::from_fn(5 * n, 2, |r, k| if r % 5 == 0 { ((r + 3 * k) as f64).sin() } else { 0.0 });
        let readings = Readings { rows: (0..n).map(|i| (i, VV)).collect(), measured: DVector::zeros(n) };
        let residual = DVector::from_fn(n, |r, _| (r as f64 * 1.7).cos());
        let density = |c: &DMatrix<f64>| {
            let w = Whitening::new(c.clone()).unwrap();
            -0.5 * (w.white_vector(&residual).norm_squared() + w.log_determinant())
        };
        let whitening = Whitening::new(scatter.clone()).unwrap();
        let marginal = Marginal { white: whitening.white_vector(&residual), before: residual.clone(), whitening };
        let score = Score::new(&signature, &readings, &marginal, 1.5).unwrap();
        let s = readings.rows_of(&signature) * 1.5;
        let direct = density(&(&scatter + &s * s.transpose())) - density(&scatter);
        assert!((score.log_bayes_factor(&marginal.white) - direct).abs() < 1e-10);
    }

    #[test]
    fn the_size_for_an_evidence_earns_it() {
        let n = 40;
        let signature = DMatrix::from_fn(5 * n, 2, |r, k| if r % 5 == 0 { ((r + 3 * k) as f64).sin() } else { 0.0 });
        let readings = Readings { rows: (0..n).map(|i| (i, VV)).collect(), measured: DVector::zeros(n) };
        let whitening = Whitening::new(DMatrix::identity(n, n) * 0.5).unwrap();
        let marginal = Marginal { white: DVector::zeros(n), before: DVector::zeros(n), whitening };
        for width in [1.0, 2.0] {
            let score = Score::new(&signature, &readings, &marginal, width).unwrap();
            let size = score.size_for(1, 6.0).unwrap();
            let residual = marginal.whitening.white_vector(&(readings.rows_of(&signature).column(1) * size));
            assert!((score.log_bayes_factor(&residual) - 6.0).abs() < 1e-9);
        }
        // what moves nothing has no size
        let nothing = Score::new(&DMatrix::zeros(5 * n, 1), &readings, &marginal, 1.0).unwrap();
        assert_eq!(nothing.size_for(0, 6.0), None);
    }
}

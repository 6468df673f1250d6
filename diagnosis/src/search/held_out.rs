//! The gap on trials that no calibration has seen: whole conditions are left out in turn, baseline and hypothesis fitted to the rest.

use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::problem::Problem;
use crate::problem::covariance::Readings;
use crate::problem::outlier::Mixture;
use crate::search::Searcher;
use inference::whitening::Whitening;
use nalgebra::DMatrix;
use rayon::prelude::*;
use sim::coordinate::Free;

/// Scores on held-out trials.
#[derive(Clone, Debug, Default)]
pub struct HeldOut {
    /// Mean square of the whitened error [-].
    pub score: f64,
    /// What it would be if the hypothesis were true [-].
    pub floor: f64,
    /// Log predictive density of each fold.
    pub density: Vec<f64>,
    /// Root mean square error: VV, IE [deg], ML, AP, SI [mm].
    pub rmse: Free<f64>,
}

impl HeldOut {
    /// Gain of the log predictive density over another fit of the same folds.
    pub fn gain_over(&self, other: &HeldOut) -> f64 {
        self.density.iter().sum::<f64>() - other.density.iter().sum::<f64>()
    }
}

/// Scores of a fit in some scatter, five readings a trial, over `folds` folds of conditions; `which` are the folds used.
///
/// Errors: a model that cannot be evaluated.
pub fn held_out(
    searcher: &Searcher,
    cov: &DMatrix<f64>,
    fit: &Fit,
    folds: usize,
    which: usize,
) -> Result<HeldOut, DiagnosisError> {
    let problem = searcher.problem;
    let parts: Vec<Part> = (0..which.min(folds))
        .into_par_iter()
        .map(|fold| {
            let out = |i: usize| problem.trials[i].condition % folds == fold;
            let (seen, unseen) = (Readings::of(problem, &|i| !out(i)), Readings::of(problem, &out));
            if seen.rows.is_empty() || unseen.rows.is_empty() {
                return Ok(Part::default());
            }
            let start = fit.coordinates();
            let again = searcher.fit(&fit.hypothesis, &fit.unknowns, &start, cov, &seen, 10)?;
            part(problem, &again, &unseen, cov)
        })
        .collect::<Result<_, DiagnosisError>>()?;
    let count: f64 = parts.iter().map(|p| p.count).sum::<f64>().max(1.0);
    let counts: Free<f64> = Free::from_fn(|c| parts.iter().map(|p| p.counts[c]).sum::<f64>().max(1.0));
    Ok(HeldOut {
        score: parts.iter().map(|p| p.squares).sum::<f64>() / count,
        floor: parts.iter().map(|p| p.expected).sum::<f64>() / count,
        density: parts.iter().map(|p| p.density).collect(),
        rmse: Free::from_fn(|c| (parts.iter().map(|p| p.errors[c]).sum::<f64>() / counts[c]).sqrt()),
    })
}

/// Sums over a fold.
#[derive(Clone, Debug, Default)]
struct Part {
    squares: f64,
    expected: f64,
    count: f64,
    density: f64,
    errors: Free<f64>,
    counts: Free<f64>,
}

fn part(problem: &Problem, fit: &Fit, unseen: &Readings, cov: &DMatrix<f64>) -> Result<Part, DiagnosisError> {
    debug_assert!(fit.linear.value.len() == 5 * problem.trials.len());
    let error = &unseen.measured - unseen.pick(&fit.linear.value);
    let block = unseen.block_of(cov);
    let mixture = Mixture::new(unseen, block.clone(), &problem.trials)?;
    let scatter: &Whitening = mixture.plain();
    let jacobian = unseen.rows_of(&fit.linear.jacobian);
    let spread = &jacobian * &fit.posterior * jacobian.transpose();
    let half = scatter.white(&spread);
    let expected = unseen.rows.len() as f64 + scatter.white(&half.transpose()).trace();
    let predictive = Mixture::new(unseen, block + spread, &problem.trials)?;
    let mut out = Part {
        squares: 2.0 * mixture.weigh(&error).cost,
        expected,
        count: unseen.rows.len() as f64,
        density: -predictive.weigh(&error).cost - 0.5 * predictive.plain().log_determinant(),
        ..Part::default()
    };
    for (&(_, c), e) in unseen.rows.iter().zip(error.iter()) {
        out.errors[c] += e * e;
        out.counts[c] += 1.0;
    }
    Ok(out)
}

/// Share of the gap between `before` and the noise that is closed by `after`; one at most.
pub fn closed(before: &HeldOut, after: &HeldOut) -> f64 {
    let floor = after.floor.min(after.score);
    let gap = before.score - floor;
    if gap <= 1e-9 { 0.0 } else { (1.0 - (after.score - floor) / gap).clamp(-1.0, 1.0) }
}

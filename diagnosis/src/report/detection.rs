//! Limits of detection: the sizes of effects that half of such data would reveal. Smaller ones a diagnosis that names nothing would have missed.

use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::screen::{Marginal, Score, signatures};
use crate::problem::Problem;
use crate::report::{DetectionLimit, scope_name};
use crate::search::{Search, log_prior};

/// Sizes, parameter by parameter, whose expected log Bayes factor just reaches `threshold`: linear about nothing missing, ligaments and contact
/// marginalised. Shapes, and effects without a slope at nothing, have none. Nor has a loss that no share of would: which whole tears such trials
/// would miss is found off that straight line (excluded.rs).
///
/// Errors: a model that cannot be evaluated.
pub fn limits_of_detection(
    problem: &Problem,
    search: &Search,
    threshold: f64,
) -> Result<Vec<DetectionLimit>, DiagnosisError> {
    let candidates = problem.candidates();
    let signatures = signatures(problem, &search.base, &candidates)?;
    let marginal = Marginal::new(&search.base, &search.readings, &search.covariance)?;
    let mut out = Vec::new();
    for (c, signature) in candidates.iter().zip(&signatures) {
        let Some(score) = Score::new(signature, &search.readings, &marginal, 1.0) else { continue };
        if c.active(&vec![0.0; c.size()]).has_no_slope_at_zero() {
            continue;
        }
        let needed = threshold - log_prior(c, problem.asked().len());
        let parameters = c.effect.parameter.iter().enumerate().filter(|(_, p)| !p.shape);
        out.extend(parameters.filter_map(|(k, p)| {
            let size = (p.sd * score.size_for(k, needed)?).max(p.least);
            p.whole.is_none_or(|whole| size <= whole).then(|| row(problem, c, &p.key, size, &p.unit))
        }));
    }
    Ok(out)
}

fn row(problem: &Problem, c: &Candidate, parameter: &str, size: f64, unit: &str) -> DetectionLimit {
    DetectionLimit {
        effect: c.name(),
        variant: c.variant_name(),
        scope: scope_name(problem, c),
        parameter: parameter.into(),
        size,
        unit: unit.into(),
    }
}

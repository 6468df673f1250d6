//! What an effect of another form than the knee's own may leave of what it explains.

use crate::criteria::{BEYOND_BELIEF, discrepancy};
use crate::effect::candidate::Candidate;
use crate::fit::Fit;

/// What the form of an answer's effects, of `sizes` in units of their priors, may leave of what it explains [nats]: the square of the share by which
/// the form may differ. Frames and loads have one form; what the form of a first effect leaves, further ones have taken up; a size that nobody would
/// expect is no matter of form.
pub(crate) fn left_by_form(hypothesis: &[Candidate], sizes: &[f64], evidence: f64) -> f64 {
    let [only] = hypothesis else { return 0.0 };
    if are_expected(sizes) { only.effect.form_share.powi(2) * evidence } else { 0.0 }
}

/// Whether sizes, in standard deviations of their priors, are such as somebody would expect.
pub(crate) fn are_expected(sizes: &[f64]) -> bool {
    sizes.iter().all(|x| x.abs() < BEYOND_BELIEF)
}

/// Whether a field of no name beside an answer asks for a further effect.
pub(crate) fn asks_for_more(field: f64, fit: &Fit, nuisances: usize, evidence: f64) -> bool {
    field > discrepancy().max(left_by_form(&fit.hypothesis, &fit.unknowns[nuisances..], evidence))
}

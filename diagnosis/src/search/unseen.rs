//! What a further effect must show on trials that it was not chosen for.

use super::Searcher;
use crate::criteria::predicted;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::held_out::held_out;
use nalgebra::DMatrix;

/// Most fits that are asked, the most worth first [-]: each costs a refit a fold.
const MOST_ASKED: usize = 3;

impl Searcher<'_> {
    /// The first of some fits that predicts trials it has not seen clearly better than the best does: an effect that only fits the trials it was chosen for is
    /// none. Where the best leaves more than it should, the data speak less loud.
    pub(super) fn first_that_predicts(
        &self,
        (fits, best): (&[Fit], &Fit),
        cov: &DMatrix<f64>,
        places: impl Iterator<Item = usize>,
    ) -> Result<Option<usize>, DiagnosisError> {
        let folds = self.options.folds;
        let mut places = places.take(MOST_ASKED).peekable();
        if places.peek().is_none() {
            return Ok(None);
        }
        let without = held_out(self, cov, best, folds, folds)?;
        let least = predicted() * self.leaves(best).max(1.0);
        for k in places {
            let gain = held_out(self, cov, &fits[k], folds, folds)?.gain_over(&without);
            if gain >= least {
                return Ok(Some(k));
            }
        }
        Ok(None)
    }
}

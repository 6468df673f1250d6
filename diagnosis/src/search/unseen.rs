//! What a further effect must show on trials that it was not chosen for.

use super::Searcher;
use crate::criteria::predicted;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::search::held_out::held_out;
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
        let mut places = places.peekable();
        if places.peek().is_none() {
            return Ok(None);
        }
        let without = held_out(self, cov, best, folds, folds)?;
        let gain = |k: usize| -> Result<f64, DiagnosisError> {
            Ok(held_out(self, cov, &fits[k], folds, folds)?.gain_over(&without))
        };
        first_that_gains(places, gain, self.leaves(best))
    }
}

/// The first of some places whose gain on unseen trials is enough beside a fit that leaves so many times what noise does; [`MOST_ASKED`] are asked.
fn first_that_gains(
    places: impl Iterator<Item = usize>,
    mut gain: impl FnMut(usize) -> Result<f64, DiagnosisError>,
    leaves: f64,
) -> Result<Option<usize>, DiagnosisError> {
    let least = predicted() * leaves.max(1.0);
    for k in places.take(MOST_ASKED) {
        if gain(k)? >= least {
            return Ok(Some(k));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The place that is taken, of further effects with such gains on unseen trials, beside a fit that leaves so many times what noise does.
    fn taken(gains: &[f64], leaves: f64) -> Option<usize> {
        first_that_gains(0..gains.len(), |k| Ok(gains[k]), leaves).unwrap()
    }

    #[test]
    fn a_further_effect_is_taken_from_the_bar_on_alone_wherever_it_stands() {
        let (short, enough) = (predicted() - 0.01, predicted() + 0.01);
        assert_eq!((taken(&[short], 1.0), taken(&[enough], 1.0)), (None, Some(0)));
        // the first that is enough, not the largest; what is none is passed over
        assert_eq!(taken(&[short, enough, 90.0], 1.0), Some(1));
        assert_eq!((taken(&[f64::NAN, enough], 1.0), taken(&[], 1.0)), (Some(1), None));
    }

    #[test]
    fn beside_a_fit_that_leaves_more_the_bar_is_as_much_higher_and_never_lower() {
        for leaves in [0.5, 1.0, 2.0, 3.2] {
            let bar = predicted() * f64::max(leaves, 1.0);
            assert_eq!(taken(&[bar - 0.01], leaves), None, "{leaves}");
            assert_eq!(taken(&[bar + 0.01], leaves), Some(0), "{leaves}");
        }
    }

    #[test]
    fn no_more_are_asked_than_may_be() {
        let mut asked = 0;
        let gain = |_| {
            asked += 1;
            Ok(0.0)
        };
        assert_eq!(first_that_gains(0..10, gain, 1.0).unwrap(), None);
        assert_eq!(asked, MOST_ASKED);
        let fault = first_that_gains(0..10, |_| Err(DiagnosisError::Model("no rest".into())), 1.0);
        assert!(fault.is_err());
    }
}

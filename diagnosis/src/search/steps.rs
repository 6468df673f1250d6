//! The steps of a search: single effects, one more beside the best, one exchanged for another.

use super::met::Met;
use super::{Screened, Searcher, Start, TRIES};
use crate::discrepancy::discrepancy;
use crate::effect::candidate::Candidate;
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::form::asks_for_more;
use crate::problem::Linear;
use crate::problem::covariance::Readings;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Most rounds in which effects of an answer are exchanged [-].
const EXCHANGES: usize = 3;
/// Sum of squares, over what it should be, that an answer may leave for that to be worth the time, and for shapes beside it or scatters of its rivals' own
/// [-]: beyond, no further effect makes it a name.
pub(super) const HOPELESS: [f64; 2] = [3.0, 10.0];

/// Nats that a refit may have more than the screen that proposed it [-].
pub(super) const OVERTAKEN: f64 = 10.0;

/// How far behind the best, in its scatter, a rival may be to be weighed in its own against it [nats].
const CLOSE: f64 = 5.0;
/// How many rivals are, at most [-].
const MOST_CLOSE: usize = 6;

/// The rival that is the likelier by most, where one is: by the mean of what it is ahead of the best in the scatter at the best and in that at its own fit.
fn likelier(in_common: &[f64], in_own: &[f64]) -> Option<usize> {
    let mean = in_common.iter().zip(in_own).map(|(common, own)| 0.5 * (common + own)).enumerate();
    mean.filter(|(_, by)| *by > crate::criteria::likelier()).max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
}

/// What a further effect is worth that is ahead by so much in the scatter at the best and in that at its own fit: the mean, since each favours its own, where
/// it is ahead by `least` in both.
fn worth(in_common: f64, in_own: f64, least: f64) -> Option<f64> {
    (in_common >= least && in_own >= least).then_some(0.5 * (in_common + in_own))
}

/// What the forms of effects, which need not be this knee's, may leave of what they explain [nats]: as much as that whose form may differ most. Frames and
/// loads have one form.
fn left_by_forms(hypothesis: &[Candidate], evidence: f64) -> f64 {
    hypothesis.iter().map(|c| c.effect.form_share).fold(0.0, f64::max).powi(2) * evidence
}

/// Whether two hypotheses have the same effects, in whatever order.
fn are_the_same(one: &[Candidate], other: &[Candidate]) -> bool {
    one.len() == other.len() && one.iter().all(|c| other.contains(c))
}

/// Takes fits of more than so many effects from the front until one stands there that is the one `proven`, or that predicts what it has not seen.
fn drop_unproven(
    rivals: &mut Vec<Fit>,
    (proven, effects): (&[Candidate], usize),
    predicts: impl Fn(&Fit) -> Result<bool, DiagnosisError>,
) -> Result<(), DiagnosisError> {
    while let Some(first) = rivals.first() {
        let is_longer = first.hypothesis.len() > effects;
        if !is_longer || are_the_same(&first.hypothesis, proven) || predicts(first)? {
            break;
        }
        rivals.remove(0);
    }
    Ok(())
}

/// What every step works with.
#[derive(Clone, Copy)]
pub(super) struct Given<'a> {
    /// Readings fitted.
    pub readings: &'a Readings,
    /// All that could be named.
    pub candidates: &'a [Candidate],
    /// Scatter of what is not linear.
    pub extra: &'a DMatrix<f64>,
    /// Least gain of log evidence for an effect.
    pub threshold: f64,
}

/// What was found so far.
#[derive(Clone)]
pub(super) struct Found {
    /// Nothing missing.
    pub base: Fit,
    /// Hypotheses refitted, best first.
    pub rivals: Vec<Fit>,
    /// The scatter at the best.
    pub cov: DMatrix<f64>,
    /// Single effects that were refitted on the way.
    pub met: Met,
}

impl Searcher<'_> {
    /// The best single effects, refitted. A linear screen about well fitted ligaments promises little of what they have taken up, so that nothing is left
    /// out for its sake.
    pub(super) fn singles(&self, start: &Start, given: Given, list: &[Screened]) -> Result<Found, DiagnosisError> {
        let Start { zero, held, base, extra, cov } = start;
        let (readings, candidates) = (given.readings, given.candidates);
        let mut found = Found { base: base.clone(), rivals: vec![], cov: cov.clone(), met: Met::default() };
        let near = self.scatter(held, extra)?;
        let (forces, _) = self.screen(held, readings, &near, candidates)?;
        // a large effect bends the ligaments of the baseline and the poses: screen and start from the model's own and at the measured, too
        let (plain, _) = self.screen(zero, readings, cov, candidates)?;
        let (most, few) = (self.options.shortlist, self.options.shortlist / 2);
        let none = base.log_evidence;
        found.rivals = self.refits(base, (readings, cov), candidates, (list, most), none)?;
        found.rivals.extend(self.refits(zero, (readings, cov), candidates, (&plain, few), none)?);
        found.rivals.extend(self.refits(held, (readings, cov), candidates, (&forces, most), none)?);
        found.rivals.extend(self.torn_where_asked(&found, given)?);
        found = self.renewed(found, given)?;
        if self.is_poor(found.rivals.first().unwrap_or(&found.base)) {
            let none = found.base.log_evidence;
            let shaped = self.shaped(zero, (readings, &found.cov), candidates, &found.rivals, none)?;
            found.rivals.extend(shaped);
            found = self.renewed(found, given)?;
        }
        let found = self.screened_again(found, given)?;
        self.fairly(found, given)
    }

    /// Torn structures, sought from the knee as it was given, where the data ask for anything.
    fn torn_where_asked(&self, found: &Found, given: Given) -> Result<Vec<Fit>, DiagnosisError> {
        if !self.is_asked(found, given) {
            return Ok(vec![]);
        }
        self.torn((given.readings, &found.cov), given.candidates, &found.base)
    }

    /// Whether the data ask for anything: nothing missing leaves too much, or an effect passes the threshold.
    fn is_asked(&self, found: &Found, given: Given) -> bool {
        let is_passed = |fit: &Fit| self.gain(fit, &found.base) >= given.threshold;
        self.is_poor(&found.base) || found.rivals.iter().any(is_passed)
    }

    /// Single effects that screens about the ligaments and in the scatter of the end ask for beside those that the first ones did: about nothing missing,
    /// and about the rests of the best, where what imitates it is seen as it is.
    fn screened_again(&self, mut found: Found, given: Given) -> Result<Found, DiagnosisError> {
        let Some(best) = found.rivals.first().cloned() else { return Ok(found) };
        let (gain, few) = (self.gain(&best, &found.base), self.options.shortlist / 2);
        for at in [found.base.clone(), self.stripped(&best, given.readings)] {
            let data = (given.readings, &found.cov);
            let (mut list, _) = self.screen(&at, given.readings, &found.cov, given.candidates)?;
            let known = |l: &Screened| {
                let same = |f: &&Fit| f.hypothesis == std::slice::from_ref(&given.candidates[l.candidates[0]]);
                found.rivals.iter().find(same).is_some_and(|f| self.gain(f, &found.base) > l.gain - OVERTAKEN)
            };
            list.retain(|l| l.gain > (gain - OVERTAKEN).max(0.0) && !known(l));
            let more = self.refits(&at, data, given.candidates, (&list, few), found.base.log_evidence)?;
            found.rivals.extend(more);
            self.sort(&mut found.rivals);
        }
        let first = &found.rivals[0];
        if self.gain(first, &found.base) > gain + 1.0 { self.renewed(found, given) } else { Ok(found) }
    }

    /// The same with a rival in the place of the best where it is the likelier by the mean of both scatters: that at the best favours the best.
    pub(super) fn fairly(&self, mut found: Found, given: Given) -> Result<Found, DiagnosisError> {
        let Some(best) = found.rivals.first() else { return Ok(found) };
        if self.options.by_error || self.gain(best, &found.base) < given.threshold {
            return Ok(found);
        }
        let behind = |f: &Fit| self.log(f) - self.log(best);
        let near: Vec<&Fit> = found.rivals[1..].iter().filter(|f| behind(f) > -CLOSE).take(MOST_CLOSE).collect();
        let in_own: Vec<f64> = near
            .par_iter()
            .map(|f| self.ahead_in_own_scatter(f, best, given))
            .collect::<Result<_, DiagnosisError>>()?;
        let in_common: Vec<f64> = near.iter().map(|f| behind(f)).collect();
        let Some(k) = likelier(&in_common, &in_own) else { return Ok(found) };
        let taken = found.rivals.remove(k + 1);
        found.rivals.insert(0, taken);
        self.refitted(found, given)
    }

    /// By how much a fit is ahead of another in its own scatter.
    fn ahead_in_own_scatter(&self, fit: &Fit, other: &Fit, given: Given) -> Result<f64, DiagnosisError> {
        let cov = self.scatter(fit, given.extra)?;
        let [own, against] = [fit, other].map(|f| self.in_scatter(f, given.readings, &cov));
        Ok(self.log(&own?) - self.log(&against?))
    }

    /// Nothing missing, linear about the rests and the ligaments of a fit with an effect.
    pub fn stripped(&self, fit: &Fit, readings: &Readings) -> Fit {
        let (n, m) = (self.problem.nuisances(), fit.unknowns.len());
        let effect = fit.linear.jacobian.columns(n, m - n) * DVector::from_column_slice(&fit.unknowns[n..]);
        Fit {
            hypothesis: vec![],
            unknowns: fit.unknowns[..n].to_vec(),
            means: fit.means[..n].to_vec(),
            linear: Linear { jacobian: fit.linear.jacobian.columns(0, n).into_owned(), ..fit.linear.clone() },
            residual: &fit.residual + readings.pick(effect.as_slice()),
            posterior: fit.posterior.view((0, 0), (n, n)).into_owned(),
            ..fit.clone()
        }
    }

    /// One more effect beside the best, or two in its place, and whether that earns its place.
    pub(super) fn another(&self, start: &Start, found: Found, given: Given) -> Result<(Found, bool), DiagnosisError> {
        let Some(best) = found.rivals.first().cloned() else { return Ok((found, false)) };
        let short = (given.threshold - self.gain(&best, &found.base)).max(0.0);
        // two effects of which neither alone is worth its name must be worth that of one, and more
        let (least, is_asked) = if short > 0.0 {
            (self.options.least_beside + short, false)
        } else {
            self.least_beside(&best, &found, given)?
        };
        let mut more = found.clone();
        if best.hypothesis.len() == 1 && self.leaves(&best) < HOPELESS[1] {
            more.rivals.extend(self.paired(start, &found, given, least)?);
        }
        if short == 0.0 {
            more.rivals.extend(self.further(&best, &found, given, (least, is_asked))?);
        }
        self.sort(&mut more.rivals);
        let Some(k) = self.worth_more((&more.rivals, &found.cov), &best, given, least)? else {
            return Ok((found, false));
        };
        let taken = more.rivals.remove(k);
        let proven = taken.hypothesis.clone();
        more.rivals.insert(0, taken);
        let mut more = self.refitted(more, given)?;
        let without = self.in_scatter(&best, given.readings, &more.cov)?;
        self.keep_proven(&mut more, &proven, &without)?;
        let is_longer = |f: &Fit| f.hypothesis.len() > best.hypothesis.len();
        if more.rivals.first().is_some_and(|f| is_longer(f) && self.log(f) >= self.log(&without) + least) {
            return Ok((more, true));
        }
        let rivals: Vec<Fit> = std::iter::once(without).chain(found.rivals.into_iter().skip(1)).collect();
        Ok((self.refitted(Found { rivals, ..more }, given)?, false))
    }

    /// Takes fits with an effect more from the front until one stands there that predicts what it has not seen: in the scatter at the one that did (`proven`)
    /// others may be ahead of it that did not, or that nobody asked.
    fn keep_proven(&self, more: &mut Found, proven: &[Candidate], without: &Fit) -> Result<(), DiagnosisError> {
        let (rivals, cov) = (&mut more.rivals, &more.cov);
        let predicts = |fit: &Fit| -> Result<bool, DiagnosisError> {
            Ok(self.first_that_predicts((std::slice::from_ref(fit), without), cov, 0..1)?.is_some())
        };
        drop_unproven(rivals, (proven, without.hypothesis.len()), predicts)
    }

    /// Which of some fits in a scatter, sorted, has an effect more than the best, predicts unseen trials better by it, and is worth it by most.
    fn worth_more(
        &self,
        (fits, cov): (&[Fit], &DMatrix<f64>),
        best: &Fit,
        given: Given,
        least: f64,
    ) -> Result<Option<usize>, DiagnosisError> {
        let in_common = |k: usize| self.log(&fits[k]) - self.log(best);
        let is_longer = |k: &usize| fits[*k].hypothesis.len() > best.hypothesis.len();
        let longer = (0..fits.len()).filter(is_longer);
        let near: Vec<usize> = longer.filter(|&k| in_common(k) >= least).take(MOST_CLOSE).collect();
        let in_own: Vec<f64> = near
            .par_iter()
            .map(|&k| self.ahead_in_own_scatter(&fits[k], best, given))
            .collect::<Result<_, DiagnosisError>>()?;
        let worth = near.iter().zip(&in_own).filter_map(|(&k, own)| Some((k, worth(in_common(k), *own, least)?)));
        let mut worth: Vec<(usize, f64)> = worth.collect();
        worth.sort_by(|a, b| b.1.total_cmp(&a.1));
        self.first_that_predicts((fits, best), cov, worth.into_iter().map(|(k, _)| k))
    }

    /// The best with one more effect each, where the screen beside it promises `least`, much is left, or fields ask for one.
    fn further(
        &self,
        best: &Fit,
        found: &Found,
        given: Given,
        (least, is_asked): (f64, bool),
    ) -> Result<Vec<Fit>, DiagnosisError> {
        let data = (given.readings, &found.cov);
        let (list, _) = self.screen(best, given.readings, &found.cov, given.candidates)?;
        if !is_asked && !self.is_poor(best) && list.first().is_none_or(|l| l.gain < least) {
            return Ok(vec![]);
        }
        let fewer = self.options.shortlist.saturating_sub(2).max(1);
        let mut further = self.refits(best, data, given.candidates, (&list, fewer), best.log_evidence)?;
        let near = further.first().unwrap_or(best);
        if self.is_poor(near) && self.leaves(near) < HOPELESS[1] {
            further.extend(self.shaped(best, data, given.candidates, &[], best.log_evidence)?);
        }
        Ok(further)
    }

    /// What a further effect must add to the best, and whether fields ask for one: where fields of no name beside it would take its name, an effect that
    /// explains as much as they do is the likelier of the two.
    fn least_beside(&self, best: &Fit, found: &Found, given: Given) -> Result<(f64, bool), DiagnosisError> {
        let options = self.options;
        let added = if self.is_poor(best) { options.least_further } else { options.least_beside };
        let evidence = self.gain(best, &found.base);
        let usual = given.threshold.max(added).max(left_by_forms(&best.hypothesis, evidence));
        if !options.wildcard {
            return Ok((usual, false));
        }
        let field = discrepancy(self.problem, (given.readings, &found.cov), best)?.log_bayes_factor;
        let is_asked = asks_for_more(field, best, self.problem.nuisances(), evidence);
        Ok((if is_asked { usual.min(field) } else { usual }, is_asked))
    }

    /// A fit again in another scatter.
    pub(super) fn in_scatter(&self, fit: &Fit, readings: &Readings, cov: &DMatrix<f64>) -> Result<Fit, DiagnosisError> {
        self.fit(&fit.hypothesis, &fit.unknowns, &fit.coordinates(), cov, readings, TRIES)
    }

    /// Effects of the best exchanged for others as long as that finds better.
    pub(super) fn exchange(&self, mut found: Found, given: Given) -> Result<Found, DiagnosisError> {
        let mut asked = Vec::new();
        for _ in 0..EXCHANGES {
            let Some(best) = found.rivals.first().cloned() else { break };
            if self.leaves(&best) > HOPELESS[0] {
                break;
            }
            let exchanged = self.exchanged(&best, (given.readings, &found.cov), given.candidates, &mut asked)?;
            found.rivals.extend(exchanged);
            self.sort(&mut found.rivals);
            let first = &found.rivals[0];
            if self.log(first) < self.log(&best) + 1.0 {
                break;
            }
            // the same effects in a better valley are no exchange
            let is_exchanged = first.hypothesis.iter().any(|c| !best.hypothesis.contains(c));
            found = self.renewed(found, given)?;
            if !is_exchanged {
                break;
            }
        }
        Ok(found)
    }

    /// The best again with the scatter at the best.
    pub(super) fn renewed(&self, mut found: Found, given: Given) -> Result<Found, DiagnosisError> {
        self.sort(&mut found.rivals);
        self.refitted(found, given)
    }

    /// The same, the first of the rivals being the best.
    fn refitted(&self, mut found: Found, given: Given) -> Result<Found, DiagnosisError> {
        self.meet(&mut found);
        let (base, rivals, cov) = self.again(found.base, found.rivals, given.readings, given.extra)?;
        Ok(Found { base, rivals, cov, met: found.met })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::candidate::Scope;
    use crate::effect::catalogue::Catalogue;
    use crate::fit::bare;

    #[test]
    fn a_further_effect_must_earn_what_a_form_may_leave_and_a_frame_leaves_nothing() {
        let of = |id: &str| {
            let effect = Catalogue::shipped().effect.into_iter().find(|e| e.id == id).unwrap();
            Candidate { effect, variant: 0, scope: Scope::Both }
        };
        assert_eq!(left_by_forms(&[of("femur_frame"), of("load_gain")], 5000.0), 0.0);
        assert!((left_by_forms(&[of("femur_frame"), of("meniscus")], 500.0) - 20.0).abs() < 1e-9);
        assert_eq!(left_by_forms(&[], 500.0), 0.0);
    }

    #[test]
    fn effects_are_the_same_in_whatever_order_and_in_their_scopes() {
        let of = |id: &str, scope: Scope| {
            let effect = Catalogue::shipped().effect.into_iter().find(|e| e.id == id).unwrap();
            Candidate { effect, variant: 0, scope }
        };
        let (one, other) = (of("itb", Scope::Both), of("load_gain", Scope::Only(0)));
        assert!(are_the_same(&[one.clone(), other.clone()], &[other.clone(), one.clone()]));
        assert!(!are_the_same(&[one.clone(), other.clone()], &[one.clone(), of("load_gain", Scope::Only(1))]));
        assert!(!are_the_same(std::slice::from_ref(&one), &[one.clone(), other]));
    }

    #[test]
    fn an_effect_beside_a_name_stays_where_it_was_proven_or_predicts_and_else_the_name_alone() {
        let of = |id: &str| bare::candidate(id, Scope::Both);
        let name = || bare::fit(vec![of("itb")]);
        let beside = |id: &str| bare::fit(vec![of("itb"), of(id)]);
        // what is left in front of a name and an effect beside it, of which those beside it predict that have these names
        let left = |ahead: &[&str], proven: &str, predict: &[&str]| {
            let mut rivals: Vec<Fit> = ahead.iter().map(|id| beside(id)).chain([name()]).collect();
            let predicts = |f: &Fit| Ok(predict.iter().any(|id| f.hypothesis[1].effect.id == *id));
            drop_unproven(&mut rivals, (&[of(proven), of("itb")], 1), predicts).unwrap();
            rivals[0].hypothesis.iter().map(|c| c.effect.id.clone()).collect::<Vec<_>>()
        };
        // a bundle that nobody proved and that predicts nothing gives way to what was proven behind it
        assert_eq!(left(&["extra_bundle", "gravity"], "gravity", &[]), ["itb", "gravity"]);
        // where nothing was proven, the name stands alone; where the bundle predicts, it stays
        assert_eq!(left(&["extra_bundle"], "gravity", &[]), ["itb"]);
        assert_eq!(left(&["extra_bundle"], "gravity", &["extra_bundle"]), ["itb", "extra_bundle"]);
        assert_eq!(left(&["extra_bundle"], "extra_bundle", &[]), ["itb", "extra_bundle"]);
        // nothing behind the first that stays is asked
        let mut rivals = vec![name(), beside("extra_bundle")];
        drop_unproven(&mut rivals, (&[], 1), |_| Err(DiagnosisError::Model("asked".into()))).unwrap();
        assert_eq!(rivals.len(), 2);
    }

    #[test]
    fn a_further_effect_must_be_worth_it_in_both_scatters_and_counts_by_their_mean() {
        assert_eq!(worth(7.0, 10.0, 6.0), Some(8.5));
        // one of them alone is not enough
        assert_eq!(worth(5.0, 30.0, 6.0), None);
        assert_eq!(worth(30.0, 5.0, 6.0), None);
        assert_eq!(worth(30.0, f64::NAN, 6.0), None);
    }

    #[test]
    fn a_rival_takes_the_place_of_the_best_where_both_scatters_together_prefer_it_clearly() {
        assert_eq!(likelier(&[-3.2, -1.0], &[13.5, 14.0]), Some(1));
        // what its own scatter alone prefers by as much as the other does the best, or a little more, stays behind
        assert_eq!(likelier(&[-3.2, -2.6], &[3.2, 6.9]), None);
        assert_eq!(likelier(&[-1.0], &[f64::NAN]), None);
        assert_eq!(likelier(&[], &[]), None);
    }
}

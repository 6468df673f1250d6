//! Joint refits of hypotheses: from a screen, from a typical size, in the scatter at the best, and each in its own.

use super::steps::OVERTAKEN;
use super::{FEW, Screened, Searcher, TRIES, is_in};
use crate::effect::candidate::{Candidate, Scope, sized};
use crate::error::DiagnosisError;
use crate::fit::Fit;
use crate::fit::screen::Marginal;
use crate::problem::Begin;
use crate::problem::covariance::Readings;
use crate::problem::outlier::Mixture;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// How many of the best are weighed in their own scatter, too [-].
const OWN_SCATTER: usize = 5;

/// From how many rivals' ligaments nothing missing is fitted, too [-].
const OTHERS: usize = 3;

/// Shares of a whole from which a torn structure is sought [-], and whether beside the recalibrated knee instead of the given one.
const TORN: [(f64, bool); 3] = [(0.5, false), (1.0, false), (1.0, true)];

/// How many of those starts are fitted at most, the most promising by their own linear evidence [-].
const TORN_TRIED: usize = 4;

/// How far short of the best a lifted rival stays at least [nats]: more than rounding takes, less than anything means.
const SHORT: f64 = 1e-6;

/// By how much hypotheses of log evidence `common`, the best first, are lifted towards the best by what they have in their `own` scatter; never past it,
/// nor by rounding.
fn lifts(common: &[f64], own: &[f64]) -> Vec<f64> {
    let (Some(best), Some(top)) = (common.first(), own.first()) else { return Vec::new() };
    let lift = |(x, o): (&f64, &f64)| if o.is_finite() { (best + (o - top).min(-SHORT) - x).max(0.0) } else { 0.0 };
    common.iter().zip(own).map(lift).collect()
}

/// The best of a screen that are as large as their names ask: two scopes or variants of an effect, or of a pair, at most.
pub(super) fn proposed<'a>(list: &'a [Screened], candidates: &[Candidate], most: usize) -> Vec<&'a Screened> {
    let mut chosen: Vec<&Screened> = Vec::new();
    let ids =
        |of: &Screened| -> Vec<&str> { of.candidates.iter().map(|k| candidates[*k].effect.id.as_str()).collect() };
    for item in list {
        // half the way on a straight line may be the whole on a bent one
        let doubled: Vec<f64> = item.size.iter().map(|x| 2.0 * x).collect();
        let of = item.candidates.iter().map(|k| &candidates[*k]);
        let is_large_enough = sized(of, &doubled).all(|(c, size)| c.is_large_enough(size));
        if is_large_enough && chosen.iter().filter(|c| ids(c) == ids(item)).count() < 2 {
            chosen.push(item);
        }
        if chosen.len() >= most {
            break;
        }
    }
    chosen
}

/// Where a refit of a fit with a proposal starts: its hypothesis and unknowns.
pub(super) fn start_with(at: &Fit, item: &Screened, candidates: &[Candidate]) -> (Vec<Candidate>, Vec<f64>) {
    let mut hypothesis = at.hypothesis.clone();
    let beside = item.beside.iter().zip(&at.unknowns);
    let mut start: Vec<f64> = beside.map(|(x, own)| x.clamp(own - 1.5, own + 1.5)).collect();
    for (candidate, size) in sized(item.candidates.iter().map(|k| &candidates[*k]), item.size.as_slice()) {
        let nothing = candidate.nothing();
        let flat = candidate.active(&vec![0.0; nothing.len()]).has_no_slope_at_zero();
        let size = size.iter().map(|x| x.clamp(if flat { 0.5 } else { -3.0 }, 3.0));
        start.extend(size.zip(nothing).map(|(x, shape)| x + shape));
        hypothesis.push(candidate.clone());
    }
    (hypothesis, start)
}

/// A fit's hypothesis and unknowns without its effect `k`.
fn without(fit: &Fit, k: usize, nuisances: usize) -> (Vec<Candidate>, Vec<f64>) {
    let first = nuisances + fit.hypothesis[..k].iter().map(Candidate::size).sum::<usize>();
    let mut unknowns = fit.unknowns.clone();
    unknowns.drain(first..first + fit.hypothesis[k].size());
    let mut hypothesis = fit.hypothesis.clone();
    hypothesis.remove(k);
    (hypothesis, unknowns)
}

impl Searcher<'_> {
    /// Joint refits of a fit with the best of a screen.
    pub(super) fn refits(
        &self,
        at: &Fit,
        (readings, cov): (&Readings, &DMatrix<f64>),
        candidates: &[Candidate],
        (list, most): (&[Screened], usize),
        without: f64,
    ) -> Result<Vec<Fit>, DiagnosisError> {
        let mixture = Mixture::new(readings, readings.block_of(cov), &self.problem.trials)?;
        let refit = |item: &&Screened| -> Result<Fit, DiagnosisError> {
            let (hypothesis, start) = start_with(at, item, candidates);
            let fit = self.fit_to(&hypothesis, &start, &at.coordinates(), (readings, &mixture), FEW)?;
            Ok(fit.earned(without, item.size.len()))
        };
        let mut fits: Vec<Fit> =
            proposed(list, candidates, most).par_iter().map(refit).collect::<Result<_, DiagnosisError>>()?;
        fits.retain(|f| self.deserves_its_names(f));
        self.sort(&mut fits);
        Ok(fits)
    }

    /// Refits, from a typical size, of effects whose shape is free beside what a fit has already: a screen about one shape cannot judge those.
    pub(super) fn shaped(
        &self,
        at: &Fit,
        (readings, cov): (&Readings, &DMatrix<f64>),
        candidates: &[Candidate],
        tried: &[Fit],
        without: f64,
    ) -> Result<Vec<Fit>, DiagnosisError> {
        let beside = |c: &Candidate| [&at.hypothesis[..], std::slice::from_ref(c)].concat();
        let left: Vec<&Candidate> = candidates
            .iter()
            .filter(|c| c.scope == Scope::Both && c.effect.parameter.iter().any(|p| p.shape))
            .filter(|c| !is_in(at, c) && tried.iter().all(|f| f.hypothesis != beside(c)))
            .collect();
        let mixture = Mixture::new(readings, readings.block_of(cov), &self.problem.trials)?;
        let fits: Vec<Fit> = left
            .par_iter()
            .map(|c| {
                let mut start = at.unknowns.clone();
                start.extend(c.typical());
                let fit = self.fit_to(&beside(c), &start, &at.coordinates(), (readings, &mixture), FEW)?;
                Ok(fit.earned(without, c.size()))
            })
            .collect::<Result<_, DiagnosisError>>()?;
        Ok(fits)
    }

    /// Refits of effects that may be whole (a structure torn), each from half of it and all of it beside the knee as it was given, and from all of it beside
    /// the knee as it was recalibrated with this structure put back. About a knee whose ligaments were recalibrated to the data a torn structure is slack
    /// already, so that screens there see nothing of it.
    pub(super) fn torn(
        &self,
        (readings, cov): (&Readings, &DMatrix<f64>),
        candidates: &[Candidate],
        base: &Fit,
    ) -> Result<Vec<Fit>, DiagnosisError> {
        let without = base.log_evidence;
        let whole = |c: &Candidate| c.effect.parameter.iter().any(|p| p.whole.is_some());
        let starts = candidates.iter().filter(|c| whole(c) && c.scope == Scope::Both);
        let starts: Vec<(&Candidate, f64, bool)> =
            starts.flat_map(|c| TORN.map(|(share, anew)| (c, share, anew))).collect();
        let mut promised: Vec<(f64, Fit)> = starts
            .par_iter()
            .map(|(c, share, recalibrated)| {
                let sizes = c.effect.parameter.iter().map(|p| share * p.whole.unwrap_or(0.0) / p.sd);
                let knee = if *recalibrated { self.put_back(base, c) } else { self.problem.nuisance.given.clone() };
                let unknowns = knee.into_iter().chain(sizes).collect();
                let at = self.standing(std::slice::from_ref(*c), unknowns, readings)?;
                Ok((Marginal::new(&at, readings, cov)?.log_density(), at))
            })
            .collect::<Result<_, DiagnosisError>>()?;
        promised.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mixture = Mixture::new(readings, readings.block_of(cov), &self.problem.trials)?;
        let mut fits: Vec<Fit> = Vec::new();
        for (promise, at) in promised.iter().take(TORN_TRIED) {
            let is_settled = |f: &Fit| f.hypothesis == at.hypothesis && !self.is_poor(f);
            let best = fits.iter().map(|f| f.log_evidence).fold(f64::NEG_INFINITY, f64::max);
            if *promise < best - OVERTAKEN || fits.iter().any(is_settled) {
                continue;
            }
            let fit = self.fit_to(&at.hypothesis, &at.unknowns, &at.coordinates(), (readings, &mixture), TRIES)?;
            fits.push(fit.earned(without, at.hypothesis[0].size()));
        }
        Ok(fits)
    }

    /// The knee of a fit, the structure that a candidate is about as it was given.
    pub(crate) fn put_back(&self, fit: &Fit, candidate: &Candidate) -> Vec<f64> {
        let nuisance = &self.problem.nuisance;
        let mut knee = fit.unknowns[..nuisance.len()].to_vec();
        let own = candidate.variant_name().map_or(vec![], |structure| nuisance.of_structure(&structure));
        own.into_iter().for_each(|k| knee[k] = nuisance.given[k]);
        knee
    }

    /// A hypothesis as it stands at some unknowns, not fitted, each trial led to its rest the whole way.
    pub(crate) fn standing(
        &self,
        hypothesis: &[Candidate],
        unknowns: Vec<f64>,
        readings: &Readings,
    ) -> Result<Fit, DiagnosisError> {
        let linear = self.problem.linear(hypothesis, &unknowns, Begin::At(&[]))?;
        Ok(Fit {
            hypothesis: hypothesis.to_vec(),
            residual: &readings.measured - readings.pick(&linear.value),
            misfit: 0.0,
            outliers: vec![],
            log_evidence: 0.0,
            posterior: DMatrix::identity(unknowns.len(), unknowns.len()),
            means: self.problem.means(unknowns.len()),
            unknowns,
            linear,
        })
    }

    /// Answers of as many effects with one exchanged for another: what was found first may only have stood in for what came later. Free shapes are tried
    /// where what the screens ask for still leaves too much. What was `asked` for beside the same effects before is not asked for again.
    pub(super) fn exchanged(
        &self,
        best: &Fit,
        (readings, cov): (&Readings, &DMatrix<f64>),
        candidates: &[Candidate],
        asked: &mut Vec<Vec<Candidate>>,
    ) -> Result<Vec<Fit>, DiagnosisError> {
        let mixture = Mixture::new(readings, readings.block_of(cov), &self.problem.trials)?;
        let mut out = Vec::new();
        for k in 0..best.hypothesis.len() {
            let (hypothesis, start) = without(best, k, self.problem.nuisances());
            if asked.iter().any(|a| a.len() == hypothesis.len() && hypothesis.iter().all(|c| a.contains(c))) {
                continue;
            }
            asked.push(hypothesis.clone());
            let at = self.fit_to(&hypothesis, &start, &best.coordinates(), (readings, &mixture), TRIES)?;
            let (list, _) = self.screen(&at, readings, cov, candidates)?;
            let mut fits =
                self.refits(&at, (readings, cov), candidates, (&list, self.options.shortlist / 2), at.log_evidence)?;
            if self.is_poor(fits.first().unwrap_or(&at)) {
                fits.extend(self.shaped(&at, (readings, cov), candidates, &fits, at.log_evidence)?);
            }
            out.extend(fits);
        }
        Ok(out)
    }

    /// Lifts rivals that come closer to the best where each is weighed in the scatter at its own fit: the scatter at the best favours the best, by
    /// many nats where trials lie near a fold. The best stays the best, for a threshold is passed in one scatter.
    pub(super) fn weigh_in_own_scatter(
        &self,
        rivals: &mut Vec<Fit>,
        readings: &Readings,
        extra: &DMatrix<f64>,
    ) -> Result<(), DiagnosisError> {
        if self.options.by_error {
            return Ok(());
        }
        // the scatter moves with the fit and the fit with the scatter: the mean of two rounds
        let own = |fit: &Fit| -> Result<f64, DiagnosisError> {
            let mut fit = fit.clone();
            let mut sum = 0.0;
            for _ in 0..2 {
                let scatter = self.scatter(&fit, extra)?;
                let mixture = Mixture::new(readings, readings.block_of(&scatter), &self.problem.trials)?;
                fit = self.fit_to(&fit.hypothesis, &fit.unknowns, &fit.coordinates(), (readings, &mixture), TRIES)?;
                sum += 0.5 * self.log(&fit);
            }
            let size = fit.hypothesis.iter().map(Candidate::size).sum();
            // what has no size there is the scatter's merit, not the effect's
            Ok(if fit.own_evidence(size) > 0.0 { sum } else { f64::NEG_INFINITY })
        };
        let in_own: Vec<f64> = rivals.par_iter().take(OWN_SCATTER).map(own).collect::<Result<_, _>>()?;
        let in_common: Vec<f64> = rivals.iter().map(|f| self.log(f)).collect();
        for (fit, by) in rivals.iter_mut().zip(lifts(&in_common, &in_own)) {
            fit.log_evidence += by;
        }
        self.sort(rivals);
        Ok(())
    }

    /// The best again with the scatter at the best, and nothing missing from its ligaments.
    pub(super) fn again(
        &self,
        base: Fit,
        rivals: Vec<Fit>,
        readings: &Readings,
        extra: &DMatrix<f64>,
    ) -> Result<(Fit, Vec<Fit>, DMatrix<f64>), DiagnosisError> {
        let Some(best) = rivals.first() else {
            let cov = self.scatter(&base, extra)?;
            return Ok((base, rivals, cov));
        };
        let cov = self.scatter(best, extra)?;
        let mixture = Mixture::new(readings, readings.block_of(&cov), &self.problem.trials)?;
        let n = self.problem.nuisances();
        let given = vec![0.0; n];
        // nothing missing is given every chance that its rivals have: their ligaments, too; the best's where it explains little
        let others = if base.explains_little() { 1 } else { OTHERS };
        let mut starts: Vec<(&[f64], &Fit)> = vec![(&base.unknowns, &base), (&given, best)];
        starts.extend(rivals.iter().take(others).map(|f| (&f.unknowns[..n], f)));
        let bases: Vec<Fit> = starts
            .par_iter()
            .map(|(x, f)| self.fit_to(&[], x, &f.coordinates(), (readings, &mixture), TRIES))
            .collect::<Result<_, _>>()?;
        let base = bases.into_iter().reduce(|a, b| if b.log_evidence > a.log_evidence { b } else { a }).unwrap_or(base);
        // each from where it stands, and the first from the model's own ligaments: two valleys; a torn structure from those before any recalibration, too
        let (own, first) = (rivals.iter().take(6), || rivals.iter().take(OTHERS));
        let mut few: Vec<(&Fit, Option<&[f64]>)> = own.map(|f| (f, None)).collect();
        few.extend(first().map(|f| (f, Some(&given[..]))));
        let before = &self.problem.nuisance.given[..];
        few.extend(first().filter(|f| f.has_most_of_a_whole()).map(|f| (f, Some(before))));
        let mut fits: Vec<Fit> = few
            .par_iter()
            .map(|(f, anew)| {
                let mut start = f.unknowns.clone();
                if let Some(ligaments) = anew {
                    start[..n].copy_from_slice(ligaments);
                }
                let size = f.hypothesis.iter().map(Candidate::size).sum();
                let fit = self.fit_to(&f.hypothesis, &start, &f.coordinates(), (readings, &mixture), TRIES)?;
                Ok(fit.earned(base.log_evidence, size))
            })
            .collect::<Result<_, DiagnosisError>>()?;
        fits.retain(|f| self.deserves_its_names(f));
        self.sort(&mut fits);
        Ok((base, fits, cov))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rival_is_lifted_as_far_as_its_own_scatter_brings_it_and_never_past_the_best() {
        // the best, one that its own scatter prefers, one as far in it, one farther, one that could not be weighed
        let common = [10.0, 2.0, 5.0, 8.0, 7.0, 1.0];
        let own = [30.0, 33.0, 25.0, 20.0, f64::NEG_INFINITY];
        let near = |got: &[f64], asked: &[f64]| {
            got.len() == asked.len() && got.iter().zip(asked).all(|(g, a)| (g - a).abs() < 2e-6)
        };
        assert!(near(&lifts(&common, &own), &[0.0, 8.0, 0.0, 0.0, 0.0]));
        // what its own scatter prefers stays behind the best however the two round
        for k in 1..2000 {
            let (best, rival) = (60.0 + 1.0 / f64::from(k), 55.0 - 1.0 / f64::from(k * k + 1));
            assert!(rival + lifts(&[best, rival], &[1.0, 3.0])[1] < best);
        }
        // a best that its own scatter does not bear is no better than its rivals
        assert!(near(&lifts(&[10.0, 2.0], &[f64::NEG_INFINITY, 3.0]), &[0.0, 8.0]));
        assert!(lifts(&[], &[]).is_empty());
    }
}

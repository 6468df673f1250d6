//! How sure an answer is: weights of rivals, what a name must have earned, and what it may leave.

use crate::fit::Fit;
use crate::problem::Scope;
use crate::search::{Search, Searcher};
use serde::{Deserialize, Serialize};

/// How sure the answer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// One answer, weight 0.95 and more, and it predicts trials it has not seen.
    Decisive,
    /// One answer, weight 0.75 and more.
    Probable,
    /// One of several.
    OneOf,
    /// Something is missing that the catalogue does not have.
    Unnamed,
    /// Nothing beyond noise and floor.
    None,
}

/// How many times less loud the data speak than their declared scatter says: the floor is known no better than this, and a misfit shows that it is
/// too narrow. It raises the threshold of a name, tempers the weights of names and widens the intervals of sizes alike.
pub(crate) fn temper(searcher: &Searcher, fit: &Fit) -> f64 {
    1.5 * (searcher.total(fit) / fit.residual.len() as f64).max(1.0)
}

/// Weight of each rival: evidence and prior, tempered where the best leaves more than it should.
pub(crate) fn weights<'a>(searcher: &Searcher, search: &'a Search, best: &Fit) -> Vec<(&'a Fit, f64)> {
    let temper = temper(searcher, best);
    let top = searcher.gain(best, &search.base);
    let mut out: Vec<(&Fit, f64)> =
        search.rivals.iter().map(|f| (f, ((searcher.gain(f, &search.base) - top) / temper).exp())).collect();
    let sum: f64 = out.iter().map(|(_, w)| w).sum::<f64>() + (-top / temper).exp();
    out.iter_mut().for_each(|(_, w)| *w /= sum);
    out
}

/// Log Bayes factor from which a nameless field explains more than the answer does [-].
const NAMELESS: f64 = 8.0;
/// Size of an effect, in standard deviations of its prior, that is no longer the effect of that name [-].
const BEYOND_BELIEF: f64 = 5.0;
/// Share of the held-out gap that a named effect must close where the rest stays significant; closing less, it is not what is missing [-].
const LEAST_CLOSED: f64 = 0.3;
/// And that a decisive answer must close [-]: leaving more than it closes, it is at most part of what is missing.
const MOSTLY: f64 = 0.5;
/// Standard deviations of the sum of squares from which something is missing though no effect explains it [-].
const BEYOND_DOUBT: f64 = 4.0;

/// An answer that asks to be believed.
pub(crate) struct Candidature<'a> {
    /// The best hypothesis where its evidence passes the threshold, else nothing missing.
    pub believed: &'a Fit,
    /// Nothing missing.
    pub base: &'a Fit,
    /// Whether the evidence passes the threshold.
    pub is_named: bool,
    /// Log Bayes factor of a nameless field beside it [-].
    pub wild: f64,
    /// Its gain of the held-out log score [-].
    pub gain: f64,
    /// Share of the held-out gap that it closes [-].
    pub closes: f64,
}

/// How sure the answer is.
pub(crate) fn verdict(searcher: &Searcher, rivals: &[(&Fit, f64)], of: &Candidature) -> Verdict {
    let readings = of.believed.residual.len() as f64;
    let excess = searcher.total(of.believed) - readings;
    let deviations = excess / (2.0 * readings).sqrt();
    let poor = deviations > 2.5;
    let left = excess / (searcher.total(of.base) - readings).max(1e-9);
    let n = searcher.problem.nuisances();
    // the first effect, which explains most, may leave as much as its form in this knee may differ by (frames and loads have one form),
    // unless its size is one that nobody would expect
    let share = of.believed.hypothesis.first().map_or(0.0, |c| c.effect.form_share);
    let fitting = of.is_named && left < share && of.believed.unknowns[n..].iter().all(|x| x.abs() < BEYOND_BELIEF);
    let nameless = of.wild > NAMELESS && !fitting;
    let beside = if of.is_named { of.closes < LEAST_CLOSED } else { deviations > BEYOND_DOUBT };
    if searcher.options.wildcard && poor && (nameless || beside) {
        return Verdict::Unnamed;
    }
    if !of.is_named {
        return Verdict::None;
    }
    let weight = by_names(rivals).first().map_or(0.0, |g| g.1);
    // a named effect that leaves much is not the whole truth
    let rests = excess < 0.25 * readings && !(searcher.options.wildcard && of.wild > NAMELESS);
    let shrinks = of.gain > 0.0 && of.closes >= MOSTLY;
    if weight >= 0.95 && shrinks && rests && is_sized(searcher, of.believed) && holds(searcher, of.base, rivals) {
        Verdict::Decisive
    } else if weight >= 0.75 {
        Verdict::Probable
    } else {
        Verdict::OneOf
    }
}

/// Whether each effect has a size that its 90 % interval keeps from nothing.
fn is_sized(searcher: &Searcher, fit: &Fit) -> bool {
    let values = fit.parameters(searcher.problem.nuisances(), temper(searcher, fit));
    fit.hypothesis.iter().zip(values).all(|(c, values)| {
        let mut sizes = c.effect.parameter.iter().zip(values).filter(|(p, _)| !p.shape);
        sizes.any(|(_, (value, sd))| value.abs() > 1.645 * sd)
    })
}

/// Whether the first answer stays the first, and above the threshold, with priors half and twice as wide and noise of 0.7 and 1.5 of the stated.
fn holds(searcher: &Searcher, base: &Fit, rivals: &[(&Fit, f64)]) -> bool {
    let n = searcher.problem.nuisances();
    let Some((first, _)) = rivals.first() else { return true };
    let names = |f: &Fit| f.hypothesis.iter().map(|c| (c.name(), c.scope)).collect::<Vec<_>>();
    let score = |f: &Fit, wide: f64, noise: f64| {
        let heavy = |x: f64| 2.5 * (1.0 + x * x / 4.0).ln();
        let prior: f64 = f.unknowns[n..].iter().map(|x| heavy(*x) - heavy(x / wide) - wide.ln()).sum();
        searcher.gain(f, base) / (noise * noise) + prior
    };
    [(0.5, 1.0), (2.0, 1.0), (1.0, 0.7), (1.0, 1.5)].iter().all(|&(wide, noise)| {
        let own = score(first, wide, noise);
        own > searcher.options.least_evidence
            && rivals.iter().all(|(f, _)| names(f) == names(first) || score(f, wide, noise) < own)
    })
}

/// Rivals with the same effects and scopes are one answer: its best fit and the sum of weights.
pub(crate) fn by_names<'a>(rivals: &[(&'a Fit, f64)]) -> Vec<(&'a Fit, f64)> {
    type Key = Vec<(String, Scope)>;
    let mut out: Vec<(Key, &Fit, f64)> = Vec::new();
    for (fit, weight) in rivals {
        let mut key: Vec<(String, Scope)> = fit.hypothesis.iter().map(|c| (c.name(), c.scope)).collect();
        key.sort();
        match out.iter_mut().find(|(k, _, _)| *k == key) {
            Some(one) => one.2 += weight,
            None => out.push((key, fit, *weight)),
        }
    }
    let mut out: Vec<(&Fit, f64)> = out.into_iter().map(|(_, f, w)| (f, w)).collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}

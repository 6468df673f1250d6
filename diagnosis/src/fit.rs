//! The most probable ligaments, contact and effects under a hypothesis, and the evidence for it (Laplace's approximation).

#[cfg(test)]
pub(crate) mod bare;
pub(crate) mod form;
pub mod next_test;
pub mod screen;

use crate::effect::candidate::{Candidate, sized};
use crate::effect::catalogue::Parameter;
use crate::error::DiagnosisError;
use crate::problem::covariance::Readings;
use crate::problem::outlier::{Mixture, Weighed};
use crate::problem::{Begin, Linear, Problem};
use inference::least_squares::{Bounds, Quadratic, Stop, descend};
use nalgebra::{Cholesky, DMatrix, DVector};
use sim::equilibrium::{Start, starts_of};

/// Bounds of the unknowns, in units of their prior.
pub(crate) const REACH: f64 = 8.0;

/// A fit ends where a step promises or gains less than this [nats].
const SMALL: f64 = 0.05;

/// Cost of a fit, over the number of readings, from which it explains little [nats]: twice what noise leaves. Which of its valleys it lies in is no matter.
const LITTLE: f64 = 1.0;
/// Most evaluations of a fit's steps where it still explains little.
const TRIES_OF_LITTLE: usize = 12;

/// Below this log Bayes factor of its own size, an effect's evidence is looked into.
const DOUBTFUL: f64 = 15.0;
/// Evidence that may come on top of it, since Laplace's approximation is one.
const SLACK: f64 = 3.0;

/// A fitted hypothesis.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The hypothesis.
    pub hypothesis: Vec<Candidate>,
    /// The unknowns.
    pub unknowns: Vec<f64>,
    /// Means of their priors.
    pub means: Vec<f64>,
    /// Predictions and derivatives there.
    pub linear: Linear,
    /// Measured minus predicted, of the readings fitted.
    pub residual: DVector<f64>,
    /// Whitened sum of squares of the residual; an outlier's limited to what it costs.
    pub misfit: f64,
    /// Trials that it does not explain, set aside ([`crate::problem::outlier`]).
    pub outliers: Vec<usize>,
    /// Log of the evidence, the scatter it was weighed with included; up to a constant common to all hypotheses fitted to the same readings.
    pub log_evidence: f64,
    /// Posterior covariance of the unknowns.
    pub posterior: DMatrix<f64>,
}

/// What is fitted to.
#[derive(Clone, Copy)]
pub struct Data<'a> {
    /// The question.
    pub problem: &'a Problem,
    /// The readings.
    pub readings: &'a Readings,
    /// Their scatter.
    pub mixture: &'a Mixture,
    /// Most evaluations of a fit's steps.
    pub steps: usize,
    /// Unknowns that are held where the fit starts.
    pub held: &'a [usize],
}

/// Minus the log prior with its slope and curvature: normal about their `means` for nuisance parameters, Student's t with four degrees for effects.
fn prior(k: usize, means: &[f64], x: f64) -> (f64, f64, f64) {
    if let Some(mean) = means.get(k) {
        let x = x - mean;
        (0.5 * x * x, x, 1.0)
    } else {
        // relative to a normal density at its mode, so that the normalisations of all unknowns agree
        let at_zero = -(0.375f64 * (2.0 * std::f64::consts::PI).sqrt()).ln();
        let spread = 1.0 + x * x / 4.0;
        (2.5 * spread.ln() + at_zero, 1.25 * x / spread, 1.25 / spread)
    }
}

/// Bounds of the unknowns of a hypothesis, in units of their prior: sizes may not be negative where that means nothing, nor larger than the whole.
fn bounds_of(hypothesis: &[Candidate], nuisances: usize) -> Vec<Bounds> {
    let mut out = vec![Bounds { low: -REACH, high: REACH }; nuisances];
    for c in hypothesis {
        out.extend(c.effect.parameter.iter().map(|p| Bounds {
            low: if p.one_sided { 0.0 } else { -REACH },
            high: p.whole.map_or(REACH, |whole| whole / p.sd),
        }));
    }
    out
}

/// Log of the posterior's share within bounds over the prior's, where an unknown stands at `x` with a standard deviation: what lies outside is neither
/// believed before nor after. A prior reaches as far as it likes where nothing bounds it.
fn log_share(within: Bounds, x: f64, sd: f64) -> f64 {
    let is_bounded = [within.low > -REACH, within.high < REACH];
    let below = |bound: f64| normal_below((bound - x) / sd);
    let posterior =
        if is_bounded[1] { below(within.high) } else { 1.0 } - if is_bounded[0] { below(within.low) } else { 0.0 };
    let prior = if is_bounded[1] { heavy_below(within.high) } else { 1.0 } - if is_bounded[0] { 0.5 } else { 0.0 };
    (posterior / prior).ln()
}

/// Unknowns of a hypothesis within their bounds, in units of their priors.
pub(crate) fn within(hypothesis: &[Candidate], nuisances: usize, unknowns: impl Iterator<Item = f64>) -> Vec<f64> {
    unknowns.zip(bounds_of(hypothesis, nuisances)).map(|(x, bounds)| bounds.clamp(x)).collect()
}

/// The distribution function of the effects' prior, Student's t with four degrees of freedom, in closed form.
fn heavy_below(x: f64) -> f64 {
    let t = x / (4.0 + x * x).sqrt();
    0.5 + 0.75 * (t - t.powi(3) / 3.0)
}

/// How trials that no hypothesis explains are weighed.
#[derive(Clone, Copy)]
enum Weighing {
    /// Set aside at a price ([`crate::problem::outlier`]).
    Mixed,
    /// Like all others.
    All,
}

struct State {
    unknowns: Vec<f64>,
    linear: Linear,
    residual: DVector<f64>,
    white: DVector<f64>,
    jacobian: DMatrix<f64>,
    weighed: Weighed,
    cost: f64,
}

impl Data<'_> {
    fn state(
        &self,
        (hypothesis, weighing): (&[Candidate], Weighing),
        unknowns: Vec<f64>,
        begin: Begin,
    ) -> Result<State, DiagnosisError> {
        let linear = self.problem.linear(hypothesis, &unknowns, begin)?;
        let residual = &self.readings.measured - self.readings.pick(&linear.value);
        let weighed = match weighing {
            Weighing::Mixed => self.mixture.weigh(&residual),
            Weighing::All => self.mixture.weigh_all(&residual),
        };
        let whitening = weighed.whitening.as_ref().unwrap_or(self.mixture.plain());
        let white = whitening.white_vector(&residual);
        let jacobian = whitening.white(&self.readings.rows_of(&linear.jacobian));
        let means = &self.problem.nuisance.mean;
        let prior: f64 = unknowns.iter().enumerate().map(|(k, x)| prior(k, means, *x).0).sum();
        let cost = weighed.cost + prior;
        let cost = if cost.is_finite() { cost } else { f64::INFINITY };
        Ok(State { unknowns, linear, residual, white, jacobian, weighed, cost })
    }

    /// The most probable unknowns under a hypothesis, from a start. A trial that was set aside on the way pulls no more: from where such a fit ends, all
    /// trials are fitted once, and then as before; the better of the two ends counts. Not where a fit explains little.
    ///
    /// Errors: a model that cannot be evaluated.
    pub fn fit(&self, hypothesis: &[Candidate], start: &[f64], starts: &[Start]) -> Result<Fit, DiagnosisError> {
        let bounds = bounds_of(hypothesis, self.problem.nuisances());
        let unknowns: Vec<f64> = start.iter().zip(&bounds).map(|(x, within)| within.clamp(*x)).collect();
        let rests = self.problem.nearer(hypothesis, &unknowns, starts)?;
        let first = self.descend((hypothesis, Weighing::Mixed), unknowns, &starts_of(&rests))?;
        if first.weighed.outliers.is_empty() || self.explains_little(&first) {
            return Ok(self.conclude(hypothesis, first, &bounds));
        }
        let all = self.descend((hypothesis, Weighing::All), first.unknowns.clone(), &starts_of(&first.linear.rests))?;
        let second =
            self.descend((hypothesis, Weighing::Mixed), all.unknowns.clone(), &starts_of(&all.linear.rests))?;
        let [first, second] = [first, second].map(|state| self.conclude(hypothesis, state, &bounds));
        Ok(if second.log_evidence > first.log_evidence { second } else { first })
    }

    /// The least cost near some unknowns, by damped least squares.
    fn descend(
        &self,
        question: (&[Candidate], Weighing),
        unknowns: Vec<f64>,
        starts: &[Start],
    ) -> Result<State, DiagnosisError> {
        let mut bounds = bounds_of(question.0, self.problem.nuisances());
        self.held.iter().for_each(|&k| bounds[k] = Bounds { low: unknowns[k], high: unknowns[k] });
        let mut fault = DiagnosisError::Model("a fit has no start".into());
        let evaluate = |x: &DVector<f64>, last: Option<(&DVector<f64>, &State)>| {
            let begin = last.map_or(Begin::At(starts), |(_, here)| Begin::After(&here.linear));
            let state = self.state(question, x.as_slice().to_vec(), begin);
            let state = state.map_err(|e| fault = e).ok()?;
            let (hessian, gradient) = self.quadratic(&state);
            Some((Quadratic { value: state.cost, gradient, hessian }, state))
        };
        let stop = Stop {
            evaluations: self.steps + 1,
            fall: SMALL,
            poor: LITTLE * self.readings.rows.len() as f64,
            poor_evaluations: TRIES_OF_LITTLE + 1,
        };
        let found = descend(DVector::from_vec(unknowns), &bounds, evaluate, stop).map(|least| least.state);
        found.ok_or(fault)
    }

    fn explains_little(&self, state: &State) -> bool {
        state.cost > LITTLE * self.readings.rows.len() as f64
    }

    fn quadratic(&self, here: &State) -> (DMatrix<f64>, DVector<f64>) {
        let mut hessian = here.jacobian.tr_mul(&here.jacobian);
        let mut gradient = -here.jacobian.tr_mul(&here.white);
        for (k, x) in here.unknowns.iter().enumerate() {
            let (_, slope, curvature) = prior(k, &self.problem.nuisance.mean, *x);
            hessian[(k, k)] += curvature;
            gradient[k] += slope;
        }
        (hessian, gradient)
    }

    /// Log evidence of a state given that some unknowns stand where they do, and its posterior covariance: what is known has no prior and no width.
    fn given(&self, here: &State, known: &[usize]) -> (f64, DMatrix<f64>) {
        let (mut hessian, _) = self.quadratic(here);
        known.iter().for_each(|&k| hessian[(k, k)] += HELD);
        let (log_determinant, posterior) = match Cholesky::new(hessian) {
            Some(c) => (2.0 * c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>(), c.inverse()),
            None => (f64::INFINITY, DMatrix::identity(here.unknowns.len(), here.unknowns.len())),
        };
        let widths = log_determinant - HELD.ln() * known.len() as f64;
        let priors: f64 = known.iter().map(|&k| prior(k, &self.problem.nuisance.mean, here.unknowns[k]).0).sum();
        (priors - here.cost - 0.5 * (widths + self.mixture.plain().log_determinant()), posterior)
    }

    fn conclude(&self, hypothesis: &[Candidate], here: State, bounds: &[Bounds]) -> Fit {
        let (mut log_evidence, posterior) = self.given(&here, self.held);
        let is_sought = |k: &usize| !self.held.contains(k);
        for k in (self.problem.nuisances()..here.unknowns.len()).filter(is_sought) {
            log_evidence += log_share(bounds[k], here.unknowns[k], posterior[(k, k)].sqrt().max(1e-9));
        }
        if let Some(k) = whole(hypothesis, self.problem.nuisances()).filter(is_sought) {
            let (x, sd) = (here.unknowns[k], posterior[(k, k)].sqrt().max(1e-9));
            let alone = || self.given(&here, &[self.held, &[k]].concat()).0;
            let is_at_whole = x >= bounds[k].high - AT_BOUND;
            log_evidence =
                if is_at_whole { shared(log_evidence, alone()) } else { or_whole(log_evidence, bounds[k], (x, sd)) };
        }
        let means = self.problem.means(here.unknowns.len());
        Fit {
            hypothesis: hypothesis.to_vec(),
            misfit: 2.0 * here.weighed.cost,
            outliers: here.weighed.outliers,
            unknowns: here.unknowns,
            linear: here.linear,
            residual: here.residual,
            means,
            log_evidence,
            posterior,
        }
    }
}

/// Share of the prior of a loss that stands at the whole [-]. Declared: a cut and most injuries take all, a disease takes part. So "torn" is a hypothesis of
/// its own, not the end of "weakened".
const TORN: f64 = 0.5;
/// Curvature of an unknown that is known to stand where it does [1, whitened]: no reading moves it.
const HELD: f64 = 1e12;
/// How near to its bound a size is at it, in units of its prior [-]: more than rounding takes.
const AT_BOUND: f64 = 1e-6;

/// The first unknown of a hypothesis that may be whole.
fn whole(hypothesis: &[Candidate], nuisances: usize) -> Option<usize> {
    let parameters = hypothesis.iter().flat_map(|c| &c.effect.parameter);
    parameters.zip(nuisances..).find(|(p, _)| p.whole.is_some()).map(|(_, k)| k)
}

/// Share of belief that an effect takes the whole, against a part of it, where it stands at a value with a standard deviation [-]; none of what is
/// never whole. The data's density at the whole over that of a part is the posterior's density there over the prior's (Savage and Dickey's ratio
/// [dickey1971]).
pub(crate) fn share_at_whole((value, sd): (f64, f64), of: &Parameter) -> Option<f64> {
    let (x, s, at) = (value / of.sd, (sd / of.sd).max(1e-9), of.whole? / of.sd);
    let within = Bounds { low: if of.one_sided { 0.0 } else { -REACH }, high: at };
    let log_odds = nearer_whole(within, (x, s)) + (TORN / (1.0 - TORN)).ln();
    Some(1.0 / (1.0 + (-log_odds).exp()))
}

/// Log of the data's density at the whole, the end of the bounds, over that of a part, where a size stands at `x` with a standard deviation `sd`, in units
/// of its prior: the posterior's density there over the prior's, each over what lies within the bounds.
fn nearer_whole(within: Bounds, (x, sd): (f64, f64)) -> f64 {
    let at = within.high;
    prior(0, &[], at).0 - sd.ln() - 0.5 * ((at - x) / sd).powi(2) - log_share(within, x, sd)
}

/// Log evidence of an effect that may be whole where a fit ends at a part of it: the whole counts by what its density makes of that of the `part`.
fn or_whole(part: f64, within: Bounds, size: (f64, f64)) -> f64 {
    shared(part, part + nearer_whole(within, size))
}

/// Log evidence of an effect of which the share [`TORN`] of the prior stands at the whole.
fn shared(part: f64, whole: f64) -> f64 {
    let (part, whole) = (part + (1.0 - TORN).ln(), whole + TORN.ln());
    let most = part.max(whole);
    most + ((part - most).exp() + (whole - most).exp()).ln()
}

impl Fit {
    /// Whether more than twice of what noise leaves is left.
    pub fn explains_little(&self) -> bool {
        0.5 * self.misfit > LITTLE * self.residual.len() as f64
    }

    /// The unknowns from the means of their priors.
    pub fn from_means(&self) -> DVector<f64> {
        DVector::from_iterator(self.unknowns.len(), self.unknowns.iter().zip(&self.means).map(|(x, m)| x - m))
    }

    /// The rests, to begin from.
    pub fn coordinates(&self) -> Vec<Start> {
        starts_of(&self.linear.rests)
    }

    /// Log Bayes factor of the last `count` unknowns against zero by their own distribution alone (Savage and Dickey's ratio [dickey1971]): what is
    /// claimed for an effect whose size is nearly nothing is owed to another valley of the ligaments, not to it.
    pub fn own_evidence(&self, count: usize) -> f64 {
        self.own_evidence_of(self.unknowns.len() - count, count)
    }

    /// The same of `count` unknowns from `first` on.
    pub fn own_evidence_of(&self, first: usize, count: usize) -> f64 {
        let block = self.posterior.view((first, first), (count, count)).into_owned();
        let size = DVector::from_column_slice(&self.unknowns[first..first + count]);
        match Cholesky::new(block) {
            Some(c) => 0.5 * size.dot(&c.solve(&size)) + c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>(),
            None => 0.0,
        }
    }

    /// The fit with no more evidence beyond `without` than its last `count` unknowns can have earned. An effect that takes most of a whole (a torn
    /// structure) has a size, and more or less of it is no normal distribution: that is left to the fits of nothing missing from its ligaments.
    pub fn earned(mut self, without: f64, count: usize) -> Fit {
        let own = self.own_evidence(count);
        if own < DOUBTFUL && !self.has_most_of_a_whole() {
            self.log_evidence = self.log_evidence.min(without + own.max(0.0) + SLACK);
        }
        self
    }

    /// Whether an effect of the hypothesis takes more than half of what can be taken.
    pub fn has_most_of_a_whole(&self) -> bool {
        let sizes: usize = self.hypothesis.iter().map(Candidate::size).sum();
        let values = &self.unknowns[self.unknowns.len() - sizes..];
        sized(&self.hypothesis, values).any(|(c, of)| {
            let of_whole = |(p, x): (&Parameter, &f64)| p.whole.is_some_and(|whole| p.sd * x > 0.5 * whole);
            c.effect.parameter.iter().zip(of).any(of_whole)
        })
    }

    /// The posterior covariance if the data spoke `temper` times less loud: as loud as they speak where names are weighed.
    pub fn tempered(&self, nuisances: usize, temper: f64) -> DMatrix<f64> {
        let inverse = Cholesky::new(self.posterior.clone()).map(|c| c.inverse());
        let Some(mut curvature) = inverse else { return self.posterior.clone() };
        curvature /= temper;
        for (k, x) in self.unknowns.iter().enumerate() {
            curvature[(k, k)] += prior(k, &self.means[..nuisances], *x).2 * (1.0 - 1.0 / temper);
        }
        Cholesky::new(curvature).map_or_else(|| self.posterior.clone(), |c| c.inverse())
    }

    /// Value and standard deviation of the hypothesis' parameters in the catalogue's units, an effect a list. The standard deviation holds what the
    /// data leave open, spoken `temper` times less loud, and the effect's share for a form that is not the knee's own.
    pub fn parameters(&self, nuisances: usize, temper: f64) -> Vec<Vec<(f64, f64)>> {
        let posterior = self.tempered(nuisances, temper);
        let mut at = nuisances;
        self.hypothesis
            .iter()
            .map(|c| {
                c.effect
                    .parameter
                    .iter()
                    .map(|p| {
                        at += 1;
                        let value = p.sd * self.unknowns[at - 1];
                        let open = p.sd * posterior[(at - 1, at - 1)].sqrt();
                        (value, open.hypot(c.effect.form_share * value))
                    })
                    .collect()
            })
            .collect()
    }
}

/// The standard normal distribution function [abramowitz1964, 7.1.26].
pub fn normal_below(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let poly =
        ((((1.061_405_429 * t - 1.453_152_027) * t + 1.421_413_741) * t - 0.284_496_736) * t + 0.254_829_592) * t;
    let erf = 1.0 - poly * (-z * z).exp();
    (if x >= 0.0 { 0.5 * (1.0 + erf) } else { 0.5 * (1.0 - erf) }).max(1e-300)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tear_shares_the_prior_with_part_losses_and_is_worth_what_it_explains() {
        // what only a part explains, what only a tear does, what both do
        assert!((shared(10.0, f64::NEG_INFINITY) - (10.0 + (1.0 - TORN).ln())).abs() < 1e-12);
        assert!((shared(-1e9, 10.0) - (10.0 + TORN.ln())).abs() < 1e-12);
        assert!((shared(7.0, 7.0) - 7.0).abs() < 1e-12);
    }

    /// Data normal about a size with a standard deviation, in units of the prior, and where a fit of them ends.
    const MADE: [(f64, f64); 7] = [(2.0, 0.1), (2.0, 0.4), (1.8, 0.1), (1.8, 0.4), (1.5, 0.2), (1.0, 0.4), (0.5, 0.2)];

    fn loss() -> Parameter {
        let effects = crate::effect::catalogue::Catalogue::shipped().effect;
        effects.into_iter().find(|e| e.id == "structure_loss").unwrap().parameter.remove(0)
    }

    /// Densities of made data, by sums: at the whole, and the mean over the prior of a part.
    fn by_sums(whole: f64, (middle, sd): (f64, f64)) -> [f64; 2] {
        let data = |x: f64| (-0.5 * ((x - middle) / sd).powi(2)).exp();
        let at = |i: i32| whole * (f64::from(i) + 0.5) / 4000.0;
        let believed = |x: f64| (-prior(0, &[], x).0).exp();
        let (part, all) = (0..4000).map(at).fold((0.0, 0.0), |s, x| (s.0 + data(x) * believed(x), s.1 + believed(x)));
        [data(whole), part / all]
    }

    /// Where a fit of made data ends, with its standard deviation.
    fn end((middle, sd): (f64, f64)) -> (f64, f64) {
        let x = (0..50).fold(middle, |x, _| {
            let (_, slope, curvature) = prior(0, &[], x);
            x - ((x - middle) / sd.powi(2) + slope) / (sd.powi(-2) + curvature)
        });
        (x, (sd.powi(-2) + prior(0, &[], x).2).powf(-0.5))
    }

    #[test]
    fn the_share_of_a_tear_is_what_the_density_of_the_data_makes_it() {
        let of = &loss();
        let whole = of.whole.unwrap() / of.sd;
        for made in MADE {
            let [torn, part] = by_sums(whole, made);
            let (x, own) = end(made);
            let told = share_at_whole((of.sd * x, of.sd * own), of).unwrap();
            assert!((told - torn / (torn + part)).abs() < 0.05, "{made:?}: {told} of {torn} {part}");
        }
        let whole_less = Parameter { whole: None, ..of.clone() };
        assert_eq!(share_at_whole((1.0, 0.1), &whole_less), None);
    }

    #[test]
    fn a_fit_that_ends_at_a_part_has_the_evidence_of_a_tear_too() {
        let of = &loss();
        let whole = of.whole.unwrap() / of.sd;
        let within = Bounds { low: 0.0, high: whole };
        for made in MADE {
            let [torn, part] = by_sums(whole, made);
            let size = end(made);
            let (told, all) = (or_whole(part.ln(), within, size), (TORN * torn + (1.0 - TORN) * part).ln());
            assert!((told - all).abs() < 0.1, "{made:?}: {told} {all}");
            // what a part explains by itself is never lost but for its share of the prior
            assert!(told >= part.ln() + (1.0 - TORN).ln() - 1e-12, "{made:?}");
        }
        // where it stands makes no step at the end of the bounds: next to the whole it counts as much
        let at = |x: f64| or_whole(0.0, within, (x, 0.3));
        assert!((at(whole) - at(whole - 1e-5)).abs() < 1e-3);
    }

    #[test]
    fn what_may_be_whole_has_a_point_of_its_own_wherever_it_stands() {
        let of = |id: &str| {
            let effect =
                crate::effect::catalogue::Catalogue::shipped().effect.into_iter().find(|e| e.id == id).unwrap();
            Candidate { effect, variant: 0, scope: crate::effect::candidate::Scope::Both }
        };
        assert_eq!(whole(&[of("structure_loss")], 5), Some(5));
        assert_eq!(whole(&[of("load_gain")], 5), None);
        assert_eq!(whole(&[of("load_gain"), of("structure_loss")], 5), Some(6));
        assert_eq!(whole(&[], 5), None);
    }
}

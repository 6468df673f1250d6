//! The search for what is missing: baseline, screen, joint refits, one effect after another.

pub mod contradiction;
pub mod curves;
pub mod exchange;
pub mod held_out;
mod joined;
mod kin;
pub mod map;
mod met;
mod pairs;
mod refit;
pub mod regret;
mod steps;
mod tried;
mod unseen;
mod wide;

use crate::criteria::{LEAST_BESIDE, LEAST_EVIDENCE, LEAST_FURTHER, NULLS_BELOW};
use crate::effect::candidate::{Candidate, Scope, sized};
use crate::error::DiagnosisError;
use crate::fit::screen::{Marginal, Score, signatures};
use crate::fit::{Data, Fit};
use crate::problem::Problem;
use crate::problem::covariance::{Floor, Readings, covariance, normal, remainders};
use crate::problem::outlier::Mixture;
use crate::problem::trial::at_row;
use met::Met;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim::coordinate::FREE;
use sim::equilibrium::{self, starts_of};
use steps::{Found, Given, HOPELESS};

/// How a diagnosis is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiagnosisOptions {
    /// Whether a build diagnoses without being asked for that stage.
    pub run: bool,
    /// The declared scatter.
    pub floor: Floor,
    /// Most effects that act together [-].
    pub most_effects: usize,
    /// Candidates that are refitted at each step [-].
    pub shortlist: usize,
    /// Simulated nulls behind the threshold [-].
    pub nulls: usize,
    /// Least log Bayes factor of a named effect, whatever the nulls say [-].
    pub least_evidence: f64,
    /// Least gain of log evidence by a further effect beside others that leave too much, and no less than what their form may leave of theirs [-]: there a
    /// little more is a patch.
    pub least_further: f64,
    /// The same beside others that leave no more than they should [-].
    pub least_beside: f64,
    /// Draws of the prior behind the scatter of what is not linear [-].
    pub draws: usize,
    /// Seed of the simulated nulls, and of the calibration from which the diagnosis of a built knee starts.
    pub seed: u64,
    /// Ligaments held at the model's own (for comparison only).
    pub frozen_ligaments: bool,
    /// Whether an answer outside the catalogue is allowed.
    pub wildcard: bool,
    /// Whether rivals are ranked by the error that they leave, in noises, instead of by evidence (for comparison only).
    pub by_error: bool,
    /// Folds of the held-out score [-].
    pub folds: usize,
}

impl Default for DiagnosisOptions {
    fn default() -> Self {
        DiagnosisOptions {
            run: false,
            floor: Floor::default(),
            most_effects: 3,
            shortlist: 9,
            nulls: 400,
            least_evidence: LEAST_EVIDENCE,
            least_further: LEAST_FURTHER,
            least_beside: LEAST_BESIDE,
            draws: 8,
            seed: 1,
            frozen_ligaments: false,
            wildcard: true,
            by_error: false,
            folds: 4,
        }
    }
}

/// Most evaluations of a fit: enough that it ends by itself; a screen's first guess may stop at fewer, held-out folds start next to where they end.
pub const TRIES: usize = 20;
/// Of a first guess.
pub(crate) const FEW: usize = 12;
/// Standard deviation of effects in screens, in units of the catalogue's: their priors have heavy tails.
pub(crate) const WIDTH: f64 = 2.0;

/// What the search found.
#[derive(Clone, Debug)]
pub struct Search {
    /// Readings fitted.
    pub readings: Readings,
    /// Their scatter, five a trial, at the best hypothesis.
    pub covariance: DMatrix<f64>,
    /// Readings of the model as given, five a trial [deg, mm].
    pub given: Vec<f64>,
    /// Nothing missing.
    pub base: Fit,
    /// Hypotheses refitted, best first by evidence and prior.
    pub rivals: Vec<Fit>,
    /// Least gain of log evidence for an effect: what 95 % of simulated nulls stay below.
    pub threshold: f64,
    /// The screen at the baseline: candidate and log Bayes factor, best first.
    pub screened: Vec<(Candidate, f64)>,
    /// Where it started.
    start: Start,
    /// Every single effect that was refitted on the way, whatever became of it.
    met: Met,
}

/// A candidate in a screen, or two that act together: the log Bayes factor, places in the list of candidates, sizes, and where the ligaments would go beside
/// them.
struct Screened {
    gain: f64,
    candidates: Vec<usize>,
    size: DVector<f64>,
    beside: DVector<f64>,
}

/// Where a search starts.
#[derive(Clone, Debug)]
pub(crate) struct Start {
    /// The model as given.
    zero: Fit,
    /// The same, linear about the measured poses.
    held: Fit,
    /// With its ligaments fitted.
    pub(crate) base: Fit,
    /// Scatter of what is not linear.
    extra: DMatrix<f64>,
    /// All scatter, at the model as given.
    pub(crate) cov: DMatrix<f64>,
}

/// Log prior of a candidate among those of its effect: tissues are rarely in one data set only, variants share.
pub fn log_prior(candidate: &Candidate, sources: usize) -> f64 {
    let variants = -(candidate.effect.variants.len().max(1) as f64).ln();
    if sources < 2 {
        return variants;
    }
    let shared = match candidate.effect.family {
        'T' => 0.9,
        'H' => 0.6,
        _ => 0.4,
    };
    let part = if candidate.scope == Scope::Both { shared } else { (1.0 - shared) / sources as f64 };
    variants + f64::ln(part)
}

/// Whether a fit has a candidate's effect in its scope already, in whatever variant.
fn is_in(fit: &Fit, candidate: &Candidate) -> bool {
    fit.hypothesis.iter().any(|h| h.effect.id == candidate.effect.id && h.scope == candidate.scope)
}

/// Log evidence with the prior of its effects.
pub fn weighed(fit: &Fit, sources: usize) -> f64 {
    fit.log_evidence + fit.hypothesis.iter().map(|c| log_prior(c, sources)).sum::<f64>()
}

/// A problem with the options of its diagnosis.
#[derive(Clone, Copy)]
pub struct Searcher<'a> {
    /// The question.
    pub problem: &'a Problem,
    /// How.
    pub options: &'a DiagnosisOptions,
}

impl Searcher<'_> {
    /// Runs the search.
    ///
    /// Errors: a model that cannot be evaluated, data without information.
    pub fn search(&self) -> Result<Search, DiagnosisError> {
        let readings = Readings::of(self.problem, &|_| true);
        let start = self.baseline(&readings)?;
        let candidates = self.problem.candidates();
        let (list, threshold) = self.screen(&start.base, &readings, &start.cov, &candidates)?;
        let screened: Vec<(Candidate, f64)> =
            list.iter().map(|l| (candidates[l.candidates[0]].clone(), l.gain)).collect();
        let given = Given { readings: &readings, candidates: &candidates, extra: &start.extra, threshold };
        let found = self.singles(&start, given, &list)?;
        let Found { base, rivals, cov, met } = self.grown(&start, found, given)?;
        let given = start.zero.linear.value.clone();
        Ok(Search { readings, covariance: cov, given, base, rivals, threshold, screened, start, met })
    }

    /// The best single effects with what acts beside them, weighed.
    fn grown(&self, start: &Start, mut found: Found, given: Given) -> Result<Found, DiagnosisError> {
        for _ in 1..self.options.most_effects {
            let more;
            (found, more) = self.another(start, found, given)?;
            if !more {
                break;
            }
            found = self.exchange(found, given)?;
        }
        let Found { base, rivals, .. } = &mut found;
        let is_hopeful = |best: &Fit| self.gain(best, base) >= given.threshold && self.leaves(best) < HOPELESS[1];
        if rivals.first().is_some_and(is_hopeful) {
            self.weigh_in_own_scatter(rivals, given.readings, given.extra)?;
        }
        Ok(found)
    }

    fn log(&self, fit: &Fit) -> f64 {
        if self.options.by_error {
            let noises = self
                .problem
                .trials
                .iter()
                .flat_map(|t| FREE.into_iter().filter(|c| t.record.measured[*c].is_some()).map(|c| t.sd[c]));
            return -0.5 * fit.residual.iter().zip(noises).map(|(r, sd)| (r / sd).powi(2)).sum::<f64>();
        }
        weighed(fit, self.problem.asked().len())
    }

    /// Whether a fit leaves more than noise and floor do, by one standard deviation of their sum of squares.
    pub fn is_poor(&self, fit: &Fit) -> bool {
        let n = fit.residual.len() as f64;
        self.total(fit) > n + (2.0 * n).sqrt()
    }

    /// Misfit and cost of the ligaments: about the number of readings when the hypothesis is true.
    pub fn total(&self, fit: &Fit) -> f64 {
        fit.misfit + self.problem.nuisance.squares(&fit.unknowns)
    }

    /// The same over the number of readings.
    fn leaves(&self, fit: &Fit) -> f64 {
        self.total(fit) / fit.residual.len() as f64
    }

    /// Gain of evidence over nothing missing.
    pub fn gain(&self, fit: &Fit, base: &Fit) -> f64 {
        self.log(fit) - self.log(base)
    }

    fn sort(&self, fits: &mut Vec<Fit>) {
        fits.sort_by(|a, b| self.log(b).total_cmp(&self.log(a)));
        let mut seen: Vec<Vec<(String, usize, Scope)>> = Vec::new();
        fits.retain(|f| {
            let mut key: Vec<_> = f.hypothesis.iter().map(|c| (c.effect.id.clone(), c.variant, c.scope)).collect();
            key.sort();
            let new = !seen.contains(&key);
            seen.push(key);
            new
        });
    }

    /// Where a search starts: the model as given and with its nuisance parameters fitted, nothing missing.
    ///
    /// Errors: a model that cannot be evaluated.
    pub(crate) fn start(&self) -> Result<Start, DiagnosisError> {
        self.baseline(&Readings::of(self.problem, &|_| true))
    }

    /// Nothing missing: the model as given, and with its ligaments fitted.
    fn baseline(&self, readings: &Readings) -> Result<Start, DiagnosisError> {
        let x = vec![0.0; self.problem.nuisances()];
        let linear = self.problem.linear_at(&[], &x, self.problem.nearer(&[], &x, &[])?)?;
        let lost = linear.rests.iter().filter(|r| !r.balanced).count();
        if lost as f64 > crate::problem::UNBALANCED * linear.rests.len() as f64 {
            return Err(DiagnosisError::Model(format!(
                "{lost} of {} trials find no equilibrium; simulate them first and look at the flags",
                linear.rests.len()
            )));
        }
        let starts = starts_of(&linear.rests);
        let extra = remainders(self.problem, &starts, self.options.draws, &self.options.floor)?
            * self.options.floor.nonlinear.powi(2);
        let cov = covariance(self.problem, &[], &x, &linear.rests, &self.options.floor)? + &extra;
        let base = self.fit(&[], &x, &starts, &cov, readings, TRIES)?;
        let zero = Fit {
            hypothesis: vec![],
            residual: &readings.measured - readings.pick(&linear.value),
            misfit: 0.0,
            outliers: vec![],
            log_evidence: 0.0,
            posterior: DMatrix::identity(x.len(), x.len()),
            means: self.problem.means(x.len()),
            unknowns: x,
            linear,
        };
        let linear = self.problem.linear_held()?;
        let held = Fit { residual: &readings.measured - readings.pick(&linear.value), linear, ..zero.clone() };
        Ok(Start { zero, held, base, extra, cov })
    }

    fn scatter(&self, at: &Fit, extra: &DMatrix<f64>) -> Result<DMatrix<f64>, DiagnosisError> {
        let floor = &self.options.floor;
        Ok(covariance(self.problem, &at.hypothesis, &at.unknowns, &at.linear.rests, floor)? + extra)
    }

    /// Fits a hypothesis to some readings.
    ///
    /// Errors: a model that cannot be evaluated.
    #[expect(clippy::too_many_arguments, reason = "a hypothesis, where from, to what, how far")]
    pub fn fit(
        &self,
        hypothesis: &[Candidate],
        start: &[f64],
        starts: &[equilibrium::Start],
        cov: &DMatrix<f64>,
        readings: &Readings,
        steps: usize,
    ) -> Result<Fit, DiagnosisError> {
        let mixture = Mixture::new(readings, readings.block_of(cov), &self.problem.trials)?;
        self.fit_to(hypothesis, start, starts, (readings, &mixture), steps)
    }

    fn fit_to(
        &self,
        hypothesis: &[Candidate],
        start: &[f64],
        starts: &[equilibrium::Start],
        (readings, mixture): (&Readings, &Mixture),
        steps: usize,
    ) -> Result<Fit, DiagnosisError> {
        let held: Vec<usize> = (0..if self.options.frozen_ligaments { self.problem.nuisances() } else { 0 }).collect();
        Data { problem: self.problem, readings, mixture, steps, held: &held }.fit(hypothesis, start, starts)
    }

    /// Fits a hypothesis to all that a search was fitted to, some unknowns held where `start` has them.
    pub(crate) fn fit_holding(
        &self,
        (hypothesis, held): (&[Candidate], &[usize]),
        (start, starts): (&[f64], &[equilibrium::Start]),
        search: &Search,
    ) -> Result<Fit, DiagnosisError> {
        let mixture =
            Mixture::new(&search.readings, search.readings.block_of(&search.covariance), &self.problem.trials)?;
        let (problem, readings) = (self.problem, &search.readings);
        Data { problem, readings, mixture: &mixture, steps: TRIES, held }.fit(hypothesis, start, starts)
    }

    /// Log Bayes factor and estimate of every candidate beside what a fit has already, best first; and the threshold by simulated nulls.
    fn screen(
        &self,
        at: &Fit,
        readings: &Readings,
        cov: &DMatrix<f64>,
        candidates: &[Candidate],
    ) -> Result<(Vec<Screened>, f64), DiagnosisError> {
        let signatures = signatures(self.problem, at, candidates)?;
        let marginal = Marginal::new(at, readings, cov)?;
        let scores = self.scores(at, (readings, &marginal), candidates, &signatures);
        // noise alone never makes an effect that is large or nothing
        let large: Vec<&(usize, Score, f64)> =
            scores.iter().filter(|s| candidates[s.0].is_large_enough(&[0.0; 8])).collect();
        let mut random = ChaCha8Rng::seed_from_u64(self.options.seed);
        let nulls: Vec<DVector<f64>> = (0..self.options.nulls)
            .map(|_| DVector::from_fn(readings.rows.len(), |_, _| normal(&mut random)))
            .collect();
        let mut largest: Vec<f64> = nulls
            .par_iter()
            .map(|d| large.iter().map(|(_, s, p)| s.log_bayes_factor(d) + p).fold(f64::NEG_INFINITY, f64::max))
            .collect();
        largest.sort_by(f64::total_cmp);
        let place = (largest.len() as f64 * NULLS_BELOW) as usize;
        let threshold = largest.get(place).copied().unwrap_or(0.0).max(self.options.least_evidence);
        let mut list: Vec<Screened> = scores
            .iter()
            .map(|(k, s, p)| {
                let size = s.estimate(&marginal.white);
                let beside = marginal.beside(at, readings, &signatures[*k], &size);
                Screened { gain: s.log_bayes_factor(&marginal.white) + p, candidates: vec![*k], size, beside }
            })
            .collect();
        list.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Ok((list, threshold))
    }

    /// Candidates that a fit has not and that are felt, each with its score and its log prior.
    fn scores(
        &self,
        at: &Fit,
        (readings, marginal): (&Readings, &Marginal),
        candidates: &[Candidate],
        signatures: &[DMatrix<f64>],
    ) -> Vec<(usize, Score, f64)> {
        let sources = self.problem.asked().len();
        let open = candidates.iter().enumerate().filter(|(k, c)| !is_in(at, c) && self.is_felt(c, &signatures[*k]));
        let score = |k: usize| Score::new(&signatures[k], readings, marginal, WIDTH);
        open.filter_map(|(k, c)| Some((k, score(k)?, log_prior(c, sources)))).collect()
    }

    /// Whether every effect of a fit is as large as its name asks, and no larger than it allows.
    fn deserves_its_names(&self, fit: &Fit) -> bool {
        let values = &fit.unknowns[self.problem.nuisances()..];
        sized(&fit.hypothesis, values).all(|(c, of)| c.is_large_enough(of) && c.is_small_enough(of))
    }

    /// Whether a candidate of all data sets is felt in each: else it says no more than one of fewer. Anatomy is in all, felt or not.
    fn is_felt(&self, candidate: &Candidate, signature: &DMatrix<f64>) -> bool {
        let trials = &self.problem.trials;
        let felt = |source: usize| {
            (0..signature.nrows())
                .any(|r| trials[at_row(r).0].source == Some(source) && signature.row(r).iter().any(|v| *v != 0.0))
        };
        candidate.effect.one_knee || candidate.scope != Scope::Both || self.problem.asked().into_iter().all(felt)
    }
}

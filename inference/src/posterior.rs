//! The posterior: modes by least squares from many starts, their evidence, samples.
//!
//! Samples by randomised maximum likelihood [oliver1996]: each is the fit to measurements and beliefs shifted by their noise, under a prior whose centre
//! is drawn from the prior ([`crate::shift`]). For a linear model these are exact; here a parameter that the data do not touch stays where the prior drew it. A fit may start from the
//! sample's own draw ([`Forward::starts_anew`]): so samples reach modes that no start has found, of two bundles either one taut.

use crate::error::InferenceError;
use crate::least_squares::{Least, Quadratic, Stop, descend};
use crate::linear::{Linear, Shift};
use crate::noise::Likelihood;
use crate::random::{normals, stream};
use crate::shift::drawn;
use crate::weights::log_weight;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What a model answers at a point of the standard normal numbers.
#[derive(Clone, Debug)]
pub struct Point<S> {
    /// Predictions of what was measured.
    pub reading: DVector<f64>,
    /// Their derivatives: a row a reading, a column a number.
    pub jacobian: DMatrix<f64>,
    /// Residuals of beliefs that are no parameters' (forces, say), of unit variance, on whatever side.
    pub belief: DVector<f64>,
    /// Their derivatives.
    pub belief_jacobian: DMatrix<f64>,
    /// Whether a belief counts where its residual is above zero alone.
    pub one_side: Vec<bool>,
    /// What the next point close by starts from, and what else is wanted of this one.
    pub state: S,
}

impl<S: Default> Default for Point<S> {
    fn default() -> Self {
        Point {
            reading: DVector::zeros(0),
            jacobian: DMatrix::zeros(0, 0),
            belief: DVector::zeros(0),
            belief_jacobian: DMatrix::zeros(0, 0),
            one_side: Vec::new(),
            state: S::default(),
        }
    }
}

/// A model as a function of standard normal numbers.
pub trait Forward: Sync {
    /// What a point leaves for points close by.
    type State: Clone + Send + Sync;
    /// How many numbers.
    fn size(&self) -> usize;
    /// The answer at a point, from another close by where there is one; `None` where it has none.
    fn at(&self, z: &DVector<f64>, near: Option<(&DVector<f64>, &Self::State)>) -> Option<Point<Self::State>>;
    /// Told of every start, every fit of a round and every sample that has ended, on whatever thread; [`PosteriorOptions::fits`] says how many to expect. A sample
    /// that is tried again is told once.
    fn fitted(&self) {}
    /// Whether a sample's fit starts from its own draw of a number, not from a mode's.
    fn starts_anew(&self, _number: usize) -> bool {
        false
    }
    /// Covariance that readings share about a point, beside their noise.
    fn scatter(&self, _state: &Self::State) -> Option<DMatrix<f64>> {
        None
    }
}

/// How the posterior is sought.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PosteriorOptions {
    /// Starts drawn from the prior, beside those given [-]; ours.
    pub starts: usize,
    /// Most evaluations of each start [-]; ours.
    pub first_evaluations: usize,
    /// Starts fitted to the end, the best so far [-]; ours.
    pub finalists: usize,
    /// Most evaluations of a fit to the end [-]; ours.
    pub evaluations: usize,
    /// Times that the noise is inferred and the fits are done again [-]; ours.
    pub rounds: usize,
    /// Whether the scale of the noise is inferred.
    pub scale_noise: bool,
    /// Samples of the posterior [-]; 0 leaves them out.
    pub samples: usize,
    /// Most evaluations of a sample [-]; ours.
    pub sample_evaluations: usize,
    /// Seed of whatever is drawn; no option of its own in a file, a calibration has one seed.
    #[serde(skip)]
    pub seed: u64,
}

impl Default for PosteriorOptions {
    fn default() -> Self {
        PosteriorOptions {
            starts: 8,
            first_evaluations: 8,
            finalists: 3,
            evaluations: 20,
            rounds: 2,
            scale_noise: true,
            samples: 48,
            sample_evaluations: 14,
            seed: 0,
        }
    }
}

impl PosteriorOptions {
    /// How many fits [`infer`] tells of from `given` starts: every start, the best of them anew in each round, samples. Fewer where one has no answer.
    pub fn fits(&self, given: usize) -> usize {
        let starts = given + 1 + self.starts;
        starts + (self.rounds + 1) * self.finalists.min(starts) + self.samples
    }
}

/// A most probable point among its neighbours.
#[derive(Clone, Debug)]
pub struct Mode<S> {
    /// Where.
    pub z: DVector<f64>,
    /// Log probability there and its curvature.
    pub form: Quadratic,
    /// What the point left.
    pub state: S,
    /// Laplace's logarithm of the evidence [tierney1986], up to what all modes share.
    pub log_evidence: f64,
}

/// A sample.
#[derive(Clone, Debug)]
pub struct Sample<S> {
    /// Where.
    pub z: DVector<f64>,
    /// What the point left.
    pub state: S,
    /// Which mode it began from.
    pub mode: usize,
    /// Half the squared residuals there [-].
    pub half_sum: f64,
    /// Logarithm of its weight, up to what all samples share [-]: 0 in a linear model ([`crate::weights`]).
    pub log_weight: Option<f64>,
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Found<S> {
    /// Modes, the most probable first.
    pub modes: Vec<Mode<S>>,
    /// Samples.
    pub samples: Vec<Sample<S>>,
    /// How many samples were wanted but ended far from a fit.
    pub stuck: usize,
    /// Half the squared residuals of every fit of a start, in their order; infinite where it has no answer.
    pub starts: Vec<f64>,
    /// Evaluations spent.
    pub evaluations: usize,
}

/// Fall of the log probability at which a fit has converged [-].
const FALL: f64 = 0.02;
/// The same of a sample [-].
const SAMPLE_FALL: f64 = 0.5;
/// Streams of the samples' scales of noise.
const SCALES: u64 = 400_000;
/// Modes less likely than the best by this much (natural logarithm) are not sampled.
const UNLIKELY: f64 = 6.0;
/// Modes no further apart than this in any number are one [-].
const SAME: f64 = 0.3;

/// Of this many samples one is kept, the best, whatever they leave [-].
const LEAST_KEPT: usize = 4;

/// Infers; `likelihood` is left with the noise as inferred.
///
/// # Errors
/// No start has an answer; a covariance that is not positive definite.
pub fn infer<F: Forward>(
    forward: &F,
    likelihood: &mut Likelihood,
    given: &[DVector<f64>],
    options: &PosteriorOptions,
) -> Result<Found<F::State>, InferenceError> {
    likelihood.prepare()?;
    if !options.scale_noise {
        likelihood.log_scale_sd.fill(0.0);
    }
    let n = forward.size();
    let mut starts: Vec<DVector<f64>> = given.to_vec();
    starts.push(DVector::zeros(n));
    starts.extend((0..options.starts).map(|s| normals(&mut stream(options.seed, 1 + s as u64), n)));
    // what readings share does not depend much on where: better from the start than not at all
    if let Some(shared) = starts.iter().find_map(|z| forward.scatter(&forward.at(z, None)?.state)) {
        likelihood.share(shared);
        likelihood.prepare()?;
    }
    let stop = Stop::after(options.first_evaluations, FALL);
    let fits: Vec<Option<Least<F::State>>> =
        starts.par_iter().map(|z| told_fit(forward, likelihood, (z, z, None), stop)).collect();
    let mut evaluations: usize = fits.iter().flatten().map(|f| f.evaluations).sum();
    let values = fits.iter().map(|f| f.as_ref().map_or(f64::INFINITY, |f| f.form.value)).collect();
    let mut fits: Vec<Least<F::State>> = fits.into_iter().flatten().collect();
    if fits.is_empty() {
        return Err(InferenceError::NoStart { starts: starts.len() });
    }
    let stop = Stop::after(options.evaluations, FALL);
    for round in 0..=options.rounds {
        fits.sort_by(|a, b| a.form.value.total_cmp(&b.form.value));
        fits.truncate(options.finalists);
        let again = fits.par_iter().map(|f| told_fit(forward, likelihood, (&f.z, &f.z, Some(&f.state)), stop));
        let again: Vec<Option<Least<F::State>>> = again.collect();
        evaluations += again.iter().flatten().map(|f| f.evaluations).sum::<usize>();
        fits = again.into_iter().zip(fits).map(|(new, old)| new.unwrap_or(old)).collect();
        if round < options.rounds {
            fits.sort_by(|a, b| a.form.value.total_cmp(&b.form.value));
            infer_noise(forward, likelihood, &fits[0], options.scale_noise)?;
        }
    }
    let modes = modes(likelihood, fits);
    let line = |m: &Mode<F::State>| forward.at(&m.z, Some((&m.z, &m.state))).map(|p| linear(p, &m.z).0);
    let lines: Vec<Option<Linear>> = modes.par_iter().map(line).collect();
    let drawn = likelihood.measured.len() + lines.iter().flatten().map(|l| l.belief.len()).max().unwrap_or(0);
    let far = limit(&modes[0], drawn);
    let (samples, spent) = samples(forward, likelihood, (&modes, &lines), far, options);
    // an interval of no samples would be of no width: a quarter is kept, however far from a fit
    let mut ended: Vec<f64> = samples.iter().flatten().map(|s| s.half_sum).collect();
    ended.sort_by(f64::total_cmp);
    let least = ended.get((options.samples / LEAST_KEPT).min(ended.len().saturating_sub(1)));
    let limit = far.max(least.copied().unwrap_or(0.0));
    let wanted = samples.len();
    let samples: Vec<Sample<F::State>> = samples.into_iter().flatten().filter(|s| s.half_sum <= limit).collect();
    let stuck = wanted - samples.len();
    Ok(Found { modes, samples, stuck, starts: values, evaluations: evaluations + spent })
}

/// The noise as the best fit so far has it.
fn infer_noise<F: Forward>(
    forward: &F,
    likelihood: &mut Likelihood,
    best: &Least<F::State>,
    scale_noise: bool,
) -> Result<(), InferenceError> {
    let Some(point) = forward.at(&best.z, Some((&best.z, &best.state))) else { return Ok(()) };
    if let Some(shared) = forward.scatter(&point.state) {
        likelihood.share(shared);
    }
    likelihood.infer_scales(&linear(point, &best.z).0, scale_noise)
}

/// A point as the linear model of all that is known about it, and what it left.
fn linear<S>(point: Point<S>, z: &DVector<f64>) -> (Linear, S) {
    // a model without beliefs need not say of how many numbers they are
    let no_beliefs = point.belief.is_empty();
    let linear = Linear {
        reading: point.reading,
        jacobian: point.jacobian,
        belief: point.belief,
        belief_jacobian: if no_beliefs { DMatrix::zeros(0, z.len()) } else { point.belief_jacobian },
        one_side: point.one_side,
        z: z.clone(),
    };
    (linear, point.state)
}

/// What a point of a fit leaves: its state, and the linear model there.
type Left<S> = (S, Linear);

/// A fit from a start, near a state where there is one; it leaves the linear model of where it ended, too.
fn fit<F: Forward>(
    forward: &F,
    likelihood: &Likelihood,
    (start, close, near): (&DVector<f64>, &DVector<f64>, Option<&F::State>),
    shift: &Shift,
    stop: Stop,
) -> Option<Least<Left<F::State>>> {
    let evaluate = |z: &DVector<f64>, last: Option<(&DVector<f64>, &Left<F::State>)>| {
        let from = last.map(|(z, (state, _))| (z, state)).or(near.map(|s| (close, s)));
        // far from what is close by there may be an answer all the same
        let point = forward.at(z, from).or_else(|| if last.is_none() { forward.at(z, None) } else { None })?;
        let (at, state) = linear(point, z);
        let form = likelihood.form(&at, shift);
        form.value.is_finite().then_some((form, (state, at)))
    };
    descend(start.clone(), &[], evaluate, stop)
}

/// The same, and told of.
fn told_fit<F: Forward>(
    forward: &F,
    likelihood: &Likelihood,
    from: (&DVector<f64>, &DVector<f64>, Option<&F::State>),
    stop: Stop,
) -> Option<Least<F::State>> {
    let found = fit(forward, likelihood, from, &Shift::none(forward.size()), stop);
    forward.fitted();
    found.map(|f| Least { z: f.z, form: f.form, state: f.state.0, evaluations: f.evaluations, converged: f.converged })
}

/// Modes of fits, the most probable first, each once.
fn modes<S>(likelihood: &Likelihood, mut fits: Vec<Least<S>>) -> Vec<Mode<S>> {
    fits.sort_by(|a, b| a.form.value.total_cmp(&b.form.value));
    let mut out: Vec<Mode<S>> = Vec::new();
    for f in fits {
        if out.iter().any(|m| (&m.z - &f.z).amax() < SAME) {
            continue;
        }
        let half_log = f.form.factor().map_or(0.0, |c| c.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>());
        let log_evidence = -f.form.value - half_log - likelihood.half_log_determinant();
        out.push(Mode { z: f.z, form: f.form, state: f.state, log_evidence });
    }
    out.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    out
}

/// Half the squared residuals above which a sample has not come near a fit: a sample's exceeds the best fit's by half a sum of as many squared normals as
/// there are readings and beliefs, give or take.
fn limit<S>(best: &Mode<S>, drawn: usize) -> f64 {
    let n = drawn as f64;
    best.form.value + 0.5 * (n + 4.0 * (6.0 * n).sqrt())
}

/// Samples, shared among the modes by their evidence, and the evaluations they took.
fn samples<F: Forward>(
    forward: &F,
    likelihood: &Likelihood,
    (modes, lines): (&[Mode<F::State>], &[Option<Linear>]),
    far: f64,
    options: &PosteriorOptions,
) -> (Vec<Option<Sample<F::State>>>, usize) {
    let best = modes.iter().map(|m| m.log_evidence).fold(f64::NEG_INFINITY, f64::max);
    let weight = |m: &Mode<F::State>| {
        let below = best - m.log_evidence;
        if below < UNLIKELY { (-below).exp() } else { 0.0 }
    };
    let all: f64 = modes.iter().map(weight).sum();
    let mode_of = |place: f64| {
        let mut sum = 0.0;
        let found = modes.iter().position(|m| {
            sum += weight(m) / all;
            sum >= place
        });
        found.unwrap_or(0)
    };
    let stop = Stop::after(options.sample_evaluations, SAMPLE_FALL);
    let drawn: Vec<(Option<Sample<F::State>>, usize)> = (0..options.samples)
        .into_par_iter()
        .map(|s| {
            let mode = mode_of((s as f64 + 0.5) / options.samples as f64);
            let mut random = stream(options.seed, SCALES + s as u64);
            let mut own = likelihood.with_scales_at(&normals(&mut random, likelihood.scale.len()));
            let drawn =
                own.prepare().ok().and(lines[mode].as_ref()).and_then(|at| drawn(&own, at, options.seed, s as u64));
            let Some((shift, line)) = drawn else {
                forward.fitted();
                return (None, 0);
            };
            let near = &modes[mode];
            let own_draws = |from: &DVector<f64>| {
                let of = |k: usize| if forward.starts_anew(k) { shift.centre[k] } else { from[k] };
                DVector::from_fn(from.len(), |k, _| of(k))
            };
            let fit_from = |start: DVector<f64>| fit(forward, &own, (&start, &near.z, Some(&near.state)), &shift, stop);
            // where the linear model has the sample, or, where there is no answer, from the mode
            let first = fit_from(own_draws(&line)).or_else(|| fit_from(own_draws(&near.z)));
            let mut spent = first.as_ref().map_or(1, |f| f.evaluations);
            // a start of its own that ends far from a fit is tried again from where the linear model has the sample
            let again = if first.as_ref().is_some_and(|f| f.form.value <= far) { None } else { fit_from(line) };
            spent += again.as_ref().map_or(0, |f| f.evaluations);
            let found = [first, again].into_iter().flatten().min_by(|a, b| a.form.value.total_cmp(&b.form.value));
            forward.fitted();
            let sample = found.map(|f| {
                let (state, at) = f.state;
                let log_weight = lines[mode].as_ref().and_then(|m| log_weight(&own, (&at, m), &shift));
                Sample { z: f.z, state, mode, half_sum: f.form.value, log_weight }
            });
            (sample, spent)
        })
        .collect();
    let spent = drawn.iter().map(|d| d.1).sum();
    (drawn.into_iter().map(|d| d.0).collect(), spent)
}

#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod weighed;

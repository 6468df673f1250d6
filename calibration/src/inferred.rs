//! The default method: everything that is not known of the knee is inferred at once (crate `inference`), from one data set or several together.

use crate::calibrate::Calibrated;
use crate::cost::{CostFunction, rms};
use crate::design::Design;
use crate::error::CalibrationError;
use crate::knee::Knee;
use crate::last::{LastReadings, last_forces, last_readings, moved};
use crate::next_test::next_tests;
use crate::options::{CalibrateOptions, Method};
use crate::plateau::Staying;
use crate::posterior::{NoiseEstimate, OtherEstimate, ParameterEstimate, RestEstimate, ends, mean, variance};
use crate::rig;
use crate::shared::{SharedPrior, Sort};
use crate::targets::Targets;
use crate::unknown::{Unknown, Unknowns};
use crate::unknowns::{KnownFrames, parameters};
use crate::unmeasured::{self, Unmeasured, share_removed};
use inference::discrepancy::ModelDiscrepancy;
use inference::knee::{Answers, Belief, Quantity, Trials};
use inference::noise::{Likelihood, REPOSITIONING};
use inference::parameter::Parameter;
use inference::posterior::{Found, Sample, infer};
use inference::temper::{Asks, temper};
use inference::trial::{Trial, of_data_sets};
use inference::weights::Weighed;
use nalgebra::{DMatrix, DVector};
use notices::{Kind, Notice};
use rayon::prelude::*;
use sim::coordinate::{AP, Coordinate, FREE, Free, Load};
use sim::laxity::{LaxityTrial, Test};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Scatter of loads: moments [N m], forces [N]. Recorded ones scatter by 0.1 N m and 2 N, as the diagnosis has it (docs/theory/discrepancy.md); friction,
/// which the equilibria leave out, adds 0.03 of some 130 N of contact across it, by a lever of 25 mm for moments.
const LOAD_SD: Load = Load::new(0.14, 0.14, 4.4, 4.4, 2.0);
/// What the model lacks (docs/theory/inference.md), of the size by which two simulators of one knee differ on the bench: 0.3 deg, 1 deg, 0.3 mm, 0.7 mm,
/// 0.2 mm over the compliance of a knee.
pub(crate) const MODEL_DISCREPANCY: ModelDiscrepancy = ModelDiscrepancy {
    sd: Load::new(1.5, 0.25, 8.0, 6.0, 10.0),
    flexion_deg: 25.0,
    load: Load::new(6.0, 3.0, 60.0, 60.0, 60.0),
};
/// Compression in imagined trials [N]; the paper's protocols.
const COMPRESSION_N: f64 = 20.0;
/// Drawer in imagined trials [N]; [andreassen2025, section 2.6.2].
pub const DRAWER_N: f64 = 133.0;
/// Flexions of the drawers [deg].
pub const DRAWERS_DEG: [f64; 3] = [30.0, 60.0, 90.0];
/// Flexions at which tension at rest is told [deg].
pub const REST_DEG: [f64; 4] = [0.0, 30.0, 60.0, 90.0];

/// A knee, what was measured of it, and how it is asked.
pub struct Question<'a> {
    /// The knee.
    pub knee: &'a Knee,
    /// Table 3's variables.
    pub design: &'a Design,
    /// Data sets: name and targets.
    pub sources: &'a [(String, Targets)],
    /// Their cost, all trials together.
    pub cost: &'a CostFunction,
    /// The options.
    pub options: &'a CalibrateOptions,
    /// Frames as the data sets together have them, where this is one of them.
    pub frames: Option<&'a KnownFrames>,
    /// The most probable values of all data sets together, by name, where this is one of them: a start.
    pub joint: Option<&'a BTreeMap<String, f64>>,
    /// Told of every fit that has ended: how many, and of how many.
    pub on_fit: &'a (dyn Fn(usize, usize) + Sync),
}

/// What an inference leaves beside [`Calibrated`].
pub struct Inferred {
    /// The calibration.
    pub found: Calibrated,
    /// The model at the most probable values.
    pub spec: sim::spec::ModelSpec,
    /// Frames as each data set has them.
    pub frames: Vec<KnownFrames>,
}

/// A question as an inference is asked it.
pub struct Posed<'a> {
    /// The model that answers, without friction.
    pub model: sim::Model,
    /// Everything that is not known.
    pub parameters: Vec<Parameter<Quantity>>,
    /// Measured trials, then imagined ones: drawers ([`drawer_names`]), then rests ([`REST_DEG`]), then those from whose poses displacements count.
    pub asked: Vec<Trial>,
    /// How many of them were measured.
    pub measured: usize,
    /// What is believed of forces.
    pub beliefs: Vec<Belief>,
    question: &'a Question<'a>,
}

impl<'a> Posed<'a> {
    /// Poses a question.
    ///
    /// # Errors
    /// A belief about an unknown bundle; a prior that is no distribution.
    pub fn of(question: &'a Question<'a>) -> Result<Posed<'a>, CalibrationError> {
        let names: Vec<String> = question.sources.iter().map(|s| s.0.clone()).collect();
        let (spec, options) = (&question.knee.spec, question.options);
        let mut parameters = parameters(spec, question.design, &names, options, question.frames);
        parameters.extend(rig::parameters(question.sources, &options.rig));
        let model = question.knee.search_model().with_friction(0.0)?;
        let (asked, measured) = trials(question.sources);
        let beliefs = beliefs(question, &model.bundle_names(), &asked, measured)?;
        let posed = Posed { model, parameters, asked, measured, beliefs, question };
        posed.trials(None).check()?;
        Ok(posed)
    }

    /// The forward model; `on_fit` is told of fits.
    pub fn trials<'b>(&'b self, on_fit: Option<&'b (dyn Fn() + Sync)>) -> Trials<'b> {
        Trials {
            model: &self.model,
            spec: &self.question.knee.spec,
            parameters: &self.parameters,
            trials: &self.asked,
            beliefs: &self.beliefs,
            options: self.question.knee.search_options(),
            load_sd: LOAD_SD,
            discrepancy: MODEL_DISCREPANCY,
            on_fit,
        }
    }

    /// Readings as measured, with their scatter.
    pub fn likelihood(&self) -> Likelihood {
        likelihood(&self.trials(None), self.question.options)
    }
}

/// Infers.
///
/// # Errors
/// A belief about an unknown bundle; no start has an answer; a prior that is no distribution.
pub fn inferred(question: &Question) -> Result<Inferred, CalibrationError> {
    let (options, posed) = (question.options, Posed::of(question)?);
    let mut starts = vec![start(question, &posed.parameters)];
    starts.extend(question.joint.map(|values| joint_start(values, &posed.parameters)));
    let inference = inference::posterior::PosteriorOptions { seed: options.seed, ..options.inference.clone() };
    let (done, expected) = (AtomicUsize::new(0), inference.fits(starts.len()) + unmeasured::fits(options));
    let on_fit = || (question.on_fit)((done.fetch_add(1, Ordering::Relaxed) + 1).min(expected), expected);
    let trials = posed.trials(Some(&on_fit));
    let mut likelihood = posed.likelihood();
    let found = infer(&trials, &mut likelihood, &starts, &inference)?;
    told(question, &trials, &likelihood, found)
}

/// Measured trials, then those imagined: drawers, then rests; then those from whose poses displacements count. And how many were measured.
fn trials(sources: &[(String, Targets)]) -> (Vec<Trial>, usize) {
    let mut out = of_data_sets(sources.iter().map(|(_, t)| &t.trials[..]), |s, t| sources[s].1.noise(t));
    let measured = out.len();
    let imagined = |ap: f64, fe_deg: f64| {
        let load = Load::new(0.0, 0.0, 0.0, ap, COMPRESSION_N);
        Trial::imagined(LaxityTrial::asked(String::new(), Test::Neutral, fe_deg, load))
    };
    out.extend(DRAWERS_DEG.iter().map(|&f| imagined(DRAWER_N, f)));
    out.extend(DRAWERS_DEG.iter().map(|&f| imagined(-DRAWER_N, f)));
    out.extend(REST_DEG.iter().map(|&f| imagined(0.0, f)));
    let unloaded = out.len();
    let done = |t: &Trial| (t.source, t.record.imposed());
    for i in 0..measured {
        let Some(zero) = out[i].record.unloaded() else { continue };
        let zero = Trial { source: out[i].source, ..Trial::imagined(zero) };
        let known = (unloaded..out.len()).find(|&k| done(&out[k]) == done(&zero));
        out[i].from = Some(known.unwrap_or(out.len()));
        out.extend(known.is_none().then_some(zero));
    }
    (out, measured)
}

/// Names of the drawers, in the order of the imagined trials.
pub fn drawer_names() -> Vec<String> {
    let of = |test: Test| DRAWERS_DEG.iter().map(move |f| format!("{}_{f}", test.name()));
    of(Test::Anterior).chain(of(Test::Posterior)).collect()
}

/// Physiological priors on forces, and the user's own.
fn beliefs(
    question: &Question,
    bundles: &[String],
    asked: &[Trial],
    measured: usize,
) -> Result<Vec<Belief>, CalibrationError> {
    let mut out = Vec::new();
    for p in question.options.priors.forces() {
        let of: Vec<usize> = (0..bundles.len()).filter(|&b| p.is_of(&bundles[b])).collect();
        if of.is_empty() {
            continue;
        }
        let ap = match p.test {
            Test::Anterior => DRAWER_N,
            Test::Posterior => -DRAWER_N,
            _ => 0.0,
        };
        for f in &p.flexion_deg {
            let same = |t: &Trial| t.record.fe_deg == *f && t.record.load[AP] == ap;
            if let Some(trial) = (measured..asked.len()).find(|&i| same(&asked[i])) {
                let (mean_n, sd_n, only_above) = (p.mean_n, question.options.priors.sd_at_each_n(p), p.only_above);
                out.push(Belief { trial, bundles: of.clone(), mean_n, sd_n, only_above });
            }
        }
    }
    for p in &question.options.loads {
        let index = p.bundles.iter().map(|name| {
            bundles.iter().position(|b| b == name).ok_or_else(|| {
                CalibrationError::Option(format!("loads: no bundle {name}; the model has {}", bundles.join(", ")))
            })
        });
        let index: Vec<usize> = index.collect::<Result<_, _>>()?;
        for (trial, _) in asked[..measured].iter().enumerate().filter(|(_, t)| p.applies(&t.record)) {
            let mean_n = p.mean_n.or(p.most_n).unwrap_or(0.0);
            let only_above = p.mean_n.is_none();
            out.push(Belief { trial, bundles: index.clone(), mean_n, sd_n: p.sd_n, only_above });
        }
    }
    Ok(out)
}

/// Place of a data set's coordinate among the scales of noise.
fn noise_group(source: usize, c: Coordinate) -> usize {
    FREE.len() * source + c.free_index()
}

/// Readings with their noise; repositioning in common to a condition.
fn likelihood(trials: &Trials, options: &CalibrateOptions) -> Likelihood {
    let (rows, all) = (trials.rows(), trials.trials);
    let read = |&(i, c): &(usize, Coordinate)| all[i].record.measured[c].unwrap_or(0.0);
    let measured = DVector::from_iterator(rows.len(), rows.iter().map(read));
    let sd: Vec<f64> = rows.iter().map(|&(i, c)| all[i].sd[c]).collect();
    let group: Vec<usize> = rows.iter().map(|&(i, c)| noise_group(all[i].source.unwrap_or(0), c)).collect();
    let mut out = Likelihood::independent(measured, sd.clone(), group);
    out.robust = options.gradient.robust;
    let common = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let ((i, c), (k, d)) = (rows[a], rows[b]);
        match (all[i].from.is_some(), all[k].from.is_some()) {
            _ if c != d || all[i].condition != all[k].condition => 0.0,
            (true, true) => options.rig.offset[c].powi(2),
            (false, false) => REPOSITIONING.powi(2) * sd[a] * sd[b],
            _ => 0.0,
        }
    });
    out.common = common;
    out.temper = temper(Asks::Sizes(rows.len()));
    out
}

/// The model's own ligaments as a start.
fn start(question: &Question, parameters: &[Parameter<Quantity>]) -> DVector<f64> {
    let values = question.design.values(&question.knee.spec);
    DVector::from_fn(parameters.len(), |k, _| values.get(k).map_or(0.0, |x| parameters[k].prior.z_of(*x)))
}

/// Where all data sets together ended, as a start for one of them; what they do not know stays at its prior's middle.
fn joint_start(values: &BTreeMap<String, f64>, parameters: &[Parameter<Quantity>]) -> DVector<f64> {
    let z = |p: &Parameter<Quantity>| values.get(&p.name).map_or(0.0, |x| p.prior.z_of(*x).clamp(-FURTHEST, FURTHEST));
    DVector::from_iterator(parameters.len(), parameters.iter().map(z))
}

/// Furthest that a start lies from its prior's middle [sd]: a value at a bound has no finite number.
const FURTHEST: f64 = 4.0;

/// How much better the joint start must end than every other for it to be told: half a sum of squares [-]. Ours: a likelihood 20 times as large.
const BETTER: f64 = 3.0;

/// What is told where a data set's own starts ended worse than the start from all of them together.
fn joint_was_better(question: &Question, starts: &[f64]) -> Option<Notice> {
    question.joint?;
    let joint = *starts.get(1)?;
    let own = starts.iter().enumerate().filter(|(k, _)| *k != 1).map(|(_, v)| *v).fold(f64::INFINITY, f64::min);
    (own - joint > BETTER).then(|| {
        Kind::JointWasBetter.notice(format!(
            "the fit begins from the joint calibration: by its own starts half the sum of squares was {own:.0}, from there {joint:.0}"
        ))
    })
}

/// What is told of numbers of a shared prior that are not used.
fn prior_unused(question: &Question) -> Option<Notice> {
    let Some(SharedPrior::Read(shared)) = &question.options.shared_prior else { return None };
    let own = CalibrateOptions { shared_prior: None, ..question.options.clone() };
    shared.unused(&parameters(&question.knee.spec, question.design, &[], &own, question.frames))
}

/// What is told where few of the samples asked for ended near a fit.
fn few_samples(found: &Found<Answers>, asked: usize) -> Option<Notice> {
    let got = found.samples.len();
    // an interval needs two
    let worth = if got < 2 { "there are no intervals" } else { "intervals are rough" };
    let text = format!("{got} of {asked} samples of the posterior ended near a fit; {worth}");
    (found.stuck * 2 > asked).then(|| Kind::FewSamples.notice(text).count(got))
}

/// What is told of noise that is far smaller than what readings miss by: most of them count as outliers, so it stays near what was stated.
fn noise_too_small(
    question: &Question,
    noise: &[NoiseEstimate],
    (predicted, elsewhere): (&[Option<Free<f64>>], &[usize]),
) -> Vec<Notice> {
    let (mut out, mut from) = (Vec::new(), 0);
    for (name, targets) in question.sources {
        let to = from + targets.trials.len();
        let far: Vec<usize> = elsewhere.iter().filter(|i| (from..to).contains(*i)).map(|i| i - from).collect();
        let misses = rms(&targets.trials, &predicted[from..to], &far);
        let own = noise.iter().filter(|n| n.source == *name);
        out.extend(own.filter_map(|n| {
            let miss = misses.each().find(|(c, _)| c.column() == n.coordinate)?.1;
            n.outlying((*miss)?)
        }));
        from = to;
    }
    out
}

/// What was found, in the words of a calibration.
fn told(
    question: &Question,
    trials: &Trials,
    likelihood: &Likelihood,
    found: Found<Answers>,
) -> Result<Inferred, CalibrationError> {
    let options = question.options;
    let interval = options.gradient.interval;
    let n_ligaments = question.design.len();
    let measured = question.sources.iter().map(|s| s.1.trials.len()).sum::<usize>();
    let mode = &found.modes[0];
    let LastReadings { predicted, elsewhere } = last_readings(question.knee, trials, &mode.z, (measured, &mode.state))?;
    let values: Vec<f64> = trials.values(&mode.z).into_iter().map(|v| v.0).collect();
    let sources: Vec<&str> = question.sources.iter().map(|s| s.0.as_str()).collect();
    let cost = question.cost.cost(&predicted).value;
    let names = drawer_names();
    let drawers = measured..measured + names.len();
    let samples = &found.samples;
    let nobody_measured = measured..measured + names.len() + REST_DEG.len();
    let unmeasured = Unmeasured::of(trials, (nobody_measured.clone(), names.len()), options);
    let estimate =
        |k: usize| estimate(&trials.parameters[k], mode.z[k], k, samples, (interval, unmeasured.variance(k)));
    let of_ligament = |k: usize| {
        let (v, e) = (&question.design.variables[k], estimate(k));
        ParameterEstimate {
            number: v.number,
            bundle: v.bundle(),
            kind: v.kind,
            value: e.value,
            lower: e.lower,
            upper: e.upper,
            range: [v.lower, v.upper],
            determined: e.determined,
        }
    };
    let is_told = |k: &usize| !matches!(trials.parameters[*k].quantity, Quantity::Site(..) | Quantity::Lean(..));
    let mut warnings = Vec::new();
    warnings.extend(few_samples(&found, options.inference.samples));
    warnings.extend(joint_was_better(question, &found.starts));
    warnings.extend(prior_unused(question));
    let noise = noise(question, likelihood);
    warnings.extend(noise.iter().filter_map(|n| n.not_as_stated(interval)));
    warnings.extend(noise_too_small(question, &noise, (&predicted, &elsewhere)));
    let others: Vec<OtherEstimate> = (n_ligaments..values.len()).filter(is_told).map(estimate).collect();
    warnings.extend(others.iter().filter_map(OtherEstimate::outside_prior));
    let frames = frames(question, trials, samples);
    let found_values = values[..n_ligaments].to_vec();
    let last = last_forces(question.knee, trials, &values, nobody_measured.clone());
    let leaves: Vec<Vec<Option<bool>>> =
        samples.par_iter().map(|s| trials.leaving(&s.z, &s.state, nobody_measured.clone())).collect();
    let calibrated = Calibrated {
        method: Method::Posterior,
        cost,
        lowest_cost: (cost, found_values.clone()),
        parameters: (0..n_ligaments).map(of_ligament).collect(),
        others,
        forces: unmeasured.forces(&found, (measured, &names, &leaves), &last, (interval, options.seed)),
        rest: rest(&found, (&last, &leaves), measured, interval),
        next_tests: next_tests(
            trials,
            &found,
            (drawers, &leaves),
            (COMPRESSION_N, noise_of_a_test(question, likelihood)),
        ),
        noise_scale: Free::from_fn(|c| {
            (0..sources.len())
                .map(|s| likelihood.scale.get(noise_group(s, c)).copied().unwrap_or(1.0))
                .fold(0.0, f64::max)
        }),
        noise,
        rms: rms(question.sources.iter().flat_map(|s| &s.1.trials), &predicted, &elsewhere),
        predicted,
        elsewhere,
        rivals: found.modes.iter().map(|m| (-m.log_evidence, at(trials, &m.z, n_ligaments))).collect(),
        samples: samples.iter().map(|s| at(trials, &s.z, n_ligaments)).collect(),
        unknowns: with_before(unknowns(trials, &found, options), trials, &unmeasured),
        weighed: Weighed::of(&samples.iter().filter_map(|s| s.log_weight).collect::<Vec<_>>()),
        evaluations: found.evaluations,
        history: found.starts.clone(),
        warnings,
        mode: trials.parameters.iter().zip(trials.values(&mode.z)).map(|(p, v)| (p.name.clone(), v.0)).collect(),
        values: found_values,
    };
    let spec = trials.spec_at(&mode.z, None)?;
    Ok(Inferred { found: calibrated, spec, frames })
}

/// Every unknown of every sample.
pub fn unknowns(trials: &Trials, found: &Found<Answers>, options: &CalibrateOptions) -> Unknowns {
    let of = |(k, p): (usize, &Parameter<Quantity>)| Unknown {
        name: p.name.clone(),
        quantity: p.quantity.clone(),
        most_probable: p.prior.at(found.modes[0].z[k]).0,
        samples: found.samples.iter().map(|s| p.prior.at(s.z[k]).0).collect(),
        before: vec![],
    };
    let unknowns = trials.parameters.iter().enumerate().map(of).collect();
    Unknowns { unknowns, seed: options.seed, interval: options.gradient.interval, search: options.search.clone() }
}

/// The same with what was known before the measurement, of numbers that knees can share.
fn with_before(mut of: Unknowns, trials: &Trials, unmeasured: &Unmeasured) -> Unknowns {
    for (k, (u, p)) in of.unknowns.iter_mut().zip(trials.parameters).enumerate() {
        if Sort::of(&p.quantity).is_some() {
            u.before = unmeasured.values(k, &p.prior);
        }
    }
    of
}

/// Values of the ligaments at a point.
fn at(trials: &Trials, z: &DVector<f64>, ligaments: usize) -> Vec<f64> {
    trials.values(z).into_iter().take(ligaments).map(|v| v.0).collect()
}

/// A parameter's value at the mode and its interval; `before` is the variance of its number with nothing measured.
fn estimate(
    p: &Parameter<Quantity>,
    mode: f64,
    k: usize,
    samples: &[Sample<Answers>],
    (interval, before): (f64, f64),
) -> OtherEstimate {
    let z: Vec<f64> = samples.iter().map(|s| s.z[k]).collect();
    let (low, high) =
        ends(&z, interval).map_or_else(|| p.prior.interval(interval), |(a, b)| (p.prior.at(a).0, p.prior.at(b).0));
    let value = p.prior.at(mode).0;
    let determined = share_removed(&z, before);
    let (prior_lower, prior_upper) = p.prior.interval(interval);
    OtherEstimate {
        name: p.name.clone(),
        value,
        lower: low.min(value),
        upper: high.max(value),
        prior: [prior_lower, prior_upper],
        determined,
        z: mode,
    }
}

/// Of imagined trials: forces by the final mechanics, and of each sample whether it leaves the plateau.
type ByTrial<'a> = (&'a [Option<Vec<f64>>], &'a [Vec<Option<bool>>]);

/// Tension of all ligaments at rest: mean and interval of the samples that stay on the plateau (`leaves`, by sample and imagined trial).
fn rest(found: &Found<Answers>, (last, leaves): ByTrial, measured: usize, interval: f64) -> Vec<RestEstimate> {
    let mode = &found.modes[0].state;
    let total = |state: &Answers, i: usize| {
        moved(&state[measured + i].forces_n, &mode[measured + i].forces_n, last[i].as_ref()).iter().sum::<f64>()
    };
    let from = drawer_names().len();
    let of = |(k, fe_deg): (usize, &f64)| {
        let staying = Staying::of(leaves.iter().map(|l| l[from + k]));
        let all: Vec<f64> = staying.here.iter().map(|&s| total(&found.samples[s].state, from + k)).collect();
        let mode_n = total(&found.modes[0].state, from + k);
        let value_n = if all.is_empty() { mode_n } else { mean(&all) };
        let interval_n = ends(&all, interval).map(|(lower, upper)| [lower, upper]);
        RestEstimate { fe_deg: *fe_deg, value_n, interval_n, mode_n, leaving: staying.leaving }
    };
    REST_DEG.iter().enumerate().map(of).collect()
}

/// Standard deviation of one more displacement by the first data set's apparatus [deg, mm]: its readings' scatter and its offset, or the
/// scatter of two poses as it was inferred.
fn noise_of_a_test(question: &Question, likelihood: &Likelihood) -> Free<f64> {
    let (options, targets) = (question.options, &question.sources[0].1);
    let displaced = targets.trials.iter().any(|t| t.reference.is_some());
    Free::from_fn(|c| match displaced {
        true => options.targets.noise_of_displacements[c].hypot(options.rig.offset[c]),
        false => {
            let stated = targets.trials.iter().find(|t| t.measured[c].is_some());
            let sd = stated.map_or(options.targets.noise[c], |t| targets.noise(t)[c]);
            std::f64::consts::SQRT_2 * sd * likelihood.scale.get(noise_group(0, c)).copied().unwrap_or(1.0)
        }
    })
}

/// Noise of each data set and coordinate, as stated and as inferred.
fn noise(question: &Question, likelihood: &Likelihood) -> Vec<NoiseEstimate> {
    let z = inference::parameter::Prior::Normal { mean: 0.0, sd: 1.0 }.interval(question.options.gradient.interval).1;
    let mut out = Vec::new();
    for (s, (name, targets)) in question.sources.iter().enumerate() {
        for c in FREE {
            let of: Vec<f64> =
                targets.trials.iter().filter(|t| t.measured[c].is_some()).map(|t| targets.noise(t)[c]).collect();
            let group = noise_group(s, c);
            let (Some(scale), Some(sd)) = (likelihood.scale.get(group), likelihood.log_scale_sd.get(group)) else {
                continue;
            };
            if of.is_empty() {
                continue;
            }
            let stated = mean(&of);
            out.push(NoiseEstimate {
                source: name.clone(),
                coordinate: c.column(),
                stated,
                inferred: stated * scale,
                lower: stated * scale * (-z * sd).exp(),
                upper: stated * scale * (z * sd).exp(),
            });
        }
    }
    out
}

/// Frames as each data set has them: mean and standard deviation over the samples.
fn frames(question: &Question, trials: &Trials, samples: &[Sample<Answers>]) -> Vec<KnownFrames> {
    let spread = |k: usize| {
        let all: Vec<f64> = samples.iter().map(|s| trials.parameters[k].prior.at(s.z[k]).0).collect();
        (all.len() > 1).then(|| (mean(&all), variance(&all).sqrt().max(1e-3)))
    };
    let of = |source: Option<usize>| -> Vec<Option<(f64, f64)>> {
        let place = |term: usize| {
            let wanted = Quantity::Frame(source, term);
            trials.parameters.iter().position(|p| p.quantity == wanted)
        };
        (0..12).map(|term| place(term).and_then(spread)).collect()
    };
    (0..question.sources.len()).map(|s| KnownFrames { shared: of(None), own: of(Some(s)) }).collect()
}

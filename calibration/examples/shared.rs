//! A prior that knees share, shown by simulation: made knees of one population, measured by numbers, calibrated each alone and again with what
//! the others say.
//!
//! `shared MODEL.json DATA.csv... [--knees N] [--rho R] [--seed S] [--samples N] [--spacing MM] [--shipped] [--oracle]`: DATA are data sets whose
//! loads and coordinates are asked; what was measured in them is not read. The numbers that knees share have a mean in common, of variance `R` in
//! that of their priors, and each knee's own deviation from it; all others are each knee's own. Beliefs about forces are heard, by slices of the
//! model itself [murray2010]. Readings scatter as the likelihood says, and are the same in every calibration. `--samples`: of each posterior; a
//! build's number unless given, and 192 for what is published. `--spacing`: contact nodes nearer than this are merged: coarser is quicker.
//! `--shipped`: readings count as in a build (tempered), else as their scatter says. With `--rho 0` nothing is in common: what others say must do
//! no harm. `--oracle`: each knee is also calibrated with the population's true mean and variance as prior. No estimate by other knees can be
//! expected to do better, so its ratio bounds what sharing can give.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

mod made;

use attachments::groups::{GROUPS, group_forces};
use calibration::cost::CostFunction;
use calibration::design::Design;
use calibration::evidence::{Evidence, priors};
use calibration::inferred::{Posed, Question, drawer_names};
use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::posterior::{ends, mean};
use calibration::shared::{SCHEMA, Shared, SharedNumber, SharedPrior, Sort};
use calibration::targets::Targets;
use inference::knee::{Answers, Trials};
use inference::noise::Likelihood;
use inference::posterior::{Forward, PosteriorOptions, infer};
use inference::random::{normals, stream, uniform};
use made::Population;
use nalgebra::DVector;
use rayon::prelude::*;

/// Share of the samples between the ends of an interval [-].
const INTERVAL: f64 = 0.9;
/// A force below this is that of a slack ligament, and is not judged [N].
const LEAST_N: f64 = 5.0;
/// Knees are drawn again this often, for intervals of what is printed [-].
const DRAWN_AGAIN: usize = 4000;
/// Streams of random numbers: the population, noise, knees drawn again.
const STREAMS: [u64; 3] = [8_000_000, 6_000_000, 8_500_000];
/// Seed of samples with nothing measured, beside that of the posterior's: another draw.
const BEFORE_SEED: u64 = 0x6265_666f;

struct Arguments {
    model: String,
    data: Vec<String>,
    knees: usize,
    rho: f64,
    seed: u64,
    samples: Option<usize>,
    spacing_mm: Option<f64>,
    shipped: bool,
    oracle: bool,
}

fn arguments() -> Arguments {
    let mut all: Vec<String> = std::env::args().skip(1).collect();
    let mut option = |name: &str| all.iter().position(|a| a == name).map(|at| all.drain(at..at + 2).nth(1).unwrap());
    let (knees, seed) = (option("--knees"), option("--seed"));
    let (knees, seed) = (knees.map_or(30, |t| t.parse().unwrap()), seed.map_or(1, |t| t.parse().unwrap()));
    let rho = option("--rho").map_or(0.5, |t| t.parse().unwrap());
    let spacing_mm = option("--spacing").map(|t| t.parse().unwrap());
    let samples = option("--samples").map(|t| t.parse().unwrap());
    let mut flag = |name: &str| {
        let count = all.len();
        all.retain(|a| a != name);
        all.len() < count
    };
    let (shipped, oracle) = (flag("--shipped"), flag("--oracle"));
    let model = all.remove(0);
    Arguments { model, data: all, knees, rho, seed, samples, spacing_mm, shipped, oracle }
}

/// What a knee is asked with.
struct Asked<'a> {
    knee: &'a Knee,
    design: &'a Design,
    sources: &'a [(String, Targets)],
    cost: &'a CostFunction,
}

impl Asked<'_> {
    /// Asks with options.
    fn by<T>(&self, options: &CalibrateOptions, ask: impl FnOnce(&Posed) -> T) -> T {
        let question = Question {
            knee: self.knee,
            design: self.design,
            sources: self.sources,
            cost: self.cost,
            options,
            frames: None,
            joint: None,
            on_fit: &|_, _| (),
        };
        ask(&Posed::of(&question).unwrap())
    }
}

/// A sum of forces in a drawer: its name, whether it is of cruciates, and its force of a knee's answers [N].
type Sums = Vec<(String, bool, f64)>;

/// Forces of the ligament groups in the drawers.
fn sums(posed: &Posed, state: &Answers) -> Sums {
    let bundles = posed.model.bundle_names();
    let of = |(i, drawer): (usize, String)| {
        let forces = group_forces(&bundles, &state[posed.measured + i].forces_n);
        let names = GROUPS.iter().zip(forces);
        names
            .map(|((group, _), f)| (format!("{group} in {drawer}"), ["ACL", "PCL"].contains(group), f))
            .collect::<Vec<_>>()
    };
    drawer_names().into_iter().enumerate().flat_map(of).collect()
}

/// A calibrated knee: standard normal numbers of its samples, and sums of forces of each.
struct Calibrated {
    z: Vec<DVector<f64>>,
    sums: Vec<Sums>,
}

fn calibrated(
    posed: &Posed,
    likelihood: &mut Likelihood,
    (options, seed): (&CalibrateOptions, u64),
) -> Option<Calibrated> {
    let inference = PosteriorOptions { seed, ..options.inference.clone() };
    let start = DVector::zeros(posed.parameters.len());
    let found = infer(&posed.trials(None), likelihood, &[start], &inference).ok()?;
    let sums = found.samples.iter().map(|s| sums(posed, &s.state)).collect();
    Some(Calibrated { z: found.samples.into_iter().map(|s| s.z).collect(), sums })
}

/// Samples with nothing measured: beliefs alone.
fn before(posed: &Posed, (options, seed): (&CalibrateOptions, u64)) -> Option<Vec<DVector<f64>>> {
    let (asked, beliefs) = made::imagined(posed);
    let trials = Trials { trials: &asked, beliefs: &beliefs, ..posed.trials(None) };
    let mut nothing = Likelihood::independent(DVector::zeros(0), Vec::new(), Vec::new());
    let inference = PosteriorOptions { seed: seed ^ BEFORE_SEED, ..options.inference.clone() };
    let found = infer(&trials, &mut nothing, &[], &inference).ok()?;
    Some(found.samples.into_iter().map(|s| s.z).collect())
}

/// A made knee: its true sums of forces, its readings.
struct Made {
    number: u64,
    truth: Sums,
    measured: DVector<f64>,
}

fn measured(posed: &Posed, z: &DVector<f64>, (seed, number): (u64, u64)) -> Option<Made> {
    let made = posed.trials(None);
    let point = made.at(z, None)?;
    let likelihood = posed.likelihood();
    let mut random = stream(seed, STREAMS[1] + number);
    let mut scatter = likelihood.with_scales_at(&normals(&mut random, likelihood.scale.len()));
    scatter.share(made.scatter(&point.state)?);
    scatter.temper = 1.0;
    scatter.prepare().ok()?;
    let measured = &point.reading + scatter.scattered(&normals(&mut random, point.reading.len()));
    Some(Made { number, truth: sums(posed, &point.state), measured })
}

/// Squared errors of a knee, how many; intervals that hold, of how many. First of all groups, then of the cruciates.
type Judged = [[f64; 4]; 2];

fn judged(truth: &Sums, found: &Calibrated) -> Judged {
    let mut out = [[0.0; 4]; 2];
    for (k, (_, is_cruciate, t)) in truth.iter().enumerate() {
        let all: Vec<f64> = found.sums.iter().map(|s| s[k].2).collect();
        let Some((low, high)) = ends(&all, INTERVAL) else { continue };
        let value = mean(&all);
        for (part, _) in [true, *is_cruciate].into_iter().enumerate().filter(|(_, counts)| *counts) {
            if t.max(value) > LEAST_N {
                out[part][0] += (value - t).powi(2);
                out[part][1] += 1.0;
            }
            // a slack ligament whose interval says slack holds
            if t.max(high) > LEAST_N {
                out[part][2] += f64::from(u8::from(low - 1e-9 <= *t && *t <= high + 1e-9));
                out[part][3] += 1.0;
            }
        }
    }
    out
}

/// Ways in which each knee is calibrated. The last is there with `--oracle` alone.
const WAYS: [&str; 3] = ["alone", "what the others say", "the population's own"];

/// Root mean squared error and share of intervals that hold, over knees by their places.
fn over(knees: &[Vec<Judged>], places: &[usize], (way, part): (usize, usize)) -> [f64; 2] {
    let sum = |k: usize| places.iter().map(|i| knees[*i][way][part][k]).sum::<f64>();
    [(sum(0) / sum(1)).sqrt(), sum(2) / sum(3)]
}

/// What came of it, each figure with an interval by drawing knees again.
fn tell(knees: &[Vec<Judged>], seed: u64) {
    let own: Vec<usize> = (0..knees.len()).collect();
    let mut random = stream(seed, STREAMS[2]);
    let mut again =
        || -> Vec<usize> { own.iter().map(|_| (uniform(&mut random) * own.len() as f64) as usize).collect() };
    let drawn: Vec<Vec<usize>> = (0..DRAWN_AGAIN).map(|_| again()).collect();
    let with = |of: &dyn Fn(&[usize]) -> f64| {
        let all: Vec<f64> = drawn.iter().map(|d| of(d)).filter(|x| x.is_finite()).collect();
        let (low, high) = ends(&all, INTERVAL).unwrap_or((f64::NAN, f64::NAN));
        format!("{:.3} ({low:.3} to {high:.3})", of(&own))
    };
    println!("| what | prior | error, N | error over that alone | intervals hold |");
    println!("|---|---|---|---|---|");
    for (part, name) in ["groups in drawers", "cruciates in drawers"].into_iter().enumerate() {
        for (way, prior) in WAYS.iter().enumerate().take(knees.first().map_or(0, Vec::len)) {
            let figure = |k: usize| with(&|d| over(knees, d, (way, part))[k]);
            let ratio = with(&|d| over(knees, d, (way, part))[0] / over(knees, d, (0, part))[0]);
            println!("| {name} | {prior} | {} | {ratio} | {} |", figure(0), figure(1));
        }
    }
}

/// The population: a mean in common of the numbers that knees share.
fn population(posed: &Posed, arguments: &Arguments) -> Population {
    let drawn = normals(&mut stream(arguments.seed, STREAMS[0]), posed.parameters.len());
    let is_shared = |k: usize| Sort::of(&posed.parameters[k].quantity).is_some();
    let of = |f: &dyn Fn(usize) -> f64, else_: f64| {
        DVector::from_fn(drawn.len(), |k, _| if is_shared(k) { f(k) } else { else_ })
    };
    Population { mean: of(&|k| arguments.rho.sqrt() * drawn[k], 0.0), sd: of(&|_| (1.0 - arguments.rho).sqrt(), 1.0) }
}

/// The population as a prior: its true mean and standard deviation of each number that knees share.
fn oracle(posed: &Posed, of: &Population) -> Shared {
    let shared = posed.parameters.iter().enumerate().filter(|(_, p)| Sort::of(&p.quantity).is_some());
    let numbers = shared.map(|(k, p)| SharedNumber::of(&p.name, &p.prior, [of.mean[k], of.sd[k]])).collect();
    Shared { schema: SCHEMA.to_owned(), knee: None, from: vec!["the population".to_owned()], file: None, numbers }
}

/// How made knees are calibrated.
struct Way<'a> {
    asked: &'a Asked<'a>,
    options: &'a CalibrateOptions,
    seed: u64,
    shipped: bool,
    begun: std::time::Instant,
}

impl Way<'_> {
    /// A knee with a prior in place of its own, where one is given.
    fn one(&self, made: &Made, prior: Option<Shared>) -> Option<Calibrated> {
        let shared_prior = prior.map(|prior| SharedPrior::Read(Box::new(prior)));
        let options = CalibrateOptions { shared_prior, ..self.options.clone() };
        self.asked.by(&options, |posed| {
            let mut likelihood = posed.likelihood();
            likelihood.measured.clone_from(&made.measured);
            if !self.shipped {
                likelihood.temper = 1.0;
            }
            calibrated(posed, &mut likelihood, (&options, self.seed + made.number))
        })
    }

    /// A knee alone, and what its data say.
    fn alone(&self, made: &Made) -> Option<(Calibrated, Evidence)> {
        let found = self.one(made, None)?;
        let evidence = self.asked.by(self.options, |posed| {
            let before = before(posed, (self.options, self.seed + made.number))?;
            Some(Evidence::between(made.number.to_string(), &posed.parameters, (&found.z, &before)))
        })?;
        self.tell(&format!("knee {} alone: {} numbers informed", made.number, evidence.informed()));
        Some((found, evidence))
    }

    fn tell(&self, what: &str) {
        println!("{what}, {:.0} s", self.begun.elapsed().as_secs_f64());
    }
}

/// What the others say of each knee: a prior of each, in their order.
fn said(evidence: &[Evidence]) -> Vec<Shared> {
    let found = priors(evidence);
    let (shares, all) = (found.shares[evidence.len()], &found.informed[evidence.len()]);
    let told: Vec<String> = Sort::ALL.map(|s| format!("{} {:.2}", s.name(), shares[s.place()])).into();
    println!("in common: {}; knees that say anything of each number: {all:?}", told.join(", "));
    found.priors
}

/// How far what the others say lies from the truth of the population: each number's mean and standard deviation, told and true.
fn tell_means(told: Option<&Shared>, truth: &Shared) {
    println!("| number | mean, told | true | sd, told | true |\n|---|---|---|---|---|");
    for n in &truth.numbers {
        let own = told.and_then(|t| t.numbers.iter().find(|m| m.name == n.name));
        // nobody says anything: the number keeps its prior
        let [mean, sd] = own.map_or([0.0, 1.0], |m| [m.mean, m.sd]);
        println!("| {} | {mean:.2} | {:.2} | {sd:.2} | {:.2} |", n.name, n.mean, n.sd);
    }
}

/// Each knee alone, then with what the others say, then, where it is given, with the population's own prior. By knee, where all answered.
fn each_way(way: &Way, knees: &[Made], truth: &Shared, with_truth: bool) -> Vec<Vec<Judged>> {
    let alone: Vec<_> = knees.iter().map(|made| way.alone(made)).collect();
    let evidence: Vec<Evidence> = alone.iter().flatten().map(|a| a.1.clone()).collect();
    let priors = said(&evidence);
    tell_means(priors.last(), truth);
    let of = |knee: &str| priors.iter().find(|p| p.knee.as_deref() == Some(knee)).cloned();
    let judge = |(made, alone): (&Made, &Option<(Calibrated, Evidence)>)| {
        let (alone, evidence) = alone.as_ref()?;
        let found = way.one(made, Some(of(&evidence.knee)?))?;
        let mut out = vec![judged(&made.truth, alone), judged(&made.truth, &found)];
        if with_truth {
            out.push(judged(&made.truth, &way.one(made, Some(truth.clone()))?));
        }
        way.tell(&format!("knee {} with a prior of others", made.number));
        Some(out)
    };
    knees.iter().zip(&alone).filter_map(judge).collect()
}

fn main() {
    let arguments = arguments();
    let mut options = CalibrateOptions::default();
    options.search.contact_spacing_mm = arguments.spacing_mm.unwrap_or(options.search.contact_spacing_mm);
    options.inference.samples = arguments.samples.unwrap_or(options.inference.samples);
    let knee = made::knee(&arguments.model, (0.0, 0.0), &options);
    let of = |(k, file): (usize, &String)| {
        (format!("set{}", k + 1), made::targets_of(&knee.spec, &made::laxity(file), &options))
    };
    let sources: Vec<_> = arguments.data.iter().enumerate().map(of).collect();
    let design = Design::of_model(&knee.spec).unwrap();
    let measured_all: Vec<_> = sources.iter().flat_map(|s| s.1.trials.clone()).collect();
    let cost = CostFunction::new(&measured_all, &knee.spec.frames.gs_ct_pose, &options.cost).unwrap();
    let asked = Asked { knee: &knee, design: &design, sources: &sources, cost: &cost };
    let (knees, truth) = asked.by(&options, |posed| {
        let population = population(posed, &arguments);
        let truths = made::truths_of(posed, (arguments.seed, arguments.knees), &population);
        let wanted: Vec<(usize, DVector<f64>)> = truths.into_iter().take(arguments.knees).enumerate().collect();
        let made = wanted.par_iter().filter_map(|(n, z)| measured(posed, z, (arguments.seed, *n as u64)));
        (made.collect::<Vec<Made>>(), oracle(posed, &population))
    });
    let told = format!("rho {}, seed {}, {} samples", arguments.rho, arguments.seed, options.inference.samples);
    println!("{} knees made; {told}", knees.len());
    let begun = std::time::Instant::now();
    let (seed, shipped) = (1000 * arguments.seed, arguments.shipped);
    let way = Way { asked: &asked, options: &options, seed, shipped, begun };
    let judged = each_way(&way, &knees, &truth, arguments.oracle);
    println!("{} of {} knees answered every time; {told}", judged.len(), arguments.knees);
    tell(&judged, arguments.seed);
}

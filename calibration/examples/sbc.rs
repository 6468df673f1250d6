//! Simulation-based calibration [talts2018]: knees drawn from all that is believed, measured by numbers, calibrated; where the truth lies among the samples.
//!
//! `sbc MODEL.json DATA.csv... [--knees N] [--seed S] [--wide F] [--shipped] [--truth MODEL.json] [--lean DEG] [--form MM] [--spacing MM]`: DATA are data sets whose loads and
//! coordinates are asked; what was measured in them is not read. A truth is drawn from the prior times the beliefs, by elliptical slices of the model
//! itself [murray2010], and none is left out. Ten chains draw a tenth of them each, so another N asks other knees.
//! Readings scatter as the likelihood says, with scales of the noise from their prior.
//! `--wide`: numbers of the truths are that many times as wide. `--shipped`: readings count as in a build (tempered), else as their scatter says.
//! `--spacing`: contact nodes nearer than this are merged, in truth and analysis alike: coarser is quicker.
//! Of each knee it tells the shape of the tail of the samples' importance weights, and how many samples they are worth [vehtari2024].
//! `--truth`: the truth's mechanics are another model's. `--lean`, `--form`: its plateaus lean about the AP axis, and undulate over 20 mm.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

mod made;

use calibration::cost::CostFunction;
use calibration::design::Design;
use calibration::inferred::{Posed, Question, drawer_names};
use calibration::options::CalibrateOptions;
use inference::knee::Answers;
use inference::posterior::{Forward, PosteriorOptions, infer};
use inference::random::{normals, stream, uniform};
use inference::weights::Weighed;
use nalgebra::DVector;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Bins of ranks [-].
const BINS: usize = 10;
/// Intervals that are judged [-].
const SHARES: [f64; 3] = [0.5, 0.8, 0.9];
/// Streams of random numbers: noise, ties.
const STREAMS: [u64; 2] = [6_000_000, 7_000_000];

struct Arguments {
    model: String,
    data: Vec<String>,
    knees: usize,
    seed: u64,
    wide: f64,
    shipped: bool,
    truth: Option<String>,
    lean_deg: f64,
    form_mm: f64,
    spacing_mm: Option<f64>,
}

fn arguments() -> Arguments {
    let mut all: Vec<String> = std::env::args().skip(1).collect();
    let mut option = |name: &str| all.iter().position(|a| a == name).map(|at| all.drain(at..at + 2).nth(1).unwrap());
    let number = |text: Option<String>, default: f64| text.map_or(default, |t| t.parse().unwrap());
    let (knees, seed) = (number(option("--knees"), 200.0) as usize, number(option("--seed"), 1.0) as u64);
    let (wide, lean_deg) = (number(option("--wide"), 1.0), number(option("--lean"), 0.0));
    let spacing_mm = option("--spacing").map(|t| t.parse().unwrap());
    let (form_mm, truth) = (number(option("--form"), 0.0), option("--truth"));
    let shipped = all.iter().any(|a| a == "--shipped");
    all.retain(|a| a != "--shipped");
    let model = all.remove(0);
    Arguments { model, data: all, knees, seed, wide, shipped, truth, lean_deg, form_mm, spacing_mm }
}

/// What is judged: names, and their values at a point.
struct Judged<'a> {
    posed: &'a Posed<'a>,
    drawers: Vec<String>,
    bundles: Vec<String>,
    parameters: Vec<usize>,
}

impl<'a> Judged<'a> {
    fn new(posed: &'a Posed<'a>) -> Judged<'a> {
        let place = |part: &str| posed.parameters.iter().position(|p| p.name.contains(part));
        let of = ["ACL_AM", "PCL_AL", "LCL", "contact", "cartilage", "lean"];
        let mut parameters: Vec<usize> = of.iter().filter_map(|p| place(p)).collect();
        parameters
            .extend(posed.parameters.iter().position(|p| matches!(p.quantity, inference::knee::Quantity::Frame(..))));
        Judged { posed, drawers: drawer_names(), bundles: posed.model.bundle_names(), parameters }
    }

    fn names(&self) -> Vec<String> {
        let sums = self.drawers.iter().map(|d| match d.starts_with("anterior") {
            true => format!("ACL in {d} [N]"),
            false => format!("PCL in {d} [N]"),
        });
        let poses = self.drawers.iter().map(|d| format!("AP in {d} [mm]"));
        let rests = [0, 30, 60, 90].map(|f| format!("all at rest, {f} deg [N]"));
        let parameters = self.parameters.iter().map(|&k| self.posed.parameters[k].name.clone());
        sums.chain(poses).chain(rests).chain(parameters).collect()
    }

    fn values(&self, z: &DVector<f64>, state: &Answers) -> Vec<f64> {
        let sum = |i: usize, group: &str| {
            let of = state[self.posed.measured + i].forces_n.iter().zip(&self.bundles);
            of.filter(|(_, name)| name.starts_with(group)).map(|(f, _)| f).sum::<f64>()
        };
        let drawers = self.drawers.iter().enumerate();
        let sums = drawers.map(|(i, d)| sum(i, if d.starts_with("anterior") { "ACL" } else { "PCL" }));
        let poses = (0..self.drawers.len()).map(|i| state[self.posed.measured + i].predicted[sim::coordinate::AP]);
        let rests = (0..4).map(|k| sum(self.drawers.len() + k, ""));
        sums.chain(poses).chain(rests).chain(self.parameters.iter().map(|&k| z[k])).collect()
    }
}

/// Place of a truth among samples: uniform from 0 to 1 where the samples are of the posterior. Equal ones (slack: 0 N) are parted by chance.
fn place(truth: f64, samples: &[f64], random: &mut rand_chacha::ChaCha8Rng) -> f64 {
    let below = samples.iter().filter(|s| **s < truth - 1e-9).count() as f64;
    let equal = samples.iter().filter(|s| (**s - truth).abs() <= 1e-9).count() as f64;
    (below + uniform(random) * (equal + 1.0)) / (samples.len() as f64 + 1.0)
}

/// A made knee calibrated: places of what is judged, how many samples there were, and what their weights say.
fn places(
    (analysis, truth): (&Posed, &Posed),
    z: &DVector<f64>,
    (arguments, number): (&Arguments, u64),
    options: &CalibrateOptions,
) -> Option<(Vec<f64>, usize, Option<Weighed>)> {
    let made = truth.trials(None);
    let point = made.at(z, None)?;
    let mut likelihood = analysis.likelihood();
    if !arguments.shipped {
        likelihood.temper = 1.0;
    }
    let mut random = stream(arguments.seed, STREAMS[0] + number);
    let mut scatter = likelihood.with_scales_at(&normals(&mut random, likelihood.scale.len()));
    scatter.share(made.scatter(&point.state)?);
    scatter.temper = 1.0;
    scatter.prepare().ok()?;
    likelihood.measured = &point.reading + scatter.scattered(&normals(&mut random, point.reading.len()));
    let inference = PosteriorOptions { seed: arguments.seed + number, ..options.inference.clone() };
    let start = DVector::zeros(z.len());
    let found = infer(&analysis.trials(None), &mut likelihood, &[start], &inference).ok()?;
    let (of, judged) = (Judged::new(truth).values(z, &point.state), Judged::new(analysis));
    let samples: Vec<Vec<f64>> = found.samples.iter().map(|s| judged.values(&s.z, &s.state)).collect();
    let mut ties = stream(arguments.seed, STREAMS[1] + number);
    let column = |k: usize| samples.iter().map(|s| s[k]).collect::<Vec<f64>>();
    let weights: Vec<f64> = found.samples.iter().filter_map(|s| s.log_weight).collect();
    let places = of.iter().enumerate().map(|(k, t)| place(*t, &column(k), &mut ties)).collect();
    Some((places, samples.len(), Weighed::of(&weights)))
}

fn tell(names: &[String], all: &[Vec<f64>]) {
    let knees = all.len() as f64;
    println!("| what | chi-square p | 50 % | 80 % | 90 % | mean place |");
    println!("|---|---|---|---|---|---|");
    let inside = |u: f64, share: f64| (u - 0.5).abs() <= 0.5 * share;
    let law = ChiSquared::new((BINS - 1) as f64).unwrap();
    for (k, name) in names.iter().enumerate() {
        let of: Vec<f64> = all.iter().map(|p| p[k]).collect();
        let even = knees / BINS as f64;
        let count = |b: usize| of.iter().filter(|u| ((**u * BINS as f64) as usize).min(BINS - 1) == b).count() as f64;
        let p = law.sf((0..BINS).map(|b| (count(b) - even).powi(2) / even).sum());
        let held = SHARES.map(|s| 100.0 * of.iter().filter(|u| inside(**u, s)).count() as f64 / knees);
        let mean = of.iter().sum::<f64>() / knees;
        println!("| {name} | {p:.4} | {:.0} | {:.0} | {:.0} | {mean:.2} |", held[0], held[1], held[2]);
    }
    for share in SHARES {
        let by_knee: Vec<f64> =
            all.iter().map(|p| p.iter().filter(|u| inside(**u, share)).count() as f64 / p.len() as f64).collect();
        let mean = by_knee.iter().sum::<f64>() / knees;
        let sd = (by_knee.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (knees - 1.0)).sqrt();
        let z = (mean - share) / (sd / knees.sqrt());
        println!("intervals of {:.0} % hold {:.1} %: {z:+.1} standard errors by knee", 100.0 * share, 100.0 * mean);
    }
}

fn main() {
    let arguments = arguments();
    let mut options = CalibrateOptions::default();
    options.search.contact_spacing_mm = arguments.spacing_mm.unwrap_or(options.search.contact_spacing_mm);
    let analysis = made::knee(&arguments.model, (0.0, 0.0), &options);
    let other = arguments.truth.as_ref().unwrap_or(&arguments.model);
    let truth = made::knee(other, (arguments.lean_deg, arguments.form_mm), &options);
    let of = |(k, file): (usize, &String)| {
        (format!("set{}", k + 1), made::targets_of(&analysis.spec, &made::laxity(file), &options))
    };
    let sources: Vec<_> = arguments.data.iter().enumerate().map(of).collect();
    let design = Design::of_model(&analysis.spec).unwrap();
    let measured: Vec<_> = sources.iter().flat_map(|s| s.1.trials.clone()).collect();
    let cost = CostFunction::new(&measured, &analysis.spec.frames.gs_ct_pose, &options.cost).unwrap();
    let question = |knee| Question {
        knee,
        design: &design,
        sources: &sources,
        cost: &cost,
        options: &options,
        frames: None,
        joint: None,
        on_fit: &|_, _| (),
    };
    let (of_analysis, of_truth) = (question(&analysis), question(&truth));
    let (analysis, truth) = (Posed::of(&of_analysis).unwrap(), Posed::of(&of_truth).unwrap());
    let begun = std::time::Instant::now();
    let truths = made::truths(&truth, (arguments.seed, arguments.knees, arguments.wide));
    println!("{} truths in {:.0} s", truths.len(), begun.elapsed().as_secs_f64());
    let mut all = Vec::new();
    for (number, z) in truths.iter().take(arguments.knees).enumerate() {
        match places((&analysis, &truth), z, (&arguments, number as u64), &options) {
            Some((places, samples, weighed)) => {
                let told: Vec<String> = places.iter().map(|p| format!("{p:.2}")).collect();
                let worth = weighed.map_or_else(String::new, |w| {
                    format!(
                        " (k-hat {:.2} of {:.2}, worth {:.1}, spread {:.1})",
                        w.k_hat, w.limit, w.effective_samples, w.spread
                    )
                });
                println!(
                    "knee {number}: {samples} samples{worth}, {:.0} s: {}",
                    begun.elapsed().as_secs_f64(),
                    told.join(" ")
                );
                all.push(places);
            }
            None => println!("knee {number}: no answer"),
        }
    }
    println!("{} of {} knees answered; seed {}", all.len(), arguments.knees, arguments.seed);
    tell(&Judged::new(&analysis).names(), &all);
}

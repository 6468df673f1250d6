//! What chosen tests are worth: made knees, calibrated to a few trials, then with tests chosen for a ligament's force, then with as many usual ones.
//!
//! `next_tests MODEL.json DATA.csv [--knees N] [--seed S] [--spacing MM] [--count N] [--group ACL]`: of DATA loads and coordinates are asked; what was
//! measured in it is not read. Truths are those of `sbc`. Told, a knee a line and in all: the share of the force's standard deviation that the chosen tests
//! promised to leave, that found after them, that found after the usual tests, and the interval score [gneiting2007] of each.
#![expect(clippy::disallowed_methods, reason = "reads and prints")]
#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "an example")]

mod made;

use calibration::cost::CostFunction;
use calibration::design::Design;
use calibration::inferred::{Posed, Question};
use calibration::knee::Knee;
use calibration::options::CalibrateOptions;
use calibration::posterior::{ends, mean, variance};
use calibration::samples::{SCHEMA, Samples};
use calibration::test_set::{Asking, Candidate, Wanted, candidates, test_set};
use inference::posterior::{Forward, PosteriorOptions, infer};
use inference::random::{normals, stream};
use nalgebra::DVector;
use sim::coordinate::{Free, Load};
use sim::laxity::{LaxityTrial, Test};

/// Compression in the tests [N].
const COMPRESSION_N: f64 = 20.0;
/// Stream of random numbers of the readings' noise.
const STREAM: u64 = 8_000_000;
/// Usual tests beside which chosen ones stand, in this order: test and flexion [deg].
const USUAL: [(Test, f64); 6] = [
    (Test::Anterior, 30.0),
    (Test::Posterior, 90.0),
    (Test::Internal, 30.0),
    (Test::External, 30.0),
    (Test::Varus, 30.0),
    (Test::Valgus, 30.0),
];

struct Bench<'a> {
    knee: &'a Knee,
    design: Design,
    options: CalibrateOptions,
    seed: u64,
    count: usize,
    group: String,
    base: Vec<LaxityTrial>,
}

/// What a calibration says of the force: by drawer the samples, and the truth.
struct Known {
    samples: Vec<Vec<f64>>,
    truth: Vec<f64>,
}

impl Known {
    fn sd(&self) -> f64 {
        mean(&self.samples.iter().map(|s| variance(s).sqrt()).collect::<Vec<_>>())
    }

    /// Of intervals of 90 % [N]: width, and twenty times what a truth lies outside; the mean over drawers.
    fn score(&self) -> f64 {
        let of = |(samples, truth): (&Vec<f64>, &f64)| {
            let (low, high) = ends(samples, 0.9).unwrap();
            high - low + 20.0 * ((low - truth).max(0.0) + (truth - high).max(0.0))
        };
        mean(&self.samples.iter().zip(&self.truth).map(of).collect::<Vec<_>>())
    }
}

/// Tests as trials that read what they load; of each flexion the unloaded knee first.
fn as_trials(tests: &[Candidate]) -> Vec<LaxityTrial> {
    let mut out: Vec<LaxityTrial> = Vec::new();
    for c in tests {
        let rest = format!("next_{}", c.flexion_deg);
        let unloaded = match out.iter().position(|t| t.trial == rest) {
            Some(at) => at,
            None => {
                out.push(LaxityTrial::asked(rest, Test::Neutral, c.flexion_deg, Load::compression(COMPRESSION_N)));
                out.len() - 1
            }
        };
        let mut trial =
            LaxityTrial::asked(format!("next_{}_{}", c.name(), c.flexion_deg), c.tests[0], c.flexion_deg, c.load);
        for k in &c.reads {
            (trial.measured[*k], out[unloaded].measured[*k]) = (Some(0.0), Some(0.0));
        }
        out.push(trial);
    }
    out
}

impl Bench<'_> {
    /// Calls `then` with a question about the base trials and `more`.
    fn asked<T>(&self, more: &[LaxityTrial], then: impl FnOnce(&Question) -> T) -> T {
        let trials = [&self.base[..], more].concat();
        let sources = [("set1".to_owned(), made::targets_of(&self.knee.spec, &trials, &self.options))];
        let measured = sources[0].1.trials.clone();
        let cost = CostFunction::new(&measured, &self.knee.spec.frames.gs_ct_pose, &self.options.cost).unwrap();
        then(&Question {
            knee: self.knee,
            design: &self.design,
            sources: &sources,
            cost: &cost,
            options: &self.options,
            frames: None,
            joint: None,
            on_fit: &|_, _| (),
        })
    }

    /// The knee at `z` measured in the base trials and `more`, and calibrated to that. `None`: no answer.
    fn known(&self, z: &DVector<f64>, number: u64, more: &[LaxityTrial]) -> Option<(Known, Samples)> {
        self.asked(more, |question| {
            let posed = Posed::of(question).unwrap();
            let trials = posed.trials(None);
            let Some(point) = trials.at(z, None) else {
                println!("  the truth has no equilibrium in one of the trials");
                return None;
            };
            let mut likelihood = posed.likelihood();
            let mut scatter = likelihood.clone();
            scatter.share(trials.scatter(&point.state)?);
            scatter.temper = 1.0;
            scatter.prepare().ok()?;
            // the base trials have the same noise whatever comes after them
            likelihood.measured = &point.reading
                + scatter.scattered(&normals(&mut stream(self.seed, STREAM + number), point.reading.len()));
            let inference = PosteriorOptions { seed: self.seed + number, ..self.options.inference.clone() };
            let found = infer(&trials, &mut likelihood, &[DVector::zeros(z.len())], &inference).ok()?;
            let names = posed.model.bundle_names();
            let of_group = |forces: &[f64]| {
                names.iter().zip(forces).filter(|n| n.0.starts_with(&self.group)).map(|n| n.1).sum::<f64>()
            };
            let drawers = posed.measured..posed.measured + 6;
            let column = |i: usize| found.samples.iter().map(|s| of_group(&s.state[i].forces_n)).collect();
            let known = Known {
                samples: drawers.clone().map(column).collect(),
                truth: drawers.map(|i| of_group(&point.state[i].forces_n)).collect(),
            };
            let of = calibration::inferred::unknowns(&trials, &found, &self.options);
            Some((
                known,
                Samples { schema: SCHEMA.into(), model: String::new(), counted_from: self.knee.spec.clone(), of },
            ))
        })
    }

    /// Shares promised, found and found by usual tests; scores before, after, after usual tests.
    fn knee(&self, z: &DVector<f64>, number: u64) -> Option<[f64; 6]> {
        let (before, samples) = self.known(z, number, &[])?;
        let model = self.knee.search_model().with_friction(0.0).ok()?;
        let names = model.bundle_names();
        let asking = Asking {
            wanted: Wanted::Force((0..names.len()).filter(|b| names[*b].starts_with(&self.group)).collect()),
            without: &[],
            count: self.count,
            combined: true,
            noise: self.options.targets.noise,
            compression_n: COMPRESSION_N,
            most: samples.len(),
        };
        let set = test_set(&samples, &model, &asking).inspect_err(|e| println!("  {e}")).ok()?;
        let chosen: Vec<Candidate> = set.tests.iter().map(|c| c.test.clone()).collect();
        let all = candidates(COMPRESSION_N, false);
        let usual =
            |(test, fe): &(Test, f64)| all.iter().find(|c| c.tests == [*test] && c.flexion_deg == *fe).unwrap().clone();
        let usual: Vec<Candidate> = USUAL.iter().take(chosen.len()).map(usual).collect();
        let promised = mean(&set.spread.iter().map(|s| s.2).collect::<Vec<_>>())
            / mean(&set.spread.iter().map(|s| s.1).collect::<Vec<_>>());
        let (after, _) = self.known(z, number, &as_trials(&chosen))?;
        let (beside, _) = self.known(z, number, &as_trials(&usual))?;
        let names: Vec<String> = chosen.iter().map(|c| format!("{} {}", c.name(), c.flexion_deg)).collect();
        println!("  {} tests: {}", names.len(), names.join(", "));
        let share = |known: &Known| known.sd() / before.sd();
        Some([promised, share(&after), share(&beside), before.score(), after.score(), beside.score()])
    }
}

fn main() {
    let mut all: Vec<String> = std::env::args().skip(1).collect();
    let mut option = |name: &str| all.iter().position(|a| a == name).map(|at| all.drain(at..at + 2).nth(1).unwrap());
    let number = |text: Option<String>, default: f64| text.map_or(default, |t| t.parse().unwrap());
    let (knees, seed) = (number(option("--knees"), 10.0) as usize, number(option("--seed"), 1.0) as u64);
    let (spacing, count) = (number(option("--spacing"), 4.0), number(option("--count"), 6.0) as usize);
    let group = option("--group").unwrap_or("ACL".into());
    let mut options = CalibrateOptions::default();
    options.search.contact_spacing_mm = spacing;
    let knee = made::knee(&all[0], (0.0, 0.0), &options);
    let mut base = made::laxity(&all[1]);
    base.iter_mut().for_each(|t| t.sd = Free::all(None));
    let design = Design::of_model(&knee.spec).unwrap();
    let bench = Bench { knee: &knee, design, options, seed, count, group, base };
    let truths = bench.asked(&[], |question| made::truths(&Posed::of(question).unwrap(), (seed, knees, 1.0)));
    println!("promised, found, usual: share of sd; score before, after, usual [N]");
    let mut found = Vec::new();
    for (k, z) in truths.iter().take(knees).enumerate() {
        match bench.knee(z, k as u64) {
            Some(of) => {
                println!("knee {k}: {}", of.map(|x| format!("{x:.2}")).join(" "));
                found.push(of);
            }
            None => println!("knee {k}: no answer"),
        }
    }
    let means: [f64; 6] = std::array::from_fn(|k| mean(&found.iter().map(|f| f[k]).collect::<Vec<_>>()));
    println!("{} of {knees} knees, seed {seed}; means: {}", found.len(), means.map(|x| format!("{x:.2}")).join(" "));
    // promised and found shares taken off, through the origin
    let slope = found.iter().map(|f| (1.0 - f[0]) * (1.0 - f[1])).sum::<f64>()
        / found.iter().map(|f| (1.0 - f[0]).powi(2)).sum::<f64>();
    println!(
        "found against promised, slope: {slope:.2}; score of chosen less that of usual tests: {:.0} %",
        100.0 * (means[4] / means[5] - 1.0)
    );
}

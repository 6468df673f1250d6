use super::*;
use crate::cost::CostFunction;
use crate::experiment::Answer;
use crate::experiment::Experiment;
use crate::options::LoadPrior;
use crate::targets::{TargetOptions, Targets, targets};
use crate::toy;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sim::SimError;
use sim::coordinate::{FREE, Free};
use sim::spec::PoseSpec;

/// A knee whose measured values are its own answers at `truth` (unit coordinates), with noise.
struct Bench {
    design: Design,
    targets: Targets,
    ct: PoseSpec,
}

fn bench(truth: &[f64], noise: f64, seed: u64) -> Bench {
    let (design, mut trials) = (Design::table3(), toy::trials());
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let sd = Free([0.5, 0.5, 0.4, 0.4, 0.4]);
    for i in 0..trials.len() {
        let p = toy::answer(&design, &trials, &design.at(truth), i).unwrap().predicted;
        for c in FREE {
            trials[i].measured[c] = Some(p[c] + noise * sd[c] * inference::random::normal(&mut random));
        }
    }
    let ct = PoseSpec { si_mm: -20.0, ..PoseSpec::default() };
    let o = CalibrateOptions::default();
    let targets = targets(&trials, &ct, &o.cost, &TargetOptions::default()).unwrap();
    Bench { design, targets, ct }
}

fn truth(seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(1000 + seed);
    (0..26).map(|_| random.random_range(0.0..1.0)).collect()
}

fn quick(method: Method) -> CalibrateOptions {
    let mut o = CalibrateOptions { method, ..CalibrateOptions::default() };
    (o.swarm.swarm_evaluations, o.swarm.simplex_evaluations) = (100, 60);
    o
}

impl Bench {
    fn identity(&self, options: &CalibrateOptions) -> Identity {
        Identity {
            model: "toy".into(),
            start: self.design.at(&[0.5; 26]),
            design: self.design.clone(),
            trials: self.targets.trials.clone(),
            options: options.clone(),
        }
    }

    fn run(&self, options: &CalibrateOptions, watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>) -> Run {
        self.resume(Checkpoint::new(self.identity(options)).unwrap(), options, watch)
    }

    fn resume(
        &self,
        mut checkpoint: Checkpoint,
        options: &CalibrateOptions,
        watch: &mut dyn FnMut(&Checkpoint) -> ControlFlow<()>,
    ) -> Run {
        let simulate = |v: &[f64], _: bool| -> Vec<Result<Answer, SimError>> {
            toy::answers(&self.design, &self.targets.trials, v)
        };
        let experiment = Experiment { design: &self.design, simulate: &simulate, trials: self.targets.trials.len() };
        let cost = CostFunction::new(&self.targets.trials, &self.ct, &options.cost).unwrap();
        let bundles = ["A".to_owned(), "B".to_owned()];
        let problem = Problem::new((experiment, experiment), &self.targets, cost, &bundles, options).unwrap();
        let names = ["first".to_owned()];
        let experiment = Experiment { trials: 1, ..experiment };
        let probes = Probes { experiment, search: experiment, names: &names };
        calibrate(&mut checkpoint, &problem, &probes, watch)
    }
}

type Run = Result<Calibrated, CalibrationError>;

fn go_on(_: &Checkpoint) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[test]
fn interrupted_and_resumed_gives_the_same_bytes() {
    let b = bench(&truth(1), 1.0, 1);
    let mut o = quick(Method::SwarmSimplex);
    o.gradient.samples = 12;
    let whole = b.run(&o, &mut go_on).unwrap();
    for stop_at in [1, 3, 5, 8] {
        let mut steps = 0;
        let mut kept = vec![];
        let stopped = b.run(&o, &mut |c| {
            steps += 1;
            kept = c.to_bytes();
            if steps == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        if stopped.is_ok() {
            break;
        }
        assert_eq!(stopped.unwrap_err(), CalibrationError::Stopped);
        let back = Checkpoint::from_bytes(&kept, &b.identity(&o)).unwrap();
        assert_eq!(
            serde_json::to_vec(&b.resume(back, &o, &mut go_on).unwrap()).unwrap(),
            serde_json::to_vec(&whole).unwrap()
        );
    }
}

#[test]
fn a_checkpoint_of_another_calibration_is_refused_by_what_differs() {
    let b = bench(&truth(1), 1.0, 1);
    let o = quick(Method::SwarmSimplex);
    let bytes = Checkpoint::new(b.identity(&o)).unwrap().to_bytes();
    let other = CalibrateOptions { seed: 9, ..o.clone() };
    let refusal = |identity: &Identity| Checkpoint::from_bytes(&bytes, identity).unwrap_err().to_string();
    assert!(refusal(&b.identity(&other)).contains("other options"));
    assert!(refusal(&bench(&truth(2), 1.0, 2).identity(&o)).contains("other targets"));
    assert!(Checkpoint::from_bytes(&bytes[..bytes.len() / 2], &b.identity(&o)).is_err());
}

#[test]
fn any_number_of_threads_gives_the_same_answer() {
    let b = bench(&truth(3), 1.0, 3);
    let mut o = quick(Method::SwarmSimplex);
    o.gradient.samples = 8;
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| b.run(&o, &mut go_on).unwrap())
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn the_posteriors_old_name_is_taken_and_written_anew() {
    let method: Method = serde_json::from_str("\"gradient\"").unwrap();
    assert_eq!((method, serde_json::to_string(&method).unwrap().as_str()), (Method::Posterior, "\"posterior\""));
    assert!(serde_json::from_str::<Method>("\"descent\"").is_err());
}

#[test]
fn a_belief_about_a_force_is_heard() {
    let mut t = truth(5);
    t[0] = 0.9;
    let b = bench(&t, 1.0, 5);
    let plain = b.run(&quick(Method::SwarmSimplex), &mut go_on).unwrap();
    let belief = LoadPrior {
        bundles: vec!["A".into()],
        test: None,
        nominal_flexion_deg: None,
        mean_n: Some(20.0),
        most_n: None,
        sd_n: 1.0,
        weight: 50.0,
    };
    let o = CalibrateOptions { loads: vec![belief.clone()], ..quick(Method::SwarmSimplex) };
    let told = b.run(&o, &mut go_on).unwrap();
    let force = |c: &Calibrated| c.forces.iter().find(|f| f.bundle == 0).and_then(|f| f.value_n).unwrap();
    assert!((force(&told) - 20.0).abs() < (force(&plain) - 20.0).abs(), "{} {}", force(&told), force(&plain));
    let unknown = LoadPrior { bundles: vec!["Z".into()], ..belief };
    let o = CalibrateOptions { loads: vec![unknown], ..quick(Method::SwarmSimplex) };
    let simulate = |v: &[f64], _: bool| toy::answers(&b.design, &b.targets.trials, v);
    let experiment = Experiment { design: &b.design, simulate: &simulate, trials: b.targets.trials.len() };
    let cost = CostFunction::new(&b.targets.trials, &b.ct, &o.cost).unwrap();
    assert!(Problem::new((experiment, experiment), &b.targets, cost, &["A".to_owned()], &o).is_err());
}

#[test]
fn derivatives_of_residuals_and_beliefs_by_unit_coordinates_are_those_of_their_values() {
    let b = bench(&truth(3), 1.0, 3);
    let belief = LoadPrior {
        bundles: vec!["A".into()],
        test: None,
        nominal_flexion_deg: None,
        mean_n: Some(20.0),
        most_n: None,
        sd_n: 7.0,
        weight: 1.0,
    };
    let mut o = CalibrateOptions { loads: vec![belief], ..quick(Method::SwarmSimplex) };
    o.gradient.robust = 1e9; // no residual is far off: its derivative is its own
    let simulate = |v: &[f64], _: bool| toy::answers(&b.design, &b.targets.trials, v);
    let experiment = Experiment { design: &b.design, simulate: &simulate, trials: b.targets.trials.len() };
    let cost = CostFunction::new(&b.targets.trials, &b.ct, &o.cost).unwrap();
    let bundles = ["A".to_owned(), "B".to_owned()];
    let problem = Problem::new((experiment, experiment), &b.targets, cost, &bundles, &o).unwrap();
    let (unit, scale, step) = (vec![0.4; b.design.len()], Free::all(2.0), 1e-5);
    // residuals, then beliefs; the priors' rows come last
    let rows = |unit: &[f64]| -> Vec<f64> {
        let answers = experiment.answers(&b.design.at(unit), false);
        let predicted: Vec<Option<Free<f64>>> = answers.iter().map(|a| Some(a.as_ref().unwrap().predicted)).collect();
        let z = problem.standardised(&predicted);
        let residuals: Vec<f64> = z.iter().flat_map(|z| z.iter().flatten()).map(|z| z / 2.0).collect();
        let beliefs = answers.iter().map(|a| (a.as_ref().unwrap().forces_n[0] - 20.0) / 7.0).collect();
        [residuals, beliefs].concat()
    };
    let jacobian = problem.jacobian(&unit, &scale).unwrap();
    for k in 0..unit.len() {
        let at = |by: f64| rows(&(0..unit.len()).map(|j| unit[j] + if j == k { by } else { 0.0 }).collect::<Vec<_>>());
        for (i, (up, down)) in at(step).iter().zip(at(-step)).enumerate() {
            let slope = (up - down) / (2.0 * step);
            let told = jacobian[(i, k)];
            assert!((slope - told).abs() < 1e-5 * (1.0 + slope.abs()), "row {i}, variable {k}: {told}, {slope}");
        }
    }
}

/// Of data that scatter by as much as stated, by four times as much in all, and with one reading far off.
#[test]
fn a_recipes_noise_is_what_the_data_scatter_by_and_one_outlier_is_none() {
    let scale = |noise: f64, jump: f64| {
        let mut b = bench(&truth(3), noise, 3);
        if let Some(x) = &mut b.targets.trials[2].measured[FREE[3]] {
            *x += jump;
        }
        let o = quick(Method::SwarmSimplex);
        let simulate = |v: &[f64], _: bool| toy::answers(&b.design, &b.targets.trials, v);
        let experiment = Experiment { design: &b.design, simulate: &simulate, trials: b.targets.trials.len() };
        let cost = CostFunction::new(&b.targets.trials, &b.ct, &o.cost).unwrap();
        let bundles = ["A".to_owned(), "B".to_owned()];
        let problem = Problem::new((experiment, experiment), &b.targets, cost, &bundles, &o).unwrap();
        problem.noise_scale(&truth(3)).unwrap()
    };
    let (plain, wide, jumped) = (scale(1.0, 0.0), scale(4.0, 0.0), scale(1.0, 40.0));
    for c in FREE {
        assert!((1.0..1.3).contains(&plain[c]), "{plain:?}");
        assert!((2.5..5.5).contains(&wide[c]), "{wide:?}");
    }
    assert!(jumped[FREE[3]] < 1.5, "{jumped:?}");
}

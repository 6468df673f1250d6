//! Displacements as an arthrometer reads them: the published deck of Specimen 1 asked for made data.
#![expect(clippy::disallowed_methods, reason = "reads ../shared where it is there")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

use calibration::design::Design;
use calibration::knee::{Knee, SearchOptions, model_at};
use calibration::options::CalibrateOptions;
use calibration::priors::PriorTable;
use calibration::session::{Outcome, Session};
use inference::discrepancy::ModelDiscrepancy;
use inference::frames::term_name;
use inference::knee::{Quantity, Trials};
use inference::parameter::{Parameter, Prior};
use inference::posterior::Forward;
use inference::random::{normal, stream};
use inference::trial::Trial;
use nalgebra::DVector;
use needs_shared::needs_shared;
use sim::coordinate::{AP, FREE, Free, IE, Load, SI};
use sim::laxity::{LaxityTrial, Reference, Test};
use std::ops::ControlFlow;

fn knee(test: &str) -> Option<Knee> {
    let dir = crate::common::shared(test, "published/S192803/deck")?;
    let read = &mut |name: &str| std::fs::read(dir.join(name)).map_err(|e| e.to_string());
    let deck = decks::import("S192803_MAIN_LAXITY_Anterior_30deg_10.inp", read).expect("the deck is read");
    Some(Knee::new(deck.spec, &deck.meshes, &SearchOptions::default()).expect("a model"))
}

fn trial(test: Test, fe_deg: f64, size: f64) -> LaxityTrial {
    let mut load = Load::compression(20.0);
    if let Some(c) = test.coordinate() {
        load[c] = size;
    }
    LaxityTrial::asked(format!("{}_{fe_deg}_{size}", test.name()), test, fe_deg, load)
}

/// Drawer at 30 deg, rotation at 30 and 90 deg, and the trials without load.
fn trials() -> Vec<LaxityTrial> {
    let mut out = vec![trial(Test::Neutral, 30.0, 0.0), trial(Test::Neutral, 90.0, 0.0)];
    out.extend([44.5, 89.0, 134.0].map(|l| trial(Test::Anterior, 30.0, l)));
    for fe in [30.0, 90.0] {
        out.extend([-3.0, -5.0].map(|l| trial(Test::Internal, fe, l)));
        out.extend([3.0, 5.0].map(|l| trial(Test::External, fe, l)));
    }
    out
}

/// Poses as the deck has them with scatter, all coordinates; and what an arthrometer reads of them: one coordinate, from the trial without load.
fn made(knee: &Knee, sd: f64) -> (Vec<LaxityTrial>, Vec<LaxityTrial>) {
    let mut poses = trials();
    let mut random = stream(5, 0);
    for (t, answer) in trials().iter().zip(&mut poses) {
        let found = sim::trials::solve_trial(&knee.model, t, &knee.options).expect("an answer");
        answer.measured = found.predicted().map(|v| Some(v + sd * normal(&mut random)));
        answer.sd = Free::all(Some(sd));
    }
    (poses.clone(), displaced(&poses))
}

fn displaced(poses: &[LaxityTrial]) -> Vec<LaxityTrial> {
    let of = |t: &LaxityTrial| {
        let c = t.test.coordinate()?;
        let zero = poses.iter().find(|z| z.test == Test::Neutral && z.fe_deg == t.fe_deg)?;
        let mut one = t.clone();
        one.measured = Free::all(None);
        one.measured[c] = Some(t.measured[c]? - zero.measured[c]?);
        one.sd[c] = t.sd[c].map(|sd| sd * 2_f64.sqrt());
        one.reference = Some(Reference { trial: zero.trial.clone(), load: zero.load, fe_deg: zero.fe_deg });
        Some(one)
    };
    poses.iter().filter_map(of).collect()
}

fn calibrated(knee: &Knee, trials: &[LaxityTrial], options: &CalibrateOptions) -> Outcome {
    let session = Session::new(&knee.spec, "deck", &[("kt".into(), trials.to_vec())], options).expect("usable targets");
    session.run(knee, session.begin(None).expect("a beginning"), &mut |_| ControlFlow::Continue(())).expect("a fit")
}

fn quick() -> CalibrateOptions {
    let mut options = CalibrateOptions::default();
    (options.inference.starts, options.inference.finalists, options.inference.samples) = (2, 2, 16);
    options
}

/// Every turn and shift of the frames, of knees loaded in three ways, beside differences of knees solved again.
#[needs_shared]
fn derivatives_by_frames_are_those_of_knees_solved_again() {
    let Some(knee) = knee("derivatives_by_frames") else { return };
    let turned = |term| Parameter {
        name: term_name(term),
        quantity: Quantity::Frame(None, term),
        prior: Prior::Normal { mean: 0.0, sd: 1.0 },
    };
    let parameters: Vec<_> = (0..12).map(turned).collect();
    let asked = |vv: f64, ie, ap| {
        let load = Load::new(vv, ie, 0.0, ap, 20.0);
        let trial = Trial::alone(LaxityTrial::asked(String::new(), Test::Neutral, 30.0, load));
        Trial { reads: Free::all(true), ..trial }
    };
    let trials = [asked(0.0, 0.0, 134.0), asked(8.0, 0.0, 0.0), asked(0.0, -5.0, 0.0)];
    let model = knee.search_model().with_friction(0.0).expect("a model");
    let asks = Trials {
        model: &model,
        spec: &knee.spec,
        parameters: &parameters,
        trials: &trials,
        beliefs: &[],
        options: knee.search_options(),
        load_sd: Load::new(0.1, 0.1, 2.0, 2.0, 2.0),
        discrepancy: ModelDiscrepancy {
            sd: Load(Free::all(1.0)),
            flexion_deg: 25.0,
            load: Load::new(6.0, 3.0, 60.0, 60.0, 60.0),
        },
        on_fit: None,
    };
    let z = DVector::from_fn(12, |k, _| [0.5, -0.8, 1.1][k % 3]);
    let point = asks.at(&z, None).expect("an answer");
    let mut worst: f64 = 0.0;
    for k in 0..12 {
        let moved = |by: f64| {
            let mut z = z.clone();
            z[k] += by;
            asks.at(&z, None).expect("an answer").reading
        };
        let numeric = (moved(0.1) - moved(-0.1)) / 0.2;
        for (row, wanted) in numeric.iter().enumerate() {
            let found = point.jacobian[(row, k)];

            worst = worst.max((found - wanted).abs() / (1.0 + wanted.abs()));
        }
    }
    println!("worst {worst}");
    assert!(worst < 0.02, "{worst}");
}

/// The reading of the deck and its derivatives, beside the difference of its poses and differences of readings.
#[needs_shared]
fn a_displacement_is_the_difference_of_two_poses_and_its_slopes_are_right() {
    let Some(knee) = knee("a_displacement_is_the_difference_of_two_poses") else { return };
    let normal =
        |name: &str, quantity, sd| Parameter { name: name.into(), quantity, prior: Prior::Normal { mean: 0.0, sd } };
    let strain = Prior::Normal { mean: 1.0, sd: 0.02 };
    let parameters = [
        Parameter { name: "strain".into(), quantity: Quantity::ReferenceStrain(vec![0]), prior: strain },
        normal("turn", Quantity::Frame(None, 8), 2.0),
        normal("tone", Quantity::Resting(0, SI), 30.0),
        normal("weight", Quantity::Resting(0, AP), 10.0),
        Parameter { name: "give".into(), quantity: Quantity::Compliance(0, AP), prior: Prior::HalfNormal { sd: 0.02 } },
        Parameter {
            name: "pressure".into(),
            quantity: Quantity::ContactScale,
            prior: Prior::LogNormal { median: 1.0, log_sd: 1.0 },
        },
    ];
    let asked = |ap: f64, from| {
        let load = Load::new(0.0, 0.0, 0.0, ap, 20.0);
        let alone = Trial::alone(LaxityTrial::asked(String::new(), Test::Neutral, 30.0, load));
        Trial { source: Some(0), reads: Free::all(ap != 0.0), from, ..alone }
    };
    let of = |trials: &[Trial], z: &DVector<f64>| {
        let trials = Trials {
            model: &knee.search_model().with_friction(0.0).expect("a model"),
            spec: &knee.spec,
            parameters: &parameters,
            trials,
            beliefs: &[],
            options: knee.search_options(),
            load_sd: Load::new(0.1, 0.1, 2.0, 2.0, 2.0),
            discrepancy: ModelDiscrepancy {
                sd: Load(Free::all(1.0)),
                flexion_deg: 25.0,
                load: Load::new(6.0, 3.0, 60.0, 60.0, 60.0),
            },
            on_fit: None,
        };
        let point = trials.at(z, None).expect("an answer");
        let scatter = trials.scatter(&point.state).expect("a covariance");
        (point, scatter)
    };
    // a contact far from the model's own: by how much it changes depends on where it stands
    let z = DVector::from_vec(vec![0.2, 0.1, 0.4, -0.3, 0.1, -1.0]);
    let pair = [asked(134.0, Some(1)), asked(0.0, None)];
    let (point, scatter) = of(&pair, &z);
    let give = parameters[4].prior.at(z[4]).0;
    for c in FREE {
        let poses = point.state[0].predicted[c] - point.state[1].predicted[c];
        let gives = if c == AP { 134.0 * give } else { 0.0 };
        assert!((point.reading[c.free_index()] - poses - gives).abs() < 1e-9, "{c}");
    }
    assert!(scatter.clone().symmetric_eigenvalues().min() > -1e-9);
    for k in 0..z.len() {
        // contact nodes come and go as pressures change: a step short of that
        let h = if parameters[k].quantity == Quantity::ContactScale { 0.005 } else { 0.02 };
        let moved = |by: f64| {
            let mut z = z.clone();
            z[k] += by;
            of(&pair, &z).0.reading
        };
        let numeric = (moved(h) - moved(-h)) / (2.0 * h);
        for c in FREE {
            let (found, wanted) = (point.jacobian[(c.free_index(), k)], numeric[c.free_index()]);
            assert!(
                (found - wanted).abs() < 0.02 + 0.05 * wanted.abs(),
                "{} {c}: {found} {wanted}",
                parameters[k].name
            );
        }
    }
    // what both trials of a pair share falls out of the scatter: the same trial twice has none
    let (_, twice) = of(
        &[Trial { from: Some(1), ..asked(134.0, None) }, Trial { reads: Free::all(false), ..asked(134.0, None) }],
        &z,
    );
    assert!(twice[(3, 3)] < 0.2 * scatter[(3, 3)], "{} {}", twice[(3, 3)], scatter[(3, 3)]);
}

#[needs_shared]
fn a_constant_in_both_poses_changes_nothing_and_both_kinds_of_reading_agree() {
    let Some(knee) = knee("a_constant_in_both_poses_changes_nothing") else { return };
    let (poses, readings) = made(&knee, 0.3);
    let mut shifted = poses.clone();
    shifted.iter_mut().flat_map(|t| t.measured.iter_mut()).for_each(|m| *m = m.map(|v| v + 4.0));
    for (a, b) in displaced(&shifted).iter().zip(&readings) {
        let c = a.test.coordinate().expect("a loaded trial");
        assert!((a.measured[c].expect("read") - b.measured[c].expect("read")).abs() < 1e-9);
    }
    let mut options = quick();
    let truth = knee.model.bundle_names().len();
    let absolute = calibrated(&knee, &poses, &options);
    (options.rig.offset, options.rig.compliance, options.rig.resting) =
        (Free::all(0.0), Free::all(0.0), Load::default());
    let difference = calibrated(&knee, &readings, &options);
    assert_eq!(difference.found.predicted.len(), readings.len());
    let mut apart = Vec::new();
    for (a, d) in absolute.found.forces.iter().zip(&difference.found.forces) {
        assert_eq!((&a.trial, a.bundle), (&d.trial, d.bundle));
        let [of_a, of_d] = [a, d].map(|f| f.interval_n.map(|[lower, upper]| upper - lower).expect("an interval"));
        let width = of_a.hypot(of_d) / 3.29;
        let gap = a.value_n.expect("a value") - d.value_n.expect("a value");
        apart.push(gap / width.max(3.0));
    }
    let rms = (apart.iter().map(|x| x * x).sum::<f64>() / apart.len() as f64).sqrt();
    println!("{} forces of {truth} bundles differ by {rms:.2} of their standard deviations", apart.len());
    assert!(rms < 1.2, "{rms}");
}

/// Readings with a noise of 500 deg and mm remove nothing of a variance, and no share is told. With their own noise they remove something.
#[needs_shared]
fn of_readings_that_say_nothing_no_share_is_told() {
    let Some(knee) = knee("of_readings_that_say_nothing_no_share_is_told") else { return };
    let (poses, _) = made(&knee, 0.3);
    let mut options = quick();
    options.inference.samples = CalibrateOptions::default().inference.samples;
    let told = |sd: f64| {
        let trials: Vec<LaxityTrial> =
            poses.iter().map(|t| LaxityTrial { sd: Free::all(Some(sd)), ..t.clone() }).collect();
        let found = calibrated(&knee, &trials, &options).found;
        let mean = calibration::posterior::mean;
        let forces: Vec<f64> = found.forces.iter().map(|f| f.determined).collect();
        let parameters: Vec<f64> = found.parameters.iter().map(|p| p.determined).collect();
        let signed = found.forces.iter().all(|f| f.determined == 0.0 || f.removed == Some(f.determined));
        assert!(signed, "a share is told as it is, or not at all");
        println!("noise {sd}: forces {:.3}, parameters {:.3}", mean(&forces), mean(&parameters));
        [mean(&forces), mean(&parameters)]
    };
    let (nothing, something) = (told(500.0), told(0.3));
    assert!(nothing.iter().all(|share| *share < 0.05), "{nothing:?}");
    assert!(something[0] > 2.0 * nothing[0].max(0.02), "{something:?} beside {nothing:?}");
}

/// One drawer and rotation at two flexions: no parameter at a bound, and a bundle that nothing loads keeps its prior.
#[needs_shared]
fn few_displacements_move_what_they_touch_and_no_more() {
    let Some(knee) = knee("few_displacements_move_what_they_touch") else { return };
    let (_, readings) = made(&knee, 0.3);
    let few: Vec<LaxityTrial> = readings
        .into_iter()
        .filter(|t| t.load[AP].abs() > 100.0 || t.load[IE].abs() > 4.0)
        .map(|t| LaxityTrial { sd: Free::all(None), ..t })
        .collect();
    assert_eq!(few.len(), 5);
    let options = CalibrateOptions { priors: PriorTable::None, ..quick() };
    let outcome = calibrated(&knee, &few, &options);
    let names = knee.model.bundle_names();
    let unloaded = few.iter().filter_map(LaxityTrial::unloaded);
    let design = Design::of_model(&knee.spec).expect("bundles of Table 3");
    let found = model_at(&knee.model, &design, &outcome.found.values).expect("a model");
    let mut most = vec![0.0_f64; names.len()];
    for t in few.iter().cloned().chain(unloaded) {
        let answer = sim::trials::solve_trial(&found, &t, &knee.options).expect("an answer");
        most.iter_mut().zip(&answer.forces_n).for_each(|(m, f)| *m = m.max(*f));
    }
    for p in &outcome.found.parameters {
        let (low, high) = (p.range[0], p.range[1]);
        let share = (p.value - low) / (high - low);
        assert!((0.01..=0.99).contains(&share), "{} {} is at a bound: {share:.3}", p.bundle, p.kind.name());
        let touched = names.iter().zip(&most).any(|(n, f)| n.starts_with(&p.bundle) && *f > 0.0);
        if !touched {
            println!("{} {}: {share:.2} of its range, {:.2} by the data", p.bundle, p.kind.name(), p.determined);
            assert!((share - 0.5).abs() < 0.15, "{} {} moved to {share:.2}", p.bundle, p.kind.name());
        }
    }
    let told: Vec<&str> = outcome.found.others.iter().map(|o| o.name.as_str()).collect();
    for name in ["kt.compliance.ap_mm_per_n", "kt.compliance.ie_deg_per_nm", "kt.resting.si_n"] {
        assert!(told.contains(&name), "{name} is not told: {told:?}");
    }
    assert!(!told.iter().any(|n| n.contains("compliance.vv")), "nothing is read of varus");
}

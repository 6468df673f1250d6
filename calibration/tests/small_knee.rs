//! Calibration of the small knee of tests/corpus to data that it made itself: its ligaments are known.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]

#[path = "../../tests/common/knee.rs"]
mod knee;

use calibration::design::Kind;
use calibration::knee::{Knee, SearchOptions};
use calibration::options::CalibrateOptions;
use calibration::session::{Outcome, Session};
use inference::random::{normal, stream};
use sim::coordinate::{FREE, Free, IE, Load};
use sim::laxity::{LaxityTrial, Test};
use sim::spec::ModelSpec;
use std::ops::ControlFlow;

/// Noise of made readings [deg, mm].
const NOISE: f64 = 0.3;
/// Joint compression in every trial [N].
const COMPRESSION_N: f64 = 50.0;

/// The knee with its ligaments changed. Without friction, which remembers the path.
fn with(change: impl Fn(&mut ModelSpec)) -> Knee {
    let (mut spec, meshes) = knee::small();
    spec.contact.friction = 0.0;
    change(&mut spec);
    Knee::new(spec, &meshes, &SearchOptions::default()).unwrap()
}

/// Drawers, rotations and moments at 30 and 60 deg.
fn trials() -> Vec<LaxityTrial> {
    let mut out = Vec::new();
    for fe in [30.0, 60.0] {
        for (test, size) in [
            (Test::Anterior, 60.0),
            (Test::Anterior, 100.0),
            (Test::Posterior, -100.0),
            (Test::Internal, -3.0),
            (Test::External, 3.0),
            (Test::Varus, -6.0),
            (Test::Valgus, 6.0),
        ] {
            let mut load = Load::compression(COMPRESSION_N);
            load[test.coordinate().unwrap()] = size;
            out.push(LaxityTrial::asked(format!("{}_{fe}_{size}", test.name()), test, fe, load));
        }
    }
    out
}

/// What a knee answers, with noise that is stated as `sd`.
fn measured(knee: &Knee, sd: f64) -> Vec<LaxityTrial> {
    let mut random = stream(5, 0);
    let answer = |mut t: LaxityTrial| {
        let found = sim::trials::solve_trial(&knee.model, &t, &knee.options).unwrap();
        t.measured = found.predicted().map(|v| Some(v + NOISE * normal(&mut random)));
        t.sd = Free::all(Some(sd));
        t
    };
    trials().into_iter().map(answer).collect()
}

fn calibrated(knee: &Knee, trials: &[LaxityTrial], samples: usize) -> Outcome {
    let mut options = CalibrateOptions::default();
    (options.inference.starts, options.inference.finalists, options.inference.samples) = (2, 2, samples);
    let session = Session::new(&knee.spec, "small", &[("kt".into(), trials.to_vec())], &options).unwrap();
    session.run(knee, session.begin(None).unwrap(), &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Root mean square of what a knee answers beside what was measured [deg, mm].
fn misses(knee: &Knee, measured: &[LaxityTrial]) -> Free<f64> {
    let off = |t: &LaxityTrial| {
        let found = sim::trials::solve_trial(&knee.model, t, &knee.options).unwrap().predicted();
        Free::from_fn(|c| found[c] - t.measured[c].unwrap())
    };
    let all: Vec<Free<f64>> = measured.iter().map(off).collect();
    Free::from_fn(|c| (all.iter().map(|o| o[c] * o[c]).sum::<f64>() / all.len() as f64).sqrt())
}

/// Fails where a derivative by a ligament has the wrong sign, a search stops early, or intervals are those of the prior about a wrong middle.
#[test]
fn from_other_ligaments_the_data_are_met_and_the_intervals_hold_the_true_ones() {
    let truth = with(|_| ());
    let other = with(|spec| {
        for b in &mut spec.bundles {
            (b.reference_strain, b.stiffness_n_per_mm) = (1.0, 1.15 * b.stiffness_n_per_mm);
        }
    });
    let data = measured(&truth, NOISE);
    let (before, found) = (misses(&other, &data), calibrated(&other, &data, 16).found);
    println!("before {before:?}, after {:?}", found.rms);
    assert!(before[IE] > 3.0, "the knee began too near to its answer: {before:?}");
    for c in FREE {
        assert!(found.rms[c].unwrap() < 1.0, "{c}: {:?}, before {before:?}", found.rms);
    }
    let strains = found.parameters.iter().filter(|p| p.kind == Kind::ReferenceStrain);
    let held = strains.clone().filter(|p| {
        let own = truth.spec.bundles.iter().find(|b| b.name == p.bundle).unwrap().reference_strain;
        (p.lower..=p.upper).contains(&own)
    });
    // of 90 % intervals, one or two may miss
    let (held, all) = (held.count(), strains.count());
    assert!(all == 14 && held >= 11, "{held} of {all}");
}

/// Fails where a share of what the data say is told though they say nothing: the prior's own narrowness, or chance.
#[test]
fn of_readings_that_say_nothing_no_share_is_told() {
    let knee = with(|_| ());
    let told = |sd: f64| {
        let found = calibrated(&knee, &measured(&knee, sd), CalibrateOptions::default().inference.samples).found;
        let signed = found.forces.iter().all(|f| f.determined == 0.0 || f.removed == Some(f.determined));
        assert!(signed, "a share is told as it is, or not at all");
        let forces: Vec<f64> = found.forces.iter().map(|f| f.determined).collect();
        let parameters: Vec<f64> = found.parameters.iter().map(|p| p.determined).collect();
        [forces, parameters].map(|shares| calibration::posterior::mean(&shares))
    };
    let (nothing, something) = (told(500.0), told(NOISE));
    println!("forces and parameters: {nothing:?}, {something:?}");
    assert!(nothing.iter().all(|share| *share < 0.05), "{nothing:?}");
    assert!(something[0] > 2.0 * nothing[0].max(0.02), "{something:?} beside {nothing:?}");
}

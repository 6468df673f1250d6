//! What is in no catalogue, told as what it is: bones of another size, swaying trackers, impinging cruciates, a moment near extension.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::asked::asked;
use crate::common::deck::deck;
use diagnosis::discrepancy::suspects::{SHARE, SWAY, impinging, larger, pulls, swayed};
use diagnosis::discrepancy::{Bone, Course, Discrepancy, discrepancy};
use diagnosis::problem::{Problem, reading};
use diagnosis::search::{DiagnosisOptions, Searcher};
use needs_shared::needs_shared;
use sim::coordinate::{AP, Coordinate, FE, FREE, IE, ML, SI, Six, VV};

pub(crate) const TRIALS: [(&str, f64, [f64; 4]); 12] = [
    ("neutral", 0.0, [0.0; 4]),
    ("neutral", 30.0, [0.0; 4]),
    ("neutral", 60.0, [0.0; 4]),
    ("anterior", 15.0, [0.0, 0.0, 0.0, 80.0]),
    ("anterior", 60.0, [0.0, 0.0, 0.0, 80.0]),
    ("posterior", 15.0, [0.0, 0.0, 0.0, -80.0]),
    ("posterior", 60.0, [0.0, 0.0, 0.0, -80.0]),
    ("internal", 0.0, [0.0, 3.0, 0.0, 0.0]),
    ("internal", 30.0, [0.0, 3.0, 0.0, 0.0]),
    ("external", 30.0, [0.0, -3.0, 0.0, 0.0]),
    ("valgus", 30.0, [6.0, 0.0, 0.0, 0.0]),
    ("varus", 30.0, [-6.0, 0.0, 0.0, 0.0]),
];

fn problem() -> Option<Problem> {
    deck("suspects", &asked(&TRIALS, &[[0.0, 0.0, 0.0, 0.0, -21.0]; 12]))
}

/// The question of the same knee whose readings are what `misread` makes of the model's, and a little off.
fn measured(problem: &Problem, loads: &dyn Fn(usize) -> Six, misread: &dyn Fn(usize, &Six) -> Six) -> Problem {
    let mut other = problem.clone();
    for (i, t) in other.trials.iter_mut().enumerate() {
        let by = loads(i);
        FREE.into_iter().for_each(|c| t.record.load[c] += by[c] / c.to_force(1.0));
    }
    let rests = other.rests(&[], &vec![0.0; other.nuisances()], &[]).unwrap();
    let readings: Vec<[f64; 5]> = rests
        .iter()
        .enumerate()
        .map(|(i, rest)| {
            let gs = problem.model.joint.grood_suntay(&rest.q);
            let wrong = misread(i, &gs);
            let read = reading(rest);
            FREE.map(|c| {
                let unit = c.to_solver(1.0);
                read[c] + wrong[c] / unit + 0.1 * (5.0 * i as f64 + 1.3 * c.free_index() as f64).sin()
            })
        })
        .collect();
    deck("suspects", &asked(&TRIALS, &readings)).unwrap()
}

fn told(problem: &Problem) -> (Discrepancy, String) {
    let options = DiagnosisOptions { most_effects: 1, ..DiagnosisOptions::default() };
    let search = Searcher { problem, options: &options }.search().unwrap();
    let field = discrepancy(problem, (&search.readings, &search.covariance), &search.base).unwrap();
    let words = field.words(problem);
    (field, words)
}

#[needs_shared]
fn a_knee_all_of_whose_lengths_are_larger_rests_as_much_farther_apart_and_turns_no_further() {
    let Some(problem) = problem() else { return };
    let rests = problem.rests(&[], &vec![0.0; problem.nuisances()], &[]).unwrap();
    for (trial, rest) in problem.trials.iter().zip(&rests).take(3) {
        let here = problem.place.situation(&problem.model, trial, &trial.load(), &rest.q);
        let mut force = larger(&here, true);
        force[FE] = 0.0;
        let moved = rest.tangent.try_inverse().unwrap() * force;
        let gs = problem.model.joint.grood_suntay(&rest.q);
        let then = problem.model.joint.grood_suntay(&(rest.q + moved));
        for j in [ML, AP, SI] {
            let by = then[j] - gs[j];
            assert!((by - SHARE * gs[j]).abs() < 0.04, "{}: {j} by {by}, {}", trial.record.trial, SHARE * gs[j]);
        }
        for j in [VV, IE] {
            assert!((then[j] - gs[j]).abs() < 0.006, "{}: {j} by {}", trial.record.trial, then[j] - gs[j]);
        }
    }
}

#[test]
fn a_tracker_sways_with_the_size_of_the_load_alone() {
    let gs = Six::new(0.6, 0.05, -0.2, 1.0, 8.0, -21.0);
    let under = |size: f64| swayed(&gs, &Six::new(0.0, 5000.0 * size, 0.0, 0.0, 0.0, 50.0), Bone::Femur);
    assert!(under(0.0).iter().all(|by| by.amax() < 1e-12));
    for k in 0..3 {
        assert!((under(1.0)[k] - under(-1.0)[k]).amax() < 1e-12);
        assert!((under(2.0)[k] - under(1.0)[k] * 2.0).amax() < 1e-12);
    }
    // about its medial axis a bone's frame misreads flexion alone
    let by = under(1.0)[2];
    assert!((by[FE] - SWAY.to_radians()).abs() < 1e-9 && by.rows(1, 5).amax() < 1e-12, "{by}");
}

#[needs_shared]
fn cruciates_that_press_on_each_other_have_an_energy_and_are_left_alone_where_they_are_clear() {
    let Some(problem) = problem() else { return };
    let trial = &problem.trials[1];
    let force = |q: &Six, from: f64| impinging(&problem.place.situation(&problem.model, trial, &trial.load(), q), from);
    assert_eq!(force(&trial.unloaded.q, -20.0), Six::zeros());
    let q = trial.unloaded.q;
    assert!(force(&q, 25.0).amax() > 1.0, "{}", force(&q, 25.0));
    let slope = |j: Coordinate| {
        let h = if j.turns() { 1e-3 } else { 0.05 };
        let mut step = Six::zeros();
        step[j] = h;
        (force(&(q + step), 25.0) - force(&(q - step), 25.0)) / (2.0 * h)
    };
    for (j, k) in [(VV, IE), (IE, AP), (AP, SI), (ML, IE)] {
        let (one, other) = (slope(j)[k], slope(k)[j]);
        assert!((one - other).abs() < 0.02 * one.abs().max(other.abs()) + 0.5, "{j} {k}: {one}, {other}");
    }
    // thicker ones push in the same direction, which moves the lines apart
    let apart = force(&q, 26.0) - force(&q, 25.0);
    let distance = |q: &Six| {
        let by = force(q, 26.0) - force(q, 25.0);
        25.0 - force(q, 25.0).dot(&by) / by.norm_squared()
    };
    let step = apart * (0.05 / apart.norm());
    assert!(distance(&q) > 3.0 && distance(&(q + step)) > distance(&q), "{}", distance(&q));
    assert!(force(&q, 25.0).normalize().dot(&apart.normalize()) > 0.999);
}

#[needs_shared]
fn a_pull_toward_the_thigh_presses_the_joint_and_closes_the_side_that_it_passes() {
    let Some(problem) = problem() else { return };
    for bone in [Bone::Femur, Bone::Tibia] {
        let at = |i: usize| {
            let trial = &problem.trials[i];
            pulls(&problem.place.situation(&problem.model, trial, &trial.load(), &trial.unloaded.q), bone)
        };
        let [middle, medial, anterior] = at(0);
        assert!(middle[SI] > 55.0 && middle[SI] <= 60.1, "{middle}");
        // 60 N, 25 mm medially: varus; anteriorly no moment but that of flexion
        assert!((medial[VV] + 1500.0).abs() < 150.0 && anterior[VV].abs() < 150.0, "{medial} {anterior}");
    }
    // in flexion the thigh lies behind the tibia
    let trial = &problem.trials[2];
    let bent = problem.place.situation(&problem.model, trial, &trial.load(), &trial.unloaded.q);
    assert!(pulls(&bent, Bone::Femur)[0][AP] < -30.0 && pulls(&bent, Bone::Tibia)[0][AP].abs() < 20.0);
}

#[needs_shared]
fn a_pull_along_a_line_of_no_name_is_told_as_one() {
    let Some(problem) = problem() else { return };
    let pull = |i: usize| {
        let trial = &problem.trials[i];
        let here = problem.place.situation(&problem.model, trial, &trial.load(), &trial.unloaded.q);
        let [middle, medial, _] = pulls(&here, Bone::Femur);
        middle * 2.5 + medial * 3.0
    };
    let pulled = measured(&problem, &pull, &|_, _| Six::zeros());
    let (field, words) = told(&pulled);
    assert_eq!(field.course, Course::Pull(Bone::Femur), "{words}");
    assert!(field.log_bayes_factor > 4.5 && words.contains("pulled the tibia along the thigh"), "{words}");
}

#[needs_shared]
fn a_tracker_that_sways_is_told_as_one() {
    let Some(problem) = problem() else { return };
    let loads: Vec<Six> = problem.trials.iter().map(|t| t.load()).collect();
    let swaying = measured(&problem, &|_| Six::zeros(), &|i, gs| swayed(gs, &loads[i], Bone::Femur)[1] * 1.5);
    let (field, words) = told(&swaying);
    assert_eq!(field.course, Course::Sway(Bone::Femur), "{words}");
    assert!(field.log_bayes_factor > 10.0 && words.contains("the femur's tracker swayed"), "{words}");
}

#[needs_shared]
fn a_moment_near_extension_is_told_as_one() {
    let Some(problem) = problem() else { return };
    let flexions: Vec<f64> = problem.trials.iter().map(|t| t.flexion().to_degrees()).collect();
    let home = |i: usize| Six::new(0.0, 0.0, 2500.0 * (1.0 - flexions[i] / 45.0).max(0.0), 0.0, 0.0, 0.0);
    let turned = measured(&problem, &home, &|_, _| Six::zeros());
    let (field, words) = told(&turned);
    assert_eq!(field.course, Course::Near { bent: false }, "{words}");
    assert!(field.log_bayes_factor > 4.5 && words.contains("internal-external rotation"), "{words}");
}

#[needs_shared]
fn a_ct_of_a_wrong_scale_is_told_as_one() {
    let Some(problem) = problem() else { return };
    let wide = |_: usize, gs: &Six| Six::new(0.0, 0.0, 0.0, gs[ML], gs[AP], gs[SI]) * 0.05;
    let scaled = measured(&problem, &|_| Six::zeros(), &wide);
    let (field, words) = told(&scaled);
    assert!(matches!(field.course, Course::Larger { .. }), "{words}");
    assert!((SHARE * field.amounts[0] - 0.05).abs() < 0.015, "{words}");
}

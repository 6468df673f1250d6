//! How the patellar tendon and the weight of the shank pull, on the published deck.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{deck, question};
use diagnosis::effect::Active;
use diagnosis::effect::candidate::Scope;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::Problem;
use needs_shared::needs_shared;
use sim::coordinate::{AP, IE, ML, SI, Six, VV};

const FLEXIONS: [f64; 4] = [0.0, 30.0, 60.0, 90.0];

fn problem() -> Option<Problem> {
    deck("pulls", &FLEXIONS.map(|f| ("unloaded", "neutral", f, [0.0; 4], [0.0, 0.0, 0.0, 0.0, -21.0])))
}

#[needs_shared]
fn it_pulls_forward_near_extension_backward_in_flexion_and_back_into_the_groove() {
    let Some(problem) = problem() else { return };
    let catalogue = Catalogue::shipped();
    let (effect, variant) = catalogue.find("quad_passive").unwrap();
    let tendon = Active::new(effect, variant, &[100.0, 0.0, 0.0]).unwrap();
    for (trial, flexion) in problem.trials.iter().zip(FLEXIONS) {
        let force =
            |q: &sim::coordinate::Six| tendon.force(&problem.place.situation(&problem.model, trial, &trial.load(), q));
        let at_rest = force(&trial.unloaded.q);
        // against the shaft, [riener1999]: 20 deg forward in extension, 8 deg backward at 90 deg
        let forward = 100.0 * (20.0 - 28.0 * flexion / 90.0).to_radians().sin();
        assert!((at_rest[AP] - forward).abs() < 4.0, "{flexion} deg: {} N, {forward} N", at_rest[AP]);
        assert!(at_rest[SI] > 85.0, "{flexion} deg: {} N up", at_rest[SI]);
        // in a knee whose tendon stands 6 deg further forward
        let other = Active::new(effect, variant, &[100.0, 6.0, 0.0]).unwrap().force(&problem.place.situation(
            &problem.model,
            trial,
            &trial.load(),
            &trial.unloaded.q,
        ));
        let turned = (other[AP].atan2(other[SI]) - at_rest[AP].atan2(at_rest[SI])).to_degrees();
        assert!((turned - 6.0).abs() < 0.5, "{flexion} deg: {turned} deg further forward");
        // a tibia that has slipped aside, or turned, is drawn back
        for (k, by, stiffness) in [(ML, 2.0, 100.0 / 45.0), (IE, 0.05, 100.0 * 32.0 * 32.0 / 45.0)] {
            let mut moved = trial.unloaded.q;
            moved[k] += by;
            let back = (at_rest[k] - force(&moved)[k]) / by;
            assert!(back > 0.5 * stiffness && back < 2.0 * stiffness, "{flexion} deg, coordinate {k}: {back}");
        }
    }
}

#[needs_shared]
fn below_the_groove_it_hardly_turns_the_tibia_and_beside_it_to_the_other_side() {
    let Some(problem) = problem() else { return };
    let catalogue = Catalogue::shipped();
    let (effect, variant) = catalogue.find("quad_passive").unwrap();
    for (trial, flexion) in problem.trials.iter().zip(FLEXIONS) {
        let turns = |lateral: f64| {
            let tendon = Active::new(effect, variant, &[100.0, 0.0, lateral]).unwrap();
            tendon.force(&problem.place.situation(&problem.model, trial, &trial.load(), &trial.unloaded.q))[IE]
        };
        let beside = [-8.0, 8.0].map(|lateral| turns(lateral) - turns(0.0));
        // drawn back to the groove by 8 of 45 mm, at 32 mm in front of the axis: 569 N mm, and the forward part of the pull on a lever of 8 mm
        assert!(beside[0] * beside[1] < 0.0, "{flexion} deg: {beside:?} N mm");
        assert!(beside.iter().all(|m| (300.0..1100.0).contains(&m.abs())), "{flexion} deg: {beside:?} N mm");
    }
}

#[needs_shared]
fn the_weight_of_the_shank_pulls_with_the_sine_of_flexion_and_turns_by_its_lever_alone() {
    let Some(problem) = problem() else { return };
    let catalogue = Catalogue::shipped();
    let (effect, variant) = catalogue.find("gravity").unwrap();
    for (trial, flexion) in problem.trials.iter().zip(FLEXIONS) {
        let force = |weight: f64, lever: f64| {
            let gravity = Active::new(effect, variant, &[weight, lever]).unwrap();
            gravity.force(&problem.place.situation(&problem.model, trial, &trial.load(), &trial.unloaded.q))
        };
        let pulled = force(12.0, 70.0);
        assert!((pulled[AP] + 12.0 * flexion.to_radians().sin()).abs() < 1e-3, "{flexion} deg: {}", pulled[AP]);
        assert!((pulled[VV] - 840.0).abs() < 1e-9, "{flexion} deg: {} N mm", pulled[VV]);
        // no weight, no moment
        assert_eq!(force(0.0, 70.0).norm(), 0.0);
    }
}

#[needs_shared]
fn a_weight_that_no_shank_has_is_none() {
    let Some(problem) = problem() else { return };
    let gravity = problem.candidates().into_iter().find(|c| c.effect.id == "gravity").unwrap();
    let sd = gravity.effect.parameter[0].sd;
    assert!(gravity.is_small_enough(&[45.0 / sd, 1.0]));
    assert!(!gravity.is_small_enough(&[80.0 / sd, 0.0]));
    // other sizes have no end: a laboratory may be off by any flexion
    let offset = problem.candidates().into_iter().find(|c| c.effect.id == "flexion_offset").unwrap();
    assert!(offset.is_small_enough(&[8.0]));
}

#[needs_shared]
fn a_missing_structure_is_taut_in_the_ct_pose_where_its_fits_start() {
    let Some(problem) = problem() else { return };
    let trial = &problem.trials[0];
    let here = problem.place.situation(&problem.model, trial, &trial.load(), &Six::zeros());
    let lines: Vec<_> = problem.candidates().into_iter().filter(|c| c.effect.id == "extra_bundle").collect();
    assert!(lines.iter().map(|c| c.variant).max() == Some(4));
    for line in lines {
        assert!(line.active(&line.typical()).force(&here).norm() > 10.0, "variant {}", line.variant);
        // screened there it is felt, though it is nothing
        let mut little = line.nothing();
        assert_eq!(line.active(&little).force(&here).norm(), 0.0);
        little[0] = 1e-3;
        assert!(line.active(&little).force(&here).norm() > 0.0, "variant {}", line.variant);
    }
}

#[needs_shared]
fn menisci_are_of_the_knee_and_a_bias_of_a_laboratory() {
    let asked = FLEXIONS.map(|f| ("unloaded", "neutral", f, [0.0; 4], [0.0, 0.0, 0.0, 0.0, -21.0]));
    let Some(problem) = question("pulls", &[("kla", &asked), ("rks", &asked)]) else { return };
    let scopes = |id: &str| -> Vec<Scope> {
        problem.candidates().iter().filter(|c| c.effect.id == id && c.variant == 0).map(|c| c.scope).collect()
    };
    assert_eq!(scopes("meniscus"), [Scope::Both]);
    assert_eq!(scopes("load_bias"), [Scope::Both, Scope::Only(0), Scope::Only(1)]);
    // skin and capsule may have been taken off between two tests
    assert_eq!(scopes("capsule_envelope").len(), 3);
}

//! Where trials rest that a hypothesis throws out of the joint.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, deck};
use calibration::design::Kind;
use diagnosis::effect::Active;
use diagnosis::effect::bench::Bench;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::covariance::{Floor, remainders};
use diagnosis::problem::{Problem, reading};
use nalgebra::Matrix6;
use needs_shared::needs_shared;
use sim::coordinate::{Six, VV};
use sim::equilibrium::{Equilibrium, Start, starts_of};

/// The published deck under 10 N m of varus and of valgus at 30, 60 and 90 deg, measured where the deck itself rests.
fn problem() -> Option<Problem> {
    problem_off(0.0)
}

/// The same, measured `varus` degrees from where the deck rests.
fn problem_off(varus: f64) -> Option<Problem> {
    let at = |measured: &[[f64; 5]]| {
        let asked: Vec<Asked> = TRIALS
            .iter()
            .zip(measured)
            .map(|(&(name, flexion, moment), &m)| (name, "varus", flexion, [moment, 0.0, 0.0, 0.0], m))
            .collect();
        deck("rests", &asked)
    };
    let anywhere = at(&[[0.0; 5]; TRIALS.len()])?;
    let own = Bench { model: &anywhere.model, effects: &[], place: &anywhere.place };
    let rests: Vec<Equilibrium> = anywhere.trials.iter().map(|t| own.walk(t)).collect();
    assert!(rests.iter().all(|r| r.balanced));
    let moved = |r: &Equilibrium| {
        let mut out = reading(r);
        out[VV] += varus;
        out.0
    };
    at(&rests.iter().map(moved).collect::<Vec<_>>())
}

/// Name, flexion [deg], varus moment [N m].
const TRIALS: [(&str, f64, f64); 6] = [
    ("a", 90.0, -10.0),
    ("b", 90.0, 10.0),
    ("c", 60.0, -10.0),
    ("d", 60.0, 10.0),
    ("e", 30.0, -10.0),
    ("f", 30.0, 10.0),
];

/// Varus of each trial over the measured one [deg].
fn off(problem: &Problem, rests: &[Equilibrium]) -> Vec<f64> {
    let measured = problem.trials.iter().map(|t| t.record.measured[VV].unwrap());
    measured.zip(rests).map(|(m, r)| (reading(r)[VV] - m).abs()).collect()
}

/// The unknowns with all reference strains off by so many standard deviations of their prior.
fn loosened(problem: &Problem, by: f64) -> Vec<f64> {
    let own = problem.design.variables.iter().map(|v| if v.kind == Kind::ReferenceStrain { by } else { 0.0 });
    own.chain([0.0]).collect()
}

#[needs_shared]
fn a_way_that_trials_share_ends_where_the_way_of_each_alone_does() {
    let Some(problem) = problem() else { return };
    let candidates = problem.candidates();
    // nothing missing, a structure lost, which knows no trial, and an effect that knows the trial
    for (id, size) in [("", 0.0), ("structure_loss", 0.8), ("load_gain", 0.5)] {
        let hypothesis: Vec<_> = candidates.iter().filter(|c| c.effect.id == id).take(1).cloned().collect();
        assert_eq!(hypothesis.is_empty(), id.is_empty());
        let mut x = vec![0.0; problem.nuisances()];
        x.extend(hypothesis.iter().flat_map(|c| vec![size; c.size()]));
        let (together, models) = (problem.rests(&hypothesis, &x, &[]).unwrap(), problem.models_at(&x).unwrap());
        for (trial, rest) in problem.trials.iter().zip(&together) {
            let effects = problem.effects_in(trial.source, &hypothesis, &x);
            let bench = Bench { model: models.of(trial.source), effects: &effects, place: &problem.place };
            assert_eq!(bench.walk(trial).q, rest.q, "{id}, {}", trial.record.trial);
        }
    }
}

#[needs_shared]
fn a_knee_thrown_out_of_the_joint_is_led_back() {
    let Some(problem) = problem() else { return };
    let x = loosened(&problem, -0.8);
    let alone = problem.rests(&[], &x, &[]).unwrap();
    let led = problem.nearer(&[], &x, &[]).unwrap();
    assert!(off(&problem, &alone)[0] > 20.0 && off(&problem, &led)[0] < 6.0);
    assert!(led[0].balanced && led[0].miss.amax() < 0.5);
}

#[needs_shared]
fn where_a_model_fits_little_rests_count_as_they_are_and_else_as_ever() {
    let coordinates = |rests: &[Equilibrium]| rests.iter().map(|r| r.q).collect::<Vec<_>>();
    let x = |problem: &Problem| loosened(problem, 0.3);
    let Some(far) = problem_off(10.0) else { return };
    let far = far.with_far_rests(true).with_rests_as_they_are();
    let (led, alone) = (far.nearer(&[], &x(&far), &[]).unwrap(), far.rests(&[], &x(&far), &[]).unwrap());
    assert!(far.fits_little(&alone) && coordinates(&led) == coordinates(&alone));
    let Some(near) = problem() else { return };
    let as_ever = near.nearer(&[], &x(&near), &[]).unwrap();
    let near = near.with_rests_as_they_are();
    assert!(coordinates(&near.nearer(&[], &x(&near), &[]).unwrap()) == coordinates(&as_ever));
}

#[needs_shared]
fn what_fits_much_is_led_back_also_where_the_model_as_given_fits_little() {
    let Some(problem) = problem() else { return };
    let x = loosened(&problem, -0.7);
    let led =
        |problem: &Problem| -> Vec<Six> { problem.nearer(&[], &x, &[]).unwrap().into_iter().map(|r| r.q).collect() };
    let as_ever = led(&problem);
    let far = problem.with_far_rests(true);
    assert!((led(&far)[0] - as_ever[0]).amax() > 0.02, "a trial is left where it ends, some noises away");
    assert!(led(&far.with_rests_as_they_are()) == as_ever);
}

#[needs_shared]
fn how_far_from_any_rest_a_trial_was_measured_is_no_scatter() {
    let scatter = |varus: f64| -> Option<Vec<f64>> {
        let problem = problem_off(varus)?;
        let given = vec![0.0; problem.nuisances()];
        let near = problem.nearer(&[], &given, &[]).unwrap();
        // nothing rests next to what was measured so far off
        assert!(varus == 0.0 || near[2..].iter().all(|r| r.miss.norm() > 1000.0));
        let starts = starts_of(&near);
        let left = remainders(&problem, &starts, 8, &Floor::default()).unwrap();
        // 60 and 30 deg: one rest each
        Some((10..30).map(|r| left[(r, r)].sqrt()).collect())
    };
    let (Some(at_rest), Some(off)) = (scatter(0.0), scatter(8.0)) else { return };
    assert!(at_rest.iter().zip(&off).all(|(a, b)| (a - b).abs() < 0.01 + 0.1 * a), "{at_rest:?} {off:?}");
}

#[needs_shared]
fn where_no_rest_is_near_what_is_out_of_balance_counts_and_grows_with_its_cause() {
    let Some(problem) = problem() else { return };
    let mut before = 0.0;
    for by in [-2.0, -3.0, -4.0, -6.0] {
        let x = loosened(&problem, by);
        // thrown out of the joint, as above
        let alone = off(&problem, &problem.rests(&[], &x, &[]).unwrap())[0];
        assert!(alone > 20.0, "{by}: {alone}");
        let led = problem.nearer(&[], &x, &[]).unwrap();
        let now = off(&problem, &led)[0];
        assert!(led[0].miss.norm() > 1000.0 && now > before && now < 10.0, "{by}: {now}, {before}");
        before = now;
    }
}

#[needs_shared]
fn on_the_brink_a_tenth_of_a_degree_changes_little() {
    // measured there, the stiffness of trial b as given passes through nothing on its way to negative
    let away: Option<Vec<f64>> = [5.6, 5.7, 5.8, 5.9, 6.0]
        .iter()
        .map(|varus| {
            let problem = problem_off(*varus)?;
            let led = problem.nearer(&[], &loosened(&problem, -6.0), &[]).unwrap();
            assert!(led[1].miss.norm() > 1000.0, "no rest is near");
            Some(off(&problem, &led)[1])
        })
        .collect();
    let Some(away) = away else { return };
    assert!(away.windows(2).all(|w| (w[0] - w[1]).abs() < 1.0), "{away:?}");
}

#[needs_shared]
fn springs_hold_what_is_read_however_much_it_misreads() {
    let Some(problem) = problem() else { return };
    let catalogue = Catalogue::shipped();
    let turned = catalogue.effect.iter().find(|e| e.id == "tibia_frame").unwrap();
    let effects = [Active::new(turned, 0, &[3.0, -2.0]).unwrap()];
    let bench = Bench { model: &problem.model, effects: &effects, place: &problem.place };
    for trial in &problem.trials {
        let rest = bench.settle(trial, &trial.unloaded);
        if !rest.balanced {
            continue;
        }
        // measured where a knee whose frame is turned reads: nothing pulls, from wherever the pose is sought
        let sought = problem.model.joint.coordinates(&rest.observed).unwrap();
        assert!((sought - rest.q)[1].abs().to_degrees() > 1.0, "the frame turns what is read");
        let held = bench.held(trial, &rest.observed, &Start::at(sought));
        assert!((held.q - rest.q).amax() < 0.02 && held.miss.amax() < 20.0, "{}: {}", trial.record.trial, held.miss);
    }
}

#[needs_shared]
fn on_the_brink_a_knee_is_as_stiff_as_it_takes_to_stay_and_elsewhere_as_it_is() {
    let Some(problem) = problem() else { return };
    let bench = Bench { model: &problem.model, effects: &[], place: &problem.place };
    let trial = &problem.trials[0];
    let nothing = Matrix6::zeros();
    let least = bench.stiffened(trial, &nothing);
    assert!((1..6).all(|j| least[(j, j)] > 0.0) && least.row(0).amax() == 0.0);
    // a knee that would leave in one direction is held in that one
    let stiff = least * 3.0;
    assert!((bench.stiffened(trial, &stiff) - stiff).amax() < 1e-9 * stiff.amax());
    let mut brink = stiff;
    brink[(4, 4)] = -stiff[(4, 4)];
    let held = bench.stiffened(trial, &brink);
    assert!((held[(4, 4)] - least[(4, 4)]).abs() < 1e-9 * least[(4, 4)]);
    assert!((1..6).filter(|j| *j != 4).all(|j| (held[(j, j)] - stiff[(j, j)]).abs() < 1e-9 * stiff[(j, j)]));
}

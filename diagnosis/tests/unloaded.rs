//! Tissues about the unloaded pose follow it where the ligaments put it.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, deck};
use diagnosis::effect::candidate::{Candidate, Scope};
use diagnosis::problem::Problem;
use needs_shared::needs_shared;
use sim::equilibrium::starts_of;

/// A stiff capsule, and menisci without play, as large as the tests need them; of variants, those about the unloaded pose.
fn tissues(problem: &Problem) -> Vec<(Candidate, Vec<f64>)> {
    let find = |id: &str| {
        problem
            .candidates()
            .into_iter()
            .find(|c| c.effect.id == id && c.variant == 0 && c.scope == Scope::Both)
            .unwrap()
    };
    vec![(find("capsule_envelope"), vec![1.5, 1.5, 1.5, 0.5]), (find("meniscus"), vec![1.5, -1.0, 0.5, 0.0])]
}

/// Ligaments other than the deck's, some tighter, some slacker.
fn others(problem: &Problem) -> Vec<f64> {
    (0..problem.nuisances()).map(|k| 0.6 * (1.7 * k as f64).sin()).collect()
}

const MEASURED: [f64; 5] = [0.0, 0.0, 0.0, 0.0, -21.0];

#[needs_shared]
fn without_load_they_leave_the_knee_where_its_ligaments_do() {
    let unloaded: Vec<Asked> =
        [0.0, 15.0, 30.0, 60.0].map(|f| ("unloaded", "neutral", f, [0.0; 4], MEASURED)).into_iter().collect();
    let Some(problem) = deck("unloaded", &unloaded) else { return };
    let x = others(&problem);
    let plain = problem.rests(&[], &x, &[]).unwrap();
    let moved = plain.iter().zip(&problem.trials).map(|(r, t)| (r.q - t.unloaded.q).amax()).fold(0.0, f64::max);
    assert!(moved > 0.5, "other ligaments rest elsewhere: {moved}");
    for (tissue, size) in tissues(&problem) {
        let starts: Vec<_> = problem.trials.iter().map(|t| t.unloaded.clone()).collect();
        let rests = problem.rests(std::slice::from_ref(&tissue), &[x.clone(), size].concat(), &starts).unwrap();
        for (a, b) in rests.iter().zip(&plain) {
            assert!(a.balanced && (a.q - b.q).amax() < 0.01, "{}: {}", tissue.name(), a.q - b.q);
        }
    }
}

#[needs_shared]
fn derivatives_by_ligaments_and_contact_hold_what_moves_the_unloaded_pose() {
    let loaded: [Asked; 4] = [
        ("a", "anterior", 30.0, [0.0, 0.0, 0.0, 60.0], MEASURED),
        ("p", "posterior", 60.0, [0.0, 0.0, 0.0, -60.0], MEASURED),
        ("i", "internal", 30.0, [0.0, 2.0, 0.0, 0.0], MEASURED),
        ("v", "valgus", 15.0, [5.0, 0.0, 0.0, 0.0], MEASURED),
    ];
    let Some(problem) = deck("unloaded", &loaded) else { return };
    for (tissue, size) in tissues(&problem) {
        let hypothesis = [tissue.clone()];
        let x = [others(&problem), size].concat();
        let rests = problem.rests(&hypothesis, &x, &[]).unwrap();
        let starts = starts_of(&rests);
        let linear = problem.linear_at(&hypothesis, &x, rests).unwrap();
        let at = |k: usize, h: f64| {
            let mut y = x.clone();
            y[k] += h;
            let rests = problem.rests(&hypothesis, &y, &starts).unwrap();
            rests.iter().flat_map(diagnosis::problem::reading).collect::<Vec<f64>>()
        };
        let (mut off, mut all) = (0.0, 0.0);
        for k in 0..problem.nuisances() {
            let h = 0.01;
            for (r, (up, down)) in at(k, h).iter().zip(at(k, -h)).enumerate() {
                let by_difference = (up - down) / (2.0 * h);
                off += (by_difference - linear.jacobian[(r, k)]).powi(2);
                all += by_difference.powi(2);
            }
        }
        assert!(off.sqrt() < 0.02 * all.sqrt(), "{}: {} of {}", tissue.name(), off.sqrt(), all.sqrt());
    }
}

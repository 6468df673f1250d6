//! A ligament that was cut is named, and no search stays behind a fit that starts at the truth.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, question};
use diagnosis::candidate::Candidate;
use diagnosis::problem::{Problem, reading};
use diagnosis::regret::regret;
use diagnosis::search::{DiagnosisOptions, Searcher};
use inference::random::{normal, stream};
use needs_shared::needs_shared;
use sim::coordinate::FREE;

/// Most that a search may stay behind the truth [nats].
const MOST_REGRET: f64 = 2.0;

/// Drawers, rotations and moments at two flexions; nothing was measured yet.
const PLAN: [Asked; 12] = [
    ("a", "anterior", 30.0, [0.0, 0.0, 0.0, 60.0], [0.0; 5]),
    ("b", "anterior", 30.0, [0.0, 0.0, 0.0, 100.0], [0.0; 5]),
    ("c", "anterior", 60.0, [0.0, 0.0, 0.0, 60.0], [0.0; 5]),
    ("d", "anterior", 60.0, [0.0, 0.0, 0.0, 100.0], [0.0; 5]),
    ("e", "posterior", 30.0, [0.0, 0.0, 0.0, -100.0], [0.0; 5]),
    ("f", "posterior", 60.0, [0.0, 0.0, 0.0, -100.0], [0.0; 5]),
    ("g", "internal", 30.0, [0.0, -3.0, 0.0, 0.0], [0.0; 5]),
    ("h", "internal", 60.0, [0.0, -3.0, 0.0, 0.0], [0.0; 5]),
    ("i", "external", 30.0, [0.0, 3.0, 0.0, 0.0], [0.0; 5]),
    ("j", "external", 60.0, [0.0, 3.0, 0.0, 0.0], [0.0; 5]),
    ("k", "varus", 30.0, [6.0, 0.0, 0.0, 0.0], [0.0; 5]),
    ("l", "valgus", 30.0, [-6.0, 0.0, 0.0, 0.0], [0.0; 5]),
];

/// The question of a deck whose readings are those of the model itself with a structure cut, and noise.
fn cut(structure: &str) -> Option<Problem> {
    let mut problem = question("cuts", &[("rks", &PLAN)])?;
    let is_it = |c: &Candidate| c.effect.id == "structure_loss" && c.variant_name().as_deref() == Some(structure);
    let torn = problem.candidates().into_iter().find(is_it).unwrap();
    let unknowns = [vec![0.0; problem.nuisances()], vec![1.0 / torn.effect.parameter[0].sd]].concat();
    let rests = problem.rests(&[torn], &unknowns, &[]).unwrap();
    let mut random = stream(7, 0);
    for (trial, rest) in problem.trials.iter_mut().zip(&rests) {
        let there = reading(rest);
        FREE.into_iter().for_each(|c| trial.measured[c] = Some(there[c] + trial.sd[c] * normal(&mut random)));
    }
    // poses held at what is measured are found anew
    Some(problem.with_present(vec![]))
}

#[needs_shared]
fn a_cut_acl_is_named_and_the_search_does_not_stay_behind_the_truth() {
    // what is beside a name is not asked
    let options = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 3, ..DiagnosisOptions::default() };
    let Some(problem) = cut("ACL") else { return };
    let searcher = Searcher { problem: &problem, options: &options };
    let search = searcher.search().unwrap();
    let best = &search.rivals[0];
    let named: Vec<_> = best.hypothesis.iter().map(|c| (c.name(), c.variant_name())).collect();
    assert_eq!(named, [("structure_loss".to_owned(), Some("ACL".to_owned()))]);
    let regret = regret(&problem, (&searcher, &search), &[("structure_loss", "ACL", vec![1.0])]).unwrap().unwrap();
    assert!(regret.short() <= MOST_REGRET, "{regret:?}");
    // more than all is not lost
    let whole = 1.0 / best.hypothesis[0].effect.parameter[0].sd;
    assert!(best.unknowns[problem.nuisances()] <= whole, "{:?}", best.unknowns.last());
}

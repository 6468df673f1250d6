//! Fields of no name weighed against names: on one scale, and at the poses at which the names are.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::asked::asked;
use crate::common::deck::deck;
use diagnosis::discrepancy::{Discrepancy, discrepancy};
use diagnosis::effect::candidate::{Candidate, Scope};
use diagnosis::problem::{Problem, reading};
use diagnosis::search::{DiagnosisOptions, Search, Searcher};
use needs_shared::needs_shared;
use sim::coordinate::FREE;

const TRIALS: [(&str, f64, [f64; 4]); 8] = [
    ("anterior", 15.0, [0.0, 0.0, 0.0, 80.0]),
    ("anterior", 45.0, [0.0, 0.0, 0.0, 80.0]),
    ("posterior", 15.0, [0.0, 0.0, 0.0, -80.0]),
    ("posterior", 45.0, [0.0, 0.0, 0.0, -80.0]),
    ("internal", 30.0, [0.0, 3.0, 0.0, 0.0]),
    ("external", 30.0, [0.0, -3.0, 0.0, 0.0]),
    ("valgus", 30.0, [6.0, 0.0, 0.0, 0.0]),
    ("varus", 30.0, [-6.0, 0.0, 0.0, 0.0]),
];

/// A question whose knee has so much of an unrecorded compression [of its prior], and readings a little off.
fn compressed(size: f64) -> Option<Problem> {
    let problem = deck("fields", &asked(&TRIALS, &[[0.0, 0.0, 0.0, 0.0, -21.0]; 8]))?;
    let is_it = |c: &Candidate| c.effect.id == "joint_compression" && c.scope == Scope::Both;
    let press = problem.candidates().into_iter().find(is_it).unwrap();
    let unknowns = [vec![0.0; problem.nuisances()], vec![size; press.size()]].concat();
    let rests = problem.rests(&[press], &unknowns, &[]).unwrap();
    let measured: Vec<[f64; 5]> = rests
        .iter()
        .enumerate()
        .map(|(i, rest)| {
            let read = reading(rest);
            FREE.map(|c| read[c] + 0.2 * (5.0 * i as f64 + 1.3 * c.free_index() as f64).sin())
        })
        .collect();
    deck("fields", &asked(&TRIALS, &measured))
}

fn searched(problem: &Problem, options: &DiagnosisOptions) -> (Search, Discrepancy) {
    let search = Searcher { problem, options }.search().unwrap();
    let far = discrepancy(problem, (&search.readings, &search.covariance), &search.base).unwrap();
    (search, far)
}

#[needs_shared]
fn what_a_field_adds_to_is_the_evidence_of_the_fit_itself() {
    let Some(problem) = compressed(0.0) else { return };
    let (search, far) = searched(&problem, &DiagnosisOptions::default());
    let own = far.log_evidence - far.log_bayes_factor;
    assert!((own - search.base.log_evidence).abs() < 0.5, "{own}, {}", search.base.log_evidence);
}

#[needs_shared]
fn where_the_name_stands_a_field_that_does_the_same_earns_nearly_as_much() {
    let Some(problem) = compressed(4.0) else { return };
    let options = DiagnosisOptions { most_effects: 1, ..DiagnosisOptions::default() };
    let (search, far) = searched(&problem, &options);
    let best = &search.rivals[0];
    assert_eq!(best.hypothesis[0].effect.id, "joint_compression");
    let searcher = Searcher { problem: &problem, options: &options };
    let stripped = searcher.stripped(best, &search.readings);
    // what the catalogue has a name for is no field of no name
    let with_names = discrepancy(&problem, (&search.readings, &search.covariance), &stripped).unwrap();
    let mut problem = problem.clone();
    problem.catalogue = problem.catalogue.without(&["joint_compression"]);
    let near = discrepancy(&problem, (&search.readings, &search.covariance), &stripped).unwrap();
    let named = best.log_evidence - search.base.log_evidence;
    let gains = [far.log_bayes_factor, near.log_evidence - search.base.log_evidence];
    // half of what has no name are smooth fields, one of ninety kinds is the name's own, in one of three sizes; a nat for priors of other forms. About
    // the knee that nothing presses it would not do as well
    let price = (2.0f64 * 90.0 * 3.0).ln() + 1.0;
    assert!(gains[1] < named && gains[1] > named - price, "{named}, {gains:?}");
    assert!(gains[1] > gains[0] + 2.0, "{named}, {gains:?}");
    assert!(with_names.log_evidence < near.log_evidence, "{} {}", with_names.log_evidence, near.log_evidence);
}

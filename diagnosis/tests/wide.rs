//! A search that is led on stays behind no single effect that the table of tried effects has.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::asked::asked;
use crate::common::deck::deck;
use crate::cuts::cut;
use diagnosis::effect::candidate::{Candidate, Scope};
use diagnosis::fit::Fit;
use diagnosis::problem::{Problem, reading};
use diagnosis::search::{DiagnosisOptions, Searcher, TRIES};
use needs_shared::needs_shared;
use sim::coordinate::FREE;

/// Most that two fits of one valley end apart [nats]: what a last step may still promise, and as much for a bend of the way.
const ONE_VALLEY: f64 = 1.0;

/// A knee whose torn PCL has no name, so that other effects are tried in its place.
fn discrepancy() -> Option<Problem> {
    let mut problem = cut("PCL")?;
    // nor are effects that take long tried
    let slow = ["extra_bundle", "meniscus", "capsule_envelope", "mcl_wrap", "pcap_wrap", "itb", "quad_passive"];
    problem.catalogue = problem.catalogue.without(&["structure_loss", "attachment"]).without(&slow);
    Some(problem)
}

#[needs_shared]
fn what_the_table_of_tried_effects_found_is_never_ahead_of_the_search() {
    let Some(problem) = discrepancy() else { return };
    let options = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 1, ..DiagnosisOptions::default() };
    let searcher = Searcher { problem: &problem, options: &options };
    // a search that knows but one effect, one that explains little, stays behind
    let candidates = problem.candidates();
    let others: Vec<&str> = candidates.iter().map(|c| c.effect.id.as_str()).filter(|id| *id != "gravity").collect();
    let mut blind = problem.clone();
    blind.catalogue = blind.catalogue.without(&others);
    let search = Searcher { problem: &blind, options: &options }.search().unwrap();
    let narrow = search.rivals.first().map(|f| f.hypothesis.clone());
    let (wide, table) = searcher.widened(search).unwrap();
    let gain = |f: &Fit| searcher.gain(f, &wide.base);
    let best = &wide.rivals[0];
    assert_ne!(narrow.as_ref(), Some(&best.hypothesis), "the search was not behind: the law has nothing to show");
    for row in &table {
        let name = row.hypothesis[0].name();
        assert!(gain(row) <= gain(best), "{name}: {} against {}", gain(row), gain(best));
        let of_it = wide.rivals.iter().find(|f| f.hypothesis == row.hypothesis);
        assert!(of_it.is_none_or(|f| gain(row) <= gain(f)), "{name}: {} against {}", gain(row), gain(of_it.unwrap()));
        if gain(row) < 0.0 {
            continue;
        }
        // what earns anything is a fit in the scatter of the search, and led to its end there
        let (start, rests) = (&row.unknowns, row.coordinates());
        let on = searcher.fit(&row.hypothesis, start, &rests, &wide.covariance, &wide.readings, TRIES).unwrap();
        assert!(gain(&on) - gain(row) < ONE_VALLEY, "{name}: {} and then {}", gain(row), gain(&on));
    }
    let mut names: Vec<&str> = table.iter().map(|f| f.hypothesis[0].effect.id.as_str()).collect();
    let count = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count, "an effect has one row");
}

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

/// The published deck read through a tibial frame that is turned by 12 deg and shifted by 5 mm, and the two effects.
fn turned_and_shifted() -> Option<(Problem, [Candidate; 2])> {
    let problem = deck("wide", &asked(&TRIALS, &[[0.0, 0.0, 0.0, 0.0, -21.0]; 8]))?;
    let of = |id: &str| {
        let is_it = |c: &Candidate| c.effect.id == id && c.scope == Scope::Both;
        problem.candidates().into_iter().find(is_it).unwrap()
    };
    let both = ["tibia_frame", "origin_shift"].map(of);
    let sizes: [&[f64]; 2] = [&[0.0, 12.0], &[0.0, 5.0, 0.0]];
    let scaled = both.iter().zip(sizes).flat_map(|(c, of)| c.effect.parameter.iter().zip(of).map(|(p, x)| x / p.sd));
    let unknowns: Vec<f64> = vec![0.0; problem.nuisances()].into_iter().chain(scaled).collect();
    let rests = problem.rests(&both, &unknowns, &[]).unwrap();
    let measured: Vec<[f64; 5]> = rests.iter().map(|rest| FREE.map(|c| reading(rest)[c])).collect();
    Some((deck("wide", &asked(&TRIALS, &measured))?, both))
}

#[needs_shared]
fn two_effects_that_a_table_has_one_by_one_are_found_together() {
    let Some((problem, both)) = turned_and_shifted() else { return };
    let options = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 1, ..DiagnosisOptions::default() };
    let searcher = Searcher { problem: &problem, options: &options };
    let search = searcher.search().unwrap();
    let alone = |c: &Candidate| {
        let start = [&search.base.unknowns[..], &vec![0.0; c.size()]].concat();
        let (of, rests) = (std::slice::from_ref(c), search.base.coordinates());
        searcher.fit(of, &start, &rests, &search.covariance, &search.readings, TRIES).unwrap()
    };
    let table: Vec<Fit> = both.iter().map(alone).collect();
    let gain = |f: &Fit| searcher.gain(f, &search.base);
    assert!(table.iter().all(|f| gain(f) > 0.0), "{:?}", table.iter().map(gain).collect::<Vec<_>>());
    let pairs = searcher.joined(&search, &table).unwrap();
    assert_eq!(pairs.len(), 1, "two effects make one pair");
    assert!(both.iter().all(|c| pairs[0].hypothesis.contains(c)));
    assert!(table.iter().all(|f| gain(&pairs[0]) > gain(f) + options.least_further), "{}", gain(&pairs[0]));
    // one effect is no pair
    assert!(searcher.joined(&search, &table[..1]).unwrap().is_empty());
}

//! A search that is led on stays behind no single effect that the table of tried effects has.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::cuts::cut;
use diagnosis::problem::Problem;
use diagnosis::search::{DiagnosisOptions, Searcher, TRIES};
use needs_shared::needs_shared;

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
    let gain = |f: &diagnosis::fit::Fit| searcher.gain(f, &wide.base);
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

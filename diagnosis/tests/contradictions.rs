//! Two readings of one knee that no knee gives both are named by their rows; where all are of one knee, none are.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, published, source};
use calibration::options::CalibrateOptions;
use diagnosis::catalogue::Catalogue;
use diagnosis::diagnosis::{Calibration, Diagnosis, diagnose};
use diagnosis::problem::{Problem, reading};
use diagnosis::search::DiagnosisOptions;
use inference::random::{normal, stream};
use needs_shared::needs_shared;
use sim::coordinate::{AP, Coordinate, FREE, Free, IE};

/// Two flexions, four loads; nothing was measured yet.
const PLAN: [Asked; 8] = [
    ("a", "anterior", 30.0, [0.0, 0.0, 0.0, 100.0], [0.0; 5]),
    ("b", "posterior", 30.0, [0.0, 0.0, 0.0, -100.0], [0.0; 5]),
    ("c", "internal", 30.0, [0.0, -3.0, 0.0, 0.0], [0.0; 5]),
    ("d", "external", 30.0, [0.0, 3.0, 0.0, 0.0], [0.0; 5]),
    ("e", "anterior", 60.0, [0.0, 0.0, 0.0, 100.0], [0.0; 5]),
    ("f", "posterior", 60.0, [0.0, 0.0, 0.0, -100.0], [0.0; 5]),
    ("g", "internal", 60.0, [0.0, -3.0, 0.0, 0.0], [0.0; 5]),
    ("h", "external", 60.0, [0.0, 3.0, 0.0, 0.0], [0.0; 5]),
];

/// The diagnosis of two data sets of one knee, a reading of a trial of the second changed by so much.
fn changed(trial: usize, c: Coordinate, by: f64) -> Option<Diagnosis> {
    let deck = published("contradictions")?;
    let (model, options) = (sim::compile(&deck.spec, &deck.meshes).unwrap(), CalibrateOptions::default());
    let mut sources = ["kla", "rks"].map(|name| source(name, &PLAN));
    let catalogue = Catalogue::shipped();
    let problem = Problem::new(&model, &deck.spec, &sources, &catalogue, &options).unwrap();
    let rests = problem.rests(&[], &vec![0.0; problem.nuisances()], &[]).unwrap();
    let mut random = stream(3, 0);
    let trials = sources.iter_mut().flat_map(|s| &mut s.trials);
    for (own, (t, rest)) in trials.zip(problem.trials.iter().zip(&rests)) {
        let there = reading(rest);
        let mut out = Free::all(None);
        FREE.into_iter().for_each(|c| out[c] = Some(there[c] + t.sd[c] * normal(&mut random)));
        own.measured = out;
    }
    let edited = &mut sources[1].trials[trial].measured;
    edited[c] = edited[c].map(|x| x + by);
    let few = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
    let calibration = Calibration { options: &options, mode: None };
    Some(diagnose(&model, &deck.spec, &sources, &catalogue, &few, calibration).unwrap().diagnosis)
}

#[needs_shared]
fn a_row_that_was_edited_is_named_first_with_its_twin_in_the_other_data_set() {
    let (trial, c, by) = (6, IE, -12.0);
    let Some(told) = changed(trial, c, by) else { return };
    let first = told.contradictions.first().unwrap_or_else(|| panic!("{}", told.plain));
    let rows = first.readings.each_ref().map(|w| (w.source.as_str(), w.row));
    // the header is row 1
    assert_eq!((first.dof.as_str(), rows), (c.name(), [("kla", Some(trial + 2)), ("rks", Some(trial + 2))]));
    let [one, other] = first.readings.each_ref().map(|w| w.value);
    assert!((other - one - by).abs() < 3.0 && (first.expected - one).abs() < 3.0 && first.sd < 3.0, "{first:?}");
    let row = format!("row {} of rks", trial + 2);
    assert!(told.plain.contains(&row), "{}", told.plain);
    // the same rows stand in no other
    assert!(told.contradictions[1..].iter().flat_map(|c| &c.readings).all(|w| w.row != Some(trial + 2)));
}

#[needs_shared]
fn data_sets_of_one_knee_do_not_contradict_each_other() {
    let Some(told) = changed(0, AP, 0.0) else { return };
    assert!(told.contradictions.is_empty(), "{:?}", told.contradictions);
}

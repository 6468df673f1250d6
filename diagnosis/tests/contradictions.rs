//! Two readings of one knee that no knee gives both are named by their rows; where all are of one knee, none are.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, published, source};
use calibration::options::CalibrateOptions;
use diagnosis::diagnosis::{Calibration, Diagnosis, Verdict, diagnose};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::{Problem, reading};
use diagnosis::report::Against;
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

/// The diagnosis of two data sets of one knee by some effects, each reading with so many noises of scatter, and a trial of the second changed.
fn told_of(catalogue: &Catalogue, noises: f64, (trial, c, by): (usize, Coordinate, f64)) -> Option<Diagnosis> {
    let deck = published("contradictions")?;
    let (model, options) = (sim::compile(&deck.spec, &deck.meshes).unwrap(), CalibrateOptions::default());
    let mut sources = ["kla", "rks"].map(|name| source(name, &PLAN));
    let problem = Problem::new(&model, &deck.spec, &sources, catalogue, &options).unwrap();
    let rests = problem.rests(&[], &vec![0.0; problem.nuisances()], &[]).unwrap();
    let mut random = stream(3, 0);
    let trials = sources.iter_mut().flat_map(|s| &mut s.trials);
    for (own, (t, rest)) in trials.zip(problem.trials.iter().zip(&rests)) {
        let there = reading(rest);
        let mut out = Free::all(None);
        FREE.into_iter().for_each(|c| out[c] = Some(there[c] + noises * t.sd[c] * normal(&mut random)));
        own.measured = out;
    }
    let edited = &mut sources[1].trials[trial].measured;
    edited[c] = edited[c].map(|x| x + by);
    let few = DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
    let calibration = Calibration { options: &options, mode: None };
    Some(diagnose(&model, &deck.spec, &sources, catalogue, &few, calibration).unwrap().diagnosis)
}

/// The same by the whole catalogue, as noisy as is stated, a reading of a trial of the second changed by so much.
fn changed(trial: usize, c: Coordinate, by: f64) -> Option<Diagnosis> {
    told_of(&Catalogue::shipped(), 1.0, (trial, c, by))
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
    // the row that was edited is never told to be the sound one of the two, and what tells is told with it
    assert!(first.outlier().is_none_or(|k| first.readings[k].source == "rks"), "{first:?}");
    let [noise, z] = [first.noise.unwrap()[1], first.z.unwrap()];
    assert!(noise > 0.0 && noise < first.sd && (0.5 * z * z - first.surprise).abs() < 1e-9, "{first:?}");
    assert!(first.contradicts.unwrap().iter().all(|n| *n >= 1), "{first:?}");
    // the same rows stand in no other
    assert!(told.contradictions[1..].iter().flat_map(|c| &c.readings).all(|w| w.row != Some(trial + 2)));
}

#[needs_shared]
fn data_sets_of_one_knee_do_not_contradict_each_other() {
    let Some(told) = changed(0, AP, 0.0) else { return };
    assert!(told.contradictions.is_empty(), "{:?}", told.contradictions);
}

/// How many of their stated noises readings scatter by that no knee gives [-].
const WILD: f64 = 4.0;

#[needs_shared]
fn where_no_effect_is_enough_each_is_asked_as_the_answer_and_what_stands_against_it_is_told() {
    // few effects, none of which makes scatter
    let few = ["load_bias", "load_gain", "gravity", "origin_shift"];
    let all = Catalogue::shipped();
    let others: Vec<&str> = all.effect.iter().map(|e| e.id.as_str()).filter(|id| !few.contains(id)).collect();
    let Some(told) = told_of(&all.without(&others), WILD, (0, AP, 0.0)) else { return };
    assert_eq!(told.verdict, Verdict::Unnamed, "{}", told.plain);
    let why = told.unexplained.unwrap();
    assert!(why.is_proven(told.misfit[0]) && told.plain.contains("none is enough"), "{}", told.plain);
    assert!(told.plain.contains("scattered") && told.plain.contains("times as widely"), "{}", told.plain);
    for row in &why.tried {
        let earns_a_name = !row.against.contains(&Against::EarnsTooLittle);
        // what earns a name was asked on trials that it was not fitted to
        assert!(!earns_a_name || row.closes_held_out.is_some(), "{row:?}");
        assert!(row.leaves.unwrap() > 1.0, "{row:?}");
    }
    // what the best leaves: the furthest first, each trial once, and of the side on which the reading lies
    assert!(!why.left.is_empty() && why.left.windows(2).all(|w| w[0].z.abs() >= w[1].z.abs()), "{:?}", why.left);
    let mut places: Vec<_> = why.left.iter().map(|l| (&l.reading.source, l.reading.row)).collect();
    places.sort();
    places.dedup();
    assert_eq!(places.len(), why.left.len());
    assert!(why.left.iter().all(|l| l.z * (l.reading.value - l.expected) > 0.0), "{:?}", why.left);
    // none of both is a knee's, and each has what the best leaves of it
    assert!(why.data_sets.iter().all(|s| s.with_best.is_some() && s.alone > 1.0), "{:?}", why.data_sets);
}

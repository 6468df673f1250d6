//! What is hidden in the small knee's data is named, and nothing where nothing is hidden.

use super::Small;
use crate::common::deck::{Asked, source};
use diagnosis::diagnosis::Verdict;
use sim::coordinate::IE;

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

/// Fails where the evidence of a loss is not that of its fit, or another effect of the catalogue takes its place.
#[test]
fn a_torn_acl_is_named_by_the_data_that_it_moved() {
    let small = Small::new();
    let mut sources = [source("rks", &PLAN)];
    small.measure(&mut sources, Some("ACL"), 1.0);
    let told = small.told(&sources);
    assert_eq!(told.verdict, Verdict::Decisive, "{}", told.plain);
    let first = &told.answers[0].effects[0];
    assert_eq!((first.effect.as_str(), first.variant.as_deref()), ("structure_loss", Some("ACL")), "{}", told.plain);
    assert!(told.plain.contains("ACL is torn"), "{}", told.plain);
}

/// Fails where a name costs nothing: an effect is free to take up noise.
#[test]
fn of_a_whole_knee_nothing_is_named() {
    let small = Small::new();
    let mut sources = [source("rks", &PLAN)];
    small.measure(&mut sources, None, 1.0);
    let told = small.told(&sources);
    assert_eq!(told.verdict, Verdict::None, "{}", told.plain);
    assert!(told.answers.is_empty() && told.contradictions.is_empty(), "{}", told.plain);
}

/// The trial that jumps, and by how much [deg]: 24 of its noises.
const JUMPS: (usize, f64) = (9, 12.0);

/// Fails where an outlier drags the fit along, or its row is counted from the wrong line.
#[test]
fn a_trial_that_jumped_is_told_by_its_row_and_no_other_is() {
    let small = Small::new();
    let mut sources = [source("rks", &PLAN)];
    small.measure(&mut sources, None, 0.0);
    let (jumped, by) = JUMPS;
    let reading = &mut sources[0].trials[jumped].measured[IE];
    *reading = reading.map(|x| x + by);
    let told = small.told(&sources).description;
    let aside = told.split("Set aside as outliers: ").nth(1).unwrap_or_else(|| panic!("{told}"));
    let aside = aside.split(" With ligaments").next().unwrap_or(aside);
    // the header is row 1
    assert!(aside.starts_with(&format!("row {} of rks", jumped + 2)) && aside.contains(" of IE "), "{aside}");
    assert_eq!(aside.matches(" reads ").count(), 1, "{aside}");
}

/// Fails where readings of two data sets are each held against the model alone, and not against each other.
#[test]
fn a_row_that_was_edited_is_named_with_its_twin_in_the_other_data_set() {
    let small = Small::new();
    let mut sources = ["kla", "rks"].map(|name| source(name, &PLAN));
    small.measure(&mut sources, None, 1.0);
    let (trial, by) = (7, -12.0);
    let edited = &mut sources[1].trials[trial].measured[IE];
    *edited = edited.map(|x| x + by);
    let told = small.told(&sources);
    let first = told.contradictions.first().unwrap_or_else(|| panic!("{}", told.plain));
    let rows = first.readings.each_ref().map(|w| (w.source.as_str(), w.row));
    assert_eq!((first.dof.as_str(), rows), (IE.name(), [("kla", Some(trial + 2)), ("rks", Some(trial + 2))]));
    let [one, other] = first.readings.each_ref().map(|w| w.value);
    assert!((other - one - by).abs() < 3.0 && (first.expected - one).abs() < 3.0 && first.sd < 3.0, "{first:?}");
    assert!(told.plain.contains(&format!("row {} of rks", trial + 2)), "{}", told.plain);
}

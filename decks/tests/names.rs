//! Bundles and knees of any names: the deck is read back, and no two bundles become one.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::decks::{knee, read_back};
use decks::{export, written_names};
use sim::spec::ModelSpec;
use std::collections::BTreeSet;

/// Names that mean something to Abaqus or to XML, are too long, begin with no letter, or differ by what a deck does not tell apart.
fn odd() -> Vec<String> {
    let long = "long ".repeat(30);
    let names = [
        "A & B",
        "A/B",
        "a_b",
        "A_B",
        "<K>",
        "\"quoted\"",
        "1st",
        "*STEP",
        "x,y",
        "Außenband",
        "sMCL A=1",
        "-",
        long.as_str(),
    ];
    names.map(str::to_owned).into()
}

/// The knee with so many bundles more, each of one fibre, alike but for their stiffness.
fn named(names: &[String]) -> ModelSpec {
    let (mut spec, _) = knee();
    let (bundle, fibre) = (spec.bundles[0].clone(), spec.fibres[0].clone());
    for (k, name) in names.iter().enumerate() {
        let mut more = bundle.clone();
        more.name.clone_from(name);
        more.stiffness_n_per_mm = 30.0 + k as f64;
        spec.bundles.push(more);
        let mut end = fibre.clone();
        end.bundle.clone_from(name);
        spec.fibres.push(end);
    }
    spec
}

#[test]
fn bundles_of_any_name_go_out_and_come_back() {
    let mut spec = named(&odd());
    let meshes = knee().1;
    for id in ["made", "K & \"1\" <left>", "*HEADING", "a,b\nc"] {
        spec.id = id.into();
        let deck = export(&spec, &meshes).unwrap();
        assert!(deck.warnings.iter().any(|w| w.contains("A & B") && w.contains("A___B")), "{:?}", deck.warnings);
        let files = deck.files.iter().cloned().collect();
        for main in &deck.mains {
            let back = read_back(&files, main).unwrap().spec;
            let stiffness = |spec: &ModelSpec| {
                let mut all: Vec<f64> = spec.bundles.iter().map(|b| b.stiffness_n_per_mm).collect();
                all.sort_by(f64::total_cmp);
                all
            };
            assert_eq!(stiffness(&back), stiffness(&spec), "{id} {main}");
            let of_one = |spec: &ModelSpec| {
                spec.bundles.iter().filter(|b| spec.fibres.iter().any(|f| f.bundle == b.name)).count()
            };
            assert_eq!((of_one(&back), back.fibres.len()), (of_one(&spec), spec.fibres.len()), "{id} {main}");
        }
    }
}

#[test]
fn plain_names_stay_and_no_two_become_one() {
    let (spec, meshes) = knee();
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    assert!(written_names(&spec, is_plain).iter().all(|(ours, theirs)| ours == theirs));
    assert!(export(&spec, &meshes).unwrap().warnings.iter().all(|w| !w.contains("called")));
    let names = written_names(&named(&odd()), is_plain);
    let distinct: BTreeSet<String> = names.values().map(|n| n.to_lowercase()).collect();
    assert_eq!(distinct.len(), knee().0.bundles.len() + odd().len());
    let is_label =
        |n: &String| n.starts_with(|c: char| c.is_ascii_alphabetic()) && n.chars().all(is_plain) && n.len() <= 64;
    assert!(names.values().all(is_label), "{names:?}");
}

//! Laws of effects of an apparatus: none of it changes nothing, derivatives are those of differences, left mirrors right.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::deck::{Asked, published, source};
use crate::mirrored::mirrored;
use calibration::options::CalibrateOptions;
use decks::ImportedDeck;
use diagnosis::effect::candidate::{Candidate, Scope};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::{Problem, reading};
use needs_shared::needs_shared;
use sim::coordinate::{AP, IE, ML};
use sim::equilibrium::starts_of;

const MEASURED: [f64; 5] = [0.0, 0.0, 0.0, 0.0, -21.0];

/// Drawers of a knee that is turned by a moment, and turned and tilted knees.
const TRIALS: [Asked; 5] = [
    ("a", "anterior", 30.0, [0.0, 5.0, 0.0, 60.0], MEASURED),
    ("p", "posterior", 60.0, [0.0, -5.0, 0.0, -60.0], MEASURED),
    ("i", "internal", 30.0, [0.0, -2.0, 0.0, 0.0], MEASURED),
    ("e", "external", 45.0, [0.0, 2.0, 0.0, 0.0], MEASURED),
    ("v", "valgus", 15.0, [5.0, 0.0, 0.0, 0.0], MEASURED),
];

/// Effects of an apparatus that bend nowhere, in sizes that are felt.
const EFFECTS: [&str; 7] =
    ["load_axis", "strap_tissue", "foot_turn", "apparatus_compliance", "cuff_softening", "load_misalign", "load_gain"];
/// Their sizes in units of their priors [-].
const SIZE: f64 = 0.8;

fn problem(deck: &ImportedDeck) -> Problem {
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    let options = CalibrateOptions::default();
    Problem::new(&model, &deck.spec, &[source("rks", &TRIALS)], &Catalogue::shipped(), &options).unwrap()
}

fn candidate(problem: &Problem, id: &str) -> Candidate {
    problem.candidates().into_iter().find(|c| c.effect.id == id && c.scope == Scope::Both).unwrap()
}

/// Readings of all trials, five each, where each parameter of an effect has this size.
fn read(problem: &Problem, c: &Candidate, size: f64) -> Vec<f64> {
    let x = [vec![0.0; problem.nuisances()], vec![size; c.size()]].concat();
    problem.rests(std::slice::from_ref(c), &x, &[]).unwrap().iter().flat_map(reading).collect()
}

fn plain(problem: &Problem) -> Vec<f64> {
    problem.rests(&[], &vec![0.0; problem.nuisances()], &[]).unwrap().iter().flat_map(reading).collect()
}

#[needs_shared]
fn an_apparatus_of_no_fault_changes_nothing_and_derivatives_are_those_of_differences() {
    let Some(deck) = published("apparatus") else { return };
    let problem = problem(&deck);
    let without = plain(&problem);
    for id in EFFECTS {
        let c = candidate(&problem, id);
        let none = read(&problem, &c, 0.0);
        let most = none.iter().zip(&without).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(most < 1e-4, "{id} of no size moves a reading by {most}");

        let n = problem.nuisances();
        let x = [vec![0.0; n], vec![SIZE; c.size()]].concat();
        let hypothesis = [c.clone()];
        let rests = problem.rests(&hypothesis, &x, &[]).unwrap();
        let starts = starts_of(&rests);
        let linear = problem.linear_at(&hypothesis, &x, rests).unwrap();
        let at = |k: usize, h: f64| {
            let mut y = x.clone();
            y[n + k] += h;
            let rests = problem.rests(&hypothesis, &y, &starts).unwrap();
            rests.iter().flat_map(reading).collect::<Vec<f64>>()
        };
        let (mut off, mut all) = (0.0, 0.0);
        for k in 0..c.size() {
            let h = 0.01;
            for (r, (up, down)) in at(k, h).iter().zip(at(k, -h)).enumerate() {
                let by_difference = (up - down) / (2.0 * h);
                off += (by_difference - linear.jacobian[(r, n + k)]).powi(2);
                all += by_difference.powi(2);
            }
        }
        assert!(all > 0.0 && off.sqrt() < 0.02 * all.sqrt(), "{id}: {} of {}", off.sqrt(), all.sqrt());
    }
}

#[needs_shared]
fn an_apparatus_does_to_a_mirrored_knee_what_it_does_to_the_knee() {
    let Some(deck) = published("apparatus") else { return };
    let [left, right] = [problem(&deck), problem(&mirrored(deck))];
    let [own, others] = [plain(&left), plain(&right)];
    for id in EFFECTS {
        let by = |problem: &Problem, without: &[f64]| -> Vec<f64> {
            read(problem, &candidate(problem, id), SIZE).iter().zip(without).map(|(a, b)| a - b).collect()
        };
        let (a, b) = (by(&left, &own), by(&right, &others));
        let most = a.iter().map(|x| x.abs()).fold(0.0, f64::max);
        assert!(most > 0.1, "{id} moves readings by {most} at most");
        for (r, (x, y)) in a.iter().zip(&b).enumerate() {
            // the fields of the contact are sampled on other points of the same surfaces
            assert!((x - y).abs() < 0.05 + 0.02 * most, "{id}, trial {} coordinate {}: {x} {y}", r / 5, r % 5);
        }
    }
}

#[needs_shared]
fn a_strap_that_turns_with_the_shank_moves_it_to_where_the_foot_points() {
    let Some(deck) = published("apparatus") else { return };
    let problem = problem(&deck);
    let c = candidate(&problem, "load_axis");
    let (without, with) = (plain(&problem), read(&problem, &c, 1.0 / c.effect.parameter[0].sd));
    let rotation = without[IE.free_index()];
    let sideways = with[ML.free_index()] - without[ML.free_index()];
    // the forward drawer, of a knee that a moment has turned
    assert!(rotation.abs() > 3.0, "the knee is turned by {rotation} deg");
    assert!(sideways * rotation > 0.0, "{sideways} mm at {rotation} deg");
    // and of its pull forward little is lost
    assert!((with[AP.free_index()] - without[AP.free_index()]).abs() < 2.0);
}

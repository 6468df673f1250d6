//! Two effects at once, of which each may stand for part of the other.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::shared;
use calibration::options::CalibrateOptions;
use diagnosis::effect::candidate::Candidate;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::trial::Source;
use diagnosis::problem::trial::row_of;
use diagnosis::problem::{Begin, Problem};
use diagnosis::report::scope_name;
use diagnosis::search::{DiagnosisOptions, Searcher};
use needs_shared::needs_shared;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sim::coordinate::FREE;

/// The published deck's question, its readings those of the model itself with two effects hidden (sizes in units of their priors), and noise.
#[expect(clippy::disallowed_methods, reason = "published data")]
fn question(hidden: &[(&str, &str, &[f64])]) -> Option<Problem> {
    let deck = shared("pairs", "published/S192803/deck")?;
    let case = shared("pairs", "blind/case_001")?;
    let mut read = |name: &str| std::fs::read(deck.join(name)).map_err(|e| e.to_string());
    let deck = decks::import("S192803_MAIN_LAXITY_Anterior_0deg_0.inp", &mut read).unwrap();
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    let sources = ["kla", "rks"].map(|name| {
        let trials = sim::laxity::read(&std::fs::read(case.join(format!("{name}.csv"))).unwrap()).unwrap().trials;
        Source::new(name, trials.into_iter().step_by(2).collect())
    });
    let mut problem =
        Problem::new(&model, &deck.spec, &sources, &Catalogue::shipped(), &CalibrateOptions::default()).unwrap();
    let mut hypothesis = Vec::new();
    let mut unknowns = vec![0.0; problem.nuisances()];
    for (id, scope, sizes) in hidden {
        let is_it = |c: &Candidate| c.effect.id == *id && scope_name(&problem, c) == *scope;
        hypothesis.push(problem.candidates().into_iter().find(is_it).unwrap());
        unknowns.extend_from_slice(sizes);
    }
    let readings = problem.linear(&hypothesis, &unknowns, Begin::At(&[])).unwrap().value;
    let mut random = ChaCha8Rng::seed_from_u64(11);
    // the sum of four uniform numbers, of standard deviation 1
    let mut noise = || (0..4).map(|_| random.random::<f64>() - 0.5).sum::<f64>() * 3f64.sqrt();
    for (i, trial) in problem.trials.iter_mut().enumerate() {
        for c in FREE {
            trial.record.measured[c] = Some(readings[row_of(i, c)] + trial.sd[c] * noise());
        }
    }
    // poses held at what is measured are found anew
    Some(problem.with_present(vec![]))
}

fn found(hidden: &[(&str, &str, &[f64])]) -> Option<Vec<(String, String)>> {
    let problem = question(hidden)?;
    let options = DiagnosisOptions::default();
    let best = Searcher { problem: &problem, options: &options }.search().unwrap().rivals.remove(0);
    let mut named: Vec<(String, String)> =
        best.hypothesis.iter().map(|c| (c.name(), scope_name(&problem, c))).collect();
    named.sort();
    Some(named)
}

#[needs_shared]
fn both_frames_turned_in_one_data_set_are_found() {
    let hidden: [(&str, &str, &[f64]); 2] = [("femur_frame", "kla", &[1.2, 1.0]), ("tibia_frame", "kla", &[-1.1, 1.1])];
    let Some(named) = found(&hidden) else { return };
    let asked = hidden.map(|(id, scope, _)| (id.to_owned(), scope.to_owned()));
    assert_eq!(named, asked);
}

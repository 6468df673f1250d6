//! A trial that jumped is told by its row, and by the reading that jumped.
#![allow(clippy::unwrap_used, reason = "tests")]

use crate::common::asked::asked;
use crate::common::deck::{published, source};
use crate::suspects::TRIALS;
use calibration::options::CalibrateOptions;
use diagnosis::diagnosis::{Calibration, diagnose};
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::{Problem, reading};
use diagnosis::search::DiagnosisOptions;
use needs_shared::needs_shared;
use sim::coordinate::{FREE, IE};

/// The trial that jumps, and by how much [deg]: 24 of its noises.
const JUMPS: (usize, f64) = (4, 12.0);

#[needs_shared]
fn a_trial_that_jumped_is_told_by_its_row_and_no_other_is() {
    let Some(deck) = published("jumps") else { return };
    let (catalogue, calibrate) = (Catalogue::shipped(), CalibrateOptions::default());
    let model = diagnosis::problem::rim::prepared(&deck.spec, &deck.meshes, &calibrate.search).unwrap();
    let of = |measured: &[[f64; 5]]| [source("rks", &asked(&TRIALS, measured))];
    let anywhere = of(&[[0.0, 0.0, 0.0, 0.0, -21.0]; 12]);
    let problem = Problem::new(&model, &deck.spec, &anywhere, &catalogue, &calibrate).unwrap();
    let rests = problem.rests(&[], &vec![0.0; problem.nuisances()], &[]).unwrap();
    let mut measured: Vec<[f64; 5]> = rests.iter().map(|rest| FREE.map(|c| reading(rest)[c])).collect();
    let (jumped, by) = JUMPS;
    measured[jumped][IE.free_index()] += by;

    let options =
        DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
    let calibration = Calibration { options: &calibrate, mode: None };
    let outcome = diagnose(&model, &deck.spec, &of(&measured), &catalogue, &options, calibration).unwrap();
    let told = outcome.diagnosis.description;
    let aside = told.split("Set aside as outliers: ").nth(1).unwrap_or_else(|| panic!("{told}"));
    let aside = aside.split(" With ligaments").next().unwrap_or(aside);
    // the header is row 1
    assert!(aside.starts_with(&format!("row {} of rks", jumped + 2)) && aside.contains(" of IE "), "{aside}");
    assert_eq!(aside.matches(" reads ").count(), 1, "{aside}");
}

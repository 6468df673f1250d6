//! Laws of a diagnosis on the small knee of tests/corpus: they need no shared data.
#![allow(clippy::unwrap_used, reason = "tests")]

mod effects;
mod named;

#[path = "../../tests/common/knee.rs"]
mod knee;

use crate::mirrored::mirrored;
use calibration::options::CalibrateOptions;
use decks::ImportedDeck;
use diagnosis::diagnosis::{Calibration, Diagnosis, diagnose};
use diagnosis::effect::candidate::Candidate;
use diagnosis::effect::catalogue::Catalogue;
use diagnosis::problem::trial::Source;
use diagnosis::problem::{Problem, reading};
use diagnosis::search::DiagnosisOptions;
use inference::random::{normal, stream};
use sim::Model;
use sim::coordinate::{FREE, Free};
use sim::mesh::MeshValue;
use sim::spec::ModelSpec;
use std::collections::BTreeMap;

/// The small knee, ready for a diagnosis.
struct Small {
    spec: ModelSpec,
    model: Model,
}

impl Small {
    fn new() -> Small {
        let (spec, meshes) = knee::small();
        Small::of(spec, &meshes)
    }

    fn of(spec: ModelSpec, meshes: &BTreeMap<String, MeshValue>) -> Small {
        let search = CalibrateOptions::default().search;
        let model = diagnosis::problem::rim::prepared(&spec, meshes, &search).unwrap();
        Small { spec, model }
    }

    /// The knee of the other side.
    fn mirrored() -> Small {
        let (spec, meshes) = knee::small();
        let ImportedDeck { spec, meshes, .. } = mirrored(ImportedDeck { spec, meshes, warnings: Vec::new() });
        Small::of(spec, &meshes)
    }

    /// The question of these data sets.
    fn asked(&self, sources: &[Source]) -> Problem {
        Problem::new(&self.model, &self.spec, sources, &Catalogue::shipped(), &CalibrateOptions::default()).unwrap()
    }

    /// Puts into data sets what the knee itself answers, a structure torn or none, with so many of its stated noises of scatter.
    fn measure(&self, sources: &mut [Source], torn: Option<&str>, noises: f64) {
        let problem = self.asked(sources);
        let hidden: Vec<Candidate> = torn.map(|structure| loss(&problem, structure)).into_iter().collect();
        let whole = hidden.iter().map(|c| 1.0 / c.effect.parameter[0].sd);
        let unknowns: Vec<f64> = vec![0.0; problem.nuisances()].into_iter().chain(whole).collect();
        let rests = problem.rests(&hidden, &unknowns, &[]).unwrap();
        let mut random = stream(7, 0);
        let trials = sources.iter_mut().flat_map(|s| &mut s.trials);
        for (own, (trial, rest)) in trials.zip(problem.trials.iter().zip(&rests)) {
            let there = reading(rest);
            let mut out = Free::all(None);
            FREE.into_iter().for_each(|c| out[c] = Some(there[c] + noises * trial.sd[c] * normal(&mut random)));
            own.measured = out;
        }
    }

    /// What a short diagnosis says of them.
    fn told(&self, sources: &[Source]) -> Diagnosis {
        let options =
            DiagnosisOptions { nulls: 50, most_effects: 1, shortlist: 2, folds: 2, ..DiagnosisOptions::default() };
        let usual = CalibrateOptions::default();
        let calibration = Calibration { options: &usual, mode: None };
        diagnose(&self.model, &self.spec, sources, &Catalogue::shipped(), &options, calibration).unwrap().diagnosis
    }
}

/// The loss of a structure, as the catalogue has it.
fn loss(problem: &Problem, structure: &str) -> Candidate {
    let is_it = |c: &Candidate| c.effect.id == "structure_loss" && c.variant_name().as_deref() == Some(structure);
    problem.candidates().into_iter().find(is_it).unwrap()
}

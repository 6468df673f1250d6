//! Explicit dynamics on the published knee: against the quasi-static solver, and the deck's own steps.
#![expect(clippy::disallowed_methods, reason = "reads ../shared where it is there")]
#![expect(clippy::print_stdout, reason = "figures for the reader of the log")]
#![expect(clippy::unwrap_used, reason = "a test's helpers")]

use crate::common::shared;
use decks::{ImportedDeck, import};
use needs_shared::needs_shared;
use sim::Model;
use sim::coordinate::{FE, Load, Six};
use sim::explicit::{ExplicitOptions, ExplicitState, TrialSteps, deck_program, run, snapshot, unobserved};
use sim::steps::{StepOptions, follow_program};
use sim::trials::{TrialOptions, solve};

/// The deck of a trial and its model.
fn deck(test: &str, trial: &str) -> Option<(ImportedDeck, Model)> {
    let dir = shared(test, "published/S192803/deck")?;
    let main = format!("S192803_MAIN_LAXITY_{trial}.inp");
    let deck = import(&main, &mut |name: &str| std::fs::read(dir.join(name)).map_err(|e| e.to_string())).unwrap();
    let model = sim::compile(&deck.spec, &deck.meshes).unwrap();
    Some((deck, model))
}

/// The quasi-static answer on a path fine enough to resolve friction's history.
fn quasi_static(model: &Model, fe_deg: f64, load: &Load) -> Six {
    let mut options = TrialOptions { increments: [24, 144, 32], ..TrialOptions::default() };
    options.solver.step_on_the_way_mm = 1e-5;
    model.joint.grood_suntay(&solve(model, fe_deg, load, &options).unwrap().state.q)
}

/// Largest difference of two poses, in degrees and mm, flexion left out.
fn apart(a: &Six, b: &Six) -> f64 {
    let d = a - b;
    (1..6).map(|c| if c < 3 { d[c].to_degrees().abs() } else { d[c].abs() }).fold(0.0, f64::max)
}

#[needs_shared]
fn the_papers_steps_end_where_the_quasi_static_path_does() {
    let Some((_, model)) = deck("explicit against quasi-static", "Anterior_30deg_10") else { return };
    for (name, fe, load) in [
        ("Anterior_30deg_20", 20.3, Load::new(0.0, 0.0, 0.0, 88.9644, 20.0)),
        ("Anterior_90deg_40", 84.5, Load::new(0.0, 0.0, 0.0, 177.9288, 20.0)),
        ("Internal_90deg_10", 84.5, Load::new(0.0, -2.824621, 0.0, 0.0, 20.0)),
        ("External_30deg_5", 23.6, Load::new(0.0, 1.4123105, 0.0, 0.0, 20.0)),
    ] {
        let program = TrialSteps::default().program(&model.joint, fe, &load.generalised()).unwrap();
        let mut state = ExplicitState::at_rest();
        run(&model, &program, &ExplicitOptions::default(), &mut state, &mut unobserved).unwrap();
        let there = model.joint.grood_suntay(&state.q);
        let miss = apart(&there, &quasi_static(&model, fe, &load));
        let balance = state.energies.balance_error();
        println!("{name}: {miss:.4} mm or deg apart, {} increments, balance {balance:.1e}", state.increments);
        assert!(miss < 0.02 && balance < 1e-3 && state.rate.amax() < 1e-6);
    }
}

#[needs_shared]
fn the_decks_own_steps_run_with_their_quirks() {
    let Some((deck, model)) = deck("the deck's steps", "External_30deg_10") else { return };
    let program = deck_program(&model.joint, deck.spec.frames.chain.as_ref(), &deck.spec.protocols[0]);
    let mut state = ExplicitState::at_rest();
    run(&model, &program, &ExplicitOptions::default(), &mut state, &mut unobserved).unwrap();
    let there = snapshot(&model, &program, &state).unwrap().grood_suntay;
    let dir = shared("the deck's steps", "published/S192803/laxity_targets.csv").unwrap();
    let mut rows = csv::Reader::from_path(dir).unwrap();
    let header = rows.headers().unwrap().clone();
    let column = |name: &str| header.iter().position(|h| h == name).unwrap();
    let (trial, source) = (column("trial"), column("source"));
    let row = rows.records().map(Result::unwrap).find(|r| &r[trial] == "External_30deg_10" && &r[source] == "KLA_MRI");
    let row = row.unwrap();
    let number = |name: &str| row[column(name)].parse::<f64>().unwrap();
    let fe = number("deck_final_GS_FE_deg");
    let still = follow_program(&model, &program, &StepOptions::default()).unwrap();
    let miss = apart(&there, &model.joint.grood_suntay(&still.q));
    println!(
        "deck's steps: flexion {:.4} deg for {fe:.4}, {miss:.4} mm or deg from the quasi-static path along them, {} increments, balance {:.1e}",
        there[FE].to_degrees(),
        state.increments,
        state.energies.balance_error()
    );
    // the chain's flexion stands for Grood-Suntay's to a few thousandths of a degree
    assert!((there[FE].to_degrees() - fe).abs() < 5e-3);
    assert!(state.energies.balance_error() < 0.01 && miss < 0.02);
}

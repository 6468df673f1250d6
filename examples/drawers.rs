//! The 90 N drawer of models, intact and without ACL, beside cadavers: `cargo run --release --example drawers -- MODEL...`
//!
//! Prints a table a model: how far the tibia comes forward of its unloaded pose, the cadavers' mean and scatter, by how many scatters the model is off.
//! The cadavers are twelve knees [drawer2020, table 1]. docs/drawers.md holds the tables.
#![expect(clippy::print_stderr, clippy::print_stdout, reason = "a table for the reader")]

use genu::error::BuildError;
use genu::model_file;
use sim::coordinate::{AP, Load};
use sim::laxity::{LaxityTrial, Test};
use sim::model::{Model, compile};
use sim::trials::{Answer, TrialOptions, solve_trials};
use std::path::Path;
use std::process::ExitCode;

/// Flexion [deg], then mean and standard deviation of the drawer [mm] of the intact knee and of that without ACL.
const CADAVERS: [(f64, [[f64; 2]; 2]); 10] = [
    (0.0, [[4.0, 1.4], [10.0, 2.9]]),
    (10.0, [[5.4, 1.8], [12.4, 2.1]]),
    (20.0, [[5.9, 2.3], [13.2, 2.2]]),
    (30.0, [[6.0, 2.5], [12.9, 2.5]]),
    (40.0, [[5.6, 2.5], [11.8, 2.7]]),
    (50.0, [[5.2, 2.5], [10.4, 2.9]]),
    (60.0, [[4.7, 2.4], [9.4, 2.7]]),
    (70.0, [[4.2, 2.3], [8.5, 2.6]]),
    (80.0, [[3.9, 2.2], [7.9, 2.6]]),
    (90.0, [[3.7, 2.3], [7.7, 2.5]]),
];

/// The drawer [N]; the cadavers'.
const DRAWER_N: f64 = 90.0;
/// Compression of the joint [N]; as in the published decks.
const COMPRESSION_N: f64 = 20.0;
/// Scatters within which a model is like the cadavers [-].
const ALIKE: f64 = 2.0;

fn main() -> ExitCode {
    let models: Vec<String> = std::env::args().skip(1).collect();
    if models.is_empty() {
        eprintln!("usage: drawers MODEL... (model.json, or the folder of a build)");
        return ExitCode::from(2);
    }
    for model in &models {
        if let Err(e) = table(Path::new(model)) {
            eprintln!("{e}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn table(path: &Path) -> Result<(), BuildError> {
    let loaded = model_file::load(path)?;
    let fault = |e: sim::SimError| BuildError::File(format!("{}: {e}", path.display()));
    let intact = compile(&loaded.spec, &loaded.meshes).map_err(fault)?;
    let cut = intact.without(&["ACL".into()]).map_err(fault)?;
    println!("\n{}, {}\n", loaded.label(), if loaded.spec.menisci.is_empty() { "no menisci" } else { "menisci" });
    println!("| flexion deg | intact mm | cadavers | off by sd | without ACL mm | cadavers | off by sd | flags |");
    println!("|---|---|---|---|---|---|---|---|");
    let answers = [drawn(&intact).map_err(fault)?, drawn(&cut).map_err(fault)?];
    let mut alike = [0; 2];
    for (k, (flexion, cadavers)) in CADAVERS.iter().enumerate() {
        let mut row = format!("| {flexion} ");
        for (state, [mean, sd]) in cadavers.iter().enumerate() {
            let [rest, drawn] = &answers[state][k];
            let drawer = drawn.predicted()[AP] - rest.predicted()[AP];
            let off = (drawer - mean) / sd;
            alike[state] += usize::from(off.abs() <= ALIKE);
            row += &format!("| {drawer:.1} | {mean} ({sd}) | {off:+.1} ");
        }
        let told = |k: usize, name: &str, a: &Answer| match a.flags.is_empty() {
            true => None,
            false => Some(format!("{} {name}: {}", ["intact", "cut"][k], sim::flags::sentences(&a.flags).join(", "))),
        };
        let flags = (0..2).flat_map(|s| {
            let [rest, drawn] = &answers[s][k];
            [told(s, "unloaded", rest), told(s, "drawn", drawn)]
        });
        println!("{row}| {} |", flags.flatten().collect::<Vec<_>>().join("; "));
    }
    println!("\nwithin {ALIKE} sd: intact {} of 10, without ACL {} of 10", alike[0], alike[1]);
    Ok(())
}

/// Unloaded and drawn at each flexion.
fn drawn(model: &Model) -> Result<Vec<[Answer; 2]>, sim::SimError> {
    let asked = |fe: f64, ap: f64| {
        let load = Load::new(0.0, 0.0, 0.0, ap, COMPRESSION_N);
        LaxityTrial::asked(format!("{fe} deg, {ap} N"), Test::Anterior, fe, load)
    };
    let trials: Vec<LaxityTrial> =
        CADAVERS.iter().flat_map(|(fe, _)| [asked(*fe, 0.0), asked(*fe, DRAWER_N)]).collect();
    let mut answers = solve_trials(model, &trials, &TrialOptions::default()).into_iter();
    let mut out = Vec::new();
    while let (Some(rest), Some(drawn)) = (answers.next(), answers.next()) {
        out.push([rest?, drawn?]);
    }
    Ok(out)
}

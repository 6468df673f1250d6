//! The 90 N drawer of models beside cadavers: intact, without ACL, and without ACL and ALS. `cargo run --release --example drawers -- MODEL...`
//!
//! Prints a table a model: how far the tibia comes forward of its unloaded pose, the cadavers' mean and scatter, how many scatters off the model is.
//! The cadavers are twelve knees [drawer2020, table 1]. Last stands the drawer at which it gives way without ACL. A knee without equilibrium is a
//! row that says so, and counts as unlike the cadavers. So does one that is dislocated before it is drawn.
//! Behind these tables stands a second one a model, of rotations, varus and valgus, and the posterior drawer: cadavers.csv.
//! docs/drawers.md holds the tables.
#![expect(clippy::print_stderr, clippy::print_stdout, reason = "a table for the reader")]

mod others;
mod rows;

use genu::error::BuildError;
use genu::model_file;
use sim::SimError;
use sim::coordinate::{AP, Load};
use sim::flags::Flag;
use sim::laxity::{LaxityTrial, Test};
use sim::model::{Model, compile};
use sim::trials::{Answer, TrialOptions, solve_trials};
use std::path::Path;
use std::process::ExitCode;

/// A state of a knee: its name, what is cut. What the cadavers' table calls ALL, the anterolateral ligament, a model has as ALS.
const STATES: [(&str, &[&str]); 3] =
    [("intact", &[]), ("without ACL", &["ACL"]), ("without ACL and ALS", &["ACL", "ALS"])];

/// Flexion [deg], then mean and standard deviation of the drawer [mm] in each state.
const CADAVERS: [(f64, [[f64; 2]; 3]); 10] = [
    (0.0, [[4.0, 1.4], [10.0, 2.9], [10.3, 2.9]]),
    (10.0, [[5.4, 1.8], [12.4, 2.1], [12.8, 1.9]]),
    (20.0, [[5.9, 2.3], [13.2, 2.2], [14.0, 2.2]]),
    (30.0, [[6.0, 2.5], [12.9, 2.5], [13.6, 2.7]]),
    (40.0, [[5.6, 2.5], [11.8, 2.7], [12.5, 3.1]]),
    (50.0, [[5.2, 2.5], [10.4, 2.9], [11.2, 3.3]]),
    (60.0, [[4.7, 2.4], [9.4, 2.7], [10.1, 3.3]]),
    (70.0, [[4.2, 2.3], [8.5, 2.6], [9.2, 3.3]]),
    (80.0, [[3.9, 2.2], [7.9, 2.6], [8.5, 2.9]]),
    (90.0, [[3.7, 2.3], [7.7, 2.5], [8.3, 3.1]]),
];

/// The drawer [N]; the cadavers'.
const DRAWER_N: f64 = 90.0;
/// Compression of the joint [N]; as in the published decks.
const COMPRESSION_N: f64 = 20.0;
/// Scatters within which a model is like the cadavers [-].
const ALIKE: f64 = 2.0;
/// The drawer is raised by so much at a time, so often, to find where the knee gives way [N], [-]; ours.
const STEPS: (f64, u8) = (10.0, 15);
/// A knee gives way where its tibia comes so much further within a step [mm]; ours: S192803 without ACL never does.
const GIVES_MM: f64 = 5.0;
/// What stands where the solver finds no pose.
pub(crate) const NONE: &str = "no equilibrium";

/// The answers of a state at a flexion, unloaded and drawn; none where there is no equilibrium.
type Drawn = [Option<Answer>; 2];

fn main() -> ExitCode {
    let models: Vec<String> = std::env::args().skip(1).collect();
    if models.is_empty() {
        eprintln!("usage: drawers MODEL... (model.json, or the folder of a build)");
        return ExitCode::from(2);
    }
    for of in [table, others::table] {
        for model in &models {
            if let Err(e) = of(Path::new(model)) {
                eprintln!("{e}");
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}

fn table(path: &Path) -> Result<(), BuildError> {
    let loaded = model_file::load(path)?;
    let fault = |e: SimError| BuildError::File(format!("{}: {e}", path.display()));
    let intact = compile(&loaded.spec, &loaded.meshes).map_err(fault)?;
    // a model that has no ALS is not asked without it
    let has_als = loaded.spec.bundles.iter().any(|b| b.name == "ALS");
    let states = &STATES[..if has_als { 3 } else { 2 }];
    println!("\n{}, {}\n", loaded.label(), if loaded.spec.menisci.is_empty() { "no menisci" } else { "menisci" });
    let heads: String = states.iter().map(|(name, _)| format!(" {name} mm | cadavers | off by sd |")).collect();
    println!("| flexion deg |{heads} gives way at N | flags |\n|---|{}---|---|", "---|---|---|".repeat(states.len()));
    let mut answers = Vec::new();
    for (_, cut) in states {
        let cut: Vec<String> = cut.iter().map(|name| (*name).to_owned()).collect();
        answers.push(drawn(&intact.without(&cut).map_err(fault)?).map_err(fault)?);
    }
    let gives = gives_way(&intact.without(&["ACL".into()]).map_err(fault)?);
    let mut alike = vec![0; states.len()];
    for (k, (flexion, cadavers)) in CADAVERS.iter().enumerate() {
        let mut row = format!("| {flexion} ");
        for (state, of) in answers.iter().enumerate() {
            let (told, is_alike) = cells(&of[k], cadavers[state]);
            row += &told;
            // a knee without equilibrium is not like a cadaver
            alike[state] += usize::from(is_alike);
        }
        let flags = states.iter().zip(&answers).flat_map(|((state, _), of)| odd(state, &of[k]));
        println!("{row}| {} | {} |", gives[k], flags.collect::<Vec<_>>().join("; "));
    }
    let sums: Vec<String> = states.iter().zip(&alike).map(|((name, _), n)| format!("{name} {n} of 10")).collect();
    println!("\nwithin {ALIKE} sd: {}", sums.join(", "));
    Ok(())
}

/// Cells of a state at a flexion: drawer, cadavers, how far it is off; and whether it is like them.
fn cells(drawn: &Drawn, [mean, sd]: [f64; 2]) -> (String, bool) {
    let [Some(rest), Some(drawn)] = drawn else {
        return (format!("| {NONE} | {mean} ({sd}) | "), false);
    };
    let drawer = drawn.predicted()[AP] - rest.predicted()[AP];
    let off = (drawer - mean) / sd;
    // a way between two poses off the plateau may be of any length
    let is_alike = off.abs() <= ALIKE && !rest.flags.contains(&Flag::Dislocated);
    (format!("| {drawer:.1} | {mean} ({sd}) | {off:+.1} "), is_alike)
}

/// What is odd of a state at a flexion, in words.
fn odd(state: &str, drawn: &Drawn) -> Vec<String> {
    let named = ["unloaded", "drawn"].into_iter().zip(drawn);
    let told = named.filter_map(|(name, answer)| {
        let own = answer.as_ref().map_or_else(|| vec![NONE.to_owned()], |a| sim::flags::sentences(&a.flags));
        (!own.is_empty()).then(|| format!("{state}, {name}: {}", own.join(", ")))
    });
    told.collect()
}

/// A drawer at a flexion.
fn asked(fe: f64, ap: f64) -> LaxityTrial {
    let load = Load::new(0.0, 0.0, 0.0, ap, COMPRESSION_N);
    LaxityTrial::asked(format!("{fe} deg, {ap} N"), Test::Anterior, fe, load)
}

/// The drawer at which the knee gives way, at each flexion, in words.
fn gives_way(model: &Model) -> Vec<String> {
    let (step, count) = STEPS;
    let at = |(fe, _): &(f64, [[f64; 2]; 3])| {
        let trials: Vec<LaxityTrial> = (0..=count).map(|k| asked(*fe, step * f64::from(k))).collect();
        let answers = solve_trials(model, &trials, &TrialOptions::default());
        let ap: Vec<Option<f64>> = answers.into_iter().map(|a| a.ok().map(|a| a.predicted()[AP])).collect();
        // a step to a drawer without equilibrium has no length
        let gives = |pair: &[Option<f64>]| pair[0].zip(pair[1]).is_some_and(|(a, b)| b - a > GIVES_MM);
        let first = ap.windows(2).position(gives).map(|k| trials[k + 1].load[AP]);
        let lost = ap.iter().position(Option::is_none).map(|k| trials[k].load[AP]);
        match (first, lost) {
            (Some(n), _) => format!("{n}"),
            // whether it gave way there is not known
            (None, Some(n)) => format!("{NONE} at {n}"),
            (None, None) => format!("over {}", step * f64::from(count)),
        }
    };
    CADAVERS.iter().map(at).collect()
}

/// Unloaded and drawn at each flexion.
///
/// Errors: what was asked is at fault.
fn drawn(model: &Model) -> Result<Vec<Drawn>, SimError> {
    let trials: Vec<LaxityTrial> =
        CADAVERS.iter().flat_map(|(fe, _)| [asked(*fe, 0.0), asked(*fe, DRAWER_N)]).collect();
    let mut answers = solve_trials(model, &trials, &TrialOptions::default()).into_iter();
    let mut out = Vec::new();
    while let (Some(rest), Some(drawn)) = (answers.next(), answers.next()) {
        out.push([found(rest)?, found(drawn)?]);
    }
    Ok(out)
}

/// An answer; none where the solver finds no equilibrium.
///
/// Errors: what was asked is at fault.
fn found(answer: Result<Answer, SimError>) -> Result<Option<Answer>, SimError> {
    match answer {
        Ok(answer) => Ok(Some(answer)),
        Err(SimError::Solver(_)) => Ok(None),
        Err(e) => Err(e),
    }
}

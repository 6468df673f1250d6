//! Rotations, varus and valgus, and the posterior drawer of a model beside cadavers: the rows of cadavers.csv.

use crate::rows::{Push, Row, Spread, rows};
use crate::{ALIKE, COMPRESSION_N, NONE};
use genu::error::BuildError;
use genu::model_file;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use sim::SimError;
use sim::coordinate::Load;
use sim::laxity::{LaxityTrial, Test};
use sim::model::{Model, compile};
use sim::trials::{Answer, TrialOptions, solve_trials};
use std::path::Path;

/// What a model does under the load of a row.
struct Moved {
    /// From its unloaded pose, in the load's direction; the sum of both directions where a row is of a range [deg, mm].
    motion: f64,
    /// What is odd, in words.
    flags: String,
}

/// What came of a row.
enum Answered {
    /// The model has a pose under each load.
    Moved(Moved),
    /// The model lacks a ligament that the row cuts: which, in words. The row is not asked of it.
    NotInModel(String),
    /// There is no pose: why, in words.
    Nowhere(String),
}

/// Prints every row of a model, and how many lie within [`ALIKE`] scatters.
///
/// Errors: a table or a model that cannot be read.
pub(crate) fn table(path: &Path) -> Result<(), BuildError> {
    let rows = rows()?;
    let loaded = model_file::load(path)?;
    let intact =
        compile(&loaded.spec, &loaded.meshes).map_err(|e| BuildError::File(format!("{}: {e}", path.display())))?;
    println!("\n{}, other loads\n", loaded.label());
    println!("| source (knees) | test | state | flexion deg | model | cadavers (sd) | off by sd | flags |");
    println!("|---|---|---|---|---|---|---|---|");
    let answers: Vec<Answered> = rows.par_iter().map(|row| answered(&intact, row)).collect();
    let offs: Vec<Option<f64>> = rows.iter().zip(&answers).map(|(row, answer)| off(row, answer)).collect();
    for ((row, answer), off) in rows.iter().zip(&answers).zip(&offs) {
        println!("{}", line(row, answer, *off));
    }
    sums(&rows, &offs);
    Ok(())
}

/// A row's line.
fn line(row: &Row, answer: &Answered, off: Option<f64>) -> String {
    let (motion, flags) = match answer {
        Answered::Moved(moved) => (format!("{:.1} {}", moved.motion, row.unit), moved.flags.clone()),
        Answered::NotInModel(why) => ("not in the model".to_owned(), why.clone()),
        Answered::Nowhere(why) => (NONE.to_owned(), why.clone()),
    };
    let off = off.filter(|off| off.is_finite()).map_or(String::new(), |off| format!("{off:+.1}"));
    let (source, test, cadavers) = (row.source_told(), row.test_told(), row.cadavers_told());
    format!("| {source} | {test} | {} | {} | {motion} | {cadavers} | {off} | {flags} |", row.state, row.fe_deg)
}

/// How many scatters a model is off [-]: none where no scatter was told or the row was not asked, without end where the model has no pose.
fn off(row: &Row, answer: &Answered) -> Option<f64> {
    let sd = row.sd?;
    match answer {
        Answered::Moved(moved) => Some((moved.motion - row.mean) / sd),
        Answered::NotInModel(_) => None,
        Answered::Nowhere(_) => Some(f64::INFINITY),
    }
}

/// Prints how many rows lie within [`ALIKE`] scatters: in all, by what the scatter is, by test. Rows without a scatter do not count, nor do
/// those that were not asked.
fn sums(rows: &[Row], offs: &[Option<f64>]) {
    let count = |wanted: &dyn Fn(&Row) -> bool| {
        let offs: Vec<f64> = rows.iter().zip(offs).filter(|(row, _)| wanted(row)).filter_map(|(_, off)| *off).collect();
        let alike = offs.iter().filter(|off| off.abs() <= ALIKE).count();
        (alike, offs.len())
    };
    let told = |(alike, of): (usize, usize)| format!("{alike} of {of}");
    let sd = told(count(&|row| row.spread == Spread::Sd));
    let bar = told(count(&|row| row.spread == Spread::Bar));
    println!("\nwithin {ALIKE} sd: {}; by standard deviations {sd}, by error bars {bar}", told(count(&|_| true)));
    let mut tests: Vec<&str> = rows.iter().map(|row| row.test.as_str()).collect();
    tests.sort_unstable();
    tests.dedup();
    let by_test = tests.into_iter().filter_map(|name| {
        let (alike, of) = count(&|row| row.test == name);
        (of > 0).then(|| format!("{name} {}", told((alike, of))))
    });
    println!("by test: {}", by_test.collect::<Vec<_>>().join(", "));
}

/// What comes of a row.
fn answered(intact: &Model, row: &Row) -> Answered {
    // a cut fails where the model lacks the ligament, and nowhere else
    let model = match intact.without(&row.cut) {
        Ok(model) => model,
        Err(e) => return Answered::NotInModel(e.to_string()),
    };
    moved(&model, row).map_or_else(|e| Answered::Nowhere(e.to_string()), Answered::Moved)
}

/// What a model, cut as the row asks, does in it.
///
/// Errors: a pose without equilibrium.
fn moved(model: &Model, row: &Row) -> Result<Moved, SimError> {
    let mut trials = vec![asked(row, None)];
    trials.extend(row.pushes.iter().map(|push| asked(row, Some(push))));
    let solved = solve_trials(model, &trials, &TrialOptions::default());
    let answers: Vec<Answer> = solved.into_iter().collect::<Result<_, _>>()?;
    let mut motion = 0.0;
    for (push, answer) in row.pushes.iter().zip(&answers[1..]) {
        motion += push.sign * (answer.predicted()[push.coordinate] - answers[0].predicted()[push.coordinate]);
    }
    let odd = trials.iter().zip(&answers).filter(|(_, answer)| !answer.flags.is_empty());
    let told = odd.map(|(trial, answer)| {
        let name = if trial.test == Test::Neutral { "unloaded" } else { trial.test.name() };
        format!("{name}: {}", sim::flags::sentences(&answer.flags).join(", "))
    });
    let flags = told.collect::<Vec<_>>().join("; ");
    Ok(Moved { motion, flags })
}

/// The trial of a row's load in one direction; without one, unloaded.
fn asked(row: &Row, push: Option<&Push>) -> LaxityTrial {
    let mut load = Load::compression(COMPRESSION_N);
    if let Some(push) = push {
        load.0[push.coordinate] = push.sign * row.load;
    }
    let test = push.map_or(Test::Neutral, |push| push.test);
    LaxityTrial::asked(format!("{} deg, {}", row.fe_deg, test.name()), test, row.fe_deg, load)
}

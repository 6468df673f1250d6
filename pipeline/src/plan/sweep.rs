//! `plan --sweep`: many plans of one knee that differ in the choices of one graft. What does not differ is asked once.

mod choice;
mod file;
mod page;
mod row;

use super::PlanArgs;
use super::file::PlanFile;
use super::ground::{Before, Ground};
use super::outcome::outcome_on;
use crate::error::{BuildError, Place};
use crate::model_file::LoadedModel;
use crate::progress::Searching;
use crate::store;
use crate::told::{ModelTold, Told};
use calibration::samples::Samples;
pub(super) use file::{EXAMPLE, Sweep, read};
use notices::{Kind, Notice};
use rayon::prelude::*;
use row::Row;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Version of `plan --sweep --json`.
pub const SCHEMA: &str = "sweep/1";

/// So many of the best plans are told [-]; ours: a page has room for them.
const BEST: usize = 20;
/// So many of them on a terminal [-].
const ON_A_TERMINAL: usize = 3;

/// `plan --sweep --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct SweepTold {
    /// sweep/1
    pub schema: &'static str,
    /// The plan's name.
    pub plan: String,
    /// The model.
    pub model: ModelTold,
    /// The graft that is varied.
    pub graft: String,
    /// The choices, and the values of each.
    pub varied: BTreeMap<String, Vec<f64>>,
    /// How many plans were asked.
    pub plans: usize,
    /// How many of them could be done.
    pub done: usize,
    /// Samples of the posterior by which intervals and chances stand; 0: none.
    pub samples: usize,
    /// Share of the samples between the ends of an interval [-].
    pub interval: f64,
    /// The table: a row a plan.
    pub file: String,
    /// Its columns, in order.
    pub columns: Vec<String>,
    /// The page.
    pub page: String,
    /// The best plans, at most twenty.
    pub best: Vec<BestTold>,
    /// What is odd, in sentences.
    pub warnings: Vec<String>,
    /// The same as values.
    pub notices: Vec<Notice>,
}

/// One of the best plans.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct BestTold {
    /// Its place, the best has 1.
    pub rank: usize,
    /// Its number in the table.
    pub plan: usize,
    /// Values of the choices.
    pub choices: BTreeMap<String, f64>,
    /// Its numbers by their columns; null where it has none.
    pub numbers: BTreeMap<String, Option<f64>>,
    /// What is odd about it.
    pub flags: Vec<String>,
}

/// Asks all plans of a sweep, and writes what comes of them. `notices` is what is odd about the model.
pub(super) fn swept(
    args: &PlanArgs,
    (sweep, place): (&Sweep, &Path),
    (base, loaded): (&PlanFile, &LoadedModel),
    (samples, mut notices): (Option<Samples>, Vec<Notice>),
) -> Result<Told, BuildError> {
    let fault = |what: String| BuildError::At { place: Place::of(place), told: format!("{}: {what}", place.display()) };
    let plan_fault = |what: String| {
        let file = args.plan.as_deref().unwrap_or(place);
        BuildError::At { place: Place::of(file), told: format!("{}: {what}", file.display()) }
    };
    let ground = Ground::new(&loaded.spec, &loaded.meshes, base).map_err(plan_fault)?;
    let all = sweep.all();
    // a site that is none is told before anything is solved
    let placed = |values: &Vec<f64>| {
        let placed = ground.placed(&sweep.plan(base, values)).map(drop);
        placed.map_err(|e| format!("{e}; so with {}", sweep.words(values)))
    };
    all.par_iter().map(placed).collect::<Vec<_>>().into_iter().collect::<Result<Vec<()>, _>>().map_err(fault)?;
    let asked = samples.as_ref().map_or(0, Samples::len);
    let bar = Searching::new(args.quiet, "plans");
    bar.show(0.0, "the knee before a graft is in");
    let before = ground.before(&loaded.meshes, samples);
    let mut rows = rows(sweep, base, (&ground, &before, &all), &bar);
    drop(bar);
    row::rank(&mut rows);
    notices.extend(base.odd());
    notices.extend(odd(&rows));
    let told = sweep_told(args, (sweep, base, loaded), (&rows, asked, before.interval), notices);
    let files = vec![
        ("sweep.csv".to_owned(), row::csv(sweep, &rows)),
        ("sweep.html".to_owned(), page::page(sweep, base, &rows, (&told, &loaded.label())).into_bytes()),
    ];
    store::write_all(&args.out, &files)?;
    let words = loaded.line()
        + &in_words(sweep, &rows, &told)
        + &format!("sweep.csv and sweep.html in {}\n", args.out.display());
    Ok(Told::words(words).odd(told.notices.clone()).with(&told))
}

/// Every plan as a row, in the order of the values.
fn rows(
    sweep: &Sweep,
    base: &PlanFile,
    (ground, before, all): (&Ground, &Before, &[Vec<f64>]),
    bar: &Searching,
) -> Vec<Row> {
    let done = AtomicUsize::new(0);
    let one = |(k, values): (usize, &Vec<f64>)| {
        let plan = sweep.plan(base, values);
        let found = ground.operated(&plan).map(|knee| outcome_on(ground, before, (&plan, &knee)));
        let row = Row::of(k + 1, values.clone(), found, sweep.graft);
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        bar.show(done as f64 / all.len() as f64, &format!("{done} of {} plans", all.len()));
        row
    };
    all.par_iter().enumerate().map(one).collect()
}

/// What is odd about the rows together.
fn odd(rows: &[Row]) -> Vec<Notice> {
    let faults: Vec<&String> = rows.iter().filter_map(|r| r.fault.as_ref()).collect();
    let flagged = rows.iter().filter(|r| !r.flags.is_empty()).count();
    let all = rows.len();
    let lost = faults.first().map(|why| {
        let text = format!("{} of {all} plans could not be done; the first: {why}", faults.len());
        Kind::RowFlagged.notice(text).count(faults.len())
    });
    let text = format!("{flagged} of {all} plans have something odd; the column flags says what");
    let flagged = (flagged > 0).then(|| Kind::RowFlagged.notice(text).count(flagged));
    lost.into_iter().chain(flagged).collect()
}

fn sweep_told(
    args: &PlanArgs,
    (sweep, base, loaded): (&Sweep, &PlanFile, &LoadedModel),
    (rows, samples, interval): (&[Row], usize, f64),
    notices: Vec<Notice>,
) -> SweepTold {
    let by_key = |values: &[f64]| sweep.varied.iter().zip(values).map(|((c, _), x)| (c.key.to_owned(), *x)).collect();
    let best = |r: &&Row| BestTold {
        rank: r.rank.unwrap_or_default(),
        plan: r.plan,
        choices: by_key(&r.values),
        numbers: r.numbers.iter().cloned().collect(),
        flags: r.flags.clone(),
    };
    let ranked = row::ranked(rows);
    SweepTold {
        schema: SCHEMA,
        plan: base.name.clone(),
        model: ModelTold::of(loaded),
        graft: base.graft.get(sweep.graft).map_or(String::new(), |g| g.name.clone()),
        varied: sweep.varied.iter().map(|(c, values)| (c.key.to_owned(), values.clone())).collect(),
        plans: rows.len(),
        done: ranked.len(),
        samples,
        interval,
        file: args.out.join("sweep.csv").display().to_string(),
        columns: row::columns(sweep, rows),
        page: args.out.join("sweep.html").display().to_string(),
        best: ranked.iter().take(BEST).map(best).collect(),
        warnings: notices::texts(&notices),
        notices,
    }
}

/// Lines for a terminal.
fn in_words(sweep: &Sweep, rows: &[Row], told: &SweepTold) -> String {
    let mut text = format!("{} plans, {} samples each\n", told.plans, told.samples);
    for r in row::ranked(rows).into_iter().take(ON_A_TERMINAL) {
        let chance = match (r.number("chance"), r.number("restored")) {
            (Some(p), _) => format!("every test like the intact knee in {:.0} % of the samples", 100.0 * p),
            (_, Some(1.0)) => "every test like the intact knee".to_owned(),
            _ => "not every test like the intact knee".to_owned(),
        };
        let off = r.number("anterior_drawer_most_off_mm").map_or("none".into(), |x| format!("{x:.1} mm"));
        let place = r.rank.unwrap_or_default();
        let _ =
            writeln!(text, "{place}: {}: {chance}, furthest off in an anterior drawer {off}", sweep.words(&r.values));
    }
    text
}

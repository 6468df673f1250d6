//! `plan --sweep`: many plans of one knee that differ in the choices of one graft. What does not differ is asked once.

mod choice;
mod file;
mod page;
mod row;
mod subject;

use super::file::PlanFile;
use super::ground::{Before, Ground};
use super::knee::STATES;
use super::outcome::{flagged, outcome_on};
use super::{PlanArgs, of_other_plans};
use crate::error::{BuildError, Place};
use crate::model_file::LoadedModel;
use crate::progress::Searching;
use crate::record::json;
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
use subject::Subject;

/// Version of sweep.json.
pub const SCHEMA: &str = "sweep/1";

/// So many of the best plans are told [-]; ours: a page has room for them.
const BEST: usize = 20;
/// So many of them on a terminal [-].
const ON_A_TERMINAL: usize = 3;
/// What `--json` prints, as a file beside the table: its warnings hold for all of its rows.
const BESIDE: &str = "sweep.json";

/// sweep.json.
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
    notices.extend(without_a_graft(base, &ground, &before));
    let told = sweep_told(args, (sweep, base, loaded), (&rows, asked, before.interval), notices);
    let placed = ground.placed(base).or_else(|_| ground.placed(&sweep.plan(base, &all[0]))).unwrap_or_default();
    let given = page::Given { sweep, base, cut: &ground.cut, placed: &placed, seed: args.seed };
    let files = vec![
        ("sweep.csv".to_owned(), row::csv(sweep, &rows)),
        (BESIDE.to_owned(), json(&told)),
        ("sweep.html".to_owned(), page::page(&given, &rows, (&told, &loaded.label())).into_bytes()),
    ];
    store::write_all(&args.out, &files)?;
    if told.done == 0 {
        return Err(plan_fault(none_done(&rows, &args.out)));
    }
    let words = loaded.line()
        + &in_words((sweep, base), &rows, &told)
        + &format!("sweep.csv, {BESIDE} and sweep.html in {}\n", args.out.display());
    let odd = told.notices.iter().cloned().chain(of_other_plans(&args.out, &files)).collect();
    Ok(Told::words(words).odd(odd).with(&told))
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
        let found = ground.operated(&plan).map(|knee| {
            let (out, left) = outcome_on(ground, before, (&plan, &knee));
            let brief = row::brief(&plan, &knee.placed, &out);
            (out, left, brief)
        });
        let row = Row::of(k + 1, values.clone(), found, (sweep.graft, Subject::of(base)));
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        bar.show(done as f64 / all.len() as f64, &format!("{done} of {}", counted(all.len(), "plan")));
        row
    };
    all.par_iter().enumerate().map(one).collect()
}

/// A number of things by their name in the singular.
fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// Why there is no answer at all.
fn none_done(rows: &[Row], out: &Path) -> String {
    let why = rows.iter().find_map(|r| r.fault.as_deref()).unwrap_or_default();
    match rows.len() {
        1 => format!("the plan could not be done: {why}"),
        all => format!(
            "none of the {all} plans could be done; the first: {why}. sweep.csv in {} says why of each",
            out.display()
        ),
    }
}

/// A sentence where no plan restores the knee: in no sample, or without samples not in the most probable knee.
fn not_restored(rows: &[Row], base: &PlanFile) -> Option<String> {
    let done = row::ranked(rows);
    let is_in_vain = |r: &&Row| r.number("chance").or(r.number("restored")).unwrap_or(0.0) <= 0.0;
    if done.is_empty() || !done.iter().all(is_in_vain) {
        return None;
    }
    let who = match (done.len(), rows.len()) {
        (1, 1) => "The plan does not restore".to_owned(),
        (1, _) => "The one plan that could be done does not restore".to_owned(),
        (n, all) if n == all => format!("None of the {n} plans restores"),
        (n, _) => format!("None of the {n} plans that could be done restores"),
    };
    let (mm, deg) = (base.tests.restored_mm, base.tests.restored_deg);
    let of = if done.iter().any(|r| r.number("chance").is_some()) { " in any sample" } else { "" };
    Some(format!("{who} the knee within {mm} mm and {deg} deg{of}"))
}

/// What is odd about the knee before a graft is in: the same of all plans.
fn without_a_graft(base: &PlanFile, ground: &Ground, before: &Before) -> Vec<Notice> {
    let bare = PlanFile { graft: vec![], ..base.clone() };
    let Ok(knee) = ground.operated(&bare) else { return vec![] };
    let out = outcome_on(ground, before, (&bare, &knee)).0;
    // of which nothing is cut, the deficient knee is the intact one
    let (states, count) = (STATES, if ground.cut.is_empty() { 1 } else { 2 });
    let in_vain = out.notices.into_iter().filter(|n| n.kind == Kind::NoIntervals);
    in_vain.chain(out.tests.iter().flat_map(|t| flagged(t, &states[..count]))).collect()
}

/// What is odd about the rows together.
fn odd(rows: &[Row]) -> Vec<Notice> {
    let faults: Vec<&String> = rows.iter().filter_map(|r| r.fault.as_ref()).collect();
    let flagged = rows.iter().filter(|r| !r.flags.is_empty()).count();
    let all = rows.len();
    let lost = faults.first().map(|why| {
        let text = format!("{} of {} could not be done; the first: {why}", faults.len(), counted(all, "plan"));
        Kind::RowFlagged.notice(text).count(faults.len())
    });
    let who = if all == 1 { "the plan".to_owned() } else { format!("{flagged} of {all} plans") };
    let have = if flagged == 1 { "has" } else { "have" };
    let text = format!("{who} {have} something odd; the column flags says what");
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
fn in_words((sweep, base): (&Sweep, &PlanFile), rows: &[Row], told: &SweepTold) -> String {
    let mut text = counted(told.plans, "plan");
    if told.samples > 0 {
        let _ = write!(text, ", {} asked of each", counted(told.samples, "sample"));
    }
    text.push('\n');
    if let Some(none) = not_restored(rows, base) {
        let _ = writeln!(text, "{none}");
    }
    if let Some(beyond) = row::beyond_among_first(rows) {
        let _ = writeln!(text, "{beyond}");
    }
    for r in row::ranked(rows).into_iter().take(ON_A_TERMINAL) {
        let chance = match (r.share("chance"), r.number("restored")) {
            (Some(share), _) => format!("every test like the intact knee in {share} of the samples"),
            (_, Some(1.0)) => "every test like the intact knee".to_owned(),
            _ => "not every test like the intact knee".to_owned(),
        };
        let of = r.subject;
        let off = r.number(&of.most_off()).map_or("none".into(), |x| format!("{x:.1} {}", of.unit()));
        let bears = r.number("unloaded_force_n").zip(r.number("unloaded_force_at_deg"));
        let bears = bears.map_or("none".into(), |(n, deg)| format!("{n:.0} N at {deg} deg"));
        let (place, choices) = (r.rank.unwrap_or_default(), sweep.words(&r.values));
        let _ = writeln!(
            text,
            "{place}: {choices}: {chance}, furthest off in {} {off}, most graft force unloaded {bears}",
            of.several()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::file::parsed;
    use super::row::tests::row;
    use super::*;
    use crate::plan::file;

    #[test]
    fn it_is_said_where_no_plan_restores_the_knee_and_only_there() {
        let base = file::parsed(file::EXAMPLE).unwrap();
        let told = |chances: &[f64]| {
            let mut rows: Vec<Row> =
                chances.iter().enumerate().map(|(k, p)| row(k + 1, &[k as f64], *p, 1.0)).collect();
            row::rank(&mut rows);
            not_restored(&rows, &base)
        };
        let none = "None of the 2 plans restores the knee within 2 mm and 3 deg in any sample";
        assert_eq!(told(&[0.0, 0.0]).as_deref(), Some(none));
        assert_eq!(told(&[0.0]).unwrap(), "The plan does not restore the knee within 2 mm and 3 deg in any sample");
        assert!(told(&[0.0, 0.01]).is_none() && told(&[]).is_none());
    }

    #[test]
    fn one_plan_is_no_plans() {
        let base = file::parsed(file::EXAMPLE).unwrap();
        let sweep = parsed("tension_n = [40]", &base).unwrap();
        let mut odd_one = row(1, &sweep.all()[0], 0.5, 1.0);
        odd_one.flags.push("subluxed".into());
        let told = odd(&[odd_one]).remove(0);
        assert!(told.starts_with("the plan has something odd"), "{told}");
        let lost = Row { fault: Some("out of reach".into()), ..row(1, &[40.0], 0.0, 0.0) };
        assert_eq!(none_done(&[lost], Path::new("plans")), "the plan could not be done: out of reach");
    }
}

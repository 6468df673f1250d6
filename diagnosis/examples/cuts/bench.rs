//! A bench of cuts: how often a diagnosis reports the ligament that was cut, on built knees, with and without data from before.
//!
//! Each set is a line of a file of results, written when it is done. A bench that is cut off goes on from there. A file of results belongs to one program
//! and to one build of each model: begin another for others.

use crate::knee::Specimen;
use diagnosis::diagnosis::Diagnosis;
use diagnosis::report::{Named, Verdict};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

/// Ligaments that are cut whole, one at a time; those that injuries take most.
const CUT: [&str; 4] = ["ACL", "PCL", "sMCL", "LCL"];
/// Cells of a line of results: five of [`Set`], five answers, seconds [-].
const CELLS: usize = 11;
/// Standard deviations of a 95 % interval [-].
const Z: f64 = 1.96;

/// A set that is asked once.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Set {
    model: String,
    cut: String,
    before: bool,
    seed: u64,
}

/// What was said of a set.
#[derive(Clone, Debug)]
struct Row {
    verdict: String,
    reported: bool,
    first: bool,
    named: bool,
    unnamed_without: bool,
    /// States that are reported beside the cut [-].
    others: usize,
    seconds: f64,
}

/// Runs what the file of results lacks, `count` cuts of each ligament of each knee, and prints the table of all that it holds.
pub(crate) fn run(results: &Path, count: u64, knees: &[[&str; 3]]) {
    let mut done = kept(results);
    for [model, kla, rks] in knees {
        let missing = sets(model, count).into_iter().filter(|set| !done.contains_key(set)).collect::<Vec<_>>();
        if missing.is_empty() {
            continue;
        }
        let specimen = Specimen::read(model, [kla, rks]);
        for set in missing {
            let row = asked(&specimen, &set);
            append(results, &line(&set, &row));
            done.insert(set, row);
        }
    }
    let models: BTreeSet<&str> = knees.iter().map(|k| k[0]).collect();
    done.retain(|set, _| models.contains(set.model.as_str()) && set.seed <= count);
    print!("{}", table(&done));
}

/// All sets of a model: each seed cuts each ligament, without and with data from before, so that a bench that is cut off is one of fewer.
fn sets(model: &str, count: u64) -> Vec<Set> {
    let mut out = Vec::new();
    for seed in 1..=count {
        for cut in CUT {
            out.extend([false, true].map(|before| Set { model: model.into(), cut: cut.into(), before, seed }));
        }
    }
    out
}

fn asked(specimen: &Specimen, set: &Set) -> Row {
    let begun = Instant::now();
    let before = if set.before { specimen.before(set.seed) } else { vec![] };
    let said = specimen.diagnosed(specimen.cut((&set.cut, 1.0), set.seed), before, &[]);
    said_of(&set.cut, &said.diagnosis, begun.elapsed().as_secs_f64())
}

/// What a diagnosis says of a cut, as `blind score` counts it.
fn said_of(cut: &str, d: &Diagnosis, seconds: f64) -> Row {
    let is_it =
        |state: &&[Named]| state.iter().any(|e| e.effect == "structure_loss" && e.variant.as_deref() == Some(cut));
    let states = reported(d);
    let is_reported = states.iter().any(is_it);
    let first = states.first().is_some_and(is_it);
    Row {
        verdict: format!("{:?}", d.verdict),
        reported: is_reported,
        first,
        named: first && !d.answers.is_empty(),
        unnamed_without: d.verdict == Verdict::Unnamed && !is_reported,
        others: states.iter().filter(|s| !is_it(s)).count(),
        seconds,
    }
}

/// What a diagnosis reports as possible: its answers, then what it does not exclude beside them, each once; not that nothing is missing.
fn reported(d: &Diagnosis) -> Vec<&[Named]> {
    let about = |state: &[Named]| state.iter().map(|e| (e.effect.clone(), e.variant.clone())).collect::<Vec<_>>();
    let mut seen = BTreeSet::new();
    let all = d.answers.iter().map(|a| &a.effects[..]).chain(d.not_excluded.iter().map(|n| &n.effects[..]));
    all.filter(|state| !state.is_empty() && seen.insert(about(state))).collect()
}

/// Sets that a file of results holds; a line that was cut off counts nothing.
fn kept(results: &Path) -> BTreeMap<Set, Row> {
    let text = std::fs::read_to_string(results).unwrap_or_default();
    text.lines().filter_map(of_line).collect()
}

fn of_line(line: &str) -> Option<(Set, Row)> {
    let cells: Vec<&str> = line.split('\t').collect();
    let [model, cut, before, seed, verdict, reported, first, named, unnamed, others, seconds]: [&str; CELLS] =
        cells.try_into().ok()?;
    let yes = |cell: &str| cell.parse::<bool>().ok();
    let set = Set { model: model.into(), cut: cut.into(), before: yes(before)?, seed: seed.parse().ok()? };
    let row = Row {
        verdict: verdict.into(),
        reported: yes(reported)?,
        first: yes(first)?,
        named: yes(named)?,
        unnamed_without: yes(unnamed)?,
        others: others.parse().ok()?,
        // a line that was cut off in its last number lacks the unit
        seconds: seconds.strip_suffix('s')?.parse().ok()?,
    };
    Some((set, row))
}

fn line(set: &Set, row: &Row) -> String {
    let cells = [
        set.model.clone(),
        set.cut.clone(),
        set.before.to_string(),
        set.seed.to_string(),
        row.verdict.clone(),
        row.reported.to_string(),
        row.first.to_string(),
        row.named.to_string(),
        row.unnamed_without.to_string(),
        row.others.to_string(),
        format!("{:.1}s", row.seconds),
    ];
    cells.join("\t")
}

/// Adds a line to a file. It begins with a line's end, so that a line that was cut off stays by itself.
fn append(file: &Path, line: &str) {
    let mut out = std::fs::OpenOptions::new().create(true).append(true).open(file).unwrap();
    out.write_all(format!("\n{line}").as_bytes()).unwrap();
    out.sync_all().unwrap();
}

/// The table: a row a ligament and kind of data, of each knee and of all.
fn table(done: &BTreeMap<Set, Row>) -> String {
    let mut groups: BTreeMap<(bool, &str, &str), Vec<&Row>> = BTreeMap::new();
    for (set, row) in done {
        for (model, cut) in [(set.model.as_str(), set.cut.as_str()), ("all", set.cut.as_str()), ("all", "all")] {
            groups.entry((set.before, model, cut)).or_default().push(row);
        }
    }
    let mut out = "| data from before | knee | cut | in what is reported | first of it | named first | `unnamed` without it | states beside it, median | s a set, median |\n|---|---|---|---|---|---|---|---|---|\n".to_owned();
    for ((before, model, cut), rows) in groups {
        let share = |is: fn(&Row) -> bool| share(rows.iter().filter(|r| is(r)).count(), rows.len());
        let shares = [share(|r| r.reported), share(|r| r.first), share(|r| r.named), share(|r| r.unnamed_without)];
        let others = middle(rows.iter().map(|r| r.others as f64).collect());
        let seconds = middle(rows.iter().map(|r| r.seconds).collect());
        let data = if before { "yes" } else { "no" };
        let _ = writeln!(out, "| {data} | {model} | {cut} | {} | {others:.0} | {seconds:.0} |", shares.join(" | "));
    }
    out
}

/// A share with its 95 % interval [wilson1927]: "18 of 20: 90 % (70 to 97)".
fn share(hits: usize, of: usize) -> String {
    let (n, p) = (of as f64, hits as f64 / of as f64);
    let middle = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    let [low, high] = [middle - half, middle + half].map(|x| 100.0 * (x / (1.0 + Z * Z / n)).clamp(0.0, 1.0));
    format!("{hits} of {of}: {:.0} % ({low:.0} to {high:.0})", 100.0 * p)
}

fn middle(mut of: Vec<f64>) -> f64 {
    of.sort_by(f64::total_cmp);
    of[of.len() / 2]
}

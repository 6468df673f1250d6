//! `inspect`: what each stage made.

use crate::again::building_to;
use crate::error::BuildError;
pub use crate::record::records;
use crate::record::{Failure, Record};
use crate::stage::list::{folder_name, named};
use crate::store;
use crate::suggested::{command, command_on};
use notices::{Notice, firsts};
use schemars::JsonSchema;
use serde::Serialize;
use std::ffi::OsStr;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// An entry of `inspect --json`.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum StageTold {
    /// What a stage made.
    Made {
        /// Its line of the log.
        #[serde(flatten)]
        record: Record,
        /// Its folder's name.
        folder: String,
        /// What lies there.
        files: Vec<FileTold>,
    },
    /// The last entry of a build that stopped.
    Stopped {
        /// What stopped it.
        failed: Failure,
    },
}

/// A file of a stage.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct FileTold {
    /// Its path below the stage's folder.
    pub name: String,
    /// Its size.
    pub bytes: u64,
}

/// What the stages of a build made, or one stage in full.
pub fn inspect(dir: &Path, stage: Option<&str>, json: bool) -> Result<String, BuildError> {
    let build = build_folder(dir)?;
    let records = records(&build)?;
    let failure = failure(&build);
    let Some(stage) = stage else {
        return Ok(if json {
            facts(&build, &records, failure.as_ref())
        } else {
            overview(&build, &records, failure.as_ref())
        });
    };
    let record = records.iter().find(|r| r.stage == stage).ok_or_else(|| {
        BuildError::of_file(
            &build,
            format!("{}: stage {stage} has not been run; run it: {}", build.display(), building_to(&build, stage)),
        )
    })?;
    if json {
        return Ok(facts(&build, std::slice::from_ref(record), failure.as_ref().filter(|f| f.stage == stage)));
    }
    let mut text = told(std::slice::from_ref(record), &build);
    let _ = writeln!(text, "\nfiles in {}:", build.join(folder_name(stage)).display());
    for (name, bytes) in store::sizes(&build.join(folder_name(stage))) {
        let _ = writeln!(text, "  {:>10}  {name}", size(bytes));
    }
    let metrics = serde_json::to_string_pretty(&record.metrics).unwrap_or_default();
    let _ = writeln!(text, "\nmetrics:\n{metrics}");
    Ok(text)
}

/// The table, then what the stages warn of.
fn told(records: &[Record], build: &Path) -> String {
    let warnings: String = notices(records, build).iter().map(|n| format!("warning: {n}\n")).collect();
    table(records) + &warnings
}

/// The table, the files, what it all took, and what stopped the build.
fn overview(build: &Path, records: &[Record], failure: Option<&Failure>) -> String {
    let mut text = told(records, build);
    let _ = writeln!(text, "\nfiles in {}:", build.display());
    let mut all = 0;
    for r in records {
        let files = store::sizes(&build.join(folder_name(&r.stage)));
        let sum: u64 = files.iter().map(|f| f.1).sum();
        all += sum;
        let _ = writeln!(text, "  {:16} {:3} files {:>10}", folder_name(&r.stage), files.len(), size(sum));
    }
    let seconds: f64 = records.iter().map(|r| r.seconds).sum();
    let memory = records.iter().map(|r| r.peak_memory_mib).fold(0.0, f64::max);
    let _ = writeln!(
        text,
        "{} stages, {seconds:.1} s, at most {memory:.0} MiB of memory, {} on disk",
        records.len(),
        size(all)
    );
    if let Some(f) = failure {
        let _ = writeln!(text, "stopped at {}: {}", f.stage, f.message);
    }
    text
}

/// Bytes for a reader.
fn size(bytes: u64) -> String {
    match bytes {
        0..1024 => format!("{bytes} B"),
        1024..1_048_576 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        _ => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
    }
}

/// The log as one JSON array, every stage with its folder and files; what stopped the build as a last element `{"failed": {...}}`.
fn facts(build: &Path, records: &[Record], failure: Option<&Failure>) -> String {
    let stage = |r: &Record| {
        let files = store::sizes(&build.join(folder_name(&r.stage)));
        let files = files.into_iter().map(|(name, bytes)| FileTold { name, bytes }).collect();
        StageTold::Made { record: r.clone(), folder: folder_name(&r.stage), files }
    };
    let mut all: Vec<StageTold> = records.iter().map(stage).collect();
    all.extend(failure.map(|f| StageTold::Stopped { failed: f.clone() }));
    let mut text = serde_json::to_string_pretty(&all).unwrap_or_default();
    text.push('\n');
    text
}

/// The build folder of `dir`, which is one or holds one.
pub fn build_folder(dir: &Path) -> Result<PathBuf, BuildError> {
    [dir.join("build"), dir.to_path_buf()].into_iter().find(|d| store::exists(&d.join("log.jsonl"))).ok_or_else(|| {
        let next = match (dir.exists(), store::exists(&dir.join("specimen.toml"))) {
            (false, _) => "no such file or folder; expected a build, or a specimen's folder with one".to_owned(),
            (true, true) => format!("no log.jsonl there or in build/; build it first: {}", command_on("build", dir)),
            (true, false) => {
                "no log.jsonl there or in build/; expected a build, or a specimen's folder with one".to_owned()
            }
        };
        BuildError::of_file(dir, format!("no build in {}: {next}", dir.display()))
    })
}

/// What stopped the build in `build`, if anything did.
pub fn failure(build: &Path) -> Option<Failure> {
    let path = build.join("failure.json");
    if !store::exists(&path) {
        return None;
    }
    serde_json::from_str(&store::read_text(&path).ok()?).ok()
}

/// A line a stage.
pub fn table(records: &[Record]) -> String {
    let mut text = format!("{:3} {:12} {:>8} {:>9}  metrics\n", "", "stage", "seconds", "MiB");
    for r in records {
        let number = named(&r.stage).map_or("", |s| s.number());
        let state = match (r.outdated, r.cached) {
            (true, _) => " (of an earlier run)",
            (_, true) => " (unchanged)",
            _ => "",
        };
        let _ = writeln!(
            text,
            "{number:3} {:12} {:8.2} {:9.0}  {}{state}",
            r.stage,
            r.seconds,
            r.peak_memory_mib,
            brief(&r.stage, &r.metrics)
        );
    }
    text
}

/// What the stages warn of, the first of each kind; of one stage, all. Each begins with the stage's name.
pub fn notices(records: &[Record], build: &Path) -> Vec<Notice> {
    let mut all = Vec::new();
    for r in records {
        let told = r.told();
        // one stage is told in full
        let firsts = if records.len() == 1 { told.iter().map(|n| (n, 0)).collect() } else { firsts(&told) };
        all.extend(firsts.into_iter().map(|(notice, more)| {
            let like = match more {
                0 => String::new(),
                n => {
                    let all = command("inspect", [build.as_os_str(), OsStr::new(&r.stage)]);
                    format!(" (and {n} more of this kind: {all})")
                }
            };
            Notice { text: format!("{}: {}{like}", r.stage, notice.text), ..notice.clone() }
        }));
    }
    all
}

/// The log as one JSON array.
pub fn as_json(records: &[Record]) -> String {
    let mut text = serde_json::to_string_pretty(records).unwrap_or_default();
    text.push('\n');
    text
}

/// The telling figures of a stage, on one line.
fn brief(stage: &str, metrics: &serde_json::Value) -> String {
    let mut all = Vec::new();
    numbers("", metrics, &mut all);
    let telling = named(stage).map_or(&[][..], |s| s.telling());
    let ends_so = |name: &str| telling.iter().any(|end| name.rsplit('.').next() == Some(end));
    all.into_iter()
        .filter(|(name, _)| ends_so(name))
        .map(|(name, value)| format!("{name} {value}"))
        .collect::<Vec<_>>()
        .join(", ")
}

fn numbers(prefix: &str, value: &serde_json::Value, parts: &mut Vec<(String, String)>) {
    match value {
        serde_json::Value::Object(map) => {
            for (key, value) in map {
                let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                numbers(&name, value, parts);
            }
        }
        serde_json::Value::Number(n) => {
            let short = n.as_f64().map(|x| if x.fract() == 0.0 { format!("{x}") } else { format!("{x:.3}") });
            parts.push((prefix.to_string(), short.unwrap_or_default()));
        }
        _ => {}
    }
}

//! Runs a stage: times it, digests its value, keeps it, takes it from an earlier run where nothing changed, names it when it fails.

use crate::error::BuildError;
use crate::kept::{Inputs, Kept};
use crate::options::BuildOptions;
use crate::progress::Progress;
use crate::record::{Record, hash, json};
use crate::stage::list::{Diagnose, folder_name, names};
use crate::stage::{Files, Reported, Stage, VALUE, Work, parts, section};
use crate::store::{self, BuildFolder};
use notices::Notice;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;

/// What a stage folder says of itself.
#[derive(Serialize, Deserialize, schemars::JsonSchema)]
struct Seal {
    key: String,
    digest: String,
    files: BTreeMap<String, String>,
}

/// Which stages to run.
#[derive(Clone, Debug, Default)]
pub struct Range {
    /// Stages from here on are run even if nothing changed.
    pub from: Option<String>,
    /// The last stage.
    pub to: Option<String>,
    /// Every stage is run.
    pub force: bool,
    /// No stage is run: it is told which would be, if the result of each that runs were another than it was.
    pub plan: bool,
}

/// The run: where values are kept and what was logged.
pub struct RunLog<'a> {
    folder: &'a BuildFolder,
    options: &'a BuildOptions,
    range: Range,
    forced: bool,
    /// The last stage asked for is done: what comes after it is only looked at.
    reached: bool,
    progress: Progress,
    earlier: BTreeMap<String, Record>,
    /// One record a finished stage; of a plan, one a stage that would be there.
    pub records: Vec<Record>,
    /// What is odd in what was read, before any stage.
    pub read_warnings: Vec<Notice>,
}

const SEAL: &str = "stage.json";

impl<'a> RunLog<'a> {
    /// A run in `folder` with `options`.
    pub fn new(folder: &'a BuildFolder, options: &'a BuildOptions, range: Range, progress: Progress) -> RunLog<'a> {
        let text = folder.read_file("log.jsonl").unwrap_or_default();
        let earlier = String::from_utf8_lossy(&text)
            .lines()
            .filter_map(|l| serde_json::from_str::<Record>(l).ok())
            .map(|r| (r.stage.clone(), r))
            .collect();
        RunLog {
            folder,
            options,
            forced: range.force,
            range,
            reached: false,
            progress,
            earlier,
            records: Vec::new(),
            read_warnings: Vec::new(),
        }
    }

    /// The options in force.
    pub fn options(&self) -> &'a BuildOptions {
        self.options
    }

    /// Runs or takes up a stage. What it is given and its section of the options are the key under which its value is kept.
    pub(crate) fn stage<S: Stage>(&mut self, inputs: S::Inputs<'_>) -> Result<Kept<S::Value>, BuildError> {
        // by the order of all stages: a knee need not have the one that is named
        let place = |name: &str| names().iter().position(|n| *n == name);
        let (here, ends) = (place(S::NAME), [&self.range.from, &self.range.to].map(|n| n.as_deref().and_then(place)));
        self.reached |= ends[1].is_some_and(|to| here > Some(to));
        if self.reached && self.range.plan {
            return Err(BuildError::Reached);
        }
        self.forced |= ends[0].is_some_and(|from| here >= Some(from));
        let options = S::options(self.options);
        let key = key(S::NAME, section::<S>(self.options)?, inputs);
        if self.reached {
            return self.left_over::<S>(&key);
        }
        if !self.forced
            && let Some(kept) = self.take_up::<S>(&key)?
        {
            return Ok(kept);
        }
        if self.range.plan {
            return self.outdated::<S>();
        }
        self.progress.start(S::NAME);
        store::reset_peak_memory();
        let start = Instant::now();
        if self.forced {
            parts::discard(self.folder, S::NAME);
        }
        let work = Work { folder: self.folder, tell: &self.progress.teller(), stage: (S::NAME, &key) };
        let value = S::run(inputs, options, &work).map_err(|e| BuildError::of_stage(S::NAME, &e))?;
        let kept = self.keep::<S>(key, value, inputs)?;
        parts::discard(self.folder, S::NAME);
        let seconds = start.elapsed().as_secs_f64();
        let took = ((seconds * 1e3).round() / 1e3, store::peak_memory_mib().unwrap_or(0.0).round());
        self.record(record(S::NAME, &kept, took, false))?;
        Ok(kept)
    }

    /// The stage's value from an earlier run, if its key and every file are as they were.
    fn take_up<S: Stage>(&mut self, key: &str) -> Result<Option<Kept<S::Value>>, BuildError> {
        let Some(files) = self.folder.read_folder(&folder::<S>()) else { return Ok(None) };
        let Some(seal) = files.get(SEAL).and_then(|b| serde_json::from_slice::<Seal>(b).ok()) else { return Ok(None) };
        if seal.key != key {
            return Ok(None);
        }
        let whole = seal.files.len() + 1 == files.len()
            && seal.files.iter().all(|(name, digest)| files.get(name).is_some_and(|b| hash(b) == *digest));
        if !whole {
            if !self.reached {
                self.progress.note(&format!("{}: its artifacts were changed by hand; built anew", S::NAME));
            }
            return Ok(None);
        }
        let Some(kept) = files.get(VALUE).and_then(|b| Some(Kept::made(decoded::<S>(b)?, b))) else { return Ok(None) };
        if !self.range.plan {
            parts::discard(self.folder, S::NAME);
        }
        let took = self.earlier.get(S::NAME).map_or((0.0, 0.0), |r| (r.seconds, r.peak_memory_mib));
        self.record(record(S::NAME, &kept, took, true))?;
        Ok(Some(kept))
    }

    /// In a plan: the stage would run. Its earlier value stands in for the one it would make; without one the plan ends here.
    fn outdated<S: Stage>(&mut self) -> Result<Kept<S::Value>, BuildError> {
        let file = format!("{}/{VALUE}", folder::<S>());
        let earlier = self.folder.read_file(&file).and_then(|bytes| decoded::<S>(&bytes));
        let Some(value) = earlier else { return Err(BuildError::Unplanned(S::NAME)) };
        let kept = Kept::outdated(value);
        self.record(record(S::NAME, &kept, (0.0, 0.0), false))?;
        Ok(kept)
    }

    /// Beyond the last stage asked for: what an earlier run left, told as outdated where this run would make it anew. None ends the build.
    fn left_over<S: Stage>(&mut self, key: &str) -> Result<Kept<S::Value>, BuildError> {
        if let Some(kept) = self.take_up::<S>(key)? {
            return Ok(kept);
        }
        let file = format!("{}/{VALUE}", folder::<S>());
        let value = self.folder.read_file(&file).and_then(|bytes| decoded::<S>(&bytes));
        match (self.earlier.get(S::NAME), value) {
            (Some(record), Some(value)) => {
                self.records.push(Record { cached: true, outdated: true, ..record.clone() });
                Ok(Kept::outdated(value))
            }
            _ => Err(BuildError::Reached),
        }
    }

    /// The end of a run: every line of the log. What earlier runs left and this one did not come to is outdated. Of a run that went through and made
    /// all as it was, a stage that runs only where it is asked for is not.
    pub fn settled(&mut self, stopped: bool) -> Result<Vec<Record>, BuildError> {
        let same = |r: &Record| self.earlier.get(&r.stage).is_some_and(|e| e.digest == r.digest);
        let as_it_was = !stopped && self.records.iter().all(|r| !r.outdated && same(r));
        let all = self.with_left(|stage| !(as_it_was && stage == Diagnose::NAME));
        self.write(&all)?;
        Ok(all)
    }

    /// The records of this run and those of other stages that have a folder, in the order of the stages.
    fn with_left(&self, outdated: impl Fn(&str) -> bool) -> Vec<Record> {
        let here = |stage: &str| self.records.iter().find(|r| r.stage == stage).cloned();
        let left = |stage: &str| {
            let record = self.earlier.get(stage)?;
            let there = store::is_folder(&self.folder.path().join(folder_name(stage)));
            there.then(|| Record { cached: true, outdated: outdated(stage) || record.outdated, ..record.clone() })
        };
        names().into_iter().filter_map(|stage| here(stage).or_else(|| left(stage))).collect()
    }

    fn keep<S: Stage>(
        &self,
        key: String,
        value: S::Value,
        inputs: S::Inputs<'_>,
    ) -> Result<Kept<S::Value>, BuildError> {
        let mut bytes = Vec::new();
        ciborium::into_writer(&value, &mut bytes).map_err(|e| BuildError::stage(S::NAME, e))?;
        let shown: Files = S::artifacts(&value, inputs);
        let mut files = shown.map_err(|e| BuildError::stage(S::NAME, e))?;
        files.push(("metrics.json".into(), json(&value.metrics())));
        let kept = Kept::made(value, &bytes);
        files.push((VALUE.into(), bytes));
        let seal = Seal {
            key,
            digest: kept.digest().to_owned(),
            files: files.iter().map(|(name, bytes)| (name.clone(), hash(bytes))).collect(),
        };
        files.push((SEAL.into(), json(&seal)));
        self.folder.write_folder(&folder::<S>(), &files)?;
        Ok(kept)
    }

    fn record(&mut self, record: Record) -> Result<(), BuildError> {
        if !self.range.plan && !self.reached {
            self.progress.done(&record);
        }
        self.records.push(record);
        if self.range.plan || self.reached {
            return Ok(());
        }
        // until it is looked at, what an earlier run left is not known to be this run's
        self.write(&self.with_left(|_| true))
    }

    fn write(&self, records: &[Record]) -> Result<(), BuildError> {
        let mut text = String::new();
        for r in records {
            text += &serde_json::to_string(r).map_err(|e| BuildError::File(e.to_string()))?;
            text.push('\n');
        }
        self.folder.write_file("log.jsonl", text.as_bytes())
    }
}

/// A line of the log; `took` are seconds and MiB.
fn record<T: Reported>(stage: &str, kept: &Kept<T>, took: (f64, f64), cached: bool) -> Record {
    Record {
        stage: stage.into(),
        seconds: took.0,
        peak_memory_mib: took.1,
        digest: kept.digest().to_owned(),
        cached,
        outdated: false,
        warnings: notices::texts(kept.warnings()),
        notices: kept.warnings().iter().map(|n| n.clone().told_by(stage)).collect(),
        metrics: kept.metrics(),
    }
}

/// `NN-stage`.
fn folder<S: Stage>() -> String {
    format!("{}-{}", S::NUMBER, S::NAME)
}

/// A stage's value as it was kept; `None` where another version kept it.
fn decoded<S: Stage>(bytes: &[u8]) -> Option<S::Value> {
    ciborium::from_reader(bytes).ok()
}

/// The digest of all that a stage's value depends on: the program, the stage, its options, what it is given.
fn key(stage: &str, options: String, inputs: impl Inputs) -> String {
    let mut parts = vec![env!("GENU_CODE_DIGEST").to_owned(), stage.to_owned(), options];
    inputs.digests(&mut parts);
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

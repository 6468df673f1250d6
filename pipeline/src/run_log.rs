//! Runs a stage: times it, digests its value, keeps it, takes it from an earlier run where nothing changed, names it when it fails.

use crate::error::BuildError;
use crate::progress::Progress;
use crate::record::{Record, folder_name, hash, json};
use crate::show::{Files, Reported};
use crate::store::{self, BuildFolder};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Deref;
use std::time::Instant;

/// A stage's value with the digest by which later stages know it.
pub struct Kept<T> {
    value: T,
    /// blake3 of the serialised value.
    pub digest: String,
}

impl<T> Deref for Kept<T> {
    type Target = T;
    fn deref(&self) -> &T {
        &self.value
    }
}

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
}

/// What a stage makes: it can be kept, taken up and told of.
pub trait Value: Serialize + DeserializeOwned + Reported {}
impl<T: Serialize + DeserializeOwned + Reported> Value for T {}

/// The run: where values are kept and what was logged.
pub struct RunLog<'a> {
    folder: &'a BuildFolder,
    range: Range,
    forced: bool,
    progress: Progress,
    earlier: BTreeMap<String, Record>,
    /// One record a finished stage.
    pub records: Vec<Record>,
}

const VALUE: &str = "value.cbor";
const SEAL: &str = "stage.json";

impl<'a> RunLog<'a> {
    /// A run in `folder`.
    pub fn new(folder: &'a BuildFolder, range: Range, progress: Progress) -> RunLog<'a> {
        let text = folder.read_file("log.jsonl").unwrap_or_default();
        let earlier = String::from_utf8_lossy(&text)
            .lines()
            .filter_map(|l| serde_json::from_str::<Record>(l).ok())
            .map(|r| (r.stage.clone(), r))
            .collect();
        RunLog { folder, forced: range.force, range, progress, earlier, records: Vec::new() }
    }

    /// The build's folder.
    pub fn folder(&self) -> &'a BuildFolder {
        self.folder
    }

    /// Tells how far a long stage has come.
    pub fn teller(&self) -> impl Fn(&str) + use<> {
        self.progress.teller()
    }

    /// Runs or takes up a stage. `inputs` are the digests of what it depends on, `options` its resolved options.
    /// `show` gives what people may look at.
    pub fn stage<T: Value, O: Serialize, E: ToString>(
        &mut self,
        stage: &'static str,
        inputs: &[&str],
        options: &O,
        run: impl FnOnce() -> Result<T, E>,
        show: impl FnOnce(&T) -> Files,
    ) -> Result<Kept<T>, BuildError> {
        if self.records.last().is_some_and(|r| Some(&r.stage) == self.range.to.as_ref()) {
            return Err(BuildError::Reached);
        }
        self.forced |= self.range.from.as_deref() == Some(stage);
        let key = key(stage, inputs, options)?;
        if !self.forced
            && let Some(kept) = self.take_up::<T>(stage, &key)?
        {
            return Ok(kept);
        }
        self.progress.start(stage);
        store::reset_peak_memory();
        let start = Instant::now();
        let value = run().map_err(|e| BuildError::stage(stage, e.to_string()))?;
        let digest = self.keep(stage, key, &value, show(&value))?;
        let seconds = start.elapsed().as_secs_f64();
        let peak_memory_mib = store::peak_memory_mib().unwrap_or(0.0);
        self.record(Record {
            stage: stage.into(),
            seconds: (seconds * 1e3).round() / 1e3,
            peak_memory_mib: peak_memory_mib.round(),
            digest: digest.clone(),
            cached: false,
            warnings: value.warnings().to_vec(),
            metrics: value.metrics(),
        })?;
        Ok(Kept { value, digest })
    }

    /// The stage's value from an earlier run, if its key and every file are as they were.
    fn take_up<T: Value>(&mut self, stage: &'static str, key: &str) -> Result<Option<Kept<T>>, BuildError> {
        let Some(files) = self.folder.read_folder(&folder_name(stage)) else { return Ok(None) };
        let Some(seal) = files.get(SEAL).and_then(|b| serde_json::from_slice::<Seal>(b).ok()) else { return Ok(None) };
        if seal.key != key {
            return Ok(None);
        }
        let whole = seal.files.len() + 1 == files.len()
            && seal.files.iter().all(|(name, digest)| files.get(name).is_some_and(|b| hash(b) == *digest));
        if !whole {
            self.progress.note(&format!("{stage}: its artifacts were changed by hand; built anew"));
            return Ok(None);
        }
        let Some(value) = files.get(VALUE).and_then(|b| ciborium::from_reader::<T, _>(b.as_slice()).ok()) else {
            return Ok(None);
        };
        let (seconds, peak_memory_mib) = self.earlier.get(stage).map_or((0.0, 0.0), |r| (r.seconds, r.peak_memory_mib));
        self.record(Record {
            stage: stage.into(),
            seconds,
            peak_memory_mib,
            digest: seal.digest.clone(),
            cached: true,
            warnings: value.warnings().to_vec(),
            metrics: value.metrics(),
        })?;
        Ok(Some(Kept { value, digest: seal.digest }))
    }

    fn keep<T: Value>(&self, stage: &'static str, key: String, value: &T, shown: Files) -> Result<String, BuildError> {
        let mut bytes = Vec::new();
        ciborium::into_writer(value, &mut bytes).map_err(|e| BuildError::stage(stage, e))?;
        let digest = hash(&bytes);
        let mut files = shown.map_err(|e| BuildError::stage(stage, e))?;
        files.push(("metrics.json".into(), json(&value.metrics())));
        files.push((VALUE.into(), bytes));
        let seal = Seal {
            key,
            digest: digest.clone(),
            files: files.iter().map(|(name, bytes)| (name.clone(), hash(bytes))).collect(),
        };
        files.push((SEAL.into(), json(&seal)));
        self.folder.write_folder(&folder_name(stage), &files)?;
        Ok(digest)
    }

    fn record(&mut self, record: Record) -> Result<(), BuildError> {
        self.progress.done(&record);
        self.records.push(record);
        let mut text = String::new();
        for r in &self.records {
            text += &serde_json::to_string(r).map_err(|e| BuildError::File(e.to_string()))?;
            text.push('\n');
        }
        self.folder.write_file("log.jsonl", text.as_bytes())
    }
}

/// The file in a stage's folder that holds its value.
pub fn value_name() -> &'static str {
    VALUE
}

fn key<O: Serialize>(stage: &str, inputs: &[&str], options: &O) -> Result<String, BuildError> {
    let options = serde_json::to_string(options).map_err(|e| BuildError::Option(e.to_string()))?;
    let mut hasher = blake3::Hasher::new();
    for part in [env!("GENU_CODE_DIGEST"), stage, &options].iter().chain(inputs) {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    Ok(hasher.finalize().to_hex().to_string())
}

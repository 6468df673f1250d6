//! Numbers of a build, each with its file, digest and day.

use crate::error::BuildError;
use crate::inspect;
use crate::record::{current, hash};
use crate::stage::list::folder_name;
use crate::store;
use crate::which_model::JOINT;
use serde_json::Value;
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A build that is read for evidence.
pub(super) struct Build {
    folder: PathBuf,
    /// Stages that the last run stands for.
    stages: BTreeSet<String>,
    /// The specimen's name.
    pub(super) knee: String,
    /// The calibrated model: the joint one, else that of the one data set.
    pub(super) model: Option<String>,
    /// Version and digest.
    pub(super) program: String,
    /// Digests that each stage sealed, by stage.
    seals: BTreeMap<String, BTreeMap<String, String>>,
    changed: RefCell<BTreeSet<String>>,
    /// Those of them that were asked for since [`Build::astray`] was asked last.
    astray: RefCell<BTreeSet<String>>,
    /// Whether a file was asked for that is gone; see [`Build::was_lost`].
    lost: Cell<bool>,
}

/// A file of a stage as it was read.
pub(super) struct Read {
    pub(super) stage: String,
    /// Below the build's folder.
    pub(super) file: String,
    pub(super) digest: String,
    pub(super) date: Option<String>,
    pub(super) as_built: bool,
    pub(super) text: String,
    /// Flexions of the rows that a number is taken from [deg], ascending; empty where they have none.
    pub(super) flexions_deg: Vec<f64>,
}

/// A table's rows by column.
pub(super) type Rows = Vec<BTreeMap<String, String>>;

impl Build {
    pub(super) fn open(folder: &Path) -> Result<Build, BuildError> {
        let records = current(&inspect::records(folder)?);
        let stages: BTreeSet<String> = records.into_iter().map(|r| r.stage).collect();
        let run: toml::Table = store::read_text(&folder.join("run.toml"))?.parse().unwrap_or_default();
        let word = |table: &str, key: &str| {
            run.get(table).and_then(|t| t.get(key)).and_then(toml::Value::as_str).unwrap_or("not known").to_owned()
        };
        let seal = |stage: &String| {
            let text = store::read_text(&folder.join(folder_name(stage)).join("stage.json")).ok()?;
            let files = serde_json::from_str::<Value>(&text).ok()?.get("files")?.clone();
            Some((stage.clone(), serde_json::from_value(files).ok()?))
        };
        let calibrated = folder.join(folder_name("calibrate"));
        let is_model = |name: &String| store::exists(&calibrated.join(name).join("model.json"));
        let models: Vec<String> = match stages.contains("calibrate") {
            true => store::list(&calibrated).into_iter().filter(is_model).collect(),
            false => vec![],
        };
        let sources: Vec<String> = models.iter().filter(|m| *m != JOINT).cloned().collect();
        let joint = models.iter().find(|m| *m == JOINT);
        let model = joint.or(sources.first().filter(|_| sources.len() == 1)).cloned();
        Ok(Build {
            seals: stages.iter().filter_map(seal).collect(),
            folder: folder.to_path_buf(),
            stages,
            knee: word("specimen", "id"),
            model,
            program: format!(
                "{} ({})",
                word("program", "version"),
                &word("program", "code").chars().take(12).collect::<String>()
            ),
            changed: RefCell::default(),
            astray: RefCell::default(),
            lost: Cell::new(false),
        })
    }

    /// A file of a stage that was run; `MODEL` in its name stands for the calibrated model.
    pub(super) fn file(&self, stage: &str, name: &str) -> Option<Read> {
        if !self.stages.contains(stage) {
            return None;
        }
        let name = match name.contains("MODEL") {
            true => name.replace("MODEL", self.model.as_ref()?),
            false => name.to_owned(),
        };
        let file = format!("{}/{name}", folder_name(stage));
        let path = self.folder.join(&file);
        let seal = self.seals.get(stage);
        let Ok(text) = store::read_text(&path) else {
            // a stage that ran and has no seal any more may have left the file, too
            if seal.is_none_or(|s| s.contains_key(&name)) {
                self.tell_changed(file);
                self.lost.set(true);
            }
            return None;
        };
        let digest = hash(text.as_bytes());
        let as_built = seal.and_then(|s| s.get(&name)).is_some_and(|sealed| *sealed == digest);
        if !as_built {
            self.tell_changed(file.clone());
        }
        Some(Read {
            stage: stage.to_owned(),
            file,
            digest,
            date: store::written_on(&path),
            as_built,
            text,
            flexions_deg: vec![],
        })
    }

    /// Whether a file that its stage left was asked for and is gone, since this was asked last.
    pub(super) fn was_lost(&self) -> bool {
        self.lost.replace(false)
    }

    fn tell_changed(&self, file: String) {
        self.astray.borrow_mut().insert(file.clone());
        self.changed.borrow_mut().insert(file);
    }

    /// Files that were asked for since this was asked last, and are not as their stage left them, or gone.
    pub(super) fn astray(&self) -> Vec<String> {
        self.astray.take().into_iter().collect()
    }

    /// Files that were asked for and are not as their stage left them, or gone.
    pub(super) fn changed(&self) -> Vec<String> {
        self.changed.borrow().iter().cloned().collect()
    }
}

impl Read {
    /// The file as JSON.
    pub(super) fn json(&self) -> Value {
        serde_json::from_str(&self.text).unwrap_or_default()
    }

    /// The file as a table.
    pub(super) fn rows(&self) -> Rows {
        let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(self.text.as_bytes());
        let header: Vec<String> = reader.headers().map(|h| h.iter().map(str::to_owned).collect()).unwrap_or_default();
        let row = |r: csv::StringRecord| header.iter().cloned().zip(r.iter().map(str::to_owned)).collect();
        reader.records().flatten().map(row).collect()
    }
}

/// The flexions of rows [deg], each once, ascending.
pub(super) fn flexions<'a>(rows: impl IntoIterator<Item = &'a BTreeMap<String, String>>, column: &str) -> Vec<f64> {
    let each = rows.into_iter().filter_map(|r| r.get(column)?.parse::<f64>().ok());
    let mut all: Vec<f64> = each.filter(|fe| fe.is_finite()).collect();
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    all
}

/// The numbers of a column.
pub(super) fn numbers(rows: &Rows, column: &str) -> Vec<f64> {
    rows.iter().filter_map(|r| r.get(column)?.parse().ok()).collect()
}

/// The largest; none of nothing.
pub(super) fn largest(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    values.into_iter().reduce(f64::max)
}

/// The smallest; none of nothing.
pub(super) fn smallest(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    values.into_iter().reduce(f64::min)
}

/// The share of rows for which something holds; none of nothing.
pub(super) fn share(rows: &Rows, holds: impl Fn(&BTreeMap<String, String>) -> bool) -> Option<f64> {
    (!rows.is_empty()).then(|| rows.iter().filter(|r| holds(r)).count() as f64 / rows.len() as f64)
}

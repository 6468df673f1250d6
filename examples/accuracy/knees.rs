//! The knees with truth: the shared specimens where they are there, and the phantoms.

use crate::registration::{Case, case};
use serde_json::Value;
use stages::ingest::ingest;
use stages::specimen::{IngestOptions, RawSpecimen, Specimen};
use std::path::{Path, PathBuf};

/// A knee with its truth.
pub(crate) struct Knee {
    pub(crate) name: String,
    pub(crate) raw: RawSpecimen,
    pub(crate) specimen: Specimen,
    pub(crate) truth: Value,
    truth_files: Vec<(String, Vec<u8>)>,
}

/// A path of the shared data.
pub(crate) fn shared(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path)
}

/// Every knee there is, specimens first.
pub(crate) fn all() -> Result<Vec<Knee>, String> {
    let mut knees = Vec::new();
    for id in ["S192803", "S193761"] {
        let folder = shared(&format!("specimens/{id}"));
        if !folder.exists() {
            continue;
        }
        let (_, raw) = genu::store::read_specimen(&folder).map_err(|e| e.to_string())?;
        let mut truth_files = Vec::new();
        for file in ["truth.json", "femur.stl", "tibfib_medial.stl", "tibfib_lateral.stl"] {
            let path = format!("truth/{file}");
            truth_files.push((path.clone(), genu::store::read(&folder.join(path)).map_err(|e| e.to_string())?));
        }
        knees.push(knee(id, raw, truth_files)?);
    }
    for id in stages::phantom::PHANTOMS {
        let made = stages::phantom::phantom(id, 1).map_err(|e| e.to_string())?;
        let mut raw = RawSpecimen::default();
        let mut truth_files = Vec::new();
        for (name, bytes) in made.files {
            if name == "specimen.toml" {
                raw.toml = String::from_utf8_lossy(&bytes).into_owned();
            } else if name.starts_with("truth/") {
                truth_files.push((name, bytes));
            } else {
                raw.files.insert(name, bytes);
            }
        }
        knees.push(knee(id, raw, truth_files)?);
    }
    Ok(knees)
}

fn knee(id: &str, raw: RawSpecimen, truth_files: Vec<(String, Vec<u8>)>) -> Result<Knee, String> {
    let specimen = ingest(&raw, &IngestOptions::default()).map_err(|e| e.to_string())?;
    let truth = &truth_files.iter().find(|f| f.0 == "truth/truth.json").ok_or("no truth.json")?.1;
    let truth = serde_json::from_slice(truth).map_err(|e| e.to_string())?;
    Ok(Knee { name: id.into(), raw, specimen, truth, truth_files })
}

impl Knee {
    /// A file below truth/.
    pub(crate) fn truth_file(&self, name: &str) -> &[u8] {
        let path = format!("truth/{name}");
        self.truth_files.iter().find(|f| f.0 == path).map_or(&[], |f| &f.1)
    }

    /// A bone as the registration's statistics take it.
    pub(crate) fn case(&self, bone: &str) -> Case {
        let own = |path: &str| self.raw.files.get(path).cloned();
        case(|path| own(path).unwrap_or_else(|| self.truth_file(path.trim_start_matches("truth/")).to_vec()), bone)
    }

    /// Whether it is one of the shared specimens.
    pub(crate) fn is_specimen(&self) -> bool {
        !self.name.ends_with("phantom")
    }
}

/// User time of the process so far, all threads [s].
#[expect(clippy::disallowed_methods, reason = "asks the system for its time")]
pub(crate) fn user_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields after the name in brackets; user time is the twelfth, in hundredths.
    let after = text.rsplit(')').next().unwrap_or_default();
    after.split_whitespace().nth(11).and_then(|t| t.parse::<f64>().ok()).map_or(f64::NAN, |t| t / 100.0)
}

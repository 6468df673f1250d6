//! One build as the cohort sees it: the files that FORMAT.md fixes, nothing of the program's own.

use super::quantity::Quantity;
use super::regions;
use crate::again::building_again;
use crate::inspect;
use crate::record::{Failure, Record, current};
use crate::report::{REPORT, STOPPED};
use crate::stage::list::folder_name;
use crate::store;
use serde_json::Value;
use sim::spec::SharedPriorSpec;
use std::path::{Path, PathBuf};

/// Whether a model was made.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Status {
    Built,
    Failed { stage: String, message: String },
}

impl Status {
    /// A word for tables.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Status::Built => "built",
            Status::Failed { .. } => "failed",
        }
    }
}

/// Rows of a CSV file of the build with the source they belong to.
#[derive(Clone, Debug, Default)]
pub(super) struct Rows {
    pub(super) source: String,
    /// Which file, for tables that join several.
    pub(super) kind: String,
    header: Vec<String>,
    rows: Vec<csv::StringRecord>,
}

impl Rows {
    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// For every row, the cell of a column; empty where there is no such column.
    pub(super) fn cells(&self, column: &str) -> Vec<String> {
        let at = self.header.iter().position(|h| h == column);
        self.rows.iter().map(|r| at.and_then(|i| r.get(i)).unwrap_or_default().to_owned()).collect()
    }

    /// As [`Rows::cells`], as numbers; `None` where empty or not a number.
    pub(super) fn numbers(&self, column: &str) -> Vec<Option<f64>> {
        self.cells(column).iter().map(|c| c.parse().ok().filter(|x: &f64| x.is_finite())).collect()
    }
}

/// A build.
#[derive(Clone, Debug)]
pub(super) struct Knee {
    pub(super) name: String,
    /// Its id in specimen.toml; empty where unknown.
    pub(super) specimen: String,
    pub(super) side: String,
    /// The build's folder, absolute; `None` where there is none.
    pub(super) folder: Option<PathBuf>,
    pub(super) status: Status,
    pub(super) program: String,
    pub(super) records: Vec<Record>,
    pub(super) bytes: u64,
    pub(super) quantities: Vec<Quantity>,
    pub(super) parameters: Vec<Rows>,
    pub(super) forces: Vec<Rows>,
    pub(super) laxity: Vec<Rows>,
    /// Surfaces and pictures that it was built from: name and digest.
    pub(super) surfaces: Vec<(String, String)>,
    /// What other knees gave as the prior of its calibration; `None` where they gave no number.
    pub(super) shared_prior: Option<SharedPriorSpec>,
}

/// Ends of the names of surfaces and pictures, which no two knees have in common.
const SURFACES: [&str; 10] = ["stl", "ply", "obj", "vtk", "vtp", "nii", "gz", "nrrd", "mha", "dcm"];

/// Figures of a stage that knees are compared by, of the whole knee.
const WHOLE: [(&str, &[&str]); 2] = [
    ("frames", &["angle_to_tea_axial_deg", "condylar_radius_mm", "epicondylar_width_mm"]),
    ("overclosure", &["max_overclosure_before_mm", "gap_min_mm"]),
];
/// The same of its parts.
const PARTS: [(&str, &[&str]); 3] = [
    ("register", &["predicted_error_mm"]),
    ("cartilage", &["volume_mm3", "thickness_mean_mm", "thickness_p95_mm", "area_articular_mm2"]),
    ("hexmesh", &["scaled_jacobian_min"]),
];
/// The same of its menisci, where they act.
const OF_MENISCI: [&str; 2] = ["extrusion_mm", "coverage"];
const POSE: [&str; 6] = ["fe_deg", "vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"];
const PROTOCOLS: [&str; 4] = ["ap_laxity", "passive_flexion", "pivot_shift", "pivot_shift_no_acl"];

impl Knee {
    /// The build in or below `place`; what cannot be read is a failure of this knee alone.
    pub(super) fn read(name: &str, place: &Path) -> Knee {
        let mut knee = Knee {
            name: name.to_owned(),
            specimen: String::new(),
            side: String::new(),
            folder: None,
            status: Status::Failed {
                stage: "input".into(),
                message: format!("no build in {}; its build did not come so far, or was not run", place.display()),
            },
            program: String::new(),
            records: Vec::new(),
            bytes: 0,
            quantities: Vec::new(),
            parameters: Vec::new(),
            forces: Vec::new(),
            laxity: Vec::new(),
            surfaces: Vec::new(),
            shared_prior: None,
        };
        let is_build = |d: &Path| ["log.jsonl", "failure.json", "run.toml"].iter().any(|f| store::exists(&d.join(f)));
        let Some(folder) = [place.join("build"), place.to_path_buf()].into_iter().find(|d| is_build(d)) else {
            return knee;
        };
        let folder = store::absolute(&folder).unwrap_or(folder);
        knee.identify(&folder);
        knee.bytes = store::sizes(&folder).iter().map(|(_, bytes)| bytes).sum();
        knee.status = knee.judge(&folder);
        knee.gather(&folder);
        knee.folder = Some(folder);
        knee
    }

    /// Id, side and program, from run.toml and the first stage.
    fn identify(&mut self, folder: &Path) {
        let run = store::read_text(&folder.join("run.toml")).ok().and_then(|t| t.parse::<toml::Table>().ok());
        let text = |table: &str, key: &str| {
            let value = run.as_ref()?.get(table)?.get(key)?.as_str()?;
            Some(value.to_owned())
        };
        self.specimen = text("specimen", "id").unwrap_or_default();
        self.program = text("program", "version").unwrap_or_default();
        let inputs = run.as_ref().and_then(|run| run.get("inputs")?.as_table());
        let is_surface = |name: &str| {
            Path::new(name).extension().is_some_and(|end| SURFACES.iter().any(|s| end.eq_ignore_ascii_case(s)))
        };
        let known = inputs.into_iter().flatten().filter(|(name, _)| is_surface(name));
        self.surfaces = known.filter_map(|(name, digest)| Some((name.clone(), digest.as_str()?.to_owned()))).collect();
        let identity = read_json(&folder.join(folder_name("ingest")).join("identity.json"));
        self.side = identity["side"].as_str().unwrap_or_default().to_owned();
    }

    /// Reads the log and tells what came of the build.
    fn judge(&mut self, folder: &Path) -> Status {
        let failed = |stage: &str, message: String| Status::Failed { stage: stage.to_owned(), message };
        let log = match store::exists(&folder.join("log.jsonl")) {
            true => inspect::records(folder),
            false => Ok(Vec::new()),
        };
        match log {
            Ok(records) => self.records = current(&records),
            Err(e) => return failed("log", e.to_string()),
        }
        if let Some(Failure { stage, message, .. }) = inspect::failure(folder) {
            return failed(&stage, message);
        }
        if store::exists(&folder.join(STOPPED)) || !store::exists(&folder.join(REPORT)) {
            let after = self.last_stage().unwrap_or("the beginning").to_owned();
            return failed(
                "unfinished",
                format!("stopped after {after}; it goes on from there: {}", building_again(folder)),
            );
        }
        Status::Built
    }

    fn gather(&mut self, folder: &Path) {
        for record in self.records.clone() {
            let m = &record.metrics;
            for (stage, names) in WHOLE.iter().filter(|(s, _)| *s == record.stage) {
                names.iter().for_each(|n| self.add(stage, n, "", &m[*n]));
            }
            for (stage, names) in PARTS.iter().filter(|(s, _)| *s == record.stage) {
                for (part, inner) in m.as_object().into_iter().flatten().filter(|(_, v)| v.is_object()) {
                    names.iter().for_each(|n| self.add(stage, n, part, &inner[*n]));
                }
            }
            if record.stage == "frames" {
                POSE.iter().for_each(|n| self.add("frames", &format!("pose_{n}"), "", &m["gs_ct_pose"][*n]));
            }
            for (name, meniscus) in named(&m["menisci"]).filter(|_| record.stage == "assemble") {
                OF_MENISCI.iter().for_each(|n| self.add("assemble", n, name, &meniscus[*n]));
            }
            if record.stage == "hexmesh" {
                self.quantities.extend(regions::of_build(folder));
            }
        }
        let calibrate = folder.join(folder_name("calibrate"));
        for source in store::list(&calibrate) {
            self.parameters.extend(read_rows(&calibrate.join(&source).join("parameters.csv"), &source, "parameters"));
            self.forces.extend(read_rows(&calibrate.join(&source).join("forces.csv"), &source, "forces"));
            let model = read_json(&calibrate.join(&source).join("model.json"));
            let prior: Option<SharedPriorSpec> =
                serde_json::from_value(model["calibrated"]["shared_prior"].clone()).ok();
            self.shared_prior = self.shared_prior.take().or(prior.filter(|prior| prior.numbers > 0));
        }
        let validate = folder.join(folder_name("validate"));
        for source in store::list(&validate) {
            for protocol in PROTOCOLS {
                let path = validate.join(&source).join(format!("{protocol}.csv"));
                self.laxity.extend(read_rows(&path, &source, protocol));
            }
        }
    }

    fn add(&mut self, stage: &'static str, name: &str, part: &str, value: &Value) {
        if let Some(value) = value.as_f64().filter(|v| v.is_finite()) {
            self.quantities.push(Quantity { stage, name: name.to_owned(), part: part.to_owned(), value });
        }
    }

    /// Whether no model came of it.
    pub(super) fn failed(&self) -> bool {
        self.status != Status::Built
    }

    /// The last stage that is done.
    pub(super) fn last_stage(&self) -> Option<&str> {
        self.records.last().map(|r| r.stage.as_str())
    }

    /// Stage and words of each warning.
    pub(super) fn warnings(&self) -> impl Iterator<Item = (&str, &str)> {
        self.records.iter().flat_map(|r| r.warnings.iter().map(|w| (r.stage.as_str(), w.as_str())))
    }

    /// Time that its stages took [s].
    pub(super) fn seconds(&self) -> f64 {
        self.records.iter().map(|r| r.seconds).sum()
    }

    /// Most memory of a stage [MiB].
    pub(super) fn memory_mib(&self) -> f64 {
        self.records.iter().map(|r| r.peak_memory_mib).fold(0.0, f64::max)
    }

    /// Its report, where there is one.
    pub(super) fn report(&self) -> Option<PathBuf> {
        self.folder.as_ref().map(|f| f.join("report.html")).filter(|p| store::exists(p))
    }
}

/// The members of a list with their names.
fn named(list: &Value) -> impl Iterator<Item = (&str, &Value)> {
    list.as_array().into_iter().flatten().filter_map(|m| Some((m["name"].as_str()?, m)))
}

fn read_json(path: &Path) -> Value {
    store::read_text(path).ok().and_then(|t| serde_json::from_str(&t).ok()).unwrap_or(Value::Null)
}

/// The rows of a CSV file; `None` where there is none or it is not a table.
fn read_rows(path: &Path, source: &str, kind: &str) -> Option<Rows> {
    if !store::exists(path) {
        return None;
    }
    let bytes = store::read(path).ok()?;
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(bytes.as_slice());
    let header = reader.headers().ok()?.iter().map(str::to_owned).collect();
    let rows = reader.records().collect::<Result<Vec<_>, _>>().ok()?;
    Some(Rows { source: source.to_owned(), kind: kind.to_owned(), header, rows })
}

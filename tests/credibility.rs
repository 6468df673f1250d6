//! The credibility of a knee: every number is traced to its file, and a changed number changes what it is worth.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use crate::common::{build_model, copy, json, read, text, write};
use crate::one_knee::specimen;
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;

/// The factors in the order of the standard.
const ORDER: [&str; 8] = [
    "code-verification",
    "calculation-verification",
    "model-form",
    "model-inputs",
    "comparator",
    "equivalence",
    "output-comparison",
    "applicability",
];

/// What is said of a build, by its JSON.
fn told(folder: &Path) -> Value {
    build_model().arg("credibility").arg(folder).arg("--quiet").assert().success();
    json(&folder.join("build/credibility.json"))
}

fn evidence<'a>(told: &'a Value, id: &str) -> &'a Value {
    let mut all = told["factors"].as_array().unwrap().iter().flat_map(|f| f["evidence"].as_array().unwrap());
    all.find(|e| e["id"] == id).unwrap_or_else(|| panic!("{id}"))
}

fn digest(path: &Path) -> String {
    blake3::hash(&read(path)).to_hex().to_string()
}

/// A change of one number: in JSON by its pointer, or in every row of a column.
enum Change {
    Json(&'static str, Value),
    Column(&'static str, &'static str),
}

impl Change {
    fn of(&self, whole: &str) -> String {
        match self {
            Change::Json(pointer, value) => {
                let mut whole: Value = serde_json::from_str(whole).unwrap();
                match value {
                    Value::Null => {
                        let (above, key) = pointer.rsplit_once('/').unwrap();
                        whole.pointer_mut(above).unwrap().as_object_mut().unwrap().remove(key).unwrap();
                    }
                    _ => *whole.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value.clone(),
                }
                whole.to_string()
            }
            Change::Column(column, value) => {
                let mut lines = whole.lines();
                let header = lines.next().unwrap();
                let at = header.split(',').position(|c| c == *column).unwrap_or_else(|| panic!("{column}"));
                let row = |line: &str| {
                    let mut cells: Vec<&str> = line.split(',').collect();
                    cells[at] = value;
                    cells.join(",") + "\n"
                };
                format!("{header}\n{}", lines.map(row).collect::<String>())
            }
        }
    }
}

/// Evidence, the file it stands in, a change, the grade after it.
fn changes() -> Vec<(&'static str, &'static str, Change, &'static str)> {
    use Change::{Column, Json};
    let calibrated = "10-calibrate/metrics.json";
    vec![
        ("element-quality", "08-overclosure/metrics.json", Json("/femur/scaled_jacobian_min", json!(0.1)), "weak"),
        ("cartilage-gap", "08-overclosure/metrics.json", Json("/gap_min_mm", json!(-0.2)), "weak"),
        ("bone-surface", "03-bones/metrics.json", Json("/femur/surface_distance_p95_mm", json!(0.1)), "adequate"),
        ("protocols-run", "11-validate/joint/ap_laxity.csv", Column("odd", "yes"), "weak"),
        ("solvers-agree", "11-validate/solvers.csv", Column("difference", "9.0"), "weak"),
        ("explicit-runs", "11-validate/joint/ap_laxity.csv", Column("solver", "quasistatic"), "weak"),
        ("strain-sensitivity", "11-validate/sensitivity.csv", Column("ap_mm", "9.0"), "weak"),
        ("stiffness-sensitivity", "11-validate/sensitivity.csv", Column("ap_mm", "9.0"), "weak"),
        ("contact-sensitivity", "11-validate/sensitivity.csv", Column("ap_mm", "9.0"), "weak"),
        ("misfit", calibrated, Json("/joint/noise_scale/vv_deg", json!(9.0)), "weak"),
        ("fibres-in-bone", "06-attachments/metrics.json", Json("/through_bone_mm", json!({"LCL": 0.0})), "strong"),
        ("registration", "02-register/metrics.json", Json("/femur/held_out_rms_mm", json!(0.9)), "weak"),
        ("sites-marked", "06-attachments/metrics.json", Json("/sites_literature", json!(1000)), "weak"),
        ("parameters-determined", "10-calibrate/joint/parameters.csv", Column("determined", "0.9"), "strong"),
        ("measured", "01-ingest/identity.json", Json("/provenance", json!("cadaver")), "strong"),
        ("data-sets", calibrated, Json("/rks", Value::Null), "adequate"),
        ("trials", calibrated, Json("/joint/trials", json!(3)), "weak"),
        ("flexions", "10-calibrate/joint/fit.csv", Column("nominal_flexion_deg", "30"), "weak"),
        ("tests", "10-calibrate/joint/fit.csv", Column("test", "anterior"), "weak"),
        ("stated-noise", "10-calibrate/joint/noise.csv", Column("inferred", "99"), "weak"),
        ("detectable-change", "10-calibrate/joint/noise.csv", Column("inferred", "9"), "weak"),
        ("frames", "10-calibrate/joint/frames.csv", Column("value", "9"), "weak"),
        ("fit", calibrated, Json("/joint/rms/vv_deg", json!(9.0)), "weak"),
        ("cross-prediction", "11-validate/cross_prediction.csv", Column("inside", "no"), "weak"),
        ("cross-prediction-width", "11-validate/cross_prediction.csv", Column("upper", "999"), "weak"),
        ("forces-determined", "10-calibrate/joint/forces.csv", Column("determined", "0.9"), "strong"),
        ("flexion-range", "10-calibrate/joint/fit.csv", Column("fe_deg", "30"), "weak"),
    ]
}

#[test]
fn a_changed_number_changes_what_it_is_worth_and_an_unsealed_file_is_no_evidence() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    write(&folder.path().join("credibility.toml"), "flexion_deg = [0, 80]\n");
    let as_built = told(folder.path());
    assert_eq!(as_built["changed"], json!([]));
    for (id, file, change, grade) in changes() {
        let path = folder.path().join("build").join(file);
        let (stage, name) = file.split_once('/').unwrap();
        let seal = folder.path().join("build").join(stage).join("stage.json");
        let (whole, sealed) = (text(&path), text(&seal));
        let before = evidence(&as_built, id);
        assert!(before["value"].is_number() && before["as_built"] == true, "{id}: {before}");
        assert_ne!(before["grade"], grade, "{id}: {before}");
        assert_eq!((&before["file"], &before["digest"]), (&json!(file), &json!(digest(&path))), "{id}");
        write(&path, change.of(&whole));
        let broken = told(folder.path());
        assert_eq!(evidence(&broken, id)["grade"], "no-evidence", "{id}");
        assert!(broken["changed"].as_array().unwrap().contains(&json!(file)), "{id}");
        let mut seals: Value = serde_json::from_str(&sealed).unwrap();
        seals["files"][name] = json!(digest(&path));
        write(&seal, seals.to_string());
        let changed = told(folder.path());
        assert_eq!(evidence(&changed, id)["grade"], grade, "{id}: {}", evidence(&changed, id));
        write(&path, whole);
        write(&seal, sealed);
    }
    assert_eq!(told(folder.path()), as_built, "all is as it was");
}

#[test]
fn the_page_is_whole_in_order_and_says_what_is_not_known() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let bare = told(folder.path());
    let names: Vec<&str> = bare["factors"].as_array().unwrap().iter().map(|f| f["factor"].as_str().unwrap()).collect();
    assert_eq!(names, ORDER);
    for id in ["contact-law", "missing-effects", "menisci-sensitivity", "starts", "passive-flexion", "flexion-range"] {
        let e = evidence(&bare, id);
        assert!(e["grade"] == "no-evidence" && e["value"].is_null() && e["digest"].is_null(), "{e}");
    }
    let page = text(&folder.path().join("build/credibility.html"));
    for outside in ["src=\"http", "href=\"http", "url(http", "@import", "<script"] {
        assert!(!page.contains(outside), "{outside}");
    }
    let places: Vec<usize> = bare["factors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| page.find(&format!("<h2>{}</h2>", f["name"].as_str().unwrap())).unwrap())
        .collect();
    assert!(places.is_sorted() && page.matches("not stated").count() >= 6 && page.contains("no evidence"));
    assert!(page.find("Question").unwrap() < page.find("Context of use").unwrap());
    for factor in bare["factors"].as_array().unwrap() {
        assert_eq!(factor["enough"], Value::Null);
        for e in factor["evidence"].as_array().unwrap().iter().filter(|e| e["value"].is_number()) {
            assert!(e["digest"].as_str().unwrap().len() == 64 && e["date"].is_string(), "{e}");
            assert!(e["stage"].is_string() != e["test"].is_string(), "{e}");
        }
    }
    // the same bytes again
    let again = page.clone();
    told(folder.path());
    assert_eq!(text(&folder.path().join("build/credibility.html")), again);
}

#[test]
fn risk_asks_for_more_and_an_unknown_key_is_refused() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let context = folder.path().join("credibility.toml");
    let stated = |influence: &str, consequence: &str| {
        write(&context, format!("question = \"q\"\ninfluence = \"{influence}\"\nconsequence = \"{consequence}\"\n"));
        let told = told(folder.path());
        let enough = told["factors"].as_array().unwrap().iter().filter(|f| f["enough"] == true).count();
        (told["model_risk"].as_str().unwrap().to_owned(), enough)
    };
    let (low, many) = stated("low", "low");
    let (high, few) = stated("high", "high");
    assert_eq!((low.as_str(), high.as_str(), stated("low", "high").0.as_str()), ("low", "high", "medium"));
    assert!(many > few, "{many} {few}");
    write(&context, "question = \"q\"\ninfluenze = \"low\"\n");
    let run = build_model().arg("credibility").arg(folder.path()).assert().code(1);
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(said.contains("influenze") && said.contains("expected question"), "{said}");
}

/// Tests that the page names are there.
#[test]
fn tests_that_made_the_programs_figures_exist() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let table: toml::Table = text(&root.join("data/credibility.toml")).parse().unwrap();
    for e in table["evidence"].as_array().unwrap() {
        let test = e["test"].as_str().unwrap();
        let (file, name) = test.split_once(": ").unwrap_or((test, ""));
        assert!(text(&root.join(file)).contains(name), "{test}");
    }
}

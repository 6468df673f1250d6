//! The credibility of a knee: every number is traced to its file, and a changed number changes what it is worth.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

use crate::common::{build_model, copy, json, read, text, write};
use crate::one_knee::specimen;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;
use tempfile::TempDir;

/// The grades, the worst first.
const GRADES: [&str; 4] = ["no-evidence", "weak", "adequate", "strong"];

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
        ("strain-forces", "11-validate/sensitivity.csv", Column("force_n", "1.0"), "strong"),
        ("stiffness-forces", "11-validate/sensitivity.csv", Column("force_n", "99.0"), "weak"),
        ("contact-forces", "11-validate/sensitivity.csv", Column("force_n", "99.0"), "weak"),
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
        ("other-flexions", "11-validate/cross_prediction.csv", Column("inside", "no"), "weak"),
        ("other-directions", "11-validate/cross_prediction.csv", Column("inside", "no"), "weak"),
        ("other-flexions-width", "11-validate/cross_prediction.csv", Column("upper", "999"), "weak"),
        ("other-directions-width", "11-validate/cross_prediction.csv", Column("upper", "999"), "weak"),
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
        // a knee of few samples may end oddly as built: then it does so no more
        let ends_oddly = id == "protocols-run" && before["grade"] == grade;
        let (change, grade) = if ends_oddly { (Change::Column("odd", ""), "strong") } else { (change, grade) };
        assert_ne!(before["grade"], grade, "{id}: {before}");
        assert_eq!((&before["file"], &before["digest"]), (&json!(file), &json!(digest(&path))), "{id}");
        write(&path, change.of(&whole));
        let broken = told(folder.path());
        assert_eq!(evidence(&broken, id)["grade"], "no-evidence", "{id}");
        assert!(broken["changed"].as_array().unwrap().contains(&json!(file)), "{id}");
        // an answer that has lost its numbers says by which file
        for (was, now) in as_built["answers"].as_array().unwrap().iter().zip(broken["answers"].as_array().unwrap()) {
            let is_lost = was["lacking"].is_null() && now["lacking"].is_string();
            assert!(!is_lost || now["lacking"].as_str().unwrap().contains(file), "{file}: {now}");
        }
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

/// Intervals of ranges that are not asked about may be as wide as they like; those that are asked about decide.
#[test]
fn a_prediction_of_other_flexions_is_as_wide_as_its_own_ranges() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let (stage, name) = ("11-validate", "cross_prediction.csv");
    let (path, seal) = (
        folder.path().join("build").join(stage).join(name),
        folder.path().join("build").join(stage).join("stage.json"),
    );
    let whole = text(&path);
    let as_built = told(folder.path());
    let before = evidence(&as_built, "other-flexions-width").clone();
    let asked: Vec<f64> = before["flexions_deg"].as_array().unwrap().iter().map(|fe| fe.as_f64().unwrap()).collect();
    for is_asked in [false, true] {
        let mut lines = whole.lines();
        let header = lines.next().unwrap();
        let place = |column: &str| header.split(',').position(|c| c == column).unwrap();
        let (flexion, upper) = (place("flexion [deg]"), place("upper"));
        let mut changed = 0;
        let mut other = format!("{header}\n");
        for line in lines {
            let mut cells: Vec<&str> = line.split(',').collect();
            if asked.contains(&cells[flexion].parse().unwrap()) == is_asked {
                cells[upper] = "999";
                changed += 1;
            }
            other += &(cells.join(",") + "\n");
        }
        assert!(changed > 0, "{whole}");
        write(&path, other);
        let mut seals: Value = serde_json::from_str(&text(&seal)).unwrap();
        seals["files"][name] = json!(digest(&path));
        write(&seal, seals.to_string());
        let after = told(folder.path());
        let width = evidence(&after, "other-flexions-width");
        let answer = after["answers"].as_array().unwrap().iter().find(|a| a["id"] == "other-flexions").unwrap();
        if is_asked {
            assert_eq!((&width["grade"], &answer["verdict"]), (&json!("weak"), &json!("too-wide")), "{answer}");
        } else {
            assert_eq!((&width["value"], &width["grade"]), (&before["value"], &before["grade"]));
        }
    }
}

/// Files of stages that the page's numbers come from.
fn read_files(told: &Value) -> BTreeSet<String> {
    let all = told["factors"].as_array().unwrap().iter().flat_map(|f| f["evidence"].as_array().unwrap());
    all.filter(|e| e["stage"].is_string()).map(|e| e["file"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_file_that_is_gone_is_named_and_never_to_the_models_advantage() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let as_built = told(folder.path());
    let rank = |f: &Value| GRADES.iter().position(|g| f["grade"] == *g).unwrap();
    let files = read_files(&as_built);
    assert!(files.len() > 10, "{files:?}");
    for file in files {
        let path = folder.path().join("build").join(&file);
        let whole = read(&path);
        std::fs::remove_file(&path).unwrap();
        let without = told(folder.path());
        assert!(without["changed"].as_array().unwrap().contains(&json!(file)), "{file} is not named");
        for (before, after) in
            as_built["factors"].as_array().unwrap().iter().zip(without["factors"].as_array().unwrap())
        {
            assert!(rank(after) <= rank(before), "{file}: {} is better without it", before["name"]);
            let stood_on_it = before["evidence"].as_array().unwrap().iter().any(|e| e["file"] == json!(file));
            assert!(!stood_on_it || rank(after) <= 1, "{file}: {} is {}", before["name"], after["grade"]);
        }
        write(&path, whole);
    }
    assert_eq!(told(folder.path()), as_built, "all is as it was");
}

/// Takes sentences out of a value: texts of notices, and the list of them.
fn without_words(value: &mut Value) {
    match value {
        Value::Object(all) => {
            all.retain(|key, _| key != "text" && key != "warnings");
            all.values_mut().for_each(without_words);
        }
        Value::Array(all) => all.iter_mut().for_each(without_words),
        _ => {}
    }
}

/// Sentences are for people: whatever they say, what programs read stays.
#[test]
fn a_reworded_build_is_judged_and_inspected_alike() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let log = folder.path().join("build/log.jsonl");
    let inspected = || {
        let run = build_model().arg("inspect").arg(folder.path()).arg("--json").assert().success();
        serde_json::from_slice::<Value>(&run.get_output().stdout).unwrap()
    };
    let (judged, mut before) = (told(folder.path()), inspected());
    let mut reworded = 0;
    let line = |line: &str| {
        let mut record: Value = serde_json::from_str(line).unwrap();
        for notice in record.get_mut("notices").and_then(Value::as_array_mut).into_iter().flatten() {
            reworded += 1;
            notice["text"] =
                json!(format!("wording {reworded}: wrong, left out, too small, at (9, 9, 9), row 3 of other.csv"));
        }
        for words in record.get_mut("warnings").and_then(Value::as_array_mut).into_iter().flatten() {
            *words = json!("another wording: wrong");
        }
        format!("{record}\n")
    };
    let other: String = text(&log).lines().map(line).collect();
    write(&log, other);
    let mut after = inspected();
    assert!(reworded > 0 && before != after);
    assert_eq!(told(folder.path()), judged);
    without_words(&mut before);
    without_words(&mut after);
    assert_eq!(before, after);
}

#[test]
fn an_mri_knee_is_judged_by_what_it_has() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    build_model().args(["phantom", "mri-phantom"]).arg(&knee).assert().success();
    let mut command = build_model();
    command.arg(&knee).args(["--quiet", "--to", "validate"]);
    for set in ["inference.starts=1", "inference.finalists=1", "inference.rounds=1", "inference.samples=12"] {
        command.args(["--set", &format!("calibrate.{set}")]);
    }
    command.assert().success();
    let told = told(&knee);
    assert_eq!(told["changed"], json!([]));
    // bone and cartilage are of one picture: there is nothing to register, and nothing was taken away
    let registration = evidence(&told, "registration");
    assert!(registration["value"].is_null() && registration["as_built"].is_null(), "{registration}");
    for id in ["element-quality", "bone-surface", "misfit", "strain-forces", "other-directions", "forces-determined"] {
        assert!(evidence(&told, id)["value"].is_number(), "{}", evidence(&told, id));
    }
    let all = told["factors"].as_array().unwrap().iter().flat_map(|f| f["evidence"].as_array().unwrap());
    for e in all.filter(|e| e["stage"].is_string()) {
        let path = knee.join("build").join(e["file"].as_str().unwrap());
        assert_eq!(e["digest"], json!(digest(&path)), "{}", e["id"]);
    }
}

#[test]
fn the_page_is_whole_in_order_and_says_what_is_not_known() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let bare = told(folder.path());
    let names: Vec<&str> = bare["factors"].as_array().unwrap().iter().map(|f| f["factor"].as_str().unwrap()).collect();
    assert_eq!(names, ORDER);
    let lacking =
        ["contact-law", "missing-effects", "menisci-sensitivity", "menisci-forces", "starts", "starts-stiffness"];
    for id in lacking.into_iter().chain(["starts-fit", "passive-flexion", "flexion-range"]) {
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
    for question in [
        "Do menisci change",
        "contact law change",
        "start of the search",
        "at flexions predicted",
        "in directions predicted",
    ] {
        assert_eq!(page.matches(question).count(), 1, "{question}");
    }
    for factor in bare["factors"].as_array().unwrap() {
        assert_eq!(factor["enough"], Value::Null);
        for e in factor["evidence"].as_array().unwrap().iter().filter(|e| e["value"].is_number()) {
            assert!(e["digest"].as_str().unwrap().len() == 64 && e["date"].is_string(), "{e}");
            assert!(e["stage"].is_string() != e["test"].is_string(), "{e}");
            assert!(e["stage"].is_string() || e["test_digest"].as_str().unwrap().len() == 64, "{e}");
        }
    }
    // the same bytes again
    let again = page.clone();
    told(folder.path());
    assert_eq!(text(&folder.path().join("build/credibility.html")), again);
}

/// The cells of a page's row by its id: heading first, as they read.
fn cells(page: &str, id: &str) -> Vec<String> {
    let row = page.split(&format!("<tr id=\"{id}\">")).nth(1).unwrap_or_else(|| panic!("{id} is not on the page"));
    let row = row.split("</tr>").next().unwrap();
    let ends = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")];
    let plain = |cell: &str| {
        let inner = cell.rsplit_once('>').map_or(cell, |(_, inner)| inner);
        ends.iter().fold(inner.to_owned(), |text, (from, to)| text.replace(from, to))
    };
    row.split("</td>").flat_map(|part| part.split("</th>")).filter(|part| !part.is_empty()).map(plain).collect()
}

/// Holds the answers of credibility.json against the page, and against the evidence that they name.
fn holds_answers(folder: &Path, told: &Value) {
    let page = text(&folder.join("build/credibility.html"));
    let answers = told["answers"].as_array().unwrap();
    assert_eq!((answers.len(), page.matches("<tr id=\"answer-").count()), (7, 7));
    for answer in answers {
        let word = |key: &str| answer[key].as_str().unwrap();
        let row = cells(&page, &format!("answer-{}", word("id")));
        assert_eq!(row[..2], [word("question"), word("answer")], "{answer}");
        let (numbers, flexions) = (answer["numbers"].as_array().unwrap(), answer["flexions_deg"].as_array().unwrap());
        assert_eq!(numbers.is_empty(), answer["lacking"].is_string(), "{answer}");
        assert!(
            !numbers.is_empty() || answer["verdict"] == "not-known" && row[2].starts_with(word("lacking")),
            "{row:?}"
        );
        for number in numbers {
            let own = evidence(told, number["id"].as_str().unwrap());
            for key in ["value", "unit", "grade"] {
                assert_eq!(number[key], own[key], "{number}");
            }
            assert!(row[2].contains(&format!("{} ", number["name"].as_str().unwrap())), "{number}: {row:?}");
            assert!(own["flexions_deg"].as_array().unwrap().iter().all(|fe| flexions.contains(fe)), "{own}");
        }
        let count = if flexions.is_empty() { "none".to_owned() } else { format!("{}: ", flexions.len()) };
        assert!(row[3].starts_with(&count), "{row:?}");
        assert!(numbers.is_empty() || !flexions.is_empty(), "in how many flexions was it decided? {answer}");
    }
}

#[test]
fn the_page_and_the_file_answer_alike() {
    let folder = TempDir::new().unwrap();
    copy(specimen(), folder.path());
    let bare = told(folder.path());
    holds_answers(folder.path(), &bare);
    // three ends of the search: one as good as the best, one that does not fit
    let stage = folder.path().join("build/10-calibrate");
    let starts = stage.join("joint/starts.csv");
    let whole = text(&starts);
    let mut lines = whole.lines();
    let (header, first) = (lines.next().unwrap(), lines.next().unwrap());
    let (cost, values) = first.split_once(',').unwrap();
    let cost: f64 = cost.parse().unwrap();
    let (strain, others) = values.split_once(',').unwrap();
    let other: f64 = 1.03 * strain.parse::<f64>().unwrap();
    write(
        &starts,
        format!("{header}\n{cost},{values}\n{},{other},{others}\n{},9.9,{others}\n", cost + 1.0, cost + 50.0),
    );
    let mut seals = json(&stage.join("stage.json"));
    seals["files"]["joint/starts.csv"] = json!(digest(&starts));
    write(&stage.join("stage.json"), seals.to_string());
    let told = told(folder.path());
    holds_answers(folder.path(), &told);
    let of = |told: &Value| told["answers"].as_array().unwrap().iter().find(|a| a["id"] == "starts").unwrap().clone();
    let (before, after) = (of(&bare), of(&told));
    assert_eq!((&before["verdict"], &before["did_not_fit"]), (&json!("not-known"), &json!(0)));
    assert_eq!((&after["verdict"], &after["did_not_fit"]), (&json!("some"), &json!(1)), "{after}");
    let spread = evidence(&told, "starts")["value"].as_f64().unwrap();
    assert!((spread - 3.0).abs() < 0.01, "{spread} %: what does not fit counts for nothing");
    // and is not to the model's advantage
    let share = evidence(&told, "starts-fit");
    assert!((share["value"].as_f64().unwrap() - 2.0 / 3.0).abs() < 1e-9 && share["grade"] == "adequate", "{share}");
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

/// Figures that README and the statement of need tell of a page: where, in which words; the page, its words.
const TOLD_OF_PAGES: [[&str; 4]; 9] = [
    ["README.md", "nothing-fitted), root mean square", "docs/paper.md", "They miss by 1.1 N (root mean square)"],
    ["README.md", "by [1.1 N](docs/paper.md#", "docs/paper.md", "They miss by 1.1 N"],
    ["README.md", "misses them by 6.2 N", "docs/paper.md", "with Table 4 as printed by 6.2 N"],
    ["README.md", "50 of 57 strong ones were named first", "docs/discrepancy.md", "named first | 85 % | 50 of 57"],
    ["README.md", "none of 100 with nothing hidden", "docs/discrepancy.md", "nulls that alarm | 5 % | 0 of 100"],
    [
        "docs/need.md",
        "by 1.1 N, root mean square, and by 4 N at most",
        "docs/paper.md",
        "| kla | none | 0 | 168 (164) |",
    ],
    ["docs/need.md", "Of 57 strong hidden effects 50", "docs/discrepancy.md", "named first | 85 % | 50 of 57"],
    [
        "docs/need.md",
        "Of 100 sets with nothing hidden none",
        "docs/discrepancy.md",
        "nulls that alarm | 5 % | 0 of 100",
    ],
    ["docs/need.md", "Of four sets by another laboratory", "docs/discrepancy.md", "nulls that alarm | 10 % | 1 of 4"],
];

#[test]
fn what_the_first_pages_claim_stands_on_the_pages_that_they_name() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let has = |page: &str, words: &str| text(&root.join(page)).contains(words);
    for [first, claim, page, words] in TOLD_OF_PAGES {
        assert!(has(first, claim), "{first} has no more: {claim}");
        assert!(has(page, words), "{first} claims \"{claim}\"; {page} has no more: {words}");
    }
}

/// The code of a test, or of a whole program where no test is named, without blank lines and comments.
fn code(source: &str, name: &str) -> String {
    let begins = |line: &&str| name.is_empty() || line.starts_with(&format!("fn {name}("));
    let mut own: Vec<&str> = Vec::new();
    for line in source.lines().skip_while(|line| !begins(line)) {
        own.push(line.trim());
        if !name.is_empty() && line == "}" {
            break;
        }
    }
    own.retain(|line| !line.is_empty() && !line.starts_with("//"));
    own.join("\n")
}

#[test]
fn a_figure_of_the_program_is_of_the_test_that_is_there_now() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let table: toml::Table = text(&root.join("data/credibility.toml")).parse().unwrap();
    let (mut faults, mut asked) = (Vec::new(), 0);
    for e in table["evidence"].as_array().unwrap() {
        let test = e["test"].as_str().unwrap();
        let (file, name) = test.split_once(": ").unwrap_or((test, ""));
        let own = code(&text(&root.join(file)), name);
        assert!(!own.is_empty(), "{test} is not there");
        let now = blake3::hash(own.as_bytes()).to_hex().to_string();
        asked += 1;
        if e["test_digest"].as_str() != Some(now.as_str()) {
            faults.push(format!(
                "{}: {test} is another one now: take its figure again, then test_digest = \"{now}\"",
                e["id"]
            ));
        }
    }
    assert!(asked > 4 && faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn another_tolerance_makes_another_test_and_a_remark_does_not() {
    let source = |limit: &str, remark: &str| {
        format!("fn a() {{\n    {remark}\n    assert!(x < {limit});\n}}\n\nfn b() {{\n    c();\n}}\n")
    };
    let of = |limit: &str, remark: &str, name: &str| code(&source(limit, remark), name);
    assert_ne!(of("0.1", "", "a"), of("0.2", "", "a"));
    assert_eq!(of("0.1", "", "a"), of("0.1", "// why", "a"));
    assert_eq!(of("0.1", "", "b"), of("0.2", "", "b"), "a neighbour counts for nothing");
    assert_ne!(of("0.1", "", ""), of("0.2", "", ""), "of a whole program every line counts");
    assert!(of("0.1", "", "c").is_empty());
}

//! The report: self-contained, small, the same bytes again; of a failed build; of two builds; in a browser.
#![allow(clippy::unwrap_used, clippy::print_stderr, clippy::disallowed_methods, reason = "tests")]

use crate::common::{build_model, built, copy, phantom, read, text, write};
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// What is between the end of the styles and the data: the words of the page.
fn words(page: &str) -> &str {
    let from = page.find("</style>").unwrap();
    &page[from..page.find("<script").unwrap()]
}

#[test]
fn report_is_one_small_file_with_the_verdict_first() {
    let page = text(&built().join("build/report.html"));
    assert!(page.len() < 15 << 20, "{} bytes", page.len());
    let words = words(&page);
    for outside in ["src=\"http", "href=\"http", "url(http", "@import"] {
        assert!(!words.contains(outside), "{outside}");
    }
    let verdict = words.find("id=\"verdict\"").unwrap();
    assert!(verdict < words.find("id=\"ingest\"").unwrap());
    for stage in ["register", "bones", "cartilage", "frames", "attachments", "hexmesh", "overclosure", "knee"] {
        assert!(words.contains(&format!("data-scene=\"a/{stage}\"")), "{stage}");
        assert!(words.contains(&format!("<figcaption id=\"text-a-{stage}\">")), "{stage}");
    }
    assert!(words.contains("This knee is synthetic"));
}

/// The standing of an answer of the first screen: the class of its card.
fn standing<'a>(page: &'a str, answer: &str) -> &'a str {
    let card = page.find(&format!("data-answer=\"{answer}\"")).unwrap();
    let class = page[..card].rfind("class=\"").unwrap() + "class=\"".len();
    page[class..card].split('"').next().unwrap()
}

#[test]
fn the_joint_knee_is_what_the_report_is_about() {
    let build = crate::one_knee::specimen().join("build");
    for file in ["ap_laxity", "passive_flexion", "pivot_shift", "pivot_shift_no_acl"] {
        assert!(build.join(format!("11-validate/joint/{file}.csv")).exists(), "{file}");
    }
    let compare = text(&build.join("11-validate/compare.csv"));
    for pair in ["joint,kla,", "joint,rks,", "kla,rks,"] {
        assert!(compare.contains(&format!("\n{pair}ap_laxity,")), "{pair}");
    }
    for table in ["table4", "table5", "table6", "table7"] {
        assert!(text(&build.join(format!("11-validate/{table}.csv"))).contains("joint"), "{table}");
    }
    let page = text(&build.join("report.html"));
    let words = words(&page);
    for chart in
        ["answer-joint-kla-AP", "answer-joint-rks-AP", "parameters-joint-stiffness", "forces-joint", "joint-passive"]
    {
        assert!(words.contains(&format!("data-chart=\"a/{chart}\"")), "{chart}");
    }
    assert!(words.contains("Contact of the model joint by compartment"));
    // intervals say by how many samples; what has none says what it is; nothing reads minus nought
    assert!(words.contains("means with 90 % intervals by ") && words.contains("computed: of the most probable model"));
    assert!(!words.contains(" -0 ") && !words.contains("-0.0 ") && !words.contains("0.0 (0.0 to 0.0)"));
    assert!(!words.contains("Not tested. Not tested"));
    let data = &page[page.find("id=\"data\"").unwrap()..];
    let motions: Vec<usize> =
        ["joint: passive flexion", "joint: pivot shift", "joint: measured loads, kla", "kla: passive flexion"]
            .map(|m| data.find(&format!("\"name\":\"{m}\"")).unwrap_or_else(|| panic!("{m}")))
            .to_vec();
    assert!(motions.is_sorted(), "the joint knee moves first");
    for told in ["\"pressure\":{", "\"measured\":[", "\"moves\":\"names\"", "\"edges\":true"] {
        assert!(data.contains(told), "{told}");
    }
}

#[test]
fn four_answers_stand_apart() {
    let page = text(&built().join("build/report.html"));
    assert_eq!(words(&page).matches("data-answer=").count(), 4);
    assert!(["good", "look"].contains(&standing(&page, "geometry")));
    assert!(["good", "look"].contains(&standing(&page, "calibrated")));
    assert_eq!(standing(&page, "missing"), "unknown", "nobody asked");
    // a knee that is not calibrated has nothing that a diagnosis could be asked of
    let word = if built().join("build/10-calibrate").exists() { "Not asked" } else { "Cannot be asked" };
    assert!(words(&page).contains(&format!(">{word}<")) && !words(&page).contains(&format!("{word}. {word}")));
    assert_eq!(words(&page).matches("class=\"sheet\"").count(), 1, "one page to print");
}

#[test]
fn a_knee_without_laxity_is_not_green() {
    let folder = phantom("S192803-phantom");
    assert!(!text(&folder.path().join("specimen.toml")).contains("[laxity]"));
    build_model().arg(folder.path()).arg("--quiet").assert().success();
    let page = text(&folder.path().join("build/report.html"));
    let words = words(&page);
    assert!(words.contains("class=\"verdict look\""), "not green");
    assert!(words.contains("not calibrated") && words.contains("only assembled"));
    assert_eq!(standing(&page, "calibrated"), "look");
    assert_eq!(standing(&page, "predicts"), "unknown");
    assert_eq!(standing(&page, "missing"), "unknown");
    assert!(words.contains(">Cannot be asked<") && !words.contains("--to diagnose"), "a diagnosis would be refused");
    assert!(!words.contains("within all limits"));
}

#[test]
fn report_again_gives_the_same_bytes() {
    let path = built().join("build/report.html");
    let first = text(&path);
    build_model().arg("report").arg(built()).assert().success();
    assert!(text(&path) == first);
}

#[test]
fn report_of_a_failed_build_says_what_and_where() {
    let folder = phantom("S192803-phantom");
    let run =
        build_model().arg(folder.path()).args(["--quiet", "--set", "cartilage.least_area_mm2=100000"]).assert().code(1);
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    let page = text(&folder.path().join("build/report.html"));
    let words = words(&page);
    assert!(words.contains("The build stopped at 04 cartilage."), "{said}");
    assert!(words.contains("04 cartilage: stopped here"));
    assert!(words.contains("data-scene=\"a/failed\""));
    assert!(said.starts_with("build-model: cartilage: "), "{said}");
    build_model().arg(folder.path()).args(["--quiet", "--to", "cartilage"]).assert().success();
    assert!(!text(&folder.path().join("build/report.html")).contains("stopped at"));
    assert!(!folder.path().join("build/failure.json").exists());
}

/// What the log says of each stage that stands in it: its name, and whether it is of an earlier run.
fn logged(build: &Path) -> Vec<(String, bool)> {
    let line = |l: &str| {
        let record: serde_json::Value = serde_json::from_str(l).unwrap();
        (record["stage"].as_str().unwrap().to_owned(), record["outdated"] == true)
    };
    text(&build.join("log.jsonl")).lines().map(line).collect()
}

#[test]
fn a_good_report_is_not_cut_down_and_the_log_is_that_of_the_folder() {
    let folder = phantom("S192803-phantom");
    let build = folder.path().join("build");
    let run = |more: &[&str]| build_model().arg(folder.path()).arg("--quiet").args(more).assert();
    let names = ["ingest", "register", "bones", "cartilage"];
    let all = |outdated: [bool; 4]| names.map(String::from).into_iter().zip(outdated).collect::<Vec<_>>();
    run(&["--to", "cartilage"]).success();
    let [page, methods] = ["report.html", "methods.md"].map(|name| text(&build.join(name)));
    // nothing has changed: what comes after the last stage asked for is as good as before
    run(&["--to", "ingest"]).success();
    assert_eq!(logged(&build), all([false; 4]));
    assert!(text(&build.join("report.html")) == page && !build.join("report-stopped.html").exists());
    // bones that differ: what was made of the old ones stands, and is told so
    run(&["--to", "bones", "--set", "bones.edge_mm=2.5"]).success();
    assert_eq!(logged(&build), all([false, false, false, true]));
    let table = build_model().arg("inspect").arg(folder.path()).assert().success();
    assert!(String::from_utf8_lossy(&table.get_output().stdout).contains("(of an earlier run)"));
    let stopped = text(&build.join("report-stopped.html"));
    assert!(!stopped.contains("id=\"cartilage\"") && stopped.contains("id=\"bones\""));
    // a run that fails
    run(&["--set", "register.error_limit_mm=0.001"]).code(1);
    assert_eq!(logged(&build), all([false, true, true, true]));
    assert!(words(&text(&build.join("report-stopped.html"))).contains("The build stopped at 02 register."));
    assert!(text(&build.join("report.html")) == page && text(&build.join("methods.md")) == methods);
    // whole again
    run(&["--to", "cartilage"]).success();
    assert_eq!(logged(&build), all([false; 4]));
    assert!(text(&build.join("report.html")) == page && text(&build.join("methods.md")) == methods);
    let left = ["report-stopped.html", "methods-stopped.md", "failure.json"].map(|name| build.join(name).exists());
    assert_eq!(left, [false; 3]);
    // what cannot be read is not vouched for
    let value = build.join("04-cartilage/value.cbor");
    let whole = read(&value);
    write(&value, b"cut off");
    run(&["--to", "bones"]).success();
    assert_eq!(logged(&build), all([false, false, false, true]));
    write(&value, whole);
    run(&["--to", "bones"]).success();
    assert_eq!(logged(&build), all([false; 4]));
}

#[test]
fn a_model_of_an_earlier_run_is_refused_until_it_is_built_again() {
    let folder = phantom("S192803-phantom");
    let run = |more: &[&str]| build_model().arg(folder.path()).arg("--quiet").args(more).assert();
    let out = folder.path().join("r.csv");
    let simulate = || {
        let mut command = build_model();
        command.arg("simulate").arg(folder.path()).args(["--protocol", "pivot-shift", "--out"]).arg(&out).assert()
    };
    run(&[]).success();
    simulate().success();
    run(&["--to", "bones", "--set", "bones.edge_mm=2.5"]).success();
    let told = text(&folder.path().join("build/methods.md"));
    simulate().code(1).stderr(predicates::str::contains("09-assemble/model.json is of an earlier run"));
    run(&["--to", "bones"]).success();
    simulate().success();
    assert!(text(&folder.path().join("build/methods.md")) == told, "the methods are those of the folders");
}

#[test]
fn report_of_a_failed_mesh_shows_its_elements() {
    let folder = phantom("S192803-phantom");
    let set = ["--quiet", "--set", "hexmesh.least_scaled_jacobian=0.9"];
    let run = build_model().arg(folder.path()).args(set).assert().code(1);
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    let number = said.split("element ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(number.parse::<u32>().is_ok(), "{said}");
    let page = text(&folder.path().join("build/report.html"));
    assert!(words(&page).contains("07 hexmesh: stopped here"));
    assert!(words(&page).contains("data-scene=\"a/failed\""));
    // The scene draws them where they are, each with its number.
    let data = &page[page.find("id=\"data\"").unwrap()..];
    assert_eq!(data.matches("in CT\"").count(), 20, "elements in the scene");
    assert!(data.contains(&format!("\"element {number} (")), "{said}");
}

#[test]
fn two_builds_stand_side_by_side() {
    let other = phantom("S193761-phantom");
    build_model().arg(other.path()).args(["--quiet", "--to", "bones"]).assert().success();
    build_model().arg("report").arg(built()).arg("--compare").arg(other.path()).assert().success();
    let page = text(&built().join("build/compare.html"));
    assert!(page.len() < 15 << 20, "{} bytes", page.len());
    let words = words(&page);
    assert!(words.contains("data-scene=\"a/bones\"") && words.contains("data-scene=\"b/bones\""));
    assert!(words.contains("This build has not come so far."));
    assert!(words.contains("right less left"));
}

#[test]
fn report_works_in_a_browser() {
    let there = |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    let missing: Vec<&str> = ["chromium", "chromedriver", "python3"].into_iter().filter(|p| !there(p)).collect();
    if !missing.is_empty() {
        eprintln!("report_works_in_a_browser: skipped, {} not there", missing.join(", "));
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser/report.py");
    let shots = TempDir::new().unwrap();
    let run =
        Command::new("python3").arg(script).arg(built().join("build/report.html")).arg(shots.path()).output().unwrap();
    let said = [run.stdout, run.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    if run.status.code() == Some(77) {
        eprintln!("report_works_in_a_browser: skipped, {said}");
        return;
    }
    assert!(run.status.success(), "{said}");
}

/// A build's first screen and groups of warnings without their words, and the places that warnings and messages mark.
fn judged(folder: &Path) -> (Vec<String>, Vec<String>, Vec<String>) {
    build_model().arg("report").arg(folder).assert().success();
    let page = text(&folder.join("build/report.html"));
    let answers = ["geometry", "calibrated", "predicts", "missing"].map(|a| standing(&page, a).to_owned());
    let summaries = page.split("<details class=\"warnings ").skip(1);
    let groups = summaries.map(|s| s[..s.find("</summary>").unwrap()].to_owned());
    let marked = ["places that warnings name", "places that the message names"].into_iter();
    let places = marked.filter_map(|layer| {
        let at = page.find(&format!("\"name\":\"{layer}\""))?;
        let points = at + page[at..].find("\"points\":")?;
        Some(page[points..points + page[points..].find("]]")?].to_owned())
    });
    (answers.to_vec(), groups.collect(), places.collect())
}

/// Sentences are for people: whatever they say, verdict, groups and places stay.
#[test]
fn a_reworded_build_is_judged_alike() {
    let folder = TempDir::new().unwrap();
    copy(built(), folder.path());
    let log = folder.path().join("build/log.jsonl");
    let failure = folder.path().join("build/failure.json");
    let told = text(&built().join("build/log.jsonl"));
    let reworded = |reword: bool, places: bool| {
        let line = |line: &str| {
            let mut record: serde_json::Value = serde_json::from_str(line).unwrap();
            if record["stage"] == "bones" {
                for (name, z) in [("femur", 2.5), ("tibfib", 3.5)] {
                    let (heavy, at) = (serde_json::json!("spikes"), serde_json::json!([[1.5, z, -3.0]]));
                    let mut notice = serde_json::json!({"kind": heavy, "weight": "heavy", "stage": "bones", "element": name, "text": "odd"});
                    if places {
                        notice["places"] = at;
                    }
                    record["notices"].as_array_mut().unwrap().push(notice);
                    record["warnings"].as_array_mut().unwrap().push("odd".into());
                }
            }
            if reword {
                // words by which a warning was once taken for a heavy one, and a place in words
                let other =
                    |k: usize| format!("wording {k}: wrong, left out, too small, at (9, 9, 9), row {k} of other.csv");
                let all = record["notices"].as_array_mut().unwrap();
                all.iter_mut().enumerate().for_each(|(k, n)| n["text"] = other(k).into());
                let all = record["warnings"].as_array_mut().unwrap();
                all.iter_mut().enumerate().for_each(|(k, w)| *w = other(k).into());
            }
            format!("{record}\n")
        };
        write(&log, told.lines().map(line).collect::<String>());
        let message = if reword { "nothing at (7, 7, 7)" } else { "element 3 at (1, 2, 3)" };
        let marks = if places {
            serde_json::json!([{"name": "element 3", "place": [1.0, 2.0, 3.0]}])
        } else {
            serde_json::json!([])
        };
        write(&failure, serde_json::json!({"stage": "diagnose", "message": message, "marks": marks}).to_string());
        judged(folder.path())
    };
    let as_told = reworded(false, true);
    assert!(
        as_told.1.iter().any(|g| g.starts_with("heavy")) && as_told.1.iter().any(|g| g.starts_with("light")),
        "{:?}",
        as_told.1
    );
    assert_eq!(as_told.2.len(), 2, "{:?}", as_told.2);
    assert_eq!(reworded(true, true), as_told);
    assert_ne!(reworded(true, false).2, as_told.2, "places are of the values");
    assert!(text(&folder.path().join("build/report.html")).contains("wording 0"));
}

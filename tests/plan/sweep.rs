//! Many plans of one knee: a row is the plan of that very choice, whatever stands beside it.

use super::knee;
use crate::common::{build_model, json, text, write};
use crate::one_knee::specimen;
use crate::schema::obeys;
use genu::plan::EXAMPLE;
use predicates::str::contains;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

/// The example with few tests.
fn few() -> String {
    EXAMPLE
        .replace("flexions_deg = [0.0, 30.0, 60.0, 90.0]", "flexions_deg = [30.0]")
        .replace("passive_deg = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0]", "passive_deg = [20.0, 90.0]")
}

/// Rows of a sweep by column.
fn rows(folder: &Path) -> Vec<BTreeMap<String, String>> {
    let text = text(&folder.join("sweep.csv"));
    let mut table = csv::Reader::from_reader(text.as_bytes());
    let head = table.headers().unwrap().clone();
    let row = |r: csv::Result<csv::StringRecord>| {
        head.iter().zip(r.unwrap().iter()).map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect()
    };
    table.records().map(row).collect()
}

/// A folder with a plan and a sweep of it.
fn given(plan: &str, sweep: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("graft.toml"), plan);
    write(&folder.path().join("sweep.toml"), sweep);
    folder
}

/// Asks a sweep.
fn asked(knee: &Path, of: &TempDir, to: &str, more: &[&str]) -> assert_cmd::assert::Assert {
    let at = |name: &str| of.path().join(name);
    let mut command = build_model();
    command.arg("plan").arg(knee).arg(at("graft.toml")).arg("--sweep").arg(at("sweep.toml"));
    command.arg("--out").arg(at(to)).args(more).assert()
}

/// A number as the table has it; empty where there is none.
fn cell(value: &Value) -> String {
    value.as_f64().map_or(String::new(), |x| format!("{x:.4}"))
}

/// What plan.json says of a plan, by the columns of a sweep.
fn by_plan(told: &Value) -> BTreeMap<String, String> {
    let mut out = BTreeMap::new();
    let own = &told["grafts"][0];
    for (column, of) in [
        ("quadrant_depth_percent", &own["quadrant_percent"][0]),
        ("quadrant_height_percent", &own["quadrant_percent"][1]),
        ("plateau_front_percent", &own["plateau_percent"][0]),
        ("plateau_medial_percent", &own["plateau_percent"][1]),
        ("slack_length_mm", &own["slack_length_mm"]),
        ("chance_drawer", &told["chances"][0]["chance"]),
        ("chance_pivot_shift", &told["chances"][1]["chance"]),
        ("chance", &told["chances"][2]["chance"]),
    ] {
        out.insert(column.to_owned(), cell(of));
    }
    let four = |out: &mut BTreeMap<String, String>, column: &str, value: &Value| {
        for (end, key) in [("", "value"), ("_mean", "mean"), ("_lower", "lower"), ("_upper", "upper")] {
            out.insert(format!("{column}{end}"), cell(&value[key]));
        }
    };
    let tests = told["tests"].as_array().unwrap();
    for t in tests.iter().filter(|t| t["test"] != "unloaded") {
        let name = format!("{}_{}", t["test"].as_str().unwrap().replace(' ', "_"), t["flexion_deg"].as_f64().unwrap());
        out.insert(format!("chance_{name}"), cell(&t["chance"]));
        if name.contains("drawer") {
            four(&mut out, &format!("{name}_off_mm"), &t["off"]["ap_mm"]);
        }
    }
    for (column, quantity) in [
        ("unloaded_force_n", "graft_hamstring_n"),
        ("unloaded_medial_contact_n", "contact_medial_force_n"),
        ("unloaded_lateral_contact_n", "contact_lateral_force_n"),
    ] {
        let unloaded = tests.iter().filter(|t| t["test"] == "unloaded");
        let all = unloaded.map(|t| &t["states"]["reconstructed"][quantity]);
        let most = all.max_by(|a, b| a["value"].as_f64().unwrap().total_cmp(&b["value"].as_f64().unwrap()));
        four(&mut out, column, most.unwrap());
    }
    out
}

#[test]
fn a_row_is_the_plan_of_that_very_choice_and_threads_and_order_change_nothing() {
    let samples = ["--samples", "6", "--seed", "3"];
    let sweep = "femur_depth_percent = [24.8, 32]\ntension_n = [40, 120]\nat_flexion_deg = [20]\n";
    let of = given(&few(), sweep);
    for (to, jobs) in [("a", "1"), ("b", "3")] {
        asked(specimen(), &of, to, &[&samples[..], &["--jobs", jobs]].concat()).success();
    }
    let at = |name: &str| text(&of.path().join(name));
    for file in ["sweep.csv", "sweep.html"] {
        assert!(at(&format!("a/{file}")) == at(&format!("b/{file}")), "{file}");
    }
    let rows_a = rows(&of.path().join("a"));
    assert_eq!(rows_a.len(), 4);
    // the same choices in another order, beside others
    let other = given(&few(), "at_flexion_deg = [45, 20]\ntension_n = [120, 40]\nfemur_depth_percent = [32, 24.8]\n");
    asked(specimen(), &other, "c", &samples).success();
    let keys = ["femur_depth_percent", "tension_n", "at_flexion_deg"];
    let choices = |r: &BTreeMap<String, String>| keys.map(|k| r[k].clone());
    let rows_c = rows(&other.path().join("c"));
    assert_eq!(rows_c.len(), 8);
    let beside = json(&of.path().join("a/sweep.json"));
    let without_a_graft = |told: &Value| -> Vec<String> {
        let all = told["warnings"].as_array().unwrap().iter().filter_map(Value::as_str);
        all.filter(|w| w.contains(", intact: ") || w.contains(", deficient: ")).map(str::to_owned).collect()
    };
    let mut chances = std::collections::BTreeSet::new();
    for row in &rows_a {
        let mut same = rows_c.iter().find(|r| choices(r) == choices(row)).unwrap().clone();
        for place in ["plan", "rank"] {
            same.insert(place.into(), row[place].clone());
        }
        assert_eq!(&same, row);
        let [depth, tension, _] = choices(row);
        let plan = few()
            .replace("[24.8, 28.5]", &format!("[{depth}, 28.5]"))
            .replace("\ntension_n = 80.0", &format!("\ntension_n = {tension}"));
        write(&of.path().join("one.toml"), plan);
        let mut one = build_model();
        one.arg("plan").arg(specimen()).arg(of.path().join("one.toml")).args(samples).arg("--out");
        one.arg(of.path().join("one")).assert().success();
        let told = json(&of.path().join("one/plan.json"));
        for (column, cell) in by_plan(&told) {
            assert_eq!(row[&column], cell, "{column} of {:?}", choices(row));
        }
        let flags =
            told["tests"].as_array().unwrap().iter().flat_map(|t| t["flags"]["reconstructed"].as_array().unwrap());
        assert!(flags.clone().all(|f| row["flags"].contains(f.as_str().unwrap())));
        assert_eq!(row["samples"], "6");
        // what is odd before a graft is in is the same of all plans, and said once
        assert_eq!(without_a_graft(&beside), without_a_graft(&told));
        // each chance has the samples of which it is
        for (column, of) in row.iter().filter(|(name, _)| name.starts_with("chance") && name.ends_with("_of")) {
            let all: usize = of.parse().unwrap();
            let held = row[column.trim_end_matches("_of")].parse::<f64>().map_or(0.0, |chance| chance * all as f64);
            assert!(all <= 6 && (held - held.round()).abs() < 1e-3, "{column}: {held} of {all}");
        }
        chances.insert(row["unloaded_force_n_mean"].clone());
    }
    // the choices do something
    assert_eq!(chances.len(), 4);
}

#[test]
fn the_ranks_go_by_the_chances_and_the_page_and_the_data_begin_with_the_best() {
    let of = given(&few(), "femur_forwards_mm = [-4, 0, 4]\ntension_n = [40, 120]\n");
    let done = asked(specimen(), &of, "a", &["--samples", "6", "--json"]).success();
    let told: Value = serde_json::from_slice(&done.get_output().stdout).unwrap();
    let schema = json(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schema/sweep.schema.json"));
    obeys(&told, &schema, &schema).unwrap();
    let all = rows(&of.path().join("a"));
    let mut by_rank: Vec<(usize, f64, usize)> = all
        .iter()
        .map(|r| (r["rank"].parse().unwrap(), r["chance"].parse().unwrap(), r["plan"].parse().unwrap()))
        .collect();
    by_rank.sort_by_key(|r| r.0);
    assert_eq!(by_rank.iter().map(|r| r.0).collect::<Vec<_>>(), [1, 2, 3, 4, 5, 6]);
    assert!(by_rank.windows(2).all(|w| w[0].1 >= w[1].1), "{by_rank:?}");
    let best: Vec<u64> = told["best"].as_array().unwrap().iter().map(|b| b["plan"].as_u64().unwrap()).collect();
    assert_eq!(best, by_rank.iter().map(|r| r.2 as u64).collect::<Vec<_>>());
    assert_eq!((&told["plans"], &told["done"], &told["samples"]), (&6.into(), &6.into(), &6.into()));
    let page = text(&of.path().join("a/sweep.html"));
    let row = format!("<tr><td data-head=\"rank\">1</td><td data-head=\"plan\">{}</td>", best[0]);
    // the page says what the plan is, and of how many samples a chance is
    let share = format!(" of {})</td>", all.iter().find(|r| r["rank"] == "1").unwrap()["chance_of"]);
    for words in ["Cut: ACL", "6 samples of the knee were asked", "What was planned", "134 N", share.as_str()] {
        assert!(page.contains(words), "{words}");
    }
    assert!(page.contains(&row) && page.contains("<svg") && !page.contains(" src=\"http"), "{row}");
    // a field a combination in each of the three maps
    let maps = page.split("<h2>Maps</h2>").nth(1).unwrap().split("<h2>").next().unwrap();
    assert_eq!(maps.matches("stroke=\"#fff\"").count(), 3 * 6);
}

#[test]
fn a_graft_too_taut_keeps_its_rank_and_is_marked_wherever_its_plan_is_told() {
    const MARK: &str = "hamstring beyond 250 N unloaded";
    let (folder, ..) = knee();
    let of = given(&few(), "tension_n = [10, 400]\n");
    let done = asked(folder.path(), &of, "a", &["--samples", "0"]).success();
    done.stdout(contains("1 of the first 2 plans has a graft beyond its failure load or beyond 250 N unloaded"));
    let all = rows(&of.path().join("a"));
    let force = |r: &BTreeMap<String, String>| r["unloaded_force_n"].parse::<f64>().unwrap();
    for (row, is_taut) in all.iter().zip([false, true]) {
        assert_eq!((force(row) > 250.0, row["flags"].contains(MARK)), (is_taut, is_taut), "{row:?}");
        assert!(!row["rank"].is_empty(), "{row:?}");
    }
    let told = json(&of.path().join("a/sweep.json"));
    for best in told["best"].as_array().unwrap() {
        let is_taut = best["choices"]["tension_n"] == 400.0;
        assert_eq!(best["flags"].to_string().contains(MARK), is_taut, "{best}");
    }
    // the table of the page names it once, in the row of its plan
    let page = text(&of.path().join("a/sweep.html"));
    assert_eq!(page.matches(MARK).count(), 1);
    assert!(page.contains("1 of the first 2 plans has a graft beyond"));
    // no knee of many plans can be pulled at, and the page of a sweep has no place that says why
    let opened = build_model().args(["open", "--view", "--print"]).arg(of.path().join("a")).assert();
    opened.code(1).stderr(contains("sweep.html has no knee to pull at: it is of many plans"));
    // the plan by itself says the same
    write(&of.path().join("one.toml"), few().replace("\ntension_n = 80.0", "\ntension_n = 400"));
    let mut one = build_model();
    one.arg("plan").arg(folder.path()).arg(of.path().join("one.toml")).args(["--samples", "0", "--out"]);
    one.arg(of.path().join("one")).assert().success().stderr(contains(MARK));
    for file in ["plan.json", "plan.csv", "plan.html"] {
        assert!(text(&of.path().join("one").join(file)).contains(MARK), "{file}");
    }
}

#[test]
fn a_plan_that_cannot_be_done_says_why_and_the_others_stay() {
    let (folder, ..) = knee();
    let of = given(&few(), "stiffness_n_per_mm = [0.1, 200]\ntension_n = [500, 80]\n");
    let told = asked(folder.path(), &of, "a", &["--samples", "0"]).success();
    told.stderr(contains("2 of 4 plans could not be done"));
    let all = rows(&of.path().join("a"));
    for row in &all {
        let is_lost = row["stiffness_n_per_mm"] == "0.1";
        assert_eq!(row["fault"].contains("out of reach"), is_lost, "{row:?}");
        assert_eq!(row["fault"].starts_with("graft "), is_lost, "{row:?}");
        assert_eq!((row["rank"].is_empty(), row["unloaded_force_n"].is_empty()), (is_lost, is_lost), "{row:?}");
        // nobody asked samples
        assert!(row["chance"].is_empty() && row["unloaded_force_n_mean"].is_empty());
    }
    // a sweep of one plan is that plan
    let one = given(&few(), "tension_n = [80]\n");
    asked(folder.path(), &one, "b", &["--samples", "0"]).success();
    let alone = rows(&one.path().join("b")).remove(0);
    let beside = all.iter().find(|r| r["stiffness_n_per_mm"] == "200" && r["tension_n"] == "80").unwrap();
    assert!(alone.iter().all(|(name, x)| ["plan", "rank"].contains(&name.as_str()) || beside[name] == *x));
    assert!(!text(&one.path().join("b/sweep.html")).contains("<h2>Maps</h2>"));
}

#[test]
fn where_no_plan_can_be_done_the_table_says_why_and_the_command_fails() {
    let (folder, ..) = knee();
    let of = given(&few(), "stiffness_n_per_mm = [0.1]\ntension_n = [500, 80]\n");
    let told = asked(folder.path(), &of, "a", &["--samples", "0"]).code(1);
    told.stderr(contains("none of the 2 plans could be done; the first: graft")).stderr(contains("graft.toml"));
    let all = rows(&of.path().join("a"));
    assert!(all.len() == 2 && all.iter().all(|r| r["fault"].contains("out of reach")));
    assert!(!text(&of.path().join("a/sweep.html")).contains("The best"));
}

#[test]
fn a_sweep_that_means_nothing_is_one_clear_error_and_writes_nothing() {
    let (folder, ..) = knee();
    let graft = few();
    let uncut = "cut = [\"ACL\"]\n";
    for (plan, sweep, words) in [
        (graft.as_str(), "tensions_n = [40]", "sweep.toml line 1: no key tensions_n; did you mean tension_n?"),
        (&graft, "tension_n = [40]\nat_flexion_deg = [900]", "line 2: at_flexion_deg has 900"),
        // a place within the percentages, where no bone is
        (&graft, "tension_n = [40]\ntibia_front_percent = [41, -10]\ntibia_medial_percent = [-10]", "meets no bone"),
        (uncut, "tension_n = [40]", "there is no graft to vary"),
    ] {
        let of = given(plan, sweep);
        asked(folder.path(), &of, "a", &["--samples", "0"]).code(1).stderr(contains(words));
        assert!(!of.path().join("a").exists(), "{sweep}");
    }
    // where it lies is told, too
    let of = given(&graft, "tibia_front_percent = [41, -10]\ntibia_medial_percent = [-10]");
    asked(folder.path(), &of, "a", &["--samples", "0"]).code(1).stderr(contains("so with tibia_front_percent"));
    asked(folder.path(), &of, "a", &["--map"]).code(2).stderr(contains("cannot be used with"));
    build_model().args(["plan", "--sweep-example"]).assert().success().stdout(contains("femur_depth_percent"));
}

#[test]
fn what_a_sweep_could_not_keep_is_told_before_the_knee_is_read() {
    let of = given(&few(), "tension_n = [40]\n");
    let nowhere = of.path().join("nowhere");
    for name in ["sweep.csv", "sweep.json", "sweep.html"] {
        let out = TempDir::new().unwrap();
        let run = |more: &[&str]| asked(&nowhere, &of, &out.path().display().to_string(), more).code(1);
        // results of one plan are in nobody's way
        write(&out.path().join("plan.json"), "by hand");
        run(&[]).stderr(contains("nowhere"));
        let file = out.path().join(name);
        write(&file, "by hand");
        run(&[]).stderr(contains("--force")).stderr(contains(name));
        // with it the next fault is the knee's
        run(&["--force"]).stderr(contains("nowhere"));
        assert_eq!(text(&file), "by hand");
    }
}

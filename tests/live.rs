//! The knee in the report answers as `simulate` does: by the library, by the module outside a browser, and by the page in Chromium.
#![allow(clippy::unwrap_used, clippy::print_stderr, clippy::disallowed_methods, reason = "tests")]

use crate::common::{build_model, json, text, write};
use crate::one_knee::specimen;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::GzDecoder;
use genu::model_file::load;
use genu::plan::{Outcome, PlanFile, outcome, parsed};
use live::{Asked, Knee};
use meshes::Point;
use serde_json::Value;
use sim::coordinate::{FREE, Free, Load};
use sim::graft::{COMPRESSION_N, Drawn, Graft, TOE_STRAIN};
use sim::laxity::read;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Module and library may differ by what two compilers make of a sine [mm, deg, N].
const TOLERANCE: f64 = 1e-6;
/// The types of a page's scripts: of the language, and of what a browser gives.
const PAGE: &str = "es2022,dom,dom.iterable";
/// The last digit of a results file [mm, deg, N].
const DIGIT: f64 = 1e-6;
/// A report grows by no more than this [bytes].
const MOST_GROWTH: usize = 3 << 20;
/// The module is no larger [bytes].
const MOST_MODULE: usize = 3 << 19;

/// What stands in the page under `id`, unpacked.
fn part(page: &str, id: &str) -> (usize, Vec<u8>) {
    let from = page.find(&format!("id=\"{id}\">")).unwrap_or_else(|| panic!("no {id}"));
    let coded = page[from..].split('>').nth(1).unwrap().split('<').next().unwrap();
    let mut bytes = Vec::new();
    GzDecoder::new(&STANDARD.decode(coded).unwrap()[..]).read_to_end(&mut bytes).unwrap();
    (coded.len(), bytes)
}

fn report() -> String {
    text(&specimen().join("build/report.html"))
}

#[test]
fn open_goes_to_the_knee_in_the_report() {
    opens_at_the_knee(specimen(), "build/report.html");
}

/// `open` finds the page of a folder, and with --view the knee in it, as an address.
fn opens_at_the_knee(folder: &Path, page: &str) {
    let said = |more: &[&str]| {
        let run = build_model().arg("open").arg(folder).arg("--print").args(more).assert().success();
        text_of(&run.get_output().stdout).trim_end().to_owned()
    };
    let plain = said(&[]);
    assert!(Path::new(&plain).ends_with(page), "{plain}");
    let told = said(&["--view"]);
    assert!(told.starts_with("file:///") && told.ends_with(&format!("{page}#live&")), "{told}");
    assert!(!told.contains(' '), "{told}");
}

#[test]
fn a_page_without_a_knee_says_why_in_the_words_of_its_kind() {
    let out = TempDir::new().unwrap();
    let told = |page: &str, beside: &[&str]| {
        let folder = out.path().join(format!("of {page} and {}", beside.len()));
        std::fs::create_dir(&folder).unwrap();
        for name in [&[page][..], beside].concat() {
            write(&folder.join(name), "<html></html>");
        }
        let run = build_model().arg("open").arg(&folder).args(["--print", "--view"]).assert().failure();
        let said = text_of(&run.get_output().stderr);
        assert!(said.contains(page) && said.contains("has no knee to pull at: "), "{said}");
        said.split("has no knee to pull at: ").nth(1).unwrap().to_owned()
    };
    let all = [
        told("plan.html", &["plan.json"]),
        told("report.html", &["diagnosis.json"]),
        told("report.html", &["log.jsonl", "run.toml"]),
    ];
    assert!(all[2].contains("not calibrated") && !all[0].contains("laxity") && !all[1].contains("laxity"), "{all:?}");
    assert!(all[0] != all[1] && all[0].contains("the page says why"), "{all:?}");
}

fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The trials of both data sets, whole and without the ACL.
fn asked() -> Vec<Asked> {
    let trials =
        |name: &str| read(&std::fs::read(specimen().join(format!("laxity/{name}.csv"))).unwrap()).unwrap().trials;
    let all = trials("kla").into_iter().chain(trials("rks"));
    let both = |t: sim::laxity::LaxityTrial| {
        let cut = |cut: &[&str]| Asked {
            flexion_deg: t.fe_deg,
            load: t.load,
            cut: cut.iter().map(|c| (*c).to_owned()).collect(),
            ..Asked::default()
        };
        [cut(&[]), cut(&["ACL"])]
    };
    all.flat_map(both).collect()
}

/// What `simulate` says, by row and column.
fn simulated(set: &str, without: &[&str]) -> Vec<BTreeMap<String, String>> {
    let out = TempDir::new().unwrap();
    let file = out.path().join("results.csv");
    let mut command = build_model();
    command.arg("simulate").arg(specimen()).arg("--trials").arg(specimen().join(format!("laxity/{set}.csv")));
    without.iter().for_each(|name| {
        command.args(["--without", name]);
    });
    command.arg("--out").arg(&file).assert().success();
    rows_of(&file)
}

/// The rows of a table by column.
fn rows_of(file: &Path) -> Vec<BTreeMap<String, String>> {
    let table = text(file);
    let mut lines = table.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().unwrap();
    lines.map(|l| header.iter().cloned().zip(l).collect()).collect()
}

#[test]
fn the_page_carries_the_knee_within_its_room() {
    let page = report();
    let (module_coded, module) = part(&page, "live-module");
    let (knee_coded, _) = part(&page, "live-knee");
    assert!(module.len() <= MOST_MODULE, "{} bytes of module", module.len());
    assert!(module_coded + knee_coded <= MOST_GROWTH, "{} bytes", module_coded + knee_coded);
    assert!(page.contains("<a href=\"#live\">") && page.contains("data-scene=\"a/live\""));
}

#[test]
fn the_packed_knee_says_what_simulate_says_bands_included() {
    let knee = Knee::open(&part(&report(), "live-knee").1).unwrap();
    for (set, without) in [("kla", &[][..]), ("rks", &["ACL"])] {
        let rows = simulated(set, without);
        let trials = read(&std::fs::read(specimen().join(format!("laxity/{set}.csv"))).unwrap()).unwrap().trials;
        assert_eq!(rows.len(), trials.len());
        for (row, trial) in rows.iter().zip(&trials).step_by(5) {
            let cut = without.iter().map(|c| (*c).to_owned()).collect();
            let asked = Asked { flexion_deg: trial.fe_deg, load: trial.load, cut, ..Asked::default() };
            let told = knee.told(&asked).unwrap();
            let number =
                |column: &str| row[column].parse::<f64>().unwrap_or_else(|_| panic!("{column}: {}", row[column]));
            let pose = told.pose.free();
            for c in FREE {
                assert!((number(&c.column()) - pose[c]).abs() <= DIGIT, "{} {}", trial.trial, c.column());
            }
            // `simulate` asks all samples
            let bands = knee.bands(&asked, knee.about().samples).unwrap().bands;
            assert!(bands.contains_key("ap_mm") && bands.contains_key("force_LCL_n"));
            for (column, band) in &bands {
                let mut ends = vec![("mean", band.mean)];
                // what the model lacks is drawn for all trials of a file together: the ends of a pose are other draws of the same
                if FREE.into_iter().all(|c| c.column() != *column) {
                    ends.extend([("lower", band.lower), ("upper", band.upper)]);
                }
                for (end, value) in ends {
                    let told = number(&format!("{column}_{end}"));
                    assert!((told - value).abs() <= DIGIT, "{} {column}_{end}: {told}, {value}", trial.trial);
                }
            }
            for (bundle, force) in knee.about().bundles.iter().zip(&told.forces_n) {
                assert!((number(&format!("force_{}_n", bundle.name)) - force).abs() <= DIGIT, "{}", bundle.name);
            }
        }
    }
}

/// A graft as plan and page have it: between places of the knee's own ACL, drawn to 60 N at 25 deg while the ACL is cut.
fn planned() -> PlanFile {
    let text = "cut = [\"ACL\"]\n[[graft]]\nname = \"graft 1\"\nfemur = { native = \"ACL_AM\" }\ntibia = { native = \"ACL_PL\" }\n\
                stiffness_n_per_mm = 180\ntension_n = 60\nat_flexion_deg = 25\n[tests]\nflexions_deg = [30]\npassive_deg = [25]\n";
    parsed(text).unwrap()
}

fn lachman(cut: &[&str]) -> Asked {
    let load = Load::new(0.0, 0.0, 0.0, 133.0, 20.0);
    Asked { flexion_deg: 30.0, load, cut: cut.iter().map(|c| (*c).to_owned()).collect(), ..Asked::default() }
}

/// A knee whose ACL is replaced by the graft of [`planned`], whose ends a plan tells.
fn grafted(out: &Outcome) -> Asked {
    let g = &out.grafts[0];
    let drawn = Drawn::Tension { tension_n: 60.0, at_flexion_deg: 25.0, compression_n: COMPRESSION_N };
    let ends = vec![[Point::from(g.femur_mm), Point::from(g.tibia_mm)]];
    let (name, toe_strain) = (g.name.clone(), TOE_STRAIN);
    let graft = Graft { name, ends, stiffness_n_per_mm: g.stiffness_n_per_mm, toe_strain, like: None, drawn };
    Asked { grafts: vec![graft], ..lachman(&["ACL_AM", "ACL_PL"]) }
}

fn plan_of_the_knee() -> Outcome {
    let loaded = load(specimen()).unwrap();
    outcome(&loaded.spec, &loaded.meshes, &planned()).unwrap()
}

#[test]
fn a_plan_and_the_page_give_a_graft_the_same_answer() {
    let knee = Knee::open(&part(&report(), "live-knee").1).unwrap();
    let out = plan_of_the_knee();
    let asked = grafted(&out);
    let mut bears = 0.0_f64;
    for test in out.tests {
        let load = Load(Free(test.load));
        let told = knee.told(&Asked { flexion_deg: test.flexion_deg, load, ..asked.clone() }).unwrap();
        let by_plan = &test.states["reconstructed"];
        for c in FREE {
            let off = told.pose.free()[c] - by_plan[&c.column()].value;
            assert!(off.abs() <= TOLERANCE, "{} {}: {off}", test.test, c.column());
        }
        let force = told.forces_n.last().unwrap();
        assert!((force - by_plan["graft_graft 1_n"].value).abs() <= TOLERANCE, "{}", test.test);
        bears = bears.max(*force);
    }
    assert!(bears > 30.0, "the graft bears {bears} N at most");
    let told = knee.told(&asked).unwrap();
    assert!((told.grafts[0].slack_length_mm - out.grafts[0].slack_length_mm).abs() <= TOLERANCE);
}

#[test]
fn intervals_of_a_changed_knee_are_those_of_samples_that_are_changed_alike() {
    const SAMPLES: usize = 16;
    let knee = Knee::open(&part(&report(), "live-knee").1).unwrap();
    let asked = lachman(&[]);
    let plain = knee.bands(&asked, SAMPLES).unwrap().bands;
    // what changes nothing gives the same bits
    let nothing =
        Asked { strain: [("ACL_AM".into(), 0.0)].into(), stiffness: [("PCL_AL".into(), 1.0)].into(), ..asked.clone() };
    assert_eq!(knee.bands(&nothing, SAMPLES).unwrap().bands, plain);
    // a slacker, softer ACL: the samples' mean moves as the most probable knee does, and half the change moves it less
    let slack = |share: f64| Asked {
        strain: ["ACL_AM", "ACL_PL"].map(|b| (b.to_owned(), -0.04 * share)).into(),
        stiffness: [("ACL_AM".to_owned(), 1.0 - 0.4 * share)].into(),
        ..asked.clone()
    };
    let ap = |a: &Asked| knee.told(a).unwrap().pose.ap_mm;
    let mean = |a: &Asked| knee.bands(a, SAMPLES).unwrap().bands["ap_mm"].mean;
    let (moved, by_samples) = (ap(&slack(1.0)) - ap(&asked), mean(&slack(1.0)) - plain["ap_mm"].mean);
    assert!(moved > 0.5 && (by_samples / moved - 1.0).abs() < 0.5, "{moved} {by_samples}");
    let half = mean(&slack(0.5)) - plain["ap_mm"].mean;
    assert!(half > 0.1 * by_samples && half < by_samples, "{half} {by_samples}");
    // in every sample a graft is drawn to its tension anew
    let graft = Asked { flexion_deg: 25.0, load: Load::compression(COMPRESSION_N), ..grafted(&plan_of_the_knee()) };
    let band = knee.bands(&graft, SAMPLES).unwrap().bands["force_graft0_n"];
    assert!((band.mean - 60.0).abs() < 1.0 && band.lower < band.upper, "{band:?}");
}

#[test]
fn the_page_of_a_plan_carries_the_knee_with_its_grafts() {
    let out = TempDir::new().unwrap();
    let (file, to) = (out.path().join("graft.toml"), out.path().join("plan"));
    let text = "cut = [\"ACL\"]\n[[graft]]\nname = \"g\"\nfemur = { native = \"ACL\" }\ntibia = { native = \"ACL\" }\nstiffness_n_per_mm = 200\n\
                tension_n = 40\n[tests]\nflexions_deg = [30]\npassive_deg = [20]\n";
    write(&file, text);
    build_model()
        .arg("plan")
        .arg(specimen())
        .arg(&file)
        .args(["--samples", "0"])
        .arg("--out")
        .arg(&to)
        .assert()
        .success();
    let page = text_of(&std::fs::read(to.join("plan.html")).unwrap());
    let knee = Knee::open(&part(&page, "live-knee").1).unwrap();
    let from = page.find("data-start=\"").unwrap() + "data-start=\"".len();
    let start = page[from..].split('"').next().unwrap().replace("&quot;", "\"");
    let start: Asked = serde_json::from_str(&start).unwrap();
    let told = knee.told(&start).unwrap();
    let plan = json(&to.join("plan.json"));
    assert!((told.forces_n.last().unwrap() - 40.0).abs() < 0.5, "{:?}", told.forces_n);
    let slack = plan["grafts"][0]["slack_length_mm"].as_f64().unwrap();
    assert!((told.grafts[0].slack_length_mm - slack).abs() <= TOLERANCE);
    opens_at_the_knee(&to, "plan/plan.html");
    in_a_browser("plan.py", &to.join("plan.html"), &serde_json::json!({"told": told, "about": knee.about()}));
}

#[test]
fn the_module_says_what_the_library_says() {
    if !Command::new("node").arg("--version").output().is_ok_and(|o| o.status.success()) {
        eprintln!("the_module_says_what_the_library_says: skipped, node is not there");
        return;
    }
    let knee = Knee::open(&part(&report(), "live-knee").1).unwrap();
    let out = TempDir::new().unwrap();
    let path = |name: &str| out.path().join(name);
    let mut requests: Vec<Value> = asked().iter().map(|a| serde_json::json!({"trial": a})).collect();
    let bands = |a: &Asked| serde_json::json!({"bands": {"trial": a, "most": 4}});
    requests.extend(asked().iter().step_by(17).map(bands));
    let graft = grafted(&plan_of_the_knee());
    requests.extend([serde_json::json!({"trial": graft}), bands(&graft)]);
    write(&path("requests.json"), serde_json::to_vec(&requests).unwrap());
    let mut command = Command::new("node");
    command.arg(script("module.mjs")).arg(specimen().join("build/report.html"));
    command.args([path("requests.json"), path("replies.json")]);
    // CI gives the module that it has built anew
    command.args(std::env::var_os("GENU_MODULE").map(PathBuf::from));
    let run = command.output().unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let replies = json(&path("replies.json"));
    let replies = replies.as_array().unwrap();
    assert_eq!(replies.len(), requests.len() + 1);
    assert!(replies[0]["bundles"].is_array(), "{}", replies[0]);
    let mut most = 0.0;
    for (request, reply) in requests.iter().zip(&replies[1..]) {
        let own: Value = serde_json::from_slice(&live::answer(&knee, request.to_string().as_bytes())).unwrap();
        assert_eq!(own.get("fault"), reply.get("fault"), "{request}");
        apart(&own, reply, "", &mut most);
    }
    assert!(most <= TOLERANCE, "{most}");
}

/// The largest difference of two replies, by their numbers.
fn apart(a: &Value, b: &Value, key: &str, most: &mut f64) {
    match (a, b) {
        // how many evaluations it took, and which corners count as pressed, may turn on the last bit
        _ if ["evaluations", "pressure"].contains(&key) => {}
        (Value::Object(x), Value::Object(y)) => {
            assert_eq!(x.keys().collect::<Vec<_>>(), y.keys().collect::<Vec<_>>(), "{key}");
            x.iter().for_each(|(k, v)| apart(v, &y[k], k, most));
        }
        (Value::Array(x), Value::Array(y)) => {
            assert_eq!(x.len(), y.len(), "{key}");
            x.iter().zip(y).for_each(|(v, w)| apart(v, w, key, most));
        }
        (Value::Number(x), Value::Number(y)) => *most = most.max((x.as_f64().unwrap() - y.as_f64().unwrap()).abs()),
        _ => assert_eq!(a, b, "{key}"),
    }
}

/// The page of a diagnosis holds the model that it leaves, and a browser shows what that model answers.
pub(crate) fn page_answers_as_its_model(folder: &Path) {
    let page = text(&folder.join("report.html"));
    let knee = Knee::open(&part(&page, "live-knee").1).unwrap();
    let trials = folder.join("trials.csv");
    write(
        &trials,
        "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n\
        rest,neutral,30,0,0,0,0,20,30,,,,,\nlachman,anterior,30,0,0,0,133,20,30,,,,,\n",
    );
    let results = folder.join("results.csv");
    let mut command = build_model();
    command.arg("simulate").arg(folder.join("model.json")).arg("--trials").arg(&trials).args(["--samples", "0"]);
    command.arg("--out").arg(&results).assert().success();
    let rows = rows_of(&results);
    let rest = Asked { load: Load::compression(COMPRESSION_N), ..lachman(&[]) };
    let asked = [rest, lachman(&[])];
    for (row, asked) in rows.iter().zip(&asked) {
        let pose = knee.told(asked).unwrap().pose.free();
        for c in FREE {
            let simulated: f64 = row[&c.column()].parse().unwrap();
            assert!((simulated - pose[c]).abs() <= DIGIT, "{}: {simulated}, {}", c.column(), pose[c]);
        }
    }
    let told = asked.map(|a| serde_json::to_value(knee.told(&a).unwrap()).unwrap());
    let expected = serde_json::json!({"about": knee.about(), "rest": told[0], "lachman": told[1]});
    opens_at_the_knee(folder, "report.html");
    in_a_browser("diagnosis.py", &folder.join("report.html"), &expected);
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser").join(name)
}

/// What the check of types says of files that run with the types of `lib`: nothing where they keep them. `all`: each parameter must have one.
fn types_of(tsc: &OsStr, lib: &str, all: bool, files: &[PathBuf]) -> String {
    let strict = ["--noEmit", "--allowJs", "--checkJs", "--strict", "--target", "es2022", "--lib", lib];
    let any = ["--noImplicitAny", if all { "true" } else { "false" }];
    let run = Command::new("node").arg(tsc).args(strict).args(any).args(files).output().unwrap();
    let said = text_of(&[run.stdout, run.stderr].concat());
    assert_eq!(run.status.success(), said.is_empty(), "{said}");
    said
}

#[test]
fn the_scripts_of_a_page_keep_their_types_and_those_of_the_library() {
    // where TypeScript could be had
    let Some(tsc) = std::env::var_os("GENU_TSC") else {
        eprintln!("the_scripts_of_a_page_keep_their_types_and_those_of_the_library: skipped, GENU_TSC names no tsc");
        return;
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipeline/src/report");
    let named = |names: &[&str]| names.iter().map(|n| folder.join(n)).collect::<Vec<_>>();
    let worker = named(&["live_worker.js"]);
    let files = std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().path());
    let scripts = files.filter(|f| f.extension().is_some_and(|e| e == "js") && !worker.contains(f));
    let page: Vec<PathBuf> = scripts.chain(named(&["page.d.ts"])).collect();
    assert!(page.len() > 7, "{page:?}");
    assert_eq!(types_of(&tsc, PAGE, false, &page), "");
    // these have a type at each parameter
    let hands = named(&["live_words.js", "live_hand.js", "live_graft.js", "live_draft.js", "page.d.ts"]);
    assert_eq!(types_of(&tsc, PAGE, true, &hands), "");
    assert_eq!(types_of(&tsc, "es2022,webworker", true, &worker), "");
    // what the page takes a reply for is what the library gives, no key more and none less
    let knee = Knee::open(&part(&report(), "live-knee").1).unwrap();
    let asked = grafted(&plan_of_the_knee());
    let replies = [
        ("LiveAsked", serde_json::to_value(&asked).unwrap()),
        ("LiveAboutKnee", serde_json::to_value(knee.about()).unwrap()),
        ("LiveTold", serde_json::to_value(knee.told(&asked).unwrap()).unwrap()),
        ("LiveBands", serde_json::to_value(knee.bands(&asked, 4).unwrap()).unwrap()),
    ];
    let out = TempDir::new().unwrap();
    let file = out.path().join("replies.ts");
    let says = |kind: &str, value: &Value| {
        write(&file, format!("const reply: {kind} = {value};\n"));
        types_of(&tsc, PAGE, true, &[file.clone(), folder.join("page.d.ts")])
    };
    for (kind, reply) in &replies {
        assert_eq!(says(kind, reply), "", "{kind}");
        // one key away is seen, and one key more
        let key = reply.as_object().unwrap().keys().next().unwrap().clone();
        let (mut less, mut more) = (reply.clone(), reply.clone());
        less.as_object_mut().unwrap().remove(&key);
        more["unheard_of"] = true.into();
        assert!(says(kind, &less).contains(&key), "{kind} without {key}");
        assert!(says(kind, &more).contains("unheard_of"), "{kind} with a key more");
    }
}

#[test]
fn a_reader_pulls_at_the_knee_in_a_browser() {
    // what the page must show, from the library
    let knee = Knee::open(&part(&report(), "live-knee").1).unwrap();
    let told = |asked: &Asked| serde_json::to_value(knee.told(asked).unwrap()).unwrap();
    let graft = grafted(&plan_of_the_knee());
    let expected = serde_json::json!({
        "about": knee.about(),
        "lachman": told(&lachman(&[])),
        "cut": told(&lachman(&["ACL"])),
        "graft": {"asked": graft, "told": told(&graft), "bands": knee.bands(&graft, 32).unwrap()},
    });
    in_a_browser("live.py", &specimen().join("build/report.html"), &expected);
}

/// Drives a page with a script of tests/browser; left out where there is no browser.
fn in_a_browser(name: &str, page: &Path, expected: &Value) {
    let there = |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    let missing: Vec<&str> = ["chromium", "chromedriver", "python3"].into_iter().filter(|p| !there(p)).collect();
    if !missing.is_empty() {
        eprintln!("{name}: skipped, {} not there", missing.join(", "));
        return;
    }
    let out = TempDir::new().unwrap();
    write(&out.path().join("expected.json"), expected.to_string());
    let run = Command::new("python3")
        .arg(script(name))
        .arg(page)
        .args([out.path().join("expected.json"), out.path().join("shots")])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&[run.stdout, run.stderr].concat()).into_owned();
    if run.status.code() == Some(77) {
        eprintln!("{name}: skipped, {said}");
        return;
    }
    assert!(run.status.success(), "{said}");
    eprintln!("{said}");
}

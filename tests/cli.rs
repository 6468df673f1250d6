//! The command line: verbs, exit statuses, words.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

use crate::common::{build_model, copy, files, json, phantom, read, write};
use crate::one_knee;
use predicates::str::contains;
use std::path::Path;
use tempfile::TempDir;

#[test]
fn wrong_use_ends_with_2_and_says_what_was_expected() {
    let specimen = phantom("S193761-phantom");
    for (arguments, words) in [
        (vec![], "Usage"),
        (vec!["--to", "bonse"], "ingest, register, bones"),
        (vec!["--from", "frames", "--to", "bones"], "comes after"),
        (vec!["--set", "bones.edge_mm"], "stage.key=value"),
        (vec!["--set", "bones.no_such=1"], "bones.no_such"),
        (vec!["--set", "bnes.edge_mm=1"], "bnes"),
        (vec!["--jobs", "0"], "--jobs"),
        (vec!["--no-such"], "--no-such"),
    ] {
        let mut command = build_model();
        if !arguments.is_empty() {
            command.arg(specimen.path());
        }
        command.args(&arguments).assert().code(2).stderr(contains(words));
    }
    assert!(!specimen.path().join("build/01-ingest").exists());
}

#[test]
fn help_and_version() {
    build_model().arg("--help").assert().success().stdout(contains("phantom")).stdout(contains("inspect"));
    build_model().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn a_phantom_is_written_built_and_inspected() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    build_model().arg("phantom").arg("right-phantom").arg(&knee).assert().success().stdout(contains("synthetic"));
    build_model().arg("phantom").arg("no-such").arg(&knee).assert().code(1).stderr(contains("right-phantom"));
    build_model().arg("phantom").arg("S193761-phantom").arg(&knee).assert().code(1).stderr(contains("not empty"));
    build_model().arg("inspect").arg(&knee).assert().code(1).stderr(contains("no build"));
    build_model().arg(&knee).args(["--to", "bones"]).assert().success().stdout(contains("report.html"));
    build_model().arg("inspect").arg(&knee).assert().success().stdout(contains("03  bones"));
    build_model()
        .arg("inspect")
        .arg(&knee)
        .args(["bones", "--json"])
        .assert()
        .success()
        .stdout(contains("\"stage\": \"bones\""));
    build_model().arg("inspect").arg(&knee).arg("hexmesh").assert().code(1).stderr(contains("has not been run"));
    build_model().arg("report").arg(&knee).assert().success().stdout(contains("report.html"));
}

#[test]
fn json_and_quiet_print_nothing_else() {
    let specimen = phantom("S193761-phantom");
    let run = build_model().arg(specimen.path()).args(["--to", "ingest", "--json"]).output().unwrap();
    let records: Vec<serde_json::Value> = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(records[0]["stage"], "ingest");
    assert!(run.stderr.is_empty());
    let run = build_model().arg(specimen.path()).args(["--to", "ingest", "--quiet"]).output().unwrap();
    assert!(run.stdout.is_empty() && run.stderr.is_empty());
}

/// Verbs with results at --out, each with the file that is edited there; the words that are the same for all come after.
const WITH_RESULTS: [(&[&str], &str); 5] = [
    (&["simulate", "--protocol", "pivot-shift", "--samples", "0"], ""),
    (&["validate", "--samples", "0"], "compare.csv"),
    (&["credibility"], "credibility.json"),
    (&["cohort"], "cohort.html"),
    (&["export", "--format", "stl"], "femur_bone.stl"),
];

#[test]
fn what_was_edited_stays_in_every_verb_until_forced() {
    let out = TempDir::new().unwrap();
    let knee = one_knee::specimen().display().to_string();
    for (words, inner) in WITH_RESULTS {
        let place = out.path().join(words[0]);
        let file = if inner.is_empty() { place.clone() } else { place.join(inner) };
        let run = |more: &[&str]| {
            let mut command = build_model();
            command.args(words).arg(&knee).arg("--out").arg(&place).args(more).assert()
        };
        run(&[]).success();
        run(&[]).success();
        write(&file, "by hand");
        let told = run(&["--json"]).code(1);
        let error: serde_json::Value = serde_json::from_slice(&told.get_output().stderr).unwrap();
        assert_eq!((&error["code"], &error["file"]), (&"file".into(), &file.display().to_string().into()), "{error}");
        for part in ["message", "advice"] {
            assert!(error[part].as_str().unwrap().contains("--force"), "{error}");
        }
        assert_eq!(read(&file), b"by hand", "{words:?}");
        run(&["--force"]).success();
        assert_ne!(read(&file), b"by hand", "{words:?}");
    }
}

/// A graft, for a short plan.
const GRAFT: &str = "cut = ['ACL']\n[[graft]]\nname = 'g'\nfemur = { native = 'ACL' }\ntibia = { native = 'ACL' }\n\
    stiffness_n_per_mm = 200\nslack_length_mm = 20\n[tests]\nflexions_deg = [30]\npassive_deg = [0, 60]\n";

/// Verbs with a folder of results, as they take least time: KNEE is what they read, LAXITY and GRAFT are files beside it.
const INTO_A_FOLDER: [&[&str]; 7] = [
    &["validate", "KNEE", "--samples", "0", "--solver", "quasistatic"],
    &["cohort", "KNEE"],
    &["credibility", "KNEE"],
    &["plan", "KNEE", "GRAFT", "--samples", "0"],
    &["plan", "KNEE", "GRAFT", "--samples", "0", "--map"],
    &["diagnose", "KNEE", "--measured", "rks=LAXITY", "--atlas"],
    &[
        "calibrate",
        "KNEE",
        "--targets",
        "LAXITY",
        "--set",
        "calibrate.inference.starts=1",
        "--set",
        "calibrate.inference.finalists=1",
        "--set",
        "calibrate.inference.rounds=1",
        "--set",
        "calibrate.inference.samples=0",
    ],
];

/// The law over all verbs with a folder: a file that the verb wrote and that was edited stops it before it reads what it is asked of.
/// Else a model that cannot be read would be told.
#[test]
fn an_edit_of_any_result_is_told_before_the_model_is_read() {
    let folder = TempDir::new().unwrap();
    let place = |name: &str| folder.path().join(name);
    for broken in ["broken", "broken/09-assemble"] {
        std::fs::create_dir_all(place(broken)).unwrap();
        write(&place(broken).join("model.json"), "no model");
    }
    write(&place("graft.toml"), GRAFT);
    let laxity = one_knee::specimen().join("laxity/rks.csv");
    for (n, words) in INTO_A_FOLDER.into_iter().enumerate() {
        let run = |knee: &Path, out: &Path| {
            let as_said = |word: &&str| match *word {
                "KNEE" => knee.display().to_string(),
                "GRAFT" => place("graft.toml").display().to_string(),
                word => word.replace("LAXITY", &laxity.display().to_string()),
            };
            build_model().args(words.iter().map(as_said)).arg("--out").arg(out).assert()
        };
        let whole = place(&format!("{n}"));
        run(one_knee::specimen(), &whole).success();
        let is_result =
            |name: &String| !name.starts_with(".written/") && (words[0] != "validate" || !name.contains('/'));
        let results: Vec<String> = files(&whole).into_keys().filter(is_result).collect();
        assert!(results.len() >= 2, "{words:?}: {results:?}");
        let edited = place(&format!("{n}-edited"));
        copy(&whole, &edited);
        let told = run(&place("broken"), &edited).failure();
        let told = String::from_utf8_lossy(&told.get_output().stderr).into_owned();
        assert!(!told.contains("--force"), "{words:?}: without an edit it is the model that is told: {told}");
        for name in results {
            let (file, was) = (edited.join(&name), read(&edited.join(&name)));
            write(&file, "by hand");
            let told = run(&place("broken"), &edited).code(1).stderr(contains("--force"));
            told.stderr(contains(file.display().to_string()));
            write(&file, was);
        }
    }
}

/// Files of single models are known once the models are read: they are looked at before a model is compiled.
#[test]
fn an_edit_among_the_answers_of_a_model_is_told_before_it_is_asked() {
    let folder = TempDir::new().unwrap();
    let place = |name: &str| folder.path().join(name);
    // it can be read, and it cannot be compiled
    changed_model(&place("model.json"), |model| model["fibres"][0]["bundle"] = "of no model".into());
    let run = |out: &str| {
        let mut command = build_model();
        command.arg("validate").arg(format!("a={}", place("model.json").display())).args(["--samples", "0", "--out"]);
        command.arg(place(out)).assert().code(1)
    };
    run("none").stderr(contains("no bundle is named"));
    for protocol in ["ap_laxity", "passive_flexion", "pivot_shift", "pivot_shift_no_acl"] {
        let out = place(protocol);
        std::fs::create_dir_all(out.join("a")).unwrap();
        write(&out.join("a").join(format!("{protocol}.csv")), "by hand");
        run(protocol).stderr(contains("--force")).stderr(contains(format!("a/{protocol}.csv")));
        // answers of another model, and files of other commands, are in nobody's way
        std::fs::rename(out.join("a"), out.join("b")).unwrap();
        write(&out.join("plan.json"), "by hand");
        run(protocol).stderr(contains("no bundle is named"));
    }
}

/// The knee's own model as a file elsewhere, with paths that hold there, and with a change.
fn changed_model(file: &Path, change: impl Fn(&mut serde_json::Value)) {
    let own = one_knee::specimen().join("build/10-calibrate/joint");
    let mut model = json(&own.join("model.json"));
    change(&mut model);
    write(file, serde_json::to_string(&model).unwrap().replace("\"../", &format!("\"{}/../", own.display())));
}

/// A page as its reader sees it: data for scripts are no text of it.
fn without_scripts(page: &str) -> String {
    let parts = page.split("<script").enumerate();
    parts
        .map(|(n, part)| if n == 0 { part } else { part.split_once("</script>").map_or("", |(_, rest)| rest) })
        .collect()
}

#[test]
fn names_of_any_kind_are_text_in_pages() {
    let folder = TempDir::new().unwrap();
    let place = |name: &str| folder.path().join(name);
    changed_model(&place("model.json"), |model| model["id"] = "<knee>&\"".into());
    write(&place("graft.toml"), GRAFT.replace("'g'", "'<graft>&'"));
    std::fs::copy(one_knee::specimen().join("laxity/rks.csv"), place("rks.csv")).unwrap();
    let model = place("model.json").display().to_string();
    let run = |words: &[&str], out: &str| {
        build_model().args(words).current_dir(folder.path()).arg("--out").arg(place(out)).assert().success();
    };
    run(&["plan", &model, "graft.toml", "--samples", "0"], "plan");
    run(&["diagnose", &model, "--measured", "rks=rks.csv", "--atlas"], "atlas");
    let pages = [("plan/plan.html", &["knee", "graft"][..]), ("atlas/atlas.html", &["knee"])];
    for (page, names) in pages {
        let seen = without_scripts(&String::from_utf8(read(&place(page))).unwrap());
        for name in names {
            assert!(
                !seen.contains(&format!("<{name}>")) && seen.contains(&format!("&lt;{name}&gt;")),
                "{page}: {name}"
            );
        }
    }
}

#[test]
#[cfg(unix)]
fn a_file_of_others_is_no_result() {
    let out = TempDir::new().unwrap();
    let (file, link) = (out.path().join("notes.csv"), out.path().join("link.csv"));
    write(&file, "years of work");
    std::os::unix::fs::symlink("notes.csv", &link).unwrap();
    for place in [&file, &link] {
        let mut command = build_model();
        // before anything is read: there is no such model
        command.arg("simulate").arg(out.path().join("none")).args(["--protocol", "pivot-shift", "--out"]);
        command.arg(place).assert().code(1).stderr(contains("--force"));
        let mut command = build_model();
        command.arg("next-tests").arg(out.path().join("none")).args(["--for", "ACL", "--out"]);
        command.arg(place).assert().code(1).stderr(contains("--force"));
        assert_eq!(read(&file), b"years of work");
    }
}

/// Two wishes, two words: to begin a search anew, and to write over what was edited.
#[test]
fn beginning_anew_and_writing_over_are_asked_for_apart() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("c");
    std::fs::create_dir_all(&out).unwrap();
    let saved = out.join("checkpoint.cbor");
    let run = |more: &[&str]| {
        let mut command = build_model();
        command.arg("calibrate").arg(one_knee::specimen()).arg("--targets");
        command.arg(one_knee::specimen().join("laxity/rks.csv")).args(["--out", out.to_str().unwrap()]).args(more);
        command.args(["--set", "calibrate.inference.samples=0", "--set", "calibrate.inference.starts=1"]);
        command.args(["--set", "calibrate.inference.finalists=1", "--set", "calibrate.inference.rounds=1"]).assert()
    };
    write(&saved, "of another search");
    for more in [vec![], vec!["--force"]] {
        run(&more).code(1).stderr(contains("checkpoint"));
        assert_eq!(read(&saved), b"of another search", "{more:?}");
    }
    write(&out.join("model.json"), "by hand");
    run(&["--anew"]).code(1).stderr(contains("--force"));
    assert_eq!((read(&saved), read(&out.join("model.json"))), (b"of another search".to_vec(), b"by hand".to_vec()));
    run(&["--anew", "--force"]).success();
    assert!(!saved.exists() && json(&out.join("model.json")).is_object());
}

#[test]
fn details_go_to_standard_error_and_change_nothing_else() {
    let out = TempDir::new().unwrap();
    let knee = one_knee::specimen().display().to_string();
    let commands: [&[&str]; 4] = [&["inspect", &knee], &["options"], &["credibility", &knee], &["cohort", &knee]];
    for words in commands {
        let place = out.path().join(words[0]).display().to_string();
        let more: &[&str] = if ["inspect", "options"].contains(&words[0]) { &[] } else { &["--out", &place] };
        let run = |flag: &[&str]| {
            let done = build_model().args(words).args(more).args(flag).assert().success();
            let texts = [&done.get_output().stdout, &done.get_output().stderr];
            texts.map(|bytes| String::from_utf8(bytes.clone()).unwrap())
        };
        let ([plain, _], [same, told]) = (run(&[]), run(&["-v"]));
        assert_eq!(plain, same, "{words:?}");
        let details: Vec<&str> = told.lines().filter(|l| l.get(8..11) == Some(" s ")).collect();
        assert!(details[0].contains("build-model") && details.last().unwrap().contains("ends with 0"), "{told}");
        assert!(words[0] == "options" || details.iter().any(|l| l.contains("reads ")), "{told}");
        assert_eq!(details.iter().any(|l| l.contains("writes ")), !more.is_empty(), "{told}");
    }
    let specimen = phantom("S193761-phantom");
    let run = build_model().arg(specimen.path()).args(["--to", "ingest", "--verbose"]).assert().success();
    let told = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    for part in ["specimen.toml", "ingest begins", "ingest is done", "01-ingest", "ends with 0"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    build_model().arg(specimen.path()).args(["-v", "-q"]).assert().code(2);
    assert!(json(&specimen.path().join("build/01-ingest/metrics.json")).is_object());
}

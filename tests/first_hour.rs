//! The first hour: init from files, check, build, open, with no other page needed; options, completions and manual.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare and look at files")]

use crate::common::{build_model, phantom, shared};
use needs_shared::needs_shared;
use predicates::prelude::*;
use predicates::str::contains;
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// Copies the files of a specimen into one heap, under names that say nothing.
fn heap(specimen: &Path, into: &Path) {
    fs::create_dir_all(into).unwrap();
    for (from, to) in [
        ("ct/femur.stl", "a.stl"),
        ("ct/tibfib.stl", "b.stl"),
        ("scans/femur.ply", "c.ply"),
        ("scans/tibfib.ply", "d.ply"),
        ("landmarks.csv", "points1.csv"),
        ("marks.csv", "points2.csv"),
        ("laxity/kla.csv", "kla.csv"),
        ("laxity/rks.csv", "rks.csv"),
    ] {
        if specimen.join(from).exists() {
            fs::copy(specimen.join(from), into.join(to)).unwrap();
        }
    }
}

/// Init from a heap, check, build as far as `to`, open: the words of each, and what specimen.toml says.
fn first_hour(specimen: &Path, to: &str) -> (String, String) {
    let folder = TempDir::new().unwrap();
    let (files, knee) = (folder.path().join("files"), folder.path().join("knee"));
    heap(specimen, &files);
    let wrote = build_model().arg("init").arg(&knee).arg("--from").arg(&files).assert().success();
    let wrote = String::from_utf8_lossy(&wrote.get_output().stdout).into_owned();
    assert!(wrote.contains("build-model check"), "{wrote}");
    let checked = build_model().arg("check").arg(&knee).assert().success().stdout(contains("build-model build"));
    let checked = String::from_utf8_lossy(&checked.get_output().stdout).into_owned();
    assert!(!knee.join("build/01-ingest").exists(), "check builds nothing");
    build_model().arg("build").arg(&knee).args(["--to", to, "--quiet"]).assert().success();
    build_model().arg("open").arg(&knee).arg("--print").assert().success().stdout(contains("report.html"));
    let methods = fs::read_to_string(knee.join("build/methods.md")).unwrap();
    assert!(methods.contains("was built with Genu"), "{methods}");
    (checked, fs::read_to_string(knee.join("specimen.toml")).unwrap())
}

#[test]
fn a_heap_of_a_phantoms_files_becomes_a_build() {
    for (id, side) in [("S193761-phantom", "left"), ("right-phantom", "right")] {
        let (checked, toml) = first_hour(phantom(id).path(), "bones");
        for words in
            ["femur = \"ct/a.stl\"", "tibfib = \"ct/b.stl\"", "femur = \"scans/c.ply\"", "tibfib = \"scans/d.ply\""]
        {
            assert!(toml.contains(words), "{words} is not in\n{toml}");
        }
        assert!(toml.contains(&format!("side = \"{side}\"")), "{toml}");
        assert!(checked.contains("nothing to calibrate to"), "{checked}");
    }
}

#[needs_shared]
fn a_heap_of_the_published_specimens_files_becomes_a_build() {
    let Some(specimen) = shared("a_heap_of_the_published_specimens_files_becomes_a_build", "specimens/S192803") else {
        return;
    };
    let (checked, toml) = first_hour(&specimen, "frames");
    for words in ["femur = \"ct/a.stl\"", "tibfib = \"scans/d.ply\"", "side = \"left\"", "kla = \"laxity/kla.csv\""] {
        assert!(toml.contains(words), "{words} is not in\n{toml}");
    }
    assert!(checked.contains("laxity.kla") && !checked.contains("against its load"), "{checked}");
}

#[test]
fn a_label_map_alone_becomes_a_build() {
    let folder = TempDir::new().unwrap();
    let made = phantom("mri-phantom");
    let knee = folder.path().join("knee");
    let map = made.path().join("mri/labels.nii.gz");
    build_model().arg("init").arg(&knee).arg("--from").arg(&map).assert().success().stdout(contains("a label map"));
    let key = |folder: &Path, key: &str| {
        let toml: toml::Table = fs::read_to_string(folder.join("specimen.toml")).unwrap().parse().unwrap();
        (toml["segmentation"][key].clone(), toml["specimen"]["side"].clone())
    };
    for name in ["femur", "tibia", "femoral_cartilage", "tibial_cartilage_medial", "tibial_cartilage_lateral"] {
        assert_eq!(key(&knee, name), key(made.path(), name));
    }
    build_model().arg("check").arg(&knee).assert().success();
    build_model().arg("build").arg(&knee).args(["--to", "bones", "--quiet"]).assert().success();
}

#[needs_shared]
fn the_label_maps_at_hand_are_known() {
    let Some(mri) = shared("the_label_maps_at_hand_are_known", "mri") else { return };
    for (id, side) in [("S192803", "left"), ("kneeB", "right")] {
        let folder = TempDir::new().unwrap();
        let knee = folder.path().join("knee");
        build_model().arg("init").arg(&knee).arg("--from").arg(mri.join(id).join("labels.nrrd")).assert().success();
        let toml: toml::Table = fs::read_to_string(knee.join("specimen.toml")).unwrap().parse().unwrap();
        assert_eq!(toml["specimen"]["side"].as_str(), Some(side));
        // as the data's own page has them
        for (name, label) in [
            ("femoral_cartilage", 1),
            ("tibial_cartilage_medial", 2),
            ("tibial_cartilage_lateral", 3),
            ("patellar_cartilage", 4),
            ("femur", 5),
            ("tibia", 6),
            ("patella", 7),
            ("fibula", 8),
            ("meniscus_lateral", 9),
            ("meniscus_medial", 10),
        ] {
            let found = toml["segmentation"].get(name).and_then(toml::Value::as_integer);
            // the made knee's fibula and menisci have no label
            assert!(
                found == Some(label) || (id == "S192803" && found.is_none()),
                "{id}: {name} is {found:?}, not {label}"
            );
        }
    }
}

#[test]
fn points_without_frames_get_those_of_the_surfaces_they_lie_on() {
    let specimen = phantom("S193761-phantom");
    let folder = TempDir::new().unwrap();
    heap(specimen.path(), &folder.path().join("files"));
    let marks = fs::read_to_string(specimen.path().join("marks.csv")).unwrap();
    let bare: String = marks
        .lines()
        .map(|l| l.split(',').enumerate().filter(|(i, _)| *i != 1).map(|(_, c)| c).collect::<Vec<_>>().join(",") + "\n")
        .collect();
    fs::write(folder.path().join("files/points2.csv"), bare).unwrap();
    let knee = folder.path().join("knee");
    build_model().arg("init").arg(&knee).arg("--from").arg(folder.path().join("files")).assert().success();
    assert_eq!(fs::read_to_string(knee.join("marks.csv")).unwrap().trim(), marks.trim());
}

/// A TOML text without some of its tables.
fn without(text: &str, tables: &[&str]) -> String {
    let mut left_out = false;
    let mut keep = |line: &&str| {
        if line.starts_with('[') {
            left_out = tables.contains(&line.trim());
        }
        !left_out
    };
    text.lines().filter(|l| keep(l)).map(|l| format!("{l}\n")).collect()
}

#[test]
fn an_empty_folder_is_written_to_fill_in() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("K7");
    build_model().arg("init").arg(&knee).assert().success().stdout(contains("specimen.toml"));
    let toml = fs::read_to_string(knee.join("specimen.toml")).unwrap();
    assert!(toml.contains("id = \"K7\"") && toml.contains("# [laxity_format.kla]"), "{toml}");
    // what is commented out is TOML that the program knows, and the laxity file reads
    let key = |l: &&str| l.starts_with('[') || l.split_once(" = ").is_some_and(|(k, _)| !k.contains(' '));
    let bare: String = toml.lines().map(|l| l.strip_prefix("# ").filter(key).unwrap_or(l).to_owned() + "\n").collect();
    // surfaces and scans, or a label map in place of them
    let with_scans = without(&bare, &["[segmentation]"]);
    let surfaces = |l: &&str| !l.starts_with("volume") && !l.starts_with("labels");
    let with_scans: String = with_scans.lines().filter(surfaces).map(|l| format!("{l}\n")).collect();
    for text in [with_scans, without(&bare, &["[ct]", "[scans]"])] {
        stages::ingest::parse_specimen_file(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    }
    sim::laxity::read(&fs::read(knee.join("laxity/example.csv")).unwrap()).unwrap();
    build_model()
        .arg("check")
        .arg(&knee)
        .assert()
        .code(1)
        .stdout(contains("FAULT").and(contains("ct/femur.stl is not there")));
}

#[test]
fn options_completions_manual_and_version() {
    build_model().args(["options", "hexmesh"]).assert().success().stdout(
        contains("hexmesh.edge_length_mm = 0.9 [mm]").and(contains("Wanted edge")).and(contains("stimpson2007")),
    );
    build_model().arg("options").assert().success().stdout(contains("contact-law.fit").and(contains("swarm-simplex")));
    for shell in ["bash", "zsh", "fish"] {
        build_model().args(["completions", shell]).assert().success().stdout(contains("import-abaqus"));
    }
    build_model().arg("man").assert().success().stdout(contains(".TH build-model"));
    let folder = TempDir::new().unwrap();
    build_model().arg("man").arg("--out").arg(folder.path()).assert().success();
    assert!(folder.path().join("build-model-check.1").exists());
    build_model().arg("--version").assert().success().stdout(contains("("));
}

/// The pages: links, commands, words. Left out where there is no python3.
#[test]
fn pages_hold() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = build_model().get_program().to_owned();
    for (script, argument) in [("links.py", Some(program)), ("words.py", None)] {
        let run = Command::new("python3").arg(root.join("docs/words").join(script)).args(argument).output();
        let Ok(run) = run else { return };
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&[run.stdout, run.stderr].concat()));
    }
    let site = fs::read_to_string(root.join("mkdocs.yml")).unwrap();
    assert!(site.contains(&format!("site_name: Genu {}\n", env!("CARGO_PKG_VERSION"))), "mkdocs.yml: another version");
}

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
    // its build came to no model
    build_model()
        .arg("open")
        .arg(&knee)
        .args(["--print", "--view"])
        .assert()
        .failure()
        .stderr(contains("no knee to pull at"));
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

/// Init of `files` in a folder `from`: what it says, and specimen.toml.
fn init(files: &[(&str, Vec<u8>)]) -> (String, String, TempDir) {
    let folder = TempDir::new().unwrap();
    let (from, knee) = (folder.path().join("from"), folder.path().join("knee"));
    for (name, bytes) in files {
        fs::create_dir_all(from.join(name).parent().unwrap()).unwrap();
        fs::write(from.join(name), bytes).unwrap();
    }
    let run = build_model().arg("init").arg(&knee).arg("--from").arg(&from).assert().success();
    let said = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
    (said, fs::read_to_string(knee.join("specimen.toml")).unwrap(), folder)
}

#[test]
fn files_of_every_kind_are_placed_or_told() {
    let made = phantom("S193761-phantom");
    let read = |name: &str| fs::read(made.path().join(name)).unwrap();
    let mesh = |name: &str| formats::read_surface(name, &read(name), &Default::default()).unwrap().mesh;
    let stl = |mesh: &meshes::surface::TriMesh| {
        let mut out = Vec::new();
        formats::stl::write(&mut out, mesh).unwrap();
        out
    };
    // a femur alone: by its name, and what is missing
    let (said, toml, _) = init(&[("my femur.stl", read("ct/femur.stl"))]);
    assert!(toml.contains("femur = \"ct/my femur.stl\"") && said.contains("by its name the femur"), "{said}");
    assert!(said.contains("Missing: the tibia with the fibula in CT") && said.contains("scans/femur.ply"), "{said}");
    assert!(said.contains("Missing: the side") && said.contains("--side"), "nothing shows it: {said}");
    let (said, _, _) = init(&[("bone.stl", read("ct/femur.stl"))]);
    assert!(said.contains("left out") && said.contains("give the other bone too"), "{said}");
    // bones in metres are written in mm; a tibia that is open where it was cut is a bone all the same
    let (mut femur, tibia) = (mesh("ct/femur.stl"), mesh("ct/tibfib.stl"));
    femur.vertices.iter_mut().for_each(|p| *p /= 1e3);
    let low = tibia.vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let (open, _) = tibia.submesh(|t| tibia.corners(t).iter().any(|p| p.z > low + 3.0));
    let scans = [("c.ply", read("scans/femur.ply")), ("d.ply", read("scans/tibfib.ply"))];
    let (said, toml, folder) = init(&[[("a.stl", stl(&femur)), ("b.stl", stl(&open))].as_slice(), &scans].concat());
    assert!(toml.contains("femur = \"ct/a.mm.ply\"") && said.contains("was in metres"), "{said}");
    assert!(said.contains("a.stl -> ct/a.mm.ply"), "a file is called as it was given: {said}");
    assert!(toml.contains("tibfib = \"ct/b.stl\"") && toml.contains("tibfib = \"scans/d.ply\""), "{said}");
    build_model().arg("check").arg(folder.path().join("knee")).assert().success();
    // VTK, points of 3D Slicer, a DICOM series, and what is none of these
    let vtk = |mesh: &meshes::surface::TriMesh| {
        let mut out = format!(
            "# vtk DataFile Version 3.0\nbone\nASCII\nDATASET POLYDATA\nPOINTS {} double\n",
            mesh.vertices.len()
        );
        out.extend(mesh.vertices.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)));
        out += &format!("POLYGONS {0} {1}\n", mesh.triangles.len(), 4 * mesh.triangles.len());
        out.extend(mesh.triangles.iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n")));
        out.into_bytes()
    };
    let fcsv = b"# Markups fiducial file version = 5.0\n# CoordinateSystem = LPS\n# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n1,1,2,300,0,0,0,1,1,1,0,femoral_head_center,,\n";
    let mut slice = vec![0; 128];
    slice.extend(b"DICM");
    let files = [
        ("a.vtk", vtk(&mesh("ct/femur.stl"))),
        ("b.vtk", vtk(&tibia)),
        ("F.fcsv", fcsv.to_vec()),
        ("series/IM1", slice.clone()),
        ("notes.docx", b"PK\x03\x04".to_vec()),
    ];
    let (said, toml, folder) = init(&[files.as_slice(), &scans].concat());
    assert!(toml.contains("femur = \"ct/a.vtk\"") && toml.contains("landmarks = \"landmarks.fcsv\""), "{said}");
    assert!(said.contains("1 DICOM files") && said.contains("so it is not needed"), "{said}");
    assert!(said.contains("notes.docx left out: the file is a zip archive"), "{said}");
    build_model().arg("check").arg(folder.path().join("knee")).assert().success();
    let (said, toml, folder) = init(&[("series/IM1", slice.clone()), ("series/IM2", slice)]);
    assert!(
        toml.contains("volume = \"ct/dicom\"") && said.contains("-> ct/dicom: a DICOM series of 2 files"),
        "{said}"
    );
    assert!(!said.contains("IM1") && !said.contains("IM2"), "a series is told by its folder: {said}");
    assert!(folder.path().join("knee/ct/dicom/IM2").exists());
}

#[test]
fn a_side_is_told_from_the_bones_or_given() {
    let made = phantom("S193761-phantom");
    let folder = TempDir::new().unwrap();
    let run = |name: &str, from: &[&str], side: &[&str]| {
        let knee = folder.path().join(name);
        let files = from.iter().map(|f| made.path().join(f));
        let run = build_model().arg("init").arg(&knee).args(side).arg("--from").args(files).assert().success();
        let said = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
        (said, fs::read_to_string(knee.join("specimen.toml")).unwrap())
    };
    let bones = ["ct/femur.stl", "ct/tibfib.stl"];
    let (said, toml) = run("told", &bones, &[]);
    let shown = if toml.contains("side = \"left\"") { "left" } else { "right" };
    assert!(said.contains(&format!("side = \"{shown}\": the fibula lies there")), "{said}");
    let other = if shown == "left" { "right" } else { "left" };
    let (said, toml) = run("against", &bones, &["--side", other]);
    assert!(said.contains(&format!("the files show a {shown} knee")), "{said}");
    assert!(toml.contains(&format!("side = \"{other}\"")), "{toml}");
    let (said, toml) = run("given", &bones[..1], &["--side", "right"]);
    assert!(!said.contains("Missing: the side") && said.contains("as given"), "{said}");
    assert!(toml.contains("side = \"right\""), "{toml}");
}

#[needs_shared]
fn surfaces_beside_a_label_map_are_not_taken_for_bones() {
    let Some(mri) = shared("surfaces_beside_a_label_map_are_not_taken_for_bones", "mri/kneeB") else { return };
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    let run = build_model().arg("init").arg(&knee).arg("--from").arg(&mri).assert().success();
    let said = String::from_utf8_lossy(&run.get_output().stdout).into_owned();
    assert_eq!(said.matches("the label map shows this knee, so it is not needed").count(), 5, "{said}");
    let toml: toml::Table = fs::read_to_string(knee.join("specimen.toml")).unwrap().parse().unwrap();
    assert!(toml.contains_key("segmentation") && !toml.contains_key("ct"), "{toml}");
    build_model().arg("check").arg(&knee).assert().success();
}

#[test]
fn options_completions_manual_and_version() {
    build_model()
        .args(["options", "hexmesh"])
        .assert()
        .success()
        .stdout(contains("hexmesh.edge_length_mm = 0.9 [mm]").and(contains("Wanted edge")));
    build_model().args(["options", "hexmesh", "--all"]).assert().success().stdout(contains("stimpson2007"));
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

/// A page that names what is not there is found out, one that names what is there is not. Left out where there is no python3.
#[test]
fn what_a_page_names_must_be_there() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/words/links.py");
    let folder = TempDir::new().unwrap();
    let page = folder.path().join("page.md");
    let told = |text: &str| {
        fs::write(&page, text).unwrap();
        let run = Command::new("python3").arg(&script).arg(&page).output().ok()?;
        Some((run.status.success(), String::from_utf8_lossy(&[run.stdout, run.stderr].concat()).into_owned()))
    };
    for (wrong, words) in [
        ("`cargo test -p sim`", "nothing is called sim"),
        ("`-p sim`", "nothing is called sim"),
        ("```sh\ncargo run --release --example nothing -- --test x\n```", "nothing is called nothing"),
        ("`cargo bench --bench nothing`", "nothing is called nothing"),
        ("`sim/tests/published_deck.rs`", "no file sim/tests/published_deck.rs"),
        ("`tests/fields.rs`", "no file tests/fields.rs"),
        ("`score_solver.py`", "no file score_solver.py"),
    ] {
        let Some((good, said)) = told(wrong) else { return };
        assert!(!good && said.contains(words), "{wrong}: {said}");
    }
    let right = "`cargo test --release -p genu-sim --test main`, `cargo bench --bench solver`, `-p genu`, `diagnosis/tests/fields.rs`, \
                 `stages/src/`, `links.py`, `laxity/kla.csv`, `cargo run --release --example paper`";
    let Some((good, said)) = told(right) else { return };
    assert!(good, "{said}");
}

/// The pages: links, commands, words. Left out where there is no python3.
#[test]
fn pages_hold() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = env!("CARGO_BIN_EXE_build-model");
    for (script, argument) in [("links.py", Some(program)), ("words.py", None)] {
        let run = Command::new("python3").arg(root.join("docs/words").join(script)).args(argument).output();
        let Ok(run) = run else { return };
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&[run.stdout, run.stderr].concat()));
    }
    let site = fs::read_to_string(root.join("mkdocs.yml")).unwrap();
    assert!(site.contains(&format!("site_name: Genu {}\n", env!("CARGO_PKG_VERSION"))), "mkdocs.yml: another version");
    let cited = fs::read_to_string(root.join("CITATION.cff")).unwrap();
    assert!(cited.contains(&format!("\nversion: {}\n", env!("CARGO_PKG_VERSION"))), "CITATION.cff: another version");
}

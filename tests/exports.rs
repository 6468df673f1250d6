//! Exports, opened again by programs that are not ours.
#![allow(clippy::unwrap_used, clippy::print_stderr, clippy::print_stdout, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at files and run other programs")]

use crate::common::{build_model, built, copy, json, reads, write};
use sim::coordinate::Load;
use sim::mesh::MeshValue;
use sim::trials::{TrialOptions, solve};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// A phantom's model with its ligaments tightened and its contact without friction, so that it stands in equilibrium without a calibration.
fn model() -> &'static Path {
    static MODEL: OnceLock<TempDir> = OnceLock::new();
    let folder = MODEL.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        // the stages' folders: what the model is made of, and no page that another test writes again
        for stage in std::fs::read_dir(built().join("build")).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir())
        {
            copy(&stage, &folder.path().join("build").join(stage.file_name().unwrap()));
        }
        let path = folder.path().join("build/09-assemble/model.json");
        let mut model = json(&path);
        model["contact"]["friction"] = 0.0.into();
        for bundle in model["bundles"].as_array_mut().unwrap() {
            bundle["reference_strain"] = 1.05.into();
        }
        write(&path, serde_json::to_vec(&model).unwrap());
        folder
    });
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| folder.path().join("build/09-assemble/model.json"))
}

fn exported(format: &str, more: &[&str]) -> TempDir {
    let out = TempDir::new().unwrap();
    build_model()
        .arg("export")
        .arg(model())
        .args(["--format", format])
        .args(more)
        .arg("--out")
        .arg(out.path())
        .assert()
        .success();
    out
}

/// Passive flexion of the model to an angle [deg], in a file of the folder.
fn flexed_to(degrees: &str, folder: &Path) -> PathBuf {
    let path = folder.join("flexion.csv");
    let mut run = build_model();
    run.arg("simulate")
        .arg(model())
        .args(["--protocol", "passive-flexion", "--to-flexion", degrees, "--out"])
        .arg(&path);
    run.assert().success();
    path
}

/// Poses under drawers and moments that press the joint together. A knee that nothing pulls has no one place of rest to compare (docs/export.md).
fn loaded(folder: &Path) -> PathBuf {
    let mut trials = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,\
        fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n"
        .to_string();
    for flexion in [20, 40, 60, 90] {
        for (test, anterior, external, pressed) in
            [("anterior", 60, 0, 50), ("posterior", -60, 0, 50), ("internal", 0, -3, 50), ("external", 0, 3, 50)]
        {
            trials +=
                &format!("{test}_{flexion},{test},{flexion},0,{external},0,{anterior},{pressed},{flexion},,,,,\n");
        }
    }
    let [asked, found] = ["trials.csv", "results.csv"].map(|name| folder.join(name));
    write(&asked, trials);
    let mut run = build_model();
    run.arg("simulate").arg(model()).arg("--trials").arg(&asked).arg("--out").arg(&found);
    run.assert().success();
    found
}

#[test]
fn surfaces_are_read_by_trimesh() {
    for format in ["stl", "ply", "glb"] {
        let out = exported(format, &[]);
        reads("surfaces_are_read_by_trimesh", "formats.py", &[format, &out.path().display().to_string()]);
    }
}

#[test]
fn a_time_series_is_read_by_meshio() {
    let folder = TempDir::new().unwrap();
    let out = exported("vtk", &["--poses", &flexed_to("90", folder.path()).display().to_string()]);
    // the series, and the three files that lie beside every export
    assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 20 + 3);
    reads("a_time_series_is_read_by_meshio", "formats.py", &["vtk", &out.path().display().to_string()]);
}

#[test]
fn a_febio_file_is_well_formed_and_every_name_in_it_defined() {
    let folder = TempDir::new().unwrap();
    let table = loaded(folder.path()).with_file_name("trials.csv");
    let out = exported("febio", &["--poses", &table.display().to_string()]);
    reads("a_febio_file", "formats.py", &["febio", &out.path().display().to_string()]);
}

#[test]
fn an_abaqus_deck_is_read_by_meshio() {
    let out = exported("abaqus", &[]);
    let spec = model().display().to_string();
    reads("an_abaqus_deck_is_read_by_meshio", "formats.py", &["abaqus", &out.path().display().to_string(), &spec]);
}

#[test]
fn an_abaqus_deck_has_the_hexahedra_of_stage_8_and_comes_back_with_the_same_forces() {
    let out = exported("abaqus", &[]);
    let text = |name: &str| std::fs::read_to_string(out.path().join(name)).unwrap();
    let (mut own, mut of_kind) = (false, 0);
    for line in text("geometry.inp").lines() {
        match line.strip_prefix("*ELEMENT") {
            Some(head) => own = head.contains("TYPE=C3D8R"),
            None if line.starts_with('*') => own = false,
            None => of_kind += usize::from(own),
        }
    }
    let metrics = json(&model().parent().unwrap().join("../08-overclosure/metrics.json"));
    let parts = ["femur", "tibia_medial", "tibia_lateral"].map(|part| metrics[part]["elements"].as_u64().unwrap());
    assert_eq!(of_kind as u64, parts.iter().sum::<u64>(), "{metrics}");
    // the paper's names of the element sets
    for set in ["CART-FEMUR", "CART-TIBIA-MED", "CART-TIBIA-LAT", "BONE-FEMUR", "BONE-TIBIA"] {
        assert!(text("geometry.inp").contains(&format!("ELSET={set}\n")), "{set}");
    }
    let back = TempDir::new().unwrap();
    let main = std::fs::read_dir(out.path()).unwrap().map(|e| e.unwrap().path());
    let main = main.into_iter().find(|p| p.display().to_string().ends_with("_settle_flex.inp")).unwrap();
    build_model().arg("import-abaqus").arg(main).arg("--out").arg(back.path()).assert().success();
    let folder = TempDir::new().unwrap();
    let trials = loaded(folder.path()).with_file_name("trials.csv");
    let [ours, theirs] = [model().to_path_buf(), back.path().join("model.json")].map(|m| {
        let results = folder.path().join("results.csv");
        build_model().arg("simulate").arg(m).arg("--trials").arg(&trials).arg("--out").arg(&results).assert().success();
        numbers(&results)
    });
    assert!(ours.len() > 100 && ours.len() == theirs.len(), "{} {}", ours.len(), theirs.len());
    let apart = ours.iter().zip(&theirs).map(|((_, a), (_, b))| (a - b).abs() / (1.0 + a.abs())).fold(0.0, f64::max);
    println!("import-abaqus of the exported deck: results within {apart:.1e}");
    assert!(apart < 1e-6, "{apart}");
}

#[test]
fn every_row_of_a_laxity_file_becomes_a_main_file_of_the_deck() {
    let folder = TempDir::new().unwrap();
    let results = loaded(folder.path());
    // what simulate was asked, and what it answered: both say which loads and flexions
    for table in [results.with_file_name("trials.csv"), results] {
        let out = exported("abaqus", &["--poses", &table.display().to_string()]);
        let names: Vec<String> =
            std::fs::read_dir(out.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        let rows = std::fs::read_to_string(&table).unwrap().lines().count() - 1;
        assert_eq!((rows, names.iter().filter(|n| n.contains("_trial_")).count()), (16, 16), "{names:?}");
        for (flexion, ap) in [(20.0, 60.0), (90.0, -60.0)] {
            let ending = format!("_trial_{}_{flexion}.inp", if ap > 0.0 { "anterior" } else { "posterior" });
            let main = names.iter().find(|n| n.ends_with(&ending)).unwrap();
            let read = |name: &str| std::fs::read(out.path().join(name)).map_err(|e| e.to_string());
            let back = decks::import(main, &mut |name: &str| read(name)).unwrap().spec;
            let joint = sim::joint::Joint::new(&back.frames, back.side).unwrap();
            let program = sim::explicit::deck_program(&joint, back.frames.chain.as_ref(), &back.protocols[0]);
            let step = program.steps.last().unwrap();
            let at_end = |c: sim::coordinate::Coordinate| match &step.drive[c.index()] {
                sim::explicit::Drive::Load(course) | sim::explicit::Drive::Motion(course) => course.at(step.duration_s),
            };
            assert!((at_end(sim::coordinate::AP) - ap).abs() < 1e-9 * ap.abs(), "{main}");
            let turned = flexion - joint.ct_pose()[sim::coordinate::FE].to_degrees();
            assert!((at_end(sim::coordinate::FE).to_degrees() - turned).abs() < 1e-6, "{main}");
        }
    }
}

/// The rows of steps.csv, cells by column.
fn steps_of(folder: &Path) -> Vec<BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(folder.join("steps.csv")).unwrap();
    let header: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let cells = |r: csv::StringRecord| header.iter().cloned().zip(r.iter().map(str::to_owned)).collect();
    reader.records().map(|r| cells(r.unwrap())).collect()
}

/// The programs whose files know flexions and loads, and the endings of their files.
const LOADED_FORMATS: [(&str, &str); 3] = [("abaqus", ".inp"), ("febio", ".feb"), ("opensim", ".osim")];

#[test]
fn every_format_has_the_same_steps_and_lists_the_row_that_each_is_of() {
    let folder = TempDir::new().unwrap();
    let table = loaded(folder.path());
    let (path, asked) = (table.display().to_string(), std::fs::read_to_string(&table).unwrap());
    let names: Vec<&str> = asked.lines().map(|line| line.split(',').next().unwrap()).collect();
    let mut known: Option<Vec<BTreeMap<String, String>>> = None;
    for (format, ending) in LOADED_FORMATS {
        let out = exported(format, &["--poses", &path]);
        let mut rows = steps_of(out.path());
        for row in &mut rows {
            let file = row["file"].clone();
            assert!(out.path().join(&file).is_file(), "{format}: {file}");
            // the row of the table, its header being row 1
            let named = row["row"].parse::<usize>().ok().map_or("", |n| names[n - 1]);
            assert_eq!(
                (named, row["table"].is_empty()),
                (row["trial"].as_str(), named.is_empty()),
                "{format}: {row:?}"
            );
            // the same names, behind that of the knee's own file where it has one
            let own = file.strip_suffix(ending).unwrap();
            let own = if format == "abaqus" { own } else { own.strip_prefix("model_").unwrap() };
            row.insert("file".into(), own.to_owned());
        }
        // a row for each trial; the protocols have none, and the header is none
        let of: std::collections::BTreeSet<&String> = rows.iter().map(|r| &r["row"]).collect();
        assert_eq!(of.len(), names.len(), "{format}");
        assert_eq!(*known.get_or_insert_with(|| rows.clone()), rows, "{format}");
    }
}

#[test]
fn protocols_and_trials_in_opensim_hold_what_was_asked_and_end_where_ours_do() {
    let folder = TempDir::new().unwrap();
    let results = loaded(folder.path());
    let text = std::fs::read_to_string(&results).unwrap();
    let wanted = |line: &&str| ["trial,", "anterior_60,", "external_40,"].iter().any(|name| line.starts_with(*name));
    let few = folder.path().join("few.csv");
    write(&few, text.lines().filter(wanted).map(|line| format!("{line}\n")).collect::<String>());
    let few = few.display().to_string();
    let out = exported("opensim", &["--poses", &few]);
    let [osim, spec] = [out.path(), model()].map(|p| p.display().to_string());
    reads("protocols_and_trials_in_opensim", "opensim_steps.py", &[&osim, &spec, &few]);
}

/// Bundles and a knee with names that mean something to XML, to OpenSim's paths or to Abaqus.
fn oddly_named() -> PathBuf {
    let path = model().with_file_name("oddly_named.json");
    let mut spec = json(model());
    spec["id"] = "K & \"1\" <left>".into();
    let names: Vec<serde_json::Value> = spec["bundles"].as_array().unwrap().iter().map(|b| b["name"].clone()).collect();
    // the last four: collateral and cruciate ligaments show an importer the side
    for (odd, k) in ["A & B", "<C>", "D/E \"f\"", "a*b"].into_iter().zip(names.len() - 4..) {
        spec["bundles"][k]["name"] = odd.into();
        for fibre in spec["fibres"].as_array_mut().unwrap() {
            if fibre["bundle"] == names[k] {
                fibre["bundle"] = odd.into();
            }
        }
    }
    write(&path, serde_json::to_vec(&spec).unwrap());
    path
}

#[test]
fn names_of_any_kind_come_back_from_every_format() {
    let count = |path: &Path| ["bundles", "fibres"].map(|key| json(path)[key].as_array().unwrap().len());
    let model = oddly_named();
    let [plain, jam]: [&[&str]; 2] = [&[], &["--contact", "jam"]];
    let formats = [
        ("febio", plain, "import-febio", "model.feb"),
        ("opensim", jam, "import-opensim", "model.osim"),
        ("abaqus", plain, "import-abaqus", "_settle_flex.inp"),
    ];
    for (format, more, import, ending) in formats {
        let [out, back] = [TempDir::new().unwrap(), TempDir::new().unwrap()];
        let mut run = build_model();
        run.arg("export").arg(&model).args(["--format", format, "--out"]).arg(out.path()).args(more).assert().success();
        let files = std::fs::read_dir(out.path()).unwrap().map(|e| e.unwrap().path());
        let main = files.into_iter().find(|p| p.display().to_string().ends_with(ending)).unwrap();
        build_model().arg(import).arg(main).arg("--out").arg(back.path()).assert().success();
        assert_eq!(count(&back.path().join("model.json")), count(&model), "{format}");
        if format == "febio" {
            assert_eq!(json(&back.path().join("model.json"))["id"], json(&model)["id"]);
        }
    }
}

/// Forces of one model at one pose, read from two places, agree to within this share [-]: numbers are written so that they come back.
const SAME_SHARE: f64 = 1e-9;

/// The calibrated knee's friction, which the other tests of this file leave out: searches along a path of friction end where the path led them.
const FRICTION: f64 = 0.03;

#[test]
fn a_deck_that_is_read_back_is_the_same_model_at_every_pose() {
    let ours = genu::model_file::load(model()).unwrap();
    let out = exported("abaqus", &[]);
    let main = std::fs::read_dir(out.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let main = main.into_iter().find(|name| name.ends_with("_settle_flex.inp")).unwrap();
    let read = |name: &str| std::fs::read(out.path().join(name)).map_err(|e| e.to_string());
    let theirs = decks::import(&main, &mut |name: &str| read(name)).unwrap();
    // the surfaces that bear: the same vertices in the same order
    let surface = |of: &BTreeMap<String, MeshValue>, name: &str| match &of[name] {
        MeshValue::Surface(mesh) => mesh.clone(),
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(ours.spec.contact.pairs.len(), theirs.spec.contact.pairs.len());
    for (a, b) in ours.spec.contact.pairs.iter().zip(&theirs.spec.contact.pairs) {
        for (x, y) in [(&a.femur, &b.femur), (&a.tibia, &b.tibia)] {
            let (x, y) = (surface(&ours.meshes, x), surface(&theirs.meshes, y));
            assert!(x.vertices.len() > 100 && x.triangles == y.triangles);
            let far = x.vertices.iter().zip(&y.vertices).map(|(p, q)| (p - q).norm() / (1.0 + p.coords.norm()));
            assert!(far.fold(0.0, f64::max) < 1e-12);
        }
    }
    let compiled = |spec, meshes| sim::compile(spec, meshes).unwrap().with_friction(FRICTION).unwrap();
    let (ours, theirs) = (compiled(&ours.spec, &ours.meshes), compiled(&theirs.spec, &theirs.meshes));
    let (mut pulled, mut pressed) = (0, 0);
    for (flexion, ap, ie) in [(20.0, 60.0, 0.0), (40.0, -60.0, 0.0), (60.0, 0.0, -3.0), (90.0, 0.0, 3.0)] {
        let load = Load::new(0.0, ie, 0.0, ap, 50.0);
        let q = solve(&ours, flexion, &load, &TrialOptions::default()).unwrap().state.q;
        let [a, b] = [&ours, &theirs].map(|model| model.evaluate(&q));
        let [x, y] = [(&ours, &a), (&theirs, &b)].map(|(model, e)| model.bundle_forces(&e.fibres));
        for (f, g) in x.iter().zip(&y) {
            assert!((f - g).abs() <= SAME_SHARE * f.max(1.0), "{flexion} deg: {f} {g}");
            pulled += usize::from(*f > 1.0);
        }
        for (f, g) in a.contact.wrench.iter().zip(&b.contact.wrench) {
            let apart = (f.0 - g.0).norm() / f.0.norm().max(1.0);
            assert!(apart <= SAME_SHARE, "{flexion} deg: {:?} {:?}", f.0, g.0);
            pressed += usize::from(f.0.norm() > 1.0);
        }
    }
    assert!(pulled >= 8 && pressed >= 4, "{pulled} {pressed}");
}

/// Every pose and force of a table of results, by column.
fn numbers(table: &Path) -> Vec<(String, f64)> {
    let text = std::fs::read_to_string(table).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let wanted =
        |name: &str| name.starts_with("force_") || ["vv_deg", "ie_deg", "ml_mm", "ap_mm", "si_mm"].contains(&name);
    let row = |line: &str| {
        let cells = header.iter().zip(line.split(',')).filter(|(name, _)| wanted(name));
        cells.filter_map(|(name, x)| Some(((*name).to_owned(), x.parse().ok()?))).collect::<Vec<_>>()
    };
    lines.flat_map(row).collect()
}

#[test]
fn what_is_in_the_way_of_an_export_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("deck");
    write(&file, "something else");
    for out in [file.clone(), file.join("deeper")] {
        let mut run = build_model();
        run.arg("export").arg(model()).args(["--format", "stl", "--out"]).arg(out);
        run.assert().code(1).stderr(predicates::str::contains(format!("{} is a file", file.display())));
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "something else");
}

#[test]
fn what_was_changed_in_an_export_is_written_over_by_force_alone() {
    let out = exported("stl", &[]);
    let edited = out.path().join("femur_bone.stl");
    let run = |more: &[&str]| {
        let mut run = build_model();
        run.arg("export").arg(model()).args(["--format", "stl", "--out"]).arg(out.path()).args(more).assert()
    };
    let before = std::fs::read(&edited).unwrap();
    run(&[]).success();
    write(&edited, "by hand");
    run(&[]).code(1).stderr(predicates::str::contains("femur_bone.stl is not as the last export here left it"));
    assert_eq!(std::fs::read(&edited).unwrap(), b"by hand");
    run(&["--force"]).success();
    assert_eq!(std::fs::read(&edited).unwrap(), before);
}

#[test]
fn trials_of_an_earlier_export_do_not_stay_beside_a_later_one() {
    let folder = TempDir::new().unwrap();
    let table = folder.path().join("trials.csv");
    // loads and one column of flexion are enough, as for simulate
    let rows = "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n\n\
        a,anterior,30,0,0,0,60,50\nb,posterior,60,0,0,0,-60,50\n";
    write(&table, rows);
    let out = exported("febio", &["--poses", &table.display().to_string()]);
    let file_of = |trial: &str| {
        let steps = steps_of(out.path());
        steps.into_iter().find(|row| row["trial"] == trial).map(|row| row["file"].clone()).unwrap()
    };
    let [untouched, edited] = ["a", "b"].map(file_of);
    write(&out.path().join(&edited), "by hand");
    let mut run = build_model();
    run.arg("export").arg(model()).args(["--format", "febio", "--out"]).arg(out.path());
    run.assert().success().stdout(predicates::str::contains(&untouched)).stderr(predicates::str::contains(&edited));
    assert!(!out.path().join(&untouched).exists() && out.path().join("model.feb").exists());
    assert_eq!(std::fs::read_to_string(out.path().join(&edited)).unwrap(), "by hand");
    let kept = json(&out.path().join("model.source.json"));
    assert!(kept["files"].get(&untouched).is_none() && kept["files"].get("model.feb").is_some());
}

#[test]
fn opensim_finds_the_same_equilibrium() {
    let out = exported("opensim", &[]);
    let folder = out.path().display().to_string();
    if !reads("opensim_finds_the_same_equilibrium", "formats.py", &["opensim", &folder]) {
        return;
    }
    let folder_of_poses = TempDir::new().unwrap();
    let poses = loaded(folder_of_poses.path()).display().to_string();
    let spec = model().display().to_string();
    reads("opensim_finds_the_same_equilibrium", "opensim_statics.py", &[&folder, &spec, &poses, "8"]);
}

/// The model with contact by one line, as OpenSim and JAM have it.
fn with_straight_contact(folder: &Path) -> PathBuf {
    copy(model().parent().unwrap().parent().unwrap(), &folder.join("build"));
    let path = folder.join("build/09-assemble/model.json");
    let mut model = json(&path);
    let ends = |key: &str| -> Vec<f64> {
        model["contact"][key].as_array().unwrap().iter().rev().take(2).map(|x| x.as_f64().unwrap()).collect()
    };
    let (d, p) = (ends("overclosure_mm"), ends("pressure_mpa"));
    let slope = (p[0] - p[1]) / (d[0] - d[1]);
    model["contact"]["overclosure_mm"] = vec![0.0, 1.0].into();
    model["contact"]["pressure_mpa"] = vec![0.0, slope].into();
    write(&path, serde_json::to_vec(&model).unwrap());
    path
}

/// Pulls of the quadriceps at flexions where the patella lies in its groove [N].
const PULLED: [(u32, u32); 3] = [(20, 50), (30, 100), (60, 200)];

#[test]
fn opensim_finds_the_patella_where_it_rests_and_its_tendon_as_tight() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    copy(built(), &knee);
    let mut build = build_model();
    build.arg("build").arg(&knee).args(["--to", "assemble", "--quiet", "--set", "assemble.patella=generic"]);
    build.assert().success();
    let model = knee.join("build/09-assemble/model.json");
    let mut trials =
        "trial,test,nominal_flexion_deg,load_vv_nm,load_ie_nm,load_ml_n,load_ap_n,load_si_n,load_quadriceps_n,\
        fe_deg,vv_deg,ie_deg,ml_mm,ap_mm,si_mm\n"
            .to_string();
    for (flexion, tension) in PULLED {
        trials += &format!("pulled_{flexion},neutral,{flexion},0,0,0,0,100,{tension},{flexion},,,,,\n");
    }
    let [asked, found] = ["trials.csv", "results.csv"].map(|name| folder.path().join(name));
    write(&asked, trials);
    build_model().arg("simulate").arg(&model).arg("--trials").arg(&asked).arg("--out").arg(&found).assert().success();
    for contact in ["elastic", "jam"] {
        let out = folder.path().join(contact);
        let mut run = build_model();
        run.arg("export").arg(&model).args(["--format", "opensim", "--contact", contact, "--out"]).arg(&out);
        run.assert().success().stderr(predicates::str::contains("the patella is a body there"));
        let osim = std::fs::read_to_string(out.join("model.osim")).unwrap();
        for part in ["<Body name=\"patella\">", "<FreeJoint name=\"patellofemoral\">", "name=\"patella_on_trochlea\""] {
            assert_eq!(osim.matches(part).count(), 1, "{contact}: {part}");
        }
    }
    // JAM's contact is not OpenSim's own
    let [elastic, model, found] = [&folder.path().join("elastic"), &model, &found].map(|p| p.display().to_string());
    reads("opensim_finds_the_patella", "opensim_patella.py", &[&elastic, &model, &found]);
    // an importer finds the knee alone, and tells of the rest
    let back = folder.path().join("back");
    let jam = folder.path().join("jam/model.osim");
    build_model().arg("import-opensim").arg(jam).arg("--out").arg(&back).assert().success();
    let count = |path: &Path| ["bundles", "fibres"].map(|key| json(path)[key].as_array().unwrap().len());
    assert_eq!(count(&back.join("model.json")), count(Path::new(&model)));
}

/// Both models answer the same loaded trials alike, within so many mm, deg or N and that share.
fn answer_alike(folder: &Path, models: [&Path; 2], within: f64) {
    let trials = loaded(folder).with_file_name("trials.csv");
    let [a, b] = [0, 1].map(|k| {
        let results = folder.join(["ours.csv", "theirs.csv"][k]);
        let mut run = build_model();
        run.arg("simulate").arg(models[k]).arg("--trials").arg(&trials).arg("--out").arg(&results);
        run.assert().success();
        numbers(&results)
    });
    assert!(a.len() > 100 && a.len() == b.len(), "{} {}", a.len(), b.len());
    let off = |((_, x), (_, y)): (&(String, f64), &(String, f64))| (x - y).abs() / (1.0 + x.abs());
    println!("models apart by at most {:e}", a.iter().zip(&b).map(off).fold(0.0, f64::max));
    for ((name, x), (_, y)) in a.iter().zip(&b) {
        assert!((x - y).abs() <= within * (1.0 + x.abs()), "{name}: {x} {y}");
    }
}

#[test]
fn a_knee_written_for_febio_comes_back_and_answers_as_it_did() {
    let folder = TempDir::new().unwrap();
    let ours = with_straight_contact(folder.path());
    // with friction a pose remembers its way there: digits that a file has not are seen
    for (friction, within) in [(0.0, 1e-4), (0.03, 1e-2)] {
        let mut model = json(&ours);
        model["contact"]["friction"] = friction.into();
        write(&ours, serde_json::to_vec(&model).unwrap());
        let [feb, back] = ["feb", "back"].map(|name| folder.path().join(format!("{name}{friction}")));
        build_model().arg("export").arg(&ours).args(["--format", "febio", "--out"]).arg(&feb).assert().success();
        build_model().arg("import-febio").arg(feb.join("model.feb")).arg("--out").arg(&back).assert().success();
        let theirs = back.join("model.json");
        let names = |path: &Path| -> Vec<String> {
            let bundles = json(path)["bundles"].as_array().unwrap().clone();
            bundles.iter().map(|b| b["name"].as_str().unwrap().to_owned()).collect()
        };
        assert_eq!(names(&ours), names(&theirs));
        answer_alike(folder.path(), [&ours, &theirs], within);
    }
}

#[test]
fn a_febio_protocol_that_is_imported_names_the_file_that_has_the_knee() {
    let out = exported("febio", &[]);
    let files = std::fs::read_dir(out.path()).unwrap().map(|f| f.unwrap().path());
    let protocols: Vec<_> = files
        .filter(|f| f.extension().is_some_and(|e| e == "feb") && f.file_name().is_some_and(|n| n != "model.feb"))
        .collect();
    assert!(protocols.len() > 1, "{protocols:?}");
    for protocol in protocols {
        let back = out.path().join("back");
        let run = build_model().arg("import-febio").arg(&protocol).arg("--out").arg(&back).assert();
        run.code(1).stderr(predicates::str::contains("import model.feb in place of this one"));
        assert!(!back.exists());
    }
}

#[test]
fn a_file_that_is_no_febio_knee_is_told_and_writes_nothing() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("m");
    for (text, wanted) in
        [("solid", "expected a FEBio file (.feb)"), ("<febio_spec version=\"4.0\"/>", "no sliding contact is between")]
    {
        let bad = folder.path().join("bad.feb");
        write(&bad, text);
        let run = build_model().arg("import-febio").arg(&bad).arg("--out").arg(&out).assert();
        run.code(1).stderr(predicates::str::contains(wanted));
        assert!(!out.exists());
    }
}

#[test]
fn a_knee_written_for_jam_comes_back_and_opensim_answers_as_it_does() {
    let folder = TempDir::new().unwrap();
    let [jam, plain, back] = ["jam", "osim", "back"].map(|name| folder.path().join(name));
    let ours = with_straight_contact(folder.path());
    for (out, contact) in [(&jam, "jam"), (&plain, "elastic")] {
        let mut run = build_model();
        run.arg("export").arg(&ours).args(["--format", "opensim", "--contact", contact, "--out"]).arg(out);
        run.assert().success();
    }
    build_model().arg("import-opensim").arg(jam.join("model.osim")).arg("--out").arg(&back).assert().success();
    let theirs = back.join("model.json");
    answer_alike(folder.path(), [&ours, &theirs], 1e-4);
    // OpenSim 4.6 has no contact of JAM's: the same knee with its own contact, against what the model read back answers
    let [osim, spec, results] = [&plain, &theirs, &folder.path().join("theirs.csv")].map(|p| p.display().to_string());
    reads("a_knee_written_for_jam_comes_back", "opensim_statics.py", &[&osim, &spec, &results, "8"]);
}

#[test]
fn contact_goes_with_opensim_alone_and_a_file_that_is_none_is_told() {
    let folder = TempDir::new().unwrap();
    let mut run = build_model();
    run.arg("export").arg(model()).args(["--format", "stl", "--contact", "jam", "--out"]).arg(folder.path());
    run.assert().code(2).stderr(predicates::str::contains("--contact goes with --format opensim"));
    let bad = folder.path().join("bad.osim");
    write(&bad, "solid");
    let mut run = build_model();
    run.arg("import-opensim").arg(&bad).arg("--out").arg(folder.path().join("m"));
    run.assert().code(1).stderr(predicates::str::contains("expected an OpenSim model"));
}

#[test]
fn poses_go_with_some_formats_and_bad_ones_are_told() {
    let folder = TempDir::new().unwrap();
    let bad = folder.path().join("bad.csv");
    write(&bad, "fe_deg,vv_deg\n1,2\n");
    let run = |format: &str| {
        let mut run = build_model();
        run.arg("export").arg(model()).args(["--format", format, "--poses"]).arg(&bad).arg("--out").arg(folder.path());
        run
    };
    run("vtk").assert().code(1).stderr(predicates::str::contains("no column ie_deg"));
    for format in ["stl", "ply", "glb"] {
        run(format).assert().code(2).stderr(predicates::str::contains("--poses goes with --format"));
    }
}

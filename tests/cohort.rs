//! `cohort`: the figures of a knee that users of other programs look for in its tables.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

use crate::common::{build_model, copy, json, read, text, write};
use crate::one_knee;
use crate::schema::obeys;
use assert_cmd::Command;
use calibration::evidence::Evidence;
use calibration::options::CalibrateOptions;
use calibration::samples::Samples;
use calibration::shared::{SCHEMA, Shared, SharedNumber, SharedPrior};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Rows of quantities.csv without the knee's name: stage, quantity, part, value, unit.
fn quantities(build: &Path, out: &Path) -> Vec<Vec<String>> {
    build_model().arg("cohort").arg(build).arg("--out").arg(out).assert().success();
    let table = text(&out.join("quantities.csv"));
    table.lines().skip(1).map(|l| l.split(',').skip(1).map(str::to_owned).collect()).collect()
}

/// Area of the bony face of a mesh as its file has it [mm2]: the feet of elements that stand on no other.
fn bony_area(file: &Path) -> f64 {
    let mesh = formats::vtk::read_solids(&read(file)).unwrap();
    let heads: BTreeSet<[u32; 4]> = mesh.hexahedra.iter().map(|e| [e[4], e[5], e[6], e[7]]).collect();
    let feet = mesh.hexahedra.iter().map(|e| [e[0], e[1], e[2], e[3]]).filter(|q| !heads.contains(q));
    let area = |q: [u32; 4]| {
        let [a, b, c, d] = q.map(|n| mesh.nodes[n as usize]);
        0.5 * (c - a).cross(&(d - b)).norm()
    };
    feet.map(area).sum()
}

#[test]
fn regions_of_a_knee_add_up_to_its_cartilages() {
    let (knee, out) = (one_knee::specimen(), TempDir::new().unwrap());
    let rows = quantities(knee, out.path());
    let whole = json(&knee.join("build/04-cartilage/metrics.json"));
    for cartilage in ["femur", "tibia_medial", "tibia_lateral"] {
        let of = |quantity: &str, unit: &str| -> Vec<f64> {
            let own = rows.iter().filter(|r| {
                r[0] == "hexmesh" && r[1] == quantity && r[2].starts_with(&format!("{cartilage}_")) && r[4] == unit
            });
            own.map(|r| r[3].parse().unwrap()).collect()
        };
        let (areas, means) = (of("area_bony_mm2", "mm2"), of("thickness_mean_mm", "mm"));
        let deviations = of("thickness_sd_mm", "mm");
        assert_eq!([areas.len(), means.len(), deviations.len()], [5; 3], "{cartilage}");
        let area: f64 = areas.iter().sum();
        let meshed = bony_area(&knee.join(format!("build/07-hexmesh/{cartilage}.vtu")));
        assert!((area - meshed).abs() < 1e-6 * meshed, "{cartilage}: {area} of {meshed} mm2");
        // the rim that is too thin for elements is missing, and with it the thinnest
        let solid = |name: &str| whole[cartilage][name].as_f64().unwrap();
        let share = area / solid("area_bony_mm2");
        assert!((0.85..1.0).contains(&share), "{cartilage}: {share}");
        let mean = areas.iter().zip(&means).map(|(a, m)| a * m).sum::<f64>() / area;
        let off = mean - solid("thickness_mean_mm");
        assert!((0.0..0.25).contains(&off), "{cartilage}: {mean} mm, {off} more than the solid's");
    }
    let page = text(&out.path().join("cohort.html"));
    assert!(page.contains("hexmesh: thickness_mean_mm of femur by region"));
    assert!(!page.contains("thickness_sd_mm"), "the tables have it, and the page would have fifteen charts more");
}

#[test]
fn menisci_are_figures_of_a_knee_where_they_act() {
    let (knee, out) = (one_knee::specimen(), TempDir::new().unwrap());
    let build = out.path().join("knee/build");
    std::fs::create_dir_all(&build).unwrap();
    let menisci = serde_json::json!([
        {"name": "meniscus_medial", "coverage": 0.44, "extrusion_mm": 1.25},
        {"name": "meniscus_lateral", "coverage": 0.53}
    ]);
    let changed = |line: &str| {
        let mut record: Value = serde_json::from_str(line).unwrap();
        if record["stage"] == "assemble" {
            record["metrics"]["menisci"] = menisci.clone();
        }
        format!("{record}\n")
    };
    let log = text(&knee.join("build/log.jsonl"));
    write(&build.join("log.jsonl"), log.lines().map(changed).collect::<String>());
    let rows = quantities(&out.path().join("knee"), &out.path().join("cohort"));
    let own: Vec<String> = rows.iter().filter(|r| r[0] == "assemble").map(|r| r[1..].join(",")).collect();
    let wanted =
        ["extrusion_mm,meniscus_medial,1.25,mm", "coverage,meniscus_medial,0.44,-", "coverage,meniscus_lateral,0.53,-"];
    assert_eq!(own, wanted);
    // a knee without menisci has none of it, and a build without its meshes has no regions
    let before = quantities(knee, &out.path().join("before"));
    assert!(before.iter().all(|r| r[0] != "assemble"));
    assert!(rows.iter().all(|r| r[1] != "thickness_sd_mm") && before.iter().any(|r| r[1] == "thickness_sd_mm"));
}

/// What the tests say of one number: its value where it was measured.
const LCL: (&str, f64) = ("LCL.reference_strain", 0.97);

/// The samples of the built knee.
fn samples(build: &Path) -> Samples {
    serde_json::from_slice(&read(&build.join("10-calibrate/joint/samples.json"))).unwrap()
}

/// A build of another name in `folder`, with what a later verb reads of it; its data say that the LCL's strain is that of [`LCL`].
fn like_it(knee: &Path, folder: &Path, id: &str) -> PathBuf {
    let place = folder.join(id);
    let from = knee.join("build");
    let joint = place.join("build/10-calibrate/joint");
    std::fs::create_dir_all(&joint).unwrap();
    for file in ["run.toml", "log.jsonl", "10-calibrate/joint/model.json"] {
        write(&place.join("build").join(file), read(&from.join(file)));
    }
    let mut all = samples(&from);
    all.counted_from.id = id.into();
    for u in all.of.unknowns.iter_mut().filter(|u| u.name == LCL.0) {
        let count = u.samples.len() as f64;
        u.samples.iter_mut().enumerate().for_each(|(k, x)| *x = LCL.1 + 0.002 * (k as f64 / count - 0.5));
    }
    write(&joint.join("samples.json"), serde_json::to_vec(&all).unwrap());
    place
}

/// `cohort infer` of these.
fn infer(builds: &[&Path], out: &Path) -> Command {
    let mut command = build_model();
    command.args(["cohort", "infer"]).args(builds).arg("--out").arg(out);
    command
}

#[test]
fn knees_are_told_what_the_others_measured_and_not_what_they_did() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let [a, b, c] = ["A", "B", "C"].map(|id| like_it(knee, folder.path(), id));
    let out = folder.path().join("shared");
    let run = infer(&[&a, &b, &c], &out).arg("--json").assert().success();
    let told: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let schema: Value = serde_json::from_str(&genu::schema::schema("cohort-infer").unwrap()).unwrap();
    obeys(&told, &schema, &schema).unwrap();
    let side = json(&a.join("build/10-calibrate/joint/model.json"))["side"].as_str().unwrap().to_owned();
    for (k, id) in ["A", "B", "C"].into_iter().enumerate() {
        let prior: Shared = serde_json::from_slice(&read(&out.join(format!("shared_prior_{id}.json")))).unwrap();
        let own = format!("{id} {side}");
        assert_eq!(
            (prior.knee.as_deref(), prior.from.len(), prior.from.contains(&own)),
            (Some(own.as_str()), 2, false)
        );
        let lcl = prior.numbers.iter().find(|n| n.name == LCL.0).expect("the others measured it");
        let off = |values: [f64; 3]| (values[1] - LCL.1).abs();
        assert!(
            off(lcl.after) < off(lcl.before) && lcl.after[2] - lcl.after[0] < lcl.before[2] - lcl.before[0],
            "{lcl:?}"
        );
        assert_eq!(
            told["knees"][k]["prior"]["file"].as_str().map(Path::new),
            Some(&*out.join(format!("shared_prior_{id}.json")))
        );
    }
    let another: Shared = serde_json::from_slice(&read(&out.join("shared_prior.json"))).unwrap();
    assert_eq!((another.knee, another.from.len()), (None, 3));
    let table = text(&out.join("infer.csv"));
    for (name, others) in [("A", 2), ("B", 2), ("C", 2), ("", 3)] {
        let line = format!("{name},{},{others},", LCL.0);
        assert!(table.lines().any(|l| l.starts_with(&line)), "{line} {table}");
        let own = table.lines().skip(1).map(|l| l.split(',').collect::<Vec<_>>()).filter(|l| l[0] == name);
        for row in own {
            let informed: usize = row[2].parse().unwrap();
            assert!((1..=others).contains(&informed), "{row:?}");
        }
    }
    // another order of the knees is the same prior, all but rounding
    let turned = folder.path().join("turned");
    infer(&[&c, &a, &b], &turned).assert().success();
    let mean = |out: &Path| {
        let prior: Shared = serde_json::from_slice(&read(&out.join("shared_prior_B.json"))).unwrap();
        prior.numbers.iter().find(|n| n.name == LCL.0).unwrap().mean
    };
    assert!((mean(&out) - mean(&turned)).abs() < 1e-9);
}

/// A build of [`like_it`] with its side, another id, and another digest of its surfaces where `other_files`.
fn with_side(knee: &Path, folder: &Path, (id, side): (&str, &str), other_files: bool) -> PathBuf {
    let place = like_it(knee, folder, id);
    let mut identity = json(&knee.join("build/01-ingest/identity.json"));
    identity["side"] = side.into();
    std::fs::create_dir_all(place.join("build/01-ingest")).unwrap();
    write(&place.join("build/01-ingest/identity.json"), identity.to_string());
    let mut run: toml::Table = text(&place.join("build/run.toml")).parse().unwrap();
    run["specimen"].as_table_mut().unwrap().insert("id".into(), id.into());
    if other_files {
        let inputs = run["inputs"].as_table_mut().unwrap();
        inputs.iter_mut().for_each(|(name, digest)| *digest = format!("{id} {name}").into());
    }
    write(&place.join("build/run.toml"), run.to_string());
    place
}

/// Why builds are not independent, as `cohort --json` says it.
fn dependent_of(builds: &[&Path], out: &Path) -> Vec<Value> {
    let run = build_model().arg("cohort").args(builds).arg("--out").arg(out).arg("--json").assert().success();
    let told: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let schema: Value = serde_json::from_str(&genu::schema::schema("cohort").unwrap()).unwrap();
    obeys(&told, &schema, &schema).unwrap();
    told["dependent"].as_array().unwrap().clone()
}

#[test]
fn one_knee_that_is_given_twice_and_one_with_a_shared_prior_are_told() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let build = |within: &str, named: (&str, &str), other_files: bool| {
        with_side(knee, &folder.path().join(within), named, other_files)
    };
    let told = |builds: [&Path; 2], out: &str| {
        let out = folder.path().join(out);
        let run = build_model().arg("cohort").args(builds).arg("--out").arg(&out).assert().success();
        let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
        assert_eq!(printed.contains("not independent: "), text(&out.join("cohort.html")).contains("id=\"dependent\""));
        let said: Vec<&str> = printed.lines().filter_map(|line| line.strip_prefix("not independent: ")).collect();
        let dependent = dependent_of(&builds, &out.with_extension("json"));
        assert_eq!(said, dependent.iter().map(|d| d["message"].as_str().unwrap()).collect::<Vec<_>>());
        (printed, dependent)
    };
    let a = build("one", ("A", "left"), false);
    // one id and side, of other files
    let (printed, dependent) = told([&a, &build("two", ("A", "left"), true)], "of_id");
    assert!(printed.contains("one/A and two/A are one knee: both are A left."), "{printed}");
    assert_eq!((&dependent[0]["kind"], &dependent[0]["knees"]), (&"one_knee".into(), &vec!["one/A", "two/A"].into()));
    assert_eq!((dependent.len(), &dependent[0]["shared_prior"]), (1, &Value::Null));
    // another id, of the same files
    let b = build("one", ("B", "left"), false);
    let (printed, _) = told([&a, &b], "of_files");
    assert!(printed.contains("A and B are one knee: both are left knees of one file, "), "{printed}");
    // both knees of one picture, both knees of one person, and two that have nothing in common
    for (k, (named, other_files)) in
        [(("C", "right"), false), (("A", "right"), true), (("D", "left"), true)].into_iter().enumerate()
    {
        let (printed, _) = told([&a, &build("three", named, other_files)], &format!("apart_{k}"));
        assert!(!printed.contains("not independent"), "{named:?}: {printed}");
    }
    // the same two, one with a prior that other knees gave
    let d = folder.path().join("three/D");
    let file = d.join("build/10-calibrate/joint/model.json");
    let mut model = json(&file);
    let prior = serde_json::json!({"file": "prior.json", "digest": "ab", "from": ["other left"], "numbers": 2});
    model["calibrated"]["shared_prior"] = prior.clone();
    write(&file, model.to_string());
    let (printed, dependent) = told([&a, &d], "shared");
    assert_eq!((&dependent[0]["kind"], &dependent[0]["knees"]), (&"shared_prior".into(), &vec!["D"].into()));
    assert_eq!(dependent[0]["shared_prior"], prior);
    assert!(
        printed.contains(&format!("not independent: D: {DEPENDENT}")) && !printed.contains("one knee"),
        "{printed}"
    );
    let table = text(&folder.path().join("shared/knees.csv"));
    // the build's folder is the last column
    let of: Vec<&str> = table.lines().map(|line| line.rsplit(',').nth(1).unwrap()).collect();
    assert_eq!(of, ["shared_prior", "", "prior.json"]);
}

#[test]
fn an_export_says_in_its_head_and_beside_it_whose_data_are_in_the_models_prior() {
    let folder = TempDir::new().unwrap();
    let knee = folder.path().join("knee");
    copy(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/knee"), &knee);
    let file = knee.join("model.json");
    for (numbers, is_told) in [(2, true), (0, false)] {
        let mut model = json(&file);
        model["calibrated"] = serde_json::json!({"to": ["kla"], "from": "ab", "shared_prior":
            {"file": "prior.json", "digest": "cd", "from": ["other left"], "numbers": numbers}});
        write(&file, model.to_string());
        for (format, main, comment) in
            [("abaqus", ".inp", "** "), ("opensim", "model.osim", "<!-- "), ("stl", ".stl", "")]
        {
            let out = folder.path().join(format!("{format}_{numbers}"));
            let mut command = build_model();
            command.arg("export").arg(&file).args(["--format", format, "--out"]).arg(&out).assert().success();
            let said = json(&out.join("model.source.json"))["not_independent"].clone();
            let words = said.as_str().unwrap_or_default();
            assert_eq!((words.contains("prior.json: other left"), said.is_null()), (is_told, !is_told), "{said}");
            let files = crate::common::files(&out);
            let heads: Vec<String> = files
                .iter()
                .filter(|(name, _)| !comment.is_empty() && name.ends_with(main))
                .map(|(_, bytes)| String::from_utf8_lossy(bytes).lines().take(3).collect::<Vec<_>>().join("\n"))
                .collect();
            assert_eq!(heads.is_empty(), comment.is_empty(), "{format}");
            let line = format!("{comment}The prior of 2 numbers is what 1 other knee says");
            assert!(heads.iter().all(|head| head.contains(&line) == is_told), "{heads:?}");
        }
    }
}

#[test]
fn knees_that_cannot_share_are_refused_with_what_to_do() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let [a, b] = ["A", "B"].map(|id| like_it(knee, folder.path(), id));
    let refused = |builds: &[&Path], status: i32| {
        let run = infer(builds, &folder.path().join("out")).assert().code(status);
        String::from_utf8(run.get_output().stderr.clone()).unwrap()
    };
    assert!(refused(&[&a], 2).contains("two or more"));
    assert!(refused(&[&a, &a.join("build")], 1).contains("each knee once"));
    assert!(refused(&[&a, folder.path()], 1).contains("model"));
    let run = b.join("build/run.toml");
    let usual = text(&run);
    write(&run, usual.replace("turn_deg = 1.5", "turn_deg = 0.5"));
    let told = refused(&[&a, &b], 1);
    assert!(
        told.contains("calibrate.frames.offset_turn_deg") && told.contains("the same options of all knees"),
        "{told}"
    );
    // one with data of others in it
    let shared = Shared { schema: SCHEMA.into(), knee: None, from: vec!["C left".into()], file: None, numbers: vec![] };
    let mut options: toml::Table = usual.parse().unwrap();
    let calibrate = options["options"]["calibrate"].as_table_mut().unwrap();
    calibrate.insert("shared_prior".into(), String::from(SharedPrior::Read(Box::new(shared))).into());
    write(&run, options.to_string());
    assert!(refused(&[&a, &b], 1).contains("calibrate.shared_prior"));
    // and one of a version that did not keep what was known before
    write(&run, &usual);
    let mut old = json(&b.join("build/10-calibrate/joint/samples.json"));
    for u in old["unknowns"].as_array_mut().unwrap() {
        u.as_object_mut().unwrap().remove("before");
    }
    write(&b.join("build/10-calibrate/joint/samples.json"), old.to_string());
    assert!(refused(&[&a, &b], 1).contains("build it again"));
}

#[test]
fn of_a_pair_each_is_told_as_many_numbers_as_the_other_says_by_itself() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let [a, b] = ["A", "B"].map(|id| like_it(knee, folder.path(), id));
    // B is as it was measured, so that its data say something else
    let mut own = samples(&knee.join("build"));
    own.counted_from.id = "B".into();
    write(&b.join("build/10-calibrate/joint/samples.json"), serde_json::to_vec(&own).unwrap());
    let run = infer(&[&a, &b], &folder.path().join("out")).arg("--json").assert().success();
    let told: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    let of = |k: usize| &told["knees"][k];
    for (k, other) in [(0, 1), (1, 0)] {
        let numbers = of(k)["prior"]["numbers"].as_array().unwrap().len() as u64;
        assert_eq!(of(other)["informed"].as_u64(), Some(numbers), "{k}");
    }
}

#[test]
fn the_next_command_has_the_options_of_the_build_and_a_model_is_called_by_its_id() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let [a, b] = ["A", "B"].map(|id| like_it(knee, folder.path(), id));
    let changed = |place: &Path, friction: f64| {
        let file = place.join("build/run.toml");
        let mut run: toml::Table = text(&file).parse().unwrap();
        let assemble = run["options"]["assemble"].as_table_mut().unwrap();
        assemble.insert("friction".into(), friction.into());
        assemble.insert("patella".into(), "on".into());
        write(&file, run.to_string());
        write(&place.join("specimen.toml"), read(&knee.join("specimen.toml")));
    };
    let out = folder.path().join("out");
    changed(&a, 0.01);
    changed(&b, 0.02);
    let run = infer(&[&a, &b], &out).assert().code(1);
    let told = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    assert!(told.contains("assemble.friction is 0.02, and 0.01"), "{told}");
    changed(&b, 0.01);
    let run = infer(&[&a, &b], &out).arg("--json").assert().success();
    let told: Value = serde_json::from_slice(&run.get_output().stdout).unwrap();
    for k in 0..2 {
        let next = told["knees"][k]["next"].as_str().expect("its specimen lies around its build");
        for set in ["assemble.friction=0.01", "assemble.patella=on", "calibrate.shared_prior="] {
            assert!(next.contains(&format!(" --set {set}")), "{next}");
        }
    }
    let models = [&a, &b].map(|place| place.join("build/10-calibrate/joint/model.json"));
    let by_model = folder.path().join("by_model");
    infer(&[&models[0], &models[1]], &by_model).assert().success();
    for id in ["A", "B"] {
        let name = format!("shared_prior_{id}.json");
        assert_eq!(read(&by_model.join(&name)), read(&out.join(&name)));
    }
    // both knees of one person
    let both = ["left", "right"].map(|side| {
        let place = like_it(knee, &folder.path().join(side), "A");
        let joint = place.join("build/10-calibrate/joint");
        let mut own = json(&joint.join("samples.json"));
        own["counted_from"]["side"] = side.into();
        write(&joint.join("samples.json"), own.to_string());
        joint.join("model.json")
    });
    let of_both = folder.path().join("both");
    infer(&[&both[0], &both[1]], &of_both).assert().success();
    assert!(["left", "right"].iter().all(|side| of_both.join(format!("shared_prior_A_{side}.json")).exists()));
}

#[test]
fn a_prior_of_another_knee_stops_a_build_at_its_start_and_a_search_that_is_kept_outlives_a_refusal() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let other = Some("another left".to_owned());
    let shared =
        Shared { schema: SCHEMA.into(), knee: other, from: vec!["other left".into()], file: None, numbers: vec![] };
    let file = folder.path().join("prior.json");
    write(&file, serde_json::to_vec(&shared).unwrap());
    let set = format!("calibrate.shared_prior={}", file.display());
    let (out, kla, rks) = (folder.path().join("out"), knee.join("laxity/kla.csv"), knee.join("laxity/rks.csv"));
    let refused = |command: &mut Command| {
        let run = command.assert().code(1);
        String::from_utf8(run.get_output().stderr.clone()).unwrap()
    };
    let calibrate = || {
        let mut command = build_model();
        command.args(["calibrate", "--as-assembled"]).arg(knee).arg("--targets").arg(&kla).arg("--out").arg(&out);
        command
    };
    // a plan runs no stage: what it refuses is refused before all of them
    let told =
        [refused(build_model().arg(knee).args(["--plan", "--set", &set])), refused(calibrate().args(["--set", &set]))];
    for told in told {
        assert!(told.contains("calibrate.shared_prior: ") && told.contains("it is for another left"), "{told}");
    }
    // a recipe takes one data set
    let kept = out.join("checkpoint.cbor");
    std::fs::create_dir_all(&out).unwrap();
    write(&kept, "a search");
    let told = refused(calibrate().arg("--targets").arg(&rks).args(["--method", "swarm-simplex", "--anew"]));
    assert!(told.contains("one data set"), "{told}");
    assert_eq!(read(&kept), b"a search");
}

/// A prior that says of the knee what [`LCL`] has, and tells of one number that no knee has.
fn made_prior(knee: &Path) -> Shared {
    let evidence = Evidence::of(&samples(&knee.join("build")), &CalibrateOptions::default()).unwrap();
    let own = &evidence.numbers.iter().find(|p| p.name == LCL.0).unwrap().prior;
    let (mean, sd) = (own.z_of(LCL.1), 0.02);
    let line = |name: &str, before: [f64; 3]| SharedNumber { name: name.into(), mean, sd, before, after: before };
    let before = [-1.0, 0.0, 1.0].map(|z| own.at(z).0);
    let numbers = vec![line(LCL.0, before), line("XCL.reference_strain", before)];
    Shared { schema: SCHEMA.into(), knee: None, from: vec!["other left".into()], file: None, numbers }
}

/// Settings of a rough calibration that ends soon.
const QUICK: [&str; 4] = ["inference.starts=1", "inference.finalists=1", "inference.rounds=1", "inference.samples=12"];

/// Why credibility.json grades the ligament parameters that the data settle as it does.
fn why_determined(credibility: &Value) -> String {
    let factors = credibility["factors"].as_array().unwrap();
    let mut evidence = factors.iter().flat_map(|f| f["evidence"].as_array().unwrap());
    let row = evidence.find(|e| e["id"] == "parameters-determined").unwrap();
    row["why"].as_str().unwrap().to_owned()
}

/// What a reader is told of a model that this prior is in.
const DEPENDENT: &str = "The prior of 2 numbers is what 1 other knee says (prior.json: other left), so the result is not independent of that knee.";

#[test]
fn a_calibration_takes_the_shared_prior_up_and_its_content_is_in_the_key_of_the_stage() {
    let (knee, folder) = (one_knee::specimen(), TempDir::new().unwrap());
    let file = folder.path().join("prior.json");
    write(&file, serde_json::to_vec(&made_prior(knee)).unwrap());
    let set = |command: &mut Command, more: bool| {
        let more = more.then(|| format!("shared_prior={}", file.display()));
        for one in QUICK.iter().map(|s| (*s).to_owned()).chain(more) {
            command.args(["--set", &format!("calibrate.{one}")]);
        }
    };
    let plan = |more: bool| {
        let mut command = build_model();
        set(command.arg(knee).args(["--plan", "--to", "calibrate"]), more);
        String::from_utf8(command.assert().success().get_output().stdout.clone()).unwrap()
    };
    let of_stage = |plan: String| plan.lines().find(|l| l.starts_with("calibrate")).unwrap().to_owned();
    assert!(of_stage(plan(false)).contains("unchanged") && of_stage(plan(true)).contains("would run"));
    let out = folder.path().join("out");
    let mut command = build_model();
    command.args(["calibrate", "--as-assembled"]).arg(knee).arg("--targets").arg(knee.join("laxity/kla.csv"));
    set(command.arg("--anew").arg("--out").arg(&out), true);
    // another search was kept there: it is not taken up, and is gone at the end
    std::fs::create_dir_all(&out).unwrap();
    write(&out.join("checkpoint.cbor"), "another search");
    let run = command.assert().success();
    assert!(!out.join("checkpoint.cbor").exists());
    let warned = String::from_utf8(run.get_output().stderr.clone()).unwrap();
    let unused =
        warned.lines().find(|l| l.contains("of the shared prior are not used")).unwrap_or_else(|| panic!("{warned}"));
    assert!(unused.contains("1 of 2") && unused.contains("XCL.reference_strain"), "{unused}");
    let found: Samples = serde_json::from_slice(&read(&out.join("samples.json"))).unwrap();
    let lcl = found.of.unknowns.iter().find(|u| u.name == LCL.0).unwrap();
    assert!(lcl.samples.iter().chain(&lcl.before).all(|x| (x - LCL.1).abs() < 0.02), "{lcl:?}");
    let model = json(&out.join("model.json"));
    let prior = &model["calibrated"]["shared_prior"];
    assert_eq!((prior["file"].as_str(), prior["numbers"].as_u64()), (Some("prior.json"), Some(2)));
    assert_eq!(prior["from"], serde_json::json!(["other left"]));
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(printed.contains(DEPENDENT), "{printed}");
}

#[test]
fn a_build_with_a_shared_prior_says_on_every_page_that_it_is_not_independent() {
    let folder = TempDir::new().unwrap();
    let (knee, file) = (folder.path().join("knee"), folder.path().join("prior.json"));
    copy(one_knee::specimen(), &knee);
    write(&file, serde_json::to_vec(&made_prior(&knee)).unwrap());
    let mut command = build_model();
    command.arg(&knee);
    let shared = format!("shared_prior={}", file.display());
    for set in QUICK.into_iter().chain([shared.as_str()]) {
        command.args(["--set", &format!("calibrate.{set}")]);
    }
    let run = command.assert().success();
    let printed = String::from_utf8(run.get_output().stdout.clone()).unwrap();
    assert!(printed.contains(DEPENDENT), "{printed}");
    build_model().arg("credibility").arg(&knee).arg("--quiet").assert().success();
    let build = knee.join("build");
    for model in ["joint", "kla", "rks"] {
        let model = json(&build.join(format!("10-calibrate/{model}/model.json")));
        assert_eq!(model["calibrated"]["shared_prior"]["from"], serde_json::json!(["other left"]));
    }
    let credibility = json(&build.join("credibility.json"));
    let prior = &credibility["shared_prior"];
    assert_eq!((prior["file"].as_str(), prior["numbers"].as_u64()), (Some("prior.json"), Some(2)), "{prior}");
    assert!(why_determined(&credibility).contains("what other knees say"), "{credibility}");
    for page in ["report.html", "methods.md", "credibility.html"] {
        assert!(text(&build.join(page)).contains(DEPENDENT), "{page}");
    }
    // on the report's first screen, before any stage
    let report = text(&build.join("report.html"));
    let (first, _) = report.split_once("<main").unwrap();
    assert!(first.contains(DEPENDENT) && first.contains("on what other knees say"), "{first}");
    // and a knee that had none says nothing
    let own = text(&one_knee::specimen().join("build/report.html"));
    assert!(!own.contains("id=\"shared-prior\""));
}

//! Scans in pieces, a scan with the capsule on, a patella: read, laid on their bones, carried into the model.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

use crate::common::{build_model, json, phantom, read, text, write};
use formats::{ply, read_surface, stl};
use meshes::query::SurfaceQuery;
use meshes::shapes::icosphere;
use meshes::surface::{ColouredMesh, TriMesh};
use meshes::{Isometry, Point, Vector};
use std::path::Path;

fn scan(folder: &Path, name: &str) -> ColouredMesh {
    read_surface(name, &read(&folder.join(name)), &Default::default()).unwrap()
}

fn put(folder: &Path, name: &str, scan: &ColouredMesh) {
    let mut bytes = Vec::new();
    ply::write_coloured(&mut bytes, scan).unwrap();
    write(&folder.join(name), bytes);
}

/// The part of a scan whose triangles have a corner for which `keep` holds, moved.
fn part(whole: &ColouredMesh, pose: &Isometry, keep: impl Fn(&Point) -> bool) -> ColouredMesh {
    let mesh = &whole.mesh;
    let (part, from) = mesh.submesh(|t| mesh.corners(t).iter().any(&keep));
    ColouredMesh { mesh: part.moved(pose), colours: from.iter().map(|&v| whole.colours[v as usize]).collect() }
}

fn change(folder: &Path, from: &str, to: &str) {
    let file = folder.join("specimen.toml");
    let changed = text(&file).replace(from, to);
    assert_ne!(changed, text(&file), "{from}");
    write(&file, changed);
}

fn pose() -> Isometry {
    Isometry::new(Vector::new(40.0, -25.0, 300.0), Vector::new(0.5, 1.1, -0.7))
}

#[test]
fn scans_that_overlap_become_the_one_they_were() {
    let folder = phantom("S192803-phantom");
    let whole = scan(folder.path(), "scans/femur.ply");
    let (low, high) = whole.mesh.bounds().unwrap();
    let wide = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap();
    let across = (0..3).find(|&k| k != wide).unwrap();
    let cut = f64::midpoint(low[across], high[across]);
    put(folder.path(), "scans/femur_a.ply", &part(&whole, &Isometry::identity(), |p| p[across] < cut + 8.0));
    put(folder.path(), "scans/femur_b.ply", &part(&whole, &pose(), |p| p[across] > cut - 8.0));
    change(folder.path(), "femur = \"scans/femur.ply\"", "femur = [\"scans/femur_a.ply\", \"scans/femur_b.ply\"]");
    build_model().arg(folder.path()).args(["--quiet", "--to", "ingest"]).assert().success();
    let merged = scan(&folder.path().join("build"), "01-ingest/scan_femur.ply");
    let figures = &json(&folder.path().join("build/01-ingest/metrics.json"))["scan_femur"]["merged"][0];
    let off = |from: &TriMesh, to: &TriMesh| {
        let query = SurfaceQuery::new(to).unwrap();
        from.vertices.iter().map(|p| query.nearest(p).distance).fold(0.0, f64::max)
    };
    let (out, back) = (off(&merged.mesh, &whole.mesh), off(&whole.mesh, &merged.mesh));
    let area = merged.mesh.area() / whole.mesh.area();
    println!("merged: {figures}; {out:.3} mm off, {back:.3} mm missing, {area:.4} of the area");
    assert!(out < 0.1 && back < 0.1, "{out:.3} mm off, {back:.3} mm missing");
    assert!((1.0..1.05).contains(&area), "{area}");
    assert!(figures["overlap_rms_mm"].as_f64().unwrap() < 0.1);
    assert_eq!(merged.colours.len(), merged.mesh.vertices.len());
    // Scans of two bones do not.
    change(folder.path(), "scans/femur_b.ply", "scans/tibfib.ply");
    let run = build_model().arg(folder.path()).args(["--quiet", "--to", "ingest"]).assert().code(1);
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(said.contains("scans/tibfib.ply") && said.contains("overlap"), "{said}");
}

/// The knee with its capsule on: both scans as they lie in CT, everything near the joint grown by soft tissue.
fn capsule(folder: &Path) -> TriMesh {
    let truth = json(&folder.join("truth/truth.json"));
    let bones = ["femur", "tibfib"].map(|bone| {
        let mesh = scan(folder, &format!("scans/{bone}.ply")).mesh;
        let m = |r: usize, c: usize| truth["scan_to_ct"][bone][r][c].as_f64().unwrap();
        let turn = nalgebra::Matrix3::from_fn(m);
        let shift = Vector::from_fn(|r, _| m(r, 3));
        TriMesh { vertices: mesh.vertices.iter().map(|p| Point::from(turn * p.coords + shift)).collect(), ..mesh }
    });
    let mut knee = TriMesh::joined(&bones);
    let read = |k: usize| truth["frames_ct"]["tibia"]["origin"][k].as_f64().unwrap();
    let joint = Point::new(read(0), read(1), read(2));
    let normals = knee.vertex_normals();
    for (p, n) in knee.vertices.iter_mut().zip(&normals) {
        let near = 1.0 - ((*p - joint).norm() / 50.0).clamp(0.0, 1.0);
        *p += n * (12.0 * near);
    }
    knee.moved(&pose())
}

#[test]
fn a_capsule_scan_checks_and_changes_nothing() {
    let folder = phantom("S192803-phantom");
    let to_register = |out: &str| {
        let out = folder.path().join(out);
        build_model()
            .arg(folder.path())
            .arg("--out")
            .arg(&out)
            .args(["--quiet", "--to", "register"])
            .assert()
            .success();
        (text(&out.join("02-register/transforms.json")), json(&out.join("02-register/metrics.json")))
    };
    let (without, _) = to_register("without");
    let mut bytes = Vec::new();
    stl::write(&mut bytes, &capsule(folder.path())).unwrap();
    write(&folder.path().join("scans/capsule.stl"), bytes);
    change(folder.path(), "[scans]\n", "[scans]\ncapsule = \"scans/capsule.stl\"\n");
    let (with, metrics) = to_register("with");
    println!("capsule: {}", metrics["capsule"]);
    assert_eq!(with, without);
    for bone in ["femur", "tibfib"] {
        let median = metrics["capsule"][bone]["median_to_scan_mm"].as_f64().unwrap();
        assert!(median < 0.1, "{bone}: {median}");
    }
}

/// A patella as CT shows it, before the trochlea, and its scan with cartilage on its back.
fn patella(folder: &Path) -> [TriMesh; 2] {
    let truth = json(&folder.join("truth/truth.json"));
    let read = |name: &str| Vector::from_fn(|k, _| truth["frames_ct"]["femur"][name][k].as_f64().unwrap());
    let (origin, forwards, across) = (read("origin"), read("anterior"), read("medial"));
    let shape = |cartilage: f64| {
        let mut mesh = icosphere(1.0, 5);
        for p in &mut mesh.vertices {
            // A point below, a ridge behind, a shoulder to one side: no symmetry to slip along.
            let (x, y, z) = (p.x, p.y, p.z);
            let back = (-y).max(0.0);
            let thick = 9.0 + 3.0 * back * (1.0 - x.abs()) + cartilage * back;
            *p = Point::new(
                21.0 * x * (1.0 + 0.1 * z) + 2.0 * back,
                thick * y + 1.5 * x * x,
                21.0 * z - 6.0 * (1.0 - x * x) * (-z).max(0.0).powi(3),
            );
        }
        mesh
    };
    let up = across.cross(&forwards);
    let turn = nalgebra::Matrix3::from_columns(&[across, forwards, up]);
    [0.0, 2.5].map(|cartilage| {
        let mut mesh = shape(cartilage);
        mesh.vertices.iter_mut().for_each(|p| *p = Point::from(origin + forwards * 45.0 + turn * p.coords));
        if mesh.volume() < 0.0 { mesh.flipped() } else { mesh }
    })
}

#[test]
fn a_patella_is_carried_along() {
    let folder = phantom("S192803-phantom");
    let [ct, scanned] = patella(folder.path());
    for (name, mesh) in [("ct/patella.stl", &ct), ("scans/patella.stl", &scanned.moved(&pose()))] {
        let mut bytes = Vec::new();
        stl::write(&mut bytes, mesh).unwrap();
        write(&folder.path().join(name), bytes);
    }
    change(folder.path(), "[ct]\n", "[ct]\npatella = \"ct/patella.stl\"\n");
    change(folder.path(), "[scans]\n", "[scans]\npatella = \"scans/patella.stl\"\n");
    build_model().arg(folder.path()).arg("--quiet").assert().success();
    let build = folder.path().join("build");
    // Its scan lies where it was.
    let found = &json(&build.join("02-register/transforms.json"))["patella"]["ct_from_scan"];
    let m = |r: usize, c: usize| found[r][c].as_f64().unwrap();
    let off = scanned
        .vertices
        .iter()
        .map(|p| {
            let q = pose() * p;
            let back = Vector::from_fn(|r, _| (0..3).map(|c| m(r, c) * q[c]).sum::<f64>() + m(r, 3));
            (back - p.coords).norm()
        })
        .fold(0.0, f64::max);
    println!("patella: its scan at most {off:.2} mm off");
    assert!(off < 0.8, "{off:.2} mm");
    // It is a body of the model, and nothing that is simulated knows it.
    let model = json(&build.join("09-assemble/model.json"));
    let names: Vec<&str> = model["bodies"].as_array().unwrap().iter().map(|b| b["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["femur", "tibia", "patella"]);
    let bone = scan(&build, "03-bones/patella.ply").mesh;
    assert!((bone.volume() / ct.volume() - 1.0).abs() < 0.02, "{}", bone.volume() / ct.volume());
    assert!(text(&build.join("report.html")).contains("bone patella"));
    for (format, file) in [("stl", "patella_bone.stl"), ("abaqus", ""), ("vtk", ""), ("febio", "")] {
        let out = folder.path().join(format);
        let path = build.join("09-assemble/model.json");
        build_model().arg("export").arg(path).args(["--format", format, "--out"]).arg(&out).assert().success();
        assert!(out.join(file).exists(), "{format}");
    }
    let results = folder.path().join("results.csv");
    let run = |model: &Path| {
        let run = ["--protocol", "passive-flexion", "--to-flexion", "10", "--out"];
        build_model().arg("simulate").arg(model).args(run).arg(&results).assert().success();
        // the last column names the model, whose digest is another
        text(&results).lines().map(|l| l.split(",\"").next().unwrap().to_owned() + "\n").collect::<String>()
    };
    let path = build.join("09-assemble/model.json");
    let with = run(&path);
    let mut less = model.clone();
    less["bodies"].as_array_mut().unwrap().pop();
    write(&path, serde_json::to_vec(&less).unwrap());
    assert_eq!(run(&path), with);
}

#[test]
fn a_table_that_cannot_be_read_stops_the_build_at_its_start() {
    let folder = phantom("S192803-phantom");
    write(&folder.path().join("kla.csv"), "trial,test\n1,sideways\n");
    change(folder.path(), "[points]\n", "[laxity]\nkla = \"kla.csv\"\n\n[points]\n");
    build_model().arg(folder.path()).assert().code(1).stderr(predicates::str::contains("kla.csv"));
    assert!(!folder.path().join("build/01-ingest").exists());
}

//! The main job on every specimen there is: each figure against the truth, at the limits of the main job.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests look at what a build left")]

use crate::common::{build_model, json, phantom, shared, text};
use meshes::surface::TriMesh;
use nalgebra::{Matrix4, Point3, Vector3};
use needs_shared::needs_shared;
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

const CARTILAGES: [(&str, &str, f64); 3] =
    [("femur", "femur", 0.06), ("tibia_medial", "tibfib_medial", 0.10), ("tibia_lateral", "tibfib_lateral", 0.10)];

fn matrix(rows: &Value) -> Matrix4<f64> {
    let x: Vec<f64> = rows.as_array().unwrap().iter().flat_map(numbers).collect();
    Matrix4::from_row_slice(&x)
}

fn numbers(list: &Value) -> Vec<f64> {
    list.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn vector(list: &Value) -> Vector3<f64> {
    Vector3::from_row_slice(&numbers(list))
}

fn mesh(path: &Path) -> TriMesh {
    let bytes = std::fs::read(path).unwrap();
    formats::read_surface(&path.to_string_lossy(), &bytes, &Default::default()).unwrap().mesh
}

/// Builds `specimen` and holds every figure against its truth.
fn built_right(specimen: &Path, femoral_axis_deg: f64, marked_mm: f64, literature_mm: f64) {
    let out = TempDir::new().unwrap();
    build_model().arg(specimen).arg("--out").arg(out.path()).args(["--to", "assemble", "--quiet"]).assert().success();
    let truth = json(&specimen.join("truth/truth.json"));
    registered(specimen, out.path(), &truth);
    cartilage(specimen, out.path(), &truth);
    frames(out.path(), &truth, femoral_axis_deg);
    sites(out.path(), &truth, marked_mm, literature_mm);
    hexahedra(out.path());
    model(out.path());
}

fn registered(specimen: &Path, out: &Path, truth: &Value) {
    let transforms = json(&out.join("02-register/transforms.json"));
    for bone in ["femur", "tibfib"] {
        let (found, right) = (matrix(&transforms[bone]["ct_from_scan"]), matrix(&truth["scan_to_ct"][bone]));
        let scan = mesh(&specimen.join(format!("scans/{bone}.ply")));
        let moved = |m: &Matrix4<f64>, p: &Point3<f64>| m.transform_point(p);
        let mean = scan.vertices.iter().map(|p| (moved(&found, p) - moved(&right, p)).norm()).sum::<f64>()
            / scan.vertices.len() as f64;
        let turn = found.fixed_view::<3, 3>(0, 0) * right.fixed_view::<3, 3>(0, 0).transpose();
        let degrees = ((turn.trace() - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees();
        assert!(mean <= 0.15 && degrees <= 0.25, "{bone}: registered {mean:.3} mm, {degrees:.3} deg from the truth");
    }
}

/// What a share of the surface's area lies below.
fn percentile_by_area(surface: &TriMesh, share: f64, figure: impl Fn(&Point3<f64>) -> f64) -> f64 {
    let mut of: Vec<(f64, f64)> = surface.vertices.iter().map(figure).zip(surface.vertex_areas()).collect();
    of.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = of.iter().map(|(_, area)| area).sum();
    let mut below = 0.0;
    of.iter()
        .find(|(_, area)| {
            below += area;
            below >= share * whole
        })
        .map_or(f64::INFINITY, |(x, _)| *x)
}

fn cartilage(specimen: &Path, out: &Path, truth: &Value) {
    let metrics = json(&out.join("04-cartilage/metrics.json"));
    for (name, true_name, limit) in CARTILAGES {
        let (found, right) = (
            mesh(&out.join(format!("04-cartilage/{name}.ply"))),
            mesh(&specimen.join(format!("truth/{true_name}.stl"))),
        );
        let topology = meshes::topology::Topology::of(&found);
        assert!(topology.is_closed(), "{name} is not closed");
        let volume = truth["cartilage_volume_mm3"][true_name].as_f64().unwrap();
        let off = (found.volume() / volume - 1.0).abs();
        assert!(off <= limit, "{name}: volume {:.1} % off", 100.0 * off);
        let reported = metrics[name]["volume_mm3"].as_f64().unwrap();
        assert!((reported / found.volume() - 1.0).abs() < 0.01);
        let query = meshes::query::SurfaceQuery::new(&found).unwrap();
        let p95 = percentile_by_area(&right, 0.95, |p| query.nearest(p).distance);
        assert!(p95 <= 0.6, "{name}: surface distance p95 {p95:.2} mm");
    }
}

fn frames(out: &Path, truth: &Value, femoral_axis_deg: f64) {
    let frames = json(&out.join("05-frames/frames.json"));
    let angle = |bone: &str, axis: &str| {
        let (a, b) = (vector(&frames[bone][axis]), vector(&truth["frames_ct"][bone][axis]));
        a.dot(&b).clamp(-1.0, 1.0).acos().to_degrees()
    };
    assert!(angle("femur", "medial") <= femoral_axis_deg, "femoral ML axis {:.2} deg off", angle("femur", "medial"));
    assert!(angle("femur", "superior") <= 10.0, "femoral SI axis {:.2} deg off", angle("femur", "superior"));
    assert!(angle("tibia", "medial") <= 10.0, "tibial ML axis {:.2} deg off", angle("tibia", "medial"));
    assert!(angle("tibia", "superior") <= 12.0, "tibial SI axis {:.2} deg off", angle("tibia", "superior"));
}

/// Literature sites lie within this of the truth in the mean [mm]. Seen: 8.04 and 8.07, with the capsule's sites beside the cartilage as the mean of bare
/// vertices; below 8 where the nearest vertex alone decided, which jumped by 3 mm as a frame turned by 0.1 deg.
const LITERATURE_MM: f64 = 8.5;

fn sites(out: &Path, truth: &Value, marked_mm: f64, literature_mm: f64) {
    let mut literature = Vec::new();
    let sites = json(&out.join("06-attachments/sites.json"));
    let sites = sites.as_array().unwrap();
    for (key, site) in truth["sites_ct"].as_object().unwrap() {
        let (ligament, bone) = key.split_once('@').unwrap();
        let found = sites.iter().find(|s| s["ligament"] == ligament && s["bone"] == bone);
        let found = found.unwrap_or_else(|| panic!("no site of {key}"));
        let error = (vector(&found["centroid"]) - vector(&site["centroid"])).norm();
        let marked = site["marked"].as_bool().unwrap();
        let limit = if marked { marked_mm } else { 15.0 };
        assert!(error <= limit, "{key}: {error:.2} mm off");
        assert_eq!(found["source"] == "marked", marked, "{key}");
        if !marked {
            literature.push(error);
        }
    }
    let mean = literature.iter().sum::<f64>() / literature.len() as f64;
    println!("literature sites: {mean:.2} mm off in the mean");
    assert!(mean <= literature_mm, "literature sites {mean:.2} mm off in the mean");
    let fibres = text(&out.join("06-attachments/fibres.csv"));
    let mut count = std::collections::BTreeMap::new();
    for line in fibres.lines().skip(1) {
        *count.entry(line.split(',').next().unwrap().to_string()).or_insert(0_usize) += 1;
    }
    for bundle in attachments::bundle::BUNDLES.iter() {
        assert_eq!(count.get(&bundle.name), Some(&bundle.fibres), "{}", bundle.name);
    }
}

fn hexahedra(out: &Path) {
    for stage in ["07-hexmesh", "08-overclosure"] {
        let metrics = json(&out.join(stage).join("metrics.json"));
        for (name, _, _) in CARTILAGES {
            let figure = |key: &str| metrics[name][key].as_f64().unwrap();
            assert!(figure("inverted") < 0.5, "{stage} {name}");
            assert!(figure("scaled_jacobian_min") >= 0.15, "{stage} {name} {}", figure("scaled_jacobian_min"));
            assert!(figure("scaled_jacobian_mean") >= 0.85, "{stage} {name} {}", figure("scaled_jacobian_mean"));
            let (least, most) = (figure("edge_min_mm"), figure("edge_max_mm"));
            assert!(least >= 0.4 && most <= 1.2, "{stage} {name}: edges {least:.2} to {most:.2} mm");
        }
    }
    let metrics = json(&out.join("08-overclosure/metrics.json"));
    assert!(metrics["gap_min_mm"].as_f64().unwrap() >= 0.0);
    let change = metrics["volume_change_mean"].as_f64().unwrap();
    assert!(change < 0.005, "elements changed by {:.2} % of their volume in the mean", 100.0 * change);
}

fn model(out: &Path) {
    let model = json(&out.join("09-assemble/model.json"));
    assert_eq!(model["bundles"].as_array().unwrap().len(), 14);
    assert_eq!(model["fibres"].as_array().unwrap().len(), 30);
    for pair in model["contact"]["pairs"].as_array().unwrap() {
        for side in ["femur", "tibia"] {
            assert!(out.join("09-assemble").join(pair[side].as_str().unwrap()).exists());
        }
    }
    let page = text(&out.join("report.html"));
    assert!(page.matches("data:image/png").count() >= 10 && page.len() < 15 << 20);
}

#[needs_shared]
fn s192803() {
    if let Some(specimen) = shared("s192803", "specimens/S192803") {
        built_right(&specimen, 5.0, 2.0, LITERATURE_MM);
    }
}

#[needs_shared]
fn s193761() {
    if let Some(specimen) = shared("s193761", "specimens/S193761") {
        built_right(&specimen, 5.0, 2.0, LITERATURE_MM);
    }
}

#[test]
fn phantoms() {
    for id in stages::phantom::PHANTOMS {
        built_right(phantom(id).path(), 5.0, 2.0, 10.0);
    }
}

#[needs_shared]
fn without_landmarks_and_marks() {
    for (name, path) in [("S192803", "specimens/S192803"), ("S193761", "specimens/S193761")] {
        let Some(specimen) = shared(name, path) else { continue };
        let bare = TempDir::new().unwrap();
        crate::common::copy(&specimen, bare.path());
        let toml = text(&specimen.join("specimen.toml"));
        let kept: Vec<&str> = toml.lines().filter(|l| !l.starts_with("landmarks") && !l.starts_with("marks")).collect();
        crate::common::write(&bare.path().join("specimen.toml"), kept.join("\n"));
        for file in ["landmarks.csv", "marks.csv"] {
            std::fs::remove_file(bare.path().join(file)).unwrap();
        }
        built_right(bare.path(), 5.0, 2.0, LITERATURE_MM);
    }
}

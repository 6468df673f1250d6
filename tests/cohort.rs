//! `cohort`: the figures of a knee that users of other programs look for in its tables.
#![allow(clippy::unwrap_used, reason = "tests")]
#![expect(clippy::disallowed_methods, reason = "tests prepare files")]

use crate::common::{build_model, json, read, text, write};
use crate::one_knee;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
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

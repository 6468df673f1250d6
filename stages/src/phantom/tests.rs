use super::*;
use crate::ingest::ingest;
use crate::specimen::{IngestOptions, PointFrame, RawSpecimen, Specimen};
use formats::stl;
use meshes::Point;
use meshes::query::SurfaceQuery;
use meshes::topology::Topology;
use std::collections::BTreeMap;

fn made(id: &str) -> (BTreeMap<String, Vec<u8>>, Specimen) {
    let files: BTreeMap<String, Vec<u8>> = phantom(id, 1).unwrap().files.into_iter().collect();
    let toml = String::from_utf8(files["specimen.toml"].clone()).unwrap();
    let specimen = ingest(&RawSpecimen { toml, files: files.clone() }, &IngestOptions::default()).unwrap();
    (files, specimen)
}

#[test]
fn an_unknown_phantom_is_refused_with_those_known() {
    assert!(phantom("S1", 1).unwrap_err().to_string().contains("expected one of S192803-phantom"));
}

#[test]
fn every_phantom_is_a_sound_specimen_with_the_truth_beside_it() {
    for id in PHANTOMS {
        let (files, specimen) = made(id);
        for (name, bone) in specimen.ct.named() {
            let topology = Topology::of(bone);
            assert!(topology.is_closed(), "{id} {name} {} {}", topology.boundary_edges, topology.irregular_edges);
            assert_eq!((topology.components, topology.euler_characteristic), (1, 2), "{id} {name}");
            assert!(bone.volume() > 0.0);
        }
        let truth: serde_json::Value = serde_json::from_slice(&files["truth/truth.json"]).unwrap();
        for name in ["femur", "tibfib_medial", "tibfib_lateral"] {
            let solid = stl::read(&files[&format!("truth/{name}.stl")]).unwrap();
            assert_eq!(Topology::of(&solid).boundary_edges, 0, "{id} {name}");
            let volume = truth["cartilage_volume_mm3"][name].as_f64().unwrap();
            assert!(volume > 800.0 && (solid.volume() / volume - 1.0).abs() < 1e-3, "{id} {name} {volume}");
        }
        scans_lie_on_their_bones(&specimen, &truth);
    }
}

/// The true pose brings the scan's bare bone onto the CT bone, within the noises; marks lie near their outlines.
fn scans_lie_on_their_bones(specimen: &Specimen, truth: &serde_json::Value) {
    for ((name, ct), (_, scan)) in specimen.ct.named().into_iter().zip(specimen.scans.named()) {
        let m: [[f64; 4]; 4] = serde_json::from_value(truth["scan_to_ct"][name].clone()).unwrap();
        let m = nalgebra::Matrix4::from_fn(|r, c| m[r][c]);
        let query = SurfaceQuery::new(ct).unwrap();
        let bare: Vec<f64> = (0..scan.colours.len())
            .filter(|&v| scan.colours[v][0].abs_diff(scan.colours[v][2]) > 30 && scan.colours[v][0] > 150)
            .map(|v| query.nearest(&m.transform_point(&scan.mesh.vertices[v])).distance)
            .collect();
        let rms = (bare.iter().map(|d| d * d).sum::<f64>() / bare.len() as f64).sqrt();
        assert!(bare.len() > 10_000 && (0.05..0.25).contains(&rms), "{name} {} {rms}", bare.len());
        let frame = if name == "femur" { PointFrame::ScanFemur } else { PointFrame::ScanTibfib };
        for mark in specimen.marks.iter().filter(|p| p.frame == frame) {
            let site = &truth["sites_ct"][format!("{}@{name}", mark.name)]["centroid"];
            let site: [f64; 3] = serde_json::from_value(site.clone()).unwrap();
            assert!((m.transform_point(&mark.point) - Point::from(site)).norm() < 4.0, "{}", mark.name);
            let dark = scan.mesh.vertices.iter().zip(&scan.colours);
            let ring = dark.filter(|(p, c)| (*p - mark.point).norm() < 12.0 && c.iter().all(|&x| x < 40)).count();
            assert!(ring > 30, "{} {name} {ring}", mark.name);
        }
    }
}

#[test]
fn the_same_seed_makes_the_same_bytes_and_another_seed_other_noise() {
    let one = phantom("right-phantom", 7).unwrap();
    assert_eq!(one, phantom("right-phantom", 7).unwrap());
    assert_ne!(one, phantom("right-phantom", 8).unwrap());
}
